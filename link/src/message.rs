//! The kinds of numbered messages. Their bodies are fixed little-endian records.
//!
//! | kind | to | message | body |
//! |---|---|---|---|
//! | 0x01 | device | configure | [`Configuration`](crate::Configuration), 67 bytes |
//! | 0x02 | device | photons | [`Token`](crate::Token)s |
//! | 0x03 | device | synchronise | anything |
//! | 0x04 | device | statistics request | none |
//! | 0x05 | device | sensor request | none |
//! | 0x06 | device | histogram request | address of a pixel, 2 bytes |
//! | 0x81 | host | configured | none |
//! | 0x82 | host | refused | a [`Refusal`](crate::Refusal), 1 byte |
//! | 0x83 | host | events | AER words of 16 bytes |
//! | 0x84 | host | synchronised | the same, after all that came before it |
//! | 0x85 | host | statistics | [`Report`](crate::Report), 226 bytes |
//! | 0x86 | host | sensor | [`SensorRecord`](crate::SensorRecord), 24 bytes |
//! | 0x87 | host | histogram | [`HistogramPart`](crate::HistogramPart), or why there is none |
//!
//! Reserved: 0x07 and 0x88 for a settings request and the settings.

use dtof_core::AER_VERSION;

use crate::endpoint::GREETING_BYTES;

/// The version both ends announce when a session begins.
pub const LINK_VERSION: u16 = 6;

/// Host to device: a [`Configuration`](crate::Configuration).
pub const CONFIGURE: u8 = 0x01;
/// Host to device: [`Token`](crate::Token) after [`Token`](crate::Token).
pub const PHOTONS: u8 = 0x02;
/// Host to device: answer when everything before it is done.
pub const SYNCHRONISE: u8 = 0x03;
/// Host to device: send a [`Report`](crate::Report).
pub const STATISTICS_REQUEST: u8 = 0x04;
/// Host to device: send a [`SensorRecord`](crate::SensorRecord).
pub const SENSOR_REQUEST: u8 = 0x05;
/// Host to device: send the histogram of a pixel.
pub const HISTOGRAM_REQUEST: u8 = 0x06;
/// Device to host: the configuration is in force.
pub const CONFIGURED: u8 = 0x81;
/// Device to host: the configuration is refused, with a [`Refusal`](crate::Refusal).
pub const REFUSED: u8 = 0x82;
/// Device to host: AER words.
pub const EVENTS: u8 = 0x83;
/// Device to host: everything before it is done. It has the body of the request.
pub const SYNCHRONISED: u8 = 0x84;
/// Device to host: a [`Report`](crate::Report).
pub const STATISTICS: u8 = 0x85;
/// Device to host: a [`SensorRecord`](crate::SensorRecord).
pub const SENSOR: u8 = 0x86;
/// Device to host: a [`HistogramPart`](crate::HistogramPart), or a
/// [`NoHistogram`](crate::NoHistogram).
pub const HISTOGRAM: u8 = 0x87;

/// The greeting of an end: versions of link and AER words, and of a device its bins
/// and pixels.
#[must_use]
pub const fn greeting(bins: u16, pixels: u16) -> [u8; GREETING_BYTES] {
    let [a, b] = LINK_VERSION.to_le_bytes();
    let [c, d] = AER_VERSION.to_le_bytes();
    let [e, f] = bins.to_le_bytes();
    let [g, h] = pixels.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}
