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

use super::half_widths::{Suited, suited};
use super::limits::median;
use super::shape::{Fit, Window, best};

/// Peaks that are fitted, at most: more take time and hardly change anything.
const MOST: usize = 256;
/// Photons of a peak, at least, and how many times its own noise.
const LEAST_PHOTONS: f64 = 30.0;
const LEAST_SIGNAL: f64 = 8.0;
/// A peak whose deviance lies so many standard deviations above its degrees of freedom is no
/// Gaussian.
const MISFIT: f64 = 4.5;
/// A pulse is no Gaussian if the misfit of its peaks is more than this share of their photons.
const UNEVEN: f64 = 0.03;

/// The pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulse {
    /// Standard deviation in bins.
    pub sigma: f64,
    /// The 95 % interval of that.
    pub between: (f64, f64),
    /// Peaks it was found from.
    pub peaks: usize,
    /// Signal photons a laser cycle of the median one.
    pub signal: f64,
    /// Share of the photons that come more than three σ after, and before, a Gaussian's.
    pub tail: f64,
    /// Whether σ is that of the core, as a Gaussian does not fit.
    pub is_core: bool,
    /// The window that suits a pulse that is no Gaussian, if equal half widths do not.
    pub suited: Option<Suited>,
}

/// Finds the pulse from windows that hold one peak each; `None` if no peak is bright enough.
#[must_use]
pub fn pulse(windows: &[Window], seed: u64) -> Option<Pulse> {
    let mut bright: Vec<&Window> = windows
        .iter()
        .filter(|window| window.photons >= LEAST_PHOTONS && window.clearness() >= LEAST_SIGNAL)
        .collect();
    bright.sort_by(|one, other| other.clearness().total_cmp(&one.clearness()));
    bright.truncate(MOST);
    if bright.is_empty() {
        return None;
    }
    let all: Vec<Window> = bright.iter().map(|&window| window.clone()).collect();
    let (sigma, fits) = best(&all);
    let fitting: Vec<Window> = all
        .iter()
        .zip(&fits)
        .filter(|(_, fit)| fit.misfit() < MISFIT)
        .map(|(window, _)| window.narrowed(sigma))
        .collect();
    let uneven = median(fits.iter().map(Fit::unevenness));
    let is_core = 2 * fitting.len() < all.len() && uneven > UNEVEN;
    let kept = if is_core {
        all.iter().map(Window::core).collect()
    } else if 2 * fitting.len() < all.len() {
        all.clone()
    } else {
        fitting
    };
    let (sigma, fits) = best(&kept);
    let suited = is_core.then(|| suited(&kept, U8F8::saturating_from_num(sigma), seed));
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
        suited: suited.flatten(),
    })
}

/// What comes late beyond a Gaussian, as a share of all.
fn tail(windows: &[Window], fits: &[Fit], sigma: f64) -> f64 {
    let (mut late, mut all) = (0.0, 0.0);
    for (window, fit) in windows.iter().zip(fits) {
        let from = fit.position + 3.0 * sigma;
        for (bin, count) in window.behind() {
            if bin as f64 >= from {
                late += count - window.background;
            }
        }
        all += fit.amplitude;
    }
    (late / (all + late).max(1.0)).clamp(0.0, 1.0)
}
