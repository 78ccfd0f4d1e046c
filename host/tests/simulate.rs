//! `dtof simulate`: scene files, good and bad.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::Scratch;
use dtof::scene::Scene;

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

fn simulate(scratch: &Scratch, scene: &Path, more: &[&str]) -> Output {
    let scene = scene.to_str().unwrap();
    scratch.dtof(&[&["simulate", "--scene", scene, "--out", "out"], more].concat())
}

#[track_caller]
fn simulated(scratch: &Scratch, scene: &Path, more: &[&str]) -> serde_json::Value {
    let output = simulate(scratch, scene, more);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {message}", scene.display());
    serde_json::from_str(&scratch.read("out/summary.json")).unwrap()
}

/// A scene file that is not one.
#[track_caller]
fn refused(text: &str, parts: &[&str]) {
    let scratch = Scratch::new();
    let scene = scratch.file("scene.toml", text);
    let parts = [&["scene.toml: "], parts].concat();
    scratch.refused(&simulate(&scratch, &scene, &[]), &parts);
}

#[test]
fn the_demos_scene_and_settings_give_the_demos_events() {
    let scratch = Scratch::new();
    let demo = ["demo", "--cycles", "2000", "--seed", "7", "--quiet"];
    assert!(scratch.dtof(&demo).status.success());
    let settings = [
        "--alpha", "8", "--l1", "100", "--l2", "2000", "--x", "10", "--cycles", "2000", "--seed",
        "7", "--quiet",
    ];
    let output = simulate(&scratch, &repository("scenes/demo.toml"), &settings);
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
    for name in ["events.csv", "events.aer", "depth-last.svg"] {
        let read = |folder| fs::read(scratch.path(folder).join(name)).unwrap();
        assert!(read("out") == read("out/demo"), "{name}");
    }
}

#[test]
fn every_scene_of_the_repository_runs_and_says_what_it_holds() {
    let scratch = Scratch::new();
    let mut scenes = 0;
    for entry in fs::read_dir(repository("scenes")).unwrap() {
        let path = entry.unwrap().path();
        let summary = simulated(&scratch, &path, &["--cycles", "500", "--quiet"]);
        assert_eq!(summary["cycles"], 500);
        assert_eq!(summary["input"], path.to_str().unwrap());
        assert!(summary["events"].as_u64() > Some(0), "{}", path.display());
        assert!(scratch.read("out/report.html").contains("Surfaces"));
        scenes += 1;
    }
    assert_eq!(scenes, 7);
}

#[test]
fn the_file_says_how_long_and_the_command_line_may_say_otherwise() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 6\nrows = 4\ncycles = 300\nbins = 64\nbin_width_ps = 92.1\n\
         [[surface]]\nrange_mm = 500\nreflectivity = 0.5\n",
    );
    let summary = simulated(&scratch, &scene, &[]);
    assert_eq!(
        (&summary["cycles"], &summary["pixels"]),
        (&300.into(), &24.into())
    );
    assert_eq!(summary["settings"]["bins"], 64);
    let width = summary["settings"]["bin_width_ps"].as_f64().unwrap();
    assert!((width - 92.1).abs() < 1.0 / 65_536.0, "{width}");
    let range: f64 = scratch
        .read("out/events.csv")
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(5)
        .unwrap()
        .parse()
        .unwrap();
    assert!((range - 500.0).abs() < 20.0, "{range}");
    let summary = simulated(&scratch, &scene, &["--cycles", "200", "--array", "3x2"]);
    assert_eq!(
        (&summary["cycles"], &summary["pixels"]),
        (&200.into(), &6.into())
    );
}

/// Motion that the events follow: they are compared with where the target was.
#[test]
fn events_of_a_moving_target_are_compared_with_the_truth_of_their_laser_cycle() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "cycles = 100_000\nbackground = 0.01\n\
         [[surface]]\nname = \"rocket\"\nrange_mm = 1000\nsignal = 2\nvelocity_m_per_s = 100\n",
    );
    let output = simulate(&scratch, &scene, &[]);
    let printed = String::from_utf8(output.stdout).unwrap();
    let row = printed
        .lines()
        .find(|line| line.contains("rocket, rms error"))
        .unwrap();
    let error: f64 = row.split_whitespace().nth(3).unwrap().parse().unwrap();
    assert!(error < 30.0 && row.contains("(0 beyond 3 bins)"), "{row}");
    let events = scratch.read("out/events.csv");
    let range = |line: &str| line.split(',').nth(5).unwrap().parse::<f64>().unwrap();
    let first = range(events.lines().nth(1).unwrap());
    let last = range(events.lines().last().unwrap());
    assert!((last - first - 1000.0).abs() < 60.0, "{first} to {last}");
}

#[test]
fn scene_files_that_are_not_toml_or_have_other_keys_are_named_by_line() {
    refused("columns = 2\nrows = \n", &["line 2: "]);
    refused("columns = 2\ncolumns = 3\n", &["line 2: ", "duplicate key"]);
    refused(
        "columns = 2\nbackgrond = 0.1\n",
        &["line 2: unknown field `backgrond`", "`background`"],
    );
    refused(
        "[tail]\nshare = 0.1\ndecay = 5\n",
        &["line 3: unknown field `decay`", "`decay_bins`"],
    );
    refused(
        "[tail]\nshare = 0.1\n",
        &["line 1: missing field `decay_bins`"],
    );
    refused(
        "[deadtime]\nduration_ps = 1\n",
        &["line 1: unknown field `deadtime`", "`dead_time`"],
    );
    refused(
        "[[surface]]\nrange_mm = 1000\nreflectivity = 1\nball = { centre = [1, 2], radius = 3, size = 4 }\n",
        &["line 4: unknown field `size`", "`radius_mm`"],
    );
    refused("columns = \"two\"\n", &["line 1: ", "expected u16"]);
    refused("columns = 2.5\n", &["line 1: ", "expected u16"]);
    refused("columns = -1\n", &["line 1: ", "expected u16"]);
    refused("\n\nbackground = true\n", &["line 3: ", "expected f64"]);
    refused(
        "[[surface]]\nfan = { centre = [1] }\n",
        &["line 2: ", "array of length 2"],
    );
    refused("surface = 1\n", &["line 1: "]);
}

#[test]
fn numbers_that_cannot_be_are_named_by_key() {
    for (line, part) in [
        ("columns = 0", "columns 0: must be from 1 to 65535"),
        ("rows = 0", "rows 0"),
        (
            "columns = 257\nrows = 256",
            "65792 pixels: more than 65,536",
        ),
        ("cycles = 0", "cycles 0"),
        (
            "bins = 100",
            "bins 100: must be a power of two from 8 to 1024",
        ),
        (
            "bin_width_ps = 0",
            "bin_width_ps 0: must be from 1 to 10000",
        ),
        ("bin_width_ps = nan", "bin_width_ps NaN"),
        ("laser_rate_mhz = 0", "laser_rate_mhz 0"),
        (
            "laser_rate_mhz = 50",
            "laser_rate_mhz 50: the next laser pulse comes after 80.0 bins",
        ),
        (
            "background = -0.1",
            "background -0.1: must be from 0 to 100",
        ),
        ("background = inf", "background inf"),
        (
            "background = 100\ncolumns = 50\nrows = 50",
            "photons a laser cycle: more than 10000000",
        ),
        ("pulse_sigma_bins = -1", "pulse_sigma_bins -1"),
        ("signal_at_one_metre = -1", "signal_at_one_metre -1"),
        (
            "[tail]\nshare = 1.5\ndecay_bins = 5",
            "[tail]: share 1.5: must be from 0 to 1",
        ),
        (
            "[tail]\nshare = 0.5\ndecay_bins = 0",
            "[tail]: decay_bins 0",
        ),
        (
            "[second_echo]\nshare = -1\nbehind_mm = 0",
            "[second_echo]: share -1",
        ),
        (
            "[second_echo]\nshare = 1\nbehind_mm = nan",
            "[second_echo]: behind_mm NaN",
        ),
        (
            "[cover_glass]\nsignal = -1\nposition_bins = 0",
            "[cover_glass]: signal -1",
        ),
        (
            "[cover_glass]\nsignal = 1\nposition_bins = -1",
            "[cover_glass]: position_bins -1",
        ),
        (
            "[hot_pixels]\nmultiple = 0.5\nshare = 1",
            "[hot_pixels]: multiple 0.5",
        ),
        (
            "[hot_pixels]\nmultiple = 2\nshare = 2",
            "[hot_pixels]: share 2",
        ),
        (
            "[hot_pixels]\nmultiple = 2",
            "[hot_pixels]: share or pixels must say",
        ),
        (
            "[hot_pixels]\nmultiple = 2\npixels = [1]",
            "[hot_pixels]: pixel 1",
        ),
        (
            "[dead_time]\nduration_ps = -1",
            "[dead_time]: duration_ps -1",
        ),
        (
            "[afterpulsing]\nprobability = 1\ndecay_ps = 5",
            "[afterpulsing]: probability 1",
        ),
        (
            "[afterpulsing]\nprobability = 0\ndecay_ps = 0",
            "[afterpulsing]: decay_ps 0",
        ),
        ("[jitter]\nsigma_ps = inf", "[jitter]: sigma_ps inf"),
        ("[tdc]\nhits_per_cycle = 0", "[tdc]: hits_per_cycle 0"),
    ] {
        refused(line, &[part]);
    }
}

#[test]
fn surfaces_that_cannot_be_are_named() {
    for (keys, part) in [
        (
            "reflectivity = 1",
            "needs range_mm or position_bins, and not both",
        ),
        (
            "range_mm = 1000\nposition_bins = 5\nsignal = 1",
            "needs range_mm or",
        ),
        (
            "range_mm = 1000",
            "needs reflectivity or signal, and not both",
        ),
        (
            "range_mm = 1000\nsignal = 1\nreflectivity = 1",
            "needs reflectivity or",
        ),
        ("range_mm = 0\nsignal = 1", "range_mm 0"),
        ("range_mm = nan\nsignal = 1", "range_mm NaN"),
        (
            "range_mm = 1000\nrange_right_mm = -1\nsignal = 1",
            "range_right_mm -1",
        ),
        ("position_bins = 0\nsignal = 1", "position_bins 0"),
        ("range_mm = 1000\nreflectivity = -1", "reflectivity -1"),
        ("range_mm = 1000\nsignal = -1", "signal -1"),
        (
            "range_mm = 10\nreflectivity = 1",
            "40000 signal photons a laser cycle from 10.0 mm",
        ),
        (
            "range_mm = 1000\nsignal = 1\nvelocity_m_per_s = nan",
            "velocity_m_per_s NaN",
        ),
        (
            "range_mm = 1000\nsignal = 1\nvelocity_m_per_s = -1000",
            "comes as near as 0.0 mm",
        ),
        (
            "range_mm = 1000\nsignal = 1\ncolumns_per_s = inf",
            "columns_per_s inf",
        ),
        (
            "range_mm = 1000\nsignal = 1\nrows_per_s = inf",
            "rows_per_s inf",
        ),
        (
            "range_mm = 1000\nsignal = 1\nrectangle = { columns = [2, 2], rows = [0, 1] }",
            "rectangle columns [2, 2]: the second must be greater",
        ),
        (
            "range_mm = 1000\nsignal = 1\nrectangle = { columns = [0, 2], rows = [nan, 1] }",
            "rectangle rows NaN",
        ),
        (
            "range_mm = 1000\nsignal = 1\nball = { centre = [0, 2], radius = 0, radius_mm = 1 }",
            "ball radius 0",
        ),
        (
            "range_mm = 1000\nsignal = 1\nball = { centre = [0, 2], radius = 1, radius_mm = 1000 }",
            "comes as near as 0.0 mm",
        ),
        (
            "range_mm = 1000\nsignal = 1\n\
             fan = { centre = [0, 2], radius = 1, blades = 0, blade_share = 0.5, rpm = 1 }",
            "fan blades 0",
        ),
        (
            "range_mm = 1000\nsignal = 1\n\
             fan = { centre = [0, 2], radius = 1, blades = 3, blade_share = 1.5, rpm = 1 }",
            "fan blade_share 1.5",
        ),
        (
            "range_mm = 1000\nsignal = 1\nrectangle = { columns = [0, 2], rows = [0, 1] }\n\
             ball = { centre = [0, 2], radius = 1, radius_mm = 1 }",
            "is more than one of rectangle, ball and fan",
        ),
    ] {
        refused(&format!("[[surface]]\n{keys}\n"), &["surface 1: ", part]);
        let named = format!("[[surface]]\nname = \"target\"\n{keys}\n");
        refused(&named, &["target: ", part]);
    }
}

#[test]
fn scenes_that_are_not_there_and_options_that_cannot_be_are_refused() {
    let scratch = Scratch::new();
    scratch.refused(
        &simulate(&scratch, &scratch.path("none.toml"), &[]),
        &["none.toml", "No such file"],
    );
    let binary = scratch.file("binary.toml", [0xff, 0xfe, 0]);
    scratch.refused(&simulate(&scratch, &binary, &[]), &["binary.toml", "UTF-8"]);
    scratch.refused(&scratch.dtof(&["simulate", "--out", "out"]), &["--scene"]);
    let scene = scratch.file("scene.toml", "columns = 2\n");
    for (arguments, part) in [
        (&["--cycles", "0"][..], "--cycles"),
        (&["--array", "0x5"], "--array"),
        (&["--array", "65535x2"], "131070 pixels: more than 65,536"),
        (&["--x", "50"], "X must not be greater than L1"),
        (&["--gate", "0..128"], "past the last bin"),
        (&["--scen", "x"], "--scen"),
    ] {
        scratch.refused(&simulate(&scratch, &scene, arguments), &[part]);
    }
}

/// The document has a row for every key, and its examples are scenes.
#[test]
fn the_document_lists_every_key_and_its_examples_are_scenes() {
    let document = fs::read_to_string(repository("docs/scenes.md")).unwrap();
    let keys_of = |text: &str| -> Vec<String> {
        let error = Scene::parse(text).unwrap_err().to_string();
        let known = error.split_once("expected").unwrap().1.to_owned();
        known
            .split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    };
    let mut keys = keys_of("nonsense = 1\n");
    assert!(keys.len() > 15, "{keys:?}");
    for section in keys.clone() {
        if section == "surface" {
            keys.extend(keys_of("[[surface]]\nnonsense = 1\n"));
            for shape in ["rectangle", "ball", "fan"] {
                keys.extend(keys_of(&format!(
                    "[[surface]]\n{shape} = {{ nonsense = 1 }}\n"
                )));
            }
        } else if document.contains(&format!("`[{section}]`")) {
            keys.extend(keys_of(&format!("[{section}]\nnonsense = 1\n")));
        }
    }
    for key in keys {
        let named = [
            format!("`{key}`"),
            format!("`[{key}]`"),
            format!("`[[{key}]]`"),
        ];
        assert!(
            named.iter().any(|name| document.contains(name)),
            "{key} is not in the document"
        );
    }
    let examples: Vec<&str> = document
        .split("```toml\n")
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap())
        .collect();
    assert!(!examples.is_empty());
    for example in examples {
        Scene::parse(example).unwrap_or_else(|error| panic!("{error}\n{example}"));
    }
}

/// The defaults of the document are those of the program.
#[test]
fn the_documents_defaults_are_those_of_an_empty_file() {
    let document = fs::read_to_string(repository("docs/scenes.md")).unwrap();
    let empty = Scene::parse("").unwrap();
    let mut defaults = 0;
    // | `key` | default | ...
    for line in document.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let (key, Ok(_)) = (
            cells[1].trim_matches('`'),
            cells[2].replace(',', "").parse::<f64>(),
        ) {
            let text = format!("{key} = {}\n", cells[2].replace(',', "_"));
            let surface = "[[surface]]\nrange_mm = 1000\nsignal = 1\n";
            // A key of the file or of a surface.
            let same = Scene::parse(&text).is_ok_and(|scene| scene == empty)
                || Scene::parse(&format!("{surface}{text}"))
                    .is_ok_and(|scene| scene == Scene::parse(surface).unwrap());
            assert!(same, "{line}");
            defaults += 1;
        }
    }
    assert_eq!(defaults, 12);
}
