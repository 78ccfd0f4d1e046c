//! How often the highest bin is the pulse's (Eq. 7 and its figures).

use super::paper_setting::{Histograms, gaussian, means, target};
use crate::sweep::charts::panel;
use crate::sweep::results::{Claim, Comparison, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, tally};
use anyhow::Result;
use dtof_core::paper::ComparatorTree;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Key, Point as Dot, Series, Style};
use dtof_draw::palette::NEUTRAL;
use dtof_light::known_background;
use rand_pcg::Pcg64;

/// Mean background counts a bin (N·B): the paper's B = 0.05 at N = 2 to 2000.
const BACKGROUNDS: [f64; 5] = [0.1, 1.0, 10.0, 30.0, 100.0];
/// The counts a bin from which the paper assumes Gaussian counts.
const GAUSSIAN_FROM: f64 = 30.0;
/// Histograms of a trial.
const HISTOGRAMS: u64 = 1000;

/// Compared with Eq. 7 and its exact form.
pub const STUDY: Study = Study {
    name: "hit-rate",
    about: "how often the highest bin is the pulse's, by SNR and background",
    revision: 2,
    few_seeds: 10,
    all_seeds: 100,
    points,
    trial,
    results,
};

/// SNR 1 to 30 at all backgrounds, with and without signal in the neighbours of the pulse's bin,
/// which Eq. 7 leaves out.
fn points() -> Vec<Point> {
    let snrs: Vec<f64> = (1..=30).map(f64::from).collect();
    grid([
        ("neighbours", &[0.0, 1.0]),
        ("background", &BACKGROUNDS),
        ("snr", &snrs),
    ])
}

fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let with_neighbours = point["neighbours"] > 0.0;
    let means = means(point["background"], point["snr"], with_neighbours);
    let histograms = Histograms::new(means)?;
    let (target, _) = target();
    let (mut hits, mut either) = (0, 0);
    for _ in 0..HISTOGRAMS {
        let peak = ComparatorTree::of(&histograms.draw(rng)).peak();
        let bin = usize::from(peak.bin.raw());
        hits += u64::from(bin == target);
        either += u64::from(bin == target || bin == target + 1);
    }
    Ok(tally([
        ("histograms", HISTOGRAMS),
        ("hits", hits),
        ("either", either),
    ]))
}

/// The exact probabilities that the peak is the pulse's bin, and that it is either bin at the edge.
fn exact(means: &[f64]) -> (f64, f64) {
    let (target, _) = target();
    let hit = |bin| known_background::hit_probability(means, bin).unwrap_or_default();
    (hit(target), hit(target) + hit(target + 1))
}

/// The probability by Eq. 7.
fn printed(background: f64, snr: f64) -> f64 {
    gaussian(background, snr).hit_probability()
}

/// The exact form of Eq. 7.
fn exact_hit(background: f64, snr: f64) -> f64 {
    exact(&means(background, snr, false)).0
}

/// The SNR at which `hit_rate`, which grows with the SNR, is 99 %.
fn snr_of_99_percent(hit_rate: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 2000.0);
    while high - low > 1e-2 {
        let middle = f64::midpoint(low, high);
        if hit_rate(middle) < 0.99 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The SNR of 99 % by the exact form, by Eq. 7, and for either bin at the edge with signal in all
/// bins.
fn snrs_of_99_percent(background: f64) -> [f64; 3] {
    [
        snr_of_99_percent(|snr| exact_hit(background, snr)),
        snr_of_99_percent(|snr| printed(background, snr)),
        snr_of_99_percent(|snr| exact(&means(background, snr, true)).1),
    ]
}

/// The simulation without neighbours compared with `predicted` at each background and SNR.
fn comparison(part: &Part, backgrounds: &[f64], predicted: impl Fn(f64, f64) -> f64) -> Comparison {
    let mut pairs = Vec::new();
    for &background in backgrounds {
        for point in part.at([("neighbours", 0.0), ("background", background)]) {
            let share = point.share("hits", "histograms");
            pairs.push((share, predicted(background, point.parameter("snr"))));
        }
    }
    Comparison::of(pairs)
}

fn results(part: &Part) -> Result<Results> {
    let histograms = part.one([("snr", 1.0)]).count("histograms");
    Ok(Results {
        figures: vec![
            Figure::new("hit-rate", &chart(part, 0.0))?,
            Figure::new("hit-rate-neighbours", &chart(part, 1.0))?,
        ],
        claims: claims(part),
        values: [("histograms", grouped(histograms))].into(),
        ..Results::default()
    })
}

fn claims(part: &Part) -> Vec<Claim> {
    let found: Vec<Comparison> = BACKGROUNDS
        .iter()
        .map(|&background| comparison(part, &[background], printed))
        .collect();
    let by_background = |text: &dyn Fn(usize) -> String| {
        let texts: Vec<String> = (0..BACKGROUNDS.len()).map(text).collect();
        texts.join(", ")
    };
    let misses = by_background(&|index| {
        let (background, of) = (BACKGROUNDS[index], found[index]);
        let (outside, largest) = (of.outside, of.largest);
        format!(
            "{background}: {outside} of {} outside, off by up to {largest:.3}",
            of.points
        )
    });
    let exact = comparison(part, &BACKGROUNDS, exact_hit);
    let levels = BACKGROUNDS.map(snrs_of_99_percent);
    let of_level = |which: usize| by_background(&|index| format!("{:.1}", levels[index][which]));
    // "Around 18": within 1 by Eq. 7, from which the paper takes the number.
    let near_18 = levels.map(|[_, printed, _]| (printed - 18.0).abs() <= 1.0);
    // Only where the paper's condition for Gaussian counts holds.
    let enough = BACKGROUNDS.iter().zip(&found);
    let enough = enough.filter(|&(&background, _)| background >= GAUSSIAN_FROM);
    let most = enough.map(|(_, of)| of.largest).fold(0.0, f64::max);
    let below = found.iter().map(|of| of.largest).fold(0.0, f64::max);
    let [fewest, .., most_counts] = BACKGROUNDS;
    let of_ends = |which: usize| [levels[0], levels[levels.len() - 1]].map(|level| level[which]);
    let [printed_at, exact_at, whole_at] = [1, 0, 2].map(of_ends);
    vec![
        Claim::new(
            "eq7",
            format!("off by up to {most:.3} from 30 background counts a bin on, with fewer up to {below:.3}"),
            // Within a fiftieth, the resolution of a plot.
            Verdict::graded(most < 0.02, found.iter().any(|of| of.largest < 0.02)),
        )
        .with_details(format!("99 % intervals by background: {misses}")),
        Claim::new(
            "poisson",
            format!(
                "{} of {} points outside their 99 % interval, off by up to {:.4}",
                exact.outside, exact.points, exact.largest
            ),
            Verdict::of(exact.is_chance()),
        ),
        Claim::new(
            "snr18",
            format!(
                "at {fewest} and {most_counts} background counts a bin: Eq. 7 {:.1} and {:.1}; exact {:.1} and {:.1}; \
                 whole pulse {:.1} and {:.1}",
                printed_at[0], printed_at[1], exact_at[0], exact_at[1], whole_at[0], whole_at[1]
            ),
            Verdict::graded(near_18 == [true; 5], near_18 != [false; 5]),
        )
        .with_details(format!(
            "at {} background counts a bin: Eq. 7 {}; exact {}; either bin at the edge, whole \
             pulse {}",
            by_background(&|index| BACKGROUNDS[index].to_string()),
            of_level(1),
            of_level(0),
            of_level(2)
        )),
    ]
}

/// Backgrounds of the figures.
const SHOWN: [f64; 3] = [1.0, 10.0, 100.0];

/// A panel for each background.
fn chart(part: &Part, neighbours: f64) -> Chart {
    let with_neighbours = neighbours > 0.0;
    let snrs = (1..=30).map(f64::from);
    let of_background = |background: f64| {
        let at = [("neighbours", neighbours), ("background", background)];
        let dots = |of: &str| part.dots(at, "snr", |point| point.share(of, "histograms"));
        let line = |of: &dyn Fn(f64) -> f64| Dot::curve(snrs.clone(), of);
        let exact = |snr| exact(&means(background, snr, with_neighbours));
        let series = |style, points| Series::unnamed(NEUTRAL, style, points);
        let series = if with_neighbours {
            vec![
                series(Style::Dots, dots("either")),
                series(Style::Line, line(&|snr| exact(snr).1)),
                series(Style::Dots, dots("hits")),
                series(Style::Dashed, line(&|snr| exact(snr).0)),
            ]
        } else {
            vec![
                series(Style::Dots, dots("hits")),
                series(Style::Line, line(&|snr| exact(snr).0)),
                series(Style::Dashed, line(&|snr| printed(background, snr))),
            ]
        };
        panel(format!("{background} background counts a bin"), series)
    };
    let (finding, holds) = if with_neighbours {
        let alone = part.at([("neighbours", 1.0), ("snr", 30.0)]);
        let near_half = alone
            .filter(|point| SHOWN.contains(&point.parameter("background")))
            .all(|point| (point.share("hits", "histograms").value - 0.5).abs() < 0.1);
        let text = "On the edge of two bins either is the highest, each about half of the time";
        (text, near_half)
    } else {
        let points = part.at([("neighbours", 0.0), ("background", SHOWN[0])]);
        let is_below = |point: &&PointTally| {
            let share = point.share("hits", "histograms");
            share.interval.1 < printed(SHOWN[0], point.parameter("snr"))
        };
        let below = points.clone().filter(is_below).count();
        let mostly = 2 * below > points.count();
        let many = comparison(part, &SHOWN[2..], printed).largest;
        let exact = comparison(part, &BACKGROUNDS, exact_hit);
        let text = "With few photons the pulse's bin is the highest less often than Eq. 7 says";
        (text, exact.is_chance() && mostly && many < 0.02)
    };
    let key = if with_neighbours {
        vec![
            Key::new(NEUTRAL, Style::Dots, "simulated"),
            Key::new(NEUTRAL, Style::Line, "exact, either of the two"),
            Key::new(NEUTRAL, Style::Dashed, "exact, the lower of them"),
        ]
    } else {
        Key::simulated("Eq. 7")
    };
    Chart {
        finding: finding.to_owned(),
        holds,
        note: format!(
            "{} Bars hold 99 %; most are smaller than their dots.",
            if with_neighbours {
                "Every bin has its signal."
            } else {
                "No signal in the bins beside the pulse's."
            }
        ),
        x: Axis::linear("signal to noise, N·A / √(N·B)"),
        y: Axis::linear("histograms with the pulse's bin the highest, %")
            .percent()
            .within(0.0, 1.0),
        key,
        columns: 3,
        panels: SHOWN.map(of_background).into(),
    }
}
