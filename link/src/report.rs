//! The statistics of a device.

use crate::endpoint::LinkCounters;
use dtof_core::Statistics;

/// The statistics of the device since it was configured, and of the link since the
/// device was switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// Laser cycles that have ended.
    pub cycles: u64,
    /// Of all pixels and whole histograms; it counts the events sent before the
    /// report.
    pub statistics: Statistics,
    /// Of all blocks of pixels. Their photons are those of pixels, counted again.
    pub blocks: Statistics,
    /// Photons for pixels that the device does not have, or that it leaves out.
    pub unaddressed: u64,
    /// Bytes that did not fit the receive queue.
    pub overrun: u32,
    /// Messages with a kind or a body that the device does not know.
    pub unknown: u32,
    /// Errors of the sensor.
    pub sensor_errors: u32,
    /// The last error: the number of a [`FaultRecord`](crate::FaultRecord), 0 before
    /// the first.
    pub last_sensor_error: u8,
    /// How often the sensor was started, since the device was switched on or reset.
    pub sensor_starts: u32,
    /// How often the sensor was stopped.
    pub sensor_stops: u32,
    /// Why the sensor stopped last: the number of a [`StopReason`](crate::StopReason), 0 if it has not.
    pub stop_reason: u8,
    /// The device's end of the link.
    pub link: LinkCounters,
}

impl Report {
    /// Bytes of the record.
    pub const BYTES: usize = Self::WIDE * 8 + Self::NARROW * 4 + 2 + Self::LAST * 8;
    /// Numbers of 8 bytes.
    const WIDE: usize = 20;
    /// Numbers of 4 bytes.
    const NARROW: usize = 12;
    /// Numbers of 8 bytes after all others.
    const LAST: usize = 3;

    /// The numbers in the order of the record: those of 8 bytes, those of 4, and after two bytes
    /// the last ones of 8. Blocks have none of these: no dead time weighs them, and what counts once in a
    /// pixel counts once in its blocks.
    const fn numbers(
        &mut self,
    ) -> (
        [&mut u64; Self::WIDE],
        [&mut u32; Self::NARROW],
        [&mut u64; Self::LAST],
    ) {
        let (pixels, blocks) = (&mut self.statistics, &mut self.blocks);
        let link = &mut self.link;
        (
            [
                &mut self.cycles,
                &mut self.unaddressed,
                &mut pixels.counted,
                &mut pixels.excluded,
                &mut pixels.saturated,
                &mut pixels.rejected,
                &mut pixels.gated_out,
                &mut pixels.events,
                &mut pixels.deferred,
                &mut pixels.expired,
                &mut pixels.expired_deferred,
                &mut blocks.counted,
                &mut blocks.excluded,
                &mut blocks.saturated,
                &mut blocks.rejected,
                &mut blocks.gated_out,
                &mut blocks.events,
                &mut blocks.deferred,
                &mut blocks.expired,
                &mut blocks.expired_deferred,
            ],
            [
                &mut self.overrun,
                &mut self.unknown,
                &mut self.sensor_errors,
                &mut self.sensor_starts,
                &mut self.sensor_stops,
                &mut link.frames,
                &mut link.corrupt,
                &mut link.oversized,
                &mut link.foreign,
                &mut link.out_of_order,
                &mut link.duplicate,
                &mut link.retransmitted,
            ],
            [
                &mut pixels.ended_full,
                &mut pixels.blind_looks,
                &mut pixels.repeated,
            ],
        )
    }

    /// The bytes to send.
    #[must_use]
    pub fn to_le_bytes(mut self) -> [u8; Self::BYTES] {
        let codes = [self.last_sensor_error, self.stop_reason];
        let (wide, narrow, last) = self.numbers();
        let wide = wide.into_iter().flat_map(|number| number.to_le_bytes());
        let narrow = narrow.into_iter().flat_map(|number| number.to_le_bytes());
        let last = last.into_iter().flat_map(|number| number.to_le_bytes());
        let mut bytes = [0; Self::BYTES];
        for (byte, value) in bytes
            .iter_mut()
            .zip(wide.chain(narrow).chain(codes).chain(last))
        {
            *byte = value;
        }
        bytes
    }

    /// Reads the record. `None` if the length is wrong.
    #[must_use]
    pub fn from_le_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let (rest, lasts) = bytes.split_last_chunk::<{ Self::LAST * 8 }>()?;
        let (numbers, &[last_sensor_error, stop_reason]) = rest.split_last_chunk()?;
        let (eights, fours) = numbers.split_at_checked(Self::WIDE * 8)?;
        let mut report = Self {
            last_sensor_error,
            stop_reason,
            ..Self::default()
        };
        let (wide, narrow, last) = report.numbers();
        let (eights, lasts) = (eights.as_chunks().0, lasts.as_chunks().0);
        let numbers = wide.into_iter().zip(eights);
        for (number, bytes) in numbers.chain(last.into_iter().zip(lasts)) {
            *number = u64::from_le_bytes(*bytes);
        }
        for (number, bytes) in narrow.into_iter().zip(fours.as_chunks().0) {
            *number = u32::from_le_bytes(*bytes);
        }
        Some(report)
    }
}
