//! One processor shared by four macropixels (section IV-A).
//!
//! All four count all the time; at the end of each laser cycle the next of them
//! is looked at, in turn, so that every macropixel is looked at every four
//! laser cycles: X = 4 for each, and never two decisions in one laser cycle.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::*;
//!
//! let rule = PaperRule::new(const { U8F8::lit("8") }, Count::saturating(5));
//! let config = PixelConfig::new(4, 40, 2000, RangeGate::full(), rule)?;
//! let addresses = [0, 1, 2, 3].map(PixelAddress);
//! let mut element = ProcessingElement::<128>::new(config, addresses)?;
//!
//! element.count(Macropixel::C, 60);
//! let (served, look) = element.end_laser_cycle(LaserCycle(0));
//! assert_eq!((served, look), (Macropixel::A, Look::TooEarly));
//! assert_eq!(element.pixel(Macropixel::C).histogram().total(), 1);
//! # Ok::<(), ConfigError>(())
//! ```

use crate::event::DepthEvent;
use crate::histogram::{Count10, CounterWidth};
use crate::pixel::{AsyncPixel, ConfigError, Look, PixelConfig};
use crate::rule::{DetectionRule, PaperRule};
use crate::units::{LaserCycle, PixelAddress};

/// One of the four macropixels of a processing element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Macropixel {
    /// Looked at after laser cycles 0, 4, 8, ...
    A,
    /// Looked at after laser cycles 1, 5, 9, ...
    B,
    /// Looked at after laser cycles 2, 6, 10, ...
    C,
    /// Looked at after laser cycles 3, 7, 11, ...
    D,
}

impl Macropixel {
    /// All four, in the order they are served.
    pub const ALL: [Self; 4] = [Self::A, Self::B, Self::C, Self::D];

    const fn next(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::C,
            Self::C => Self::D,
            Self::D => Self::A,
        }
    }

    /// This one's of four values.
    const fn of<T>(self, [a, b, c, d]: &[T; 4]) -> &T {
        match self {
            Self::A => a,
            Self::B => b,
            Self::C => c,
            Self::D => d,
        }
    }

    /// This one's of four values, to change.
    const fn of_mut<T>(self, [a, b, c, d]: &mut [T; 4]) -> &mut T {
        match self {
            Self::A => a,
            Self::B => b,
            Self::C => c,
            Self::D => d,
        }
    }
}

/// Four macropixels and the one configuration they run on.
#[derive(Clone, Debug)]
pub struct ProcessingElement<
    const BINS: usize,
    R: DetectionRule = PaperRule,
    W: CounterWidth = Count10,
> {
    config: PixelConfig<BINS, R>,
    pixels: [AsyncPixel<BINS, W>; 4],
    turn: Macropixel,
}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth> ProcessingElement<BINS, R, W> {
    /// Four empty macropixels; [`Macropixel::A`] is served first. Its first
    /// look falls on N = 1, that of [`Macropixel::D`] on N = 4.
    ///
    /// # Errors
    /// [`ConfigError::XNotFour`] if the configuration's X is not 4.
    pub fn new(
        config: PixelConfig<BINS, R>,
        addresses: [PixelAddress; 4],
    ) -> Result<Self, ConfigError> {
        if config.x() != 4 {
            return Err(ConfigError::XNotFour);
        }
        Ok(Self {
            config,
            pixels: addresses.map(AsyncPixel::new),
            turn: Macropixel::A,
        })
    }

    /// One macropixel.
    #[must_use]
    pub const fn pixel(&self, macropixel: Macropixel) -> &AsyncPixel<BINS, W> {
        macropixel.of(&self.pixels)
    }

    /// Counts one photon of one macropixel in the present laser cycle.
    #[inline]
    pub fn count(&mut self, macropixel: Macropixel, code: u16) {
        macropixel
            .of_mut(&mut self.pixels)
            .count(&self.config, code);
    }

    /// Ends laser cycle `cycle` for all four and looks at the one whose turn it
    /// is.
    #[inline]
    pub fn end_laser_cycle(&mut self, cycle: LaserCycle) -> (Macropixel, Look) {
        for pixel in &mut self.pixels {
            pixel.advance(1);
        }
        let served = self.turn;
        self.turn = served.next();
        let pixel = served.of_mut(&mut self.pixels);
        (served, pixel.look(&self.config, cycle))
    }

    /// ACK: takes the event one macropixel holds.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self, macropixel: Macropixel) -> Option<DepthEvent> {
        macropixel.of_mut(&mut self.pixels).acknowledge()
    }
}
