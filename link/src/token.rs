//! The parts of a photons message.

use heapless::Vec;

/// One part of a photons message. Each message begins at pixel 0, and so does each
/// laser cycle. A token never spans two messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Token {
    /// A photon of the current pixel in the current laser cycle: one byte for
    /// codes below 128, three for others.
    Photon {
        /// Its TDC code.
        code: u16,
    },
    /// Moves the current pixel on by `pixels`, 1 to 64: one byte.
    Advance {
        /// The number of pixels.
        pixels: u8,
    },
    /// The current laser cycle ends, and `cycles - 1` empty ones after it:
    /// three bytes.
    EndOfCycles {
        /// The number of laser cycles; 0 ends none.
        cycles: u16,
    },
}

impl Token {
    /// Bytes of the longest token.
    pub const MAX_BYTES: usize = 3;
    const ADVANCE: u8 = 0x80;
    const PHOTON: u8 = 0xc0;
    const END: u8 = 0xc1;

    /// The bytes to send.
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

    /// The first token of `bytes` and the bytes after it; `None` if `bytes` does not begin
    /// with one.
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
