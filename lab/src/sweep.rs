//! Monte-Carlo sweeps: many trials at every point of a parameter grid, in parts that can be merged.
//!
//! A [`Study`] has points, and one trial for each point and seed. A trial depends only on these two
//! and returns integers, so tallies can be added in any order: a sweep that is split over machines
//! and merged equals a single run, bit for bit.
//!
//! ```text
//! Study, seeds   [`run`]
//!   → Part       a file: the seeds that are in it, and the tallies of every point
//!   → [`merge`]  parts of disjoint seeds as one
//! ```

pub mod charts;
pub mod mean;
mod part;
pub mod results;
mod run;
pub mod values;

use std::collections::BTreeMap;

use anyhow::Result;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;

use self::results::Results;

pub use self::part::{Part, PointTally, merge};
pub use self::run::{run, run_seeds};

/// The parameters of a point, by name.
pub type Point = BTreeMap<String, f64>;

/// Counts of a point, by name. Addition is exact.
pub type Tally = BTreeMap<String, u64>;

/// The trials of one seed at one point.
pub type Trial = fn(&Point, &mut Pcg64) -> Result<Tally>;

/// A Monte-Carlo study.
#[derive(Clone, Copy)]
pub struct Study {
    /// Its name on the command line.
    pub name: &'static str,
    /// The subject, in one line.
    pub about: &'static str,
    /// Increases when a trial changes: parts of different revisions cannot be merged.
    pub revision: u32,
    /// Seeds of a quick look, from 0.
    pub few_seeds: u64,
    /// Seeds of the figures, from 0.
    pub all_seeds: u64,
    /// The grid.
    pub points: fn() -> Vec<Point>,
    /// The trials of one seed at one point.
    pub trial: Trial,
    /// Computes the results from all seeds.
    pub results: fn(&Part) -> Result<Results>,
}

impl Study {
    /// The random number generator of a seed at a point, independent of those of other studies,
    /// points and seeds, and of simulated pixels.
    fn rng(&self, point: usize, seed: u64) -> Pcg64 {
        // FNV-1a.
        let name = self.name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Pcg64::seed_from_u64(mixed(mixed(name) ^ mixed(point as u64)) ^ mixed(seed))
    }
}

/// The finaliser of `SplitMix64`: each input bit changes half of the output bits.
const fn mixed(mut bits: u64) -> u64 {
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// A point with these parameters.
#[must_use]
pub fn point<const N: usize>(parameters: [(&str, f64); N]) -> Point {
    parameters
        .map(|(name, value)| (name.to_owned(), value))
        .into()
}

/// Every point of the grid of these values. The last parameter varies fastest.
#[must_use]
pub fn grid<const N: usize>(parameters: [(&str, &[f64]); N]) -> Vec<Point> {
    let mut points = vec![Point::new()];
    for (name, values) in parameters {
        let with = |point: &Point, value: f64| {
            let mut point = point.clone();
            point.insert(name.to_owned(), value);
            point
        };
        let longer = points
            .iter()
            .flat_map(|point| values.iter().map(|&value| with(point, value)));
        points = longer.collect();
    }
    points
}

/// The numbers of so many scenes, from 0, as values of a parameter.
#[must_use]
pub fn numbers(count: usize) -> Vec<f64> {
    (0u16..).map(f64::from).take(count).collect()
}

/// A parameter that is a small whole number.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "as it was written"
)]
pub fn whole(point: &Point, name: &str) -> u16 {
    point[name] as u16
}

/// A tally with these counts.
#[must_use]
pub fn tally<const N: usize>(counts: [(&str, u64); N]) -> Tally {
    counts.map(|(name, count)| (name.to_owned(), count)).into()
}
