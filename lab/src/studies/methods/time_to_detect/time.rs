//! How long a rule takes to an event, and how sure that is.

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
    // Of a ratio of sums: the squares of what each exposure has above `mean` times its
    // events. Those without an event lasted to the end.
    let with_event = cycles - (exposures - events) * f64::from(LOOKS.expiry());
    let above = squares - 2.0 * mean * with_event + mean * mean * events;
    (mean, above.max(0.0) / (events * events))
}

/// Mean laser cycles to an event with [`FALSE_SHARE`] false alarms in the exposures of
/// `without`, the threshold, and what both are sure of.
pub(super) fn time(
    ladder: &Ladder,
    without: &[&PointTally],
    with_target: &PointTally,
) -> (f64, Measured) {
    let threshold = ladder.calibrated(without, FALSE_SHARE);
    let (value, variance) = mean_and_variance(ladder, threshold, with_target);
    // As many exposures are false or fewer, or more, by what they are sure of.
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
    use crate::studies::methods::passage::Method;
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

    /// Half of the exposures expire: as many as there are events, and the delta method's
    /// variance for that share, 1/2, of 100 is (1/4)/100/(1/2)⁴.
    #[test]
    fn what_expires_is_as_unsure_as_its_share() {
        let ladder = Ladder::new(Method::Window(2), 15, 19, 4);
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

    /// Times of 100, 110, … that vary by nothing, and false alarms that fall by a factor
    /// of four a threshold: a hundred times the exposures, about a tenth of the interval.
    #[test]
    fn a_time_is_as_unsure_as_its_threshold() {
        let ladder = Ladder::new(Method::Window(2), 15, 19, 4);
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
        // A factor of e in false alarms is 10 / ln 4 = 7.2 laser cycles, and a hundred of
        // them are sure to 26 %.
        let (few, many) = (half(10_000), half(1_000_000));
        assert!((1.4..2.6).contains(&few), "{few}");
        assert!((8.0..12.0).contains(&(few / many)), "{few} {many}");
    }
}
