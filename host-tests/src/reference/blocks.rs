//! Adaptive binning: photons of pixels that have been silent for a while also count in blocks.
//! Not in the paper; written from the description in `docs/design.md`.

use super::{Echo, EchoConfig, EchoPixel, Window};

/// A pixel or a block of pixels.
#[derive(Debug, Clone)]
struct Member {
    level: u32,
    /// Column and row of its first pixel.
    place: (u32, u32),
    pixel: EchoPixel,
    feeds: bool,
    /// Since the last tick.
    has_reported: bool,
}

/// The origin of an event: its level and the address of its first pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reporter {
    /// 0: a pixel; `k`: a block of 2ᵏ x 2ᵏ.
    pub level: u32,
    /// The address of its first pixel, row by row.
    pub first: u32,
}

/// An array of pixels, and the blocks of its levels.
#[derive(Debug, Clone)]
pub struct BinnedArray {
    columns: u32,
    patience: u64,
    cycles: u64,
    /// The pixels row by row, then the blocks of level 1, and so on.
    members: Vec<Member>,
}

impl BinnedArray {
    /// An array of `columns` x `rows` pixels and their blocks up to `levels`. Ticks come
    /// every `patience` laser cycles. Pixels and blocks have a
    /// configuration each.
    #[must_use]
    pub fn new(
        (columns, rows): (u32, u32),
        levels: u32,
        patience: u64,
        (pixels, blocks): (EchoConfig, EchoConfig),
        bins: usize,
    ) -> Self {
        let mut members = Vec::new();
        for level in 0..=levels {
            let side = 1 << level;
            for row in (0..rows).step_by(side) {
                for column in (0..columns).step_by(side) {
                    // Counters of 10 bits, and of 16.
                    let pixel = match level {
                        0 => EchoPixel::new(bins, 1023.0, pixels),
                        _ => EchoPixel::new(bins, 65_535.0, blocks),
                    };
                    members.push(Member {
                        level,
                        place: (column, row),
                        pixel,
                        feeds: false,
                        has_reported: false,
                    });
                }
            }
        }
        Self {
            columns,
            patience,
            cycles: 0,
            members,
        }
    }

    /// Counts a photon of the pixel `address`: there, in the block of the pixel if the pixel feeds it,
    /// in the next block if that block feeds it, and so on.
    pub fn photon(&mut self, address: u32, bin: usize) {
        let (column, row) = (address % self.columns, address / self.columns);
        for level in 0.. {
            let place = (column >> level << level, row >> level << level);
            let mut members = self.members.iter_mut();
            let Some(member) =
                members.find(|member| (member.level, member.place) == (level, place))
            else {
                return;
            };
            member.pixel.photon(bin);
            if !member.feeds {
                return;
            }
        }
    }

    /// Ends a laser cycle for all. `stands_clear` decides about a window.
    pub fn end_laser_cycle(
        &mut self,
        mut stands_clear: impl FnMut(Reporter, &Window) -> bool,
    ) -> Vec<(Reporter, Echo)> {
        let mut events = Vec::new();
        for member in &mut self.members {
            let (column, row) = member.place;
            let first = row * self.columns + column;
            let reporter = Reporter {
                level: member.level,
                first,
            };
            let had_reported = member.pixel.has_reported();
            let echo = member
                .pixel
                .end_laser_cycle(|window| stands_clear(reporter, window));
            if let Some(echo) = echo {
                events.push((reporter, echo));
                member.feeds = false;
                member.has_reported = true;
            } else if had_reported && !member.pixel.has_reported() {
                // An exposure that ended after an echo was not silent.
                member.feeds = false;
                member.has_reported = true;
            }
        }
        self.cycles += 1;
        if self.cycles.is_multiple_of(self.patience) {
            for member in &mut self.members {
                // An exposure that goes on after an echo is not silent.
                member.feeds = !member.has_reported && !member.pixel.has_reported();
                member.has_reported = false;
            }
        }
        events
    }
}
