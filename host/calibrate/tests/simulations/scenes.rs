//! Compares the calibration with the truth of twenty random simulated scenes. It gets only their
//! histograms and laser cycles.

use crate::drawn::{Drawn, false_alarms, observed};
use crate::slow_or_quick;
use dtof_calibrate::{CalibrationOptions, Length, Nearest, Tdc, calibrate};
use dtof_data::photons::histograms::Histograms;
use rayon::prelude::*;

/// The errors of the calibration by scene `number`, and a line about it.
fn judge(number: u64) -> (Vec<String>, String) {
    let drawn = Drawn::new(number);
    let captures = Histograms::of(drawn.capture(number)).unwrap();
    let observed = observed(
        drawn.scene.array().unwrap(),
        &captures,
        Length::Cycles(drawn.cycles),
        drawn.scene.bin_width_ps,
    );
    let options = CalibrationOptions {
        // A wall alone may be a cover glass: the user decides.
        glass: drawn.is_wall_alone().then_some(false),
        target_mm: Some(drawn.wall_mm + drawn.offset_mm),
        ..CalibrationOptions::default()
    };
    let found = calibrate(&observed, &options).unwrap();
    let mut wrong = Vec::new();
    let mut check = |what: &str, is_right: bool, found: String, truth: String| {
        if !is_right {
            wrong.push(format!("scene {number}: {what} {found}, not {truth}"));
        }
    };
    let within = |found: f64, truth: f64, share: f64| (found / truth - 1.0).abs() <= share;

    let background = found.pixels.background;
    let truth = drawn.scene.background;
    let right = within(background, truth, 0.05);
    check(
        "background",
        right,
        format!("{background:.5}"),
        format!("{truth:.5}"),
    );
    let right = found.tdc == Some(Tdc::SeveralHits);
    check(
        "TDC",
        right,
        format!("{:?}", found.tdc),
        "of several hits".to_owned(),
    );
    let sigma = found.pulse.as_ref().map_or(0.0, |pulse| pulse.sigma);
    let truth = drawn.scene.pulse_sigma_bins;
    let right = within(sigma, truth, 0.05);
    check("sigma", right, format!("{sigma:.3}"), format!("{truth:.3}"));
    let end = drawn.glass_end();
    let right = found.gate.0.abs_diff(end) <= 1;
    check("gate", right, found.gate.0.to_string(), end.to_string());
    let are_hot = match drawn.shows_in_hot {
        true => found.pixels.hot.iter().all(|hot| drawn.hot.contains(hot)),
        false => found.pixels.hot == drawn.hot,
    };
    let right = are_hot && found.pixels.dead == drawn.dead;
    let named = format!("{:?} {:?}", found.pixels.hot, found.pixels.dead);
    check(
        "pixels",
        right,
        named,
        format!("{:?} {:?}", drawn.hot, drawn.dead),
    );
    let offset = found.offset.map_or(f64::NAN, |offset| offset.mm);
    let bins = (offset - drawn.offset_mm) / drawn.scene.mm_per_bin();
    let right = bins.abs() <= 0.1;
    check(
        "offset",
        right,
        format!("{bins:.3} bins off"),
        "0.1".to_owned(),
    );
    let glass = match &found.nearest {
        Nearest::Glass(glass) => glass.photons,
        _ => 0.0,
    };
    if let (Some(truth), Nearest::Glass(glass)) = (&drawn.scene.effects.cover_glass, &found.nearest)
    {
        let (low, high) = glass.photons_between;
        // A gate that is not needed needs no glass.
        let right = end == 0 || (0.97 * low..=1.03 * high).contains(&truth.signal);
        check(
            "glass",
            right,
            format!("{low:.4} to {high:.4}"),
            format!("{:.4}", truth.signal),
        );
    }
    let detection = found.detection;
    let share = false_alarms(&found, truth_of(&drawn));
    let right = (0.7..=1.3).contains(&(share / 0.01));
    check(
        "false alarms",
        right,
        format!("{share:.4}"),
        "0.0100".to_owned(),
    );
    let line = format!(
        "{number:>2} {:>3} bins {:>3} pixels {:>6} cycles B {:.4} {:+.1}% sigma {:.2} {:+.1}% gate {} ({end}) glass {glass:.3} \
         ({:.3}) offset {bins:+.3} window {} z {:.3} L1 {} false {share:.4}",
        drawn.scene.bins,
        drawn.scene.array().unwrap().pixels(),
        drawn.cycles,
        drawn.scene.background,
        (background / drawn.scene.background - 1.0) * 100.0,
        drawn.scene.pulse_sigma_bins,
        (sigma / drawn.scene.pulse_sigma_bins - 1.0) * 100.0,
        found.gate.0,
        drawn
            .scene
            .effects
            .cover_glass
            .as_ref()
            .map_or(0.0, |glass| glass.signal),
        detection.window,
        detection.z.unwrap_or(0.0),
        detection.l1,
    );
    (wrong, line)
}

fn truth_of(drawn: &Drawn) -> f64 {
    drawn.scene.background
}

#[test]
fn random_scenes_are_calibrated_within_the_stated_limits() {
    // Four fast ones: with and without a cover glass, hot pixels and nearer surfaces.
    let scenes = slow_or_quick((0..20).collect(), vec![2, 6, 12, 14]);
    let all: Vec<(Vec<String>, String)> = scenes.into_par_iter().map(judge).collect();
    for (_, line) in &all {
        println!("{line}");
    }
    let wrong: Vec<String> = all.into_iter().flat_map(|scene| scene.0).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_wall_alone_is_a_wall() {
    let number = (0..100).find(|&number| Drawn::new(number).is_wall_alone());
    let drawn = Drawn::new(number.unwrap());
    let captures = Histograms::of(drawn.capture(1)).unwrap();
    let observed = observed(
        drawn.scene.array().unwrap(),
        &captures,
        Length::Cycles(drawn.cycles),
        drawn.scene.bin_width_ps,
    );
    let with = |glass| {
        let options = CalibrationOptions {
            glass,
            ..CalibrationOptions::default()
        };
        calibrate(&observed, &options).unwrap()
    };
    let wall = (drawn.wall_mm / drawn.scene.mm_per_bin()).floor();
    let is_wall = |bin: usize| (bin as f64 - wall).abs() <= 1.0;
    let Nearest::Wall(bin) = with(None).nearest else {
        panic!("without the option");
    };
    assert!(is_wall(bin));
    let wall = with(Some(false));
    assert_eq!(wall.nearest, Nearest::Wall(bin));
    assert_eq!(wall.gate.0, 0);
    let Nearest::Glass(glass) = with(Some(true)).nearest else {
        panic!("with the option");
    };
    assert!(is_wall(glass.top));
}
