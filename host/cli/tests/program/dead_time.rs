//! A TDC that is blind for some bins after each photon, end to end.

use std::fmt::Write;
use std::path::PathBuf;

use dtof_data::photons::source::PhotonSource;
use dtof_light::scene::Scene;
use serde_json::Value;

use crate::common::{Scratch, assert_contains, npy};

/// Where the pulse lies in bins.
const PLACE: f64 = 80.3;
const WINDOW: &str = "--rule window --window 3 --sigma-bins 1";

/// 5.5 background photons a laser cycle in 128 bins, and 0.5 of a pulse.
fn scene(tdc: &str) -> String {
    format!(
        "cycles = 20_000\nbackground = 0.043\n[[surface]]\nposition_bins = {PLACE}\nsignal = 0.5\n{tdc}"
    )
}

/// The photons of [`scene`] as a list, of a TDC with a dead time of 100 bins.
fn photons(scratch: &Scratch) -> PathBuf {
    let scene = Scene::parse(&scene("[tdc]\ndead_time_bins = 100\n")).unwrap();
    let mut source = scene.photons(1, scene.cycles).unwrap();
    let slice = source.next_slice(20_000).unwrap();
    let mut text = "pixel,cycle,bin\n".to_owned();
    for photon in &slice.pixels[0].photons {
        writeln!(text, "0,{},{}", photon.cycle, photon.code).unwrap();
    }
    scratch.file("defaults.toml", "");
    scratch.file("photons.csv", text)
}

/// How many events there are, and the share that is more than three bins off.
fn events(scratch: &Scratch) -> (usize, f64) {
    let events = scratch.events();
    let is_wrong = |event: &&Vec<String>| (event[4].parse::<f64>().unwrap() - PLACE).abs() > 3.0;
    let wrong = events.iter().filter(is_wrong).count();
    println!("{wrong} of {} events are wrong", events.len());
    (events.len(), wrong as f64 / events.len() as f64)
}

/// The dead time that was used, and who says it.
fn used(summary: &Value) -> (u64, Option<&str>) {
    let settings = &summary["settings"];
    let bins = settings["dead_time"].as_u64().unwrap();
    (
        bins,
        settings
            .get("dead_time_from")
            .map(|from| from.as_str().unwrap()),
    )
}

#[test]
fn recorded_photons_are_weighed() {
    let scratch = Scratch::new();
    let input = photons(&scratch);
    let options = format!("--settings defaults.toml {WINDOW} --cycles 20000 --dead-time 100");
    let summary = scratch.replayed(&input, &options);
    assert_eq!(used(&summary), (100, Some("settings")));
    let (count, wrong) = events(&scratch);
    assert!(count >= 10 && wrong <= 0.1);
    // Switched off, the near bins look like a target.
    scratch.file("again.toml", scratch.read("out/dtof.toml"));
    scratch.replayed(&input, "--settings again.toml --dead-time 0");
    assert!(scratch.read("out/dtof.toml").contains("dead_time = 0"));
    let (_, wrong) = events(&scratch);
    assert!(wrong > 0.5);
}

/// A full counter before the gate: its exposures end, and are counted.
#[test]
fn what_cannot_be_weighed_is_counted() {
    let scratch = Scratch::new();
    let mut text = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..4000 {
        writeln!(text, "0,{cycle},3").unwrap();
    }
    let input = scratch.file("photons.csv", text);
    scratch.file("defaults.toml", "");
    let options = "--settings defaults.toml --rule window --window 3 --gate 10..127 --dead-time 20";
    let summary = scratch.replayed(&input, options);
    assert_eq!(
        (&summary["ended_full"], &summary["events"]),
        (&3.into(), &0.into())
    );
    let report = scratch.read("out/report.html");
    assert_contains(&report, "exposures ended by a full counter");
    assert_contains(&report, "20 bins after each photon, from the settings");
    // Of the first photon only, all bins of the gate are always blind.
    let summary = scratch.replayed(
        &input,
        &format!("{options} --dead-time 128").replace("--dead-time 20 ", ""),
    );
    assert!(summary["blind_looks"].as_u64().unwrap() > 100, "{summary}");
}

/// Photons of 20,000 laser cycles, as a TDC with a dead time counts them on average.
fn histogram(dead_time: usize) -> [u32; 128] {
    let mut counts = [0_u32; 128];
    for bin in 0..128 {
        let blind: u32 = counts[usize::saturating_sub(bin, dead_time)..bin]
            .iter()
            .sum();
        let from_place = bin as f64 + 0.5 - PLACE;
        let light = 5.5 / 128.0 + 0.5 * 0.4 * (-from_place * from_place / 2.0).exp();
        let share = 1.0 - (-light).exp();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = (f64::from(20_000 - blind) * share).round() as u32;
        counts[bin] = count;
    }
    counts
}

#[test]
fn recorded_histograms_are_weighed() {
    for (dead_time, most) in [(20, 100), (128, 1900)] {
        let scratch = Scratch::new();
        let bytes: Vec<u8> = histogram(dead_time)
            .iter()
            .flat_map(|count| count.to_le_bytes())
            .collect();
        let input = scratch.file("recorded.npy", npy("<u4", "(1, 128)", &bytes));
        scratch.file("defaults.toml", "");
        let options = format!(
            "--settings defaults.toml {WINDOW} --dead-time {dead_time} --cycles 20000 --recorded-cycles"
        );
        let summary = scratch.replayed(&input, &format!("{options} 20000"));
        assert_eq!(summary["not_replayed"], 0);
        let (count, wrong) = events(&scratch);
        assert!(count >= 20_000 / most && wrong <= 0.1, "{dead_time}");
        let replay =
            format!("replay --out no --input recorded.npy {WINDOW} --dead-time {dead_time}");
        let refused = |options: &str, part: &str| {
            let output = scratch.run(&format!("{replay} {options}"));
            let error = String::from_utf8(output.stderr).unwrap();
            assert!(
                !output.status.success() && error.lines().count() == 1,
                "{error}"
            );
            assert_contains(&error, part);
        };
        let few = format!("--dead-time {dead_time}: bin ");
        refused("--recorded-cycles 9000", &few);
        if dead_time == 128 {
            refused("", "--dead-time 128: needs --recorded-cycles");
        }
    }
}

/// A dead time that is found is weighed where it can be, and its photons are drawn with it.
#[test]
fn a_dead_time_that_is_found_is_that_of_calibrate() {
    let scratch = Scratch::new();
    let counts = histogram(20).repeat(16);
    let bytes: Vec<u8> = counts.into_iter().flat_map(u32::to_le_bytes).collect();
    let input = scratch.file("recorded.npy", npy("<u4", "(4, 4, 128)", &bytes));
    let with = |options: &str| {
        let summary = scratch.replayed(&input, &format!("--recorded-cycles 20000 {options}"));
        used(&summary).0
    };
    let bins = with("");
    assert!((18..=22).contains(&bins), "{bins}");
    for options in ["--rule paper", "--binning 1", "--frame 100"] {
        assert_eq!(with(options), 0, "{options}");
    }
    scratch.printed("calibrate recorded.npy --recorded-cycles 20000 --quiet --out found.toml");
    for options in ["", "--estimator centroid"] {
        with(options);
        let alone = scratch.read("out/events.csv");
        let summary = scratch.replayed(
            &input,
            &format!(
                "--recorded-cycles 20000 --settings {} {options}",
                scratch.path("found.toml").display()
            ),
        );
        assert_eq!(used(&summary).0, bins);
        assert!(alone.lines().count() > 100);
        assert_eq!(scratch.read("out/events.csv"), alone, "{options}");
    }
}

#[test]
fn a_scene_says_the_dead_time_of_its_tdc() {
    let scratch = Scratch::new();
    let simulated = |tdc: &str, options: &str| {
        let scene = scratch.file("scene.toml", scene(tdc));
        scratch.simulated(&scene, options);
        let summary = scratch.summary();
        let (bins, from) = used(&summary);
        (bins, from.map(str::to_owned), events(&scratch).1)
    };
    let blind = "[tdc]\ndead_time_bins = 100\n";
    let (bins, from, wrong) = simulated(blind, WINDOW);
    assert_eq!((bins, from.as_deref()), (100, Some("sensor")));
    assert!(wrong <= 0.1);
    // Switched off, the near bins look like a target.
    let (bins, _, wrong) = simulated(blind, &format!("{WINDOW} --dead-time 0"));
    assert!(bins == 0 && wrong > 0.5);
    let (bins, from, _) = simulated(blind, &format!("{WINDOW} --dead-time 9"));
    assert_eq!((bins, from.as_deref()), (9, Some("settings")));
    // Not where it cannot be used, and not where there is none.
    assert_eq!(simulated(blind, "").0, 0);
    assert_eq!(simulated(blind, &format!("{WINDOW} --binning 1")).0, 0);
    let (bins, _, wrong) = simulated("", WINDOW);
    assert!(bins == 0 && wrong <= 0.02);
    let (bins, from, wrong) = simulated("[tdc]\nhits_per_cycle = 1\n", WINDOW);
    assert_eq!((bins, from.as_deref()), (128, Some("sensor")));
    assert!(wrong <= 0.1);
    assert_eq!(simulated("[tdc]\nhits_per_cycle = 2\n", WINDOW).0, 0);
}
