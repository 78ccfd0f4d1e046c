//! The half widths of the depth window before and after a pulse that is not Gaussian.
//!
//! A few photons are drawn from each peak, and the estimator of the core places them with every pair of
//! half widths. The pair with the least mean error wins. Errors are against the position that the widest
//! window gives all photons of the peak, which hardly depends on how the pulse lies in its bins. An error
//! that all peaks share does not count: it becomes part of the range offset.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{CentredWindow, Histogram, RangeGate};
use dtof_data::random::trial_rng;
use rand_distr::{Distribution, StandardUniform};

use super::offset::place;
use super::shape::{ABOUT, Window};
use super::significance::median;

/// Photons of the pulse that are drawn. From 8 to 100, the same pair is the best for a TMF8820.
const PHOTONS: f64 = 16.0;
/// Draws for each pair of half widths.
const DRAWS: usize = 8192;
/// Half widths are tried in steps of 64/256 bin.
const STEP: usize = 64;
/// An asymmetric window must have less than this share of the error of a symmetric one.
const GAIN: f64 = 0.97;

/// No side of an asymmetric window is narrower. A narrower one draws places to the ends of their bin, which peaks that all
/// lie alike in their bins do not show.
const NARROWEST: U8F8 = U8F8::lit("1.5");

/// An asymmetric window that is better for a pulse than any symmetric one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AsymmetricWindow {
    /// The window.
    pub window: CentredWindow,
    /// Mean absolute error of 16 photons of the pulse, in bins.
    pub error: f64,
    /// The same with the best symmetric window.
    pub symmetric: f64,
}

/// Photons that were drawn from a peak and its background, and the position of the whole peak.
struct Draw {
    histogram: Histogram<ABOUT>,
    background: U24F8,
    position: f64,
}

/// The best window for these peaks, whose core has the standard deviation `sigma` bins; `None` if a
/// symmetric one is as good.
#[must_use]
pub fn asymmetric_window(peaks: &[Window], sigma: U8F8, seed: u64) -> Option<AsymmetricWindow> {
    let each = DRAWS.div_ceil(peaks.len().max(1));
    let mut draws = Vec::with_capacity(each * peaks.len());
    for (trial, peak) in (0..).zip(peaks) {
        draw(&mut draws, peak, each, (seed, trial));
    }
    let error = |window: CentredWindow| {
        let errors = draws.iter().map(|draw| {
            let peak = draw.histogram.peak();
            let gate = RangeGate::full();
            let depth = window.estimate(&draw.histogram, &gate, peak, draw.background);
            f64::from(peak.bin.raw()) + f64::from(depth.offset.raw()) / 256.0 - draw.position
        });
        let errors: Vec<f64> = errors.collect();
        let off = median(errors.iter().copied());
        let sum: f64 = errors.iter().map(|error| (error - off).abs()).sum();
        sum / errors.len().max(1) as f64
    };
    let core = CentredWindow::for_pulse(sigma);
    let widths = || {
        let bits = CentredWindow::MIN.to_bits()..=CentredWindow::MAX.to_bits();
        bits.step_by(STEP).map(U8F8::from_bits)
    };
    let pairs = widths().flat_map(|before| widths().map(move |after| (before, after)));
    let windows = pairs.filter_map(|(before, after)| CentredWindow::with_sides(before, after));
    let (mut symmetric, mut best) = (error(core), (f64::INFINITY, core));
    for window in windows {
        let error = error(window);
        if window.before() == window.after() {
            symmetric = symmetric.min(error);
        } else if error < best.0 && window.before().min(window.after()) >= NARROWEST {
            best = (error, window);
        }
    }
    let (error, window) = best;
    (error < GAIN * symmetric).then_some(AsymmetricWindow {
        window,
        error,
        symmetric,
    })
}

/// Draws photons of one peak `each` times.
fn draw(draws: &mut Vec<Draw>, peak: &Window, each: usize, seed: (u64, u16)) {
    let counts = &peak.about_top;
    let mut below: Vec<f64> = Vec::with_capacity(counts.len());
    let mut all = 0.0;
    for count in counts {
        all += count;
        below.push(all);
    }
    let signal = all - peak.background * counts.len() as f64;
    if signal <= 0.0 {
        return;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let photons = (PHOTONS * all / signal).round().min(4e3) as usize;
    let widest = CentredWindow::new(CentredWindow::MAX);
    let Some(position) = widest.map(|widest| place(counts, &RangeGate::<ABOUT>::full(), widest))
    else {
        return;
    };
    let background = peak.background * photons as f64 / all;
    let mut rng = trial_rng(seed.0, seed.1);
    for _ in 0..each {
        let mut histogram = Histogram::new();
        for _ in 0..photons {
            let place: f64 = StandardUniform.sample(&mut rng);
            let bin = below.partition_point(|&below| below <= place * all);
            histogram.add(u16::try_from(bin).unwrap_or(u16::MAX));
        }
        draws.push(Draw {
            histogram,
            background: U24F8::saturating_from_num(background),
            position,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_light::counts::normal;

    const SIGMA: f64 = 0.7;

    /// A pulse `number` sixteenths of a bin after the start of bin 20; its standard deviation is `SIGMA`
    /// before its top and `fall` after it.
    fn counts(number: u32, fall: f64) -> Vec<f64> {
        let below = |z: f64| {
            let sigma = if z < 0.0 { SIGMA } else { fall };
            2.0 / (SIGMA + fall) * sigma * (normal::below(z / sigma) - 0.5)
        };
        let place = 20.0 + f64::from(number) / 16.0;
        let share = |bin: u32| below(f64::from(bin + 1) - place) - below(f64::from(bin) - place);
        (0..64).map(|bin| 12.0 + 4000.0 * share(bin)).collect()
    }

    /// Peaks at all positions within a bin.
    fn peaks(fall: f64) -> Vec<Window> {
        let of = |number| {
            Window::new(
                (&counts(number, fall), &[1.0; 64]),
                12.0,
                100.0,
                (0, 20, 63),
            )
        };
        (0..16).map(of).collect()
    }

    #[test]
    fn a_symmetric_pulse_has_a_symmetric_window() {
        assert_eq!(
            asymmetric_window(&peaks(SIGMA), U8F8::from_num(SIGMA), 1),
            None
        );
    }

    /// The sum of two Gaussians with one centre is symmetric, but not a Gaussian.
    #[test]
    fn a_symmetric_pulse_with_tails_has_a_symmetric_window() {
        let of = |number: u32| {
            let place = 20.0 + f64::from(number) / 16.0;
            let share = |bin: u32| {
                let of = |sigma: f64| {
                    let z = (f64::from(bin) - place) / sigma;
                    normal::below(z + 1.0 / sigma) - normal::below(z)
                };
                0.6 * of(0.4) + 0.4 * of(2.6)
            };
            let counts: Vec<f64> = (0..64).map(|bin| 12.0 + 4000.0 * share(bin)).collect();
            Window::new((&counts, &[1.0; 64]), 12.0, 100.0, (0, 20, 63))
        };
        let peaks: Vec<Window> = (0..16).map(of).collect();
        for seed in 1..7 {
            assert_eq!(
                asymmetric_window(&peaks, U8F8::from_num(0.5), seed),
                None,
                "{seed}"
            );
        }
    }

    /// Crosstalk nearby with ten times the photons changes nothing.
    #[test]
    fn other_peaks_change_nothing() {
        let alone = peaks(2.5 * SIGMA);
        let with_glass: Vec<Window> = (0..16u32)
            .map(|number| {
                let mut counts = counts(number, 2.5 * SIGMA);
                counts[8] += 40_000.0;
                Window::new((&counts, &[1.0; 64]), 12.0, 100.0, (11, 20, 63))
            })
            .collect();
        let found = asymmetric_window(&with_glass, U8F8::from_num(SIGMA), 1).unwrap();
        let alone = asymmetric_window(&alone, U8F8::from_num(SIGMA), 1).unwrap();
        assert!(
            (found.error / alone.error - 1.0).abs() < 0.05,
            "{found:?} {alone:?}"
        );
        assert!(found.window.after() > found.window.before() + U8F8::ONE);
    }

    #[test]
    fn a_pulse_that_falls_slowly_has_a_wider_window_after_its_top() {
        let peaks = peaks(2.5 * SIGMA);
        for seed in 1..4 {
            let found = asymmetric_window(&peaks, U8F8::from_num(SIGMA), seed).unwrap();
            let window = found.window;
            assert!(window.after() > window.before() + U8F8::ONE, "{window:?}");
            assert!(found.error < 0.95 * found.symmetric, "{found:?}");
            assert_eq!(
                asymmetric_window(&peaks, U8F8::from_num(SIGMA), seed),
                Some(found)
            );
        }
    }

    /// A wall has all its peaks at one place within a bin. The window has to suit all places.
    #[test]
    fn places_within_a_bin_differ_little() {
        let mut found = 0;
        for number in [0, 4, 8, 12] {
            for fall in [1.5, 2.0, 3.0].map(|times| times * SIGMA) {
                let counts = |number| counts(number, fall);
                let peak = Window::new((&counts(number), &[1.0; 64]), 12.0, 100.0, (0, 20, 63));
                let Some(best) = asymmetric_window(&[peak], U8F8::from_num(SIGMA), 1) else {
                    continue;
                };
                found += 1;
                let error = |number: u32| {
                    let place = place(&counts(number), &RangeGate::<64>::full(), best.window);
                    place - f64::from(number) / 16.0
                };
                let errors = (0..16).map(error);
                let [least, most] =
                    [f64::min, f64::max].map(|pick| errors.clone().reduce(pick).unwrap());
                assert!(most - least < 0.2, "{best:?}: {least} to {most}");
            }
        }
        assert!(found > 4, "{found}");
    }

    #[test]
    fn without_peaks_there_is_no_window() {
        assert_eq!(asymmetric_window(&[], U8F8::ONE, 1), None);
        let empty = Window::new((&[0.0; 64], &[1.0; 64]), 0.0, 1.0, (0, 20, 63));
        assert_eq!(asymmetric_window(&[empty], U8F8::ONE, 1), None);
    }
}
