//! Laser pulses at random times, against other LiDARs.
//!
//! The pulses of another LiDAR come at the same place in every laser cycle if its clock is nearly the same,
//! and look like a target. With dither each laser cycle has a random length. The photons of the other's pulses
//! then wander over the histogram, while those of the own pulses stay, because a TDC code counts from the own
//! pulse on.
//!
//! A laser cycle of a mean of `P` bins takes `P - S/2 + s`, where `s` is uniform from 0 to `S`, the range.
//! The place of the other's pulse is a random walk: after `n` laser cycles, up to 512, it has moved by about
//! `S · √(n / 12)` bins. A random place *around a fixed beat*, `s` bins after every `P`-th, would keep the pulse
//! within `S` bins for ever.
//!
//! The lengths repeat after [`Dither::LENGTHS`] laser cycles. The second half of them is the first with the
//! signs of its deviations changed, so that the mean length is exactly `P`. So the walk comes back to where it
//! began. If both clocks are exactly equal, it takes the same way again and again, and in long exposures the other's
//! photons make a fixed pattern. A difference between the clocks moves the pattern on: 20 ppm of 1,250 bins are
//! 25 bins each time.
//!
//! ```
//! use dtof_sensors::dither::Dither;
//!
//! let dither = Dither::new(128, 7)?;
//! let mut added = dither.added();
//! let sum: u32 = added.by_ref().take(1024).map(u32::from).sum();
//! assert_eq!(sum, 1024 * 64); // a mean of half the range
//! assert!(added.take(1024).all(|bins| bins <= 128));
//! # Ok::<(), dtof_sensors::dither::DitherError>(())
//! ```

use core::fmt;

use rand_core::Rng;
use rand_pcg::Pcg32;

/// The stream of random numbers, as `docs/link-format.md` says.
const STREAM: u64 = 0x6469_7468;

/// The random lengths of laser cycles. Off by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dither {
    range: u8,
    seed: u64,
}

/// The range of a dither is odd, or more than 254 bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct DitherError;

impl fmt::Display for DitherError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the range of the dither must be an even number of bins, at most 254")
    }
}

impl core::error::Error for DitherError {}

impl Dither {
    /// Laser cycles after which their lengths repeat.
    pub const LENGTHS: usize = 1024;

    /// Laser cycles of one length.
    pub const OFF: Self = Self { range: 0, seed: 0 };

    /// The largest range, in bins.
    pub const MOST: u8 = 254;

    /// Each laser cycle is up to `range / 2` bins longer or shorter than the mean. One seed gives one sequence
    /// of lengths. A range of 0 is no dither.
    ///
    /// # Errors
    /// Returns [`DitherError`] if `range` is odd, or more than [`Self::MOST`].
    #[allow(clippy::cast_possible_truncation, reason = "at most 254")]
    pub const fn new(range: u16, seed: u64) -> Result<Self, DitherError> {
        if range > Self::MOST as u16 || !range.is_multiple_of(2) {
            return Err(DitherError);
        }
        let range = range as u8;
        Ok(Self { range, seed })
    }

    /// By how many bins the longest laser cycle is longer than the shortest.
    #[must_use]
    pub const fn range(self) -> u16 {
        self.range as u16
    }

    /// The seed.
    #[must_use]
    pub const fn seed(self) -> u64 {
        self.seed
    }

    /// The bins, 0 to [`Self::range`], by which each laser cycle is longer than the shortest: an endless
    /// sequence from laser cycle 0 on.
    #[must_use]
    pub const fn added(self) -> Added {
        Added {
            dither: self,
            random: None,
            cycle: 0,
        }
    }
}

/// [`Dither::added`].
#[derive(Clone, Debug)]
pub struct Added {
    dither: Dither,
    random: Option<Pcg32>,
    /// Modulo [`Dither::LENGTHS`].
    cycle: usize,
}

impl Iterator for Added {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        const HALF: usize = Dither::LENGTHS / 2;
        let Dither { range, seed } = self.dither;
        if self.cycle.is_multiple_of(HALF) {
            self.random = None;
        }
        let random = self.random.get_or_insert_with(|| Pcg32::new(seed, STREAM));
        let product = u64::from(random.next_u32()) * (u64::from(range) + 1);
        #[allow(clippy::cast_possible_truncation, reason = "at most the range")]
        let bins = (product >> 32) as u8;
        let is_mirrored = self.cycle >= HALF;
        self.cycle = (self.cycle + 1) % Dither::LENGTHS;
        Some(if is_mirrored { range - bins } else { bins })
    }
}
