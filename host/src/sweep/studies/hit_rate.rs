//! How often the highest bin is the pulse's (Eq. 7 and its figures).

use anyhow::Result;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

use crate::sweep::{Point, Study, Tally, point, tally};
use crate::theory::rates::{self, Reflection};

/// The paper's: seven background bins and the pulse's, σ = 1.5 bins, the pulse on
/// an edge.
pub const BINS: u32 = 8;
/// Where the pulse lies, in bins.
pub const POSITION: f64 = 4.0;
/// Its standard deviation, in bins.
pub const SIGMA: f64 = 1.5;
/// Background photons a bin and laser cycle.
pub const BACKGROUND: f64 = 0.05;
/// Histograms a trial.
const HISTOGRAMS: u64 = 1000;

pub const STUDY: Study = Study {
    name: "hit-rate",
    about: "how often the highest bin is the pulse's, by SNR and background",
    revision: 1,
    few_seeds: 10,
    all_seeds: 100,
    points,
    trial,
};

/// SNR 1 to 30 at mean backgrounds from 0.5 to 100 counts a bin.
fn points() -> Vec<Point> {
    let backgrounds = [0.5, 5.0, 30.0, 100.0];
    let snrs = (1..=30).map(f64::from);
    let grid = backgrounds
        .into_iter()
        .flat_map(|background| snrs.clone().map(move |snr| (background, snr)));
    grid.map(|(background, snr)| point([("background", background), ("snr", snr)]))
        .collect()
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    todo!()
}
