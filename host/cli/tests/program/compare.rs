//! `dtof compare`, end to end.

use std::fmt::Write;
use std::fs;

use crate::common::{Scratch, assert_contains, names, npy};

const SCENE: &str = "columns = 8\nrows = 4\ncycles = 6000\nbackground = 0.02\nlaser_rate_mhz = 2\n\
     [[surface]]\nrange_mm = 2000\nsignal = 0.5\n";
/// The files if the fastest method is another.
const FILES: [&str; 6] = [
    "compare.svg",
    "dtof-fastest.toml",
    "dtof.toml",
    "methods.csv",
    "report.html",
    "stress.csv",
];

/// Four pixels with background and a pulse, each 1.5 bins after the last; the third has no pulse.
fn photons(scratch: &Scratch) {
    let mut text = "pixel,cycle,bin\n".to_owned();
    let mut state = 1u64;
    let mut next = |below: u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) % below
    };
    for cycle in 0..8000 {
        for pixel in 0..4 {
            if pixel != 2 && next(2) == 0 {
                // A triangle of three bins.
                let bin = 40 + 3 * pixel / 2 + next(2) + next(2);
                writeln!(text, "{pixel},{cycle},{bin}").unwrap();
            }
            if next(2) == 0 {
                writeln!(text, "{pixel},{cycle},{}", next(128)).unwrap();
            }
        }
    }
    scratch.file("photons.csv", text);
    scratch.file("short.toml", SHORT);
}

/// Thresholds are simulated for exposures of this length: shorter ones take less time.
const SHORT: &str = "[detection]\nl2 = 400\n";

#[test]
fn a_scene_has_an_answer_that_simulate_takes() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", SCENE);
    let printed = scratch.printed("compare --scene scene.toml --within 12 --out out");
    for part in [
        "32 pixels, 6,000 laser cycles",
        "0.0200 background photons",
        "errors of at most 12.0 mm",
        "instructions a laser cycle and pixel",
        "after more than 4 laser cycles (L1), at the second look",
        "harder conditions               background     signal    hot         cover second\n",
        "     ×2     ×4     ÷2     ÷4  pixel  drift  glass  LiDAR\n",
        "out/dtof.toml has the settings of the method to take.",
    ] {
        assert_contains(&printed, part);
    }
    let window = printed
        .lines()
        .find(|line| line.starts_with("  window of 3  "));
    let cells: Vec<&str> = window.unwrap().split_whitespace().skip(3).collect();
    assert_eq!(cells.len(), 8, "{cells:?}");
    assert!(
        cells[3].starts_with('×') && cells[6] == "fails",
        "{cells:?}"
    );
    assert_contains(&scratch.read("out/report.html"), "<td>fails</td>");
    assert_eq!(names(&scratch.path("out")), FILES);
    scratch.printed("compare --scene scene.toml --within 12 --out again --quiet");
    for name in FILES {
        let read = |folder| fs::read(scratch.path(folder).join(name)).unwrap();
        assert!(read("out") == read("again"), "{name}");
    }
    // The chart shows the values of the table with their unit.
    let table = scratch.read("out/methods.csv");
    let chart = scratch.read("out/compare.svg");
    for part in [
        "window of 3",
        "blocks of 2×2",
        "frames",
        "average of all bins",
    ] {
        assert_contains(&table, part);
        assert_contains(&chart, part);
    }
    for part in ["µs", ">take</text>", ">fastest</text>"] {
        assert_contains(&chart, part);
    }
    let stress = scratch.read("out/stress.csv");
    assert_contains(
        &stress,
        "\"a glass inside the gate, ten times the signal\",no,\"window of 3\"",
    );
    assert_contains(&stress, "\"twice the background\",yes,\"window of 3\"");

    // The settings have the time and the error of the answer.
    scratch.printed("simulate --scene scene.toml --settings out/dtof.toml --seed 77 --out run");
    let summary: serde_json::Value =
        serde_json::from_str(&scratch.read("run/summary.json")).unwrap();
    let truth = &summary["against_truth"];
    let rms = truth["rms_mm"].as_f64().unwrap();
    assert!((9.0..15.0).contains(&rms), "{rms}");
}

#[test]
fn frames_are_no_longer_than_the_photons_last() {
    let scratch = Scratch::new();
    // Frames of each pixel once are enough reports. L2 is 2000.
    let scene = SCENE.replace(
        "columns = 8\nrows = 4\ncycles = 6000",
        "columns = 16\nrows = 8\ncycles = 1000",
    );
    scratch.file("scene.toml", scene);
    let printed = scratch.printed("compare --scene scene.toml --out out");
    let stress = scratch.read("out/stress.csv");
    let frames: Vec<&str> = stress
        .lines()
        .filter(|line| line.contains("\"frames\""))
        .collect();
    assert_eq!(frames.len(), 9, "{stress}");
    assert!(
        frames
            .iter()
            .all(|line| line.contains(",\"frames\",,1000,")),
        "{frames:?}"
    );
    assert!(!frames[0].contains("inf"), "{}", frames[0]);
    let row = printed
        .lines()
        .find(|line| line.starts_with("  frames "))
        .unwrap();
    assert!(row.contains("×1.0"), "{row}");
}

/// A dim wall: blocks are faster than any method that keeps every pixel.
const DIM: &str = "columns = 8\nrows = 6\ncycles = 8000\nbackground = 0.005\nlaser_rate_mhz = 1\n\
     [[surface]]\nrange_mm = 2000\nsignal = 0.06\n";

#[test]
fn the_fastest_method_says_what_resolution_it_leaves() {
    let scratch = Scratch::new();
    scratch.file("dim.toml", DIM);
    let printed = scratch.printed("compare --scene dim.toml --within 30 --out out");
    for part in [
        "take                   8 neighbours\n",
        "resolution             full: each of 8×6 pixels reports; a depth may have photons of 8 neighbours\n",
        "fastest                blocks of 4×4, patience 8\n",
        "its resolution         blocks of 4×4: a sensor of 8×6 pixels keeps 2×2 places where only they report; 9",
        "out/dtof.toml has the settings of the method to take.",
        "out/dtof-fastest.toml has the settings of the fastest.",
    ] {
        assert_contains(&printed, part);
    }
    let page = scratch.read("out/report.html");
    for part in ["keeps 2×2 places", "blocks of 4×4, patience 8 after"] {
        assert_contains(&page, part);
    }
    assert_contains(&scratch.read("out/dtof.toml"), "neighbours = 8");
    let fastest = scratch.read("out/dtof-fastest.toml");
    assert_contains(&fastest, "binning = 2");
    assert_contains(&fastest, "patience = 8");
    // Both are settings that a run takes.
    let events = |settings: &str| {
        let line = format!("simulate --scene dim.toml --settings out/{settings} --out {settings}");
        scratch.printed(&line);
        let summary = scratch.read(&format!("{settings}/summary.json"));
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        summary["events_of_blocks"].as_u64()
    };
    assert_eq!(events("dtof.toml"), Some(0));
    assert!(events("dtof-fastest.toml") > Some(0));

    // An array of one row has neither: one answer, and the settings of the second are gone.
    scratch.file(
        "row.toml",
        DIM.replace("rows = 6", "rows = 1").replace("8\n", "48\n"),
    );
    let printed = scratch.printed("compare --scene row.toml --within 30 --out out");
    assert_contains(&printed, "the same, or at most 10 % faster\n");
    assert_contains(&printed, "full: each of 48×1 pixels reports\n");
    assert!(
        !printed.contains("its resolution") && !printed.contains("dtof-fastest"),
        "{printed}"
    );
    let one_answer = FILES.into_iter().filter(|name| !name.contains("fastest"));
    let one_answer: Vec<&str> = one_answer.collect();
    assert_eq!(names(&scratch.path("out")), one_answer);
    let table = scratch.read("out/methods.csv");
    assert!(
        !table.contains("neighbours\"") && !table.contains("blocks"),
        "{table}"
    );
}

#[test]
fn a_recording_without_truth_is_held_against_itself() {
    let scratch = Scratch::new();
    photons(&scratch);
    let line = "compare --input photons.csv --columns 2 --sigma-bins 0.7 --within 9 --settings short.toml --out out";
    let printed = scratch.printed(line);
    assert_contains(&printed, "take ");
    assert_contains(&printed, "slowest tenth      of the pixels: ");
    assert_contains(&scratch.read("out/compare.svg"), "laser cycles");
    let own = "errors are against the range of all photons of the pixel";
    assert_contains(&scratch.read("out/report.html"), own);
    // Pixel 2 has no target: its reports are counted apart.
    let truth = npy(
        "<f8",
        "(2, 2)",
        &[1500.0f64, 1556.0, 0.0, 1668.0]
            .map(f64::to_le_bytes)
            .concat(),
    );
    scratch.file("truth.npy", truth);
    let printed = scratch.printed(&format!("{line} --once-per-bin --truth truth.npy"));
    assert_contains(&printed, "take ");
    let report = scratch.read("out/report.html");
    assert_contains(&report, "errors are against the true range");
    assert_contains(&report, "window of 3, once per bin");
}

#[test]
fn the_range_bias_of_pixels_is_no_error() {
    let scratch = Scratch::new();
    photons(&scratch);
    let (ranges, biases) = ([1500.0, 1556.0, 0.0, 1668.0], [40.0, -90.0, 0.0, 160.0]);
    let truth = |ranges: [f64; 4]| npy("<f8", "(2, 2)", &ranges.map(f64::to_le_bytes).concat());
    scratch.file("seen.npy", truth(ranges));
    let there: Vec<f64> = ranges
        .iter()
        .zip(biases)
        .map(|(range, bias)| range - bias)
        .collect();
    scratch.file("there.npy", truth(there.try_into().unwrap()));
    let pixels = biases
        .map(|bias| format!("[0.0, 0.0, 1.0, {bias:?}]"))
        .join(", ");
    scratch.file(
        "pixels.toml",
        format!("columns = 2\nrows = 2\npixels = [{pixels}]\n"),
    );
    let rays = format!("{SHORT}[rays]\ncalibration = \"pixels.toml\"\n");
    scratch.file("rays.toml", rays);
    let line = "compare photons.csv --columns 2 --sigma-bins 0.7 --within 9";
    let methods = |options: &str| {
        scratch.printed(&format!("{line} --out out {options}"));
        scratch.read("out/methods.csv")
    };
    let seen = methods("--truth seen.npy --settings short.toml");
    assert_eq!(methods("--truth there.npy --settings rays.toml"), seen);
    assert_ne!(methods("--truth there.npy --settings short.toml"), seen);
}

/// The same wall behind a dim ball.
const PARTLY_DIM: &str = "[[surface]]\nrange_mm = 1500\nsignal = 0.01\n\
     ball = { centre = [6, 1], radius = 1.5, radius_mm = 10 }\n";

#[test]
fn a_warning_says_that_pixels_stay_silent() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", format!("{SCENE}{PARTLY_DIM}"));
    let output = scratch.run("compare --scene scene.toml --within 4 --out out");
    assert!(output.status.success());
    let warning = String::from_utf8(output.stderr).unwrap();
    let share = "warning: scene.toml: the method to take leaves 16 % of the pixels without a right report; ";
    assert_contains(&warning, share);
}

#[test]
fn without_an_answer_the_smallest_error_is_named() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", SCENE.replace("6000", "3000"));
    let printed = scratch.printed("compare --scene scene.toml --within 0.1 --out out");
    let none = "o method reaches an error of 0.100 mm; the smallest is ";
    assert_contains(&printed, &format!("  take          n{none}"));
    assert_contains(&scratch.read("out/report.html"), &format!("<h1>N{none}"));
    assert!(!printed.contains("has the settings"), "{printed}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.file("scene.toml", SCENE);
    scratch.file("dark.toml", "columns = 2\nbackground = 0.02\n");
    scratch.file("three.npy", npy("<f8", "(3,)", &[0; 24]));
    scratch.file("none.npy", npy("<f8", "(4,)", &[0; 32]));
    scratch.file("key.toml", "[detection]\nrules = 1\n");
    let recording = "--input photons.csv --columns 2 --bin-width-ps 250 --sigma-bins 0.7";
    scratch.all_refused(
        "compare --out out",
        &format!(
            "--within 4 | error: --input is needed
            --input photons.csv --scene scene.toml | cannot be used with
            --scene scene.toml --truth three.npy | cannot be used with
            --scene scene.toml --columns 8 | --columns is for recordings, not for a scene
            --scene scene.toml --photons-per-cycle 1 | --photons-per-cycle is for recordings
            --scene scene.toml --within 0 | must be a number above 0
            --scene scene.toml --false-alarm 0.5 | at most 0.1
            --scene scene.toml --settings key.toml | key.toml: rules is unknown in [detection]; is it rule?
            --scene missing.toml | missing.toml: No such file
            --scene dark.toml | dark.toml: no pixel has a target: there is nothing to compare
            {recording} --truth three.npy | three.npy: 3 ranges, but there are 4 pixels
            {recording} --truth none.npy | none.npy: no pixel has a range"
        ),
    );
    assert!(!scratch.path("out").exists());
    // The output folder is checked before the scene, which has no target.
    for folder in ["dark.toml", "dark.toml/out"] {
        let output = scratch.run(&format!("compare --scene dark.toml --out {folder}"));
        let message = String::from_utf8(output.stderr).unwrap();
        assert_contains(&message, &format!("{folder}: cannot be the output folder"));
    }
    // Runs and comparisons do not replace each other's files.
    scratch.printed("simulate --scene scene.toml --out run --quiet");
    let output = scratch.run("compare --scene scene.toml --out run");
    assert_contains(
        &String::from_utf8(output.stderr).unwrap(),
        "run: holds the results of a run",
    );
    scratch.file("compared/methods.csv", "");
    let output = scratch.run("simulate --scene scene.toml --out compared");
    assert_contains(
        &String::from_utf8(output.stderr).unwrap(),
        "compared: holds the results of a comparison",
    );
    scratch.file("out/methods.csv", "mine\n");
    let output = scratch.run("compare --scene scene.toml --out out");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_contains(&message, "out/methods.csv: was not written by this program");
    assert_eq!(scratch.read("out/methods.csv"), "mine\n");
    assert_eq!(names(&scratch.path("out")), ["methods.csv"]);
}

#[test]
fn the_settings_of_a_run_that_decided_once_are_those_of_its_sensor() {
    let scratch = Scratch::new();
    scratch.file("scene.toml", SCENE);
    scratch.printed(
        "simulate --scene scene.toml --decide-once --rule window --sigma-bins 1 --l2 400 --out once",
    );
    let once = scratch.read("once/dtof.toml");
    let is_z = |line: &&str| line.starts_with("z = ");
    assert_eq!(once.lines().filter(is_z).count(), 1, "{once}");
    let without: Vec<&str> = once.lines().filter(|line| !is_z(line)).collect();
    scratch.file("without.toml", without.join("\n"));
    let settings = ["once/dtof", "without"].map(|name| {
        scratch.printed(&format!(
            "compare --scene scene.toml --settings {name}.toml --out {name}-out"
        ));
        scratch.read(&format!("{name}-out/dtof.toml"))
    });
    assert!(!settings[0].contains("decide_once"), "{}", settings[0]);
    // The z of one decision is not that of looks.
    assert_eq!(settings[0], settings[1]);
}
