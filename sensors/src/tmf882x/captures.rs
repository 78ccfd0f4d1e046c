//! The 8×8 zones of a TMF8828: four captures of two halves of eight zones.
//!
//! A capture is 30 packets of each half and then a result. Only the result tells which of the four
//! captures it was: its number mod 4. So the zones of histograms are known once a result has come,
//! and the next result confirms them.
//!
//! A result is 132 bytes from `CONFIG_RESULT` on: 24 of which byte 4 is its number, and 36 targets
//! (confidence, distance in mm, least significant byte first). Target i is the first or second one,
//! ⌊i/18⌋, of half ⌊i/9⌋ mod 2 and channel i mod 9; channel 8 is not used.

use dtof_core::PixelAddress;
use dtof_core::fixed::types::I24F8;

use super::DeviceError;
use super::frame::PACKET;
use crate::{PhotonSink, Target};

/// The zone of each channel in the first half of capture 0, row by row.
const CHANNELS: [u8; 8] = [56, 60, 40, 44, 24, 28, 8, 12];

/// The zone of a channel in a half of a capture.
fn zone(capture: u8, half: u8, channel: u8) -> Option<u8> {
    let first = CHANNELS.get(usize::from(channel))?;
    Some(first + half + 2 * (capture % 2) - 8 * (capture / 2))
}

/// Which capture it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Captures {
    /// The present one, 0 to 3, if that is known.
    present: Option<u8>,
    /// Its first packet has come, and no result since.
    has_begun: bool,
}

impl Captures {
    pub(super) const fn new() -> Self {
        Self {
            present: None,
            has_begun: false,
        }
    }

    pub(super) const fn restart(&mut self) {
        *self = Self::new();
    }

    /// Takes the first packet of a capture. Returns whether the result of the last capture is lost,
    /// which leaves its zones unconfirmed.
    pub(super) const fn begin(&mut self) -> bool {
        let is_lost = self.has_begun;
        if is_lost {
            self.present = None;
        }
        self.has_begun = true;
        is_lost
    }

    /// The zone of a channel, 0 to 7, if the capture is known.
    pub(super) fn zone(self, half: u8, channel: u8) -> Option<u8> {
        zone(self.present?, half, channel)
    }

    /// The result of a capture.
    ///
    /// # Errors
    /// Returns [`DeviceError::WrongCapture`] if its histograms were given as those of other zones.
    pub(super) fn end(
        &mut self,
        result: &[u8; PACKET],
        first: PixelAddress,
        sink: &mut impl PhotonSink,
    ) -> Result<(), DeviceError> {
        let [_, _, _, _, number, ..] = *result;
        let found = number % 4;
        let expected = self.present.replace((found + 1) % 4);
        self.has_begun = false;
        let entries = result.iter().copied().skip(24);
        let mut entries = entries
            .clone()
            .zip(entries.clone().skip(1).zip(entries.skip(2)));
        let mut entry = entries.next();
        for index in 0..36u8 {
            let Some((confidence, (low, high))) = entry else {
                break;
            };
            entry = entries.nth(2);
            let distance = u16::from_le_bytes([low, high]);
            let zone = zone(found, index / 9 % 2, index % 9);
            if let Some(zone) = zone.filter(|_| confidence > 0 && distance > 0) {
                let target = Target {
                    number: index / 18,
                    distance: I24F8::from_bits(i32::from(distance) << 8),
                    confidence,
                    signal: None,
                    noise: None,
                    crosstalk: None,
                };
                sink.target(
                    PixelAddress::new(first.raw().saturating_add(zone.into())),
                    &target,
                );
            }
        }
        match expected {
            Some(expected) if expected != found => {
                Err(DeviceError::WrongCapture { expected, found })
            }
            _ => Ok(()),
        }
    }
}
