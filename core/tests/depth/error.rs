//! The error of the depth estimators against the Cramér–Rao bound.
//!
//! The bound is that of a Gaussian pulse of known width in bins of Poisson counts, with
//! its amplitude and the background a bin unknown. Of the histograms those are left out in
//! which the highest bin is not of the pulse. Shown with `--nocapture`.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{CentredWindow, DepthEstimator, Histogram, RangeGate};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const BINS: usize = 128;
/// Sub-bin positions, evenly spread.
const POSITIONS: u32 = 16;
/// Histograms for each of these.
const TRIALS: u32 = 250;
const SIGMAS: [f64; 7] = [0.4, 0.5, 0.6, 0.8, 1.0, 1.25, 1.5];
const SIGNALS: [f64; 3] = [30.0, 80.0, 200.0];
const BACKGROUNDS: [f64; 4] = [0.05, 0.5, 2.0, 5.0];

/// The standard normal distribution function.
fn normal(x: f64) -> f64 {
    libm::erfc(-x / std::f64::consts::SQRT_2) / 2.0
}

fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// The share of the pulse in bin `bin`, and its derivative by the position.
fn share(bin: usize, position: f64, sigma: f64) -> (f64, f64) {
    let left = (bin as f64 - position) / sigma;
    let right = left + 1.0 / sigma;
    let derivative = (density(left) - density(right)) / sigma;
    (normal(right) - normal(left), derivative)
}

/// The share of a pulse in each bin at a position, and its derivative by the position.
type Pulse<'a> = &'a dyn Fn(usize, f64) -> (f64, f64);

/// The least variance of an unbiased estimate of the position, in bins².
fn bound(pulse: Pulse, position: f64, signal: f64, background: f64) -> f64 {
    // Fisher information of position, amplitude and background.
    let mut f = [[0.0; 3]; 3];
    for bin in 0..BINS {
        let (share, derivative) = pulse(bin, position);
        let gradient = [signal * derivative, share, 1.0];
        let mean = signal * share + background;
        for (row, a) in f.iter_mut().zip(gradient) {
            for (cell, b) in row.iter_mut().zip(gradient) {
                *cell += a * b / mean;
            }
        }
    }
    let minor = f[1][1] * f[2][2] - f[1][2] * f[2][1];
    let determinant = f[0][0] * minor - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
        + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
    minor / determinant
}

fn uniform(rng: &mut Pcg64Mcg) -> f64 {
    (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0
}

fn poisson(rng: &mut Pcg64Mcg, mean: f64) -> u32 {
    if mean > 40.0 {
        return poisson(rng, mean / 2.0) + poisson(rng, mean / 2.0);
    }
    let limit = (-mean).exp();
    let (mut product, mut count) = (uniform(rng), 0);
    while product > limit {
        product *= uniform(rng);
        count += 1;
    }
    count
}

/// What counts as an error: all, or all but what an estimator is off by in the mean.
#[derive(Clone, Copy, PartialEq)]
enum Off {
    Counts,
    IsKnown,
}

/// Root mean square error of some estimators over that of the bound.
fn ratios<const N: usize>(
    estimators: [DepthEstimator; N],
    pulse: Pulse,
    reach: f64,
    signal: f64,
    background: f64,
    background_error: f64,
    (off, seed): (Off, u64),
) -> [f64; N] {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (mut least, mut trials, mut sums) = (0.0, 0.0, [[0.0; 2]; N]);
    for number in 0..POSITIONS {
        let position = 63.0 + (f64::from(number) + 0.5) / f64::from(POSITIONS);
        let bound = bound(pulse, position, signal, background);
        let means: [f64; BINS] =
            core::array::from_fn(|bin| background + signal * pulse(bin, position).0);
        for _ in 0..TRIALS {
            let counts: [u32; BINS] = means.map(|mean| poisson(&mut rng, mean));
            let mut histogram = Histogram::<BINS>::new();
            histogram.add_frame(&counts, &RangeGate::full());
            let peak = histogram.peak();
            if (f64::from(peak.bin.raw()) + 0.5 - position).abs() > reach {
                continue;
            }
            let outside: u32 = counts[..56].iter().chain(&counts[72..]).sum();
            let level = f64::from(outside) / 112.0 + background_error;
            let level = U24F8::from_num(level);
            least += bound;
            trials += 1.0;
            for ([sum, square], estimator) in sums.iter_mut().zip(estimators) {
                let depth = estimator.estimate(&histogram, &RangeGate::full(), peak, level);
                let found = f64::from(peak.bin.raw()) + f64::from(depth.offset.raw()) / 256.0;
                *sum += found - position;
                *square += (found - position).powi(2);
            }
        }
    }
    sums.map(|[sum, square]| {
        let known = match off {
            Off::Counts => 0.0,
            Off::IsKnown => sum * sum / trials,
        };
        ((square - known) / least).sqrt()
    })
}

/// Mean and highest ratio over all signals and backgrounds, with a Gaussian pulse.
fn mean_and_highest(estimator: DepthEstimator, sigma: f64, background_error: f64) -> (f64, f64) {
    let (pulse, reach) = (
        |bin, position| share(bin, position, sigma),
        1.0 + 2.0 * sigma,
    );
    let (mut sum, mut highest, mut number) = (0.0, 0.0f64, 0.0);
    for background in BACKGROUNDS {
        for signal in SIGNALS {
            let [ratio] = ratios(
                [estimator],
                &pulse,
                reach,
                signal,
                background,
                background_error,
                (Off::Counts, 7),
            );
            sum += ratio;
            highest = highest.max(ratio);
            number += 1.0;
        }
    }
    (sum / number, highest)
}

/// A ratio from 4000 histograms is uncertain by 1/√8000, 1.1 %; the mean of twelve by a
/// third of that.
#[test]
fn a_centred_window_that_suits_the_pulse_is_near_the_bound() {
    println!("sigma, half width: mean and highest ratio; of the three-bin centre of mass");
    for sigma in SIGMAS {
        let window = CentredWindow::for_pulse(U8F8::from_num(sigma));
        let (mean, highest) = mean_and_highest(DepthEstimator::CentredWindow(window), sigma, 0.0);
        let three = mean_and_highest(DepthEstimator::Centroid3, sigma, 0.0);
        println!(
            "{sigma:4} {:.2}: {mean:.3} {highest:.3}; {:.3} {:.3}",
            window.after(),
            three.0,
            three.1
        );
        assert!(highest < 1.15 + 3.0 * 0.011, "{sigma}: {highest}");
        assert!(
            (0.99..1.07 + 3.0 * 0.0033).contains(&mean),
            "{sigma}: {mean}"
        );
        assert!(mean < three.0, "{sigma}");
    }
}

/// As the paper's rule has it, whose background is a maximum.
#[test]
fn a_background_too_high_costs_little() {
    for sigma in SIGMAS {
        let estimator = DepthEstimator::for_pulse(U8F8::from_num(sigma));
        let right = mean_and_highest(estimator, sigma, 0.0).0;
        let high = mean_and_highest(estimator, sigma, 2.0).0;
        assert!(high < 1.07 * right, "{sigma}: {right} {high}");
    }
}

/// A Gaussian pulse of deviation `sigma` that falls off like an exponential of the mean `tail`, and
/// its derivative.
fn with_tail(bin: usize, position: f64, sigma: f64, tail: f64) -> (f64, f64) {
    let below = |x: f64| {
        let z = x / sigma;
        normal(z)
            - (sigma * sigma / (2.0 * tail * tail) - x / tail).exp() * normal(z - sigma / tail)
    };
    let share = |position: f64| {
        let left = bin as f64 - position;
        below(left + 1.0) - below(left)
    };
    let step = 1e-4;
    let slope = (share(position + step) - share(position - step)) / (2.0 * step);
    (share(position), slope)
}

/// Windows in steps of a quarter bin: the best with two half widths is nearer to the bound than the
/// best with equal ones, and all the more the longer the tail.
#[test]
fn two_half_widths_suit_a_pulse_with_a_tail() {
    println!("sigma, tail: best half widths, ratio to the bound; with equal ones");
    for (sigma, tail, gain) in [(0.5, 0.8, 0.98), (0.5, 1.5, 0.93), (0.7, 1.5, 0.96)] {
        let pulse = |bin, position| with_tail(bin, position, sigma, tail);
        let ratio = |before: u16, after: u16, seed| {
            let sides = [before, after].map(|quarters| U8F8::from_bits(quarters * 64));
            let window = CentredWindow::with_sides(sides[0], sides[1]).unwrap();
            let estimator = DepthEstimator::CentredWindow(window);
            let [ratio] = ratios(
                [estimator],
                &pulse,
                3.0,
                30.0,
                0.2,
                0.0,
                (Off::IsKnown, seed),
            );
            ratio
        };
        let best = |pairs: &mut dyn Iterator<Item = (u16, u16)>| {
            let ratios = pairs.map(|(before, after)| (ratio(before, after, 7), before, after));
            let best = ratios.min_by(|one, other| one.0.total_cmp(&other.0));
            let (_, before, after) = best.unwrap();
            // By other photons than it was chosen with.
            (ratio(before, after, 8), before, after)
        };
        let even = best(&mut (4..=16).map(|half| (half, half)));
        let pairs = (4..=12).flat_map(|before| (8..=16).map(move |after| (before, after)));
        let skew = best(&mut { pairs });
        println!("{sigma} {tail}: {skew:?}; {even:?}, in quarters of a bin");
        assert!(skew.1 < skew.2, "{skew:?}");
        assert!(skew.0 < gain * even.0, "{skew:?} {even:?}");
        assert!(skew.0 < 1.2, "{skew:?}");
    }
}
