//! A capture log has zones and captures, where other arrays have columns and rows.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::common::{Scratch, assert_contains, npy};

#[test]
fn the_report_of_a_capture_log_calls_them_so() {
    let scratch = Scratch::new();
    let mut counts = vec!["1"; 128];
    counts[40] = "500";
    let zone = format!("[{}]", counts.join(","));
    let capture = format!("{{\"hists\": [{}]}}", [zone.as_str(); 9].join(","));
    let log = scratch.file("log.json", format!("[{capture},{capture}]"));
    let photons = scratch.file("photons.csv", "pixel,cycle,bin\n0,0,0\n");
    for (input, [across, down], has_events) in [
        (log, ["zone", "capture"], true),
        (photons, ["column", "row"], false),
    ] {
        let summary = scratch.replayed(&input, "");
        assert_eq!(summary["events"].as_u64() > Some(0), has_events);
        let map = scratch.read("out/event-counts.svg");
        let report = scratch.read("out/report.html");
        for side in [across, down] {
            assert_contains(&map, &format!(">{side}<"));
        }
        let sides = format!("\"sides\":[\"{across}\",\"{down}\"]");
        assert_eq!(report.contains(&sides), has_events);
    }
}

/// The log of a TMF8829: one capture of 2×1 pixels with peaks in bins 20 and 40.
#[test]
fn a_log_is_replayed_packed_or_not() {
    let pixel = |peak: usize| {
        let mut counts = [1; 64];
        counts[peak] = 900;
        format!("{{\"bin\": {counts:?}}}")
    };
    let row = format!("[{}, {}]", pixel(20), pixel(40));
    let log = format!(
        "{{\"Result_Set\": [{{\"mp_histo\": [{row}], \"results\": []}}], \"configuration\": {{\"bin_shift\": 2}}}}"
    );
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(log.as_bytes()).unwrap();
    let packed = packed.finish().unwrap();
    let scratch = Scratch::new();
    let defaults = scratch.file("defaults.toml", "");
    for (name, bytes) in [("log.json", log.as_bytes()), ("log.json.gz", &packed[..])] {
        let file = scratch.file(name, bytes);
        let options = format!("--recorded-cycles 1000 --settings {}", defaults.display());
        let summary = scratch.replayed(&file, &options);
        assert_eq!(
            [&summary["pixels"], &summary["photons"]],
            [2, 1926],
            "{name}"
        );
        let events = scratch.events();
        let mut peaks: Vec<[&str; 2]> = events
            .iter()
            .map(|event| [&*event[1], &*event[3]])
            .collect();
        peaks.sort_unstable();
        peaks.dedup();
        assert_eq!(peaks, [["0", "20"], ["1", "40"]], "{name}");
    }
}

/// One capture gives what a file of that capture alone gives.
#[test]
fn one_capture_of_several_can_be_chosen() {
    let scratch = Scratch::new();
    // Three captures of 2×2 pixels, each with another peak.
    let bytes = |captures: std::ops::Range<usize>| -> Vec<u8> {
        let bins = captures.flat_map(|capture| {
            (0..4 * 16).map(move |at| if at % 16 == 4 + 3 * capture { 200 } else { 1 })
        });
        bins.collect()
    };
    let all = scratch.file("all.npy", npy("|u1", "(3, 2, 2, 16)", &bytes(0..3)));
    let one = scratch.file("one.npy", npy("|u1", "(1, 2, 2, 16)", &bytes(1..2)));
    let axes = "--axes captures,rows,columns,bins";
    let summary = scratch.replayed(&all, &format!("{axes} --rule paper --capture 1"));
    assert_eq!(summary["pixels"], 4);
    assert_eq!(summary["recording"]["capture"], "1 of 3, counted from 0");
    let chosen = scratch.events();
    assert!(!chosen.is_empty());
    scratch.replayed(&one, &format!("{axes} --rule paper"));
    assert_eq!(scratch.events(), chosen);
    // Pixels of one capture are neighbours.
    scratch.replayed(
        &all,
        &format!("{axes} --capture 2 --rule window --window 3 --z 5 --neighbours 4"),
    );
    std::fs::remove_dir_all(scratch.path("out")).unwrap();
    for part in ["calibrate", "compare"] {
        let line =
            format!("{part} all.npy --capture 3 --axes captures,rows,columns,bins --out x.toml");
        scratch.refused(
            &scratch.run(&line),
            &["--capture 3: there are 3, counted from 0"],
        );
    }
    scratch.file("list.csv", "pixel,cycle,bin\n0,0,0\n");
    scratch.all_refused(
        "replay --out out",
        "
            all.npy --capture 1 | --capture 1: there is 1; --axes says which axis of an array has captures
            list.csv --capture 0 | --capture is for histograms; list.csv holds photons
            all.npy --capture -1 | --capture
        ",
    );
}

/// `calibrate` masks a hot pixel in each capture.
#[test]
fn pixels_that_are_left_out_are_those_of_the_capture() {
    let scratch = Scratch::new();
    let counts: Vec<u8> = (0..3 * 4 * 16)
        .map(|at| 1 + 99 * u8::from(at % 16 == 7))
        .collect();
    scratch.file("all.npy", npy("|u1", "(3, 2, 2, 16)", &counts));
    scratch.file("mask.toml", "[sensor]\nmasked = [1, 5, 9, 10]\n");
    let replay = "replay all.npy --axes captures,rows,columns,bins --out out";
    scratch.all_refused(
        replay,
        "--capture 0 --mask 12 | --mask 12: there are 12 pixels
         --capture 2 --mask 1,9999 | --mask 9999: there are 12 pixels",
    );
    for (options, masked) in [
        ("--settings mask.toml --capture 0", "[1]"),
        ("--settings mask.toml --capture 1", "[1]"),
        ("--settings mask.toml --capture 2", "[1,2]"),
        ("--settings mask.toml", "[1,5,9,10]"),
        // As if the file had no other capture.
        ("--capture 2 --mask 3", "[3]"),
    ] {
        scratch.printed(&format!("{replay} {options}"));
        let settings = &scratch.summary()["settings"];
        assert_eq!(settings["masked"].to_string(), masked, "{options}");
    }
}

/// True distances give an offset, which is for the estimator that is found.
#[test]
fn an_offset_of_another_estimator_is_warned_of() {
    let scratch = Scratch::new();
    let captures = (0..4_usize).map(|capture| {
        let mut counts = [3; 128];
        let at = 30 + 10 * capture;
        counts[at..at + 5].copy_from_slice(&[100, 400, 700, 400, 100]);
        let zone = format!("[{}]", counts.map(|count| count.to_string()).join(","));
        let metres = (at as f64 + 2.5) * 0.0138 - 0.1;
        let zones = [zone.as_str(); 9].join(",");
        format!("{{\"hists\": [{zones}], \"dist_to_plane\": {metres:.4}}}")
    });
    let log = format!("[{}]", captures.collect::<Vec<_>>().join(","));
    let log = scratch.file("log.json", log);
    let warns = |options: &str| {
        let summary = scratch.replayed(&log, &format!("--photons-per-cycle 0.5 {options}"));
        assert!(
            summary["settings"]["offset_mm"]
                .as_f64()
                .is_some_and(|mm| mm < -50.0),
            "{summary}"
        );
        let warnings = summary["warnings"].to_string();
        warnings.contains("the offset was found with another estimator")
    };
    assert!(!warns("") && !warns("--sigma-bins 1.2") && !warns("--estimator window"));
    assert!(warns("--estimator centroid") && warns("--half-widths 2,3"));
    assert!(!warns("--estimator centroid --offset-mm -99"));
}
