//! The range offset, and the bin width, from targets at known distances.
//!
//! The core places the highest peak of each histogram with the estimator that events will have, so that
//! the offset includes its bias. If many histograms have known distances, the bin width is the median of
//! the slopes of all pairs (Theil and Sen), which is robust against outliers.

use dtof_core::fixed::types::U24F8;
use dtof_core::{BinPosition, CentredWindow, Count16, DepthEstimator, Histogram, RangeGate};

use super::observed::Trace;
use super::significance::{median, quantile};
use dtof_data::photons::MM_PER_PS;
use dtof_engine::with_bins;

/// The most histograms that are fitted, evenly chosen.
const MOST: usize = 400;
/// A bin width is fitted if distances span so many bins.
const LEAST_BINS: f64 = 20.0;
/// Photons farther from a peak do not move it.
const NOISE_BINS: f64 = 8.0;
/// Positions on one flat target differ by at most so many bins.
const ONE_TARGET: f64 = 1.5;

/// The range offset, and the bin width if distances show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Millimetres to add to every range.
    pub mm: f64,
    /// Standard error of `mm`, in millimetres.
    pub error_mm: f64,
    /// Picoseconds a bin, if it was fitted.
    pub bin_width_ps: Option<f64>,
    /// Histograms it was found from.
    pub histograms: usize,
}

/// Fits pairs of position in bins and true distance in millimetres; `None` without pairs.
#[must_use]
pub fn from_distances(pairs: &[(f64, f64)], bin_width_ps: f64) -> Option<Offset> {
    let step = pairs.len().div_ceil(MOST).max(1);
    let pairs: Vec<(f64, f64)> = pairs.iter().copied().step_by(step).collect();
    let mut slopes = Vec::new();
    for (index, one) in pairs.iter().enumerate() {
        for other in &pairs[index + 1..] {
            let bins = other.0 - one.0;
            if bins.abs() > LEAST_BINS / 2.0 {
                slopes.push((other.1 - one.1) / bins);
            }
        }
    }
    let at = |share| quantile(pairs.iter().map(|pair| pair.0), share);
    let reaches = at(0.95) - at(0.05) >= LEAST_BINS && slopes.len() >= 3;
    let fitted = reaches.then(|| median(slopes) / MM_PER_PS);
    let mm_a_bin = fitted.unwrap_or(bin_width_ps) * MM_PER_PS;
    let offsets = || pairs.iter().map(|pair| pair.1 - mm_a_bin * pair.0);
    let mm = median(offsets());
    let off = median(offsets().map(|offset| (offset - mm).abs()));
    (!pairs.is_empty()).then(|| Offset {
        mm,
        // 1.4826 for a standard deviation, 1.25 for a median.
        error_mm: 1.85 * off / (pairs.len() as f64).sqrt(),
        bin_width_ps: fitted,
        histograms: pairs.len(),
    })
}

/// From one target at `distance_mm`. Only positions near the most common one are used, within 1.5 bins or else
/// within `reach_bins`; `None` if they are not more than half.
#[must_use]
pub fn from_target(
    positions: &[f64],
    distance_mm: f64,
    bin_width_ps: f64,
    reach_bins: f64,
) -> Option<Offset> {
    let near = most_common(positions, ONE_TARGET);
    let near = near.or_else(|| most_common(positions, reach_bins))?;
    let pairs: Vec<(f64, f64)> = near.into_iter().map(|at| (at, distance_mm)).collect();
    from_distances(&pairs, bin_width_ps)
}

/// The most positions within `reach` bins, if they are more than half.
fn most_common(positions: &[f64], reach: f64) -> Option<Vec<f64>> {
    let mut sorted = positions.to_vec();
    sorted.sort_by(f64::total_cmp);
    let near = |at: f64| {
        let first = sorted.partition_point(|&position| position < at);
        let end = sorted.partition_point(|&position| position <= at + reach);
        &sorted[first..end]
    };
    let most = sorted
        .iter()
        .map(|&at| near(at))
        .max_by_key(|near| near.len())?;
    (2 * most.len() > positions.len()).then(|| most.to_vec())
}

/// Where the core places the highest peak of a histogram of `bins` bins within `gate`, in bins.
#[must_use]
pub fn position(
    trace: &Trace,
    bins: usize,
    gate: (u16, u16),
    window: CentredWindow,
) -> Option<f64> {
    with_bins!(bins, BINS => {
        let gate = RangeGate::<BINS>::new(gate.0, gate.1).ok();
        gate.map(|gate| place(&trace.counts, &gate, window))
    })
    .ok()?
}

/// The standard deviation of that position by the noise of the photons, in bins: each bin near it in turn has one
/// standard deviation more.
#[must_use]
pub fn noise(
    (trace, position): (&Trace, f64),
    bins: usize,
    gate: (u16, u16),
    window: CentredWindow,
) -> f64 {
    let mut moved = trace.clone();
    let mut variance = 0.0;
    let is_near = |bin: &usize| (*bin as f64 + 0.5 - position).abs() < NOISE_BINS;
    for bin in (0..trace.counts.len()).filter(is_near) {
        let count = trace.counts[bin];
        moved.counts[bin] = count + (count / trace.live[bin].max(1e-6)).sqrt();
        let place = self::position(&moved, bins, gate, window);
        variance += place.map_or(0.0, |place| (place - position).powi(2));
        moved.counts[bin] = count;
    }
    variance.sqrt()
}

/// The same for counts of any size.
#[must_use]
pub fn place<const BINS: usize>(
    counts: &[f64],
    gate: &RangeGate<BINS>,
    window: CentredWindow,
) -> f64 {
    // Scaled to counters of 16 bits.
    let highest = counts.iter().copied().fold(0.0, f64::max);
    let scale = (60_000.0 / highest.max(1.0)).min(1.0);
    let mut frame = [0u32; BINS];
    for (bin, count) in frame.iter_mut().zip(counts) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = (count * scale).round() as u32;
        *bin = count;
    }
    let mut histogram = Histogram::<BINS, Count16>::new();
    histogram.add_frame(&frame, gate);
    let peak = histogram.peak();
    let estimator = DepthEstimator::CentredWindow(window);
    let depth = estimator.estimate(&histogram, gate, peak, U24F8::ZERO);
    let position = BinPosition::of(peak.bin, depth.offset);
    f64::from(position.raw()) / 256.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_give_width_and_offset_whatever_a_few_are() {
        let mut pairs: Vec<(f64, f64)> = (0..60)
            .map(|number| f64::from(number) * 0.7 + 10.0)
            .map(|bins| (bins, bins * 92.0 * MM_PER_PS - 175.0))
            .collect();
        for pair in &mut pairs[..9] {
            pair.0 = 3.0;
        }
        let found = from_distances(&pairs, 100.0).unwrap();
        assert!((found.bin_width_ps.unwrap() - 92.0).abs() < 0.05);
        assert!((found.mm + 175.0).abs() < 0.5, "{found:?}");
        // One distance says nothing of the width.
        let found = from_distances(&pairs[20..21], 92.0).unwrap();
        assert_eq!(found.bin_width_ps, None);
        assert!((found.mm + 175.0).abs() < 1e-9);
        assert_eq!(from_distances(&[], 92.0), None);
    }

    #[test]
    fn the_target_is_what_most_pixels_see() {
        let mut positions = vec![40.3; 10];
        positions.extend([60.0, 61.0, 62.0, 63.0, 64.0, 65.0, 66.0, 40.4, 40.2]);
        let found = from_target(&positions, 1000.0, 100.0, 1.5).unwrap();
        assert_eq!(found.histograms, 12);
        assert!((found.mm - (1000.0 - 40.3 * 100.0 * MM_PER_PS)).abs() < 1e-9);
        assert_eq!(from_target(&[], 1000.0, 100.0, 1.5), None);
        // No surface is that of most.
        positions.truncate(17);
        positions.extend([20.0; 4]);
        assert_eq!(from_target(&positions, 1000.0, 100.0, 1.5), None);
        // Unless its pixels may differ that much.
        let found = from_target(&positions, 1000.0, 100.0, 25.0).unwrap();
        assert_eq!(found.histograms, 16);
    }
}
