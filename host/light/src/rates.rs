//! Photons a bin: pulse and background (Eq. 1 to 3, 6).

use std::f64::consts::PI;

use crate::counts::normal;

/// The mean photons of one pixel in a laser cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Background photons a bin (B).
    pub background: f64,
    /// Signal photons (A).
    pub signal: f64,
    /// Position of the pulse, in bins from the start of bin 0 (µ).
    pub position: f64,
    /// Standard deviation of the pulse in bins (σ).
    pub sigma: f64,
}

impl Rates {
    /// `background` photons a bin, and no pulse.
    #[must_use]
    pub const fn without_target(background: f64) -> Self {
        Self {
            background,
            signal: 0.0,
            position: 0.0,
            sigma: 1.0,
        }
    }
}

/// The light that one object returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Signal photons detected a laser cycle (`A_k`).
    pub photons: f64,
    /// Position of the pulse, in bins from the start of bin 0 (`µ_k`).
    pub position: f64,
}

/// Eq. 1: signal photons a bin width and laser cycle at time `t`, for pulses of
/// standard deviation `sigma` bins, above 0.
#[must_use]
pub fn returned_signal(t: f64, reflections: &[Reflection], sigma: f64) -> f64 {
    let one = |object: &Reflection| object.photons * pulse_density(t, object.position, sigma);
    reflections.iter().map(one).sum()
}

/// Eq. 2: the pulse, a Gaussian of integral 1.
#[must_use]
pub fn pulse_density(t: f64, position: f64, sigma: f64) -> f64 {
    let z = (t - position) / sigma;
    (-z * z / 2.0).exp() / (sigma * (2.0 * PI).sqrt())
}

/// The integral in Eq. 3 and 6: the share of a pulse that falls into bin
/// `bin`, to full relative precision even far from the pulse. With a `sigma` of 0
/// all of it falls into the bin of `position`.
#[must_use]
pub fn bin_share(bin: u32, position: f64, sigma: f64) -> f64 {
    let start = f64::from(bin) - position;
    let end = start + 1.0;
    if sigma <= 0.0 {
        return f64::from(u8::from(start <= 0.0 && 0.0 < end));
    }
    let (start, end) = (start / sigma, end / sigma);
    if start > 0.0 {
        normal::above(start) - normal::above(end)
    } else {
        normal::below(end) - normal::below(start)
    }
}

/// Eq. 3: mean signal photons in bin `bin` after `cycles` laser cycles.
#[must_use]
pub fn signal_mean(bin: u32, cycles: f64, reflections: &[Reflection], sigma: f64) -> f64 {
    let one =
        |object: &Reflection| object.photons * cycles * bin_share(bin, object.position, sigma);
    reflections.iter().map(one).sum()
}

/// Eq. 6: the bin that holds most of a pulse (`i*`, the lower of two equal
/// ones) and its share of the pulse. `h_i*` is this share times `N·A`.
#[must_use]
pub fn peak_share(bins: u32, position: f64, sigma: f64) -> (u32, f64) {
    let shares = (0..bins).map(|bin| (bin, bin_share(bin, position, sigma)));
    // On an edge the two shares differ only by rounding.
    let higher = |best: (u32, f64), next: (u32, f64)| {
        if next.1 > best.1 * (1.0 + 1e-12) {
            next
        } else {
            best
        }
    };
    shares.fold((0, 0.0), higher)
}

/// The SNR of a histogram as the paper defines it: `N·A / √(N·B)`, with `signal`
/// photons (A) and `background` photons a bin (B) in a laser cycle, after
/// `cycles` laser cycles (N).
#[must_use]
pub fn snr(signal: f64, background: f64, cycles: f64) -> f64 {
    cycles * signal / (cycles * background).sqrt()
}

/// The signal photons of a laser cycle (A) with which [`snr`] is `snr`.
#[must_use]
pub fn signal_for_snr(snr: f64, background: f64, cycles: f64) -> f64 {
    snr * (background / cycles).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counts::quadrature::integral;

    #[test]
    fn a_bin_holds_the_integral_of_the_pulse() {
        for (position, sigma) in [(4.0, 1.5), (4.5, 0.3), (3.21, 0.8)] {
            let pulse = [Reflection {
                photons: 1.0,
                position,
            }];
            for bin in 0..8 {
                let start = f64::from(bin);
                let density = |t| returned_signal(t, &pulse, sigma);
                let expected = integral(start, start + 1.0, 8, density);
                let found = signal_mean(bin, 1.0, &pulse, sigma);
                assert!((found / expected - 1.0).abs() < 1e-10, "{position} {bin}");
            }
        }
    }

    #[test]
    fn objects_and_laser_cycles_add() {
        let near = Reflection {
            photons: 0.5,
            position: 2.0,
        };
        let far = Reflection {
            photons: 0.2,
            position: 5.3,
        };
        let both = signal_mean(3, 100.0, &[near, far], 1.0);
        let apart = 100.0 * (0.5 * bin_share(3, 2.0, 1.0) + 0.2 * bin_share(3, 5.3, 1.0));
        assert!((both - apart).abs() < 1e-12);
        let total: f64 = (0..200).map(|bin| bin_share(bin, 100.2, 9.0)).sum();
        assert!((total - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_pulse_without_width_falls_into_one_bin() {
        let shares: Vec<f64> = (0..4).map(|bin| bin_share(bin, 2.0, 0.0)).collect();
        assert_eq!(shares, [0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn on_an_edge_the_lower_bin_is_the_peak() {
        let (bin, share) = peak_share(8, 4.0, 1.5);
        assert_eq!(bin, 3);
        // Φ(1/1.5) − Φ(0).
        assert!((share - 0.247_507_46).abs() < 1e-8, "{share}");
        assert_eq!(peak_share(8, 4.01, 1.5).0, 4);
        // Of bins that hold nothing the first.
        assert_eq!(peak_share(8, 500.0, 1.0), (0, 0.0));
    }

    #[test]
    fn snr_and_back() {
        assert_eq!(snr(0.3, 0.01, 900.0), 90.0);
        assert!((signal_for_snr(90.0, 0.01, 900.0) - 0.3).abs() < 1e-15);
    }
}
