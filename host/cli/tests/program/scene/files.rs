//! `dtof simulate`: scene files and what comes of them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Scratch, assert_contains};
use dtof_core::PixelAddress;
use dtof_light::scene::Scene;

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .join(path)
}

#[track_caller]
fn simulated(scratch: &Scratch, scene: &Path, options: &str) -> serde_json::Value {
    scratch.simulated(scene, options);
    scratch.summary()
}

#[test]
fn the_demos_scene_and_settings_give_the_demos_events() {
    let scratch = Scratch::new();
    scratch.printed("demo --cycles 1000 --seed 7 --quiet");
    let settings = "--rule window --sigma-bins 1 --binning 2 --echoes 2 --echo-wait 4 --cycles 1000 --seed 7 --quiet";
    let output = scratch.simulate(&repository("host/light/src/demo.toml"), settings);
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
        if path.extension().is_none_or(|ending| ending != "toml") {
            continue; // The recording of one of them.
        }
        let summary = simulated(&scratch, &path, "--cycles 500 --quiet");
        assert_eq!(summary["cycles"], 500);
        assert_eq!(summary["input"], path.to_str().unwrap());
        assert!(summary["events"].as_u64() > Some(0), "{}", path.display());
        assert!(scratch.read("out/report.html").contains("Surfaces"));
        scenes += 1;
    }
    assert_eq!(scenes, 8);
}

#[test]
fn the_file_says_how_long_and_the_command_line_may_say_otherwise() {
    let scratch = Scratch::new();
    let scene = scratch.file(
        "scene.toml",
        "columns = 6\nrows = 4\ncycles = 300\nbins = 64\nbin_width_ps = 92.1\n\
         [[surface]]\nrange_mm = 500\nreflectivity = 0.5\n",
    );
    let summary = simulated(&scratch, &scene, "");
    assert_eq!([&summary["cycles"], &summary["pixels"]], [300, 24]);
    assert_eq!(summary["settings"]["bins"], 64);
    let width = summary["settings"]["bin_width_ps"].as_f64().unwrap();
    assert!((width - 92.1).abs() < 1.0 / 65_536.0, "{width}");
    let range: f64 = scratch.events()[0][5].parse().unwrap();
    assert!((range - 500.0).abs() < 20.0, "{range}");
    let summary = simulated(&scratch, &scene, "--cycles 200 --array 3x2");
    assert_eq!([&summary["cycles"], &summary["pixels"]], [200, 6]);
}

#[test]
fn a_surface_beyond_the_last_bin_is_named() {
    let scratch = Scratch::new();
    let file = |range: &str| {
        let surface = "[[surface]]\nname = \"wall\"\nsignal = 1\n";
        let text = format!("cycles = 100\ncolumns = 4\n{surface}{range}");
        scratch.file("scene.toml", text)
    };
    let printed = |range| scratch.simulated(&file(range), "");
    // 128 bins of 250 ps are 4797 mm.
    let far = printed("range_mm = 4790\nrange_right_mm = 4800\n");
    assert_contains(
        &far,
        "1 of 4 pixels at the start or the end: no photons from 4797 mm on",
    );
    assert!(!printed("range_mm = 4790\n").contains("beyond the last bin"));
    let moving = printed("range_mm = 4796\nvelocity_m_per_s = 1000\n");
    assert_contains(&moving, "4 of 4 pixels at");
}

/// Events of a one-hit TDC carry a flag if pile-up is likely.
#[test]
fn pile_up_is_flagged_where_the_tdc_takes_one_hit() {
    let scratch = Scratch::new();
    let flags = |signal: f64, hits: &str| -> Vec<u8> {
        let surface = format!("[[surface]]\nposition_bins = 60.5\nsignal = {signal}\n");
        let scene = scratch.file("scene.toml", format!("cycles = 1000\n{surface}{hits}"));
        scratch.simulated(&scene, "--quiet");
        let events = scratch.events();
        events
            .iter()
            .map(|event| event[8].parse().unwrap())
            .collect()
    };
    let one_hit = "[tdc]\nhits_per_cycle = 1\n";
    // A photon in 26 and in 86 % of the laser cycles.
    for (signal, hits, expected) in [(0.3, one_hit, 0), (2.0, one_hit, 8), (2.0, "", 0)] {
        let flags = flags(signal, hits);
        assert!(flags.len() > 10);
        assert!(flags.iter().all(|&flag| flag == expected), "{flags:?}");
    }
}

/// The document has a row for every key, and its examples are scenes.
#[test]
fn the_document_lists_every_key_and_its_examples_are_scenes() {
    let document = fs::read_to_string(repository("docs/scenes.md")).unwrap();
    let keys_of = |text: &str| -> Vec<String> {
        let error = Scene::parse(text).unwrap_err().to_string();
        let expected = error.split_once("expected").unwrap().1.to_owned();
        let names = expected.split('`').skip(1).step_by(2);
        names.map(str::to_owned).collect()
    };
    let mut keys = keys_of("nonsense = 1\n");
    assert!(keys.len() > 15, "{keys:?}");
    for section in keys.clone() {
        if section == "surface" {
            keys.extend(keys_of("[[surface]]\nnonsense = 1\n"));
            for shape in ["rectangle", "ball", "fan"] {
                let text = format!("[[surface]]\n{shape} = {{ nonsense = 1 }}\n");
                keys.extend(keys_of(&text));
            }
        } else if document.contains(&format!("`[{section}]`")) {
            keys.extend(keys_of(&format!("[{section}]\nnonsense = 1\n")));
        }
    }
    for key in keys {
        let names = [("", ""), ("[", "]"), ("[[", "]]")];
        let names = names.map(|(open, close)| format!("`{open}{key}{close}`"));
        let is_there = names.iter().any(|name| document.contains(name));
        assert!(is_there, "{key} is not in the document");
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
    assert_eq!(defaults, 14);
}

/// A frame has an event of each pixel with a target, at its end and not before.
#[test]
fn frames_read_all_pixels_at_once() {
    let scratch = Scratch::new();
    let scene = repository("scenes/static.toml");
    let frames = "--frame 2000 --cycles 4500 --quiet";
    let summary = simulated(&scratch, &scene, frames);
    assert_eq!(summary["settings"]["frame"], 2000);
    let rows = scratch.events();
    for cycle in ["1999", "3999"] {
        let is_of_frame = |row: &&Vec<String>| row[0] == cycle && row[2] == "2000";
        assert!(rows.iter().filter(is_of_frame).count() > 32 * 16 * 9 / 10);
    }
    assert!(rows.len() <= 2 * 32 * 16);
    let report = scratch.read("out/report.html");
    assert!(report.contains("Readings in space and time") && !report.contains(" events are shown"));
    assert!(report.contains("wall</th><td>544 readings of 272 pixels, "));

    for more in ["--l1 20", "--alpha 4", "--device qemu"] {
        let refused = scratch.simulate(&scene, &format!("{frames} {more}"));
        assert!(!refused.status.success());
        let lines = refused.stderr.iter().filter(|&&byte| byte == b'\n');
        assert_eq!(lines.count(), 1);
    }
}

/// `simulate` prints the options that `dtof export` needs in addition to its defaults.
#[test]
fn the_options_that_export_needs_are_said() {
    let scratch = Scratch::new();
    let wall = "[[surface]]\nrange_mm = 1000\nsignal = 1\n";
    let keys = "columns = 8\nrows = 4\nbins = 128\ncycles = 200\n";
    let slow = "laser_rate_mhz = 1.25\nfield_of_view_degrees = [60, 32]\n";
    let natural = [60.0, 2.0 * (0.5 / 3f64.sqrt()).atan().to_degrees()];
    let of_slow = Some("--fov 60x32");
    for (more, array, hz, degrees, options) in [
        ("", "8x4", 10_000_000, natural, None),
        ("", "16x8", 10_000_000, natural, None),
        // The field of view stays.
        ("", "4x4", 10_000_000, natural, Some("--fov 60x32.204228")),
        (slow, "8x4", 1_250_000, [60.0, 32.0], of_slow),
    ] {
        let scene = scratch.file("scene.toml", format!("{keys}{more}{wall}"));
        let printed = scratch.simulated(&scene, &format!("--array {array}"));
        let row = printed.lines().find(|line| line.contains("export with"));
        let summary = scratch.summary();
        assert_eq!(summary["laser_hz"], hz);
        for (is, said) in degrees.iter().enumerate() {
            let there = summary["field_of_view_degrees"][is].as_f64().unwrap();
            assert!((there - said).abs() < 1e-9, "{there}");
        }
        assert_eq!(summary["export_with"].as_str(), options);
        assert_eq!(row.is_some(), options.is_some(), "{printed}");
        let Some(options) = options else { continue };
        assert!(row.unwrap().ends_with(options), "{printed}");
        let line = "export out/events.aer --format csv --out x";
        scratch.printed(&format!("{line} {options}"));
    }
}

/// Another array sees the same plane under the same angles.
#[test]
fn another_array_sees_as_much_of_a_plane() {
    let text = "columns = 64\nrows = 32\n[[surface]]\nrange_mm = 2000\nsignal = 1\n\
                plane = { normal = [0.5, 0.3, 1] }\n";
    let scene = Scene::parse(text).unwrap();
    let square = Scene {
        size: [8, 8],
        ..scene.clone()
    };
    let range = |scene: &Scene, column: u16, row: u16| {
        let columns = u16::try_from(scene.size[0]).unwrap();
        let pixel = PixelAddress::new(row * columns + column);
        scene.truth(pixel, 0).unwrap().range_mm
    };
    // A pixel of 8x8 is eight columns and four rows of 64x32; its middle is a corner of the
    // four pixels in the middle of them, and an inverse range is linear but for the length of
    // the ray.
    for (column, row) in [(0, 0), (7, 0), (3, 5), (7, 7)] {
        let four = [(3, 1), (4, 1), (3, 2), (4, 2)];
        let around = four.map(|(right, down)| range(&scene, 8 * column + right, 4 * row + down));
        let mean = around.iter().sum::<f64>() / 4.0;
        let here = range(&square, column, row);
        assert!((here / mean - 1.0).abs() < 1e-3, "{here} and {mean}");
    }
}

#[test]
fn a_run_without_a_photon_is_warned_of() {
    let scratch = Scratch::new();
    scratch.file("dark.toml", "cycles = 100\n");
    scratch.file("lit.toml", "cycles = 100\nbackground = 0.1\n");
    let stderr = |scene| {
        let output = scratch.run(&format!("simulate --scene {scene}.toml --out {scene}"));
        assert!(output.status.success());
        String::from_utf8(output.stderr).unwrap()
    };
    let warning = "no photons: the scene is dark, or too short";
    assert_contains(&stderr("dark"), &format!("warning: dark.toml: {warning}"));
    assert_contains(&scratch.read("dark/summary.json"), warning);
    assert_eq!(stderr("lit"), "");
}
