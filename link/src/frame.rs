//! Frames on the wire: a CRC-32 at the end, COBS around all of it, a zero byte
//! after it.
//!
//! COBS makes a frame of at most 254 bytes one byte longer and leaves no zero
//! byte in it. After any damage a receiver is in step again at the next zero byte.

use crc::{CRC_32_ISO_HDLC, Crc};

/// Bytes of a frame before COBS, checksum included.
pub const FRAME_BYTES: usize = 254;
/// Bytes of a frame on the wire, the zero byte included.
pub const WIRE_BYTES: usize = FRAME_BYTES + 2;
/// The most bytes a frame carries.
pub const PAYLOAD_BYTES: usize = FRAME_BYTES - CHECKSUM_BYTES;

const CHECKSUM_BYTES: usize = 4;
static CRC_32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Writes a frame with `parts`, one after the other, into `wire`. Returns the number of
/// bytes to send. The parts have at most [`PAYLOAD_BYTES`] together; any more are cut off.
#[must_use]
pub fn encode(parts: [&[u8]; 2], wire: &mut [u8; WIRE_BYTES]) -> usize {
    let mut frame = heapless::Vec::<u8, FRAME_BYTES>::new();
    for part in parts {
        let room = PAYLOAD_BYTES.saturating_sub(frame.len());
        let _ = frame.extend_from_slice(part.get(..part.len().min(room)).unwrap_or_default());
    }
    let checksum = CRC_32.checksum(&frame);
    let _ = frame.extend_from_slice(&checksum.to_le_bytes());
    let [first, places @ .., _] = wire;
    // COBS: each zero becomes the distance to the next one. One more is before the frame, one behind it.
    let mut distance = 1;
    for (place, &byte) in places.iter_mut().zip(&frame).rev() {
        if byte == 0 {
            *place = core::mem::replace(&mut distance, 1);
        } else {
            *place = byte;
            distance += 1;
        }
    }
    *first = distance;
    let length = frame.len() + 1;
    if let Some(end) = wire.get_mut(length) {
        *end = 0;
    }
    length + 1
}

/// Why bytes between two zero bytes are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FrameError {
    /// More bytes than a frame can have.
    Oversized,
    /// Not COBS, too short for a checksum, or the checksum does not match.
    Corrupt,
}

/// Finds frames in a stream of bytes.
#[derive(Clone, Debug, Default)]
pub struct Deframer {
    bytes: heapless::Vec<u8, { WIRE_BYTES - 1 }>,
    oversized: bool,
    ended: bool,
}

impl Deframer {
    /// Before the first byte.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: heapless::Vec::new(),
            oversized: false,
            ended: false,
        }
    }

    /// Takes the next byte. If it ends a frame, returns the payload, or why this is not a
    /// frame.
    // Each place that calls it would have a copy: 2 kB more of an image.
    #[inline(never)]
    pub fn push(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        if core::mem::take(&mut self.ended) {
            self.bytes.clear();
            self.oversized = false;
        }
        if byte != 0 {
            self.oversized |= self.bytes.push(byte).is_err();
            return None;
        }
        self.ended = true;
        if self.oversized {
            return Some(Err(FrameError::Oversized));
        }
        if self.bytes.is_empty() {
            return None; // zero bytes one after the other
        }
        Some(open(&mut self.bytes))
    }
}

/// The payload of a frame. No byte of `bytes` is 0.
fn open(bytes: &mut [u8]) -> Result<&[u8], FrameError> {
    // COBS: a byte that is a distance was a zero of the frame; the first was the one before it.
    let mut distance = 1;
    for byte in bytes.iter_mut() {
        distance -= 1;
        if distance == 0 {
            distance = core::mem::take(byte);
        }
    }
    // The last distance leads to the zero behind the frame.
    let Some((_, frame)) = bytes.split_first().filter(|_| distance == 1) else {
        return Err(FrameError::Corrupt);
    };
    let (payload, checksum) = frame.split_last_chunk().ok_or(FrameError::Corrupt)?;
    if CRC_32.checksum(payload) != u32::from_le_bytes(*checksum) {
        return Err(FrameError::Corrupt);
    }
    Ok(payload)
}
