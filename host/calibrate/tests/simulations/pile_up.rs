//! Pile-up: which TDC a recording comes from, and rates that are corrected for it.

use crate::drawn::{observed, recorded};
use crate::slow_or_quick;
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Tdc, calibrate};
use dtof_core::Array;
use dtof_simulate::scene::Scene;
use rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg32;
use rayon::prelude::*;

fn found(background: f64, more: &str, length: impl Fn(u64) -> Length) -> Calibration {
    let text = format!(
        "columns = 8\nrows = 4\nbackground = {background:?}\npulse_sigma_bins = 0.9\n\
         [[surface]]\nposition_bins = 70.3\nsignal = 0.3\n\
         [[surface]]\nposition_bins = 40.8\nsignal = 0.3\nrectangle = {{ columns = [0, 3], rows = [0, 4] }}\n\
         {more}\n"
    );
    let scene = Scene::parse(&text).unwrap();
    let captures = [recorded(&scene, 20_000, 4)];
    let observed = observed(scene.array().unwrap(), &captures, length(20_000), 250.0);
    calibrate(&observed, &CalibrationOptions::default()).unwrap()
}

#[test]
fn a_tdc_of_one_hit_is_recognised_and_its_rates_are_corrected() {
    for &background in slow_or_quick(&[0.003, 0.01, 0.02][..], &[0.02]) {
        let found = found(background, "[tdc]\nhits_per_cycle = 1", Length::Cycles);
        let Some(Tdc::DeadTime { bins, lost }) = found.tdc else {
            panic!("{background}: {:?}", found.tdc);
        };
        assert_eq!(bins, 128);
        // Each laser cycle with photons counts one of them.
        let all = 128.0 * background + 0.3;
        let truth = 1.0 - -(-all).exp_m1() / all;
        assert!((lost - truth).abs() < 0.01, "{lost} for {truth}");
        let rate = found.pixels.background;
        assert!(
            (rate / background - 1.0).abs() < 0.05,
            "{rate} for {background}"
        );
        let pulse = found.pulse.unwrap();
        assert!((pulse.sigma / 0.9 - 1.0).abs() < 0.05, "{pulse:?}");
        let signal = pulse.signal;
        assert!((signal / 0.3 - 1.0).abs() < 0.05, "{signal}");
    }
}

#[test]
fn a_tdc_of_many_hits_is_not_taken_for_one() {
    for &background in slow_or_quick(&[0.003, 0.02, 0.1][..], &[0.02]) {
        let found = found(background, "", Length::Cycles);
        assert_eq!(found.tdc, Some(Tdc::SeveralHits), "{background}");
    }
}

#[test]
fn without_laser_cycles_the_tdc_is_unknown() {
    let found = found(0.02, "[tdc]\nhits_per_cycle = 1", |_| Length::Unknown);
    assert_eq!(found.tdc, None);
}

#[test]
fn with_hardly_a_photon_either_tdc_is_possible() {
    let found = found(0.000_001, "", Length::Cycles);
    assert!(
        matches!(found.tdc, Some(Tdc::Unclear(_))),
        "{:?}",
        found.tdc
    );
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]
/// Histograms of `pixels` pixels under flat light, of a TDC that is blind for `dead_time` bins.
fn flat(
    rng: &mut Pcg32,
    pixels: usize,
    cycles: u32,
    light: f64,
    dead_time: usize,
) -> Vec<Vec<u64>> {
    const BINS: usize = 128;
    // The chance of a photon in a bin where the TDC is live.
    let hit = -(-light).exp_m1();
    let pixel = |_| {
        let mut counts = vec![0; BINS];
        for _ in 0..cycles {
            let mut bin = 0;
            loop {
                let uniform = (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0;
                bin += (uniform.ln() / (1.0 - hit).ln()) as usize;
                if bin >= BINS {
                    break;
                }
                counts[bin] += 1;
                bin += 1 + dead_time;
            }
        }
        counts
    };
    (0..pixels).map(pixel).collect()
}

fn tdc_of(capture: Vec<Vec<u64>>, cycles: u64) -> Option<Tdc> {
    let array = Array::new(u32::try_from(capture.len()).unwrap(), 1).unwrap();
    let captures = [capture];
    let observed = observed(array, &captures, Length::Cycles(cycles), 250.0);
    calibrate(&observed, &CalibrationOptions::default())
        .unwrap()
        .tdc
}

/// Short dead times, too: their background has a step, and a hole behind each bright bin.
#[test]
fn a_dead_time_is_found_by_itself() {
    let mut rng = Pcg32::seed_from_u64(1);
    for (dead_time, light, cycles) in [
        (128, 0.02, 400),
        (128, 0.047, 400),
        (20, 0.047, 2000),
        (5, 0.05, 4000),
    ] {
        let capture = flat(&mut rng, 64, cycles, light, dead_time);
        let Some(Tdc::DeadTime { bins, .. }) = tdc_of(capture, cycles.into()) else {
            panic!("none of {dead_time} at {light}");
        };
        assert!(
            (dead_time - dead_time / 20..=dead_time).contains(&bins),
            "{bins} of {dead_time}"
        );
    }
}

/// Flat counts of a TDC without a dead time, as sparse and as dense as they come, and with laser cycles
/// that would allow one: at most one recording in a hundred may look as if.
#[test]
fn flat_counts_have_no_dead_time() {
    for (light, bins, pixels, cycles) in [
        (0.05, 1024, 4096, 100_000),
        (0.01, 128, 1024, 100),
        (0.05, 128, 1024, 20),
        (0.3, 128, 256, 100),
        (2.0, 128, 256, 300),
    ] {
        // Each takes a second, for the z of its settings.
        let seeds = if bins > 128 {
            slow_or_quick(10, 3)
        } else {
            slow_or_quick(100, 8)
        };
        let found = (0u64..seeds).into_par_iter().filter(|&seed| {
            let mut rng = Pcg32::seed_from_u64(seed);
            let poisson = Poisson::new(light).unwrap();
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "small numbers"
            )]
            let mut draw = || poisson.sample(&mut rng) as u64;
            let pixels = if bins > 128 {
                slow_or_quick(pixels, 256)
            } else {
                pixels
            };
            let capture: Vec<Vec<u64>> = (0..pixels)
                .map(|_| (0..bins).map(|_| draw()).collect())
                .collect();
            matches!(tdc_of(capture, cycles), Some(Tdc::DeadTime { .. }))
        });
        let found = found.count();
        println!("{light} photons a bin, {cycles} laser cycles: {found} of {seeds}");
        assert!(found <= 1, "{found} of {seeds} at {light}");
    }
}
