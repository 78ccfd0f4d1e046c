//! How often the highest bin is the pulse's (Eq. 7 and its figures).

use anyhow::Result;
use dtof_core::peak::ComparatorTree;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

use crate::chart::{self, Axis, Chart, Series, Style, line_chart};
use crate::summary::grouped;
use crate::sweep::results::{Figure, Results};
use crate::sweep::{Part, Point, Study, Tally, point, tally};
use crate::theory::gaussian::MeanCounts;
use crate::theory::known_background;
use crate::theory::rates::{Reflection, peak_share, signal_mean};

/// The paper's histogram: the pulse's bin and seven others (`M_B`).
pub const BINS: usize = BINS_U32 as usize;
const BINS_U32: u32 = 8;
/// The pulse lies on an edge, in bins from the start of bin 0.
pub const POSITION: f64 = 4.0;
/// Its standard deviation in bins.
pub const SIGMA: f64 = 1.5;
/// Histograms of a trial.
const HISTOGRAMS: u64 = 1000;

/// Held against Eq. 7 and its exact form.
pub const STUDY: Study = Study {
    name: "hit-rate",
    about: "how often the highest bin is the pulse's, by SNR and background",
    revision: 1,
    few_seeds: 10,
    all_seeds: 100,
    points,
    trial,
    results,
};

/// SNR 1 to 30 at mean backgrounds of 0.1 to 100 counts a bin; with and without
/// the signal in the bins beside the pulse's, which Eq. 7 leaves out.
fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for neighbours in [0.0, 1.0] {
        for background in [0.1, 1.0, 10.0, 30.0, 100.0] {
            for snr in 1..=30 {
                points.push(point([
                    ("neighbours", neighbours),
                    ("background", background),
                    ("snr", snr.into()),
                ]));
            }
        }
    }
    points
}

/// Mean counts of each bin.
fn means(point: &Point) -> [f64; BINS] {
    let (background, snr) = (point["background"], point["snr"]);
    // The histogram's signal is N·A, its background N·B.
    let signal = snr * background.sqrt();
    let returned = [Reflection {
        photons: signal,
        position: POSITION,
    }];
    let (target, _) = target();
    let mut bins = 0..;
    [(); BINS].map(|()| {
        let bin = bins.next().unwrap_or_default();
        let is_lit = point["neighbours"] > 0.0 || bin == target;
        let signal = if is_lit {
            signal_mean(bin, 1.0, &returned, SIGMA)
        } else {
            0.0
        };
        background + signal
    })
}

/// The pulse's bin, the lower of the two at the edge, and its share of the pulse.
fn target() -> (u32, f64) {
    peak_share(BINS_U32, POSITION, SIGMA)
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let laws = means(point).map(Poisson::new);
    let (target, _) = target();
    let mut hits = 0;
    for _ in 0..HISTOGRAMS {
        let mut counts = [0u32; BINS];
        for (count, law) in counts.iter_mut().zip(&laws) {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number of some hundred"
            )]
            {
                *count = law.as_ref().map_err(|error| *error)?.sample(rng) as u32;
            }
        }
        let peak = ComparatorTree::of(&counts).peak();
        hits += u64::from(u32::from(peak.bin.raw()) == target);
    }
    Ok(tally([("histograms", HISTOGRAMS), ("hits", hits)]))
}

/// Eq. 7 as printed, and the same with Poisson counts, which is exact.
fn expected(point: &Point) -> (f64, f64) {
    let (target, share) = target();
    let background = point["background"];
    let gaussian = MeanCounts {
        background,
        signal: point["snr"] * background.sqrt() * share,
        background_bins: BINS_U32 - 1,
    };
    let exact = known_background::hit_probability(&means(point), target as usize);
    (gaussian.hit_probability(), exact.unwrap_or_default())
}

fn results(part: &Part) -> Result<Results> {
    let mut series = Vec::new();
    for (colour, background) in [1.0, 10.0, 100.0].into_iter().enumerate() {
        let points = part.at([("neighbours", 0.0), ("background", background)]);
        let line = |value: fn((f64, f64)) -> f64| {
            let points = points.clone().map(|point| {
                let value = value(expected(&point.parameters));
                chart::Point::exact(point.parameter("snr"), value)
            });
            points.collect()
        };
        series.push(Series {
            name: Some(format!("{background} background counts a bin: simulated")),
            colour,
            style: Style::Dots,
            points: points
                .clone()
                .map(|point| {
                    let share = point.share("hits", "histograms");
                    chart::Point {
                        x: point.parameter("snr"),
                        y: share.value,
                        interval: Some(share.interval),
                    }
                })
                .collect(),
        });
        series.push(Series {
            name: Some("exact".to_owned()),
            colour,
            style: Style::Line,
            points: line(|(_, exact)| exact),
        });
        series.push(Series {
            name: Some("Eq. 7".to_owned()),
            colour,
            style: Style::Thin,
            points: line(|(gaussian, _)| gaussian),
        });
    }
    let axis = |label| Axis {
        label,
        logarithmic: false,
        range: None,
    };
    let svg = line_chart(&Chart {
        title: "The highest bin is the pulse's",
        x: axis("SNR, N·A / √(N·B)"),
        y: axis("probability"),
        series,
    })?;
    let histograms = part.one([("snr", 1.0)])?.count("histograms");
    Ok(Results {
        figures: vec![Figure {
            name: "hit-rate",
            svg,
            caption: format!(
                "The hit rate of Eq. 7 as printed, with Poisson counts, and simulated ({} histograms a point)",
                grouped(histograms)
            ),
        }],
        claims: Vec::new(),
    })
}
