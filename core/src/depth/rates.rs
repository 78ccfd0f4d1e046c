//! The light of the bins about a peak, of a TDC with a dead time.
//!
//! A bin that was live in `l` laser cycles and had a photon in `c` of them has the light
//! `-ln(1 - c/l)` a laser cycle. This corrects both what earlier photons hid and what a photon
//! hides in its own bin.
//!
//! The logarithm is exact to 1 in 40,000: `l/(l - c)` is halved until it is below 2, and
//! `ln(x) = 2·(y + y³/3 + y⁵/5 + y⁷/7)` with `y = (x - 1)/(x + 1)` does the rest. A bin with a photon in
//! each laser cycle counts as half a cycle short of that.
//!
//! An estimator needs ratios only, so the highest of the bins becomes 1023.

use super::centroid::offset_of;
use super::estimate::DepthEstimate;
use crate::flags::Flags;
use crate::histogram::counter::{Count10, CounterWidth};
use crate::histogram::gate::RangeGate;
use crate::units::BinIndex;

/// Bins that a window can reach, from [`PEAK`] before the peak bin on: an offset of -2
/// to 2 bins, and 4 more on each side.
pub(super) const REACH: usize = 2 * PEAK;
/// The index of the peak bin among them.
pub(super) const PEAK: usize = 6;

/// The light of the bins that a window can reach.
pub(crate) struct Rates {
    /// Bins from [`PEAK`] before the peak bin on, relative to the highest, which is 1023.
    pub(super) bins: [u16; REACH],
    /// That of the background, in the same unit.
    pub(super) background: u16,
}

/// The counts of a bin, or of several together: photons and live laser cycles.
#[derive(Clone, Copy, Default)]
pub(crate) struct Counted {
    pub(crate) photons: u64,
    pub(crate) live: u64,
}

impl Rates {
    /// `counted` gives the counts of a bin, or `None` where they are unknown: such a bin has the
    /// light of the `background`.
    pub(crate) fn about(
        peak: BinIndex,
        background: Counted,
        mut counted: impl FnMut(u16) -> Option<Counted>,
    ) -> Self {
        let background = background.light();
        let mut light = [background; REACH];
        let first = usize::from(peak.raw()).wrapping_sub(PEAK);
        for (number, light) in light.iter_mut().enumerate() {
            // A bin before bin 0 wraps, and is not counted.
            let bin = u16::try_from(first.wrapping_add(number)).ok();
            if let Some(counted) = bin.and_then(&mut counted) {
                *light = counted.light();
            }
        }
        Self::relative(&light, background)
    }

    /// Relative to the highest bin. The same for all counters.
    #[inline(never)]
    fn relative(light: &[u64; REACH], background: u64) -> Self {
        let highest = light
            .iter()
            .fold(1, |highest: u64, &light| highest.max(light));
        #[allow(clippy::cast_possible_truncation, reason = "at most 1023")]
        let relative = |light: u64| {
            // 45 + 10 bits.
            let relative = (light * u64::from(Count10::MAX) + highest / 2) / highest;
            relative as u16
        };
        let mut bins = [0; REACH];
        for (bin, &light) in bins.iter_mut().zip(light) {
            *bin = relative(light);
        }
        Self {
            bins,
            background: relative(background),
        }
    }

    /// The centroid of the bin `peak` and its neighbours, minus the background. A neighbour outside
    /// the gate counts as empty.
    pub(super) fn centroid<const BINS: usize>(
        &self,
        gate: &RangeGate<BINS>,
        peak: BinIndex,
    ) -> DepthEstimate {
        let [.., left, centre, right] = self
            .bins
            .first_chunk::<{ PEAK + 2 }>()
            .copied()
            .unwrap_or_default();
        let has_left = gate.contains(peak.raw().wrapping_sub(1));
        let has_right = gate.contains(peak.raw() + 1);
        let above = |light: u16| u32::from(light.saturating_sub(self.background));
        let neighbour = |is_gated, light| if is_gated { above(light) } else { 0 };
        let flags = if has_left && has_right {
            Flags::NONE
        } else {
            Flags::CLIPPED
        };
        DepthEstimate {
            offset: offset_of(
                neighbour(has_left, left),
                above(centre),
                neighbour(has_right, right),
            ),
            flags,
        }
    }
}

impl Counted {
    /// The light a laser cycle in 1/2⁴⁰: up to 2⁴⁵.
    #[inline(never)]
    pub(crate) fn light(self) -> u64 {
        // In half cycles, so that the rest is at least 1.
        let whole = 2 * self.live.max(1);
        let mut rest = whole.saturating_sub(2 * self.photons).max(1);
        let mut halvings = 0;
        while 2 * rest <= whole {
            rest *= 2;
            halvings += 1;
        }
        // At most 39 bits, which become 63, so that the quotient has 22 or more however dim the light is.
        let above = whole - rest;
        let bits = (above | 1).leading_zeros() - 1;
        let quotient = (above << bits).checked_div(whole + rest).unwrap_or(0);
        // At most 1/3.
        let y = match bits.checked_sub(LIGHT_BITS) {
            Some(less) => quotient >> less,
            None => quotient << (LIGHT_BITS - bits),
        };
        let square = ((y >> 16) * (y >> 16)) >> 24;
        let third = (y * square) >> 24;
        let fifth = (third * square) >> 24;
        let seventh = (fifth * square) >> 24;
        halvings * LN_2 + 2 * (y + third / 3 + fifth / 5 + seventh / 7)
    }
}

/// Bits after the point of light.
const LIGHT_BITS: u32 = 40;
/// In 1/2⁴⁰.
const LN_2: u64 = 762_123_384_786;

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "a test")]
mod tests {
    use super::{Counted, PEAK, REACH, Rates};
    use crate::flags::Flags;
    use crate::histogram::gate::RangeGate;
    use crate::units::BinIndex;

    #[test]
    fn the_highest_bin_becomes_1023_and_the_others_are_rounded() {
        for highest in [1, 2, 5, 1023, 1024, 1 << 24, 1 << 30, 1 << 45] {
            for part in 0..=64 {
                let mut light = [0; REACH];
                light[3] = highest;
                light[8] = highest / 64 * part;
                let found = Rates::relative(&light, light[8] / 2);
                let rounded = |light: u64| {
                    let twice = light * 2 * 1023 / highest;
                    u16::try_from(twice.div_ceil(2)).unwrap()
                };
                assert_eq!(found.bins[3], 1023);
                assert_eq!(found.bins[8], rounded(light[8]));
                assert_eq!(found.background, rounded(light[8] / 2));
                assert_eq!(found.bins[0], 0);
            }
        }
        // Nothing anywhere.
        assert_eq!(Rates::relative(&[0; REACH], 0).bins, [0; REACH]);
    }

    /// In 1/256 bin, within half of that.
    #[test]
    fn the_centroid_is_that_of_three_bins_above_the_background_within_the_gate() {
        const PLACE: u16 = 10;
        for (first, last, has_left, has_right) in [
            (0, 31, true, true),
            (PLACE - 1, 31, true, true),
            (0, PLACE + 1, true, true),
            (PLACE, 31, false, true),
            (0, PLACE, true, false),
        ] {
            let gate = RangeGate::<32>::new(first, last).unwrap();
            for left in [0, 30, 200, 900] {
                for right in [0, 31, 250, 1000] {
                    for background in [0, 30, 120] {
                        let mut bins = [77; REACH];
                        bins[PEAK - 1..=PEAK + 1].copy_from_slice(&[left, 1023, right]);
                        let found = Rates { bins, background }
                            .centroid(&gate, BinIndex::new(PLACE).unwrap());
                        let above = |light: u16| i32::from(light.saturating_sub(background));
                        let left = if has_left { above(left) } else { 0 };
                        let right = if has_right { above(right) } else { 0 };
                        let sum = left + above(1023) + right;
                        let off =
                            (i32::from(found.offset.raw()) - 128) * sum - 256 * (right - left);
                        assert!(2 * off.abs() <= sum, "{left} {right} {background}");
                        let clipped =
                            [Flags::CLIPPED, Flags::NONE][usize::from(has_left && has_right)];
                        assert_eq!(found.flags, clipped);
                    }
                }
            }
        }
    }

    /// Few photons, many, all, and more than there were laser cycles.
    #[test]
    #[allow(
        clippy::float_arithmetic,
        clippy::disallowed_types,
        reason = "the formula"
    )]
    fn light_is_the_logarithm() {
        let mut live: u64 = 1;
        while live < 1 << 38 {
            for photons in [
                0,
                1,
                live / 1000,
                live / 10,
                live / 2,
                live - live / 100,
                live,
                2 * live,
            ] {
                let rest = (live as f64 - photons as f64).max(0.5);
                let light = libm::log(live as f64 / rest);
                let unit = 1.0 / (1u64 << 40) as f64;
                let found = Counted { photons, live }.light() as f64 * unit;
                // Rounded down ten times.
                let most = light / 40_000.0 + 10.0 * unit;
                assert!(
                    (found - light).abs() <= most,
                    "{photons} of {live}: {found}, {light}"
                );
            }
            live = live * 3 / 2 + 1;
        }
    }
}
