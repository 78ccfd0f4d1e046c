//! The time to an event, and its uncertainty.

use super::FALSE_SHARE;
use crate::studies::methods::passage::{LOOKS, Ladder};
use crate::sweep::PointTally;
use crate::sweep::mean::{Measured, Z_99};

/// Mean laser cycles to an event with a threshold, and the variance of that mean.
fn mean_and_variance(ladder: &Ladder, threshold: f64, point: &PointTally) -> (f64, f64) {
    let exposures = point.count("exposures") as f64;
    let of = |what: &str| {
        let count = |index| point.count(&ladder.key(index, what)) as f64;
        ladder.interpolated(threshold, count)
    };
    let [events, cycles, squares] = ["events", "cycles", "squares"].map(of);
    let events = events.max(1.0);
    let mean = cycles / events;
    // The variance of a ratio of sums. Exposures without an event lasted until they expired.
    let with_event = cycles - (exposures - events) * f64::from(LOOKS.expiry());
    let above = squares - 2.0 * mean * with_event + mean * mean * events;
    (mean, above.max(0.0) / (events * events))
}

/// Mean laser cycles to an event, with its interval, and the threshold with a share of
/// [`FALSE_SHARE`] of false alarms in the exposures of `without`.
pub(super) fn time(
    ladder: &Ladder,
    without: &[&PointTally],
    with_target: &PointTally,
) -> (f64, Measured) {
    let threshold = ladder.calibrated(without, FALSE_SHARE);
    let (value, variance) = mean_and_variance(ladder, threshold, with_target);
    // The thresholds at the ends of the interval of the false alarms.
    let exposures: u64 = without.iter().map(|point| point.count("exposures")).sum();
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "far fewer than 2^52"
    )]
    let events = (exposures as f64 * FALSE_SHARE).round() as u64;
    let (fewer, more) = Measured::share(events, exposures).interval;
    let [late, early] = [fewer, more]
        .map(|share| mean_and_variance(ladder, ladder.calibrated(without, share), with_target).0);
    let half = Z_99 * variance.sqrt();
    let interval = (
        value - half.hypot(value - early),
        value + half.hypot(late - value),
    );
    (threshold, Measured { value, interval })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::methods::passage::Rule;
    use crate::sweep::Tally;

    fn tally(counts: [(&str, u64); 4], ladder: &Ladder) -> PointTally {
        let mut tally = Tally::from([("exposures".to_owned(), counts[0].1)]);
        for index in 0..ladder.thresholds.len() {
            for (what, count) in &counts[1..] {
                tally.insert(ladder.key(index, what), *count);
            }
        }
        tally.into()
    }

    /// Half of 100 exposures expire. The delta method's variance for that share, 1/2, is
    /// (1/4)/100/(1/2)⁴.
    #[test]
    fn expired_exposures_widen_the_interval() {
        let ladder = Ladder::new(Rule::Window(2), 15, 19, 4);
        let expiry = u64::from(LOOKS.expiry());
        let (cycles, squares) = (50 * (100 + expiry), 50 * (100 * 100 + expiry * expiry));
        let counts = [
            ("exposures", 100),
            ("events", 50),
            ("cycles", cycles),
            ("squares", squares),
        ];
        let (mean, variance) = mean_and_variance(&ladder, 4.1, &tally(counts, &ladder));
        let expiry = f64::from(LOOKS.expiry());
        assert!((mean - (100.0 + expiry)).abs() < 1e-9);
        assert!(
            (variance / expiry.powi(2) - 0.04).abs() < 1e-9,
            "{variance}"
        );
    }

    /// Times of 100, 110, … without variance, and false alarms that fall by a factor of four per
    /// threshold: a hundred times the exposures have about a tenth of the interval.
    #[test]
    fn an_uncertain_threshold_widens_the_interval() {
        let ladder = Ladder::new(Rule::Window(2), 15, 19, 4);
        let half = |exposures: u64| {
            let mut without = tally([("exposures", exposures); 4], &ladder);
            let mut with = tally(
                [("exposures", 100), ("events", 100), ("", 0), ("", 0)],
                &ladder,
            );
            for index in 0..ladder.thresholds.len() {
                let step = u32::try_from(index).unwrap();
                let false_events = exposures * 16 / 100 / 4u64.pow(step);
                without
                    .tally
                    .insert(ladder.key(index, "false"), false_events);
                let time = 100 + 10 * u64::from(step);
                with.tally.insert(ladder.key(index, "cycles"), 100 * time);
                with.tally
                    .insert(ladder.key(index, "squares"), 100 * time * time);
            }
            let (threshold, time) = time(&ladder, &[&without], &with);
            assert!((threshold - 4.25).abs() < 1e-3 && (time.value - 120.0).abs() < 0.1);
            (time.interval.1 - time.interval.0) / 2.0
        };
        // A factor of e in false alarms is 10 / ln 4 = 7.2 laser cycles, and a count of a hundred
        // is uncertain by 26 %.
        let (few, many) = (half(10_000), half(1_000_000));
        assert!((1.4..2.6).contains(&few), "{few}");
        assert!((8.0..12.0).contains(&(few / many)), "{few} {many}");
    }
}
