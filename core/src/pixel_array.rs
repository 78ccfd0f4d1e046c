//! An array of pixels that is driven: photons in, events out.
//!
//! It has the order of a laser cycle, so that a program has not: photons count in their pixel, and in the blocks that it
//! feeds; every X laser cycles all pixels look, alone or with their [neighbours](crate::neighbours), then their
//! [blocks](crate::binning); pixels that have stayed silent begin to feed their block. A pixel that is left out counts
//! nothing and decides nothing.
//!
//! ```
//! use dtof_core::binning::Block;
//! use dtof_core::rule::z_for_levels;
//! use dtof_core::{
//!     Array, ArrayConfig, BlockLevel, Count, PixelArray, PixelConfig, PixelPlace, RangeGate, WindowRule,
//! };
//!
//! let level = BlockLevel::new(1).unwrap();
//! // One in 100 pixels has a false alarm in L2 laser cycles, its own or that of its block.
//! let z = z_for_levels(100, &RangeGate::<128>::full(), 4, 40, 2000, level);
//! let rule = WindowRule::new(3, z, Count::saturating(5))?;
//! let pixels = PixelConfig::with_rule(rule).build()?;
//! let blocks = PixelConfig::with_rule(rule.of_blocks(level)).build()?;
//! let config = ArrayConfig::new(Array::new(4, 2).unwrap(), pixels).blocks(level, blocks, 400)?;
//!
//! let mut room: Vec<PixelPlace<128>> = (0..8).map(|_| PixelPlace::new()).collect();
//! let mut block_room: Vec<Block<128>> = (0..2).map(|_| Block::default()).collect();
//! let mut array = PixelArray::new(&mut room, &mut block_room);
//! array.configure(&config)?;
//! array.leave_out(7);
//! let mut events = 0;
//! for cycle in 0..500 {
//!     for (pixel, code) in [(0, 60), (1, cycle % 128), (6, 60), (7, 60), (7, 60)] {
//!         array.photon(pixel, code);
//!     }
//!     array.end_laser_cycle();
//!     while let Some(event) = array.next_event() {
//!         assert_eq!(event.peak_bin.raw(), 60);
//!         events += 1;
//!     }
//! }
//! assert!(events > 20);
//! assert_eq!(array.losses().left_out, 2 * 500);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The photons of a laser cycle may come in any order; where they count once per bin, pixel by pixel or in the order of
//! time, as the queue of a shared TDC gives them: see [`ArrayConfig::once_per_bin`].
//!
//! Cost: pixels are touched at looks only, so a laser cycle without a look takes 12 instructions for the whole array.
//!
//! Source: the order is the flow chart of the paper's section II-B, for all pixels at once. The rest is ours.

use crate::array::Array;
use crate::binning::{Binning, Block, BlockLink, count_in_blocks, end_laser_cycles_of_blocks};
use crate::check::impl_error;
use crate::config::PixelConfig;
use crate::detect::{DetectionRule, PaperRule};
use crate::event::DepthEvent;
use crate::histogram::counter::{Count10, CounterWidth, PhotonCount};
use crate::neighbours::{self, ArrayLook, ArrayPixel, NeighbourConfig, Threads};
use crate::pixel::{AsyncPixel, Look, OncePerBin, PixelData, observer};
use crate::statistics::{Statistics, photons};
use crate::units::{BlockLevel, LaserCycle, PixelAddress};
use crate::whole::WholeHistogram;

/// A pixel of an array: its room. A program may keep `data` beside it.
#[derive(Clone, Debug)]
pub struct PixelPlace<const BINS: usize, W: CounterWidth = Count10, T = ()> {
    pixel: AsyncPixel<BINS, W>,
    feed: BlockLink,
    /// The low bits of the last laser cycle with a photon, and its latest bin, where photons count once per bin.
    seen_in: u32,
    latest: u16,
    use_of: Use,
    is_left_out: bool,
    /// Of the program. A configuration sets it to the default.
    pub data: T,
}

/// What a place is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    /// No pixel.
    Nothing,
    /// A pixel that is left out.
    LeftOut,
    /// A pixel.
    Plain,
    /// A pixel whose photons count once per bin.
    OncePerBin,
}

impl<const BINS: usize, W: CounterWidth, T: PixelData> PixelPlace<BINS, W, T> {
    /// Room for a pixel. A photon there is one of no pixel until a configuration uses it.
    #[must_use]
    pub fn new() -> Self {
        Self::of(PixelAddress::new(0), BlockLink::NONE, Use::Nothing)
    }

    #[inline(never)]
    fn of(address: PixelAddress, feed: BlockLink, use_of: Use) -> Self {
        Self {
            pixel: AsyncPixel::new(address),
            feed,
            seen_in: 0,
            latest: 0,
            use_of,
            is_left_out: false,
            data: T::default(),
        }
    }
}

impl<const BINS: usize, W: CounterWidth, T: PixelData> Default for PixelPlace<BINS, W, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BINS: usize, W: CounterWidth, T: PixelData> ArrayPixel<BINS, W>
    for PixelPlace<BINS, W, T>
{
    #[inline(always)]
    fn pixel(&self) -> Option<&AsyncPixel<BINS, W>> {
        self.use_of.counts().then_some(&self.pixel)
    }

    #[inline(always)]
    fn pixel_mut(&mut self) -> Option<&mut AsyncPixel<BINS, W>> {
        self.use_of.counts().then_some(&mut self.pixel)
    }

    #[inline(always)]
    fn end_look<R: DetectionRule>(
        &mut self,
        config: &PixelConfig<BINS, R>,
        statistics: &mut Statistics,
        last: LaserCycle,
    ) {
        if self.use_of.counts() {
            let data = &mut self.data;
            self.pixel
                .end_look(config, statistics, last, observer(data));
        }
    }
}

impl Use {
    #[inline(always)]
    const fn counts(self) -> bool {
        matches!(self, Self::Plain | Self::OncePerBin)
    }
}

/// How the pixels of an array operate.
#[derive(Debug)]
pub struct ArrayConfig<
    const BINS: usize,
    R: DetectionRule = PaperRule,
    W: CounterWidth = Count10,
    T = (),
> {
    layout: Array,
    number: u32,
    pixels: PixelConfig<BINS, R>,
    together: Together<BINS, R, W, T>,
    once_per_bin: bool,
}

/// How pixels decide together, with a pointer to the code of a look: a program that configures no blocks does not link
/// theirs, and the same with neighbours.
#[derive(Debug)]
enum Together<const BINS: usize, R: DetectionRule, W: CounterWidth, T> {
    Alone,
    Blocks {
        levels: BlockLevel,
        config: PixelConfig<BINS, R>,
        patience: u16,
        look: LookOfBlocks<BINS, R, T>,
    },
    Neighbours(NeighbourConfig, LookInTurn<BINS, R, W, T>),
}

/// [`end_laser_cycles_of_blocks`].
type LookOfBlocks<const BINS: usize, R, T> =
    fn(&mut [Block<BINS, T>], &PixelConfig<BINS, R>, &mut Statistics, LaserCycle, u16);

/// [`neighbours::end_laser_cycles`] of places.
type LookInTurn<const BINS: usize, R, W, T> =
    fn(&ArrayLook<'_, BINS, R>, &mut [PixelPlace<BINS, W, T>], &mut Statistics, u16);

// Derived, these would ask for data that can be copied.
impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> Clone for ArrayConfig<BINS, R, W, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> Copy for ArrayConfig<BINS, R, W, T> {}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> Clone for Together<BINS, R, W, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> Copy for Together<BINS, R, W, T> {}

/// An array that cannot be driven so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ArrayError {
    /// There is no room for so many pixels.
    Pixels,
    /// The layout has fewer pixels, or neighbours have another one.
    Layout,
    /// There is no room for the blocks.
    Blocks,
    /// Blocks have a level of 1 or more.
    NoLevel,
    /// Blocks look when pixels do.
    OtherLooks,
    /// Both blocks and neighbours.
    BlocksAndNeighbours,
    /// The rule weighs a dead time, which neighbours do not.
    NeighboursAndDeadTime,
    /// The room is not that of the state.
    OtherRoom,
}

impl ArrayError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Pixels => "there is no room for so many pixels",
            Self::Layout => "the layout has fewer pixels, or neighbours have another one",
            Self::Blocks => "there is no room for so many blocks",
            Self::NoLevel => "blocks have at least level 1",
            Self::OtherLooks => "X of the blocks must be that of the pixels",
            Self::BlocksAndNeighbours => "pixels have blocks or neighbours, not both",
            Self::NeighboursAndDeadTime => "neighbours do not weigh a dead time",
            Self::OtherRoom => "the room has another size than that of the state",
        }
    }
}

impl_error!(ArrayError);

impl<const BINS: usize, R, W, T> ArrayConfig<BINS, R, W, T>
where
    R: DetectionRule,
    W: CounterWidth,
    T: PixelData,
{
    /// Pixels that decide alone.
    #[must_use]
    pub const fn new(layout: Array, pixels: PixelConfig<BINS, R>) -> Self {
        Self {
            layout,
            number: layout.pixels(),
            pixels,
            together: Together::Alone,
            once_per_bin: false,
        }
    }

    /// The first `number` pixels of the layout only: its last rows are not full.
    ///
    /// # Errors
    /// Fails if the layout has fewer.
    pub const fn first(mut self, number: u32) -> Result<Self, ArrayError> {
        if number > self.layout.pixels() {
            return Err(ArrayError::Layout);
        }
        self.number = number;
        Ok(self)
    }

    /// With [blocks](crate::binning) of the levels 1 to `levels`, and ticks every `patience` laser cycles, rounded up to
    /// looks. `config` is that of the blocks. With a window rule its z is that of
    /// [`z_for_levels`](crate::rule::z_for_levels), and that of the blocks' rule of [`WindowRule::of_blocks`](
    /// crate::WindowRule::of_blocks), or there are more false alarms.
    ///
    /// # Errors
    /// Fails without levels, with another X, and with neighbours.
    pub const fn blocks(
        mut self,
        levels: BlockLevel,
        config: PixelConfig<BINS, R>,
        patience: u16,
    ) -> Result<Self, ArrayError> {
        if levels.raw() == 0 {
            return Err(ArrayError::NoLevel);
        }
        if config.x() != self.pixels.x() {
            return Err(ArrayError::OtherLooks);
        }
        if self.has_neighbours() {
            return Err(ArrayError::BlocksAndNeighbours);
        }
        self.together = Together::Blocks {
            levels,
            config,
            patience,
            look: end_laser_cycles_of_blocks,
        };
        Ok(self)
    }

    /// With [neighbours](crate::neighbours) that confirm. The rule of the pixels must be [`NeighbourRule::own`] of theirs, or
    /// there may be half as many false alarms more.
    ///
    /// # Errors
    /// Fails for another array, with blocks, and with a dead time that the rule weighs.
    ///
    /// [`NeighbourRule::own`]: crate::neighbours::NeighbourRule::own
    pub fn neighbours(mut self, neighbours: NeighbourConfig) -> Result<Self, ArrayError> {
        if *neighbours.array() != self.layout {
            return Err(ArrayError::Layout);
        }
        if self.pixels.weighs_dead_time() {
            return Err(ArrayError::NeighboursAndDeadTime);
        }
        if matches!(self.together, Together::Blocks { .. }) {
            return Err(ArrayError::BlocksAndNeighbours);
        }
        self.together = Together::Neighbours(neighbours, neighbours::end_laser_cycles);
        Ok(self)
    }

    /// Photons of one laser cycle in one bin count [once](OncePerBin). The photons of a pixel come together, or in the order
    /// of time between those of others. A photon that comes later than one of a later bin, and not together with it, does
    /// not count, because it may be a second one: see [`ArrayLosses::unordered`].
    #[must_use]
    pub const fn once_per_bin(mut self) -> Self {
        self.once_per_bin = true;
        self
    }

    /// How the pixels operate.
    #[must_use]
    pub const fn pixels(&self) -> &PixelConfig<BINS, R> {
        &self.pixels
    }

    /// The pixels and blocks for which it takes room.
    #[must_use]
    pub const fn room(&self) -> [usize; 2] {
        let blocks = match self.binning() {
            Some(binning) => binning.number_of_blocks(),
            None => 0,
        };
        [self.number as usize, blocks as usize]
    }

    /// Whether neighbours confirm.
    #[must_use]
    pub const fn has_neighbours(&self) -> bool {
        matches!(self.together, Together::Neighbours(..))
    }

    /// The blocks, if there are some.
    const fn binning(&self) -> Option<Binning> {
        match self.together {
            Together::Blocks { levels, .. } => Binning::new(self.layout, levels),
            _ => None,
        }
    }
}

/// The bins in which a pixel has had photons one after another in this laser cycle.
#[derive(Clone, Copy, Debug)]
struct Seen {
    pixel: usize,
    bins: OncePerBin<{ OncePerBin::words(1024) }>,
    /// The latest bin of its photons in this laser cycle that came before others.
    latest: Option<u16>,
}

impl Seen {
    const fn of(pixel: usize, latest: Option<u16>) -> Self {
        Self {
            pixel,
            bins: OncePerBin::new(),
            latest,
        }
    }

    /// Whether no photon of the laser cycle was in this bin before.
    fn is_first(&mut self, code: u16) -> bool {
        self.latest.is_none_or(|latest| code > latest) && self.bins.is_first(code)
    }
}

/// Photons of a pixel that are counted at once.
const AT_ONCE: usize = 16;

/// Counts the photons of a pixel: `next` writes the next codes and returns how many these are; if there was room for more,
/// they are the last.
fn in_batches<P>(
    of: &mut P,
    next: impl Fn(&mut P, &mut [u16]) -> usize,
    mut count: impl FnMut(&mut P, &[u16]),
) {
    let mut codes = [0; AT_ONCE];
    loop {
        let number = next(of, &mut codes).min(AT_ONCE);
        if let Some(codes @ [_, ..]) = codes.get(..number) {
            count(of, codes);
        }
        if number < AT_ONCE {
            return;
        }
    }
}

/// A look of all pixels, each of which decides alone.
// Out of line: with all that `look` does it would lack registers.
#[inline(never)]
fn end_laser_cycles_alone<const BINS: usize, R: DetectionRule, W: CounterWidth, T: PixelData>(
    places: &mut [PixelPlace<BINS, W, T>],
    config: &PixelConfig<BINS, R>,
    statistics: &mut Statistics,
    last: LaserCycle,
    cycles: u16,
) {
    for place in places.iter_mut().filter(|place| place.use_of.counts()) {
        let (pixel, observe) = (&mut place.pixel, observer(&mut place.data));
        let look = pixel.end_laser_cycles_with(config, statistics, last, cycles, observe);
        // A pixel that has waited for another echo has reported, too.
        if matches!(look, Look::Event | Look::Ended) {
            place.feed.reported();
        }
    }
}

/// Photons that counted in no pixel, since the configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ArrayLosses {
    /// Of addresses without a pixel.
    pub unaddressed: u64,
    /// Of pixels that are left out.
    pub left_out: u64,
    /// Whose bin may have had one in the same laser cycle, because they came out of order. They are among the repeated ones
    /// of the statistics.
    pub unordered: u64,
    /// That never came, as [`PixelArray::lost`] was told.
    pub photons: u64,
    /// Laser cycles whose photons never came.
    pub laser_cycles: u64,
}

/// An array of pixels in the room that a program gives it.
#[derive(Debug)]
pub struct PixelArray<'a, const BINS: usize, R: DetectionRule, W: CounterWidth = Count10, T = ()> {
    pixels: &'a mut [PixelPlace<BINS, W, T>],
    blocks: &'a mut [Block<BINS, T>],
    state: ArrayState<BINS, R, W, T>,
}

/// What an array is beside its pixels and blocks, for a program that does not have their room at hand all the time.
#[derive(Clone, Debug)]
pub struct ArrayState<const BINS: usize, R: DetectionRule, W: CounterWidth = Count10, T = ()> {
    /// The places for pixels and blocks.
    room: [usize; 2],
    config: Option<ArrayConfig<BINS, R, W, T>>,
    /// Of the rooms, those in use.
    pixels_in_use: usize,
    blocks_in_use: usize,
    /// Laser cycles that have ended.
    cycle: u64,
    /// Those since the last look: all pixels look at once.
    since_look: u16,
    /// Those up to the last look in which looks were left out, since they find nothing.
    dark: u16,
    /// Those from the last tick of the blocks to the last look.
    since_tick: u16,
    /// The pixel, or after the pixels the block, whose slot is emptied next.
    turn: usize,
    /// Events of pixels and of blocks that have left their slots.
    taken: [u64; 2],
    /// Of the pixel whose photons come now, where they count once per bin.
    seen: Seen,
    /// The laser cycles of the whole histograms that come now.
    frame_cycles: u32,
    statistics: Statistics,
    block_statistics: Statistics,
    losses: ArrayLosses,
}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> ArrayState<BINS, R, W, T> {
    /// Of an array without room.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            room: [0; 2],
            config: None,
            pixels_in_use: 0,
            blocks_in_use: 0,
            cycle: 0,
            since_look: 0,
            dark: 0,
            since_tick: 0,
            turn: 0,
            taken: [0; 2],
            seen: Seen::of(0, None),
            frame_cycles: 0,
            statistics: Statistics::new(),
            block_statistics: Statistics::new(),
            losses: ArrayLosses {
                unaddressed: 0,
                left_out: 0,
                unordered: 0,
                photons: 0,
                laser_cycles: 0,
            },
        }
    }

    /// Laser cycles have ended.
    const fn pass(&mut self, cycles: u64) {
        self.cycle = self.cycle.saturating_add(cycles);
    }
}

impl<const BINS: usize, R: DetectionRule, W: CounterWidth, T> Default
    for ArrayState<BINS, R, W, T>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<'a, const BINS: usize, R, W, T> PixelArray<'a, BINS, R, W, T>
where
    R: DetectionRule,
    W: CounterWidth,
    T: PixelData,
{
    /// An array without pixels, until a configuration. Without blocks `blocks` may be empty.
    #[must_use]
    pub fn new(pixels: &'a mut [PixelPlace<BINS, W, T>], blocks: &'a mut [Block<BINS, T>]) -> Self {
        let mut array = Self {
            pixels,
            blocks,
            state: ArrayState::new(),
        };
        // The room may have been used before.
        array.clear();
        array
    }

    /// The array that [`Self::into_state`] took apart, in the same room.
    ///
    /// # Errors
    /// Fails if the room has another size. Nothing tells another room of the same size.
    pub const fn resume(
        pixels: &'a mut [PixelPlace<BINS, W, T>],
        blocks: &'a mut [Block<BINS, T>],
        state: ArrayState<BINS, R, W, T>,
    ) -> Result<Self, ArrayError> {
        if pixels.len() != state.room[0] || blocks.len() != state.room[1] {
            return Err(ArrayError::OtherRoom);
        }
        Ok(Self {
            pixels,
            blocks,
            state,
        })
    }

    /// What is not in its pixels and blocks.
    #[must_use]
    pub fn into_state(self) -> ArrayState<BINS, R, W, T> {
        self.state
    }

    /// The pixels and blocks of a configuration, for which there is room.
    ///
    /// # Errors
    /// Fails if there is none.
    pub fn check(&self, config: &ArrayConfig<BINS, R, W, T>) -> Result<[usize; 2], ArrayError> {
        let [pixels, blocks] = config.room();
        if pixels > self.pixels.len() {
            return Err(ArrayError::Pixels);
        }
        if blocks > self.blocks.len() {
            return Err(ArrayError::Blocks);
        }
        Ok([pixels, blocks])
    }

    /// All pixels begin, and all counts are 0.
    ///
    /// # Errors
    /// Fails without room for that. The array stays as it was.
    pub fn configure(&mut self, config: &ArrayConfig<BINS, R, W, T>) -> Result<(), ArrayError> {
        let [pixels, blocks] = self.check(config)?;
        let binning = config.binning();
        self.clear();
        let use_of = match config.once_per_bin {
            true => Use::OncePerBin,
            false => Use::Plain,
        };
        let addresses = (0..=u16::MAX).map(PixelAddress::new);
        for (place, address) in self.pixels.iter_mut().take(pixels).zip(addresses) {
            let feed = binning.map_or(BlockLink::NONE, |binning| binning.link_of(address));
            let is_left_out = place.is_left_out;
            *place = PixelPlace::of(address, feed, use_of);
            if is_left_out {
                (place.is_left_out, place.use_of) = (true, Use::LeftOut);
            }
        }
        for (block, place) in self
            .blocks
            .iter_mut()
            .zip(binning.iter().flat_map(Binning::blocks))
        {
            *block = Block::new(place);
        }
        (self.state.pixels_in_use, self.state.blocks_in_use) = (pixels, blocks);
        self.state.config = Some(*config);
        Ok(())
    }

    /// The array has no pixels, until a configuration.
    pub fn clear(&mut self) {
        for place in self.pixels.iter_mut() {
            place.use_of = Use::Nothing;
        }
        self.state = ArrayState::new();
        self.state.room = [self.pixels.len(), self.blocks.len()];
    }
}

impl<const BINS: usize, R, W, T> PixelArray<'_, BINS, R, W, T>
where
    R: DetectionRule,
    W: CounterWidth,
    T: PixelData,
{
    /// Counts a photon of pixel number `pixel`, row · columns + column, with the TDC code `code` in the current laser cycle.
    pub fn photon(&mut self, pixel: usize, code: u16) {
        let use_of = self.pixels.get(pixel).map(|place| place.use_of);
        if use_of != Some(Use::Plain) && !self.counts(pixel, code) {
            return;
        }
        if let (Some(place), Some(config)) = (self.pixels.get_mut(pixel), &self.state.config) {
            place.pixel.count(&config.pixels, code);
            // Not through a pointer: it is small, and a call would take a sixth longer.
            if let Together::Blocks { config, .. } = &config.together {
                count_in_blocks(self.blocks, &place.feed, config, code);
            }
        }
    }

    /// Counts photons of one pixel in the current laser cycle, as [`Self::photon`] does, in less time for each unless the
    /// pixel feeds its block.
    pub fn photons(&mut self, pixel: usize, codes: &[u16]) {
        if let (Some(place), Some(config)) = (self.pixels.get_mut(pixel), &self.state.config)
            && place.use_of == Use::Plain
            && place.feed.block().is_none()
        {
            place.pixel.count_batch(&config.pixels, codes);
        } else {
            codes.iter().for_each(|&code| self.photon(pixel, code));
        }
    }

    /// Whether a photon counts that is not one of a plain pixel.
    // Out of line: a photon that counts anyhow would take longer with it.
    #[inline(never)]
    fn counts(&mut self, pixel: usize, code: u16) -> bool {
        let Some(place) = self.pixels.get_mut(pixel) else {
            self.state.losses.unaddressed += 1;
            return false;
        };
        if !place.use_of.counts() {
            match place.use_of {
                Use::LeftOut => self.state.losses.left_out += 1,
                _ => self.state.losses.unaddressed += 1,
            }
            return false;
        }
        if usize::from(code) >= BINS {
            return true;
        }
        #[allow(clippy::cast_possible_truncation, reason = "the low bits")]
        let now = (self.state.cycle as u32).wrapping_add(1);
        if place.seen_in != now {
            (place.seen_in, place.latest) = (now, code);
            self.state.seen = Seen::of(pixel, None);
        } else if self.state.seen.pixel != pixel {
            self.state.seen = Seen::of(pixel, Some(place.latest));
        }
        if !self.state.seen.is_first(code) {
            self.state.statistics.repeated += 1;
            self.state.losses.unordered += u64::from(Some(code) < self.state.seen.latest);
            return false;
        }
        place.latest = place.latest.max(code);
        true
    }

    /// Ends the current laser cycle, with photons or without. Take the events then: one that stays in its slot defers the
    /// next decision of its pixel.
    #[inline]
    pub fn end_laser_cycle(&mut self) {
        let _ = self.end_laser_cycles(1);
    }

    /// Ends `cycles` laser cycles without further photons, up to and with the next look, and those after it whose looks find
    /// nothing for want of a photon. Returns how many are left: end these after the events of that look are taken.
    #[inline]
    #[must_use = "these laser cycles have not ended yet"]
    pub fn end_laser_cycles(&mut self, cycles: u16) -> u16 {
        self.end(cycles, |in_turn, look, places, statistics, cycles| {
            in_turn(look, places, statistics, cycles);
        })
    }

    /// The same on the threads of a program, after it has counted photons: `next` writes the next codes of a pixel and
    /// returns how many these are; if there was room for more, they are the last. They are photons of these laser cycles up
    /// to [the next look](Self::to_look), or of the current laser cycle where they count once per bin; laser cycles past that
    /// look have none. Without a configuration it takes none.
    ///
    /// Only pixels with neighbours, whose looks take by far the most time, are shared among the threads.
    #[must_use = "these laser cycles have not ended yet"]
    pub fn end_laser_cycles_on(
        &mut self,
        threads: &impl Threads,
        cycles: u16,
        next: impl Fn(usize, &mut T, &mut [u16]) -> usize + Sync,
    ) -> u16
    where
        R: Sync,
        PixelPlace<BINS, W, T>: Send + Sync,
    {
        let together = self.state.config.as_ref().is_some_and(|config| {
            config.has_neighbours() && !config.once_per_bin && cycles >= self.to_look()
        });
        if !together {
            self.photons_in_turn(&next);
        }
        let mut left_out = 0;
        let left = self.end(cycles, |_, look, places, statistics, cycles| {
            let count = |pixel, place: &mut PixelPlace<BINS, W, T>| {
                let mut left_out = 0;
                if together {
                    let next = |place: &mut PixelPlace<_, _, T>, codes: &mut [u16]| {
                        next(pixel, &mut place.data, codes)
                    };
                    in_batches(place, next, |place, codes| match place.use_of.counts() {
                        true => place.pixel.count_batch(look.config, codes),
                        false => left_out += codes.len() as u64,
                    });
                }
                left_out
            };
            left_out = look.end_laser_cycles_on(threads, places, statistics, cycles, count);
        });
        self.state.losses.left_out += left_out;
        left
    }

    fn photons_in_turn(&mut self, next: impl Fn(usize, &mut T, &mut [u16]) -> usize) {
        for pixel in 0..self.state.pixels_in_use {
            let next = |array: &mut Self, codes: &mut [u16]| {
                let place = array.pixels.get_mut(pixel);
                place.map_or(0, |place| next(pixel, &mut place.data, codes))
            };
            in_batches(self, next, |array, codes| array.photons(pixel, codes));
        }
    }

    /// The program's data beside the pixels.
    pub fn data(&mut self) -> impl Iterator<Item = &mut T> {
        let places = self.pixels.iter_mut().take(self.state.pixels_in_use);
        places.map(|place| &mut place.data)
    }

    /// `look` is that of pixels with neighbours.
    #[inline(always)]
    fn end(
        &mut self,
        cycles: u16,
        look: impl FnOnce(
            LookInTurn<BINS, R, W, T>,
            &ArrayLook<'_, BINS, R>,
            &mut [PixelPlace<BINS, W, T>],
            &mut Statistics,
            u16,
        ),
    ) -> u16 {
        let Some(config) = &self.state.config else {
            return 0;
        };
        let x = config.pixels.x();
        let to_look = x - self.state.since_look;
        if cycles < to_look {
            self.state.since_look += cycles;
            self.state.pass(cycles.into());
            return 0;
        }
        self.state.pass(to_look.into());
        self.state.since_look = 0;
        let blind_looks = self.state.statistics.blind_looks;
        self.look(look);
        let left = cycles - to_look;
        if left < x || self.has_event() || self.state.statistics.blind_looks != blind_looks {
            return left;
        }
        let dark = self.dark_cycles(left);
        self.state.dark = dark;
        self.state.pass(dark.into());
        left - dark
    }

    /// All pixels look: X laser cycles after the last look, or later if looks were left out.
    #[inline(never)]
    fn look(
        &mut self,
        of_neighbours: impl FnOnce(
            LookInTurn<BINS, R, W, T>,
            &ArrayLook<'_, BINS, R>,
            &mut [PixelPlace<BINS, W, T>],
            &mut Statistics,
            u16,
        ),
    ) {
        // An event that was left has its turn before those that come now.
        self.state.turn = self.next_slot(self.state.turn).unwrap_or(0);
        let Some(config) = &self.state.config else {
            return;
        };
        let pixels = &config.pixels;
        let cycles = pixels.x() + core::mem::take(&mut self.state.dark);
        let last = LaserCycle::new(self.state.cycle.saturating_sub(1));
        let places = self
            .pixels
            .get_mut(..self.state.pixels_in_use)
            .unwrap_or_default();
        let statistics = &mut self.state.statistics;
        if let Together::Neighbours(neighbours, in_turn) = &config.together {
            let look = ArrayLook {
                config: pixels,
                neighbours,
                last,
            };
            of_neighbours(*in_turn, &look, places, statistics, cycles);
        } else {
            end_laser_cycles_alone(places, pixels, statistics, last, cycles);
        }
        if let Together::Blocks {
            config,
            patience,
            look: look_of_blocks,
            ..
        } = &config.together
        {
            let blocks = self
                .blocks
                .get_mut(..self.state.blocks_in_use)
                .unwrap_or_default();
            let statistics = &mut self.state.block_statistics;
            look_of_blocks(blocks, config, statistics, last, cycles);
            self.state.since_tick = self.state.since_tick.saturating_add(cycles);
            if self.state.since_tick >= *patience {
                self.state.since_tick = 0;
                for place in places {
                    place.feed.tick(place.pixel.has_reported());
                }
                blocks.iter_mut().for_each(Block::tick);
            }
        }
    }

    /// Of the next `cycles` laser cycles, which have no photon, those up to the last look that finds nothing, before the next
    /// tick. All pixels have just looked and found nothing.
    #[inline(never)]
    fn dark_cycles(&self, cycles: u16) -> u16 {
        let Some(config) = &self.state.config else {
            return 0;
        };
        let (pixels, x) = (&config.pixels, config.pixels.x());
        let mut dark = cycles.min(u16::MAX - x);
        for place in self.pixels.iter().take(self.state.pixels_in_use) {
            if place.use_of.counts() {
                dark = dark.min(place.pixel.dark_cycles(pixels, config.has_neighbours()));
            }
            if dark < x {
                return 0;
            }
        }
        if let Together::Blocks {
            config, patience, ..
        } = &config.together
        {
            dark = dark.min(patience.saturating_sub(self.state.since_tick + 1));
            for block in self.blocks.iter().take(self.state.blocks_in_use) {
                dark = dark.min(block.pixel().dark_cycles(config, false));
            }
        }
        dark - dark.checked_rem(x).unwrap_or(0)
    }

    /// Takes an event out of its slot: of the pixels by address, then of the blocks. Who does not take all goes on from there
    /// later, so that each has its turn.
    pub fn next_event(&mut self) -> Option<DepthEvent> {
        let slot = self.next_slot(self.state.turn)?;
        let event = match slot.checked_sub(self.state.pixels_in_use) {
            None => {
                self.state.taken[0] += 1;
                self.pixels.get_mut(slot)?.pixel.take_event()
            }
            Some(block) => {
                self.state.taken[1] += 1;
                self.blocks.get_mut(block)?.take_event()
            }
        };
        self.state.turn = slot + 1;
        event
    }

    /// The next slot from `from` on with an event, or else the first.
    #[inline(never)]
    fn next_slot(&self, from: usize) -> Option<usize> {
        if !self.has_event() {
            return None;
        }
        let slots = self.state.pixels_in_use + self.state.blocks_in_use;
        let mut slot = from;
        for _ in 0..slots {
            if slot >= slots {
                slot = 0;
            }
            let has_event = match slot.checked_sub(self.state.pixels_in_use) {
                None => self.pixels.get(slot).map(|place| place.pixel.has_event()),
                Some(block) => self.blocks.get(block).map(Block::has_event),
            };
            if has_event == Some(true) {
                return Some(slot);
            }
            slot += 1;
        }
        None
    }

    /// Whether an event waits in its slot.
    #[inline]
    #[must_use]
    pub const fn has_event(&self) -> bool {
        self.state.statistics.events != self.state.taken[0]
            || self.state.block_statistics.events != self.state.taken[1]
    }

    /// Whether the pixels have looked at the end of the last laser cycle, or would have found nothing, or have just been
    /// configured.
    #[must_use]
    pub const fn has_looked(&self) -> bool {
        self.state.since_look == 0
    }

    /// A sensor has counted whole histograms for `cycles` laser cycles by itself: each comes by [`Self::histogram`].
    pub fn begin_frame(&mut self, cycles: u32) {
        self.state.pass(cycles.into());
        self.state.frame_cycles = cycles;
    }

    /// Decides on the whole histogram of a pixel, alone, and calls `event` for each event, all of the last laser cycle of the
    /// frame. Its exposure is the laser cycles of the frame, at most 65,535. Without `room` for the events of all echoes
    /// the histogram is a deferred decision. It is decided on in counters of `V`: 24 bits, or 20 for 512 bins and more.
    pub fn histogram<V: CounterWidth, C: PhotonCount>(
        &mut self,
        pixel: PixelAddress,
        counts: &[C; BINS],
        room: usize,
        mut event: impl FnMut(&DepthEvent),
    ) {
        let place = self.pixels.get(usize::from(pixel.raw()));
        let use_of = place.map_or(Use::Nothing, |place| place.use_of);
        if use_of == Use::LeftOut {
            self.state.losses.left_out += photons(Some(counts));
            return;
        }
        let Some(config) = self
            .state
            .config
            .as_ref()
            .filter(|_| use_of != Use::Nothing)
        else {
            self.state.losses.unaddressed += photons(Some(counts));
            return;
        };
        let (config, statistics) = (&config.pixels, &mut self.state.statistics);
        if room < usize::from(config.echoes().raw()) {
            statistics.add_counts(counts, config.gate());
            statistics.deferred += 1;
            return;
        }
        let last = LaserCycle::new(self.state.cycle.saturating_sub(1));
        let exposure = u16::try_from(self.state.frame_cycles).unwrap_or(u16::MAX);
        let mut whole = WholeHistogram::<BINS, V>::new();
        let cycles = self.state.frame_cycles.into();
        whole.decide(config, counts, cycles, statistics, |echo, detection| {
            let first = detection.event(pixel, last, exposure);
            event(&DepthEvent { echo, ..first });
            self.state.taken[0] += 1;
        });
    }

    /// The queue of a TDC has lost `photons`, and all photons of `laser_cycles`. These laser cycles are numbered, but they
    /// belong to no exposure. Call it between two laser cycles. Photons that are lost in laser cycles that end as others do
    /// make peaks lower.
    pub const fn lost(&mut self, photons: u64, laser_cycles: u64) {
        self.state.losses.photons = self.state.losses.photons.saturating_add(photons);
        self.state.losses.laser_cycles =
            self.state.losses.laser_cycles.saturating_add(laser_cycles);
        self.state.pass(laser_cycles);
    }

    /// Leaves a pixel out from now on, whatever the configuration: its photons count as left out, and it decides nothing.
    /// An event that waits in its slot still comes. Its place stays left out, in another array of the same room, too, until
    /// the program puts a new [`PixelPlace`] there. Without room for the pixel nothing happens.
    pub fn leave_out(&mut self, pixel: usize) {
        if let Some(place) = self.pixels.get_mut(pixel) {
            place.is_left_out = true;
            if place.use_of != Use::Nothing {
                place.use_of = Use::LeftOut;
            }
        }
    }

    /// The program's data beside the pixel or the block of an event.
    pub fn data_of(&mut self, event: &DepthEvent) -> Option<&mut T> {
        if event.level == BlockLevel::PIXEL {
            let place = self.pixels.get_mut(usize::from(event.pixel.raw()))?;
            return Some(&mut place.data);
        }
        let binning = self.state.config.as_ref()?.binning()?;
        let place = binning.number_of(event.level, event.pixel)?;
        Some(&mut self.blocks.get_mut(place)?.data)
    }

    /// The configuration in force.
    #[must_use]
    pub const fn config(&self) -> Option<&ArrayConfig<BINS, R, W, T>> {
        self.state.config.as_ref()
    }

    /// The pixels for which there is room.
    #[must_use]
    pub const fn room(&self) -> usize {
        self.pixels.len()
    }

    /// A pixel. Its exposure is that of the last look that was not left out: see [`Self::exposure`].
    #[must_use]
    pub fn pixel(&self, pixel: usize) -> Option<&AsyncPixel<BINS, W>> {
        self.pixels.get(pixel)?.pixel()
    }

    /// The laser cycles of a pixel's exposure that have ended.
    #[must_use]
    pub fn exposure(&self, pixel: usize) -> Option<u16> {
        let exposure = self.pixel(pixel)?.exposure();
        let since = self.state.dark.saturating_add(self.state.since_look);
        Some(exposure.saturating_add(since))
    }

    /// Laser cycles up to and with the next look: the photons of these may come pixel by pixel, unless they count once per bin.
    #[must_use]
    pub const fn to_look(&self) -> u16 {
        match &self.state.config {
            Some(config) => config.pixels.x() - self.state.since_look,
            None => 1,
        }
    }

    /// Laser cycles that have ended since the configuration.
    #[must_use]
    pub const fn cycles(&self) -> u64 {
        self.state.cycle
    }

    /// Those of the last frame: see [`Self::begin_frame`].
    #[must_use]
    pub const fn frame_cycles(&self) -> u32 {
        self.state.frame_cycles
    }

    /// What counted in no pixel.
    #[must_use]
    pub const fn losses(&self) -> &ArrayLosses {
        &self.state.losses
    }

    /// What the pixels have done so far, and what the blocks have, with the photons of exposures that have not ended. Events
    /// are those that were taken.
    #[must_use]
    pub fn statistics(&self) -> [Statistics; 2] {
        let (mut pixels, mut blocks) = (self.state.statistics, self.state.block_statistics);
        for place in self.pixels.iter().take(self.state.pixels_in_use) {
            place.pixel.add_photons_to(&mut pixels);
        }
        for block in self.blocks.iter().take(self.state.blocks_in_use) {
            block.pixel().add_photons_to(&mut blocks);
        }
        [pixels.events, blocks.events] = self.state.taken;
        [pixels, blocks]
    }
}
