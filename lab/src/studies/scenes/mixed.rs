//! Exposures that an edge passes, each beside one of the same photons without the
//! edge: is it blurred?
//!
//! A laser cycle lies in a long exposure more often than in a short one, so that an
//! exposure over an edge is longer than the next. The other of a pair is over the
//! same laser cycle, of the same pixel with the same random numbers, and the edge
//! left out.

use super::one_pixel::{PER_BIN, Reading};
use crate::sweep::mean::{Measured, Z_99, add};
use crate::sweep::results::Verdict;
use crate::sweep::{PointTally, Tally};

/// The paper's bound of a false detection: half a bin from the surface.
const BELONGS: i64 = PER_BIN / 2;
/// An edge that makes so few more of the exposures false does not blur: two
/// percentage points.
pub const MARGIN: f64 = 0.02;

/// Adds the exposures over laser cycles `at - 1` and `at`, of readings in which the
/// surface steps at the start of `at` and of readings in which it does not, and
/// whether they belong to none of `surfaces`. Where one of the two was not read, as
/// it expired, the pair counts apart; so does an edge that falls between two
/// exposures.
pub fn add_pair(
    tally: &mut Tally,
    sensor: &str,
    [with, without]: [&[Reading]; 2],
    at: u64,
    surfaces: &[i64],
) {
    // The same in both, which differ from `at` on.
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

/// Of the exposures with an edge (`mixed`) or without (`clean`), those read as
/// neither surface.
pub fn neither(point: &PointTally, sensor: &str, exposures: &str) -> Measured {
    point.share(
        &format!("{sensor} {exposures}, neither"),
        &format!("{sensor} pairs"),
    )
}

/// How much more often an exposure with an edge is read as neither surface than the
/// same without, with the 99 % interval of Agresti and Min for pairs.
pub fn excess(point: &PointTally, sensor: &str) -> Measured {
    let count = |what: &str| point.count(&format!("{sensor} {what}")) as f64;
    let pairs = count("pairs") + 2.0;
    let (more, fewer) = (count("mixed alone") + 0.5, count("clean alone") + 0.5);
    let value = (more - fewer) / pairs;
    let half = Z_99 * ((more + fewer) / pairs - value * value).max(0.0).sqrt() / pairs.sqrt();
    Measured {
        value,
        interval: (value - half, value + half),
    }
}

/// In percentage points.
pub fn points(excess: Measured) -> String {
    excess.times(100.0).text(1)
}

/// The largest.
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
        // Nothing was read over it.
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
