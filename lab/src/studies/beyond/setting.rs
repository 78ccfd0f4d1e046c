//! The settings of pixels in these studies, from the parameters of a point, and their names in
//! tallies and charts.

use crate::sweep::{Point, PointTally, whole};
use anyhow::{Context, Result};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::rule::z_for_levels;
use dtof_core::{BlockLevel, Count, RangeGate, WindowRule, z_for};
use dtof_engine::settings::{AdaptiveBinning, Settings};

/// Bins of a histogram.
pub const BINS: usize = 128;
/// X, L1 and L2 in laser cycles.
pub const X: u16 = 4;
pub const L1: u16 = 40;
pub const L2: u16 = 1000;
/// Standard deviation of the pulse in bins.
pub const SIGMA: f64 = 1.0;
/// The limit: one pixel in this many is covered by a false report in L2 laser cycles.
pub const ONE_IN: u32 = 100;
/// Levels of blocks, as parameters of a point.
pub const LEVELS: [f64; 4] = [0.0, 1.0, 2.0, 3.0];

/// The features beyond a single pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Levels of blocks.
    pub levels: BlockLevel,
    /// Laser cycles.
    pub patience: u16,
    /// Whether pixels track their target.
    pub tracking: bool,
    /// The longest exposure.
    pub l2: u16,
}

impl Setting {
    /// Pixels alone.
    pub const ALONE: Self = Self {
        levels: BlockLevel::PIXEL,
        patience: 0,
        tracking: false,
        l2: L2,
    };

    /// From a point; features without a parameter are off.
    pub fn of(point: &Point) -> Result<Self> {
        let named = |name| point.contains_key(name).then(|| whole(point, name));
        Ok(Self {
            patience: named("patience").unwrap_or_default(),
            tracking: named("tracking").is_some_and(|tracking| tracking > 0),
            ..Self::ALONE.with_levels(point.get("levels").copied().unwrap_or_default())?
        })
    }

    /// With `levels` levels of blocks, 0 to 3.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 3"
    )]
    pub fn with_levels(self, levels: f64) -> Result<Self> {
        let levels = BlockLevel::new(levels as u8).context("a level from 0 to 3")?;
        Ok(Self { levels, ..self })
    }

    /// The z for these settings.
    pub fn z(&self) -> U4F12 {
        let gate = RangeGate::<BINS>::full();
        z_for_levels(ONE_IN, &gate, X, L1, self.l2, self.levels)
    }

    /// Settings of the engine with `z`.
    pub fn settings(&self, z: U4F12) -> Result<Settings> {
        let rule = WindowRule::new(3, z, Count::saturating(5))?;
        let settings = Settings::static_scene(0).for_pulse(U8F8::from_num(SIGMA));
        Ok(settings.configured(|array| {
            array.rule = rule.into();
            (array.x, array.l1, array.l2) = (X, L1, self.l2);
            array.binning = (self.levels != BlockLevel::PIXEL).then_some(AdaptiveBinning {
                levels: self.levels,
                patience: self.patience,
            });
            array.tracking = self.tracking;
        }))
    }
}

/// The window rule of these studies, at the same limit, for a pixel alone.
pub fn window_rule(l1: u16, l2: u16) -> Result<WindowRule> {
    let z = z_for(ONE_IN, &RangeGate::<BINS>::full(), X, l1, l2);
    Ok(WindowRule::new(3, z, Count::saturating(5))?)
}

/// Removes points without blocks except those with `patience`: the patience has no effect without
/// blocks.
pub fn with_one_patience_alone(mut points: Vec<Point>, patience: f64) -> Vec<Point> {
    points.retain(|point| point["levels"] > 0.0 || point["patience"] == patience);
    points
}

/// The counts of `what` of each level.
pub fn by_level(point: &PointTally, what: &str) -> [u64; 4] {
    [0, 1, 2, 3].map(|level| point.count(&format!("{what} {level}")))
}

/// The counts of right and wrong reports as cells of a table.
pub fn verdict_cells(point: &PointTally) -> String {
    let counts = ["right", "wrong"].map(|verdict| by_level(point, verdict));
    let cells: Vec<String> = counts.iter().flatten().map(u64::to_string).collect();
    cells.join(",")
}

/// The head of these cells.
pub const VERDICT_HEAD: &str = "right 0,right 1,right 2,right 3,wrong 0,wrong 1,wrong 2,wrong 3";

/// The name of pixels with this many levels of blocks in charts.
pub fn levels_name(levels: f64) -> String {
    match levels {
        0.0 => "pixels alone".to_owned(),
        1.0 => "1 level".to_owned(),
        _ => format!("{levels} levels"),
    }
}
