//! The methods that are compared: what decides, what finds the depth, and what it is called.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{AnyRule, AverageRule, BlockLevel, Count, PaperRule, WindowRule};
use dtof_draw::palette::{self, Pen};
use dtof_link::AdaptiveBinning;

use dtof_engine::settings::Settings;

/// What decides in one pixel, without its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rule {
    /// The paper's; its threshold is α.
    Paper,
    /// The same over the average of all bins.
    Average,
    /// A window of so many bins; its threshold is z.
    Window(u8),
}

impl Rule {
    /// Thresholds run from 0 in steps of a 32nd; any rule can have so many.
    pub const THRESHOLDS: usize = 480;

    /// The threshold with a number.
    #[must_use]
    pub fn threshold(number: usize) -> f64 {
        number as f64 / 32.0
    }

    /// The core's rule.
    ///
    /// # Errors
    /// If a window is too wide.
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
        /// What decides.
        rule: Rule,
        /// Levels of blocks.
        levels: u8,
        /// Half of the false alarms near the last event.
        tracking: bool,
    },
    /// Readings of frames.
    Frames,
}

/// A method.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// What charts and tables call it.
    pub name: String,
    /// How pixels report.
    pub kind: Kind,
    /// The depth comes from three bins.
    pub centroid: bool,
    /// What it looks like in charts.
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
            },
            centroid: false,
            pen,
        }
    }

    /// All that suit a pulse of standard deviation `sigma` bins in an array that has blocks of
    /// so many levels. Frames are the last.
    #[must_use]
    pub fn all(sigma: U8F8, most_levels: u8) -> Vec<Self> {
        let suits = WindowRule::width_for_pulse(sigma);
        let window = Rule::Window(suits);
        let named = format!("window of {suits}");
        let mut methods = vec![
            Self {
                centroid: true,
                ..Self::events("paper's rule, centroid", Rule::Paper, palette::PAPER)
            },
            Self::events("paper's rule", Rule::Paper, palette::alpha(2)),
            Self::events("average of all bins", Rule::Average, palette::AVERAGE),
            Self {
                centroid: true,
                ..Self::events(format!("{named}, centroid"), window, palette::window(2))
            },
            Self::events(named, window, palette::window(3)),
        ];
        let more = |name: &str, levels, tracking, pen| Self {
            kind: Kind::Events {
                rule: window,
                levels,
                tracking,
            },
            ..Self::events(name, window, pen)
        };
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

    /// What decides, if it reports events.
    #[must_use]
    pub const fn rule(&self) -> Option<Rule> {
        match self.kind {
            Kind::Events { rule, .. } => Some(rule),
            Kind::Frames => None,
        }
    }

    /// Levels of its blocks.
    #[must_use]
    pub fn levels(&self) -> BlockLevel {
        match self.kind {
            Kind::Events { levels, .. } => BlockLevel::saturating(levels),
            Kind::Frames => BlockLevel::PIXEL,
        }
    }

    /// Whether it is one pixel by itself with every exposure for itself, which a bound binds.
    #[must_use]
    pub const fn is_single(&self) -> bool {
        !matches!(
            self.kind,
            Kind::Events { levels: 1.., .. } | Kind::Events { tracking: true, .. }
        )
    }

    /// `like` with this method. `effort` is the least photons of a peak, or the laser cycles of
    /// a frame.
    ///
    /// # Errors
    /// If a window is too wide.
    pub fn settings(
        &self,
        like: &Settings,
        threshold: f64,
        effort: u16,
    ) -> anyhow::Result<Settings> {
        let settings = Settings {
            centroid: self.centroid,
            binning: None,
            tracking: false,
            frame: None,
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
