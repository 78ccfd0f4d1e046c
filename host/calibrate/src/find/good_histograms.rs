//! The histograms of good pixels, with background and peaks of each.

use dtof_core::Array;

use super::background::Level;
use super::observed::Trace;
use super::peaks::Peak;

/// Standard deviations from which on a slope of the background is taken as real.
const SLOPE: f64 = 6.0;

/// The histograms of pixels that are neither hot nor dead.
#[derive(Clone, Debug)]
pub struct GoodHistograms {
    /// The array of one capture.
    array: Array,
    /// Background photons a bin and laser cycle.
    pub rate: f64,
    /// The histograms.
    pub traces: Vec<Trace>,
    /// The background of each.
    pub levels: Vec<Level>,
    /// The peaks of each.
    pub peaks: Vec<Vec<Peak>>,
    /// The background of each bin, relative to the mean over all bins.
    trend: Vec<f64>,
}

impl GoodHistograms {
    /// `rate` is the background in photons a bin and laser cycle. There is at least one histogram.
    #[must_use]
    pub fn new(array: Array, rate: f64, traces: Vec<Trace>, levels: Vec<Level>) -> Self {
        let peaks = traces.iter().zip(&levels);
        let peaks = peaks.map(|(trace, level)| Peak::all(&trace.counts, level.mean));
        let peaks: Vec<Vec<Peak>> = peaks.collect();
        let trend = trend(&traces, &levels);
        Self {
            array,
            rate,
            traces,
            levels,
            peaks,
            trend,
        }
    }

    /// Bins of a histogram.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.trend.len()
    }

    /// Mean number of background photons in bin `bin` of histogram `index`.
    #[must_use]
    pub fn background(&self, index: usize, bin: usize) -> f64 {
        self.levels[index].mean * self.trend[bin]
    }

    /// The sums over all histograms of the counts of each bin, and of the background of each bin.
    #[must_use]
    pub fn pooled(&self) -> (Vec<f64>, Vec<f64>) {
        let mut counts = vec![0.0; self.bins()];
        for trace in &self.traces {
            for (sum, count) in counts.iter_mut().zip(&trace.counts) {
                *sum += count;
            }
        }
        let level: f64 = self.levels.iter().map(|level| level.mean).sum();
        let background = self.trend.iter().map(|trend| trend * level).collect();
        (counts, background)
    }

    /// Laser cycles of all histograms.
    #[must_use]
    pub fn cycles(&self) -> f64 {
        self.traces.iter().map(|trace| trace.cycles).sum()
    }

    /// The indices of the histograms in the order of rows, in that of columns, and so that those of a square are together:
    /// the bits of column and row take turns (Z-order).
    #[must_use]
    pub fn orders(&self) -> [Vec<usize>; 3] {
        let columns = self.array.columns() as usize;
        let rows: Vec<usize> = (0..self.traces.len()).collect();
        let by = |key: &dyn Fn(usize, usize) -> usize| {
            let mut order = rows.clone();
            // Stable: within a column the order of rows stays.
            order.sort_by_key(|&index| {
                let pixel = self.traces[index].pixel;
                key(pixel % columns, pixel / columns)
            });
            order
        };
        let spread =
            |number: usize| (0..32).fold(0, |all, bit| all | (number >> bit & 1) << (2 * bit));
        let along_columns = by(&|column, _| column);
        let squares = by(&|column, row| spread(column) | spread(row) << 1);
        [rows, along_columns, squares]
    }
}

/// Fits a straight line through the bins that hold background in most histograms. The trend is flat
/// if these bins span too little, or if the slope is not significant.
fn trend(traces: &[Trace], levels: &[Level]) -> Vec<f64> {
    let bins = levels.first().map_or(0, |level| level.clear.len());
    // Counts and expectation of each bin.
    let mut sums = vec![(0.0, 0.0); bins];
    for (trace, level) in traces.iter().zip(levels) {
        for (bin, sum) in sums.iter_mut().enumerate() {
            if level.clear[bin] {
                sum.0 += trace.counts[bin];
                sum.1 += level.mean;
            }
        }
    }
    let flat = vec![1.0; bins];
    let most = sums.iter().map(|sum| sum.1).fold(0.0, f64::max);
    let kept = |bin: &usize| most > 0.0 && sums[*bin].1 >= 0.5 * most;
    let kept: Vec<usize> = (0..bins).filter(kept).collect();
    let (Some(first), Some(last)) = (kept.first(), kept.last()) else {
        return flat;
    };
    if 2 * kept.len() < bins || 10 * (last - first) < 8 * bins {
        return flat;
    }
    let weight: f64 = kept.iter().map(|&bin| sums[bin].1).sum();
    let middle = kept.iter().map(|&bin| sums[bin].1 * bin as f64);
    let middle = middle.sum::<f64>() / weight;
    let (mut covariance, mut variance) = (0.0, 0.0);
    for &bin in &kept {
        let from = bin as f64 - middle;
        covariance += from * (sums[bin].0 - sums[bin].1);
        variance += from * from * sums[bin].1;
    }
    let slope = covariance / variance;
    if slope.abs() * variance.sqrt() < SLOPE {
        return flat;
    }
    let line = (0..bins).map(|bin| (1.0 + slope * (bin as f64 - middle)).max(0.1));
    line.collect()
}
