//! The pixels of an array: their background, and those that are hot or dead.

use dtof_core::Array;

use super::background::Level;
use super::observed::Trace;
use super::peaks::Peak;
use super::significance::{is_surely_less, is_surely_more, median, quantile};

/// A hot pixel has more than this many times the background of the median pixel and of its neighbours.
const HOT: f64 = 10.0;
/// A hot pixel is flat: no peak is higher than so many times its background.
const FLAT: f64 = 2.0;
/// Neighbours in a single row: so many on either side. In a row or a column of light each has two that are as bright.
const BESIDE: u32 = 2;
/// By chance at most one pixel in so many is called hot or dead: one in a thousand of the largest arrays.
const ONE_IN: f64 = 65_536.0 * 1000.0;

/// The background of an array, and its bad pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    /// Photons a bin and laser cycle: the mean of the middle half of the pixels.
    pub background: f64,
    /// The 95 % interval of `background`.
    pub between: (f64, f64),
    /// The 10th and 90th percentile of the pixels.
    pub spread: (f64, f64),
    /// Hot pixels: flat, with many times the background of the others, and of all but one of their neighbours. Pixels in the
    /// sun have such neighbours, or see a pulse.
    pub hot: Vec<usize>,
    /// Dead pixels: without a photon, where even the darkest of the others have so many that chance does not
    /// explain it.
    pub dead: Vec<usize>,
}

impl Pixels {
    /// Classifies the pixels of `array` that have traces from the background of each.
    #[must_use]
    pub fn new(array: Array, traces: &[Trace], levels: &[Level]) -> Self {
        let pixels = array.pixels() as usize;
        let mut of = vec![Sum::default(); pixels];
        let all = || traces.iter().zip(levels);
        for (trace, level) in all() {
            of[trace.pixel].add(trace, level);
        }
        let is_seen = |at: &usize| of[*at].traces > 0;
        // Most of the pixels may be dead: the median is that of pixels with photons.
        let with_photons = of.iter().filter(|pixel| pixel.total > 0.0);
        let usual = median(with_photons.map(|pixel| pixel.total));
        // A pixel without a photon may be dark rather than dead. If some are surely darker than the median, it
        // may be as dark as the darkest of them.
        let darker = of.iter().map(|pixel| pixel.total);
        let darker = darker.filter(|&total| total > 0.0 && is_surely_less(total, usual, ONE_IN));
        let expected = darker.fold(usual, f64::min);
        let is_dead = |pixel: &Sum| pixel.total == 0.0 && expected > ONE_IN.ln();
        let seen: Vec<usize> = (0..pixels).filter(is_seen).collect();
        let alive = seen
            .iter()
            .map(|&at| &of[at])
            .filter(|pixel| !is_dead(pixel));
        let rate = median(alive.map(Sum::rate));
        // One photon more, as the median may be 0.
        let is_brighter = |pixel: &Sum, than: f64| {
            let most = HOT * (than * pixel.exposure + 1.0);
            is_surely_more(pixel.photons, most, ONE_IN)
        };
        let is_hot = |&at: &usize| {
            let neighbours = neighbours(array, at).filter(is_seen);
            let neighbours = neighbours.map(|other| of[other].rate());
            is_brighter(&of[at], rate)
                && is_brighter(&of[at], second_highest(neighbours))
                && !all().any(|(trace, level)| trace.pixel == at && has_pulse(trace, level))
        };
        let hot: Vec<usize> = seen.iter().copied().filter(is_hot).collect();
        let dead = seen.iter().copied().filter(|&at| is_dead(&of[at]));
        let dead: Vec<usize> = dead.collect();
        let is_bad = |at: &usize| hot.binary_search(at).is_ok() || dead.binary_search(at).is_ok();
        let good = seen.iter().filter(|at| !is_bad(at));
        let mut good: Vec<&Sum> = good.map(|&at| &of[at]).collect();
        good.sort_by(|one, other| one.rate().total_cmp(&other.rate()));
        let quarter = good.len() / 4;
        let middle = &good[quarter..good.len() - quarter];
        let exposure: f64 = middle.iter().map(|pixel| pixel.exposure).sum();
        let photons: f64 = middle.iter().map(|pixel| pixel.photons).sum();
        let background = photons / exposure.max(1.0);
        let rates = || good.iter().map(|pixel| pixel.rate());
        let [low, high] = [0.16, 0.84].map(|share| quantile(rates(), share));
        // The mean of the middle half of normal values has 1.2 times the variance of the mean. A single
        // pixel has no spread, but shot noise.
        let by_spread = 1.1 * (high - low) / 2.0 / (good.len().max(1) as f64).sqrt();
        let by_count = photons.sqrt() / exposure.max(1.0);
        let error = 1.96 * by_spread.max(by_count);
        Self {
            background,
            between: ((background - error).max(0.0), background + error),
            spread: (quantile(rates(), 0.1), quantile(rates(), 0.9)),
            hot,
            dead,
        }
    }

    /// Whether a pixel is neither hot nor dead.
    #[must_use]
    pub fn is_good(&self, pixel: usize) -> bool {
        !self.hot.contains(&pixel) && !self.dead.contains(&pixel)
    }
}

/// The background of a pixel in all captures.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    photons: f64,
    /// Bins × laser cycles.
    exposure: f64,
    /// Photons of all bins.
    total: f64,
    /// Of a pixel that is left out there is no histogram.
    traces: usize,
}

impl Sum {
    fn add(&mut self, trace: &Trace, level: &Level) {
        self.photons += level.photons();
        self.exposure += level.clear_bins * trace.cycles;
        self.total += trace.counts.iter().sum::<f64>();
        self.traces += 1;
    }

    fn rate(&self) -> f64 {
        self.photons / self.exposure.max(1.0)
    }
}

/// Whether a histogram has a peak that rises after its first bin, from a background that is lower.
fn has_pulse(trace: &Trace, level: &Level) -> bool {
    let peaks = Peak::all(&trace.counts, &trace.live, level.with_one_more());
    let is_pulse = |peak: &Peak| peak.first > 0 && trace.counts[peak.top] > FLAT * level.mean;
    peaks.iter().any(is_pulse)
}

/// The pixels around pixel `at`, without those past the edges.
fn neighbours(array: Array, at: usize) -> impl Iterator<Item = usize> {
    let (columns, rows) = (array.columns(), array.rows());
    let reach = match columns.min(rows) {
        1 => BESIDE,
        _ => 1,
    };
    #[allow(clippy::cast_possible_truncation, reason = "at most 65,536 pixels")]
    let (column, row) = (at as u32 % columns, at as u32 / columns);
    let about =
        move |place: u32, end: u32| place.saturating_sub(reach)..(place + reach + 1).min(end);
    let all = about(row, rows)
        .flat_map(move |row| about(column, columns).map(move |column| row * columns + column));
    all.map(|other| other as usize)
        .filter(move |&other| other != at)
}

/// The second highest value, the highest if there is only one, 0 without any.
fn second_highest(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(|one, other| other.total_cmp(one));
    values.get(1).or(values.first()).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pixels that are hot in an array of 8×8 or 1×64, where these are `times` as bright as the others.
    fn hot(array: Array, bright: &[usize], times: f64, pulse: f64) -> Vec<usize> {
        let traces: Vec<Trace> = (0..64)
            .map(|pixel| {
                let level = if bright.contains(&pixel) {
                    20.0 * times
                } else {
                    20.0
                };
                let mut counts = vec![level; 64];
                counts[40] += pulse * level;
                Trace {
                    pixel,
                    cycles: 1000.0,
                    counts,
                    live: vec![1.0; 64],
                    truth_mm: None,
                }
            })
            .collect();
        let levels = traces.iter();
        let levels: Vec<Level> = levels
            .map(|trace| Level::of(&trace.counts, &trace.live))
            .collect();
        Pixels::new(array, &traces, &levels).hot
    }

    #[test]
    fn pixels_alone_or_in_pairs_are_hot_and_patches_are_not() {
        let (square, row) = (Array::new(8, 8).unwrap(), Array::new(64, 1).unwrap());
        for pixel in 0..64 {
            assert_eq!(hot(square, &[pixel], 30.0, 0.0), [pixel]);
            assert_eq!(hot(row, &[pixel], 30.0, 0.0), [pixel]);
            // Not much brighter, or with a pulse.
            assert!(hot(square, &[pixel], 8.0, 0.0).is_empty());
            assert!(hot(square, &[pixel], 30.0, 1.2).is_empty());
        }
        for (column, row) in (0..7).flat_map(|column| (0..7).map(move |row| (column, row))) {
            let corner = 8 * row + column;
            assert_eq!(
                hot(square, &[corner, corner + 9], 30.0, 0.0),
                [corner, corner + 9]
            );
            let patch = [corner, corner + 1, corner + 8, corner + 9];
            assert!(hot(square, &patch, 30.0, 0.0).is_empty(), "{patch:?}");
        }
        assert!(hot(row, &[20, 21, 22], 30.0, 0.0).is_empty());
        let strip: Vec<usize> = (0..8).map(|row| 8 * row + 3).collect();
        // But for the ends of a line.
        assert_eq!(hot(square, &strip, 30.0, 0.0), [strip[0], strip[7]]);
    }
}
