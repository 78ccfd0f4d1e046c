//! Events of a simulated scene against what its pixels saw.

use crate::common::{Scratch, succeeded};
use dtof::rows::grouped;

#[test]
fn events_of_a_moving_target_are_compared_with_the_truth_of_their_laser_cycle() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "cycles = 100_000\nbackground = 0.01\n\
         [[surface]]\nname = \"rocket\"\nrange_mm = 1000\nsignal = 2\nvelocity_m_per_s = 100\n",
    );
    let printed = succeeded(scratch.simulate(&scene, &[]));
    let row = |name: &str| {
        let found = printed.lines().find(|line| line.contains(name));
        found.unwrap_or_else(|| panic!("{printed}"))
    };
    let truth = &scratch.summary()["against_truth"];
    let of = |name: &str| truth[name].as_f64().unwrap();
    assert_eq!(of("false_alarms"), 0.0);
    assert!(
        of("rms_mm") < 30.0 && of("bias_mm").abs() < of("rms_mm"),
        "{truth}"
    );
    assert!(
        (of("rms_mm")..3.0 * of("rms_mm")).contains(&of("within_95_mm")),
        "{truth}"
    );
    assert!(row("rocket, false alarms").contains(" events (0 %), more than 3 bins"));
    let rms = format!("rms {:.1} mm", of("rms_mm"));
    assert!(
        row("rocket, errors of the others").contains(&rms),
        "{printed}"
    );
    let events = scratch.read("out/events.csv");
    let range = |line: &str| line.split(',').nth(5).unwrap().parse::<f64>().unwrap();
    let first = range(events.lines().nth(1).unwrap());
    let last = range(events.lines().last().unwrap());
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
    let printed = succeeded(scratch.simulate(&scene, &["--alpha", "0.5", "--l1", "4"]));
    let events = scratch.read("out/events.csv");
    let error = |row: &str| row.split(',').nth(5).unwrap().parse::<f64>().unwrap() - 1000.0;
    let errors: Vec<f64> = events.lines().skip(1).map(error).collect();
    // Three bins are 112 mm: what is not false is nearer than that.
    let mut right: Vec<f64> = errors
        .iter()
        .copied()
        .filter(|error| error.abs() < 112.4)
        .collect();
    let false_alarms = errors.len() - right.len();
    assert!(false_alarms > 50 && right.len() > 500, "{printed}");

    let summary = scratch.summary();
    let truth = &summary["against_truth"];
    let of = |name: &str| truth[name].as_f64().unwrap();
    #[allow(clippy::cast_precision_loss)]
    let mean = |sum: f64| sum / right.len() as f64;
    let square = |error: &f64| error * error;
    assert_eq!(truth["events"], errors.len());
    assert_eq!(truth["false_alarms"], false_alarms);
    assert!(
        (of("bias_mm") - mean(right.iter().sum())).abs() < 0.001,
        "{truth}"
    );
    let rms = mean(right.iter().map(square).sum()).sqrt();
    assert!((of("rms_mm") - rms).abs() < 0.001, "{truth}");
    right.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let least = right[(right.len() * 95).div_ceil(100) - 1].abs();
    // Rounded up to 1/1024 of a bin of 37.5 mm.
    assert!(
        (least - 0.001..least + 0.038).contains(&of("within_95_mm")),
        "{truth}"
    );
    assert_eq!(truth["surfaces"][0]["name"], "wall");
    assert_eq!(truth["surfaces"][0]["rms_mm"], truth["rms_mm"]);
    let row = printed
        .lines()
        .find(|line| line.contains("wall, false alarms"))
        .unwrap();
    assert!(
        row.contains(&format!("{} of ", grouped(false_alarms as u64))),
        "{row}"
    );
    // The background lies everywhere.
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
    let output = scratch.simulate(&scene, &["--alpha", "0.5", "--l1", "4"]);
    let summary = scratch.summary();
    let of_none = &summary["against_truth"]["surfaces"][1];
    assert_eq!(of_none["name"], "no surface");
    assert!(of_none["events"].as_u64() > Some(5), "{of_none}");
    assert_eq!(of_none["events"], of_none["false_alarms"]);
    assert!(of_none["rms_mm"].is_null());
    let printed = String::from_utf8(output.stdout).unwrap();
    let all = printed
        .lines()
        .find(|line| line.trim().starts_with("false alarms"));
    let count = &summary["against_truth"]["false_alarms"];
    assert!(
        all.unwrap()
            .contains(&format!("{} of ", grouped(count.as_u64().unwrap()))),
        "{printed}"
    );
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
    let output = scratch.simulate(&scene, &[]);
    let truth = &scratch.summary()["against_truth"];
    assert!(truth["events"].as_u64() > Some(100), "{truth}");
    assert_eq!(truth["false_alarm_share"], 1.0);
    assert_eq!(truth["cover_glass"]["false_alarms"], truth["events"]);
    assert_eq!(truth["cover_glass"]["bins"], serde_json::json!([1, 7]));
    let printed = String::from_utf8(output.stdout).unwrap();
    let (_, gate) = printed.split_once("try --gate ").unwrap();
    let gate = gate.lines().next().unwrap();
    assert!(scratch.simulate(&scene, &["--gate", gate]).status.success());
    let truth = &scratch.summary()["against_truth"];
    // Of the background one now and then.
    assert!(truth["false_alarm_share"].as_f64() < Some(0.01), "{truth}");
    assert!(truth["events"].as_u64() > Some(100), "{truth}");
    assert!(truth["cover_glass"].is_null());

    // Where the target lies in the light of the glass no gate parts them.
    let near = scratch.read("scene.toml").replace("1000", "320");
    let near = scratch.file("near.toml", near);
    assert!(scratch.simulate(&near, &[]).status.success());
    assert!(scratch.summary()["against_truth"]["cover_glass"].is_null());
}
