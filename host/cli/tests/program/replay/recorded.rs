//! Replays that must succeed, end to end.

use std::fmt::Write;
use std::process::Output;

use crate::common::{Scratch, assert_contains, npy, succeeded};

const HEADER: &str =
    "cycle,pixel,exposure,peak_bin,depth_bins,range_mm,peak_count,background,flags,level,echo\n";

/// One photon a laser cycle, all in the same bin.
fn steady(pixel: u16, bin: u16, cycles: u64) -> String {
    let mut text = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..cycles {
        writeln!(text, "{pixel},{cycle},{bin}").unwrap();
    }
    text
}

#[test]
fn a_steady_pixel_reports_when_the_flow_chart_says() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(7, 60, 100));
    let summary = scratch.replayed(
        &input,
        "--rule paper --alpha 8 --x 4 --l1 40 --l2 2000 --estimator centroid --dead-time 0",
    );
    // N = 44 is the first multiple of 4 above 40; cycles count from 0. All in
    // bin 60 puts the centroid at 60.5 bins of 37.474 mm.
    let expected =
        "43,7,44,60,60.5000,2267.180,44,0,0,0,1\n87,7,44,60,60.5000,2267.180,44,0,0,0,1\n";
    assert_eq!(
        scratch.read("out/events.csv"),
        format!("{HEADER}{expected}")
    );
    let counts = ["cycles", "photons", "events", "pixels", "pixels_reporting"];
    assert_eq!(counts.map(|name| &summary[name]), [100, 100, 2, 1, 1]);
    let losses = ["rejected", "saturated", "deferred", "not_replayed"];
    assert_eq!(losses.map(|name| &summary[name]), [0; 4]);
}

#[test]
fn decode_prints_what_replay_wrote() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(7, 60, 1000));
    scratch.replayed(&input, "--bin-width-ps 92.1 --offset-mm -179.5");
    let decoded = scratch.printed("decode out/events.aer");
    assert_eq!(decoded, scratch.read("out/events.csv"));
    assert!(scratch.read("out/events.csv").lines().count() > 10);
}

#[test]
fn a_damaged_aer_file_is_named_with_its_offset() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(7, 60, 1000));
    scratch.replayed(&input, "");
    let whole = std::fs::read(scratch.path("out/events.aer")).unwrap();
    std::fs::remove_dir_all(scratch.path("out")).unwrap();
    // Header 64 bytes, a time word, then the events, then the end word.
    let events = (whole.len() - 64 - 32) / 16;
    let decode = |bytes: &[u8]| {
        scratch.file("damaged.aer", bytes);
        scratch.run("decode damaged.aer")
    };
    let rows = |output: &Output| output.stdout.split(|&byte| byte == b'\n').count() - 1;

    let cut = decode(&whole[..64 + 16 + 3 * 16 + 5]);
    scratch.refused(&cut, &["damaged.aer", "byte 128", "ends inside a word"]);
    assert_eq!(rows(&cut), 1 + 3);
    let cut = decode(&whole[..whole.len() - 16]);
    scratch.refused(&cut, &["damaged.aer", "ends without an end word"]);
    assert_eq!(rows(&cut), 1 + events);
    for (bytes, part) in [
        ([&whole[..], b"x"].concat(), "bytes follow the end word"),
        (whole[..63].to_vec(), "shorter than its header"),
        (
            [&whole[..64], &[0; 16]].concat(),
            "byte 64: unknown control word",
        ),
    ] {
        scratch.refused(&decode(&bytes), &["damaged.aer: ", part]);
    }
    scratch.all_refused("decode", "none.aer | none.aer | No such file");
    // A file with any flipped bit is refused.
    for bit in (0..whole.len() * 8).step_by(37) {
        let mut damaged = whole.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        scratch.refused(&decode(&damaged), &["damaged.aer"]);
    }
}

/// Its times count from the own pulses on. The settings go on for a device.
#[test]
fn a_recording_has_no_dither_but_keeps_that_of_its_settings() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(0, 60, 100));
    scratch.file("own.toml", "[sensor]\ndither_bins = 64\ndither_seed = 9\n");
    let summary = scratch.replayed(&input, "--settings own.toml");
    assert_eq!(summary["settings"].get("dither_bins"), None);
    let written = scratch.read("out/dtof.toml");
    for line in ["dither_bins = 64", "dither_seed = 9"] {
        assert_contains(&written, line);
    }
}

#[test]
fn only_the_first_cycles_are_replayed_and_the_rest_is_counted() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(0, 60, 500));
    let summary = scratch.replayed(&input, "--cycles 100");
    assert_eq!([&summary["cycles"], &summary["photons"]], [100, 100]);
    assert_eq!(summary["not_replayed"], 400);
}

#[test]
fn histograms_of_every_integer_type_give_the_same_events() {
    // Two rows of three pixels with 8 bins; all of a pixel's photons are in the
    // bin with the pixel's number, but for one in bin 7.
    let mut counts = [0u64; 6 * 8];
    for (pixel, bins) in counts.chunks_mut(8).enumerate() {
        (bins[pixel], bins[7]) = (100, 1);
    }
    let mut results = Vec::new();
    for descr in "|u1 |i1 <u2 >u2 <i2 >i2 <u4 >u4 <i4 >i4 <u8 >u8 <i8 >i8".split(' ') {
        let scratch = Scratch::new();
        let size: usize = descr[2..].parse().unwrap();
        let data: Vec<u8> = counts
            .iter()
            .flat_map(|&count| {
                let mut element = count.to_le_bytes()[..size].to_vec();
                if descr.starts_with('>') {
                    element.reverse();
                }
                element
            })
            .collect();
        let input = scratch.file("recorded.npy", npy(descr, "(2, 3, 8)", &data));
        let summary = scratch.replayed(&input, "--recorded-cycles 100");
        assert_eq!(
            [&summary["pixels"], &summary["photons"]],
            [6, 606],
            "{descr}"
        );
        results.push((descr, scratch.events()));
    }
    for (descr, events) in &results {
        assert_eq!(events, &results[0].1, "{descr}");
    }
    // Row-major: the peak bin is the pixel's number.
    let rows = &results[0].1;
    let is_right = |row: &Vec<String>| row[1] == row[3];
    assert!(rows.len() >= 6 && rows.iter().all(is_right), "{rows:?}");
}

#[test]
fn the_brightest_pixel_of_a_capture_sets_the_pace() {
    let scratch = Scratch::new();
    let mut data = [0; 16];
    data[3] = 200;
    data[12] = 50;
    let input = scratch.file("recorded.npy", npy("|u1", "(2, 8)", &data));
    // 200 photons at half a photon a laser cycle: 400 laser cycles.
    let summary = scratch.replayed(&input, "--photons-per-cycle 0.5");
    assert_eq!(summary["recorded_cycles"], serde_json::json!([400, 400]));
    assert_eq!(summary["not_replayed"], 0);
    assert_eq!([&summary["cycles"], &summary["photons"]], [400, 250]);
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let scratch = Scratch::new();
    let mut data = vec![1; 64 * 16];
    for bins in data.chunks_mut(16) {
        bins[5] = 90;
    }
    scratch.file("recorded.npy", npy("|u1", "(8, 8, 16)", &data));
    let run = |threads: &str, seed: &str, out: &str| {
        let line = format!("replay --input recorded.npy --out {out} --seed {seed}");
        let mut dtof = scratch.command(&line);
        succeeded(dtof.env("RAYON_NUM_THREADS", threads).output().unwrap());
        let names = "events.csv events.aer summary.json report.html depth-last.svg";
        let read = |name| std::fs::read(scratch.path(out).join(name)).unwrap();
        names.split(' ').map(read).collect::<Vec<_>>()
    };
    let one = run("1", "5", "a");
    assert!(one == run("2", "5", "b") && one == run("7", "5", "c"));
    assert!(one[0] != run("1", "6", "d")[0]);
}

#[test]
fn a_gate_leaves_the_cover_glass_out() {
    let scratch = Scratch::new();
    // A hundred times more photons in bin 5 than in the target's bin 40.
    let mut text = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..400 {
        for _ in 0..10 {
            writeln!(text, "0,{cycle},5").unwrap();
        }
        if cycle % 10 == 0 {
            writeln!(text, "0,{cycle},40").unwrap();
        }
    }
    let input = scratch.file("photons.csv", text);
    let summary = scratch.replayed(&input, "--gate 10..127");
    assert_eq!([&summary["photons"], &summary["gated_out"]], [4040, 4000]);
    let events = scratch.events();
    assert!(
        !events.is_empty() && events.iter().all(|event| event[3] == "40"),
        "{events:?}"
    );
}

#[test]
fn every_pixel_of_the_demo_reports_alone_or_in_a_block() {
    let scratch = Scratch::new();
    let output = scratch.run("demo --quiet");
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
    let read = |name: &str| scratch.read(&format!("out/demo/{name}"));
    let summary: serde_json::Value = serde_json::from_str(&read("summary.json")).unwrap();
    let settings = &summary["settings"];
    let names = [
        "l1",
        "l2",
        "x",
        "binning",
        "patience",
        "echoes",
        "echo_wait",
    ];
    let numbers = names.map(|name| settings[name].as_u64().unwrap());
    assert_eq!(numbers, [40, 2000, 4, 2, 64, 2, 4]);
    let counts = ["cycles", "pixels", "pixels_reporting"].map(|name| &summary[name]);
    assert_eq!(counts, [4000, 2048, 2048]);
    let events = read("events.csv");
    // The first look above L1, N = 44.
    let first = events.lines().nth(1).unwrap();
    assert!(first.starts_with("43,"), "{first}");
    let report = read("report.html");
    assert!(report.contains("</html>") && report.matches("<svg").count() == 4);
    // As documented: the report stays small enough to send.
    assert!(report.len() < 5_000_000 && report.contains("All 30,552 events are shown."));
    for picture in ["depth-mean", "reflectivity-events", "reflectivity-signal"] {
        assert!(read(&format!("{picture}.svg")).ends_with("</svg>\n"));
    }
    // All surfaces are reported, also the dim one and the one behind the glass.
    for surface in summary["against_truth"]["surfaces"].as_array().unwrap() {
        let (name, events) = (&surface["name"], surface["events"].as_u64().unwrap());
        let false_alarms = surface["false_alarms"].as_u64().unwrap();
        assert!(
            events > 400 && false_alarms * 40 <= events,
            "{name}: {events}, {false_alarms}"
        );
    }
    // The array of the AER file's header: 64 columns, 32 rows.
    let aer = std::fs::read(scratch.path("out/demo/events.aer")).unwrap();
    assert_eq!(aer[12..24], [128, 0, 0, 0, 64, 0, 0, 0, 32, 0, 0, 0]);
    // The maps of the documentation are those of the demo.
    for (picture, shown) in [
        ("depth-last", "demo-depth"),
        ("event-counts", "demo-events"),
        ("photon-counts", "demo-photons"),
    ] {
        let path = format!(
            "{}/../../docs/figures/{shown}.svg",
            env!("CARGO_MANIFEST_DIR")
        );
        let committed = std::fs::read_to_string(path).unwrap();
        assert!(read(&format!("{picture}.svg")) == committed, "{shown}");
    }
}

/// A target that comes nearer by 20 bins after 1,000 laser cycles.
#[test]
fn dynamic_depth_is_shown_over_time_where_it_is_asked_for() {
    let scratch = Scratch::new();
    let far = steady(0, 60, 1000);
    let near = (1000..2000).map(|cycle| format!("0,{cycle},40\n"));
    let input = scratch.file("photons.csv", far + &near.collect::<String>());
    let defaults = format!("--settings {}", scratch.file("defaults.toml", "").display());
    scratch.replayed(&input, &defaults);
    let (plain, events) = (
        scratch.read("out/report.html"),
        scratch.read("out/events.csv"),
    );
    assert!(!plain.contains("Dynamic depth"));
    scratch.replayed(&input, &format!("{defaults} --dynamic-depth"));
    let shown = scratch.read("out/report.html");
    assert!(shown.contains("<figcaption>Dynamic depth: 3 changes in place of 45 events."));
    let figures = |report: &str| report.matches("<svg").count();
    assert_eq!(figures(&shown), figures(&plain) + 1);
    assert_eq!(scratch.read("out/events.csv"), events);
    // More than a third of 20 bins; a wall has no changes.
    for options in ["--threshold-mm 300", "--cycles 1000"] {
        scratch.replayed(&input, &format!("{defaults} --dynamic-depth {options}"));
        assert_eq!(figures(&scratch.read("out/report.html")), figures(&plain));
    }
}

#[test]
fn replay_takes_the_stated_defaults_and_keeps_quiet() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(0, 60, 100));
    scratch.file("empty.toml", "");
    let empty = scratch.path("empty.toml");
    let output = scratch.replay(&input, &format!("--settings {} --quiet", empty.display()));
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
    let summary = scratch.summary();
    let settings = serde_json::json!({
        "bins": 128, "bin_width_ps": 250.0, "offset_mm": 0.0, "gate": null, "rule": "paper", "alpha": 4.0, "estimator": "centroid",
        "min_count": 5, "l1": 40, "l2": 2000, "x": 4, "binning": 0, "tracking": false, "echoes": 1, "echo_wait": null, "dead_time": 0, "once_per_bin": false, "counter_bits": 10, "seed": 1
    });
    assert_eq!(summary["settings"], settings);
    let histogram = npy("<u4", "(8,)", &10_000u32.to_le_bytes().repeat(8));
    let input = scratch.file("recorded.npy", histogram);
    let summary = scratch.replayed(&input, "");
    // One photon a laser cycle, the first 10,000 laser cycles.
    assert_eq!(
        summary["recorded_cycles"],
        serde_json::json!([80_000, 80_000])
    );
    assert_eq!(summary["cycles"], 10_000);
}

#[test]
fn an_exposure_without_an_event_is_counted() {
    let scratch = Scratch::new();
    // A photon every 50 laser cycles never makes a peak of five before L2.
    let rows: String = (0..10)
        .map(|photon| format!("0,{},60\n", photon * 50))
        .collect();
    let input = scratch.file("photons.csv", format!("pixel,cycle,bin\n{rows}"));
    let summary = scratch.replayed(&input, "--l2 200");
    assert_eq!([&summary["events"], &summary["expired"]], [0, 2]);
}

#[test]
fn histogram_photons_after_the_last_cycle_are_counted() {
    let scratch = Scratch::new();
    let input = scratch.file("RECORDED.NPY", npy("|u1", "(2, 8)", &[100; 16]));
    let summary = scratch.replayed(&input, "--recorded-cycles 1000 --cycles 100");
    let photons = |name: &str| summary[name].as_u64().unwrap();
    assert_eq!(photons("photons") + photons("not_replayed"), 1600);
    assert!(photons("photons") > 0 && photons("not_replayed") > 0);
    assert_eq!(summary["input"], input.to_str().unwrap());
}

#[test]
fn a_run_too_short_for_an_event_says_so() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", steady(7, 60, 100));
    let output = scratch.replay(&input, "--cycles 40");
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_contains(&stdout, "the first decision comes after 44 laser cycles");
}

/// The file needs no option, and the results go into a folder of its name.
#[test]
fn a_recording_is_a_plain_argument_and_names_the_folder() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", steady(7, 60, 100));
    scratch.printed("replay --input photons.csv --out named");
    let printed = scratch.printed("replay photons.csv");
    assert!(printed.contains("out/photons"), "{printed}");
    let events = scratch.read("out/photons/events.csv");
    assert_eq!(events, scratch.read("named/events.csv"));
    let scratch = Scratch::new();
    scratch.file("photons.csv", steady(7, 60, 100));
    scratch.all_refused(
        "replay",
        "
        | <FILE> is needed
        photons.csv --input photons.csv | cannot be used with
        photons.csv other.csv | error: other.csv is not expected here: one file at a time
        ",
    );
}
