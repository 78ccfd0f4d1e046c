//! The histogram of a pixel, in one or more messages.
//!
//! Eight counts of `width` bits are `width` bytes, lowest bits first. All counts of a histogram
//! have the same width, the smallest that fits, and a message has as many eights as fit:
//! 128 counts of up to 14 bits are one message, wider ones two.
//!
//! ```
//! use dtof_core::{LaserCycle, PixelAddress};
//! use dtof_link::{HistogramHead, HistogramPart};
//!
//! let head = HistogramHead {
//!     pixel: PixelAddress::new(3),
//!     is_whole: false,
//!     cycle: LaserCycle::new(1000),
//!     exposure: 40,
//! };
//! let mut counts = [1; 128];
//! counts[60] = 500; // 9 bits
//! let mut messages = head.messages(&counts);
//! assert_eq!(messages.len(), 1);
//! let mut body = heapless::Vec::new();
//! messages.next().unwrap().write(&mut body);
//! assert_eq!(body.len(), 19 + 9 * 128 / 8);
//! let part = HistogramPart::from_le_bytes(&body).unwrap().unwrap();
//! assert_eq!((part.head(), part.first_bin()), (head, 0));
//! assert!(part.counts().eq(counts));
//! ```

use dtof_core::{LaserCycle, PixelAddress};
use heapless::Vec;

use crate::endpoint::BODY_BYTES;
use crate::numbered::numbered;

/// Bytes before the counts.
const HEAD_BYTES: usize = 19;
/// Counts that are packed together.
const EIGHT: usize = 8;
/// The most bits of a count; a larger count is sent as the largest.
const WIDEST: u32 = 24;
const LARGEST: u32 = (1 << WIDEST) - 1;

/// What a histogram belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HistogramHead {
    /// The pixel.
    pub pixel: PixelAddress,
    /// Whether the sensor gave it complete. Otherwise it has the photons of the pixel's current
    /// exposure so far.
    pub is_whole: bool,
    /// Laser cycles that had ended when it was taken.
    pub cycle: LaserCycle,
    /// Laser cycles of the histogram: it began at `cycle - exposure`.
    pub exposure: u32,
}

numbered! {
    /// Why there is no histogram.
    NoHistogram {
        /// No configuration is in force.
        NoConfiguration = 1: "the device is not configured",
        /// The configuration has no such pixel, or the sensor has none.
        NoPixel = 2: "the device has no such pixel",
        /// Another request or a configuration came before there was room for the answer, or
        /// before the sensor had a histogram.
        GivenUp = 3: "another request came before the answer",
        /// The sensor failed before it had a histogram.
        Sensor = 4: "the sensor failed",
    }
}

impl HistogramHead {
    /// The messages that carry `counts`. Their number is a multiple of 8; any more are cut off.
    #[must_use]
    pub fn messages(
        self,
        counts: &[u32],
    ) -> impl ExactSizeIterator<Item = HistogramMessage<'_>> + use<'_> {
        let used = counts.iter().fold(1, |all, count| all | count);
        #[allow(clippy::cast_possible_truncation, reason = "at most 24")]
        let width = (u32::BITS - used.min(LARGEST).leading_zeros()) as u8;
        let (eights, _) = counts.as_chunks::<EIGHT>();
        // At least 9.
        let most = (BODY_BYTES - HEAD_BYTES) / usize::from(width.max(1));
        let parts = eights.chunks(most.max(1)).enumerate();
        parts.map(move |(number, eights)| HistogramMessage {
            head: self,
            #[allow(clippy::cast_possible_truncation, reason = "no histogram is so long")]
            first_bin: (number * most * EIGHT) as u16,
            width,
            eights,
        })
    }
}

/// A message that carries a part of a histogram.
#[derive(Clone, Copy, Debug)]
pub struct HistogramMessage<'a> {
    head: HistogramHead,
    first_bin: u16,
    width: u8,
    eights: &'a [[u32; EIGHT]],
}

impl HistogramMessage<'_> {
    /// Writes it into an empty `body`.
    pub fn write(&self, body: &mut Vec<u8, BODY_BYTES>) {
        let head = &self.head;
        // There is room for all of it: the eights were counted.
        let mut put = |bytes: &[u8]| {
            let _ = body.extend_from_slice(bytes);
        };
        put(&head.pixel.raw().to_le_bytes());
        put(&[0, head.is_whole.into()]);
        put(&head.cycle.raw().to_le_bytes());
        put(&head.exposure.to_le_bytes());
        put(&self.first_bin.to_le_bytes());
        put(&[self.width]);
        let (mut bits, mut rest) = (0, 0u32);
        for &count in self.eights.as_flattened() {
            rest |= count.min(LARGEST) << bits;
            bits += self.width;
            while bits >= 8 {
                let _ = body.push((rest & 0xff) as u8);
                rest >>= 8;
                bits -= 8;
            }
        }
    }
}

/// Part of a histogram, as a message carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HistogramPart<'a> {
    head: HistogramHead,
    first_bin: u16,
    width: u8,
    packed: &'a [u8],
}

impl<'a> HistogramPart<'a> {
    /// Reads a message: part of a histogram, or a pixel and why it has none. `None` if the body
    /// is neither.
    #[must_use]
    #[allow(clippy::type_complexity)]
    pub fn from_le_bytes(body: &'a [u8]) -> Option<Result<Self, (PixelAddress, NoHistogram)>> {
        let (&[a, b, reason], rest) = body.split_first_chunk()?;
        let pixel = PixelAddress::new(u16::from_le_bytes([a, b]));
        if reason != 0 {
            let reason = NoHistogram::from_number(reason)?;
            return rest.is_empty().then_some(Err((pixel, reason)));
        }
        let (&[whole], rest) = rest.split_first_chunk()?;
        let (&cycle, rest) = rest.split_first_chunk()?;
        let (&exposure, rest) = rest.split_first_chunk()?;
        let (&[c, d, width], packed) = rest.split_first_chunk()?;
        let is_packed = (1..=WIDEST).contains(&u32::from(width))
            && !packed.is_empty()
            && packed.len().is_multiple_of(width.into());
        (whole < 2 && is_packed).then_some(Ok(Self {
            head: HistogramHead {
                pixel,
                is_whole: whole == 1,
                cycle: LaserCycle::new(u64::from_le_bytes(cycle)),
                exposure: u32::from_le_bytes(exposure),
            },
            first_bin: u16::from_le_bytes([c, d]),
            width,
            packed,
        }))
    }

    /// What the histogram belongs to.
    #[must_use]
    pub const fn head(&self) -> HistogramHead {
        self.head
    }

    /// The bin of the first count.
    #[must_use]
    pub const fn first_bin(&self) -> u16 {
        self.first_bin
    }

    /// The counts, from the first bin on.
    pub fn counts(&self) -> impl Iterator<Item = u32> + use<'a> {
        let (width, mut bytes) = (self.width, self.packed.iter());
        let (mut bits, mut rest) = (0, 0u32);
        core::iter::from_fn(move || {
            while bits < width {
                rest |= u32::from(*bytes.next()?) << bits;
                bits += 8;
            }
            let count = rest & (LARGEST >> (WIDEST - u32::from(width)));
            rest >>= width;
            bits -= width;
            Some(count)
        })
    }
}

impl NoHistogram {
    /// The body of the message with this reason for `pixel`.
    #[must_use]
    pub fn message(self, pixel: PixelAddress) -> Vec<u8, BODY_BYTES> {
        let [a, b] = pixel.raw().to_le_bytes();
        Vec::from_array([a, b, self as u8])
    }
}
