//! The losses and errors of a device.

use dtof_link::endpoint::LinkCounters;
use dtof_link::{FaultRecord, Report};

/// Losses since a start.
pub struct Losses<'a> {
    /// The device's counts at the start.
    pub first: &'a Report,
    /// The host's counts of the link since then.
    pub here: &'a LinkCounters,
}

impl Losses<'_> {
    /// Each loss with its name.
    #[must_use]
    pub fn counts(&self, report: &Report) -> [(&'static str, u64); 20] {
        let (pixels, blocks) = (&report.statistics, &report.blocks);
        let (first, here) = (self.first, self.here);
        let there = since(&report.link, &first.link);
        let both =
            |count: fn(&LinkCounters) -> u32| u64::from(count(&there)) + u64::from(count(here));
        let overrun = report.overrun.wrapping_sub(first.overrun);
        let unknown = report.unknown.wrapping_sub(first.unknown);
        [
            ("saturated", pixels.saturated),
            ("saturated in blocks", blocks.saturated),
            ("rejected", pixels.rejected),
            ("gated out", pixels.gated_out),
            ("repeated", pixels.repeated),
            ("unaddressed", report.unaddressed),
            ("deferred", pixels.deferred + blocks.deferred),
            ("expired", pixels.expired),
            (
                "expired and deferred",
                pixels.expired_deferred + blocks.expired_deferred,
            ),
            ("ended by a full counter", pixels.ended_full),
            ("blind looks", pixels.blind_looks),
            ("lost bytes", overrun.into()),
            ("corrupt frames", both(|link| link.corrupt)),
            ("oversized frames", both(|link| link.oversized)),
            ("foreign frames", both(|link| link.foreign)),
            ("out of order", both(|link| link.out_of_order)),
            ("duplicates", both(|link| link.duplicate)),
            ("retransmissions", both(|link| link.retransmitted)),
            ("unknown messages", unknown.into()),
            ("sensor errors", self.sensor_errors(report).into()),
        ]
    }

    /// The losses other than 0, each after a comma.
    #[must_use]
    pub fn line(&self, report: &Report) -> String {
        let mut line = String::new();
        for (name, count) in self
            .counts(report)
            .into_iter()
            .filter(|&(_, count)| count > 0)
        {
            line += &format!(", {name} {count}");
        }
        if let Some(fault) = self.last_fault(report) {
            line += &format!(" (last: {fault})");
        }
        line
    }

    /// The last error of the sensor, if there was one.
    #[must_use]
    pub fn last_fault(&self, report: &Report) -> Option<String> {
        let number = report.last_sensor_error;
        (self.sensor_errors(report) > 0).then(|| match FaultRecord::from_number(number) {
            Some(fault) => fault.to_string(),
            None => format!("number {number}"),
        })
    }

    fn sensor_errors(&self, report: &Report) -> u32 {
        report.sensor_errors.wrapping_sub(self.first.sensor_errors)
    }
}

/// The counts since `first`.
#[must_use]
pub fn since(now: &LinkCounters, first: &LinkCounters) -> LinkCounters {
    LinkCounters {
        frames: now.frames.wrapping_sub(first.frames),
        corrupt: now.corrupt.wrapping_sub(first.corrupt),
        oversized: now.oversized.wrapping_sub(first.oversized),
        foreign: now.foreign.wrapping_sub(first.foreign),
        out_of_order: now.out_of_order.wrapping_sub(first.out_of_order),
        duplicate: now.duplicate.wrapping_sub(first.duplicate),
        retransmitted: now.retransmitted.wrapping_sub(first.retransmitted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn losses(report: &Report, first: &Report, here: &LinkCounters) -> String {
        Losses { first, here }.line(report)
    }

    #[test]
    fn every_loss_is_shown_and_only_losses() {
        // A report whose numbers are `number` in one field after the other, little-endian.
        let report = |number: fn(u64) -> u64| {
            let wide = (0..20).flat_map(|at| number(at).to_le_bytes());
            let narrow = (20..32).flat_map(|at| u32::try_from(number(at)).unwrap().to_le_bytes());
            let last = (32..35).flat_map(|at| number(at).to_le_bytes());
            let bytes: Vec<u8> = wide.chain(narrow).chain([1, 0]).chain(last).collect();
            Report::from_le_bytes(&bytes).unwrap()
        };
        let none = LinkCounters::default();
        assert_eq!(losses(&report(|_| 0), &report(|_| 0), &none), "");
        // The counts of link and sensor did not start at 0.
        assert_eq!(
            losses(&report(|at| 101 + at), &report(|_| 100), &none),
            ", saturated 105, saturated in blocks 114, rejected 106, gated out 107, repeated 135, unaddressed 102, \
             deferred 227, expired 110, expired and deferred 231, ended by a full counter 133, blind looks 134, \
             lost bytes 21, corrupt frames 27, \
             oversized frames 28, foreign frames 29, out of order 30, duplicates 31, \
             retransmissions 32, unknown messages 22, sensor errors 23 (last: no answer)"
        );
        // An error from before the start is not shown.
        assert_eq!(losses(&report(|_| 0), &Report::default(), &none), "");

        // Each end sees other frames.
        let here = LinkCounters {
            frames: 1,
            corrupt: 2,
            oversized: 3,
            foreign: 4,
            out_of_order: 5,
            duplicate: 6,
            retransmitted: 7,
        };
        assert_eq!(
            losses(&report(|_| 0), &report(|_| 0), &here),
            ", corrupt frames 2, oversized frames 3, foreign frames 4, out of order 5, duplicates 6, \
             retransmissions 7"
        );
    }
}
