//! The statistics of a device.

use dtof_core::Statistics;
use heapless::Vec;

use crate::endpoint::LinkCounters;

/// What the device has done since it was configured, and what happened to the
/// link since it was switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// Laser cycles that have ended.
    pub cycles: u64,
    /// All pixels and whole histograms together; of events those sent before
    /// the report.
    pub statistics: Statistics,
    /// Photons of pixels the device does not have.
    pub unaddressed: u64,
    /// Bytes the receive queue had no room for.
    pub overrun: u32,
    /// Messages with a kind or a body that the device does not know.
    pub unknown: u32,
    /// Errors of the sensor.
    pub sensor_errors: u32,
    /// The last of them: the number of a
    /// [`FaultRecord`](crate::FaultRecord), 0 before the first.
    pub last_sensor_error: u8,
    /// The device's end of the link.
    pub link: LinkCounters,
}

impl Report {
    /// Bytes of the record.
    pub const BYTES: usize = 10 * 8 + 10 * 4 + 1;

    /// As it is sent.
    #[must_use]
    pub fn to_le_bytes(&self) -> Vec<u8, { Self::BYTES }> {
        let Statistics {
            counted,
            saturated,
            rejected,
            gated_out,
            events,
            deferred,
            expired,
            expired_deferred,
        } = self.statistics;
        let wide = [
            self.cycles,
            counted,
            saturated,
            rejected,
            gated_out,
            events,
            deferred,
            expired,
            expired_deferred,
            self.unaddressed,
        ];
        let LinkCounters {
            frames,
            corrupt,
            oversized,
            foreign,
            out_of_order,
            duplicate,
            retransmitted,
        } = self.link;
        let narrow = [
            self.overrun,
            self.unknown,
            self.sensor_errors,
            frames,
            corrupt,
            oversized,
            foreign,
            out_of_order,
            duplicate,
            retransmitted,
        ];
        let wide = wide.into_iter().flat_map(u64::to_le_bytes);
        let narrow = narrow.into_iter().flat_map(u32::to_le_bytes);
        let last = [self.last_sensor_error];
        wide.chain(narrow).chain(last).collect()
    }

    /// As it was received, or `None` if it is not as long as the record.
    #[must_use]
    pub fn from_le_bytes(bytes: &[u8]) -> Option<Self> {
        let (&last_sensor_error, numbers) = bytes.split_last()?;
        let (wide, narrow) = numbers.split_at_checked(10 * 8)?;
        let mut wide = wide
            .chunks_exact(8)
            .filter_map(|eight| Some(u64::from_le_bytes(eight.try_into().ok()?)));
        let mut narrow = narrow
            .chunks_exact(4)
            .filter_map(|four| Some(u32::from_le_bytes(four.try_into().ok()?)));
        // Fields are read in the order they are written.
        let report = Self {
            cycles: wide.next()?,
            statistics: Statistics {
                counted: wide.next()?,
                saturated: wide.next()?,
                rejected: wide.next()?,
                gated_out: wide.next()?,
                events: wide.next()?,
                deferred: wide.next()?,
                expired: wide.next()?,
                expired_deferred: wide.next()?,
            },
            unaddressed: wide.next()?,
            overrun: narrow.next()?,
            unknown: narrow.next()?,
            sensor_errors: narrow.next()?,
            last_sensor_error,
            link: LinkCounters {
                frames: narrow.next()?,
                corrupt: narrow.next()?,
                oversized: narrow.next()?,
                foreign: narrow.next()?,
                out_of_order: narrow.next()?,
                duplicate: narrow.next()?,
                retransmitted: narrow.next()?,
            },
        };
        (bytes.len() == Self::BYTES).then_some(report)
    }
}
