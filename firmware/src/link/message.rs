//! What the numbered messages say, as fixed little-endian records.
//!
//! | kind | to | message | body |
//! |---|---|---|---|
//! | 0x01 | device | configure | [`Configuration`], 39 bytes |
//! | 0x02 | device | photons | [`Token`]s |
//! | 0x03 | device | synchronise | anything |
//! | 0x04 | device | statistics request | none |
//! | 0x05 | device | sensor request | none |
//! | 0x81 | host | configured | none |
//! | 0x82 | host | refused | a [`Refusal`], 1 byte |
//! | 0x83 | host | events | AER words of 16 bytes |
//! | 0x84 | host | synchronised | the same, after all that came before it |
//! | 0x85 | host | statistics | [`Report`], 121 bytes |
//! | 0x86 | host | sensor | [`About`], 10 bytes |

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    ConfigError, GateError, RangeScaleError, Statistics, WindowWidthError, ZeroThresholdError,
};
use heapless::Vec;

use super::endpoint::LinkCounters;
use crate::sensor::About;

/// The version both ends announce when a session begins.
pub const LINK_VERSION: u16 = 3;

/// Host to device: a [`Configuration`].
pub const CONFIGURE: u8 = 0x01;
/// Host to device: [`Token`] after [`Token`].
pub const PHOTONS: u8 = 0x02;
/// Host to device: answer when all before it is done.
pub const SYNCHRONISE: u8 = 0x03;
/// Host to device: send a [`Report`].
pub const STATISTICS_REQUEST: u8 = 0x04;
/// Host to device: say what the sensor is.
pub const SENSOR_REQUEST: u8 = 0x05;
/// Device to host: the configuration is in force.
pub const CONFIGURED: u8 = 0x81;
/// Device to host: the configuration is not; a [`Refusal`].
pub const REFUSED: u8 = 0x82;
/// Device to host: AER words.
pub const EVENTS: u8 = 0x83;
/// Device to host: all before is done; the body of the question.
pub const SYNCHRONISED: u8 = 0x84;
/// Device to host: a [`Report`].
pub const STATISTICS: u8 = 0x85;
/// Device to host: what [`about_to_le_bytes`] makes.
pub const SENSOR: u8 = 0x86;

/// Bytes of what a device says of its sensor.
pub const ABOUT_BYTES: usize = 10;

/// What a device says of its sensor, or that it has none: no pixels.
#[must_use]
pub fn about_to_le_bytes(sensor: Option<&About>) -> [u8; ABOUT_BYTES] {
    let Some(about) = sensor else {
        return [0; ABOUT_BYTES];
    };
    let [a, b] = about.pixels.to_le_bytes();
    let [c, d, e, f] = about.bin_width.unwrap_or_default().to_le_bytes();
    let [g, h, i, j] = about.offset.to_le_bytes();
    [a, b, c, d, e, f, g, h, i, j]
}

/// As it was received: the sensor, or that there is none. `None` if it is not as
/// long as that.
#[must_use]
pub fn about_from_le_bytes(bytes: &[u8]) -> Option<Option<About>> {
    let [a, b, c, d, e, f, g, h, i, j]: [u8; ABOUT_BYTES] = bytes.try_into().ok()?;
    let pixels = u16::from_le_bytes([a, b]);
    let bin_width = U16F16::from_le_bytes([c, d, e, f]);
    Some((pixels > 0).then_some(About {
        pixels,
        bin_width: (bin_width > 0).then_some(bin_width),
        offset: I24F8::from_le_bytes([g, h, i, j]),
    }))
}

/// What a photons message is made of. Tokens begin at pixel 0 in each message
/// and after each end of a laser cycle, and do not reach over the end of a
/// message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Token {
    /// A photon of the present pixel in the present laser cycle: one byte for
    /// codes below 128, three for others.
    Photon {
        /// Its TDC code.
        code: u16,
    },
    /// The present pixel is one farther on by `pixels`, 1 to 64: one byte.
    Advance {
        /// How many.
        pixels: u8,
    },
    /// The present laser cycle ends, and `cycles - 1` empty ones after it:
    /// three bytes.
    EndOfCycles {
        /// How many; none if 0.
        cycles: u16,
    },
}

impl Token {
    /// Bytes of the longest.
    pub const MAX_BYTES: usize = 3;
    const ADVANCE: u8 = 0x80;
    const PHOTON: u8 = 0xc0;
    const END: u8 = 0xc1;

    /// As it is sent.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8, { Self::MAX_BYTES }> {
        let (first, number) = match self {
            Self::Photon { code } => match u8::try_from(code) {
                Ok(code) if code < Self::ADVANCE => return Vec::from_iter([code]),
                _ => (Self::PHOTON, code),
            },
            Self::Advance { pixels } => {
                return Vec::from_iter([Self::ADVANCE | (pixels.wrapping_sub(1) & 0x3f)]);
            }
            Self::EndOfCycles { cycles } => (Self::END, cycles),
        };
        let [low, high] = number.to_le_bytes();
        Vec::from_iter([first, low, high])
    }

    /// The first token of `bytes` and the bytes after it; `None` if there is
    /// none.
    #[must_use]
    pub fn split_first(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (&first, rest) = bytes.split_first()?;
        match first {
            0..Self::ADVANCE => Some((Self::Photon { code: first.into() }, rest)),
            Self::ADVANCE..Self::PHOTON => Some((
                Self::Advance {
                    pixels: (first & 0x3f) + 1,
                },
                rest,
            )),
            Self::PHOTON | Self::END => {
                let (&number, rest) = rest.split_first_chunk()?;
                let number = u16::from_le_bytes(number);
                let token = if first == Self::PHOTON {
                    Self::Photon { code: number }
                } else {
                    Self::EndOfCycles { cycles: number }
                };
                Some((token, rest))
            }
            _ => None,
        }
    }
}

/// Where the device takes its photons from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// From the link: photons messages.
    Link,
    /// From its sensor.
    Sensor,
}

/// How the pixels are to operate, not yet validated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// α in 1/256; of the paper's rule.
    pub alpha: u16,
    /// Photons a reported peak, or the window around it, holds at least.
    pub minimum_count: u16,
    /// Laser cycles between looks.
    pub x: u16,
    /// The exposure a decision must exceed.
    pub l1: u16,
    /// The exposure at which a pixel starts over.
    pub l2: u16,
    /// First bin that may hold the peak.
    pub gate_first: u16,
    /// Last bin that may hold the peak.
    pub gate_last: u16,
    /// Pixels, addresses 0 up.
    pub pixels: u16,
    /// Bin width in 1/65,536 ps.
    pub bin_width: u32,
    /// Range offset in 1/256 mm.
    pub offset: i32,
    /// 0: link, 1: sensor.
    pub source: u8,
    /// 0: the paper's rule, 1: a window.
    pub rule: u8,
    /// Bins in the window of the rule.
    pub window: u8,
    /// z in 1/4096; of the window's rule.
    pub z: u16,
    /// 0: centre of mass of three bins, 1: centred window.
    pub estimator: u8,
    /// Half the width of the centred window in 1/256 bin.
    pub half_width: u16,
    /// 0: depth events, 1: dynamic depth events.
    pub output: u8,
    /// What a mean depth is compared with, 0: that of the event before, 1: the one
    /// reported last; of dynamic depth.
    pub reference: u8,
    /// How far a mean depth has to move, in 1/256 mm; of dynamic depth.
    pub threshold: u32,
    /// 1: the TDC takes one photon a laser cycle, so that events say when it piles up;
    /// 0: any number.
    pub one_hit: u8,
}

impl Configuration {
    /// Bytes of the record.
    pub const BYTES: usize = 39;

    /// As it is sent.
    #[must_use]
    pub fn to_le_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let fields = [
            self.alpha,
            self.minimum_count,
            self.x,
            self.l1,
            self.l2,
            self.gate_first,
            self.gate_last,
            self.pixels,
        ];
        let wide = self
            .bin_width
            .to_le_bytes()
            .into_iter()
            .chain(self.offset.to_le_bytes());
        let [z, z_high] = self.z.to_le_bytes();
        let [half_width, half_width_high] = self.half_width.to_le_bytes();
        let all = fields
            .into_iter()
            .flat_map(u16::to_le_bytes)
            .chain(wide)
            .chain([self.source, self.rule, self.window, z, z_high])
            .chain([self.estimator, half_width, half_width_high])
            .chain([self.output, self.reference])
            .chain(self.threshold.to_le_bytes())
            .chain([self.one_hit]);
        for (place, byte) in bytes.iter_mut().zip(all) {
            *place = byte;
        }
        bytes
    }

    /// As it was received, or `None` if it is not as long as the record.
    #[must_use]
    pub fn from_le_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; Self::BYTES] = bytes.try_into().ok()?;
        let two = |at: usize| Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?));
        let four = |at: usize| bytes.get(at..at + 4)?.try_into().ok();
        Some(Self {
            alpha: two(0)?,
            minimum_count: two(2)?,
            x: two(4)?,
            l1: two(6)?,
            l2: two(8)?,
            gate_first: two(10)?,
            gate_last: two(12)?,
            pixels: two(14)?,
            bin_width: u32::from_le_bytes(four(16)?),
            offset: i32::from_le_bytes(four(20)?),
            source: *bytes.get(24)?,
            rule: *bytes.get(25)?,
            window: *bytes.get(26)?,
            z: two(27)?,
            estimator: *bytes.get(29)?,
            half_width: two(30)?,
            output: *bytes.get(32)?,
            reference: *bytes.get(33)?,
            threshold: u32::from_le_bytes(four(34)?),
            one_hit: *bytes.get(38)?,
        })
    }
}

/// Why a configuration is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Refusal {
    /// Not as long as the record, or of an unknown source, rule, estimator, output,
    /// reference or number of hits.
    Unknown = 1,
    /// X is 0.
    ZeroX = 2,
    /// X is greater than L1.
    XAboveL1 = 3,
    /// L2 is not greater than L1.
    L2NotAboveL1 = 4,
    /// No look falls between L1 and L2.
    NoLook = 5,
    /// The gate ends past the last bin.
    GatePastLastBin = 6,
    /// The gate leaves fewer than 8 bins.
    GateTooNarrow = 7,
    /// The bin width is zero, or a range would be out of range.
    Range = 8,
    /// No pixels, or more than the device has.
    Pixels = 9,
    /// The minimum peak count is 0 or more than a counter holds.
    MinimumCount = 10,
    /// The device has no sensor.
    NoSensor = 11,
    /// The bins of the sensor are not as wide as that.
    BinWidth = 12,
    /// The window of the rule is not 1 to 7 bins wide.
    WindowWidth = 13,
    /// The centred window is not 1 to 4 bins wide on either side.
    HalfWidth = 14,
    /// The threshold of dynamic depth is less than half of 1/256 bin.
    ZeroThreshold = 15,
}

impl Refusal {
    const ALL: [Self; 15] = [
        Self::Unknown,
        Self::ZeroX,
        Self::XAboveL1,
        Self::L2NotAboveL1,
        Self::NoLook,
        Self::GatePastLastBin,
        Self::GateTooNarrow,
        Self::Range,
        Self::Pixels,
        Self::MinimumCount,
        Self::NoSensor,
        Self::BinWidth,
        Self::WindowWidth,
        Self::HalfWidth,
        Self::ZeroThreshold,
    ];

    /// From its number on the wire.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|&refusal| refusal as u8 == number)
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unknown => f.write_str("the configuration is not one this device knows"),
            Self::ZeroX => ConfigError::ZeroX.fmt(f),
            Self::XAboveL1 => ConfigError::XAboveL1.fmt(f),
            Self::L2NotAboveL1 => ConfigError::L2NotAboveL1.fmt(f),
            Self::NoLook => ConfigError::NoLook.fmt(f),
            Self::GatePastLastBin => GateError::PastLastBin.fmt(f),
            Self::GateTooNarrow => GateError::TooNarrow.fmt(f),
            Self::Range => f.write_str("the bin width is zero, or a range would be out of range"),
            Self::Pixels => f.write_str("the device does not have that many pixels"),
            Self::MinimumCount => f.write_str("the minimum peak count must be from 1 to 1023"),
            Self::NoSensor => f.write_str("the device has no sensor"),
            Self::BinWidth => f.write_str("the bins of the sensor are not as wide as that"),
            Self::WindowWidth => WindowWidthError.fmt(f),
            Self::HalfWidth => f.write_str("the centred window must be 1 to 4 bins to either side"),
            Self::ZeroThreshold => ZeroThresholdError.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

impl From<ConfigError> for Refusal {
    fn from(error: ConfigError) -> Self {
        match error {
            ConfigError::ZeroX => Self::ZeroX,
            ConfigError::XAboveL1 => Self::XAboveL1,
            ConfigError::L2NotAboveL1 => Self::L2NotAboveL1,
            ConfigError::NoLook => Self::NoLook,
        }
    }
}

impl From<GateError> for Refusal {
    fn from(error: GateError) -> Self {
        match error {
            GateError::PastLastBin => Self::GatePastLastBin,
            GateError::TooNarrow => Self::GateTooNarrow,
        }
    }
}

impl From<WindowWidthError> for Refusal {
    fn from(_: WindowWidthError) -> Self {
        Self::WindowWidth
    }
}

impl From<ZeroThresholdError> for Refusal {
    fn from(_: ZeroThresholdError) -> Self {
        Self::ZeroThreshold
    }
}

impl From<RangeScaleError> for Refusal {
    fn from(_: RangeScaleError) -> Self {
        Self::Range
    }
}

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
    /// [`SensorFault`](crate::sensor::SensorFault), 0 before the first.
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
