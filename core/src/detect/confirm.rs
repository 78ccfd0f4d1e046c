//! Neighbouring pixels confirm a window that is promising, but not enough by itself.
//!
//! Most surfaces are larger than a pixel. So a pixel whose best window is only promising adds up the
//! same window of its neighbours. Let the pixels together have `T` photons, `S` of them in that window. Under a
//! flat background each photon lies in the window with the same probability, whatever the pixel and however long its
//! exposure. So `S` and `T` are compared as those of one pixel by the [`WindowRule`]: the neighbours'
//! backgrounds and exposures may differ.
//!
//! | step | condition |
//! |---|---|
//! | the pixel alone | a detection of the window rule with `z₁` |
//! | promising | its window with the most photons has at least two and exceeds the background by 2 standard deviations |
//! | confirmed | a neighbour has photons in the window, all pixels together have the minimum there, and exceed `z₂` |
//! | at an edge | the neighbours without the pixel do not exceed 3.5 standard deviations, or the pixel alone exceeds 3 |
//!
//! `z₁` and `z₂` each have half of the false alarms of the rule's `z`. For `z₁` that is twice as many
//! trials. The sum contains the photons that made the pixel promising, so `z₂` depends on their share. With
//! `r² = T₁/T`, the share of the pixel's own photons, both excesses are normally distributed
//! with the correlation `r`, and
//!
//! ```text
//! P(z₁ > 2 and z > z₂) = ∫ φ(x) Q((z₂ - r·x) / √(1 - r²)) dx   from 2 on
//! ```
//!
//! is one in so many trials. With a share of more than half the neighbours hardly say anything, and `z₂` is `z₁`; so it is
//! where `z₁` exceeds [`HIGHEST_Z`](crate::rule::HIGHEST_Z), the end of the table.
//! Only one window is tried in a look, so that confirmed false alarms are fewer than their half:
//! `core/tests/neighbours/false_alarms.rs` has the rates.
//!
//! Bins that the pixel has left out, because their echo was reported, count in no neighbour. A neighbour that has left
//! out bins at the window is not asked.
//!
//! The last condition is for pixels beside a surface that ends. Its pixels are sure, and would confirm any chance
//! peak at their place. With it a pixel beside a straight edge has up to 3 times the false alarms of the rule if its neighbours see up
//! to half a photon a laser cycle, and up to 6 times if they see two (`core/tests/neighbours/false_alarms.rs`).
//!
//! The depth is that of the photons of all these pixels. The peak count is that of the pixel's own photons in the window,
//! the background what is expected of them there.

use core::ops::{Range, RangeInclusive};

use fixed::types::U4F12;

use super::decision::{Detection, detection_at, rounded};
use super::window::{WindowRule, stands_clear};
use super::window_z::{HIGHEST_Z, ONE, trials_of, twice_the_trials};
use crate::depth::DepthEstimator;
use crate::flags::Flags;
use crate::histogram::counter::{Count16, CounterWidth};
use crate::histogram::excluded::ExcludedBins;
use crate::histogram::gate::RangeGate;
use crate::histogram::{Histogram, Peak, mean};
use crate::units::{BinIndex, Count};

/// The window rule for a pixel and its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NeighbourRule {
    own: WindowRule,
    /// z₂ in 1/4096, for own shares of the photons of 1/16, 2/16, … 8/16.
    z: [u16; SHARES],
}

/// The most photons in a window of a pixel.
struct Promising {
    /// Where the first of them begins.
    first: u16,
    photons: u32,
    /// Bins that are not excluded.
    bins: u32,
}

/// What a neighbour contributes.
pub(crate) type Neighbour<'a, const BINS: usize, W> = (&'a Histogram<BINS, W>, &'a ExcludedBins);

const SHARES: usize = 8;
const MOST_NEIGHBOURS: usize = 8;
/// 2 standard deviations, in 1/4096.
const PROMISING: u16 = 2 << 12;
/// The neighbours' excess at which they are sure without the pixel: 3.5 standard deviations.
const SURE: u16 = 7 << 11;
/// What the pixel then needs by itself: 3 standard deviations.
const BESIDE_SURE: u16 = 3 << 12;
/// If the highest bin has at most so many photons, it often has them by chance, and all windows are looked
/// at; otherwise those that contain it.
const FEW: u32 = 3;
/// The bins of as many windows in a row as have a bin in common, of the widest.
const MOST_BINS: usize = 2 * WindowRule::MAX_WIDTH as usize - 1;
/// The bins to either side of a peak that its depth may need.
const BESIDE: u16 = 6;

/// z₂ in 1/4096, at least 2, for 2⁶, 2⁸, … trials and own shares of 1/16 to 8/16.
const Z: [[u16; SHARES]; 15] = [
    [8192, 8192, 8192, 8192, 8192, 8192, 8192, 8192],
    [8192, 8192, 8192, 8283, 8731, 9119, 9460, 9760],
    [9270, 10075, 10642, 11081, 11436, 11728, 11971, 12172],
    [11589, 12329, 12830, 13203, 13492, 13718, 13896, 14032],
    [13519, 14206, 14654, 14975, 15213, 15390, 15519, 15611],
    [15204, 15846, 16249, 16527, 16723, 16861, 16955, 17016],
    [16716, 17318, 17683, 17924, 18086, 18193, 18261, 18300],
    [18099, 18665, 18996, 19206, 19339, 19422, 19470, 19494],
    [19381, 19914, 20214, 20397, 20507, 20570, 20603, 20618],
    [20579, 21083, 21356, 21514, 21604, 21652, 21675, 21684],
    [21710, 22185, 22434, 22571, 22645, 22680, 22696, 22701],
    [22782, 23232, 23458, 23577, 23636, 23663, 23673, 23676],
    [23803, 24230, 24436, 24538, 24586, 24606, 24612, 24614],
    [24782, 25185, 25373, 25461, 25500, 25514, 25518, 25519],
    [25721, 26104, 26274, 26350, 26381, 26391, 26394, 26394],
];

impl NeighbourRule {
    /// The rule for pixels and their neighbours that together have the false alarms of `rule`.
    #[must_use]
    pub fn new(rule: &WindowRule) -> Self {
        let own = rule.with_z(twice_the_trials(rule.z()));
        if own.z() > HIGHEST_Z {
            return Self {
                own,
                z: [own.z().to_bits(); SHARES],
            };
        }
        let above = trials_of(own.z()).saturating_sub(6 * ONE);
        let (index, part) = ((above >> 9) as usize, above & 511);
        let z = match Z.get(index..) {
            Some(&[low, high, ..]) => {
                let mut z = low;
                for (z, high) in z.iter_mut().zip(high) {
                    let rise = (u32::from(high - *z) * part) >> 9;
                    *z = z.saturating_add(u16::try_from(rise).unwrap_or(0));
                }
                z
            }
            _ => Z.last().copied().unwrap_or([u16::MAX; SHARES]),
        };
        Self { own, z }
    }

    /// The rule of a pixel's own decisions, for its configuration.
    #[must_use]
    pub const fn own(&self) -> &WindowRule {
        &self.own
    }

    /// z₂ if the pixel has `own` of `all` photons.
    #[must_use]
    pub fn z(&self, own: u32, all: u32) -> U4F12 {
        let (own, all) = (u64::from(own), u64::from(all));
        let is_share = |&(_, sixteenths): &(&u16, u64)| 16 * own <= sixteenths * all;
        let share = self.z.iter().zip(1..).find(is_share);
        share.map_or(self.own.z(), |(&z, _)| U4F12::from_bits(z))
    }

    /// The pixel's window with the most photons, if it is promising.
    #[inline(always)]
    fn promising<const BINS: usize, W: CounterWidth>(
        &self,
        histogram: &Histogram<BINS, W>,
        gate: &RangeGate<BINS>,
        excluded: &ExcludedBins,
    ) -> Option<Promising> {
        let peak = histogram.peak();
        if !gate.contains(peak.bin.raw()) {
            return None;
        }
        let width = self.own.width();
        let starts = if peak.count.raw() <= FEW {
            gate.first()..=gate.last() + 1 - u16::from(width)
        } else {
            self.own.starts_about(gate, peak.bin)
        };
        let (first, photons) = first_highest(histogram, starts, width);
        if photons < 2 {
            return None;
        }
        let bins = excluded.bins_left(gate)?;
        let is_promising = exceeds::<W>(photons, histogram.total(), width, bins, PROMISING);
        is_promising.then_some(Promising {
            first,
            photons,
            bins,
        })
    }

    /// The detection in a promising window that the neighbours confirm.
    #[inline(always)]
    pub(crate) fn confirm<'a, const BINS: usize, W: CounterWidth + 'a>(
        &self,
        own: Neighbour<'a, BINS, W>,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        neighbours: impl Iterator<Item = Neighbour<'a, BINS, W>>,
    ) -> Option<Detection> {
        let (histogram, excluded) = own;
        let promising = self.promising(histogram, gate, excluded)?;
        self.sum_up(own, promising, gate, estimator, neighbours)
    }

    /// The sum of a promising window.
    #[inline(never)]
    fn sum_up<'a, const BINS: usize, W: CounterWidth + 'a>(
        &self,
        own: Neighbour<'a, BINS, W>,
        Promising {
            first,
            photons: promising,
            bins: own_bins,
        }: Promising,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        neighbours: impl Iterator<Item = Neighbour<'a, BINS, W>>,
    ) -> Option<Detection> {
        let (histogram, excluded) = own;
        let width = u16::from(self.own.width());
        // With few photons, several windows in a row often have as many. The neighbours choose.
        let mut end = first + width;
        let mut same = promising;
        for leaving in first..first + width - 1 {
            let [leaving, entering] = [leaving, end].map(|bin| histogram.count(bin.into()));
            same = same
                .wrapping_add(entering.unwrap_or(0))
                .wrapping_sub(leaving.unwrap_or(0));
            if same != promising || end > gate.last() {
                break;
            }
            end += 1;
        }
        let mut asked = [None::<&Histogram<BINS, W>>; MOST_NEIGHBOURS];
        let mut places = asked.iter_mut();
        let (mut total, mut bins) = (histogram.total(), own_bins);
        let mut sums = [0u32; MOST_BINS];
        add_window(&mut sums, histogram, first..end);
        let reach = estimator.reach();
        for (other, left_out) in neighbours {
            // Those that have left out bins here, because their echo was reported, do not know.
            if left_out.echoes() > 0 && (first..end).any(|bin| left_out.touches(bin, reach)) {
                continue;
            }
            let Some((photons, left)) = counted(other, left_out, gate, excluded) else {
                continue;
            };
            let Some(place) = places.next() else {
                break;
            };
            *place = Some(other);
            total = total.saturating_add(photons);
            // The fewest bins expect the most photons.
            bins = bins.min(left);
            add_window(&mut sums, other, first..end);
        }
        if excluded.echoes() > 0 {
            for (bin, sum) in (first..end).zip(&mut sums) {
                if excluded.contains(bin) {
                    *sum = 0;
                }
            }
        }
        let (mut start, mut photons) = (first, promising);
        for place in first..=end - width {
            let from = usize::from(place - first);
            let window = sums.iter().skip(from).take(width.into());
            let sum = window.fold(0u32, |sum, &count| sum.saturating_add(count));
            if sum > photons {
                (start, photons) = (place, sum);
            }
        }
        if photons == promising || photons < self.own.minimum_count().raw() {
            return None;
        }
        let (own_total, wide) = (histogram.total(), self.own.width());
        let z = self.z(own_total, total).to_bits();
        let others = total.saturating_sub(own_total);
        let is_confirmed = exceeds::<W>(photons, total, wide, bins, z)
            && (!exceeds::<W>(photons - promising, others, wide, bins, SURE)
                || exceeds::<W>(promising, own_total, wide, own_bins, BESIDE_SURE));
        if !is_confirmed {
            return None;
        }
        let end = start + width;
        let near =
            start.saturating_sub(BESIDE).max(gate.first())..(end + BESIDE).min(gate.last() + 1);
        let mut sum = Histogram::<BINS, Count16>::new();
        let all = asked.into_iter().flatten().chain([histogram]);
        all.clone().for_each(|one| sum.add_bins(one, near.clone()));
        excluded.empty(&mut sum);
        sum.leave_out(sum.total().saturating_sub(total));
        let mut peak = Peak::default();
        for bin in start..end {
            let count = Count::saturating(sum.count(bin.into()).unwrap_or(0));
            if count > peak.count {
                peak = Peak {
                    bin: BinIndex::saturating(bin),
                    count,
                };
            }
        }
        let outside = mean(total.saturating_sub(photons), bins - u32::from(width))?;
        let mut detection = detection_at(&sum, gate, peak, outside, estimator, excluded);
        detection.depth.flags |= Flags::CONFIRMED;
        let is_full = |one: &Histogram<BINS, W>| one.count(peak.bin.raw().into()) == Some(W::MAX);
        if all.clone().any(is_full) {
            detection.depth.flags |= Flags::SATURATED;
        }
        // The pixel's own, of the window.
        detection.peak.count = Count::saturating(promising);
        let outside = histogram.total().saturating_sub(promising);
        let background = mean(
            outside.saturating_mul(width.into()),
            own_bins - u32::from(width),
        )?;
        detection.background = rounded(background);
        Some(detection)
    }
}

/// Where the first window with the most photons begins, of those that begin at `starts`, and its photons. Its
/// twin without the place, `highest_sum`, saves 20 to 130 instructions at each look.
#[inline(always)]
fn first_highest<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    starts: RangeInclusive<u16>,
    width: u8,
) -> (u16, u32) {
    let bins = usize::from(*starts.start())..usize::from(*starts.end()) + usize::from(width);
    let bins = histogram.counts().get(bins).unwrap_or_default();
    let (window, entering) = bins.split_at_checked(width.into()).unwrap_or_default();
    let mut sum = window
        .iter()
        .fold(0u32, |sum, &count| sum.wrapping_add(count.into()));
    let (mut first, mut highest) = (*starts.start(), sum);
    for ((&leaving, &entering), start) in bins.iter().zip(entering).zip(starts.skip(1)) {
        sum = sum
            .wrapping_add(entering.into())
            .wrapping_sub(leaving.into());
        if sum > highest {
            (first, highest) = (start, sum);
        }
    }
    (first, highest)
}

/// Adds some bins of a histogram to `sums`.
#[inline(always)]
fn add_window<const BINS: usize, W: CounterWidth>(
    sums: &mut [u32; MOST_BINS],
    histogram: &Histogram<BINS, W>,
    bins: Range<u16>,
) {
    let counts = histogram.counts().get(bins.start.into()..bins.end.into());
    for (sum, &count) in sums.iter_mut().zip(counts.unwrap_or_default()) {
        *sum = sum.saturating_add(count.into());
    }
}

/// The photons of a neighbour in the bins that neither it nor the pixel has `excluded`, and the
/// number of these bins; `None` if they are too few.
#[inline(always)]
fn counted<const BINS: usize, W: CounterWidth>(
    histogram: &Histogram<BINS, W>,
    left_out: &ExcludedBins,
    gate: &RangeGate<BINS>,
    excluded: &ExcludedBins,
) -> Option<(u32, u32)> {
    if excluded.echoes() == 0 {
        return Some((histogram.total(), left_out.bins_left(gate)?));
    }
    let is_left = |bin: &u16| !excluded.contains(*bin) && !left_out.contains(*bin);
    let (mut photons, mut bins) = (0u32, 0);
    for bin in (gate.first()..=gate.last()).filter(is_left) {
        photons = photons.saturating_add(histogram.count(bin.into()).unwrap_or(0));
        bins += 1;
    }
    (bins >= u32::from(RangeGate::<BINS>::MIN_BINS)).then_some((photons, bins))
}

/// [`stands_clear`] for the photons of up to nine pixels.
#[inline(never)]
fn exceeds<W: CounterWidth>(inside: u32, total: u32, width: u8, bins: u32, z: u16) -> bool {
    if W::BITS <= 10 {
        stands_clear::<true>(inside, total, width.into(), bins, z)
    } else {
        stands_clear::<false>(inside, total, width.into(), bins, z)
    }
}
