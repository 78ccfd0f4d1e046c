//! Address-event words: what leaves the pixel array.
//!
//! One depth event is one 128-bit word, sent as 16 bytes, least significant
//! first. The layout, its golden vectors and what will not change are in
//! `docs/aer-format.md`. A word carries the low 16 bits of its laser cycle; a
//! time word carries the rest and precedes the first event and every event
//! whose upper bits differ from those of the event before. It is absolute: a
//! receiver that joins late or loses words is right again after the next one.
//!
//! ```
//! use dtof_core::{
//!     AerDecoder, AerEncoder, AerError, AerRecord, BinIndex, BlockLevel, Count, DepthEvent,
//!     EchoNumber, Flags, LaserCycle, PixelAddress, SubBinOffset,
//! };
//!
//! let event = DepthEvent {
//!     pixel: PixelAddress::new(2047),
//!     level: BlockLevel::PIXEL,
//!     echo: EchoNumber::FIRST,
//!     cycle: LaserCycle::new(5_000_000),
//!     exposure: 110,
//!     peak_bin: BinIndex::saturating(40),
//!     offset: SubBinOffset::CENTRE,
//!     peak_count: Count::saturating(37),
//!     background: Count::saturating(4),
//!     flags: Flags::NONE,
//! };
//! let (time, word) = AerEncoder::new().encode(&event);
//!
//! let mut decoder = AerDecoder::new();
//! assert_eq!(decoder.decode(word), Err(AerError::MissingTime));
//! decoder.decode(time.unwrap())?;
//! assert_eq!(decoder.decode(word), Ok(AerRecord::Event(event)));
//! # Ok::<(), AerError>(())
//! ```

mod field;

use core::fmt;

use self::field::{
    BACKGROUND_HIGH, BACKGROUND_LOW, CHANGE_FLAGS, CONTROL, CONTROL_END, CONTROL_TIME, CYCLE_LOW,
    ECHO, EXPOSURE, FLAGS, KIND, KIND_CONTROL, KIND_DEPTH_EVENT, KIND_DYNAMIC_DEPTH, LEVEL, OFFSET,
    PEAK_BIN, PEAK_COUNT, PIXEL,
};
use crate::event::DepthEvent;
use crate::events::DynamicDepthEvent;
use crate::flags::Flags;
use crate::units::{
    BinIndex, BinPosition, BlockLevel, Count, EchoNumber, LaserCycle, PixelAddress, SubBinOffset,
};

/// The version of the word layout, which file headers and links announce.
pub const AER_VERSION: u16 = 5;

/// One packed word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AerWord {
    /// Least significant first.
    parts: [u32; 4],
}

/// The low part of a number, and the high one.
#[allow(clippy::cast_possible_truncation, reason = "split in two")]
const fn split(number: u64) -> [u32; 2] {
    [number as u32, (number >> 32) as u32]
}

const fn join(low: u32, high: u32) -> u64 {
    low as u64 | (high as u64) << 32
}

impl AerWord {
    /// Bytes of a word.
    pub const BYTES: usize = 16;

    /// The word as it is sent: least significant byte first.
    #[inline]
    #[must_use]
    pub const fn to_le_bytes(self) -> [u8; Self::BYTES] {
        let [first, second, third, fourth] = self.parts;
        let (low, high) = (join(first, second), join(third, fourth));
        ((high as u128) << 64 | low as u128).to_le_bytes()
    }

    /// A word as it was received. Any bytes make a word;
    /// [`AerDecoder::decode`] checks it.
    #[inline]
    #[must_use]
    pub const fn from_le_bytes(bytes: [u8; Self::BYTES]) -> Self {
        let word = u128::from_le_bytes(bytes);
        #[allow(clippy::cast_possible_truncation, reason = "split in four parts")]
        Self {
            parts: [
                word as u32,
                (word >> 32) as u32,
                (word >> 64) as u32,
                (word >> 96) as u32,
            ],
        }
    }

    /// The depth event without the upper bits of its laser cycle. Exact: every
    /// field fits by its type.
    #[inline]
    #[must_use]
    pub const fn depth_event(event: &DepthEvent) -> Self {
        let background = event.background.raw();
        Self {
            parts: [
                PIXEL.put(event.pixel.raw() as u32) | EXPOSURE.put(event.exposure as u32),
                KIND.put(KIND_DEPTH_EVENT)
                    | CYCLE_LOW.put_low(split(event.cycle.raw())[0])
                    | LEVEL.put(event.level.raw() as u32)
                    | ECHO.put(event.echo.raw() as u32 - 1)
                    | PEAK_BIN.put(event.peak_bin.raw() as u32),
                PEAK_COUNT.put(event.peak_count.raw()) | background << BACKGROUND_LOW.shift,
                BACKGROUND_HIGH.put(background >> BACKGROUND_LOW.bits)
                    | OFFSET.put_low(event.offset.raw().cast_unsigned() as u32)
                    | FLAGS.put(event.flags.bits() as u32),
            ],
        }
    }

    /// The dynamic depth event without the upper bits of its laser cycle. Exact.
    #[inline]
    #[must_use]
    pub const fn dynamic_depth(event: &DynamicDepthEvent) -> Self {
        Self {
            parts: [
                PIXEL.put(event.pixel.raw() as u32),
                KIND.put(KIND_DYNAMIC_DEPTH)
                    | CYCLE_LOW.put_low(split(event.cycle.raw())[0])
                    | LEVEL.put(event.level.raw() as u32)
                    | CHANGE_FLAGS.put(event.flags.bits() as u32),
                event.position.raw().cast_unsigned(),
                event.change().cast_unsigned(),
            ],
        }
    }

    /// The upper bits of the laser cycle of the events that follow.
    #[inline]
    #[must_use]
    pub const fn time(cycle: LaserCycle) -> Self {
        let [low, high] = split(cycle.raw() >> CYCLE_LOW.bits);
        Self {
            parts: [
                0,
                KIND.put(KIND_CONTROL) | CONTROL.put(CONTROL_TIME),
                low,
                high,
            ],
        }
    }

    /// The last word of a recording: how many events it holds and the CRC-32
    /// of all bytes before this word.
    #[must_use]
    pub const fn end(events: u64, checksum: u32) -> Self {
        let [low, high] = split(events);
        let control = KIND.put(KIND_CONTROL) | CONTROL.put(CONTROL_END);
        Self {
            parts: [checksum, control, low, high],
        }
    }
}

/// Packs events in the order they leave, with the time words they need.
#[derive(Clone, Debug, Default)]
pub struct AerEncoder {
    cycle_high: Option<u64>,
}

impl AerEncoder {
    /// At the start of a stream.
    #[must_use]
    pub const fn new() -> Self {
        Self { cycle_high: None }
    }

    /// The word of an event, and the time word to send before it if one is
    /// due. Events need not be in order of time.
    #[inline]
    #[must_use = "without the time word the events that follow have a wrong laser cycle"]
    pub const fn encode(&mut self, event: &DepthEvent) -> (Option<AerWord>, AerWord) {
        (self.time(event.cycle), AerWord::depth_event(event))
    }

    /// Packs a dynamic depth event, as [`Self::encode`] does a depth event.
    #[inline]
    #[must_use = "without the time word the events that follow have a wrong laser cycle"]
    pub const fn encode_dynamic_depth(
        &mut self,
        event: &DynamicDepthEvent,
    ) -> (Option<AerWord>, AerWord) {
        (self.time(event.cycle), AerWord::dynamic_depth(event))
    }

    /// The time word that is due before an event of this laser cycle.
    #[inline]
    pub(crate) const fn time(&mut self, cycle: LaserCycle) -> Option<AerWord> {
        let high = cycle.raw() >> CYCLE_LOW.bits;
        let time = match self.cycle_high {
            Some(sent) if sent == high => None,
            _ => Some(AerWord::time(cycle)),
        };
        self.cycle_high = Some(high);
        time
    }
}

/// A decoded word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AerRecord {
    /// A depth event with its whole laser cycle.
    Event(DepthEvent),
    /// A dynamic depth event with its whole laser cycle.
    DynamicDepth(DynamicDepthEvent),
    /// A time word: the events that follow lie in this laser cycle or in the
    /// 2¹⁶ − 1 after it.
    Time(LaserCycle),
    /// The end of a recording.
    End {
        /// Depth events and dynamic depth events in the recording.
        events: u64,
        /// CRC-32 of all bytes before this word.
        checksum: u32,
    },
}

/// Why a word cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AerError {
    /// This version has no such kind.
    UnknownKind,
    /// This version has no such control code.
    UnknownControl,
    /// Bits that are zero in this version are set.
    ReservedBits,
    /// A field has an impossible value: a dynamic depth event without a change, or a
    /// position outside the histogram.
    OutOfRange,
    /// An event before any time word, so that its laser cycle is unknown.
    MissingTime,
}

impl fmt::Display for AerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UnknownKind => "unknown kind of word",
            Self::UnknownControl => "unknown control word",
            Self::ReservedBits => "reserved bits are set",
            Self::OutOfRange => "a field is out of range",
            Self::MissingTime => "an event before any time word",
        })
    }
}

impl core::error::Error for AerError {}

/// Reads words in the order they were sent.
#[derive(Clone, Debug, Default)]
pub struct AerDecoder {
    cycle_high: Option<u64>,
}

impl AerDecoder {
    /// At the start of a stream, or joining one.
    #[must_use]
    pub const fn new() -> Self {
        Self { cycle_high: None }
    }

    /// Decodes the next word.
    ///
    /// # Errors
    /// Fails if the word cannot be decoded. The decoder does not change; the next
    /// word can follow.
    #[inline]
    pub fn decode(&mut self, word: AerWord) -> Result<AerRecord, AerError> {
        match KIND.get(word.parts[1]) {
            KIND_DEPTH_EVENT => {
                let high = self.cycle_high.ok_or(AerError::MissingTime)?;
                Ok(AerRecord::Event(unpack(word, high)))
            }
            KIND_DYNAMIC_DEPTH => {
                let high = self.cycle_high.ok_or(AerError::MissingTime)?;
                unpack_dynamic_depth(word, high).map(AerRecord::DynamicDepth)
            }
            KIND_CONTROL => self.control(word),
            _ => Err(AerError::UnknownKind),
        }
    }

    fn control(&mut self, word: AerWord) -> Result<AerRecord, AerError> {
        let [checksum, control, low, high] = word.parts;
        let number = join(low, high);
        match CONTROL.get(control) {
            CONTROL_TIME => {
                let cycle = LaserCycle::new(number << CYCLE_LOW.bits);
                if word != AerWord::time(cycle) {
                    return Err(AerError::ReservedBits);
                }
                self.cycle_high = Some(number);
                Ok(AerRecord::Time(cycle))
            }
            CONTROL_END => {
                if word != AerWord::end(number, checksum) {
                    return Err(AerError::ReservedBits);
                }
                Ok(AerRecord::End {
                    events: number,
                    checksum,
                })
            }
            _ => Err(AerError::UnknownControl),
        }
    }
}

/// The whole laser cycle of an event.
fn cycle(second: u32, cycle_high: u64) -> LaserCycle {
    LaserCycle::new(cycle_high << CYCLE_LOW.bits | u64::from(CYCLE_LOW.get(second)))
}

/// An event from its word and the upper bits of its laser cycle.
#[allow(
    clippy::cast_possible_truncation,
    reason = "each field is as wide as its type"
)]
fn unpack(word: AerWord, cycle_high: u64) -> DepthEvent {
    let [first, second, third, fourth] = word.parts;
    // Sign-extends the ten bits of the offset.
    let offset = ((OFFSET.get(fourth) << 6) as u16).cast_signed() >> 6;
    let background = BACKGROUND_LOW.get(third) | BACKGROUND_HIGH.get(fourth) << BACKGROUND_LOW.bits;
    DepthEvent {
        pixel: PixelAddress::new(PIXEL.get(first) as u16),
        level: BlockLevel::saturating(LEVEL.get(second) as u8),
        echo: EchoNumber::new(ECHO.get(second) as u8 + 1).unwrap_or(EchoNumber::LAST),
        cycle: cycle(second, cycle_high),
        exposure: EXPOSURE.get(first) as u16,
        peak_bin: BinIndex::saturating(PEAK_BIN.get(second) as u16),
        offset: SubBinOffset::new(offset).unwrap_or(SubBinOffset::CENTRE),
        peak_count: Count::saturating(PEAK_COUNT.get(third)),
        background: Count::saturating(background),
        flags: Flags::from_bits(FLAGS.get(fourth) as u8).unwrap_or(Flags::NONE),
    }
}

/// A dynamic depth event, whose values do not use all bits of their fields.
#[allow(clippy::cast_possible_truncation, reason = "fields of up to 16 bits")]
fn unpack_dynamic_depth(word: AerWord, cycle_high: u64) -> Result<DynamicDepthEvent, AerError> {
    let [first, second, third, fourth] = word.parts;
    let event = DynamicDepthEvent::new(
        PixelAddress::new(PIXEL.get(first) as u16),
        BlockLevel::saturating(LEVEL.get(second) as u8),
        cycle(second, cycle_high),
        BinPosition::new(third.cast_signed()).ok_or(AerError::OutOfRange)?,
        fourth.cast_signed(),
        Flags::from_bits(CHANGE_FLAGS.get(second) as u8).unwrap_or(Flags::NONE),
    );
    let event = event.ok_or(AerError::OutOfRange)?;
    if AerWord::dynamic_depth(&event) != word {
        return Err(AerError::ReservedBits);
    }
    Ok(event)
}
