//! Dynamic depth: events of changes of depth only.
//!
//! A pixel that looks at a wall reports the wall again and again. Dynamic depth
//! (section III-E of the paper) reports only when the mean depth of the last events has
//! moved by more than a threshold: by how much and in which direction, as an event camera
//! does with brightness. The paper compares the three-event means of two adjacent events
//! and takes 0.1 m: see [`Reference::Previous`].
//!
//! - A jump moves the mean of `N` events in `N` steps. [`Reference::Previous`] therefore
//!   misses jumps of up to `N` times the threshold, and slow motion.
//!   [`Reference::Reported`] sees both.
//! - While the mean moves, positions are reported where no surface needs to be.
//! - A false alarm moves the mean twice: when it enters it and when it leaves.
//! - The mean ignores time: an event after a long pause is averaged with those before it.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
//! use dtof_core::{BinIndex, BlockLevel, Count, DepthEvent, EchoNumber, Flags, LaserCycle, PixelAddress, RangeScale, SubBinOffset};
//! use dtof_core::events::{DynamicDepthConfig, DynamicDepthPixel, Polarity, Reference};
//!
//! let scale = RangeScale::new(const { U16F16::lit("250") }, I24F8::ZERO)?; // 37.5 mm a bin
//! let config = DynamicDepthConfig::new(U24F8::from_num(100), &scale, Reference::Previous)?;
//! let mut pixel = DynamicDepthPixel::<3>::new();
//! let mut event = |cycle, bin| DepthEvent {
//!     pixel: PixelAddress::new(0), level: BlockLevel::PIXEL, echo: EchoNumber::FIRST,
//!     cycle: LaserCycle::new(cycle), exposure: 44,
//!     peak_bin: BinIndex::saturating(bin), offset: SubBinOffset::CENTRE,
//!     peak_count: Count::saturating(20), background: Count::saturating(2), flags: Flags::NONE,
//! };
//! // Three for the first mean, and two more in the same place.
//! for cycle in 0..5 {
//!     assert_eq!(pixel.observe(&config, &event(cycle, 40)), None);
//! }
//! // A target 12 bins nearer moves the mean of three by 4.
//! let change = pixel.observe(&config, &event(5, 28)).unwrap();
//! assert_eq!((change.polarity(), change.change()), (Polarity::Nearer, -4 * 256));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use fixed::types::U24F8;

use super::running_mean::RunningMean;
use crate::check::impl_error;
use crate::depth::RangeScale;
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::pixel::PixelData;
use crate::units::{BinPosition, BlockLevel, LaserCycle, PixelAddress};

/// The mean that a mean depth is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reference {
    /// The mean at the event before, as in the paper. Sees jumps of more than `N` times the
    /// threshold.
    #[default]
    Previous,
    /// The mean that was reported last; before the first report, the first mean. Sees slow
    /// motion, too, in steps of the threshold.
    Reported,
}

/// The settings of dynamic depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DynamicDepthConfig {
    /// In 1/256 bins; not 0.
    threshold: u32,
    reference: Reference,
}

/// The threshold is less than half of 1/256 bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ZeroThresholdError;

impl ZeroThresholdError {
    /// The error in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        "the threshold of dynamic depth is less than 1/512 bin"
    }
}

impl_error!(ZeroThresholdError);

impl DynamicDepthConfig {
    /// Reports a mean depth more than `threshold` millimetres from `reference`. The threshold
    /// is rounded to the nearest 1/256 bin of `scale`.
    ///
    /// # Errors
    /// Fails if the rounded threshold is 0.
    #[allow(clippy::cast_possible_truncation, reason = "limited to 20 bits")]
    pub const fn new(
        threshold: U24F8,
        scale: &RangeScale,
        reference: Reference,
    ) -> Result<Self, ZeroThresholdError> {
        // No two positions are farther apart.
        const MOST: u64 = 1 << 20;
        let threshold = scale.bins_of(threshold);
        if threshold == 0 {
            return Err(ZeroThresholdError);
        }
        let threshold = if threshold < MOST { threshold } else { MOST };
        Ok(Self {
            threshold: threshold as u32,
            reference,
        })
    }

    /// The threshold in 1/256 bins.
    #[must_use]
    pub const fn threshold(&self) -> u32 {
        self.threshold
    }

    /// The mean to compare with.
    #[must_use]
    pub const fn reference(&self) -> Reference {
        self.reference
    }
}

/// The direction of a change of depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polarity {
    /// The depth has decreased: the paper's negative event.
    Nearer,
    /// The depth has increased: the paper's positive event.
    Farther,
}

/// The mean depth of a pixel has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DynamicDepthEvent {
    /// The macropixel; for a block its first.
    pub pixel: PixelAddress,
    /// Whether this is one pixel, or a block.
    pub level: BlockLevel,
    /// The laser cycle of the depth event that moved the mean.
    pub cycle: LaserCycle,
    /// The mean of the last events, to the nearest 1/256 bin.
    pub position: BinPosition,
    /// The flags of these events, and of the one that has left the mean.
    pub flags: Flags,
    change: i32,
}

impl DynamicDepthEvent {
    /// The farthest two positions can be from each other, in 1/256 bins.
    const MOST: i32 = BinPosition::MAX.raw() - BinPosition::MIN.raw();

    /// `change` is the change of the mean, in 1/256 bins. `None` if it is 0 or more than the
    /// largest distance of two positions.
    #[inline]
    #[must_use]
    pub const fn new(
        pixel: PixelAddress,
        level: BlockLevel,
        cycle: LaserCycle,
        position: BinPosition,
        change: i32,
        flags: Flags,
    ) -> Option<Self> {
        if change == 0 || change < -Self::MOST || Self::MOST < change {
            return None;
        }
        Some(Self {
            pixel,
            level,
            cycle,
            position,
            flags,
            change,
        })
    }

    /// How far the mean has moved, in 1/256 bins; not 0. Rounded towards 0.
    #[inline]
    #[must_use]
    pub const fn change(&self) -> i32 {
        self.change
    }

    /// The direction of the change.
    #[inline]
    #[must_use]
    pub const fn polarity(&self) -> Polarity {
        if self.change < 0 {
            Polarity::Nearer
        } else {
            Polarity::Farther
        }
    }
}

/// The last `N` depths of one pixel, and what they are compared with. `N` is 3 in the
/// paper; takes `5·N + 8` bytes, rounded up to whole words (asserted in
/// `core/tests/events/dynamic_depth.rs`).
#[derive(Clone, Debug)]
pub struct DynamicDepthPixel<const N: usize> {
    recent: RunningMean<N>,
    /// `N` times a mean, in 1/256 bins; 0 until `recent` is full.
    reference: i32,
    /// The flags of the same events, the newest first.
    flags: [Flags; N],
}

impl<const N: usize> PixelData for DynamicDepthPixel<N> {}

impl<const N: usize> Default for DynamicDepthPixel<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> DynamicDepthPixel<N> {
    /// Before any event.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            recent: RunningMean::new(),
            reference: 0,
            flags: [Flags::NONE; N],
        }
    }

    /// Adds a depth event of this pixel. Returns an event if the mean depth has changed. The
    /// first `N` events only make the first mean.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "N is less than 256, and the threshold has 20 bits"
    )]
    pub fn observe(
        &mut self,
        config: &DynamicDepthConfig,
        event: &DepthEvent,
    ) -> Option<DynamicDepthEvent> {
        // Each moves on by one; the last one, which leaves, is included once more.
        let mut flags = event.flags;
        let mut moving = event.flags;
        for place in &mut self.flags {
            flags |= *place;
            moving = core::mem::replace(place, moving);
        }
        let is_first = !self.recent.is_full();
        self.recent.push(event.position());
        // N times as much as the mean, so that nothing is rounded: at most 28 bits.
        let sum = self.recent.sum();
        if is_first {
            self.reference = sum;
            return None;
        }
        let moved = sum - self.reference;
        let changed = moved.unsigned_abs() > config.threshold * N as u32;
        if changed || config.reference == Reference::Previous {
            self.reference = sum;
        }
        if !changed {
            return None;
        }
        DynamicDepthEvent::new(
            event.pixel,
            event.level,
            event.cycle,
            self.recent.mean()?,
            moved / N as i32,
            flags,
        )
    }

    /// The running mean.
    #[must_use]
    pub const fn recent(&self) -> &RunningMean<N> {
        &self.recent
    }
}
