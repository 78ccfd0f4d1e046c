//! Neighbouring pixels confirm what one pixel alone is not sure of.
//!
//! A dim pixel takes long to gather enough photons. Most of its neighbours see the same surface. So a
//! pixel whose own photons are only promising adds up the same bins of its 4 or 8 neighbours,
//! and reports if the sum stands clear of the background. Neighbours that are much brighter see something else,
//! and are left out. The event is the pixel's own, at its place, with
//! [`Flags::CONFIRMED`](crate::Flags::CONFIRMED). [`NeighbourRule`] says what is promising and what is enough.
//!
//! All pixels of an array look at the same time, and decide on the same photons: none clears its histogram
//! before all have decided. [`PixelArray`](crate::PixelArray) sees to that.
//!
//! ```
//! use dtof_core::neighbours::NeighbourConfig;
//! use dtof_core::fixed::types::U4F12;
//! use dtof_core::{
//!     Array, ArrayConfig, Count, Flags, Neighbours, PixelArray, PixelConfig, PixelPlace, WindowRule,
//! };
//!
//! let rule = WindowRule::new(3, const { U4F12::lit("4.47") }, Count::saturating(5))?;
//! let layout = Array::new(3, 3).unwrap();
//! let neighbours = NeighbourConfig::new(layout, Neighbours::Eight, &rule);
//! let config = PixelConfig::<128, WindowRule>::with_rule(*neighbours.rule().own()).build()?;
//! let mut room: Vec<PixelPlace<128>> = (0..9).map(|_| PixelPlace::new()).collect();
//! let mut array = PixelArray::new(&mut room, &mut []);
//! array.configure(&ArrayConfig::new(layout, config).neighbours(neighbours)?)?;
//!
//! // Three photons a pixel of the same surface, and some background.
//! for (pixel, background) in [3, 20, 35, 77, 90, 100, 101, 110, 120].into_iter().enumerate() {
//!     [60, 60, 61, background, 127 - background].map(|code| array.photon(pixel, code));
//! }
//! (0..44).for_each(|_| array.end_laser_cycle());
//! let events: Vec<_> = std::iter::from_fn(|| array.next_event()).collect();
//! let event = events.iter().find(|event| event.pixel.raw() == 4).unwrap();
//! assert_eq!((event.peak_count.raw(), event.flags), (3, Flags::CONFIRMED));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What all pixels have in common is confirmed, too: crosstalk of a cover glass, a slope of pile-up, bins of different
//! widths. Its significance triples with eight neighbours. Leave it out by a [gate](crate::RangeGate).
//! Where the rule weighs a [dead time](crate::PixelConfigBuilder::dead_time) neighbours are not asked, and each pixel
//! decides alone.
//!
//! Whole histograms and [blocks](crate::binning) do not ask neighbours.
//!
//! Cost: a photon takes no more, and a pixel no more memory. On a Cortex-M4, with 8 × 8 pixels, eight neighbours and a
//! window of 3 bins, a look of a pixel without an event takes 1,011 instructions on average over background, and one
//! that neighbours confirm 3,660 more; alone 150 and, with an event, 365. A decision that is confirmed adds the
//! histograms up on the stack: `2·BINS + 16` bytes.
//!
//! Source: ours. The field knows it as spatial pooling of neighbouring pixels in two stages: a low threshold chooses the
//! pixels, a second one tests the pooled counts.

use core::ops::AddAssign;

use crate::array::{Array, Neighbours};
use crate::config::PixelConfig;
pub use crate::detect::NeighbourRule;
use crate::detect::{Detection, DetectionRule, WindowRule};
use crate::histogram::counter::CounterWidth;
use crate::pixel::{AsyncPixel, unobserved};
use crate::statistics::Statistics;
use crate::units::{LaserCycle, PixelAddress};

/// A place of an array: a pixel, or something with one, or without one because it is left out.
pub(crate) trait ArrayPixel<const BINS: usize, W: CounterWidth> {
    /// The pixel, to read.
    fn pixel(&self) -> Option<&AsyncPixel<BINS, W>>;
    /// The pixel, to change.
    fn pixel_mut(&mut self) -> Option<&mut AsyncPixel<BINS, W>>;
    /// The [third step](AsyncPixel::end_look) of the pixel.
    #[inline]
    fn end_look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
    ) {
        if let Some(pixel) = self.pixel_mut() {
            pixel.end_look(config, statistics, last, unobserved);
        }
    }
}

#[cfg(test)]
impl<const BINS: usize, W: CounterWidth> ArrayPixel<BINS, W> for AsyncPixel<BINS, W> {
    fn pixel(&self) -> Option<&Self> {
        Some(self)
    }

    fn pixel_mut(&mut self) -> Option<&mut Self> {
        Some(self)
    }
}

/// Which neighbours confirm, and by which rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NeighbourConfig {
    array: Array,
    neighbours: Neighbours,
    rule: NeighbourRule,
}

impl NeighbourConfig {
    /// The pixels of `array` and their neighbours together have the false alarms of `rule`.
    #[must_use]
    pub fn new(array: Array, neighbours: Neighbours, rule: &WindowRule) -> Self {
        Self {
            array,
            neighbours,
            rule: NeighbourRule::new(rule),
        }
    }

    /// The array.
    #[must_use]
    pub const fn array(&self) -> &Array {
        &self.array
    }

    /// The rule.
    #[must_use]
    pub const fn rule(&self) -> &NeighbourRule {
        &self.rule
    }

    /// The second step of pixel `number` of `pixels`, row · columns + column: see [`AsyncPixel::decide`]. `pixels` are all
    /// places of the array in this order, or as many as there are of its first ones.
    #[inline]
    pub(crate) fn decide<const BINS: usize, W: CounterWidth, R: DetectionRule>(
        &self,
        pixels: &[impl ArrayPixel<BINS, W>],
        number: usize,
        config: &PixelConfig<BINS, R>,
    ) -> Option<Detection> {
        let pixel = pixels.get(number)?.pixel()?;
        let address = PixelAddress::new(u16::try_from(number).ok()?);
        let around = self.array.neighbours(address, self.neighbours);
        let around = around.filter_map(|address| pixels.get(usize::from(address.raw()))?.pixel());
        pixel.decide(config, &self.rule, around)
    }
}

/// The threads of a program, among which the pixels of an array are shared.
pub trait Threads {
    /// Does `work` with all parts of `items`, each of which begins at the number that it gets. Adds the results up.
    fn each<P: Send, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        work: impl Fn(usize, &mut [P]) -> S + Sync,
    ) -> S;

    /// Decides for each of `items`, by number, with all of them as they are; then does `work` with each and what was found.
    /// Adds the results up.
    fn decide<P: Send + Sync, D: Send + Sync, S: Send + Default + AddAssign>(
        &self,
        items: &mut [P],
        decide: impl Fn(&[P], usize) -> Option<D> + Sync,
        work: impl Fn(&mut P, Option<&D>, &mut S) + Sync,
    ) -> S;
}

/// A look of all pixels.
pub(crate) struct ArrayLook<'a, const BINS: usize, R: DetectionRule> {
    pub(crate) config: &'a PixelConfig<BINS, R>,
    pub(crate) neighbours: &'a NeighbourConfig,
    pub(crate) last: LaserCycle,
}

impl<const BINS: usize, R: DetectionRule> ArrayLook<'_, BINS, R> {
    /// What [`end_laser_cycles`] does, on threads. First `count` counts the photons of each pixel, and gives those that are left out. Returns how
    /// many these are.
    pub(crate) fn end_laser_cycles_on<W: CounterWidth, P: ArrayPixel<BINS, W> + Send + Sync>(
        &self,
        threads: &impl Threads,
        pixels: &mut [P],
        statistics: &mut Statistics,
        cycles: u16,
        count: impl Fn(usize, &mut P) -> u64 + Sync,
    ) -> u64
    where
        R: Sync,
    {
        let begun = threads.each(pixels, |first, pixels| {
            let mut begun = Step::default();
            for (number, pixel) in (first..).zip(pixels) {
                begun.left_out += count(number, pixel);
                if let Some(pixel) = pixel.pixel_mut() {
                    begun.decides |= pixel.begin_look(self.config, &mut begun.statistics, cycles);
                }
            }
            begun
        });
        *statistics += begun.statistics;
        if !begun.decides {
            return begun.left_out;
        }
        let decide = |pixels: &[P], number| self.decide(pixels, number);
        let ended = threads.decide(pixels, decide, |pixel, found, ended: &mut Statistics| {
            if let (Some(pixel), Some(detection)) = (pixel.pixel_mut(), found) {
                pixel.keep_detection(self.last, detection);
            }
            pixel.end_look(self.config, ended, self.last);
        });
        *statistics += ended;
        begun.left_out
    }

    /// The detection of a pixel.
    fn decide<W: CounterWidth>(
        &self,
        pixels: &[impl ArrayPixel<BINS, W>],
        number: usize,
    ) -> Option<Detection> {
        self.neighbours.decide(pixels, number, self.config)
    }

    /// Those of all pixels, one after another.
    fn decide_in_turn<W: CounterWidth>(&self, pixels: &mut [impl ArrayPixel<BINS, W>]) {
        for number in 0..pixels.len() {
            let detection = self.decide(pixels, number);
            let pixel = pixels.get_mut(number).and_then(ArrayPixel::pixel_mut);
            if let (Some(pixel), Some(detection)) = (pixel, detection) {
                pixel.keep_detection(self.last, &detection);
            }
        }
    }
}

/// The three steps of a look, one after another.
pub(crate) fn end_laser_cycles<
    const BINS: usize,
    R: DetectionRule,
    W: CounterWidth,
    P: ArrayPixel<BINS, W>,
>(
    look: &ArrayLook<'_, BINS, R>,
    pixels: &mut [P],
    statistics: &mut Statistics,
    cycles: u16,
) {
    let mut decides = false;
    for pixel in pixels.iter_mut().filter_map(P::pixel_mut) {
        decides |= pixel.begin_look(look.config, statistics, cycles);
    }
    if decides {
        look.decide_in_turn(pixels);
        for pixel in pixels {
            pixel.end_look(look.config, statistics, look.last);
        }
    }
}

/// What the first step did in a part of the pixels.
#[derive(Default)]
struct Step {
    statistics: Statistics,
    decides: bool,
    left_out: u64,
}

impl AddAssign for Step {
    fn add_assign(&mut self, other: Self) {
        self.statistics += other.statistics;
        self.decides |= other.decides;
        self.left_out += other.left_out;
    }
}
