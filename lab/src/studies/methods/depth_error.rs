//! The error of a pulse's position, compared with the Cramér-Rao bound.

use crate::sweep::charts::{joined, level, level_key, panel};
use crate::sweep::mean::{Measured, add, add_count};
use crate::sweep::results::{Figure, Results, ends};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid};
use anyhow::{Context, Result};
use dtof_core::fixed::types::{U4F12, U8F8, U24F8};
use dtof_core::paper::quadrant_background;
use dtof_core::rule::{ExcludedBins, background_from_count};
use dtof_core::{
    BinPosition, Count, Count10, DepthEstimator, DetectionRule, Histogram, Peak, RangeGate,
    SubBinOffset, WindowRule,
};
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart};
use dtof_draw::palette::{self, Pen};
use dtof_light::bounds::cramer_rao::Pulse;
use dtof_light::looks::exposure::{Exposures, Looks};
use dtof_light::rates::Rates;
use rand_core::Rng;
use rand_pcg::Pcg64;
use std::fmt::Write as _;

const BINS: usize = 128;
/// Standard deviations of the pulse in bins.
pub const SIGMAS: [f64; 7] = [0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5];
/// Signal photons.
pub const SIGNALS: [f64; 4] = [30.0, 60.0, 100.0, 200.0];
/// Background counts a bin.
pub const BACKGROUNDS: [f64; 4] = [0.5, 1.0, 2.0, 5.0];
/// Positions of a trial, evenly spread over a bin.
const POSITIONS: u32 = 64;

/// The estimators of the core by the width of the pulse.
pub const STUDY: Study = Study {
    name: "depth-error",
    about: "depth error against the Cramér-Rao bound, by pulse, signal and background",
    revision: 4,
    few_seeds: 30,
    all_seeds: 300,
    points,
    trial,
    results,
};

/// A depth estimator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimator {
    /// The middle of the highest bin.
    HighestBin,
    /// The paper's: centroid of three bins minus the quadrant background.
    Paper,
    /// The centroid of three bins minus the mean of the bins outside a window.
    CentreOfMass3,
    /// The centred window for a pulse of this standard deviation, in bins.
    CentredWindow(f64),
    /// The centred window for the actual pulse.
    OwnWindow,
}

impl Estimator {
    /// All estimators, with their names in tallies.
    pub const ALL: [(Self, &str); 7] = [
        (Self::HighestBin, "highest"),
        (Self::Paper, "paper"),
        (Self::CentreOfMass3, "mass3"),
        (Self::CentredWindow(0.5), "centred0.5"),
        (Self::CentredWindow(1.0), "centred1.0"),
        (Self::CentredWindow(1.5), "centred1.5"),
        (Self::OwnWindow, "centred"),
    ];

    /// Its pen in a chart.
    #[must_use]
    pub fn pen(self) -> Pen {
        match self {
            Self::HighestBin => palette::REFERENCE,
            Self::Paper => palette::PAPER,
            Self::CentreOfMass3 => palette::STEPS[4],
            Self::CentredWindow(sigma) if sigma < 0.75 => palette::STEPS[0],
            Self::CentredWindow(sigma) if sigma < 1.25 => palette::STEPS[1],
            Self::CentredWindow(_) => palette::STEPS[3],
            Self::OwnWindow => palette::CENTRED,
        }
    }

    /// Its name in a chart.
    #[must_use]
    pub fn label(self) -> String {
        match self {
            Self::HighestBin => "highest bin".to_owned(),
            Self::Paper => "centroid of 3, quadrant background".to_owned(),
            Self::CentreOfMass3 => "centroid of 3, mean background".to_owned(),
            Self::CentredWindow(sigma) => format!("centred window for σ {sigma}"),
            Self::OwnWindow => "centred window for the pulse's σ".to_owned(),
        }
    }

    /// The estimated position of a pulse of standard deviation `sigma`.
    fn position(self, histogram: &Histogram<BINS>, peak: Peak, sigma: f64) -> BinPosition {
        let gate = RangeGate::full();
        let centred = |sigma| DepthEstimator::for_pulse(U8F8::saturating_from_num::<f64>(sigma));
        let mean = mean_background(histogram, peak);
        let (estimator, background) = match self {
            Self::HighestBin => return BinPosition::of(peak.bin, SubBinOffset::CENTRE),
            Self::Paper => {
                let background = quadrant_background(histogram.counts(), &gate, peak.bin);
                (DepthEstimator::Centroid3, background_from_count(background))
            }
            Self::CentreOfMass3 => (DepthEstimator::Centroid3, mean),
            Self::CentredWindow(for_sigma) => (centred(for_sigma), mean),
            Self::OwnWindow => (centred(sigma), mean),
        };
        let depth = estimator.estimate(histogram, &gate, peak, background);
        BinPosition::of(peak.bin, depth.offset)
    }
}

/// The background of a window rule of five bins.
fn mean_background(histogram: &Histogram<BINS>, peak: Peak) -> U24F8 {
    // Any excess is a detection: only the background is used.
    let rule = WindowRule::new(5, U4F12::ZERO, Count::default());
    let background =
        rule.map(|rule| rule.detect(histogram, &RangeGate::full(), peak, &ExcludedBins::NONE));
    background.ok().flatten().unwrap_or_default()
}

fn points() -> Vec<Point> {
    grid([
        ("sigma", &SIGMAS),
        ("signal", &SIGNALS),
        ("background", &BACKGROUNDS),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let sigma = point["sigma"];
    let looks = Looks {
        x: 1,
        first: 1,
        last: 1,
    };
    let steps = 256 / POSITIONS;
    let mut tally = Tally::new();
    for index in 0..POSITIONS {
        // In 1/256 bin, as in the core.
        let place = (64 << 8) + index * steps + rng.next_u32() % steps;
        let rates = Rates {
            background: point["background"],
            signal: point["signal"],
            position: f64::from(place) / 256.0,
            sigma,
        };
        let mut histogram = Histogram::<BINS, Count10>::new();
        Exposures::new(&rates, u16::try_from(BINS)?, looks)?.frames::<BINS>(rng, |_, frame| {
            histogram.add_frame(frame, &RangeGate::full());
            true
        });
        add_count(&mut tally, "histograms", 1);
        let peak = histogram.peak();
        let middle = f64::from(peak.bin.raw()) + 0.5;
        if (middle - rates.position).abs() > 2.0 * sigma + 1.0 {
            // A false alarm, not an error of depth.
            add_count(&mut tally, "elsewhere", 1);
            continue;
        }
        for (estimator, name) in Estimator::ALL {
            let position = estimator.position(&histogram, peak, sigma).raw();
            let square = u64::from(position.abs_diff(place.cast_signed())).pow(2);
            add_count(&mut tally, name, square);
            add(&mut tally, name, "fourths", square.pow(2));
        }
    }
    Ok(tally)
}

/// Ratio of the root mean square error of an estimator to the bound, at a point.
#[must_use]
pub fn over_bound(point: &PointTally, name: &str) -> Measured {
    let near = point.count("histograms") - point.count("elsewhere");
    let fourths = point.count(&format!("{name} fourths"));
    let [near, squares, fourths] = [near, point.count(name), fourths].map(u128::from);
    let bound = Pulse {
        signal: point.parameter("signal"),
        background: point.parameter("background"),
        sigma: point.parameter("sigma"),
    };
    let error = Measured::root_of_squares(near, squares, fourths);
    error.times(1.0 / 256.0 / bound.position_error())
}

/// The point with the largest share of peaks outside the pulse, and that share. Such peaks are left
/// out of the error.
///
/// # Errors
/// Fails if there is no point.
pub fn elsewhere(part: &Part) -> Result<(&PointTally, f64)> {
    let shares = part.points().iter().map(|point| {
        let share = point.share("elsewhere", "histograms");
        (point, share.value)
    });
    shares
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .context("depth-error: no points")
}

/// Over all signals and backgrounds: the root mean square of [`over_bound`], and its range.
fn summary(part: &Part, sigma: f64, name: &str) -> Measured {
    let ratios: Vec<f64> = part
        .at([("sigma", sigma)])
        .map(|point| over_bound(point, name).value)
        .collect();
    let squares: f64 = ratios.iter().map(|ratio| ratio * ratio).sum();
    Measured {
        value: (squares / ratios.len().max(1) as f64).sqrt(),
        interval: ends(ratios),
    }
}

fn results(part: &Part) -> Result<Results> {
    let panels = Estimator::ALL.map(|(estimator, name)| {
        let dots = SIGMAS.map(|sigma| summary(part, sigma, name).at(sigma));
        let series = [level(&SIGMAS, 1.0), joined(estimator.pen(), dots)];
        panel(estimator.label(), series)
    });
    let own = SIGMAS.map(|sigma| summary(part, sigma, "centred").interval.1);
    let most = own.into_iter().fold(0.0, f64::max);
    let chart = Chart {
        finding: format!(
                "A centred window for the pulse errs {:.0} % more than the bound at most",
                (most - 1.0) * 100.0
            ), holds: most < 1.2,
        note: "Dots are means over 16 pairs of signal and background, bars go from the best pair to the worst."
            .to_owned(),
        x: Axis::linear("pulse σ, bins"),
        y: Axis::logarithmic("root mean square depth error over the Cramér-Rao bound")
            .within(0.9, 9.0),
        key: vec![level_key("the bound: pulse shape known, signal and background not")],
        columns: 3,
        panels: panels.into(),
    };
    let histograms = part.one([]).count("histograms");
    Ok(Results {
        figures: vec![Figure::new("depth-error", &chart)?],
        values: [("histograms", grouped(histograms))].into(),
        tables: vec![("results/data/depth_error.csv", csv(part)?)],
        ..Results::default()
    })
}

fn csv(part: &Part) -> Result<String> {
    let mut csv = "sigma,signal,background,elsewhere,method,error,low,high\n".to_owned();
    for point in part.points() {
        let at = point.parameter_cells(["sigma", "signal", "background"]);
        let elsewhere = point.share("elsewhere", "histograms").value;
        for (_, name) in Estimator::ALL {
            let error = over_bound(point, name).cells(3);
            writeln!(csv, "{at},{elsewhere:.4},{name},{error}")?;
        }
    }
    Ok(csv)
}
