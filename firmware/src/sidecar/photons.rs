//! Photons into pixels, and photons messages of the link.

use heapless::vec::Vec;

use super::Sidecar;
use dtof_link::Token;
use dtof_link::endpoint::BODY_BYTES;

/// A photons message and how far it has been worked through.
#[derive(Debug)]
pub(super) struct Photons {
    body: Vec<u8, BODY_BYTES>,
    next: usize,
    pixel: usize,
    /// Laser cycles of the token before `next` that have not ended yet.
    cycles: u16,
}

impl Photons {
    pub(super) const fn new(body: Vec<u8, BODY_BYTES>) -> Self {
        Self {
            body,
            next: 0,
            pixel: 0,
            cycles: 0,
        }
    }
}

impl Sidecar<'_> {
    /// Works through a photons message until it is done, an event cannot leave its
    /// slot, or the pixels have looked `looks` times, which it counts down.
    pub(super) fn work_through(&mut self, looks: &mut u16) {
        let Some(mut photons) = self.photons.take() else {
            return;
        };
        loop {
            while photons.cycles > 0 {
                if *looks == 0 || self.array.has_event() {
                    self.photons = Some(photons);
                    return;
                }
                *looks -= 1;
                photons.cycles = self.end_laser_cycles_to_look(photons.cycles);
            }
            let left = photons.body.get(photons.next..).unwrap_or_default();
            let Some((token, rest)) = Token::split_first(left) else {
                // The end, or an invalid token.
                self.unknown = self.unknown.saturating_add(u32::from(!left.is_empty()));
                return;
            };
            photons.next = photons.body.len() - rest.len();
            match token {
                Token::Photon { code } => self.array.photon(photons.pixel, code),
                Token::Advance { pixels } => photons.pixel += usize::from(pixels),
                Token::EndOfCycles { cycles } => {
                    photons.pixel = 0;
                    photons.cycles = cycles;
                }
            }
        }
    }

    /// Ends laser cycles as [`PixelArray::end_laser_cycles`](dtof_core::PixelArray::end_laser_cycles) does. Events of a look
    /// move on as far as there is room.
    #[inline(never)]
    pub(super) fn end_laser_cycles_to_look(&mut self, cycles: u16) -> u16 {
        let left = self.array.end_laser_cycles(cycles);
        if self.array.has_looked() && self.array.has_event() {
            self.drain();
        }
        left
    }
}
