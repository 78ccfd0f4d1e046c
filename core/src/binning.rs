//! Adaptive binning: pixels that stay silent are counted together.
//!
//! A dim pixel may never gather enough photons for an event. So a pixel that has been silent
//! for a while feeds the block it is in: its photons count there as well. A block of level 1
//! has 2 × 2 pixels. It decides as a pixel does, by the same configuration, and reports an
//! event that holds for all of its pixels. If it stays silent it feeds a block of level 2, and
//! so on up to level 3, 8 × 8 pixels. A pixel works exactly as it does without blocks.
//!
//! Every `patience` laser cycles comes a tick, for all at once. Who has had no event since
//! the tick before feeds from now on; who reports feeds no more.
//!
//! ```
//! use dtof_core::fixed::types::U8F8;
//! use dtof_core::*;
//!
//! const CONFIG: PixelConfig<128> = checked!(PixelConfig::paper().build());
//! let level = BlockLevel::new(1).unwrap();
//! let binning = Binning::new(Array::new(2, 2).unwrap(), level).unwrap();
//!
//! let mut feeds: Vec<Feed> = (0..4).map(|pixel| binning.feed_of(PixelAddress(pixel))).collect();
//! let mut blocks: Vec<Block<128>> = binning.blocks().map(Block::new).collect();
//! feeds.iter_mut().for_each(|feed| feed.tick(false)); // nobody has reported yet: all feed
//!
//! let mut statistics = Statistics::default(); // of blocks
//! for cycle in 0..44 {
//!     // Each pixel has a photon in every fourth laser cycle.
//!     count_in_blocks(&mut blocks, &feeds[cycle % 4], &CONFIG, 60);
//!     end_laser_cycles_of_blocks(&mut blocks, &CONFIG, &mut statistics, LaserCycle(cycle as u64), 1);
//! }
//! let event = blocks[0].acknowledge().unwrap();
//! assert_eq!((event.pixel, event.level, event.peak_count.raw()), (PixelAddress(0), level, 44));
//! ```
//!
//! Cost: a photon of a pixel that feeds is counted once more for each level that it reaches:
//! on a Cortex-M4 30 instructions for the first and 18 for each other. A look of a block takes
//! 244 with a window of 3 bins, where that of a pixel takes 191. A block takes as much room
//! as a pixel and eight bytes more; there is a third as many of them.
//!
//! The photons of an event of a block may be those of an event of a pixel as well: the two
//! are not independent. Rejected: pixels that hand their photons over and start anew
//! (`docs/design.md`).

use crate::array::Array;
use crate::config::PixelConfig;
use crate::detect::DetectionRule;
use crate::event::DepthEvent;
use crate::histogram::counter::Count16;
use crate::pixel::{AsyncPixel, Decided, Look};
use crate::statistics::Statistics;
use crate::units::{BlockLevel, LaserCycle, PixelAddress};

/// Which blocks an array has. They are numbered level by level, the blocks of a level row by
/// row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Binning {
    array: Array,
    levels: BlockLevel,
}

/// Where a block lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlockPlace {
    /// Its first pixel.
    pub first: PixelAddress,
    /// How large it is.
    pub level: BlockLevel,
    /// The block of the next level that it feeds, while it does.
    pub feed: Feed,
}

/// Whether a pixel or block feeds the block it is in, and which that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Feed {
    block: u16,
    feeds: bool,
    /// Since the last tick.
    has_reported: bool,
}

impl Feed {
    const NOWHERE: u16 = u16::MAX;

    /// Into no block.
    pub const NONE: Self = Self::into_block(Self::NOWHERE);

    /// Into the block of this number; not before the first tick.
    const fn into_block(block: u16) -> Self {
        Self {
            block,
            feeds: false,
            has_reported: false,
        }
    }

    /// The block that photons count in as well, if the feed is on.
    #[inline]
    #[must_use]
    pub const fn block(&self) -> Option<usize> {
        if self.feeds {
            Some(self.block as usize)
        } else {
            None
        }
    }

    /// An event has come: the feed is off.
    pub const fn reported(&mut self) {
        self.feeds = false;
        self.has_reported = true;
    }

    /// The patience is over: the feed is on unless an event has come meanwhile, or
    /// [`AsyncPixel::has_reported`]. One into no block stays off.
    pub const fn tick(&mut self, has_reported: bool) {
        let is_silent = !has_reported && !self.has_reported;
        self.feeds = is_silent && self.block != Self::NOWHERE;
        self.has_reported = false;
    }
}

impl Binning {
    /// Blocks of the levels 1 to `levels`; `None` without any.
    #[must_use]
    pub const fn new(array: Array, levels: BlockLevel) -> Option<Self> {
        if levels.raw() == 0 {
            return None;
        }
        Some(Self { array, levels })
    }

    /// How many blocks there are: at most 57,344, those of one row of 65,536 pixels.
    #[must_use]
    pub const fn number_of_blocks(&self) -> u32 {
        self.first_number(self.levels.raw() + 1)
    }

    /// All blocks, in the order of their numbers.
    pub fn blocks(&self) -> impl Iterator<Item = BlockPlace> + use<> {
        let binning = *self;
        let levels = (1..=self.levels.raw()).map(BlockLevel::saturating);
        levels.flat_map(move |level| {
            (0..binning.array.blocks(level)).map(move |block| {
                let first = binning.array.first_of(block, level);
                BlockPlace {
                    first,
                    level,
                    feed: binning.feed(first, level),
                }
            })
        })
    }

    /// The block of level 1 that a pixel feeds; [`Feed::NONE`] of a pixel that is not in the
    /// array.
    #[must_use]
    pub fn feed_of(&self, pixel: PixelAddress) -> Feed {
        if u32::from(pixel.0) >= self.array.pixels() {
            return Feed::NONE;
        }
        self.feed(pixel, BlockLevel::PIXEL)
    }

    /// The block of the next level that one of `level` with the pixel `first` feeds.
    fn feed(&self, first: PixelAddress, level: BlockLevel) -> Feed {
        if level >= self.levels {
            return Feed::NONE;
        }
        let next = BlockLevel::saturating(level.raw() + 1);
        let number = self.first_number(next.raw()) + self.array.block_of(first, next);
        Feed::into_block(u16::try_from(number).unwrap_or(Feed::NOWHERE))
    }

    /// The number of the first block of `level`.
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
pub struct Block<const BINS: usize> {
    pixel: AsyncPixel<BINS, Count16>,
    feed: Feed,
}

impl<const BINS: usize> Block<BINS> {
    /// An empty block at the beginning of its first exposure.
    #[must_use]
    pub const fn new(place: BlockPlace) -> Self {
        Self {
            pixel: AsyncPixel::of_block(place.first, place.level),
            feed: place.feed,
        }
    }

    /// The patience is over. See [`Feed::tick`].
    pub const fn tick(&mut self) {
        self.feed.tick(self.pixel.has_reported());
    }

    /// REQ: whether an event waits for the link.
    #[inline]
    #[must_use]
    pub const fn request(&self) -> bool {
        self.pixel.request()
    }

    /// ACK: takes the event that waits, so that the block may fire again.
    #[inline]
    #[must_use = "the event is taken from the slot"]
    pub const fn acknowledge(&mut self) -> Option<DepthEvent> {
        self.pixel.acknowledge()
    }

    /// The pixel that counts for all of the block.
    #[must_use]
    pub const fn pixel(&self) -> &AsyncPixel<BINS, Count16> {
        &self.pixel
    }
}

impl<const BINS: usize> AsMut<Self> for Block<BINS> {
    fn as_mut(&mut self) -> &mut Self {
        self
    }
}

/// Counts a photon of a pixel with this feed in the blocks that it reaches.
#[inline]
pub fn count_in_blocks<const BINS: usize, R: DetectionRule>(
    blocks: &mut [impl AsMut<Block<BINS>>],
    feed: &Feed,
    config: &PixelConfig<BINS, R>,
    code: u16,
) {
    let mut next = feed.block();
    while let Some(block) = next.and_then(|number| blocks.get_mut(number)) {
        let block = block.as_mut();
        block.pixel.count(config, code);
        next = block.feed.block();
    }
}

/// Ends `cycles` laser cycles at once for all blocks, as
/// [`AsyncPixel::end_laser_cycles`] does for a pixel. `statistics` are those of the blocks.
/// Gives whether one of them has an event.
pub fn end_laser_cycles_of_blocks<const BINS: usize, R: DetectionRule>(
    blocks: &mut [impl AsMut<Block<BINS>>],
    config: &PixelConfig<BINS, R>,
    statistics: &mut Statistics,
    last: LaserCycle,
    cycles: u16,
) -> bool {
    end_laser_cycles_of_blocks_seen(blocks, config, statistics, last, cycles, |_, _| ())
}

/// The same, and shows for each event the number of its block among these, and what it is
/// decided from.
pub fn end_laser_cycles_of_blocks_seen<const BINS: usize, R: DetectionRule>(
    blocks: &mut [impl AsMut<Block<BINS>>],
    config: &PixelConfig<BINS, R>,
    statistics: &mut Statistics,
    last: LaserCycle,
    cycles: u16,
    mut see: impl FnMut(usize, Decided<'_, BINS, Count16>),
) -> bool {
    let mut fired = false;
    for (number, block) in blocks.iter_mut().enumerate() {
        let block = block.as_mut();
        let look = block
            .pixel
            .end_laser_cycles_seen(config, statistics, last, cycles, |decided| {
                see(number, decided);
            });
        if look == Look::Event {
            block.feed.reported();
            fired = true;
        }
    }
    fired
}
