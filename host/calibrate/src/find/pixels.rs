//! The pixels of an array: their background, and those that are hot or dead.

use super::background::Level;
use super::limits::{is_more, median, quantile};
use super::observed::Trace;

/// A hot pixel has more than so many times the background of the median one.
pub const HOT: f64 = 10.0;
/// One pixel in so many is named by chance, at most: none in a thousand of the largest arrays.
const ONE_IN: f64 = 65_536.0 * 1000.0;

/// What the background of an array is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixels {
    /// Photons a bin and laser cycle of the median pixel: the mean of the middle half of them.
    pub background: f64,
    /// The 95 % interval of that.
    pub between: (f64, f64),
    /// What a tenth of the pixels lie below, and a tenth above.
    pub spread: (f64, f64),
    /// Those with many times as much.
    pub hot: Vec<usize>,
    /// Those without a photon where others have enough to be sure.
    pub dead: Vec<usize>,
}

impl Pixels {
    /// Of an array of `pixels`, with the level of each trace.
    #[must_use]
    pub fn new(pixels: usize, traces: &[Trace], levels: &[Level]) -> Self {
        let mut of = vec![Sum::default(); pixels];
        for (trace, level) in traces.iter().zip(levels) {
            of[trace.pixel].add(trace, level);
        }
        // Most of the pixels may be dead: those with photons say what is usual.
        let with_photons = of.iter().filter(|pixel| pixel.total > 0.0);
        let usual = median(with_photons.map(|pixel| pixel.total));
        let is_dead = |pixel: &Sum| pixel.total == 0.0 && usual > ONE_IN.ln();
        let alive = of.iter().filter(|pixel| !is_dead(pixel));
        let rate = median(alive.map(Sum::rate));
        // One photon more: a median of 0 says little.
        let is_hot = |pixel: &Sum| {
            let most = HOT * (rate * pixel.exposure + 1.0);
            is_more(pixel.photons, most, ONE_IN)
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
        // The mean of the middle half of normal values has 1.2 times the variance of the mean; one
        // pixel alone has no spread, but its photons.
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
