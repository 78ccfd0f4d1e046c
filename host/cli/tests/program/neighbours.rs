//! Neighbours confirm, end to end.

use serde_json::Value;

use crate::common::{Scratch, assert_contains};

const SCENE: &str = "
columns = 24
rows = 20
cycles = 2000
background = 0.0005
[[surface]]
signal = 0.03
position_bins = 60.5
";
const WINDOW: &str = "--rule window --sigma-bins 1";

fn simulated(scratch: &Scratch, options: &str) -> Value {
    let scene = scratch.file("scene.toml", SCENE);
    scratch.simulated(&scene, options);
    scratch.summary()
}

/// The laser cycle in which 90 % of the pixels have had an event.
fn most_reported(scratch: &Scratch) -> u64 {
    let mut first = std::collections::BTreeMap::new();
    for event in scratch.events() {
        let cycle: u64 = event[0].parse().unwrap();
        first.entry(event[1].clone()).or_insert(cycle);
    }
    let mut cycles: Vec<u64> = first.into_values().collect();
    cycles.sort_unstable();
    assert_eq!(cycles.len(), 24 * 20);
    cycles[cycles.len() * 9 / 10]
}

#[test]
fn dim_pixels_report_much_sooner() {
    let scratch = Scratch::new();
    let alone = simulated(&scratch, WINDOW);
    let time_alone = most_reported(&scratch);
    assert_eq!(alone["settings"]["neighbours"], Value::Null);
    let together = simulated(&scratch, &format!("{WINDOW} --neighbours 8"));
    let time = most_reported(&scratch);
    assert!(10 * time < 6 * time_alone, "{time} {time_alone}");
    assert_eq!(together["settings"]["neighbours"], 8);
    let events = |summary: &Value| summary["events"].as_u64().unwrap();
    assert!(events(&together) > 3 * events(&alone) / 2);
    let confirmed = scratch
        .events()
        .iter()
        .filter(|event| event[8] == "32")
        .count();
    assert!(2 * confirmed > scratch.events().len());

    // The same settings give the same events.
    let first = scratch.read("out/events.csv");
    scratch.file("again.toml", scratch.read("out/dtof.toml"));
    assert_contains(&scratch.read("out/dtof.toml"), "neighbours = 8");
    simulated(&scratch, "--settings again.toml");
    assert_eq!(scratch.read("out/events.csv"), first);
    // Switched off, those of single pixels come again.
    let off = simulated(&scratch, "--settings again.toml --neighbours 0");
    assert_eq!(events(&off), events(&alone));
    scratch.printed(&format!(
        "simulate --scene scene.toml --out again {WINDOW} --neighbours 4"
    ));
    assert_contains(
        &scratch.read("again/report.html"),
        "4 confirm; half of the false alarms of z for a pixel alone, half with neighbours",
    );
}

#[test]
fn a_scene_whose_tdc_has_a_dead_time_needs_it_left_out() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", format!("{SCENE}[tdc]\nhits_per_cycle = 1\n"));
    let options = "simulate --scene scene.toml --out out --rule window --window 3 --neighbours 8";
    let reason = "--neighbours cannot be used with a dead time; --dead-time 0 leaves it out";
    scratch.refused(&scratch.run(options), &[reason]);
    scratch.printed(&format!("{options} --dead-time 0"));
}

/// `compare` tries methods without neighbours, whatever the settings say.
#[test]
fn settings_with_neighbours_can_be_compared() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", SCENE);
    scratch.file(
        "settings.toml",
        "[detection]\nrule = \"window\"\nwindow = 3\nneighbours = 8\nl2 = 400\n",
    );
    scratch.printed(
        "compare --scene scene.toml --sigma-bins 1 --cycles 600 --settings settings.toml --out out",
    );
    assert_contains(&scratch.read("out/dtof.toml"), "neighbours = ");
}
