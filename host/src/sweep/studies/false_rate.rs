//! How far one threshold holds: false events of an exposure when the background
//! goes over orders of magnitude and the threshold stays.

use std::fmt::Write as _;

use anyhow::Result;
use rand_pcg::Pcg64;

use crate::chart::{Axis, Chart, Point as Dot, Series, Style, line_chart};
use crate::simulation::Rates;
use crate::summary::grouped;
use crate::sweep::results::{Figure, Results, Share, Table};
use crate::sweep::studies::passage::{BINS, LOOKS, Ladder, Method, Passage, count_false};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};
use crate::theory::exposure::Exposures;

/// Mean background counts a bin at the first look, after 40 laser cycles; 25 times
/// as many after 1000.
const BACKGROUNDS: [f64; 9] = [0.4, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];
/// False events an exposure that are wanted, and the figures' names.
const WANTED: [(f64, &str); 2] = [(0.01, "false-rate"), (0.001, "false-rate-low")];
/// Exposures of a trial.
const EXPOSURES: u64 = 50;

/// Every rule with one threshold for all backgrounds.
pub const STUDY: Study = Study {
    name: "false-rate",
    about: "false events with one threshold from 0.4 to 200 background counts a bin",
    revision: 1,
    few_seeds: 40,
    all_seeds: 400,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let point = |first_mean| point([("first_mean", first_mean)]);
    BACKGROUNDS.map(point).to_vec()
}

fn ladders() -> Vec<Ladder> {
    let ladder = |method| match method {
        Method::Paper => Ladder::new(method, 8, 32, 4),
        _ => Ladder::new(method, 28, 44, 8),
    };
    Method::RULES.map(ladder).to_vec()
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let rates = Rates {
        background: point["first_mean"] / f64::from(LOOKS.first * LOOKS.x),
        signal: 0.0,
        position: 0.0,
        sigma: 1.0,
    };
    let ladders = ladders();
    let exposures = Exposures::new(&rates, u16::try_from(BINS)?, LOOKS)?;
    let mut passage = Passage::new(&ladders, exposures, None)?;
    Ok(count_false(&mut passage, EXPOSURES, rng))
}

/// A rule with one threshold.
struct Outcome {
    method: Method,
    wanted: f64,
    threshold: f64,
    /// False events an exposure at each background.
    shares: Vec<(f64, Share)>,
}

impl Outcome {
    /// The largest factor between a share and the wanted one, up or down.
    fn worst_factor(&self) -> f64 {
        let factors = self.shares.iter().map(|(_, share)| {
            let ratio = share.value / self.wanted;
            ratio.max(1.0 / ratio)
        });
        factors.fold(1.0, f64::max)
    }
}

/// False events of `point` at a threshold, in exposures, between those of the two
/// beside it.
#[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
fn false_events(ladder: &Ladder, point: &PointTally, threshold: f64) -> f64 {
    // Equal factors for equal steps; none is less than one.
    let count = |index| (point.count(&ladder.key(index, "false")) as f64).max(0.5);
    ladder
        .interpolated(threshold, |index| count(index).ln())
        .exp()
}

/// The threshold whose shares at all backgrounds have the geometric mean `wanted`.
#[allow(clippy::cast_precision_loss, reason = "far fewer than 2^52")]
fn one_threshold(ladder: &Ladder, part: &Part, wanted: f64) -> f64 {
    let is_more = |threshold: f64| {
        let excess = part.points().iter().map(|point| {
            let exposures = point.count("exposures") as f64;
            (false_events(ladder, point, threshold) / (exposures * wanted)).ln()
        });
        excess.sum::<f64>() > 0.0
    };
    let (mut low, mut high) = (0.0, 16.0);
    for _ in 0..40 {
        let middle = (low + high) / 2.0;
        if is_more(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low.clamp(
        ladder.thresholds[0],
        ladder.thresholds[ladder.thresholds.len() - 1],
    )
}

fn outcome(ladder: &Ladder, part: &Part, wanted: f64) -> Outcome {
    let threshold = one_threshold(ladder, part, wanted);
    let share = |point: &PointTally| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let events = false_events(ladder, point, threshold).round() as u64;
        let share = Share::new(events, point.count("exposures"));
        (point.parameter("first_mean"), share)
    };
    Outcome {
        method: ladder.method,
        wanted,
        threshold,
        shares: part.points().iter().map(share).collect(),
    }
}

fn results(part: &Part) -> Result<Results> {
    let mut figures = Vec::new();
    let mut csv = "wanted,method,threshold,first_mean,share,low,high\n".to_owned();
    let exposures = part
        .points()
        .first()
        .map_or(0, |point| point.count("exposures"));
    for (wanted, name) in WANTED {
        let outcomes: Vec<Outcome> = ladders()
            .iter()
            .map(|ladder| outcome(ladder, part, wanted))
            .collect();
        let mut series = Vec::new();
        let mut factors = Vec::new();
        for (colour, outcome) in outcomes.iter().enumerate() {
            let threshold = outcome.threshold;
            let symbol = if outcome.method == Method::Paper {
                "α"
            } else {
                "z"
            };
            series.push(Series {
                name: Some(format!(
                    "{}, {symbol} {threshold:.2}",
                    outcome.method.label()
                )),
                colour,
                style: Style::JoinedDots,
                points: outcome
                    .shares
                    .iter()
                    .filter(|(_, share)| share.value > 0.0)
                    .map(|(background, share)| share.at(*background))
                    .collect(),
            });
            factors.push(format!(
                "{} {:.1}",
                outcome.method.label(),
                outcome.worst_factor()
            ));
            for (background, share) in &outcome.shares {
                let (low, high) = share.interval;
                writeln!(
                    csv,
                    "{wanted},{},{threshold:.3},{background},{:.6},{low:.6},{high:.6}",
                    outcome.method.name(),
                    share.value
                )?;
            }
        }
        for (name, factor) in [
            ("wanted, and a factor of 1.5", 1.0),
            ("", 1.5),
            ("", 1.0 / 1.5),
        ] {
            let at = |x| Dot::exact(x, wanted * factor);
            series.push(Series {
                name: (!name.is_empty()).then(|| name.to_owned()),
                colour: 6,
                style: Style::Thin,
                points: vec![at(BACKGROUNDS[0]), at(BACKGROUNDS[BACKGROUNDS.len() - 1])],
            });
        }
        let percent = wanted * 100.0;
        let axis = |label, range| Axis {
            range,
            ..Axis::logarithmic(label)
        };
        let svg = line_chart(&Chart {
            title: &format!("One threshold for all backgrounds, {percent} % wanted"),
            x: axis(
                "background counts a bin at the first look",
                Some((0.3, 30_000.0)),
            ),
            y: axis(
                "false events an exposure",
                Some((wanted / 100.0, wanted * 40.0)),
            ),
            series,
        })?;
        figures.push(Figure {
            name,
            svg,
            caption: format!(
                "False events of a 1000-cycle exposure with one threshold for all backgrounds, set to {percent} % on \
                 (geometric) average. Largest factor off, up or down: {} ({} exposures a dot)",
                factors.join(", "),
                grouped(exposures)
            ),
        });
    }
    Ok(Results {
        figures,
        claims: Vec::new(),
        tables: vec![Table {
            name: "false_rate",
            csv,
        }],
    })
}
