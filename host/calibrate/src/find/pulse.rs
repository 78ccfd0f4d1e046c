//! The width of the laser's pulse: one σ for all peaks, by maximum likelihood.
//!
//! A bin of a peak holds `b + A·share` photons on average, where the share is the integral of a
//! Gaussian over the bin ([`bin_share`](dtof_theory::rates::bin_share)). Each peak has an
//! amplitude and a position of its own, found by Fisher scoring for every σ that is tried. What
//! they take away from the width of peaks with few photons is given back by Cox and Reid's
//! term, half the logarithm of their information. Peaks that a Gaussian does not fit, such as
//! two surfaces in one, are left out if the others are more. If they are not, the pulse is no
//! Gaussian: then its core is fitted, the bins with at least a quarter of its height.

use dtof_core::fixed::types::U8F8;

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
/// The pulse is not Gaussian if the median residual of its peaks is more than this share of their
/// photons.
const MAX_RESIDUAL: f64 = 0.03;

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
    let (sigma, fits) = best(&all);
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
        all.iter().map(Window::core).collect()
    } else if most_fit {
        fitting
    } else {
        all
    };
    let (sigma, fits) = best(&kept);
    let core = is_core.then(|| U8F8::saturating_from_num(sigma));
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
