//! Dynamic depth: only changes of depth are reported.
//!
//! A pixel that looks at a wall reports the wall again and again. Dynamic depth
//! (section III-E of the paper) keeps quiet until the mean depth of the last events has
//! moved by more than a threshold, and then reports by how much and to which side, as
//! an event camera does with brightness. The paper compares the three-event means of
//! two adjacent events and takes 0.1 m: see [`Reference::Previous`]. A jump moves the
//! mean of `N` events by an `N`th of it at each of `N` events, so that one of up to `N`
//! times the threshold is not seen so, nor is slow motion; [`Reference::Reported`] sees
//! what is more than the threshold. What is reported on the way of the mean are places
//! where nothing need stand. A false alarm moves the mean twice, when it comes and when it
//! leaves. Means know no time: an event after a long pause is averaged with those before it.
//!
//! ```
//! use dtof_core::fixed::types::{I24F8, U16F16, U24F8};
//! use dtof_core::{
//!     BinIndex, BlockLevel, Count, DepthEvent, DynamicDepthConfig, DynamicDepthPixel, EchoNumber,
//!     Flags, LaserCycle, PixelAddress, Polarity, RangeScale, Reference, SubBinOffset,
//! };
//!
//! let scale = RangeScale::new(const { U16F16::lit("250") }, I24F8::ZERO)?; // 37.5 mm a bin
//! let config = DynamicDepthConfig::new(U24F8::from_num(100), &scale, Reference::Previous)?;
//! let mut pixel = DynamicDepthPixel::<3>::new();
//! let mut event = |cycle, bin| DepthEvent {
//!     pixel: PixelAddress(0), level: BlockLevel::PIXEL, echo: EchoNumber::FIRST,
//!     cycle: LaserCycle(cycle), exposure: 44,
//!     peak_bin: BinIndex::saturating(bin), offset: SubBinOffset::CENTRE,
//!     peak_count: Count::saturating(20), background: Count::saturating(2), flags: Flags::NONE,
//! };
//! // Three for the first mean, two more that say the same.
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
use crate::check::written_as_its_text;
use crate::depth::RangeScale;
use crate::event::DepthEvent;
use crate::flags::Flags;
use crate::units::{BinPosition, BlockLevel, LaserCycle, PixelAddress};

/// What a mean depth is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reference {
    /// The mean at the event before: the paper's. Sees jumps of more than `N` times the
    /// threshold.
    #[default]
    Previous,
    /// The mean that was reported last, at first the first mean. Sees slow motion, too,
    /// a threshold at a time.
    Reported,
}

/// How dynamic depth is found.
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
    /// What is wrong, in one line.
    #[must_use]
    pub const fn text(self) -> &'static str {
        "the threshold of dynamic depth is less than 1/512 bin"
    }
}

written_as_its_text!(ZeroThresholdError);

impl DynamicDepthConfig {
    /// A mean depth more than `threshold` millimetres from `reference` is reported.
    /// Rounded to the nearest 1/256 bin of `scale`.
    ///
    /// # Errors
    /// [`ZeroThresholdError`] if that is 0.
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

    /// What a mean is compared with.
    #[must_use]
    pub const fn reference(&self) -> Reference {
        self.reference
    }
}

/// To which side a depth has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polarity {
    /// The depth has become less: the paper's negative event.
    Nearer,
    /// The depth has become more: the paper's positive event.
    Farther,
}

/// The mean depth of a pixel has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DynamicDepthEvent {
    /// Which macropixel; of a block its first.
    pub pixel: PixelAddress,
    /// Whether it is one pixel, or a block.
    pub level: BlockLevel,
    /// The laser cycle of the depth event that moved the mean.
    pub cycle: LaserCycle,
    /// The mean of the last events, to the nearest 1/256 bin.
    pub position: BinPosition,
    /// What is to be said against any of these events, or the one that has left the mean.
    pub flags: Flags,
    change: i32,
}

impl DynamicDepthEvent {
    /// The farthest two positions can be from each other, in 1/256 bins.
    const MOST: i32 = BinPosition::MAX.raw() - BinPosition::MIN.raw();

    /// `change` is that of the mean, in 1/256 bins; `None` if it is 0 or more than two
    /// positions can be apart.
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

    /// To which side.
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
    /// `N` times a mean, in 1/256 bins; of nothing until `recent` is full.
    reference: i32,
    /// Of the same events, the newest first.
    flags: [Flags; N],
}

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

    /// Takes a depth event of this pixel in, and says whether the mean depth has
    /// changed. The first `N` events only make the first mean.
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
        // Each moves on by one; the last, which leaves, counts once more.
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
