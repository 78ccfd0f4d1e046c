//! No single pixel moves what all of them share.

use dtof_calibrate::{CalibrationOptions, Length, Tdc, calibrate};
use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{Array, CentredWindow, Count16, DepthEstimator, Histogram, RangeGate};
use dtof_data::photons::histograms::Histograms;
use dtof_light::rates::bin_share;
use rand_core::SeedableRng;
use rand_distr::{Distribution, Poisson, Uniform};
use rand_pcg::Pcg64;

use super::drawn::observed;
use super::slow_or_quick;

/// 8×8 pixels before surfaces at random ranges, with at least 100 photons a peak, and a tail of this length in bins.
fn draw(rng: &mut Pcg64, tail: f64) -> Vec<Vec<u64>> {
    let mut between = |low: f64, high: f64| Uniform::new(low, high).unwrap().sample(rng);
    // A pulse with a tail rises within a bin.
    let (narrowest, widest) = if tail > 0.0 { (0.3, 0.6) } else { (0.6, 1.6) };
    let (sigma, background) = (between(narrowest, widest), between(0.5, 20.0));
    let brightness = between(150.0, 3000.0);
    let flat = between(0.0, 1.0) < 0.5;
    let wall = between(20.0, 100.0);
    let mut capture = Vec::new();
    for _ in 0..64 {
        let at = if flat { wall } else { between(20.0, 100.0) };
        let signal = brightness * between(0.7, 1.4);
        let mean = |bin: u32| {
            let late = (0..40).map(|late| {
                let share = if tail > 0.0 {
                    (-f64::from(late) / tail).exp()
                } else {
                    0.0
                };
                share * bin_share(bin, at + f64::from(late), sigma)
            });
            let all = if tail > 0.0 {
                1.0 / (1.0 - (-1.0 / tail).exp())
            } else {
                1.0
            };
            let late = if tail > 0.0 {
                late.sum()
            } else {
                bin_share(bin, at, sigma)
            };
            background + signal * late / all
        };
        let means: Vec<f64> = (0..128).map(mean).collect();
        capture.push(
            means
                .into_iter()
                .map(|mean| poisson(mean, between(0.0, 1.0)))
                .collect(),
        );
    }
    capture
}

/// A Poisson number from a uniform one.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn poisson(mean: f64, uniform: f64) -> u64 {
    let mut rng = Pcg64::seed_from_u64(uniform.to_bits());
    Poisson::new(mean).unwrap().sample(&mut rng) as u64
}

/// The window that events would find their depth with.
fn window(capture: &[Vec<u64>], seed: u64) -> CentredWindow {
    let captures = Histograms::of(capture.to_vec()).unwrap();
    let pixels = u32::try_from(capture.len()).unwrap();
    let array = match pixels {
        64 => Array::new(8, 8),
        pixels => Array::new(pixels, 1),
    };
    let observed = observed(array.unwrap(), &captures, Length::Unknown, 250.0);
    let options = CalibrationOptions {
        seed,
        ..CalibrationOptions::default()
    };
    let found = calibrate(&observed, &options).unwrap().detection;
    found
        .half_widths
        .unwrap_or_else(|| CentredWindow::for_pulse(found.sigma_bins))
}

/// The depth of a histogram in bins.
fn depth(counts: &[u64], window: CentredWindow) -> f64 {
    let counts: Vec<u32> = counts
        .iter()
        .map(|&count| u32::try_from(count).unwrap())
        .collect();
    let counts: [u32; 128] = counts.try_into().unwrap();
    let mut histogram = Histogram::<128, Count16>::new();
    histogram.add_frame(&counts, &RangeGate::full());
    let peak = histogram.peak();
    let estimator = DepthEstimator::CentredWindow(window);
    let depth = estimator.estimate(&histogram, &RangeGate::full(), peak, U24F8::ZERO);
    f64::from(peak.bin.raw()) + f64::from(depth.offset.raw()) / 256.0
}

/// The most that the depth of another pixel differs between two windows.
fn moved(capture: &[Vec<u64>], without: usize, one: CentredWindow, other: CentredWindow) -> f64 {
    let others = capture
        .iter()
        .enumerate()
        .filter(|(pixel, _)| *pixel != without);
    let moved = others.map(|(_, counts)| (depth(counts, one) - depth(counts, other)).abs());
    moved.fold(0.0, f64::max)
}

#[test]
fn no_pixel_moves_the_depth_of_the_others() {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut most = 0.0_f64;
    for number in 0..slow_or_quick(200, 12) {
        let capture = draw(&mut rng, 0.0);
        let all = window(&capture, 1);
        for pixel in (0..64).step_by(slow_or_quick(5, 21)) {
            let mut without = capture.clone();
            without.remove(pixel);
            let left_out = moved(&capture, pixel, all, window(&without, 1));
            // A bin that is stuck, at any count.
            let mut stuck = capture.clone();
            let at = Uniform::new(0, 128).unwrap().sample(&mut rng);
            stuck[pixel][at] += 10_u64.pow(2 + number % 5);
            let stuck = moved(&capture, pixel, all, window(&stuck, 1));
            most = most.max(left_out).max(stuck);
            assert!(
                left_out < 0.02 && stuck < 0.02,
                "{number} {pixel}: {left_out} {stuck}"
            );
        }
    }
    println!("at most {most:.4} bins");
}

/// Unequal half widths are for pulses with a tail, whatever one pixel holds.
#[test]
fn half_widths_are_unequal_only_if_the_pulse_is_skewed() {
    let mut rng = Pcg64::seed_from_u64(12);
    let mut skewed = 0;
    for _ in 0..slow_or_quick(100, 10) {
        let symmetric = window(&draw(&mut rng, 0.0), 1);
        assert_eq!(symmetric.before(), symmetric.after());
        let with_tail = window(&draw(&mut rng, 2.0), 1);
        skewed += u32::from(with_tail.after() > with_tail.before() + U8F8::ONE);
    }
    assert!(skewed >= slow_or_quick(90, 9), "{skewed}");
}

/// The dead time may be given: then it is not looked for.
#[test]
fn a_dead_time_that_is_given_holds() {
    let mut rng = Pcg64::seed_from_u64(13);
    let captures = Histograms::of(draw(&mut rng, 0.0)).unwrap();
    let array = Array::new(8, 8).unwrap();
    let observed = observed(array, &captures, Length::Cycles(100_000), 250.0);
    let found = |dead_time| {
        let options = CalibrationOptions {
            dead_time,
            ..CalibrationOptions::default()
        };
        calibrate(&observed, &options).unwrap().tdc.unwrap()
    };
    assert_eq!(found(Some(0)), Tdc::SeveralHits);
    assert!(matches!(found(Some(20)), Tdc::DeadTime { bins: 20, .. }));
    assert!(matches!(found(Some(500)), Tdc::DeadTime { bins: 128, .. }));
}
