//! Motion blur: exposures that contain an edge, paired with exposures of the same photons without
//! it.
//!
//! A given laser cycle lies in a long exposure more often than in a short one, so exposures with an
//! edge are longer than average. The partner of a pair therefore covers the same laser cycle of the
//! same pixel, with the same random numbers and without the edge.

use super::one_pixel::{PER_BIN, Reading};
use crate::sweep::mean::{Measured, Z_99, add};
use crate::sweep::results::Verdict;
use crate::sweep::{PointTally, Tally};

/// The paper's limit for a false detection: half a bin from the surface.
const BELONGS: i64 = PER_BIN / 2;
/// The largest excess of false exposures that does not count as blur: two percentage points.
pub const MARGIN: f64 = 0.02;

/// Adds a pair: the exposures that contain laser cycles `at - 1` and `at`, with a step of the
/// surface at the start of `at` and without it, and whether each lies at none of `surfaces`. Pairs
/// with an expired exposure, and edges between two exposures, are counted separately.
pub fn add_pair(
    tally: &mut Tally,
    sensor: &str,
    [with, without]: [&[Reading]; 2],
    at: u64,
    surfaces: &[i64],
) {
    // The same in both, because they differ only from `at` on.
    if with.iter().any(|reading| reading.last + 1 == at) {
        add(tally, sensor, "between exposures", 1);
        return;
    }
    let is_neither = |readings: &[Reading]| {
        let mut over = readings
            .iter()
            .filter(|reading| reading.first < at && at <= reading.last);
        let off = |reading: &Reading, surface: &i64| (reading.position - surface).abs() > BELONGS;
        over.next()
            .map(|reading| surfaces.iter().all(|surface| off(reading, surface)))
    };
    let (mixed, clean) = (is_neither(with), is_neither(without));
    add(tally, sensor, "mixed, not read", mixed.is_none().into());
    add(tally, sensor, "clean, not read", clean.is_none().into());
    let (Some(mixed), Some(clean)) = (mixed, clean) else {
        return;
    };
    add(tally, sensor, "pairs", 1);
    add(tally, sensor, "mixed, neither", mixed.into());
    add(tally, sensor, "clean, neither", clean.into());
    add(tally, sensor, "mixed alone", (mixed && !clean).into());
    add(tally, sensor, "clean alone", (clean && !mixed).into());
}

/// The share of exposures with an edge (`mixed`) or without (`clean`) that are read as neither
/// surface.
pub fn neither(point: &PointTally, sensor: &str, exposures: &str) -> Measured {
    point.share(
        &format!("{sensor} {exposures}, neither"),
        &format!("{sensor} pairs"),
    )
}

/// The excess: how much more often an exposure with an edge is read as neither surface than its
/// partner, with the 99 % interval of Agresti and Min for pairs.
pub fn excess(point: &PointTally, sensor: &str) -> Measured {
    let count = |what: &str| point.count(&format!("{sensor} {what}")) as f64;
    let pairs = count("pairs") + 2.0;
    let (more, fewer) = (count("mixed alone") + 0.5, count("clean alone") + 0.5);
    let value = (more - fewer) / pairs;
    let half = Z_99 * ((more + fewer) / pairs - value * value).max(0.0).sqrt() / pairs.sqrt();
    Measured::plus_minus(value, half)
}

/// The excess in percentage points, as text.
pub fn points(excess: Measured) -> String {
    excess.times(100.0).text(1)
}

/// The largest excess.
pub fn worst(excesses: impl Iterator<Item = Measured>) -> Option<Measured> {
    excesses.max_by(|a, b| a.value.total_cmp(&b.value))
}

/// Whether no excess reaches [`MARGIN`], with 99 % confidence in each.
pub fn is_sharp(excesses: &[Measured]) -> Verdict {
    if excesses.iter().all(|excess| excess.interval.1 < MARGIN) {
        Verdict::Agrees
    } else if excesses.iter().any(|excess| excess.interval.0 > MARGIN) {
        Verdict::Refuted
    } else {
        Verdict::NotDecided
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::tally;

    fn reading(first: u64, last: u64, position: i64) -> Reading {
        Reading {
            first,
            last,
            position,
        }
    }

    #[test]
    fn a_pair_is_over_the_same_laser_cycle() {
        let with = [reading(0, 99, 0), reading(100, 199, 512)];
        let without = [reading(0, 149, 512), reading(150, 199, 0)];
        let mut tally = Tally::new();
        let mut add = |at, pair| add_pair(&mut tally, "a", pair, at, &[0, 1024]);
        // 512 lies between the surfaces, two bins from either.
        add(160, [&with, &without]);
        // An exposure that begins with the edge has one surface.
        add(100, [&with, &without]);
        // No reading covers the edge.
        add(180, [&with[..1], &without]);
        add(180, [&with, &without[..1]]);
        assert_eq!(tally["a between exposures"], 1);
        assert_eq!((tally["a pairs"], tally["a mixed alone"]), (1, 1));
        for (what, mixed, clean) in [("neither", 1, 0), ("not read", 1, 1)] {
            let both = ["mixed", "clean"].map(|which| tally[&format!("a {which}, {what}")]);
            assert_eq!(both, [mixed, clean]);
        }
    }

    #[test]
    fn few_pairs_decide_nothing() {
        let verdict = |pairs, alone| {
            let counts = [("a pairs", pairs), ("a mixed alone", alone)];
            is_sharp(&[excess(&tally(counts).into(), "a")])
        };
        assert_eq!(verdict(0, 0), Verdict::NotDecided);
        assert_eq!(verdict(50, 0), Verdict::NotDecided);
        assert_eq!(verdict(1000, 0), Verdict::Agrees);
        assert_eq!(verdict(1000, 20), Verdict::NotDecided);
        assert_eq!(verdict(1000, 60), Verdict::Refuted);
    }

    /// n = 100 and 2, 12.5 and 3.5 of 102 by hand: 9 / 102, and
    /// √(16 − 81/102) / 102.
    #[test]
    fn the_interval_is_that_of_agresti_and_min() {
        let counts = [
            ("a pairs", 100),
            ("a mixed alone", 12),
            ("a clean alone", 3),
        ];
        let excess = excess(&tally(counts).into(), "a");
        assert!((excess.value - 9.0 / 102.0).abs() < 1e-12);
        let half = Z_99 * (16.0 - 81.0 / 102.0_f64).sqrt() / 102.0;
        assert!((excess.interval.1 - excess.value - half).abs() < 1e-12);
    }
}
