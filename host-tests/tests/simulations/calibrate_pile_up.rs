//! Pile-up: which TDC a recording comes from, and rates that are corrected for it.

use crate::calibration::recorded;
use crate::slow_or_quick;
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Observed, Tdc, calibrate};
use dtof_simulate::scene::Scene;

fn found(background: f64, more: &str, length: impl Fn(u64) -> Length) -> Calibration {
    let text = format!(
        "columns = 8\nrows = 4\nbackground = {background:?}\npulse_sigma_bins = 0.9\n\
         [[surface]]\nposition_bins = 70.3\nsignal = 0.3\n\
         [[surface]]\nposition_bins = 40.8\nsignal = 0.3\nrectangle = {{ columns = [0, 3], rows = [0, 4] }}\n\
         {more}\n"
    );
    let scene = Scene::parse(&text).unwrap();
    let captures = [recorded(&scene, 20_000, 4)];
    let observed = Observed {
        array: scene.array().unwrap(),
        captures: &captures,
        length: length(20_000),
        cycles: None,
        bin_width_ps: 250.0,
        truth_mm: None,
    };
    calibrate(&observed, &CalibrationOptions::default()).unwrap()
}

#[test]
fn a_tdc_of_one_hit_is_recognised_and_its_rates_are_corrected() {
    for &background in slow_or_quick(&[0.003, 0.01, 0.02][..], &[0.02]) {
        let found = found(background, "[tdc]\nhits_per_cycle = 1", Length::Cycles);
        let Some(Tdc::OneHit(lost)) = found.tdc else {
            panic!("{background}: {:?}", found.tdc);
        };
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
    let found = found(0.00001, "", Length::Cycles);
    assert!(
        matches!(found.tdc, Some(Tdc::Unclear(_))),
        "{:?}",
        found.tdc
    );
}
