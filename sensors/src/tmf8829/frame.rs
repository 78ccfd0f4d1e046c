//! Frames as they come out of the FIFO.
//!
//! | bytes | |
//! |---|---|
//! | 0 | FIFOSTATUS |
//! | 1..5 | systick |
//! | 5 | 0x10 a frame of results, 0x20 of histograms; low half: the mode of the zones |
//! | 6 | results: their format, and bit 6 for the odd rows; histograms: the time slot |
//! | 7..9 | length less 9 |
//! | 9..13 | number of the frame, those of both kinds together |
//! | 13..21 | temperatures, and more that is not used |
//! | 21.. | data: four reference histograms and those of some zones, or the results of zones |
//! | last 12 | stamps of the time slots, flags, 0, 0xE0F7 |
//!
//! Numbers are little-endian. A count has three bytes. The first 21 bytes are read from
//! FIFOSTATUS on, all others from the FIFO.

use super::config::Config;
use super::error::DeviceError;
use super::registers::OVERRUN;
use super::zones::{FEW_BINS, REFERENCES};

/// Bytes in front of the data.
pub(super) const HEADER: usize = 21;
/// Bytes behind the data.
pub(super) const END: u16 = 12;
/// Bytes that the length in the header does not count.
const UNCOUNTED: u16 = 9;
const MARKER: u16 = 0xE0F7;
const RESULT: u8 = 0x10;
const HISTOGRAM: u8 = 0x20;
/// The bit of a format for the odd rows.
const SECOND: u8 = 1 << 6;

/// What a frame holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Of all zones or, in halves, of the even rows first.
    Results { is_second: bool },
    /// Of this time slot.
    Histograms { slot: u8 },
}

/// The beginning of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) kind: Kind,
    pub(super) number: u32,
    /// Bytes of data.
    pub(super) data: u16,
}

impl Header {
    /// # Errors
    /// Fails if this is not the header of a frame of the configured measurement.
    pub(super) fn of(bytes: &[u8], config: &Config) -> Result<Self, DeviceError> {
        let Some(&[status, _, _, _, _, id, part, size_l, size_h, a, b, c, d, ..]) =
            bytes.first_chunk::<HEADER>()
        else {
            return Err(DeviceError::NoEnd { marker: 0 });
        };
        if status & OVERRUN != 0 {
            return Err(DeviceError::Overrun { status });
        }
        let settings = config.settings();
        let zones = settings.zones;
        let payload = u16::from_le_bytes([size_l, size_h]);
        let results = settings.results;
        let (kind, data) = if id == RESULT | zones.mode() && part & !SECOND == results.format() {
            let is_second = part & SECOND != 0;
            let data = zones.result_zones() * results.bytes();
            (Kind::Results { is_second }, data)
        } else if id == HISTOGRAM | zones.mode() && part < zones.frames() {
            let bins = REFERENCES * FEW_BINS + zones.frame_zones() * zones.bins();
            (Kind::Histograms { slot: part }, 3 * bins)
        } else {
            return Err(DeviceError::ForeignFrame { id, part, payload });
        };
        #[allow(clippy::cast_possible_truncation, reason = "21")]
        let length = HEADER as u16 + data + END;
        let is_halved = zones.is_halved() || kind != Kind::Results { is_second: true };
        if payload != length - UNCOUNTED || !is_halved {
            return Err(DeviceError::ForeignFrame { id, part, payload });
        }
        Ok(Self {
            kind,
            number: u32::from_le_bytes([a, b, c, d]),
            data,
        })
    }
}

/// The flags at the end of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Flags(u8);

impl Flags {
    /// # Errors
    /// Fails if the end marker is missing.
    pub(super) fn of(end: &[u8; END as usize]) -> Result<Self, DeviceError> {
        let [.., flags, _, low, high] = *end;
        match u16::from_le_bytes([low, high]) {
            MARKER => Ok(Self(flags)),
            marker => Err(DeviceError::NoEnd { marker }),
        }
    }

    /// # Errors
    /// Fails if the frame was aborted or is not marked as valid.
    pub(super) const fn check(self) -> Result<(), DeviceError> {
        if self.0 & 0b1100_0001 == 1 {
            Ok(())
        } else {
            Err(DeviceError::Aborted { flags: self.0 })
        }
    }

    /// SPADs were overloaded, or the laser was at its limit.
    pub(super) const fn is_limited(self) -> bool {
        self.0 & 0b11_1000 != 0
    }
}
