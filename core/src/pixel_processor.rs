//! The pixel processor of an FPGA (`softcore/rtl/pixels`): its settings, and its events.
//!
//! It does in hardware what [`AsyncPixel`](crate::AsyncPixel) does in software, for
//! macropixels of 128 bins with 10-bit counters and the paper's rule. The same photons and
//! looks give the same events. `docs/softcore.md` has its registers.
//!
//! ```
//! use dtof_core::pixel_processor::{ProcessorEvent, ProcessorSettings};
//! use dtof_core::{AerError, PixelConfig, SubBinOffset, checked};
//!
//! const SETTINGS: ProcessorSettings =
//!     checked!(ProcessorSettings::of(&checked!(PixelConfig::paper().build())));
//! assert_eq!(SETTINGS.registers()[0], 40 << 16 | 4); // L1 and X
//!
//! // The seven words of an event: macropixel 2, N = 44, bin 60, 9 photons, no neighbours.
//! let event = ProcessorEvent::from_registers([44 << 16 | 2, 1 << 30 | 60 << 20, 9, 0, 0, 0, 0]);
//! let event = event.depth_event()?;
//! assert_eq!((event.peak_bin.raw(), event.peak_count.raw()), (60, 9));
//! assert_eq!(event.offset, SubBinOffset::CENTRE);
//! # Ok::<(), AerError>(())
//! ```
//!
//! Cost of an event from the registers to its word: some 60 instructions.

use crate::aer::{AerDecoder, AerEncoder, AerError, AerRecord, AerWord};
use crate::check::impl_error;
use crate::config::PixelConfig;
use crate::depth::{DepthEstimator, offset_of};
use crate::event::DepthEvent;
use crate::histogram::counter::{Count10, CounterWidth};
use crate::units::{EchoNumber, LaserCycle};

/// The contents of the registers `LOOK` to `GATE_END`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProcessorSettings([u32; 5]);

/// What the pixel processor cannot do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ProcessorError {
    /// It reports only one echo of an exposure.
    Echoes,
    /// It cannot track.
    Tracking,
    /// It uses three bins for the depth.
    Estimator,
    /// Its counters hold 1023 photons.
    MinimumCount,
}

impl ProcessorError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Echoes => "the pixel processor reports only one echo",
            Self::Tracking => "the pixel processor cannot track",
            Self::Estimator => "the pixel processor has only the centroid of three bins",
            Self::MinimumCount => {
                "the pixel processor counts to 1023 photons: the minimum count is higher"
            }
        }
    }
}

impl_error!(ProcessorError);

impl ProcessorSettings {
    /// The settings of `config`.
    ///
    /// # Errors
    /// Fails if `config` needs what only the software can do.
    pub const fn of(config: &PixelConfig<128>) -> Result<Self, ProcessorError> {
        if config.echoes().raw() > EchoNumber::FIRST.raw() {
            return Err(ProcessorError::Echoes);
        }
        if config.tracking().is_some() {
            return Err(ProcessorError::Tracking);
        }
        if !matches!(config.estimator(), DepthEstimator::Centroid3) {
            return Err(ProcessorError::Estimator);
        }
        let threshold = config.rule().threshold();
        let minimum_count = threshold.minimum_count().raw();
        if minimum_count > Count10::MAX {
            return Err(ProcessorError::MinimumCount);
        }
        let [first, second, middle, fourth, end] = config.gate().quadrant_starts();
        Ok(Self([
            (config.l1() as u32) << 16 | config.x() as u32,
            (config.is_first_photon_only() as u32) << 16 | config.l2() as u32,
            minimum_count << 16 | threshold.alpha().to_bits() as u32,
            (fourth as u32) << 24 | (middle as u32) << 16 | (second as u32) << 8 | first as u32,
            end as u32,
        ]))
    }

    /// The words of the registers `LOOK`, `END`, `RULE`, `GATE` and `GATE_END`.
    #[must_use]
    pub const fn registers(&self) -> [u32; 5] {
        self.0
    }
}

/// An event as read from the registers `EVENT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProcessorEvent([u32; 7]);

impl ProcessorEvent {
    /// From the seven words of `EVENT`.
    #[must_use]
    pub const fn from_registers(words: [u32; 7]) -> Self {
        Self(words)
    }

    /// Its AER word: [`AerWord::depth_event`] of [`Self::depth_event`].
    #[inline]
    #[must_use]
    pub fn word(&self) -> AerWord {
        let [low, bin, count, rest, neighbours, ..] = self.0;
        let (peak, background) = (count & 0x3ff, count >> 24 | (rest & 3) << 8);
        let (left, right) = (neighbours & 0x3ff, neighbours >> 16 & 0x3ff);
        let above = |count: u32| count.saturating_sub(background);
        let offset = offset_of(above(left), above(peak), above(right));
        let offset = u32::from(offset.raw().cast_unsigned()) & 0x3ff;
        let parts = [low, bin, count, rest | offset << 16].map(u32::to_le_bytes);
        AerWord::from_le_bytes(concatenated(parts))
    }

    /// The laser cycle at the end of which the pixel decided.
    #[inline]
    #[must_use]
    pub const fn cycle(&self) -> LaserCycle {
        let [_, bin, .., high, higher] = self.0;
        LaserCycle::new((bin & 0xffff) as u64 | (high as u64) << 16 | (higher as u64) << 48)
    }

    /// The word of the event, and the time word to send before it if one is due.
    #[inline]
    #[must_use = "without the time word the events that follow have a wrong laser cycle"]
    pub fn encode(&self, encoder: &mut AerEncoder) -> (Option<AerWord>, AerWord) {
        (encoder.time(self.cycle()), self.word())
    }

    /// The event.
    ///
    /// # Errors
    /// Fails if the words are not those of an event.
    pub fn depth_event(&self) -> Result<DepthEvent, AerError> {
        let mut decoder = AerDecoder::new();
        decoder.decode(AerWord::time(self.cycle()))?;
        match decoder.decode(self.word())? {
            AerRecord::Event(event) => Ok(event),
            _ => Err(AerError::UnknownKind),
        }
    }
}

#[inline(always)]
const fn concatenated([a, b, c, d]: [[u8; 4]; 4]) -> [u8; AerWord::BYTES] {
    [
        a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], c[0], c[1], c[2], c[3], d[0], d[1], d[2],
        d[3],
    ]
}
