//! The width of the laser's pulse: one σ for all peaks, by maximum likelihood.
//!
//! A bin of a peak holds `b + A·share` photons on average, where the share is the integral of a
//! Gaussian over the bin ([`bin_share`](dtof_light::rates::bin_share)). Each peak has an
//! amplitude and a position of its own, found by Fisher scoring for every σ that is tried. What
//! they take away from the width of peaks with few photons is given back by Cox and Reid's
//! term, half the logarithm of their information. The median of the σ of single peaks is tried
//! first, which no peak can move far. Peaks that a Gaussian of this σ does not fit, such as two
//! surfaces in one or a stuck bin, are left out if the others are more. If they are not, the pulse
//! is no Gaussian: then its core is fitted, the bins with at least a quarter of its height, in
//! peaks whose own σ is near the median.

use dtof_core::fixed::types::U8F8;
use rayon::prelude::*;

use super::half_widths::{AsymmetricWindow, asymmetric_window};
use super::shape::{Fit, Window, best};
use super::significance::median;

/// The most peaks that are fitted: more take time and hardly change anything.
const MAX_PEAKS: usize = 256;
/// The fewest photons of a peak, and its lowest signal-to-noise ratio.
const MIN_PHOTONS: f64 = 30.0;
const MIN_SNR: f64 = 8.0;
/// A Gaussian does not fit a peak whose deviance lies so many standard deviations above its degrees of
/// freedom.
const MAX_DEVIANCE_Z: f64 = 4.5;
/// The σ of a core lies between the median over this and the median times this.
const NEAR: f64 = 1.5;
/// The pulse is not Gaussian if the median residual of its peaks is more than this share of their
/// photons.
const MAX_RESIDUAL: f64 = 0.03;

/// The sides of a core begin so many standard deviations from its centre. A pulse is skewed if one side has so much more
/// of its photons than the other, in this share of the peaks.
const SIDE: f64 = 1.5;
const SKEWED: f64 = 0.03;
const SURELY: f64 = 0.8;

/// The pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulse {
    /// Standard deviation in bins.
    pub sigma: f64,
    /// The 95 % interval of `sigma`.
    pub between: (f64, f64),
    /// The number of peaks that were fitted.
    pub peaks: usize,
    /// Signal photons a laser cycle of the median peak.
    pub signal: f64,
    /// The share of the photons that come more than 3σ after the Gaussian.
    pub tail: f64,
    /// Whether `sigma` is that of the core, because a Gaussian does not fit the whole pulse.
    pub is_core: bool,
    /// An asymmetric window for the depth, if it is better than a symmetric one.
    pub asymmetric: Option<AsymmetricWindow>,
}

/// Fits the pulse in windows that hold one peak each; `None` if no peak is bright enough.
#[must_use]
pub fn pulse(windows: &[Window], seed: u64) -> Option<Pulse> {
    let mut bright: Vec<&Window> = windows
        .iter()
        .filter(|window| window.photons >= MIN_PHOTONS && window.snr() >= MIN_SNR)
        .collect();
    bright.sort_by(|one, other| other.snr().total_cmp(&one.snr()));
    bright.truncate(MAX_PEAKS);
    if bright.is_empty() {
        return None;
    }
    let all: Vec<Window> = bright.iter().map(|&window| window.clone()).collect();
    let sigma = median(sigmas(&all));
    let fits: Vec<Fit> = all.iter().map(|window| window.fit(sigma)).collect();
    let fitting: Vec<Window> = all
        .iter()
        .zip(&fits)
        .filter(|(_, fit)| fit.deviance_z() < MAX_DEVIANCE_Z)
        .map(|(window, _)| window.narrowed(sigma))
        .collect();
    let residual = median(fits.iter().map(Fit::residual_share));
    let most_fit = 2 * fitting.len() >= all.len();
    let is_core = !most_fit && residual > MAX_RESIDUAL;
    let kept = if is_core {
        cores(&all)
    } else if most_fit {
        fitting
    } else {
        let fits = all.iter().zip(&fits);
        let near = fits.filter(|(_, fit)| fit.residual_share() <= MAX_RESIDUAL);
        near.map(|(window, _)| window.clone()).collect()
    };
    let (sigma, fits) = best(&kept);
    let is_skewed = is_core && is_skewed(&kept, &fits, sigma);
    let core = is_skewed.then(|| U8F8::saturating_from_num(sigma));
    let asymmetric = core.and_then(|core| asymmetric_window(&kept, core, seed));
    let between = super::shape::interval(&kept, sigma);
    let signals = kept
        .iter()
        .zip(&fits)
        .map(|(of, fit)| fit.amplitude / of.cycles);
    Some(Pulse {
        sigma,
        between,
        peaks: kept.len(),
        signal: median(signals),
        tail: tail(&kept, &fits, sigma),
        is_core,
        asymmetric,
    })
}

/// The σ that fit single peaks best.
fn sigmas(windows: &[Window]) -> Vec<f64> {
    let each = windows.par_iter();
    each.map(|window| best(std::slice::from_ref(window)).0)
        .collect()
}

/// The cores of the peaks, without those that are far narrower or wider than the median.
fn cores(windows: &[Window]) -> Vec<Window> {
    let cores: Vec<Window> = windows.iter().map(Window::core).collect();
    let sigmas = sigmas(&cores);
    let middle = median(sigmas.iter().copied());
    let near = middle / NEAR..=middle * NEAR;
    let all = cores.into_iter().zip(sigmas);
    all.filter(|(_, sigma)| near.contains(sigma))
        .map(|(core, _)| core)
        .collect()
}

/// Whether peaks surely have more photons on one side of their core than on the other: the median peak by 3 %, and four
/// peaks of five on the same side as the median.
fn is_skewed(windows: &[Window], fits: &[Fit], sigma: f64) -> bool {
    let peaks = windows.iter().zip(fits);
    let excess =
        peaks.map(|(window, fit)| window.late_excess(fit.position, SIDE * sigma) / fit.amplitude);
    let excess: Vec<f64> = excess.collect();
    let middle = median(excess.iter().copied());
    let on_side = excess.iter().filter(|&&of| of * middle > 0.0).count();
    middle.abs() > SKEWED && on_side as f64 >= SURELY * excess.len() as f64
}

/// The share of the photons that come more than 3σ after the Gaussian.
fn tail(windows: &[Window], fits: &[Fit], sigma: f64) -> f64 {
    let (mut late, mut all) = (0.0, 0.0);
    for (window, fit) in windows.iter().zip(fits) {
        let from = fit.position + 3.0 * sigma;
        for (bin, count) in window.after_top() {
            if bin as f64 >= from {
                late += count - window.background;
            }
        }
        all += fit.amplitude;
    }
    (late / (all + late).max(1.0)).clamp(0.0, 1.0)
}
