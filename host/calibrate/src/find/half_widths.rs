//! How far the window of the depth should reach to either side of a pulse that is no Gaussian.
//!
//! What few photons of the pulse come to is tried: some are drawn from each peak, and the
//! estimator of the core places them with every pair of half widths. The pair with the least
//! mean error suits. Its error is from where the widest window places all photons of the peak:
//! that hardly depends on how the pulse lies in its bins. What a pair is off by for all peaks
//! alike does not count: it goes into the offset.

use dtof_core::fixed::types::{U8F8, U24F8};
use dtof_core::{CentredWindow, Histogram, RangeGate};
use dtof_theory::random::trial_rng;
use rand_distr::{Distribution, StandardUniform};

use super::limits::median;
use super::offset::place;
use super::shape::{ABOUT, Window};

/// Photons of the pulse that are drawn. Of 8 to 100 the same pair is the best of the TMF8820.
const PHOTONS: f64 = 16.0;
/// About so many draws for each pair.
const DRAWS: usize = 8192;
/// Half widths are tried in steps of a quarter bin.
const STEP: usize = 64;
/// Another error that is not below this share of that with equal half widths is none.
const BETTER: f64 = 0.97;

/// A window that suits a pulse better than one with equal half widths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suited {
    /// The window.
    pub window: CentredWindow,
    /// What 16 photons of the pulse are off by in the mean, in bins.
    pub error: f64,
    /// The same of the best window with equal half widths.
    pub equal: f64,
}

/// Photons of a peak among its background, and where all of them lie.
struct Drawn {
    histogram: Histogram<ABOUT>,
    background: U24F8,
    position: f64,
}

/// The best half widths for these peaks, whose core has the deviation `sigma`; `None` if equal ones
/// do as well.
#[must_use]
pub fn suited(peaks: &[Window], sigma: U8F8, seed: u64) -> Option<Suited> {
    let each = DRAWS.div_ceil(peaks.len().max(1));
    let mut drawn = Vec::with_capacity(each * peaks.len());
    for (trial, peak) in (0..).zip(peaks) {
        draw(&mut drawn, peak, each, (seed, trial));
    }
    let error = |window: CentredWindow| {
        let errors = drawn.iter().map(|drawn| {
            let peak = drawn.histogram.peak();
            let gate = RangeGate::full();
            let depth = window.estimate(&drawn.histogram, &gate, peak, drawn.background);
            f64::from(peak.bin.raw()) + f64::from(depth.offset.raw()) / 256.0 - drawn.position
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
    let (mut equal, mut best) = (error(core), (f64::INFINITY, core));
    for window in windows {
        let error = error(window);
        if window.before() == window.after() {
            equal = equal.min(error);
        } else if error < best.0 {
            best = (error, window);
        }
    }
    let (error, window) = best;
    (error < BETTER * equal).then_some(Suited {
        window,
        error,
        equal,
    })
}

/// Photons of one peak, `each` times.
fn draw(drawn: &mut Vec<Drawn>, peak: &Window, each: usize, seed: (u64, u16)) {
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
        drawn.push(Drawn {
            histogram,
            background: U24F8::saturating_from_num(background),
            position,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dtof_theory::counts::normal;

    const SIGMA: f64 = 0.7;

    /// A pulse `number` sixteenths of a bin behind bin 20; `fall` is its standard deviation after
    /// the highest place, `SIGMA` that before.
    fn counts(number: u32, fall: f64) -> Vec<f64> {
        let below = |z: f64| {
            let sigma = if z < 0.0 { SIGMA } else { fall };
            2.0 / (SIGMA + fall) * sigma * (normal::below(z / sigma) - 0.5)
        };
        let place = 20.0 + f64::from(number) / 16.0;
        let share = |bin: u32| below(f64::from(bin + 1) - place) - below(f64::from(bin) - place);
        (0..64).map(|bin| 12.0 + 4000.0 * share(bin)).collect()
    }

    /// Peaks at all places in their bins.
    fn peaks(fall: f64) -> Vec<Window> {
        let of = |number| Window::new(&counts(number, fall), 12.0, 100.0, (0, 20, 63));
        (0..16).map(of).collect()
    }

    #[test]
    fn an_even_pulse_has_equal_half_widths() {
        assert_eq!(suited(&peaks(SIGMA), U8F8::from_num(SIGMA), 1), None);
    }

    /// Two Gaussians about one place are no Gaussian, and even.
    #[test]
    fn an_even_pulse_with_tails_has_equal_half_widths() {
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
            Window::new(&counts, 12.0, 100.0, (0, 20, 63))
        };
        let peaks: Vec<Window> = (0..16).map(of).collect();
        for seed in 1..7 {
            assert_eq!(suited(&peaks, U8F8::from_num(0.5), seed), None, "{seed}");
        }
    }

    /// A glass nearby, of ten times the photons, changes nothing.
    #[test]
    fn other_peaks_have_no_part_in_it() {
        let alone = peaks(2.5 * SIGMA);
        let with_glass: Vec<Window> = (0..16u32)
            .map(|number| {
                let mut counts = counts(number, 2.5 * SIGMA);
                counts[8] += 40_000.0;
                Window::new(&counts, 12.0, 100.0, (11, 20, 63))
            })
            .collect();
        let found = suited(&with_glass, U8F8::from_num(SIGMA), 1).unwrap();
        let alone = suited(&alone, U8F8::from_num(SIGMA), 1).unwrap();
        assert!(
            (found.error / alone.error - 1.0).abs() < 0.05,
            "{found:?} {alone:?}"
        );
        assert!(found.window.after() > found.window.before() + U8F8::ONE);
    }

    #[test]
    fn what_falls_slowly_has_a_wider_window_after_its_place() {
        let peaks = peaks(2.5 * SIGMA);
        for seed in 1..4 {
            let found = suited(&peaks, U8F8::from_num(SIGMA), seed).unwrap();
            let window = found.window;
            assert!(window.after() > window.before() + U8F8::ONE, "{window:?}");
            assert!(found.error < 0.95 * found.equal, "{found:?}");
            assert_eq!(suited(&peaks, U8F8::from_num(SIGMA), seed), Some(found));
        }
    }

    #[test]
    fn no_peaks_have_none() {
        assert_eq!(suited(&[], U8F8::ONE, 1), None);
        let empty = Window::new(&[0.0; 64], 0.0, 1.0, (0, 20, 63));
        assert_eq!(suited(&[empty], U8F8::ONE, 1), None);
    }
}
