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
//! | promising | its window with the most photons has at least two and exceeds the background by 2.5 standard deviations |
//! | which neighbours | all but those more than twice as bright as the pixel in the window, or in all windows in a row that have as many of its photons; with fewer than two photons there a neighbour is not too bright |
//! | confirmed | a neighbour has photons in the window, all pixels together have the minimum there, and exceed `z₂` |
//!
//! `z₁` and `z₂` each have half of the false alarms of the rule's `z`. For `z₁` that is twice as many
//! trials. The sum contains the photons that made the pixel promising, so `z₂` depends on their share. With
//! `r² = T₁/T`, the share of the pixel's own photons, both excesses are normally distributed
//! with the correlation `r`, and
//!
//! ```text
//! P(z₁ > 2.5 and z > z₂) = ∫ φ(x) Q((z₂ - r·x) / √(1 - r²)) dx   from 2.5 on
//! ```
//!
//! is one in so many trials. With a share of more than half the neighbours hardly say anything, and `z₂` is `z₁`; so it is
//! where `z₁` exceeds [`HIGHEST_Z`](crate::rule::HIGHEST_Z), the end of the table.
//! Only one window is tried in a look, so that confirmed false alarms are fewer than their half:
//! `core/src/tests/neighbours/false_alarms.rs` has the rates.
//!
//! Bins that the pixel has left out, because their echo was reported, count in no neighbour. A neighbour that has left
//! out bins at the window is not asked.
//!
//! Brightness is photons above the background a laser cycle. Brighter neighbours are left out because of surfaces that end.
//! Their pixels would confirm any chance peak beside them. To leave out those with many photons only lowers the sum, so that `z₂` holds.
//! `core/src/tests/neighbours/false_alarms.rs` has the false alarms there, and those of a single pixel whose
//! neighbours all see a surface.
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

/// What a pixel has counted, and for how long.
#[derive(Clone, Copy)]
pub(crate) struct Exposed<'a, const BINS: usize, W: CounterWidth> {
    pub histogram: &'a Histogram<BINS, W>,
    pub excluded: &'a ExcludedBins,
    pub cycles: u16,
}

/// Photons above the background a laser cycle, as a fraction.
#[derive(Clone, Copy)]
struct Brightness {
    /// Times the number of bins.
    above: u32,
    /// Laser cycles times the number of bins.
    cycles: u32,
}

impl Brightness {
    /// Of `inside` photons in `width` of `bins` bins, which have `total` photons.
    #[inline(always)]
    fn new(inside: u32, width: u32, total: u32, bins: u32, cycles: u16) -> Self {
        // 30 bits, of counters of 16. Those of 24 saturate at counts that no exposure has.
        let inside = bins.saturating_mul(inside);
        Self {
            above: inside.saturating_sub(width.saturating_mul(total)),
            cycles: u32::from(cycles) * bins,
        }
    }

    /// Whether it is more than twice another one.
    #[inline(always)]
    fn exceeds_twice(self, other: Self) -> bool {
        // At most 32 + 26 bits, and one more for twice.
        let this = u64::from(self.above) * u64::from(other.cycles);
        let twice = 2 * u64::from(other.above) * u64::from(self.cycles);
        this > twice
    }
}

const SHARES: usize = 8;
const MOST_NEIGHBOURS: usize = 8;
/// A pixel and its neighbours.
#[allow(clippy::cast_possible_truncation, reason = "a small number")]
const PIXELS: u32 = 1 + MOST_NEIGHBOURS as u32;
/// 2.5 standard deviations, in 1/4096.
const PROMISING: u16 = 5 << 11;
/// Of fewer photons a neighbour's brightness is not known.
const FEWEST: u32 = 2;
/// If the highest bin has at most so many photons, it often has them by chance, and all windows are looked
/// at; otherwise those that contain it.
const FEW: u32 = 2;
/// The bins to either side of a peak that its depth may need.
const BESIDE: u16 = 6;

/// z₂ in 1/4096, at least 2, for 2⁶, 2⁸, … trials and own shares of 1/16 to 8/16.
const Z: [[u16; SHARES]; 15] = [
    [8192, 8192, 8192, 8192, 8192, 8192, 8192, 8192],
    [8192, 8192, 8192, 8192, 8192, 8192, 8192, 8192],
    [8192, 8192, 8757, 9400, 9946, 10420, 10839, 11210],
    [9887, 10872, 11572, 12121, 12570, 12946, 13262, 13529],
    [12172, 13089, 13721, 14201, 14580, 14885, 15130, 15324],
    [14082, 14944, 15520, 15944, 16267, 16516, 16706, 16848],
    [15752, 16566, 17095, 17471, 17748, 17952, 18100, 18202],
    [17253, 18025, 18512, 18848, 19085, 19252, 19365, 19437],
    [18627, 19361, 19810, 20110, 20313, 20449, 20535, 20585],
    [19901, 20599, 21015, 21283, 21457, 21567, 21632, 21666],
    [21093, 21759, 22144, 22383, 22532, 22620, 22668, 22691],
    [22218, 22854, 23210, 23424, 23551, 23621, 23656, 23671],
    [23285, 23893, 24223, 24414, 24521, 24577, 24602, 24611],
    [24302, 24883, 25190, 25360, 25450, 25494, 25512, 25518],
    [25276, 25832, 26116, 26267, 26343, 26377, 26390, 26394],
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
        own: Exposed<'a, BINS, W>,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        neighbours: impl Iterator<Item = Exposed<'a, BINS, W>>,
    ) -> Option<Detection> {
        let promising = self.promising(own.histogram, gate, own.excluded)?;
        self.sum_up(own, promising, gate, estimator, neighbours)
    }

    /// The sum of a promising window.
    #[inline(never)]
    fn sum_up<'a, const BINS: usize, W: CounterWidth + 'a>(
        &self,
        own: Exposed<'a, BINS, W>,
        Promising {
            first,
            photons: promising,
            bins: own_bins,
        }: Promising,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        neighbours: impl Iterator<Item = Exposed<'a, BINS, W>>,
    ) -> Option<Detection> {
        let Exposed {
            histogram,
            excluded,
            cycles,
        } = own;
        let width = u16::from(self.own.width());
        // With few photons, several windows in a row often have as many. The neighbours choose.
        let mut end = first + width;
        let mut same = promising;
        let counts = histogram.counts().get(first.into()..=gate.last().into());
        let (counts, entering) = (counts.unwrap_or_default(), usize::from(width));
        let pairs = counts
            .iter()
            .zip(counts.get(entering..).unwrap_or_default());
        for (&leaving, &entering) in pairs.take(entering - 1) {
            same = same
                .wrapping_add(entering.into())
                .wrapping_sub(leaving.into());
            if same != promising {
                break;
            }
            end += 1;
        }
        let windows = Windows {
            bins: first..end,
            excluded,
        };
        let mut asked = [None::<&Histogram<BINS, W>>; MOST_NEIGHBOURS];
        let mut places = asked.iter_mut();
        let own_total = histogram.total();
        let (mut total, mut bins) = (own_total, own_bins);
        let mut in_windows = windows.photons(histogram);
        let wide = windows.left();
        let own_brightness = Brightness::new(in_windows, wide, own_total, own_bins, cycles);
        let reach = estimator.reach();
        for other in neighbours {
            // Those that have left out bins here, because their echo was reported, do not know.
            let left_out = other.excluded;
            if left_out.echoes() > 0 && (first..end).any(|bin| left_out.touches(bin, reach)) {
                continue;
            }
            let Some((photons, left)) = counted(other.histogram, left_out, gate, excluded) else {
                continue;
            };
            let inside = windows.photons(other.histogram);
            let brightness = Brightness::new(inside, wide, photons, left, other.cycles);
            if inside >= FEWEST && brightness.exceeds_twice(own_brightness) {
                continue;
            }
            let Some(place) = places.next() else {
                break;
            };
            *place = Some(other.histogram);
            total = total.saturating_add(photons);
            in_windows = in_windows.saturating_add(inside);
            // The fewest bins expect the most photons.
            bins = bins.min(left);
        }
        let (z, wide) = (self.z(own_total, total).to_bits(), self.own.width());
        // Most looks end here: no window has more photons than all of them, or than full counters.
        let full = W::MAX.saturating_mul(PIXELS).saturating_mul(wide.into());
        if !exceeds::<W>(in_windows.min(full), total, wide, bins, z) {
            return None;
        }
        let all = asked.into_iter().flatten().chain([histogram]);
        let (mut start, mut photons) = (first, promising);
        for place in first..=end - width {
            let window = Windows {
                bins: place..place + width,
                excluded,
            };
            let counts = all.clone().map(|one| window.photons(one));
            let sum = counts.fold(0u32, u32::saturating_add);
            if sum > photons {
                (start, photons) = (place, sum);
            }
        }
        if photons == promising
            || photons < self.own.minimum_count().raw()
            || !exceeds::<W>(photons, total, wide, bins, z)
        {
            return None;
        }
        let end = start + width;
        let near =
            start.saturating_sub(BESIDE).max(gate.first())..(end + BESIDE).min(gate.last() + 1);
        let mut sum = Histogram::<BINS, Count16>::new();
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

/// The bins of windows in a row.
struct Windows<'a> {
    bins: Range<u16>,
    excluded: &'a ExcludedBins,
}

impl Windows<'_> {
    /// The number of bins that are not excluded.
    #[inline(always)]
    fn left(&self) -> u32 {
        if self.excluded.echoes() == 0 {
            return u32::from(self.bins.end - self.bins.start);
        }
        let is_left = |bin| u32::from(!self.excluded.contains(bin));
        self.bins.clone().map(is_left).sum()
    }

    /// The photons of a histogram in these bins.
    #[inline(always)]
    fn photons<const BINS: usize, W: CounterWidth>(&self, histogram: &Histogram<BINS, W>) -> u32 {
        let bins = usize::from(self.bins.start)..usize::from(self.bins.end);
        let counts = histogram.counts().get(bins).unwrap_or_default();
        let counts = counts.iter().map(|&count| -> u32 { count.into() });
        // At most 13 bins of counters of 24 bits.
        if self.excluded.echoes() == 0 {
            return counts.fold(0, u32::wrapping_add);
        }
        let is_left = |&(bin, _): &(u16, u32)| !self.excluded.contains(bin);
        let counts = self.bins.clone().zip(counts).filter(is_left);
        counts.fold(0, |sum, (_, count)| sum.wrapping_add(count))
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
