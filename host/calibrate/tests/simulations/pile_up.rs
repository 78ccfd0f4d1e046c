//! Pile-up: which TDC a recording comes from, and rates that are corrected for it.

use crate::drawn::{observed, recorded};
use crate::slow_or_quick;
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Tdc, calibrate};
use dtof_core::Array;
use dtof_simulate::scene::Scene;
use rand_core::SeedableRng;
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

/// Flat counts of a TDC without a dead time, with laser cycles that would allow one.
#[test]
fn flat_counts_of_many_bins_have_no_dead_time() {
    let (seeds, pixels, bins) = slow_or_quick((10, 4096, 1024), (1, 256, 256));
    let found = (0u64..seeds).into_par_iter().filter(|&seed| {
        let mut rng = Pcg32::seed_from_u64(seed);
        let poisson = Poisson::new(0.05).unwrap();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small numbers"
        )]
        let mut draw = || poisson.sample(&mut rng) as u64;
        let histogram = |_| (0..bins).map(|_| draw()).collect();
        let captures = [(0..pixels).map(histogram).collect::<Vec<Vec<u64>>>()];
        let array = Array::new(pixels, 1).unwrap();
        let observed = observed(array, &captures, Length::Cycles(100_000), 250.0);
        let found = calibrate(&observed, &CalibrationOptions::default()).unwrap();
        matches!(found.tdc, Some(Tdc::DeadTime { .. }))
    });
    assert_eq!(found.count(), 0);
}
