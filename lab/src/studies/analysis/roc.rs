//! The receiver operating characteristic of the threshold (Eq. 8 and 10): a sweep of α at several
//! SNRs.

use super::paper_setting::{BACKGROUND_BINS, Histograms, gaussian, means, target};
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Figure, Results, Verdict};
use crate::sweep::{Part, Point, PointTally, Study, Tally, grid, tally};
use anyhow::Result;
use dtof_core::paper::ComparatorTree;
use dtof_data::options::rows::grouped;
use dtof_draw::chart::{Axis, Chart, Key, Panel, Point as Dot, Series, Style};
use dtof_draw::palette::STEPS;
use dtof_light::counts::binomial;
use dtof_light::gaussian::{false_positive_rate, threshold};
use dtof_light::known_background;
use rand_pcg::Pcg64;

/// Mean background counts a bin: the paper's B = 0.05 at N = 600, its rule of thumb
/// for Gaussian counts.
const BACKGROUND: f64 = 30.0;
const SNRS: [f64; 5] = [3.0, 6.0, 9.0, 12.0, 18.0];
/// Histograms of a trial.
const HISTOGRAMS: u64 = 1000;

/// Compared with the Gaussian and the exact curves.
pub const STUDY: Study = Study {
    name: "roc",
    about: "true and false positive rate as α is swept, at several SNR",
    revision: 1,
    few_seeds: 10,
    all_seeds: 100,
    points,
    trial,
    results,
};

/// α from 0 to 5 in quarters.
fn alphas() -> impl DoubleEndedIterator<Item = f64> {
    (0..=20).map(|step| f64::from(step) / 4.0)
}

fn points() -> Vec<Point> {
    let alphas: Vec<f64> = alphas().collect();
    grid([("snr", &SNRS), ("alpha", &alphas)])
}

/// A true positive is a histogram whose peak is the pulse's bin and exceeds the threshold. A false
/// positive has a background bin above the threshold.
fn trial(point: &Point, rng: &mut Pcg64) -> Result<Tally> {
    let histograms = Histograms::new(means(BACKGROUND, point["snr"], false))?;
    let level = threshold(BACKGROUND, point["alpha"]);
    let (target, _) = target();
    let [mut hits, mut true_positives, mut false_positives] = [0; 3];
    for _ in 0..HISTOGRAMS {
        let mut bins = histograms.draw(rng);
        let peak = ComparatorTree::of(&bins).peak();
        let passes = |count: u32| f64::from(count) > level;
        let is_hit = usize::from(peak.bin.raw()) == target;
        hits += u64::from(is_hit);
        true_positives += u64::from(is_hit && passes(peak.count.raw()));
        bins[target] = 0;
        false_positives += u64::from(bins.into_iter().any(passes));
    }
    Ok(tally([
        ("histograms", HISTOGRAMS),
        ("hits", hits),
        ("true", true_positives),
        ("false", false_positives),
    ]))
}

fn true_positives(point: &PointTally) -> Measured {
    point.share("true", "histograms")
}

fn false_positives(point: &PointTally) -> Measured {
    point.share("false", "histograms")
}

/// False and true positive rate at α, exact.
fn exact(snr: f64, alpha: f64) -> (f64, f64) {
    let means = means(BACKGROUND, snr, false);
    let (target, _) = target();
    let hit = known_background::true_positive_rate(&means, target, BACKGROUND, alpha);
    let miss = known_background::false_positive_rate(BACKGROUND, alpha, BACKGROUND_BINS);
    (miss, hit.unwrap_or_default())
}

/// The simulated area under the curve of an SNR: trapezoids from (0, 0), level to
/// the right of the smallest α.
fn area(part: &Part, snr: f64) -> f64 {
    let points = part.at([("snr", snr)]);
    let mut curve: Vec<(f64, f64)> = points
        .map(|point| (false_positives(point).value, true_positives(point).value))
        .collect();
    curve.push((0.0, 0.0));
    curve.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let (right, top) = curve.last().copied().unwrap_or_default();
    let trapezoids = curve
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0) * f64::midpoint(pair[0].1, pair[1].1));
    trapezoids.sum::<f64>() + (1.0 - right) * top
}

fn results(part: &Part) -> Result<Results> {
    let histograms = grouped(part.points()[0].count("histograms"));
    Ok(Results {
        figures: vec![Figure::new("roc", &chart(part))?],
        claims: claims(part),
        values: [("histograms", histograms)].into(),
        ..Results::default()
    })
}

fn claims(part: &Part) -> Vec<Claim> {
    // Both simulated rates, at the smallest and the largest α of each SNR and between neighbouring
    // α.
    let mut falls = true;
    let [mut rises, mut steps] = [0u32; 2];
    for snr in SNRS {
        let points: Vec<&PointTally> = part.at([("snr", snr)]).collect();
        for rate in [true_positives, false_positives] {
            let shares: Vec<Measured> = points.iter().map(|point| rate(point)).collect();
            if let [first, .., last] = shares[..] {
                falls &= last.interval.1 < first.interval.0;
            }
            let significant = |pair: &[Measured]| pair[1].interval.0 > pair[0].interval.1;
            for pair in shares.windows(2) {
                rises += u32::from(significant(pair));
                steps += 1;
            }
        }
    }
    let exact_falls = SNRS.iter().all(|&snr| {
        let curve: Vec<(f64, f64)> = alphas().map(|alpha| exact(snr, alpha)).collect();
        let falls = |pair: &[(f64, f64)]| pair[1].0 <= pair[0].0 && pair[1].1 <= pair[0].1;
        curve.windows(2).all(falls)
    });
    let ends = |rate: fn(&PointTally) -> Measured, alpha| {
        let point = part.one([("snr", 9.0), ("alpha", alpha)]);
        rate(point).value
    };
    // The smallest α lets most pass.
    let of_snr = SNRS.map(|snr| {
        let point = part.one([("snr", snr), ("alpha", 0.0)]);
        let [best, hit] = ["true", "hits"].map(|name| point.share(name, "histograms").value);
        (area(part, snr), best, hit)
    });
    let rising = of_snr.windows(2).all(|pair| pair[0].0 < pair[1].0);
    // The best true positive rate is the hit rate, less at most a hundredth.
    let limited = |&(_, best, hit): &(f64, f64, f64)| (hit - 0.01..=hit).contains(&best);
    let texts = SNRS.iter().zip(&of_snr);
    let texts: Vec<String> = texts
        .map(|(snr, (area, best, hit))| format!("{snr}: {area:.3}, {best:.3}, {hit:.3}"))
        .collect();
    vec![
        Claim::new(
            "rise",
            format!(
                "from α = 0 to 5 at SNR 9 the TPR goes from {:.3} to {:.3}, the FPR from {:.3} to {:.1e}; of \
                 {} steps of α over all SNR {rises} rise beyond their 99 % intervals",
                ends(true_positives, 0.0),
                ends(true_positives, 5.0),
                ends(false_positives, 0.0),
                ends(false_positives, 5.0),
                steps
            ),
            // Refuted if the exact rates fall, the simulated rates fall from end to end, and no
            // more steps rise than by chance. Agrees if none of this holds.
            match (falls && exact_falls, is_chance(rises, steps)) {
                (true, true) => Verdict::Refuted,
                (false, false) => Verdict::Agrees,
                _ => Verdict::NotDecided,
            },
        ),
        Claim::new(
            "auc",
            format!(
                "AUC, highest TPR and P_hit by SNR: {}; {}",
                texts[0],
                texts[texts.len() - 1]
            ),
            Verdict::of(rising && of_snr.iter().all(limited)),
        )
        .with_details(texts.join("; ")),
    ]
}

/// Whether chance explains `rises` of `steps` (in more than one of a thousand studies) if no rate
/// rises. A step rises beyond both 99 % intervals only if one of the two rates lies outside its
/// interval on one side, which has a probability of at most 0.5 % for each.
fn is_chance(rises: u32, steps: u32) -> bool {
    binomial::at_least(rises.into(), steps.into(), 0.01) > 1e-3
}

fn chart(part: &Part) -> Chart {
    let mut series = Vec::new();
    for (snr, pen) in SNRS.into_iter().zip(STEPS) {
        let dots = part
            .at([("snr", snr)])
            .map(|point| true_positives(point).at(false_positives(point).value));
        let printed = |alpha| {
            let rate = gaussian(BACKGROUND, snr).true_positive_rate(alpha);
            (false_positive_rate(alpha, BACKGROUND_BINS), rate)
        };
        // From the left: the largest α.
        let line = |of: &dyn Fn(f64) -> (f64, f64)| {
            let points = alphas().rev().map(of);
            points.map(|(x, y)| Dot::exact(x, y)).collect()
        };
        let exact = line(&|alpha| exact(snr, alpha));
        series.extend([
            Series::unnamed(pen, Style::Dots, dots.collect()),
            Series::named(format!("SNR {snr}"), pen, Style::Line, exact),
            Series::unnamed(pen, Style::Dashed, line(&printed)),
        ]);
    }
    let areas = SNRS.map(|snr| area(part, snr));
    Chart {
        finding: "The more signal, the more hits at the same rate of false alarms".to_owned(),
        holds: areas.windows(2).all(|pair| pair[0] < pair[1]),
        note: "Along a curve α falls from 5 (left) to 0 (right). Bars hold 99 %.".to_owned(),
        x: Axis::linear("histograms with a false alarm, %")
            .percent()
            .within(0.0, 1.0),
        y: Axis::linear("histograms with a hit, %")
            .percent()
            .within(0.0, 1.0),
        key: Key::simulated("Eq. 7, 8 and 10"),
        columns: 1,
        panels: vec![Panel::only(series)],
    }
}
