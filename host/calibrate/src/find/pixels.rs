//! The pixels of an array: their background, and those that are hot or dead.

use super::background::Level;
use super::observed::Trace;
use super::significance::{is_surely_less, is_surely_more, median, quantile};

/// A hot pixel has more than this many times the background of the median pixel.
const HOT: f64 = 10.0;
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
    /// Hot pixels: with many times the background of the others.
    pub hot: Vec<usize>,
    /// Dead pixels: without a photon, where even the darkest of the others have so many that chance does not
    /// explain it.
    pub dead: Vec<usize>,
}

impl Pixels {
    /// Classifies `pixels` pixels from the background of each trace.
    #[must_use]
    pub fn new(pixels: usize, traces: &[Trace], levels: &[Level]) -> Self {
        let mut of = vec![Sum::default(); pixels];
        for (trace, level) in traces.iter().zip(levels) {
            of[trace.pixel].add(trace, level);
        }
        // Most of the pixels may be dead: the median is that of pixels with photons.
        let with_photons = of.iter().filter(|pixel| pixel.total > 0.0);
        let usual = median(with_photons.map(|pixel| pixel.total));
        // A pixel without a photon may be dark rather than dead. If some are surely darker than the median, it
        // may be as dark as the darkest of them.
        let darker = of.iter().map(|pixel| pixel.total);
        let darker = darker.filter(|&total| total > 0.0 && is_surely_less(total, usual, ONE_IN));
        let expected = darker.fold(usual, f64::min);
        let is_dead = |pixel: &Sum| pixel.total == 0.0 && expected > ONE_IN.ln();
        let alive = of.iter().filter(|pixel| !is_dead(pixel));
        let rate = median(alive.map(Sum::rate));
        // One photon more, as the median may be 0.
        let is_hot = |pixel: &Sum| {
            let most = HOT * (rate * pixel.exposure + 1.0);
            is_surely_more(pixel.photons, most, ONE_IN)
        };
        let indices = |is: &dyn Fn(&Sum) -> bool| (0..pixels).filter(|&at| is(&of[at])).collect();
        let mut good: Vec<&Sum> = of
            .iter()
            .filter(|pixel| !is_dead(pixel) && !is_hot(pixel))
            .collect();
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
            hot: indices(&is_hot),
            dead: indices(&is_dead),
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
}

impl Sum {
    fn add(&mut self, trace: &Trace, level: &Level) {
        self.photons += level.photons();
        self.exposure += level.clear_bins() as f64 * trace.cycles;
        self.total += trace.counts.iter().sum::<f64>();
    }

    fn rate(&self) -> f64 {
        self.photons / self.exposure.max(1.0)
    }
}
