//! The methods that are compared: rule, depth estimator and name.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, AverageRule, BlockLevel, Count, PaperRule, WindowRule};
use dtof_draw::palette::{self, Pen};
use dtof_link::AdaptiveBinning;

use dtof_engine::settings::Settings;

/// The rule that decides in one pixel, without its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rule {
    /// The paper's rule; its threshold is α.
    Paper,
    /// The same over the average of all bins.
    Average,
    /// A window of so many bins; its threshold is z.
    Window(u8),
}

impl Rule {
    /// The number of thresholds that are tried, from 0 in steps of 1/32.
    pub const THRESHOLDS: usize = 480;

    /// The threshold with this number.
    #[must_use]
    pub fn threshold(number: usize) -> f64 {
        number as f64 / 32.0
    }

    /// The rule in the types of the core.
    ///
    /// # Errors
    /// Fails if a window is too wide.
    pub fn with(self, threshold: f64, min_count: u16) -> anyhow::Result<AnyRule> {
        let minimum = Count::saturating(min_count.into());
        let alpha = || U8F8::saturating_from_num(threshold);
        Ok(match self {
            Self::Paper => PaperRule::new(alpha(), minimum).into(),
            Self::Average => AverageRule::new(alpha(), minimum).into(),
            Self::Window(width) => {
                let z = U4F12::saturating_from_num(threshold);
                WindowRule::new(width, z, minimum)?.into()
            }
        })
    }
}

/// How pixels report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Events, as soon as a peak stands clear.
    Events {
        /// The rule.
        rule: Rule,
        /// The number of levels of blocks.
        levels: u8,
        /// Whether half of the false alarms are spent near the last event.
        tracking: bool,
        /// Whether the rule weighs bins by the dead time of the TDC.
        weighs: bool,
        /// Whether photons of one laser cycle in one bin count once.
        once_per_bin: bool,
    },
    /// Readings of frames.
    Frames,
}

/// A method.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Its name in charts and tables.
    pub name: String,
    /// How pixels report.
    pub kind: Kind,
    /// Whether the depth is the centroid of three bins.
    pub centroid: bool,
    /// Its colour and mark in charts.
    pub pen: Pen,
}

impl Method {
    fn events(name: impl Into<String>, rule: Rule, pen: Pen) -> Self {
        Self {
            name: name.into(),
            kind: Kind::Events {
                rule,
                levels: 0,
                tracking: false,
                weighs: false,
                once_per_bin: false,
            },
            centroid: false,
            pen,
        }
    }

    /// All methods for a pulse of standard deviation `sigma` bins, in an array that has blocks of up to
    /// `most_levels` levels. With a dead time in `like`, or photons that count once per bin, the window is
    /// tried with it and without. Frames are the last.
    #[must_use]
    pub fn all(sigma: U8F8, most_levels: u8, like: &Settings) -> Vec<Self> {
        let width = WindowRule::width_for_pulse(sigma);
        let window = Rule::Window(width);
        let name = format!("window of {width}");
        let mut methods = vec![
            Self {
                centroid: true,
                ..Self::events("paper's rule, centroid", Rule::Paper, palette::PAPER)
            },
            Self::events("paper's rule", Rule::Paper, palette::alpha(2)),
            Self::events("average of all bins", Rule::Average, palette::AVERAGE),
            Self {
                centroid: true,
                ..Self::events(format!("{name}, centroid"), window, palette::window(2))
            },
            Self::events(name.clone(), window, palette::window(3)),
        ];
        let more = |name: &str, levels, tracking, pen| Self {
            kind: Kind::Events {
                rule: window,
                levels,
                tracking,
                weighs: false,
                once_per_bin: false,
            },
            ..Self::events(name, window, pen)
        };
        if like.dead_time > 0 {
            methods.push(Self {
                kind: Kind::Events {
                    rule: window,
                    levels: 0,
                    tracking: false,
                    weighs: true,
                    once_per_bin: false,
                },
                ..Self::events(format!("{name}, dead time"), window, palette::window(4))
            });
        }
        if like.once_per_bin {
            methods.push(Self {
                kind: Kind::Events {
                    rule: window,
                    levels: 0,
                    tracking: false,
                    weighs: false,
                    once_per_bin: true,
                },
                ..Self::events(format!("{name}, once per bin"), window, palette::window(6))
            });
        }
        methods.push(more("tracking", 0, true, palette::window(5)));
        if most_levels > 0 {
            methods.push(more("blocks of 2×2", 1, false, palette::window(7)));
        }
        if most_levels > 1 {
            methods.push(more("blocks of 4×4", 2, false, palette::alpha(8)));
            methods.push(more("tracking, blocks of 4×4", 2, true, palette::window(1)));
        }
        methods.push(Self {
            name: "frames".to_owned(),
            kind: Kind::Frames,
            centroid: false,
            pen: palette::frames(2000),
        });
        methods
    }

    /// Whether it reads frames.
    #[must_use]
    pub fn is_frames(&self) -> bool {
        self.kind == Kind::Frames
    }

    /// The rule, if it reports events.
    #[must_use]
    pub const fn rule(&self) -> Option<Rule> {
        match self.kind {
            Kind::Events { rule, .. } => Some(rule),
            Kind::Frames => None,
        }
    }

    /// The highest level of its blocks.
    #[must_use]
    pub fn levels(&self) -> BlockLevel {
        match self.kind {
            Kind::Events { levels, .. } => BlockLevel::saturating(levels),
            Kind::Frames => BlockLevel::PIXEL,
        }
    }

    /// Whether each pixel and each exposure decides alone, so that the bound applies.
    #[must_use]
    pub const fn is_single(&self) -> bool {
        !matches!(
            self.kind,
            Kind::Events { levels: 1.., .. } | Kind::Events { tracking: true, .. }
        )
    }

    /// Whether it weighs bins by the dead time of the TDC.
    #[must_use]
    pub const fn weighs(&self) -> bool {
        matches!(self.kind, Kind::Events { weighs: true, .. })
    }

    /// The settings `like`, with this method. `effort` is the minimum count of a peak, or the laser cycles
    /// of a frame.
    ///
    /// # Errors
    /// Fails if a window is too wide.
    pub fn settings(
        &self,
        like: &Settings,
        threshold: f64,
        effort: u16,
    ) -> anyhow::Result<Settings> {
        let settings = Settings {
            centroid: self.centroid,
            binning: None,
            neighbours: None,
            tracking: false,
            frame: None,
            dead_time: if self.weighs() { like.dead_time } else { 0 },
            once_per_bin: matches!(
                self.kind,
                Kind::Events {
                    once_per_bin: true,
                    ..
                }
            ),
            ..like.clone()
        };
        Ok(match self.kind {
            Kind::Frames => Settings {
                frame: Some(effort),
                ..settings
            },
            Kind::Events { rule, tracking, .. } => Settings {
                rule: rule.with(threshold, effort)?,
                binning: (self.levels() != BlockLevel::PIXEL).then(|| AdaptiveBinning {
                    levels: self.levels(),
                    patience: like
                        .binning
                        .map_or(AdaptiveBinning::PATIENCE, |binning| binning.patience),
                }),
                tracking,
                ..settings
            },
        })
    }
}
