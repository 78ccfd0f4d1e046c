//! How far one threshold holds: false events of an exposure when the background
//! goes over orders of magnitude and the threshold stays.

use std::fmt::Write as _;

use anyhow::Result;
use rand_pcg::Pcg64;

use crate::studies::methods::passage::{BINS, LOOKS, Ladder, Method, Passage, count_false};
use crate::sweep::results::{Figure, Results, Share, Table};
use crate::sweep::{Part, Point, PointTally, Study, Tally, point};
use dtof::chart::{Axis, Chart, Point as Dot, Series, Style, line_chart};
use dtof::rows::grouped;
use dtof_theory::looks::exposure::Exposures;
use dtof_theory::rates::Rates;

/// Mean background counts a bin at the first look, after 40 laser cycles; 25 times
/// as many after 1000.
const BACKGROUNDS: [f64; 9] = [0.4, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];
/// False events an exposure that are wanted, and the figures' names.
const WANTED: [(f64, &str); 2] = [(0.01, "false-rate"), (0.001, "false-rate-low")];
/// Exposures of a trial at each background to set the threshold by, and others to count
/// its false events.
const CALIBRATED: u64 = 20;
const TESTED: u64 = 50;

/// Every rule with one threshold for all backgrounds.
pub const STUDY: Study = Study {
    name: "false-rate",
    about: "false events with one threshold from 0.4 to 200 background counts a bin",
    revision: 3,
    few_seeds: 40,
    all_seeds: 4000,
    points,
    trial,
    results,
};

fn points() -> Vec<Point> {
    let mut points = Vec::new();
    for first_mean in BACKGROUNDS {
        for tested in [0.0, 1.0] {
            points.push(point([("first_mean", first_mean), ("tested", tested)]));
        }
    }
    points
}

/// So fine that two neighbours differ by a third in their false events.
fn ladders() -> Vec<Ladder> {
    let ladder = |method| match method {
        Method::Paper => Ladder::new(method, 16, 64, 8),
        _ => Ladder::new(method, 56, 88, 16),
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
    let count = if point["tested"] > 0.0 {
        TESTED
    } else {
        CALIBRATED
    };
    Ok(count_false(&mut passage, count, rng))
}

/// A rule with one threshold.
struct Outcome {
    method: Method,
    threshold: f64,
    /// False events an exposure at each background.
    shares: Vec<(f64, Share)>,
}

impl Outcome {
    /// The threshold with `wanted` false events an exposure on average over the
    /// backgrounds, and its false events in other exposures.
    fn new(ladder: &Ladder, part: &Part, wanted: f64) -> Self {
        let calibrated: Vec<&PointTally> = part.at([("tested", 0.0)]).collect();
        let index = ladder.nearest(ladder.calibrated(&calibrated, wanted));
        let key = ladder.key(index, "false");
        let share = |point: &PointTally| {
            let share = point.share(&key, "exposures");
            (point.parameter("first_mean"), share)
        };
        Self {
            method: ladder.method,
            threshold: ladder.thresholds[index],
            shares: part.at([("tested", 1.0)]).map(share).collect(),
        }
    }

    /// The largest factor between a share and `wanted`, up or down, with the interval of
    /// that share. Where there is no false event, at least as many as the intervals leave.
    fn worst_factor(&self, wanted: f64) -> String {
        let factor = |value: f64| (value / wanted).max(wanted / value);
        // Of an interval with `wanted` in it the least is 1.
        let least = |(low, high): (f64, f64)| {
            if low <= wanted && wanted <= high {
                1.0
            } else {
                factor(low).min(factor(high))
            }
        };
        let worst = self.shares.iter().filter(|(_, share)| share.value > 0.0);
        let worst = worst.max_by(|a, b| factor(a.1.value).total_cmp(&factor(b.1.value)));
        if self.shares.iter().any(|(_, share)| share.value == 0.0) {
            let least = self.shares.iter().map(|(_, share)| least(share.interval));
            return format!("at least {:.1}", least.fold(1.0, f64::max));
        }
        let Some((_, worst)) = worst else {
            return "unknown".to_owned();
        };
        let (low, high) = worst.interval;
        let most = factor(low).max(factor(high));
        format!(
            "{:.2} ({:.2} to {most:.2})",
            factor(worst.value),
            least(worst.interval)
        )
    }
}

fn results(part: &Part) -> Result<Results> {
    let mut figures = Vec::new();
    let mut csv = "wanted,method,threshold,first_mean,share,low,high\n".to_owned();
    let exposures = |tested: f64| {
        let point = part.at([("tested", tested)]).next();
        grouped(point.map_or(0, |point| point.count("exposures")))
    };
    for (wanted, name) in WANTED {
        let outcomes: Vec<Outcome> = ladders()
            .iter()
            .map(|ladder| Outcome::new(ladder, part, wanted))
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
                    .map(|(background, share)| share.at(*background))
                    .collect(),
            });
            factors.push(format!(
                "{} {}",
                outcome.method.label(),
                outcome.worst_factor(wanted)
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
        let svg = line_chart(&Chart {
            title: &format!("One threshold for all backgrounds, {percent} % wanted"),
            x: Axis::logarithmic("background counts a bin at the first look"),
            y: Axis {
                range: Some((wanted / 100.0, wanted * 40.0)),
                ..Axis::logarithmic("false events an exposure")
            },
            series,
        })?;
        figures.push(Figure {
            name,
            svg,
            caption: format!(
                "False events of a 1000-cycle exposure with one threshold for all backgrounds, set to {percent} % on \
                 average over the backgrounds in {} exposures of each (in steps of 1/16, α 1/8), counted in {} others a dot; an open dot is an \
                 upper limit where there was none. Largest factor off, up or down, with the interval of that dot: {}",
                exposures(0.0),
                exposures(1.0),
                factors.join(", ")
            ),
        });
    }
    Ok(Results {
        figures,
        claims: Vec::new(),
        tables: vec![Table {
            path: "results/data/false_rate.csv",
            csv,
        }],
    })
}
