//! The histograms of good pixels, with background and peaks of each.

use dtof_core::Array;

use super::background::Level;
use super::observed::Trace;
use super::peaks::Peak;
use super::significance::median;

/// Standard deviations from which on a slope of the background is taken as real.
const SLOPE: f64 = 6.0;
/// From so many histograms on, the brightest of each bin may be left out: a stuck bin of one pixel is no surface.
const MANY: usize = 16;
/// No histogram weighs more in the slope than one with so many times the background of the median.
const BRIGHTEST: f64 = 4.0;

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
        let peaks = peaks
            .map(|(trace, level)| Peak::all(&trace.counts, &trace.live, level.with_one_more()));
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

    /// The same if the TDC took the first photon in each of so many laser cycles: near bins have more of the background
    /// then, which is no surface.
    #[must_use]
    pub fn corrected(&self, cycles: f64) -> Self {
        let mut traces = self.traces.clone();
        for trace in &mut traces {
            trace.correct(cycles, self.bins());
        }
        let levels = traces.iter();
        let levels = levels.map(|trace| Level::of(&trace.counts, &trace.live));
        let levels = levels.collect();
        Self::new(self.array, self.rate, traces, levels)
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

    /// All histograms together.
    #[must_use]
    pub fn pooled(&self) -> Pooled {
        let all = self.traces.len() as f64;
        let mut pooled = Pooled {
            counts: vec![0.0; self.bins()],
            robust: Vec::new(),
            background: Vec::new(),
            live: vec![0.0; self.bins()],
        };
        let mut brightest = vec![0.0; self.bins()];
        for trace in &self.traces {
            for (bin, &count) in trace.counts.iter().enumerate() {
                pooled.counts[bin] += count;
                pooled.live[bin] += 1.0 / trace.live[bin].max(1e-6);
                brightest[bin] = f64::max(brightest[bin], count);
            }
        }
        let of_others = |(sum, brightest)| (sum - brightest) * all / (all - 1.0);
        pooled.robust = match self.traces.len() >= MANY {
            true => pooled
                .counts
                .iter()
                .zip(&brightest)
                .map(of_others)
                .collect(),
            false => pooled.counts.clone(),
        };
        pooled.live.iter_mut().for_each(|live| *live = all / *live);
        let level: f64 = self.levels.iter().map(|level| level.mean).sum();
        pooled.background = self.trend.iter().map(|trend| trend * level).collect();
        pooled
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

/// The sums over all histograms.
pub struct Pooled {
    /// Of the counts of each bin.
    pub counts: Vec<f64>,
    /// The same from all but the brightest histogram of each bin, if there are many.
    pub robust: Vec<f64>,
    /// Of the background of each bin.
    pub background: Vec<f64>,
    /// The harmonic mean of what was live: so many of the counts would be noise as large.
    pub live: Vec<f64>,
}

/// Fits a straight line through the bins that hold background in most histograms. The trend is flat
/// if these bins span too little, or if the slope is not significant.
fn trend(traces: &[Trace], levels: &[Level]) -> Vec<f64> {
    let bins = levels.first().map_or(0, |level| level.clear.len());
    let usual = median(levels.iter().map(|level| level.mean));
    // What was recorded of counts and expectation of each bin.
    let mut sums = vec![(0.0, 0.0); bins];
    for (trace, level) in traces.iter().zip(levels) {
        let weight = (BRIGHTEST * usual / level.mean.max(1e-9)).min(1.0);
        for (bin, sum) in sums.iter_mut().enumerate() {
            if level.clear[bin] {
                sum.0 += weight * trace.counts[bin] * trace.live[bin];
                sum.1 += weight * level.mean * trace.live[bin];
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
