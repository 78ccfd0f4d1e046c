//! Crosstalk of the cover glass: gates that exclude it, crosstalk with a tail, and crosstalk that grows.

use crate::drawn::{events, observed, recorded};
use crate::slow_or_quick;
use dtof_calibrate::{
    Calibration, CalibrationOptions, Change, Length, Nearest, RunPhotons, calibrate, glass_change,
};
use dtof_data::photons::histograms::Histograms;
use dtof_engine::settings::SettingsFile;
use dtof_light::scene::Scene;

/// A wall, two nearer surfaces and the cover glass. A bin is 37.5 mm.
fn scene(background: f64, glass: f64, more: &str) -> Scene {
    let text = format!(
        "columns = 16\nrows = 8\nbackground = {background:?}\npulse_sigma_bins = 0.8\n\
         [[surface]]\nposition_bins = 90.3\nsignal = 0.2\n\
         [[surface]]\nposition_bins = 60.8\nsignal = 0.25\nrectangle = {{ columns = [0, 5], rows = [0, 8] }}\n\
         [[surface]]\nposition_bins = 40.1\nsignal = 0.3\nrectangle = {{ columns = [8, 12], rows = [2, 7] }}\n\
         [cover_glass]\nsignal = {glass:?}\nposition_bins = 5.3\n{more}\n"
    );
    Scene::parse(&text).unwrap()
}

fn found(scene: &Scene, cycles: u64, seed: u64) -> Calibration {
    let captures = Histograms::of(recorded(scene, cycles, seed)).unwrap();
    let observed = observed(
        scene.array().unwrap(),
        &captures,
        Length::Cycles(cycles),
        250.0,
    );
    calibrate(&observed, &CalibrationOptions::default()).unwrap()
}

#[test]
fn a_glass_ten_times_the_signal_leaves_no_false_events() {
    for &background in slow_or_quick(&[0.005, 0.05][..], &[0.05]) {
        let scene = scene(background, 2.5, "");
        let found = found(&scene, 20_000, 1);
        let settings = found.settings(SettingsFile::default()).unwrap();
        let (all, wrong) = events(&scene, &settings, 10_000);
        println!("background {background}: {wrong} of {all} events are false");
        assert!(all > 2000, "{all}");
        assert!(100 * wrong <= all, "{wrong} of {all}");
        // Without the gate only the glass is reported.
        let mut open = settings;
        open.sensor.gate = None;
        let (all, wrong) = events(&scene, &open, 2000);
        assert!(10 * wrong > 9 * all, "{wrong} of {all}");
    }
}

/// The rate of crosstalk with a tail in a bin, by its formula: a Gaussian convolved with an
/// exponential, integrated numerically over the bin.
fn with_tail(bin: u16, position: f64, sigma: f64, share: f64, decay: f64) -> f64 {
    let gaussian = |x: f64| (-x * x / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let below = |x: f64| libm::erfc(-x / std::f64::consts::SQRT_2) / 2.0;
    let steps = 50;
    let density = |t: f64| {
        let z = (t - position) / sigma;
        let late = (sigma / decay - z) * sigma / decay - (sigma / decay).powi(2) / 2.0;
        (1.0 - share) * gaussian(z) / sigma + share / decay * late.exp() * below(z - sigma / decay)
    };
    let middles =
        (0..steps).map(|step| f64::from(bin) + (f64::from(step) + 0.5) / f64::from(steps));
    middles.map(density).sum::<f64>() / f64::from(steps)
}

#[test]
fn a_glass_with_a_long_tail_ends_where_its_photons_do() {
    let (share, decay) = (0.3, 6.0);
    let tail = format!("[tail]\nshare = {share:?}\ndecay_bins = {decay:?}");
    let scene = scene(0.02, 2.0, &tail);
    let matters = |bin: &u16| {
        2.0 * 2000.0 * with_tail(*bin, 5.3, 0.8, share, decay) >= 0.5 * (0.02f64 * 2000.0).sqrt()
    };
    let end = (0..128).rev().find(matters).unwrap() + 1;
    for seed in 3..slow_or_quick(6, 4) {
        let found = found(&scene, 40_000, seed);
        let Nearest::Glass(glass) = &found.nearest else {
            panic!("{:?}", found.nearest);
        };
        println!("ends at {end}, found {} {:?}", glass.end, glass.end_between);
        assert!(glass.has_tail);
        assert!(
            found.gate.0.abs_diff(end) <= 1,
            "{} for {end}",
            found.gate.0
        );
    }
}

/// After pile-up all pixels hold more photons in near bins than in far ones, also where nothing is near. The first bins may
/// not have been measured.
#[test]
fn a_near_surface_after_pile_up_is_no_glass() {
    let near = |at| {
        format!(
            "[[surface]]\nposition_bins = {at}\nsignal = 0.3\nrectangle = {{ columns = [0, 10], rows = [0, 24] }}"
        )
    };
    let glass = |at, signal| format!("[cover_glass]\nposition_bins = {at}\nsignal = {signal}");
    for (nearest, unmeasured, top) in [
        (near(12.3), 0, None),
        (near(12.3), 4, None),
        (glass(12.3, 0.3), 0, Some(12)),
        (glass(12.3, 0.3), 4, Some(12)),
        (glass(12.3, 0.02), 0, Some(12)),
        (glass(3.3, 0.3), 0, Some(3)),
    ] {
        let text = format!(
            "columns = 32\nrows = 24\nbackground = 0.02\n[tdc]\nhits_per_cycle = 1\n\
             [[surface]]\nposition_bins = 80.1\nsignal = 0.3\n\
             [[surface]]\nposition_bins = 60.1\nsignal = 0.3\nrectangle = {{ columns = [0, 20], rows = [0, 24] }}\n\
             {nearest}"
        );
        let scene = Scene::parse(&text).unwrap();
        let mut capture = recorded(&scene, 1000, 1);
        for counts in &mut capture {
            counts[..unmeasured].fill(0);
        }
        let captures = Histograms::of(capture).unwrap();
        let observed = observed(scene.array().unwrap(), &captures, Length::Unknown, 250.0);
        let found = calibrate(&observed, &CalibrationOptions::default()).unwrap();
        let found_top = found.glass().map(|glass| glass.top);
        assert_eq!(found_top, top, "{nearest} {:?}", found.nearest);
    }
}

#[test]
fn one_pixel_cannot_tell_a_glass_from_a_near_surface() {
    let text = "background = 0.02\n[[surface]]\nposition_bins = 60\nsignal = 0.3\n\
                [cover_glass]\nsignal = 1\nposition_bins = 5";
    let scene = Scene::parse(text).unwrap();
    let found = found(&scene, 20_000, 1);
    assert!(
        matches!(found.nearest, Nearest::Unclear(layer) if (4..=5).contains(&layer.bin)),
        "{:?}",
        found.nearest
    );
    assert_eq!(found.gate.0, 0);
}

/// All photons of a run, summed over pixels.
fn summed(capture: &[Vec<u64>]) -> Vec<u64> {
    let mut sums = vec![0; 128];
    for counts in capture {
        for (sum, count) in sums.iter_mut().zip(counts) {
            *sum += count;
        }
    }
    sums
}

/// How the crosstalk in a run of `scene` differs from that in `settings`.
fn change(scene: &Scene, settings: &SettingsFile, cycles: u64, seed: u64) -> Change {
    let bins = summed(&recorded(scene, cycles, seed));
    let run = RunPhotons {
        bins: &bins,
        cycles,
        pixels: 128,
    };
    let sensor = &settings.sensor;
    let (first, _) = sensor.gate.unwrap();
    glass_change(&run, sensor.glass_bins.as_ref().unwrap(), first)
}

#[test]
fn a_glass_that_got_brighter_is_flagged_and_nothing_else_is() {
    let glass = 2.0;
    let calibrated = scene(0.02, glass, "");
    let settings = found(&calibrated, 20_000, 5)
        .settings(SettingsFile::default())
        .unwrap();
    for seed in 0..slow_or_quick(10, 1) {
        let now = |scene: &Scene| change(scene, &settings, 4000, 100 + seed);
        match now(&scene(0.02, 1.3 * glass, "")) {
            Change::Brighter(factor, least) => {
                assert!(
                    (factor - 1.3).abs() < 0.03 && least > 1.1,
                    "{factor} {least}"
                );
            }
            other => panic!("30 % brighter: {other:?}"),
        }
        assert!(matches!(
            now(&scene(0.02, 0.7 * glass, "")),
            Change::Dimmer(..)
        ));
        // Other ambient light, darker or ten times as bright.
        for background in [0.0, 0.005, 0.1, 0.2] {
            let found = now(&scene(background, glass, ""));
            assert!(matches!(found, Change::Same(_)), "{background}: {found:?}");
        }
        // A bright target in front of the gate in eight of 128 pixels.
        for position in [3.2, 5.3, 6.9] {
            let near = format!(
                "[[surface]]\nposition_bins = {position:?}\nsignal = 3\n\
                 rectangle = {{ columns = [4, 6], rows = [0, 4] }}"
            );
            let found = now(&scene(0.02, glass, &near));
            assert!(
                !matches!(found, Change::Brighter(..) | Change::Dimmer(..)),
                "{position}: {found:?}"
            );
        }
    }
    // Twenty laser cycles are too few.
    let dim = scene(0.2, 0.05, "");
    let settings = SettingsFile {
        sensor: dtof_engine::settings::SensorSettings {
            glass_bins: Some(vec![0.0, 0.0, 0.001, 0.01, 0.02, 0.015, 0.004]),
            gate: Some((8, 127)),
            ..dtof_engine::settings::SensorSettings::default()
        },
        ..SettingsFile::default()
    };
    assert_eq!(change(&dim, &settings, 20, 1), Change::NotSure);
}
