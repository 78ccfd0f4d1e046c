//! Photons into pixels, and photons messages of the link.

use dtof_core::binning::{count_in_blocks, end_laser_cycles_of_blocks};
use dtof_core::neighbours::end_laser_cycles_of_array;
use dtof_core::{LaserCycle, Look, OncePerBin};
use heapless::vec::Vec;

use super::{BINS, Sidecar};
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

/// The bins of the pixel whose photons come now, which have had one in this laser cycle.
#[derive(Debug, Default)]
pub(super) struct BinsOfPixel {
    bins: OncePerBin<{ OncePerBin::words(BINS) }>,
    pixel: usize,
}

impl BinsOfPixel {
    /// Whether a photon of this pixel is the first of its bin. Photons of a pixel come one after another.
    // Out of line: a photon that counts anyhow would take longer with it.
    #[inline(never)]
    fn is_first(&mut self, pixel: usize, code: u16) -> bool {
        if self.pixel != pixel {
            self.end_laser_cycle();
            self.pixel = pixel;
        }
        self.bins.is_first(code)
    }

    fn end_laser_cycle(&mut self) {
        self.bins.end_laser_cycle();
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
                if *looks == 0 || self.has_waiting_events() {
                    self.photons = Some(photons);
                    return;
                }
                *looks -= 1;
                photons.cycles -= self.end_laser_cycles_to_look(photons.cycles);
            }
            let left = photons.body.get(photons.next..).unwrap_or_default();
            let Some((token, rest)) = Token::split_first(left) else {
                // The end, or an invalid token.
                self.unknown = self.unknown.saturating_add(u32::from(!left.is_empty()));
                return;
            };
            photons.next = photons.body.len() - rest.len();
            match token {
                Token::Photon { code } => self.count(photons.pixel, code),
                Token::Advance { pixels } => photons.pixel += usize::from(pixels),
                Token::EndOfCycles { cycles } => {
                    photons.pixel = 0;
                    photons.cycles = cycles;
                }
            }
        }
    }

    pub(super) fn count(&mut self, number: usize, code: u16) {
        let (Some(pixel), Some(config)) = (self.pixels.get_mut(number), &self.config) else {
            self.unaddressed += 1;
            return;
        };
        if let Some(bins) = &mut self.once_per_bin
            && !bins.is_first(number, code)
        {
            self.statistics.repeated += 1;
            return;
        }
        pixel.detector.count(config, code);
        if let Some((config, _)) = &self.binning {
            count_in_blocks(self.blocks, &pixel.feed, config, code);
        }
    }

    /// Ends up to `cycles` laser cycles, but none after the one at whose end the
    /// pixels look, and returns how many. Events move on as far as there is room.
    pub(super) fn end_laser_cycles_to_look(&mut self, cycles: u16) -> u16 {
        let Some(config) = &self.config else {
            return cycles;
        };
        // All pixels begin at once and look every X laser cycles.
        let to_look = config.x().saturating_sub(self.since_look).max(1);
        let ended = cycles.min(to_look);
        self.since_look = if ended < to_look {
            self.since_look + ended
        } else {
            0
        };
        self.cycle += u64::from(ended);
        let last = LaserCycle::new(self.cycle.saturating_sub(1));
        if let Some(bins) = &mut self.once_per_bin {
            bins.end_laser_cycle();
        }
        let mut fired = false;
        if let Some(neighbours) = &self.neighbours {
            let (pixels, statistics) = (&mut self.pixels[..], &mut self.statistics);
            fired = end_laser_cycles_of_array(pixels, config, neighbours, statistics, last, ended);
        } else {
            for pixel in self.pixels.iter_mut() {
                let (detector, statistics) = (&mut pixel.detector, &mut self.statistics);
                let look = detector.end_laser_cycles(config, statistics, last, ended);
                // A pixel that has waited for another echo has reported, too.
                if matches!(look, Look::Event | Look::Ended) {
                    pixel.feed.reported();
                }
                fired |= look == Look::Event;
            }
        }
        if let Some((config, patience)) = &self.binning {
            let statistics = &mut self.block_statistics;
            fired |= end_laser_cycles_of_blocks(self.blocks, config, statistics, last, ended);
            if self.since_look == 0 {
                self.since_tick = self.since_tick.saturating_add(config.x());
            }
            if self.since_tick >= *patience {
                self.since_tick = 0;
                for pixel in self.pixels.iter_mut() {
                    pixel.feed.tick(pixel.detector.has_reported());
                }
                let blocks = self.blocks.iter_mut();
                blocks.for_each(|block| block.detector.tick());
            }
        }
        if fired {
            self.drain();
        }
        ended
    }
}
