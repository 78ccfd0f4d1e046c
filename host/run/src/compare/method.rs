//! The methods that are compared: rule, depth estimator and name.

use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, Count, DepthEstimator, Neighbours, PaperRule, WindowRule,
};
use dtof_draw::palette::{self, Pen};
use dtof_link::{AdaptiveBinning, Configuration};

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
    Events(Events),
    /// Readings of frames.
    Frames,
}

/// What decides about an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Events {
    /// The rule.
    pub rule: Rule,
    /// The number of levels of blocks.
    pub levels: u8,
    /// Laser cycles until a silent pixel counts in its block, if not those of the settings.
    pub patience: Option<u16>,
    /// The pixels around a pixel that confirm it.
    pub neighbours: Option<Neighbours>,
    /// Whether half of the false alarms are spent near the last event.
    pub tracking: bool,
    /// Whether the rule weighs bins by the dead time of the TDC.
    pub weighs: bool,
    /// Whether photons of one laser cycle in one bin count once.
    pub once_per_bin: bool,
}

impl Events {
    /// Each pixel and each exposure decides by itself.
    const fn alone(rule: Rule) -> Self {
        Self {
            rule,
            levels: 0,
            patience: None,
            neighbours: None,
            tracking: false,
            weighs: false,
            once_per_bin: false,
        }
    }
}

/// Blocks are also tried with so many laser cycles until a silent pixel counts in its block.
const SHORT_PATIENCE: u16 = 8;

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
    fn events(name: impl Into<String>, events: Events, pen: Pen) -> Self {
        Self {
            name: name.into(),
            kind: Kind::Events(events),
            centroid: false,
            pen,
        }
    }

    /// All methods for a pulse of standard deviation `sigma` bins, in an array that has blocks of up to
    /// `most_levels` levels, and `has_neighbours`. With a dead time in `like`, or photons that count once per
    /// bin, the window is tried with it and without. Frames are the last.
    #[must_use]
    pub fn all(sigma: U8F8, most_levels: u8, has_neighbours: bool, like: &Settings) -> Vec<Self> {
        let width = WindowRule::width_for_pulse(sigma);
        let window = Events::alone(Rule::Window(width));
        let name = format!("window of {width}");
        let paper = Events::alone(Rule::Paper);
        let average = Events::alone(Rule::Average);
        let mut methods = vec![
            Self {
                centroid: true,
                ..Self::events("paper's rule, centroid", paper, palette::PAPER)
            },
            Self::events("paper's rule", paper, palette::alpha(2)),
            Self::events("average of all bins", average, palette::AVERAGE),
            Self {
                centroid: true,
                ..Self::events(format!("{name}, centroid"), window, palette::window(2))
            },
            Self::events(name.clone(), window, palette::window(3)),
        ];
        let mut add = |name: &str, events, pen| methods.push(Self::events(name, events, pen));
        if like.dead_time() > 0 {
            let weighs = Events {
                weighs: true,
                ..window
            };
            add(&format!("{name}, dead time"), weighs, palette::window(4));
        }
        if like.configuration.once_per_bin {
            let once_per_bin = Events {
                once_per_bin: true,
                ..window
            };
            let name = format!("{name}, once per bin");
            add(&name, once_per_bin, palette::window(6));
        }
        let tracking = Events {
            tracking: true,
            ..window
        };
        add("tracking", tracking, palette::window(5));
        if has_neighbours {
            let neighbours = |neighbours| Events {
                neighbours: Some(neighbours),
                ..window
            };
            let (four, eight) = (neighbours(Neighbours::Four), neighbours(Neighbours::Eight));
            add("4 neighbours", four, palette::window(2));
            add("8 neighbours", eight, palette::window(3));
        }
        let blocks = |levels| Events { levels, ..window };
        if most_levels > 0 {
            add("blocks of 2×2", blocks(1), palette::window(7));
        }
        if most_levels > 1 {
            add("blocks of 4×4", blocks(2), palette::alpha(8));
        }
        if most_levels > 0 && patience_of(like) != SHORT_PATIENCE {
            let side = 1 << most_levels;
            let name = format!("blocks of {side}×{side}, patience {SHORT_PATIENCE}");
            let short = Events {
                patience: Some(SHORT_PATIENCE),
                ..blocks(most_levels)
            };
            add(&name, short, palette::window(1));
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

    /// How it decides about events, if it reports events.
    #[must_use]
    pub const fn decides(&self) -> Option<&Events> {
        match &self.kind {
            Kind::Events(events) => Some(events),
            Kind::Frames => None,
        }
    }

    /// The rule, if it reports events.
    #[must_use]
    pub fn rule(&self) -> Option<Rule> {
        self.decides().map(|events| events.rule)
    }

    /// The highest level of its blocks.
    #[must_use]
    pub fn levels(&self) -> BlockLevel {
        let levels = self.decides().map_or(0, |events| events.levels);
        BlockLevel::saturating(levels)
    }

    /// Whether every report is of one pixel.
    #[must_use]
    pub fn has_full_resolution(&self) -> bool {
        self.levels() == BlockLevel::PIXEL
    }

    /// The pixels around a pixel that confirm it.
    #[must_use]
    pub fn neighbours(&self) -> Option<Neighbours> {
        self.decides()?.neighbours
    }

    /// Whether each pixel and each exposure decides alone, so that the bound applies.
    #[must_use]
    pub fn is_single(&self) -> bool {
        let is_single = |events: &Events| !events.tracking && events.neighbours.is_none();
        self.has_full_resolution() && self.decides().is_none_or(is_single)
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
        let window = like.depth_window().filter(|_| !self.centroid);
        let configuration = Configuration {
            estimator: window.map_or(DepthEstimator::Centroid3, DepthEstimator::CentredWindow),
            binning: None,
            neighbours: None,
            tracking: false,
            dead_time: Some(0),
            once_per_bin: false,
            ..like.configuration
        };
        let (configuration, frame) = match self.kind {
            Kind::Frames => (configuration, Some(effort)),
            Kind::Events(events) => {
                let of_events = Configuration {
                    rule: events.rule.with(threshold, effort)?,
                    binning: (!self.has_full_resolution()).then(|| AdaptiveBinning {
                        levels: self.levels(),
                        patience: events.patience.unwrap_or_else(|| patience_of(like)),
                    }),
                    neighbours: events.neighbours,
                    tracking: events.tracking,
                    dead_time: Some(if events.weighs { like.dead_time() } else { 0 }),
                    once_per_bin: events.once_per_bin,
                    ..configuration
                };
                (of_events, None)
            }
        };
        Ok(Settings {
            configuration,
            frame,
            ..like.clone()
        })
    }
}

/// The patience of blocks in `settings`, or the default.
fn patience_of(settings: &Settings) -> u16 {
    let binning = settings.configuration.binning;
    binning.map_or(AdaptiveBinning::PATIENCE, |binning| binning.patience)
}
