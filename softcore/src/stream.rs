//! Macropixels that share a processor, their photons from a FIFO, their events to a
//! link.
//!
//! Photons come first: while the FIFO has them, they are counted. When a laser cycle has
//! ended and no more than [`FEW`] words wait, or half of L2 has passed since the last look at it, the next
//! macropixel in turn is looked at, provided X laser cycles have passed. That is the mini-frame of
//! [`AsyncPixel::end_laser_cycles`]: a processor that cannot look at every macropixel
//! every X laser cycles looks as often as it can, no photon is assigned to a wrong
//! exposure, and with more photons than it can count it still decides.
//!
//! Each look and each event that leaves its pixel is marked, so that a testbench can tell
//! what the events must be.

use core::fmt::{self, Write};

use dtof_core::{
    AerEncoder, AerWord, AsyncPixel, LaserCycle, PixelAddress, PixelConfig, PixelConfigError,
    Statistics,
};

use crate::io;
use crate::word::Word;

/// Bins of a macropixel.
pub const BINS: usize = 128;
/// Laser cycles between looks, unless the processor needs more.
const X: u16 = 4;
/// The exposure an event must exceed.
const L1: u16 = 40;
/// The exposure at which a histogram is cleared without an event.
const L2: u16 = 2000;

/// Laser cycles after which a macropixel is looked at though photons wait.
const LATE: u64 = L2 as u64 / 2;

/// Words that may wait during a look: the next end of a laser cycle most often does.
pub const FEW: u32 = 1;

/// X = 4, L1 = 40, L2 = 2000, α = 4, at least 5 photons.
///
/// # Errors
/// None: the configuration is valid.
pub const fn config() -> Result<PixelConfig<BINS>, PixelConfigError> {
    PixelConfig::paper().x(X).l1(L1).l2(L2).build()
}

/// The events of a run that are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// The next macropixel in turn is looked at, when so many laser cycles have ended, of
    /// which 31 bits are marked.
    Look(u64),
    /// The event of a macropixel leaves it.
    Taken(PixelAddress),
}

impl Mark {
    const TAKEN: u32 = 1 << 31;

    /// The number of the mark.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "as much as there is room for"
    )]
    #[inline(always)]
    #[must_use]
    pub const fn to_raw(self) -> u32 {
        match self {
            Self::Look(cycles) => cycles as u32 & !Self::TAKEN,
            Self::Taken(pixel) => pixel.raw() as u32 | Self::TAKEN,
        }
    }

    /// The mark of a number, if less than 2³¹ laser cycles have ended.
    #[allow(clippy::cast_possible_truncation, reason = "16 bits were marked")]
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        if raw & Self::TAKEN == 0 {
            Self::Look(raw as u64)
        } else {
            Self::Taken(PixelAddress::new(raw as u16))
        }
    }
}

/// `N` macropixels of one processor.
pub struct Pixels<const N: usize> {
    config: PixelConfig<BINS>,
    pixels: [AsyncPixel<BINS>; N],
    statistics: Statistics,
    /// Laser cycles that had ended at each macropixel's last look.
    looked: [u64; N],
    /// Laser cycles that have ended.
    now: u64,
    turn: usize,
    looks: u32,
    /// How often a status read found that the FIFO had lost photons.
    losses: u32,
    /// Photons of macropixels that there are not.
    strays: u32,
    encoder: AerEncoder,
    /// Whether the link has not yet answered.
    is_requesting: bool,
    /// The word of the event whose time word went before.
    next: Option<AerWord>,
}

impl<const N: usize> Pixels<N> {
    /// Empty macropixels.
    ///
    /// # Errors
    /// None: the configuration is valid.
    pub const fn new() -> Result<Self, PixelConfigError> {
        let config = match config() {
            Ok(config) => config,
            Err(error) => return Err(error),
        };
        let mut pixels = [const { AsyncPixel::new(PixelAddress::new(0)) }; N];
        let mut index = 0;
        while index < N {
            #[allow(clippy::cast_possible_truncation, reason = "there are 2¹⁶ addresses")]
            let address = PixelAddress::new(index as u16);
            pixels[index] = AsyncPixel::new(address);
            index += 1;
        }
        Ok(Self {
            config,
            pixels,
            statistics: Statistics::new(),
            looked: [0; N],
            now: 0,
            turn: 0,
            looks: 0,
            losses: 0,
            strays: 0,
            encoder: AerEncoder::new(),
            is_requesting: false,
            next: None,
        })
    }

    /// Takes words from the FIFO until there will be none, and hands events to the
    /// link.
    pub fn run(&mut self) {
        loop {
            match io::take() {
                Word::Photon(pixel, code) => match self.pixels.get_mut(usize::from(pixel)) {
                    Some(pixel) => pixel.count(&self.config, code),
                    None => self.strays = self.strays.saturating_add(1),
                },
                Word::CyclesEnd(cycles) => {
                    self.now += u64::from(cycles.max(1));
                    let (waiting, is_lossy) = io::photon_status();
                    self.losses += u32::from(is_lossy);
                    self.look(waiting <= FEW);
                }
                // A time word has the event's behind it.
                Word::Empty if self.next.is_some() => self.link(self.turn),
                Word::Empty => {}
                Word::End => break,
            }
        }
        self.finish();
    }

    /// Looks at the next macropixel in turn, if it is time, or high time.
    fn look(&mut self, is_free: bool) {
        let index = self.turn;
        let (Some(pixel), Some(looked)) = (self.pixels.get_mut(index), self.looked.get_mut(index))
        else {
            return;
        };
        let passed = self.now - *looked;
        if passed < u64::from(X) || !is_free && passed < LATE {
            return;
        }
        *looked = self.now;
        self.turn = if index + 1 < N { index + 1 } else { 0 };
        self.looks += 1;
        let passed = u16::try_from(passed).unwrap_or(u16::MAX);
        let last = LaserCycle::new(self.now - 1);
        io::mark(Mark::Look(self.now).to_raw());
        let _ = pixel.end_laser_cycles(&self.config, &mut self.statistics, last, passed);
        self.link(index);
    }

    /// Hands the event that a macropixel holds to the link, if that is free. If not, the
    /// macropixel keeps it, counts on, and counts the decisions it defers.
    fn link(&mut self, index: usize) {
        if self.is_requesting && io::is_acknowledged() {
            self.is_requesting = false;
        }
        if self.is_requesting {
            return;
        }
        // The word after a time word comes before all others.
        let word = self.next.take().or_else(|| {
            let event = self.pixels.get_mut(index)?.take_event()?;
            io::mark(Mark::Taken(event.pixel).to_raw());
            let (time, word) = self.encoder.encode(&event);
            self.next = time.and(Some(word));
            Some(time.unwrap_or(word))
        });
        if let Some(word) = word {
            io::request(word);
            self.is_requesting = true;
        }
    }

    /// Hands the events that are left to the link.
    fn finish(&mut self) {
        for index in 0..N {
            while self.is_requesting || self.next.is_some() || self.holds_event(index) {
                self.link(index);
            }
        }
    }

    fn holds_event(&self, index: usize) -> bool {
        self.pixels.get(index).is_some_and(AsyncPixel::has_event)
    }

    /// Writes what was done: laser cycles, looks, losses, strays, and of all macropixels
    /// photons, events, exposures without one and decisions put off.
    ///
    /// # Errors
    /// The errors of `out`.
    pub fn report(&self, out: &mut impl Write) -> fmt::Result {
        let mut all = self.statistics;
        for pixel in &self.pixels {
            pixel.add_photons_to(&mut all);
        }
        writeln!(
            out,
            "cycles {} looks {} losses {} strays {} photons {} events {} expired {} deferred {}",
            self.now,
            self.looks,
            self.losses,
            self.strays,
            all.photons(),
            all.events,
            all.expired,
            all.deferred
        )
    }
}

/// Defines the program that runs this many macropixels.
#[macro_export]
macro_rules! stream_program {
    ($pixels:literal) => {
        /// The program: true once every photon was taken.
        #[allow(
            unsafe_code,
            reason = "the pixels are memory of the image's, not stack"
        )]
        fn run() -> bool {
            static mut PIXELS: $crate::stream::Pixels<$pixels> = match $crate::stream::Pixels::new()
            {
                Ok(pixels) => pixels,
                Err(_) => panic!("the configuration is refused"),
            };
            // SAFETY: the program is called once, and nothing else knows the name.
            let pixels = unsafe { &mut *&raw mut PIXELS };
            pixels.run();
            pixels.report(&mut $crate::io::Printer).is_ok()
        }

        $crate::program!(run);
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_read_as_they_are_made() {
        for mark in [
            Mark::Look(0),
            Mark::Look((1 << 31) - 1),
            Mark::Taken(PixelAddress::new(u16::MAX)),
        ] {
            assert_eq!(Mark::from_raw(mark.to_raw()), mark);
        }
    }
}
