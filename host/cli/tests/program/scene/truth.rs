//! Events of a simulated scene against what its pixels saw.

use crate::common::{Scratch, assert_contains};
use dtof_data::options::rows::grouped;

/// The printed line with `name`.
#[track_caller]
fn row<'a>(printed: &'a str, name: &str) -> &'a str {
    let found = printed.lines().find(|line| line.contains(name));
    found.unwrap_or_else(|| panic!("{printed}"))
}

/// The ranges of all events in millimetres.
fn ranges(scratch: &Scratch) -> Vec<f64> {
    let events = scratch.events();
    events
        .iter()
        .map(|event| event[5].parse().unwrap())
        .collect()
}

#[test]
fn events_of_a_moving_target_are_compared_with_the_truth_of_their_laser_cycle() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "cycles = 100_000\nbackground = 0.01\n\
         [[surface]]\nname = \"rocket\"\nrange_mm = 1000\nsignal = 2\nvelocity_m_per_s = 100\n",
    );
    let printed = scratch.simulated(&scene, "");
    let row = |name| row(&printed, name);
    let truth = &scratch.summary()["against_truth"];
    let of = |name: &str| truth[name].as_f64().unwrap();
    assert_eq!(of("false_alarms"), 0.0);
    let rms = of("rms_mm");
    assert!(rms < 30.0 && of("bias_mm").abs() < rms, "{truth}");
    assert!((rms..3.0 * rms).contains(&of("within_95_mm")), "{truth}");
    assert_contains(
        row("rocket, false alarms"),
        " events (0 %), more than 3 bins",
    );
    assert_contains(
        row("rocket, errors of the others"),
        &format!("rms {rms:.1} mm"),
    );
    let ranges = ranges(&scratch);
    let (first, last) = (ranges[0], ranges[ranges.len() - 1]);
    assert!((last - first - 1000.0).abs() < 60.0, "{first} to {last}");
}

#[test]
fn every_event_is_compared_with_the_truth() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 8\nrows = 8\ncycles = 2000\nbackground = 0.05\n\
         [[surface]]\nname = \"wall\"\nrange_mm = 1000\nsignal = 0.3\n",
    );
    let printed = scratch.simulated(&scene, "--alpha 0.5 --l1 4");
    let ranges = ranges(&scratch).into_iter();
    let mut right: Vec<f64> = ranges.map(|range| range - 1000.0).collect();
    let events = right.len();
    // Three bins are 112 mm. True events are nearer than that.
    right.retain(|error| error.abs() < 112.4);
    let false_alarms = events - right.len();
    assert!(false_alarms > 50 && right.len() > 500, "{printed}");

    let summary = scratch.summary();
    let truth = &summary["against_truth"];
    let of = |name: &str| truth[name].as_f64().unwrap();
    let mean = |sum: f64| sum / right.len() as f64;
    let square = |error: &f64| error * error;
    assert_eq!(truth["events"], events);
    assert_eq!(truth["false_alarms"], false_alarms);
    let bias = mean(right.iter().sum());
    assert!((of("bias_mm") - bias).abs() < 0.001, "{truth}");
    let rms = mean(right.iter().map(square).sum()).sqrt();
    assert!((of("rms_mm") - rms).abs() < 0.001, "{truth}");
    right.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let least = right[(right.len() * 95).div_ceil(100) - 1].abs();
    // Rounded up to 1/1024 of a bin of 37.5 mm.
    let within = of("within_95_mm");
    assert!((least - 0.001..least + 0.038).contains(&within), "{truth}");
    assert_eq!(truth["surfaces"][0]["name"], "wall");
    assert_eq!(truth["surfaces"][0]["rms_mm"], truth["rms_mm"]);
    let count = format!("{} of ", grouped(false_alarms as u64));
    assert_contains(row(&printed, "wall, false alarms"), &count);
    // Background is in all bins.
    assert!(truth["cover_glass"].is_null() && !printed.contains("--gate"));
}

#[test]
fn events_without_a_surface_are_false_alarms() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 2\ncycles = 4000\nbackground = 0.05\n\
         [[surface]]\nname = \"post\"\nrange_mm = 1000\nsignal = 1\n\
         rectangle = { columns = [0, 1], rows = [0, 1] }\n",
    );
    let printed = scratch.simulated(&scene, "--alpha 0.5 --l1 4");
    let summary = scratch.summary();
    let of_none = &summary["against_truth"]["surfaces"][1];
    assert_eq!(of_none["name"], "no surface");
    assert!(of_none["events"].as_u64() > Some(5), "{of_none}");
    assert_eq!(of_none["events"], of_none["false_alarms"]);
    assert!(of_none["rms_mm"].is_null());
    // The row of all surfaces.
    let all = row(&printed, "  false alarms");
    let count = summary["against_truth"]["false_alarms"].as_u64().unwrap();
    assert_contains(all, &format!("{} of ", grouped(count)));
}

#[test]
fn a_cover_glass_is_named_with_the_gate_that_leaves_it_out() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 4\nrows = 4\ncycles = 4000\nbackground = 0.02\n\
         [[surface]]\nname = \"wall\"\nrange_mm = 1000\nsignal = 0.5\n\
         [cover_glass]\nsignal = 20\nposition_bins = 4.5\n",
    );
    let printed = scratch.simulated(&scene, "");
    let truth = &scratch.summary()["against_truth"];
    assert!(truth["events"].as_u64() > Some(100), "{truth}");
    assert_eq!(truth["false_alarm_share"], 1.0);
    assert_eq!(truth["cover_glass"]["false_alarms"], truth["events"]);
    assert_eq!(truth["cover_glass"]["bins"], serde_json::json!([1, 7]));
    let (_, gate) = printed.split_once("try --gate ").unwrap();
    let gate = gate.lines().next().unwrap();
    scratch.simulated(&scene, &format!("--gate {gate}"));
    let truth = &scratch.summary()["against_truth"];
    // Background causes one now and then.
    assert!(truth["false_alarm_share"].as_f64() < Some(0.01), "{truth}");
    assert!(truth["events"].as_u64() > Some(100), "{truth}");
    assert!(truth["cover_glass"].is_null());

    // No gate separates a target from the light of the glass.
    let near = scratch.read("scene.toml").replace("1000", "320");
    let near = scratch.file("near.toml", near);
    scratch.simulated(&near, "");
    assert!(scratch.summary()["against_truth"]["cover_glass"].is_null());
}

/// The passive image of the paper's Fig. 8.
#[test]
fn with_the_laser_off_there_is_background_alone() {
    let scratch = Scratch::new();
    let photons = |background: &str| {
        let scene = format!(
            "cycles = 2000\nbackground = {background}\n[cover_glass]\nsignal = 1\nposition_bins = 3\n\
             [[surface]]\nrange_mm = 1000\nsignal = 2\n"
        );
        let scene = scratch.file("scene.toml", scene);
        scratch.simulated(&scene, "--laser-off --quiet");
        let map = scratch.read("out/photon-counts.svg");
        assert_eq!(map.contains("no photon in any pixel"), background == "0");
        scratch.summary()["photons"].as_f64().unwrap()
    };
    assert_eq!(photons("0"), 0.0);
    // 0.05 in each of 128 bins: 12,800, give or take five standard deviations.
    assert!((photons("0.05") - 12_800.0).abs() < 566.0);
}
