//! Adaptive binning: pixels that stay silent are counted together.
//!
//! A dim pixel may never gather enough photons for an event. So a pixel that has been silent
//! for a while feeds the block it is in: its photons count there as well. A block of level 1
//! has 2 × 2 pixels. It decides as a pixel does, by the same configuration, and reports an
//! event that holds for all of its pixels. If it stays silent it feeds a block of level 2, and
//! so on up to level 3, 8 × 8 pixels. A pixel works exactly as it does without blocks.
//!
//! All pixels have a tick every `patience` laser cycles. A pixel that had no event since the
//! last tick begins to feed its block. It stops once it reports.
//!
//! ```
//! use dtof_core::binning::Block;
//! use dtof_core::{
//!     Array, ArrayConfig, BlockLevel, PixelArray, PixelConfig, PixelPlace, checked,
//! };
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let level = BlockLevel::new(1).unwrap();
//! let config = ArrayConfig::new(Array::new(2, 2).unwrap(), CONFIG).blocks(level, CONFIG, 4)?;
//! let mut room: Vec<PixelPlace<128>> = (0..4).map(|_| PixelPlace::new()).collect();
//! let mut blocks = [Block::default()];
//! let mut array = PixelArray::new(&mut room, &mut blocks);
//! array.configure(&config)?;
//!
//! let _ = array.end_laser_cycles(4); // a tick: no pixel has reported, so all feed
//! for cycle in 0..40 {
//!     // Each pixel has a photon in every twelfth laser cycle.
//!     if cycle % 3 == 0 {
//!         array.photon(cycle / 3 % 4, 60);
//!     }
//!     array.end_laser_cycle();
//! }
//! let event = array.next_event().unwrap();
//! assert_eq!((event.pixel.raw(), event.level, event.peak_count.raw()), (0, level, 14));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Cost: a photon of a pixel that feeds is counted once more for each level that it reaches:
//! on a Cortex-M4 29 instructions for the first and 17 for each other. A look of a block takes
//! 168 with a window of 3 bins, that of a pixel 150. A block takes eight bytes less than the
//! place of a pixel; there are a third as many.
//!
//! The photons of an event of a block may be those of an event of a pixel as well: the two
//! are not independent. `docs/design.md` says why pixels do not hand their photons over and
//! start again.

use crate::array::Array;
use crate::config::PixelConfig;
use crate::detect::DetectionRule;
use crate::event::DepthEvent;
use crate::histogram::counter::Count16;
use crate::pixel::{AsyncPixel, Look, PixelData, observer};
use crate::statistics::Statistics;
use crate::units::{BlockLevel, LaserCycle, PixelAddress};

/// Which blocks an array has. They are numbered level by level, the blocks of a level row by
/// row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Binning {
    array: Array,
    levels: BlockLevel,
}

/// Where a block lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockPlace {
    /// Its first pixel.
    pub(crate) first: PixelAddress,
    /// How large it is.
    pub(crate) level: BlockLevel,
    /// The block of the next level, and whether it feeds it.
    pub(crate) link: BlockLink,
}

/// The block that a pixel or block is in, and whether it feeds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BlockLink {
    block: u16,
    links: bool,
    /// Since the last tick.
    has_reported: bool,
}

impl BlockLink {
    const NOWHERE: u16 = u16::MAX;

    /// To no block.
    pub(crate) const NONE: Self = Self::into_block(Self::NOWHERE);

    /// To the block of this number; off until the first tick.
    const fn into_block(block: u16) -> Self {
        Self {
            block,
            links: false,
            has_reported: false,
        }
    }

    /// The block that counts the photons as well, if the link is on.
    #[inline]
    #[must_use]
    pub(crate) const fn block(&self) -> Option<usize> {
        if self.links {
            Some(self.block as usize)
        } else {
            None
        }
    }

    /// There was an event: turns the link off.
    pub(crate) const fn reported(&mut self) {
        self.links = false;
        self.has_reported = true;
    }

    /// A tick: turns the link on, unless there was an event since the last tick or
    /// `has_reported` is true, as [`AsyncPixel::has_reported`] gives it. A link to no block
    /// stays off.
    pub(crate) const fn tick(&mut self, has_reported: bool) {
        let is_silent = !has_reported && !self.has_reported;
        self.links = is_silent && self.block != Self::NOWHERE;
        self.has_reported = false;
    }
}

impl Binning {
    /// Blocks of the levels 1 to `levels`; `None` if that is 0.
    #[must_use]
    pub(crate) const fn new(array: Array, levels: BlockLevel) -> Option<Self> {
        if levels.raw() == 0 {
            return None;
        }
        Some(Self { array, levels })
    }

    /// How many blocks there are: at most 57,344, those of one row of 65,536 pixels.
    #[must_use]
    pub(crate) const fn number_of_blocks(&self) -> u32 {
        self.first_number(self.levels.raw() + 1)
    }

    /// All blocks, in the order of their numbers.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = BlockPlace> + use<> {
        let binning = *self;
        let levels = (1..=self.levels.raw()).map(BlockLevel::saturating);
        levels.flat_map(move |level| {
            (0..binning.array.blocks(level)).map(move |block| {
                let first = binning.array.first_of(block, level);
                BlockPlace {
                    first,
                    level,
                    link: binning.link(first, level),
                }
            })
        })
    }

    /// The block of level 1 that a pixel feeds; [`BlockLink::NONE`] for a pixel outside the
    /// array.
    #[must_use]
    pub(crate) fn link_of(&self, pixel: PixelAddress) -> BlockLink {
        if u32::from(pixel.raw()) >= self.array.pixels() {
            return BlockLink::NONE;
        }
        self.link(pixel, BlockLevel::PIXEL)
    }

    /// The number of the block of `level` that begins with the pixel `first`.
    pub(crate) fn number_of(&self, level: BlockLevel, first: PixelAddress) -> Option<usize> {
        let number = self.first_number(level.raw()) + self.array.block_of(first, level);
        usize::try_from(number).ok()
    }

    /// The block of the next level that one of `level` with the pixel `first` feeds.
    fn link(&self, first: PixelAddress, level: BlockLevel) -> BlockLink {
        if level >= self.levels {
            return BlockLink::NONE;
        }
        let next = BlockLevel::saturating(level.raw() + 1);
        let number = self.first_number(next.raw()) + self.array.block_of(first, next);
        BlockLink::into_block(u16::try_from(number).unwrap_or(BlockLink::NOWHERE))
    }

    /// The number of the first block of `level`.
    // Out of line: it is called at configurations only, from three places.
    #[inline(never)]
    const fn first_number(&self, level: u8) -> u32 {
        let mut number = 0;
        let mut below = 1;
        while below < level {
            number += self.array.blocks(BlockLevel::saturating(below));
            below += 1;
        }
        number
    }
}

/// A block of pixels: a pixel with counters of 16 bits that counts for several.
#[derive(Clone, Debug)]
pub struct Block<const BINS: usize, T = ()> {
    pixel: AsyncPixel<BINS, Count16>,
    link: BlockLink,
    /// Of the program.
    pub data: T,
}

impl<const BINS: usize, T: PixelData> Block<BINS, T> {
    /// An empty block at the beginning of its first exposure.
    #[must_use]
    pub(crate) fn new(place: BlockPlace) -> Self {
        Self {
            pixel: AsyncPixel::of_block(place.first, place.level),
            link: place.link,
            data: T::default(),
        }
    }

    /// Ends `cycles` laser cycles at once, as [`AsyncPixel::end_laser_cycles`] does for a pixel.
    #[inline]
    pub(crate) fn end_laser_cycles<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
        cycles: u16,
    ) {
        let (pixel, observe) = (&mut self.pixel, observer(&mut self.data));
        let look = pixel.end_cycles::<R, false>(config, statistics, last, cycles, observe);
        // Also where it has waited for another echo, after a report.
        if matches!(look, Look::Event | Look::Ended) {
            self.link.reported();
        }
    }

    /// A tick: see [`BlockLink::tick`].
    pub(crate) const fn tick(&mut self) {
        self.link.tick(self.pixel.has_reported());
    }

    /// REQ: whether an event waits for the link.
    #[inline]
    #[must_use]
    pub(crate) const fn has_event(&self) -> bool {
        self.pixel.has_event()
    }

    /// ACK: takes the event that waits, so that the block can report again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub(crate) const fn take_event(&mut self) -> Option<DepthEvent> {
        self.pixel.take_event()
    }

    /// The pixel that counts for all of the block.
    #[must_use]
    pub const fn pixel(&self) -> &AsyncPixel<BINS, Count16> {
        &self.pixel
    }
}

/// Room for a block.
impl<const BINS: usize, T: PixelData> Default for Block<BINS, T> {
    fn default() -> Self {
        Self::new(BlockPlace {
            first: PixelAddress::new(0),
            level: BlockLevel::saturating(1),
            link: BlockLink::NONE,
        })
    }
}

/// Counts a photon of a pixel with this link in the blocks that it reaches.
#[inline]
pub(crate) fn count_in_blocks<const BINS: usize, R: DetectionRule, T>(
    blocks: &mut [Block<BINS, T>],
    link: &BlockLink,
    config: &PixelConfig<BINS, R>,
    code: u16,
) {
    let mut next = link.block();
    while let Some(block) = next.and_then(|number| blocks.get_mut(number)) {
        block.pixel.count_without_dead_time(config, code);
        next = block.link.block();
    }
}

/// Ends `cycles` laser cycles at once for all blocks, as
/// [`AsyncPixel::end_laser_cycles`] does for a pixel. `statistics` are those of the blocks.
pub(crate) fn end_laser_cycles_of_blocks<const BINS: usize, R: DetectionRule, T: PixelData>(
    blocks: &mut [Block<BINS, T>],
    config: &PixelConfig<BINS, R>,
    statistics: &mut Statistics,
    last: LaserCycle,
    cycles: u16,
) {
    for block in blocks {
        block.end_laser_cycles(config, statistics, last, cycles);
    }
}
