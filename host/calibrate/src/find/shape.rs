//! A peak of one histogram, and the maximum-likelihood fit of a Gaussian.

use dtof_light::counts::normal;

/// The most steps of Fisher scoring; it converges before.
const STEPS: usize = 30;
/// The lowest and the highest σ in bins that is tried.
const SIGMAS: (f64, f64) = (0.12, WIDEST);
pub const WIDEST: f64 = 8.0;

/// The bins around the top that a window keeps.
pub const ABOUT: usize = 32;

/// The part of a histogram that holds one peak.
#[derive(Clone, Debug)]
pub struct Window {
    /// Laser cycles of the histogram.
    pub cycles: f64,
    /// Background photons a bin.
    pub background: f64,
    /// Photons of the peak above the background, before any fit.
    pub photons: f64,
    /// Counts of [`ABOUT`] bins around the top. Bins of other peaks hold the background instead.
    pub about_top: Vec<f64>,
    /// Counts of the bins around the top, up to the next peaks.
    counts: Vec<f64>,
    /// The share of the laser cycles in which the TDC was live in each of them.
    live: Vec<f64>,
    /// The first bin of `counts`.
    start: usize,
    /// The index of the top in `counts`, and the first and last index that is fitted.
    top: usize,
    fitted: (usize, usize),
}

impl Window {
    /// The peak at `top` of a histogram, which has no other peak in `first..=last`. The TDC was `live` in so much of the
    /// laser cycles in each bin.
    #[must_use]
    pub fn new(
        (counts, live): (&[f64], &[f64]),
        background: f64,
        cycles: f64,
        (first, top, last): (usize, usize, usize),
    ) -> Self {
        let from = top.saturating_sub(ABOUT / 2);
        let of_peak = |bin: usize| (first..=last).contains(&bin);
        let about_top = (from..from + ABOUT)
            .map(|bin| {
                if of_peak(bin) {
                    counts[bin]
                } else {
                    background
                }
            })
            .collect();
        let (counts, live) = (counts[first..=last].to_vec(), live[first..=last].to_vec());
        let top = top - first;
        // The full width at half maximum, one and a half times on either side.
        let half = background + (counts[top] - background) / 2.0;
        let reach = |steps: &mut dyn Iterator<Item = usize>| {
            steps.take_while(|&bin| counts[bin] > half).count()
        };
        let before = reach(&mut (0..top).rev());
        let after = reach(&mut (top + 1..counts.len()));
        let reach = 3 * (before + after + 1) / 2 + 2;
        let fitted = (
            top.saturating_sub(reach),
            (top + reach).min(counts.len() - 1),
        );
        let photons = counts[fitted.0..=fitted.1].iter();
        let photons = photons.map(|count| count - background).sum();
        Self {
            cycles,
            background,
            photons,
            about_top,
            counts,
            live,
            start: first,
            top,
            fitted,
        }
    }

    /// The signal-to-noise ratio.
    #[must_use]
    pub fn snr(&self) -> f64 {
        let all = self.fitted.0..=self.fitted.1;
        let variance = self.counts[all.clone()].iter().zip(&self.live[all]);
        let variance = variance.map(|(count, live)| count / live.max(1e-6));
        self.photons / variance.sum::<f64>().max(1.0).sqrt()
    }

    /// With fewer background bins in the fit: at most those within 4σ and two more of the top.
    #[must_use]
    pub fn narrowed(&self, sigma: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let reach = (4.0 * sigma).ceil() as usize + 2;
        let (first, last) = self.fitted;
        Self {
            fitted: (
                first.max(self.top.saturating_sub(reach)),
                last.min(self.top + reach),
            ),
            ..self.clone()
        }
    }

    /// With only the bins of at least a quarter of the height in the fit, and at least three.
    #[must_use]
    pub fn core(&self) -> Self {
        let quarter = self.background + (self.counts[self.top] - self.background) / 4.0;
        let last = self.counts.len() - 1;
        let (mut first, mut end) = (self.top.saturating_sub(1), (self.top + 1).min(last));
        while first > 0 && self.counts[first] >= quarter {
            first -= 1;
        }
        while end < last && self.counts[end] >= quarter {
            end += 1;
        }
        if self.counts[first] < quarter && first + 1 < self.top {
            first += 1;
        }
        if self.counts[end] < quarter && end > self.top + 1 {
            end -= 1;
        }
        Self {
            fitted: (first, end),
            ..self.clone()
        }
    }

    /// The bins after the top, with their counts.
    pub fn after_top(&self) -> impl Iterator<Item = (usize, f64)> {
        let bins = self.counts.iter().copied().enumerate().skip(self.top + 1);
        bins.map(|(bin, count)| (self.start + bin, count))
    }

    /// The photons that come from `side` to `side` + 4 bins after `position`, less those that come as much before it.
    #[must_use]
    pub fn late_excess(&self, position: f64, side: f64) -> f64 {
        let at = position - self.start as f64;
        let inside = |bin: usize, from: f64, to: f64| {
            let (first, end) = (bin as f64, bin as f64 + 1.0);
            (end.min(to) - first.max(from)).max(0.0)
        };
        let (near, far) = (side, side + 4.0);
        let of_bin = |(bin, count): (usize, &f64)| {
            let late = inside(bin, at + near, at + far) - inside(bin, at - far, at - near);
            late * (count - self.background)
        };
        self.counts.iter().enumerate().map(of_bin).sum()
    }

    /// The Gaussian of `sigma` that fits best.
    #[must_use]
    pub fn fit(&self, sigma: f64) -> Fit {
        let (first, last) = self.fitted;
        let (counts, live) = (&self.counts[first..=last], &self.live[first..=last]);
        let mut amplitude = self.photons.max(1.0);
        // In bins from the start of the window.
        let mut position = self.centroid();
        let mut shares = vec![(0.0, 0.0); counts.len()];
        let mut information = 0.0;
        for _ in 0..STEPS {
            share(&mut shares, first, position, sigma);
            let (mut score, mut info) = ([0.0; 2], [0.0; 3]);
            for ((count, live), (share, slope)) in counts.iter().zip(live).zip(&shares) {
                let mean = (self.background + amplitude * share).max(1e-12);
                let off = live * (count / mean - 1.0);
                let moved = amplitude * slope;
                score[0] += off * share;
                score[1] += off * moved;
                info[0] += live * share * share / mean;
                info[1] += live * share * moved / mean;
                info[2] += live * moved * moved / mean;
            }
            let determinant = info[0] * info[2] - info[1] * info[1];
            if determinant <= 0.0 || !determinant.is_finite() {
                break;
            }
            information = determinant.ln();
            let by_amplitude = (info[2] * score[0] - info[1] * score[1]) / determinant;
            let by_position = (info[0] * score[1] - info[1] * score[0]) / determinant;
            amplitude = (amplitude + by_amplitude).clamp(0.3 * amplitude, 3.0 * amplitude);
            let limit = 0.5 * sigma.max(0.4);
            position += by_position.clamp(-limit, limit);
            position = position.clamp(first as f64 - 1.0, last as f64 + 2.0);
            if by_position.abs() < 1e-7 && by_amplitude.abs() < 1e-7 * amplitude {
                break;
            }
        }
        share(&mut shares, first, position, sigma);
        let (mut likelihood, mut deviance, mut recorded) = (0.0, 0.0, 0.0);
        for ((&count, live), (share, _)) in counts.iter().zip(live).zip(&shares) {
            let mean = (self.background + amplitude * share).max(1e-12);
            recorded += live * amplitude * share;
            likelihood += live * (count * mean.ln() - mean);
            deviance += 2.0 * live * (mean - count);
            if count > 0.0 {
                deviance += 2.0 * live * count * (count / mean).ln();
            }
        }
        Fit {
            amplitude,
            recorded,
            position: self.start as f64 + position,
            likelihood: likelihood - information / 2.0,
            deviance,
            freedom: counts.len() as f64 - 3.0,
        }
    }

    fn centroid(&self) -> f64 {
        let first = self.top.saturating_sub(1);
        let last = (self.top + 1).min(self.counts.len() - 1);
        let (mut sum, mut moment) = (1e-9, 1e-9 * self.top as f64);
        for bin in first..=last {
            let above = (self.counts[bin] - self.background).max(0.0);
            sum += above;
            moment += above * bin as f64;
        }
        moment / sum + 0.5
    }
}

/// The share of the pulse in each bin from `first` on, and its derivative by the position.
fn share(shares: &mut [(f64, f64)], first: usize, position: f64, sigma: f64) {
    let at = |bin: usize| {
        let z = (bin as f64 - position) / sigma;
        let density = (-z * z / 2.0).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt());
        (normal::below(z), density)
    };
    let mut start = at(first);
    for (bin, share) in (first..).zip(shares) {
        let end = at(bin + 1);
        *share = (end.0 - start.0, start.1 - end.1);
        start = end;
    }
}

/// A Gaussian that was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Its photons.
    pub amplitude: f64,
    /// Its centre, in bins from the start of bin 0.
    pub position: f64,
    /// Those of its photons that were recorded.
    recorded: f64,
    likelihood: f64,
    deviance: f64,
    freedom: f64,
}

impl Fit {
    /// Standard deviations that the deviance lies above its expectation.
    #[must_use]
    pub fn deviance_z(&self) -> f64 {
        (self.deviance - self.freedom) / (2.0 * self.freedom.max(1.0)).sqrt()
    }

    /// The root mean square of the residuals as a share of the photons, less shot noise.
    #[must_use]
    pub fn residual_share(&self) -> f64 {
        ((self.deviance - self.freedom).max(0.0) / self.recorded.max(1.0)).sqrt()
    }
}

/// The σ that fits all `windows` best, and the fit of each.
#[must_use]
pub fn best(windows: &[Window]) -> (f64, Vec<Fit>) {
    let of = |log: f64| -total(windows, log.exp());
    // Golden-section search; the likelihood has one maximum if peaks are clear.
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut low, mut high) = (SIGMAS.0.ln(), SIGMAS.1.ln());
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (of(left), of(right));
    while high - low > 1e-4 {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = of(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = of(right);
        }
    }
    let sigma = f64::midpoint(low, high).exp();
    let fits = windows.iter().map(|window| window.fit(sigma)).collect();
    (sigma, fits)
}

fn total(windows: &[Window], sigma: f64) -> f64 {
    let each = windows.iter().map(|window| window.fit(sigma).likelihood);
    each.sum()
}

/// The 95 % interval of `sigma`, from the curvature of the likelihood.
#[must_use]
pub fn interval(windows: &[Window], sigma: f64) -> (f64, f64) {
    let step = 0.02;
    let at = |by: f64| total(windows, sigma * f64::exp(by));
    let curvature = (2.0 * at(0.0) - at(step) - at(-step)) / (step * step);
    // A flat likelihood has no curvature.
    let error = 1.96 / curvature.max(1.0).sqrt();
    (sigma * (-error).exp(), sigma * error.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_light::rates::bin_share;

    #[test]
    fn a_gaussian_without_noise_is_found_again() {
        for (sigma, position) in [(0.5, 20.3), (0.8, 20.98), (1.6, 19.5)] {
            let counts: Vec<f64> = (0..64)
                .map(|bin| 12.0 + 4000.0 * bin_share(bin, position, sigma))
                .collect();
            let window = Window::new((&counts, &[1.0; 64]), 12.0, 100.0, (0, 20, 63));
            let (found, fits) = best(&[window]);
            // Cox and Reid's term moves it by about 1/(2·4000).
            assert!((found / sigma - 1.0).abs() < 2e-3, "{found} for {sigma}");
            assert!((fits[0].position - position).abs() < 1e-3);
            assert!((fits[0].amplitude / 4000.0 - 1.0).abs() < 2e-3);
        }
    }
}
