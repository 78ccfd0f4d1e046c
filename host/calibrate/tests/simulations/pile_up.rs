//! Pile-up: which TDC a recording comes from, and rates that are corrected for it.

use crate::drawn::{events, observed, recorded};
use crate::slow_or_quick;
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Tdc, calibrate};
use dtof_core::Array;
use dtof_data::photons::histograms::Histograms;
use dtof_engine::settings::SettingsFile;
use dtof_light::scene::Scene;
use rand_core::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg32;
use rayon::prelude::*;

/// The share of the photons that a TDC of one hit loses: each laser cycle with photons counts one of them.
fn lost_of(background: f64) -> f64 {
    let all = 128.0 * background + 0.3;
    1.0 - -(-all).exp_m1() / all
}

fn scene(background: f64, more: &str) -> Scene {
    let text = format!(
        "columns = 8\nrows = 4\nbackground = {background:?}\npulse_sigma_bins = 0.9\n\
         [[surface]]\nposition_bins = 70.3\nsignal = 0.3\n\
         [[surface]]\nposition_bins = 40.8\nsignal = 0.3\nrectangle = {{ columns = [0, 3], rows = [0, 4] }}\n\
         {more}\n"
    );
    Scene::parse(&text).unwrap()
}

fn found(background: f64, more: &str, length: impl Fn(u64) -> Length) -> Calibration {
    found_in(&scene(background, more), length)
}

fn found_in(scene: &Scene, length: impl Fn(u64) -> Length) -> Calibration {
    let captures = Histograms::of(recorded(scene, 20_000, 4)).unwrap();
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
        let truth = lost_of(background);
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
fn without_laser_cycles_one_photon_in_each_still_shows() {
    for &background in slow_or_quick(&[0.003, 0.01, 0.02, 0.04][..], &[0.02]) {
        let found = found(background, "[tdc]\nhits_per_cycle = 1", |_| Length::Unknown);
        let Some(Tdc::OnePhotonIn { cycles, lost }) = found.tdc else {
            panic!("{background}: {:?}", found.tdc);
        };
        let [cycles, lost] = [cycles / 20_000.0, lost / lost_of(background)];
        assert!((cycles - 1.0).abs() < 0.1, "{background}: {cycles}");
        assert!((lost - 1.0).abs() < 0.1, "{background}: {lost}");
    }
    let found = found(0.02, "", |_| Length::Unknown);
    assert_eq!((found.tdc, found.hidden_photons()), (None, None));
}

/// Without a correction depths are right while no more than half of the photons are lost. From there on there is a warning.
#[test]
fn half_of_the_photons_may_be_lost_without_a_warning() {
    for &background in slow_or_quick(&[0.002, 0.004, 0.008, 0.009][..], &[0.008]) {
        let scene = scene(background, "[tdc]\nhits_per_cycle = 1");
        let found = found_in(&scene, |_| Length::Unknown);
        assert_eq!(found.hidden_photons(), None, "{background}");
        let settings = found.settings(SettingsFile::default()).unwrap();
        let (all, wrong) = events(&scene, &settings, 10_000);
        assert!(
            all > 2000 && 100 * wrong < all,
            "{background}: {wrong} of {all}"
        );
    }
    let found = found(0.014, "[tdc]\nhits_per_cycle = 1", |_| Length::Unknown);
    let told = found.hidden_photons().unwrap();
    assert!(told.contains("one photon in each of about "), "{told}");
}

/// In a short recording, too, whether all pixels get as much light or some get more.
#[test]
fn of_a_thousand_laser_cycles_pile_up_shows() {
    for (background, brighter) in [(0.02, 0.0), (0.05, 0.0), (0.005, 0.1)] {
        let surface = |row: u8| {
            format!(
                "[[surface]]\nposition_bins = {}.3\nsignal = {:?}\n\
                 rectangle = {{ columns = [0, 32], rows = [{row}, {}] }}\n",
                40 + row,
                0.3 + brighter * f64::from(row),
                row + 1
            )
        };
        let text = format!(
            "columns = 32\nrows = 24\nbackground = {background}\n[tdc]\nhits_per_cycle = 1\n{}",
            (0..24).map(surface).collect::<String>()
        );
        let scene = Scene::parse(&text).unwrap();
        let captures = Histograms::of(recorded(&scene, 1000, 2)).unwrap();
        let observed = observed(scene.array().unwrap(), &captures, Length::Unknown, 250.0);
        let found = calibrate(&observed, &CalibrationOptions::default()).unwrap();
        let Some(Tdc::OnePhotonIn { cycles, .. }) = found.tdc else {
            panic!("{background}: {:?}", found.tdc);
        };
        assert!((900.0..1100.0).contains(&cycles), "{background}: {cycles}");
    }
}

/// From three photons in four on rates are not right.
#[test]
fn too_many_lost_photons_give_a_warning() {
    let told = |background| {
        let found = found(background, "[tdc]\nhits_per_cycle = 1", Length::Cycles);
        found.hidden_photons()
    };
    assert_eq!(told(0.02), None);
    let told = told(0.04).unwrap();
    assert!(told.starts_with("the TDC loses 8"), "{told}");
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
        let histogram = |_| (0..bins).map(|_| draw()).collect::<Vec<u64>>();
        let captures = Histograms::of((0..pixels).map(histogram)).unwrap();
        let array = Array::new(pixels, 1).unwrap();
        [Length::Cycles(100_000), Length::Unknown]
            .into_iter()
            .any(|length| {
                let observed = observed(array, &captures, length, 250.0);
                let found = calibrate(&observed, &CalibrationOptions::default()).unwrap();
                matches!(
                    found.tdc,
                    Some(Tdc::DeadTime { .. } | Tdc::OnePhotonIn { .. })
                )
            })
    });
    assert_eq!(found.count(), 0);
}
