//! Arrays that NumPy has written (`numpy/make.py`), end to end.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand_core::SeedableRng;
use rand_distr::{Distribution, Poisson};
use rand_pcg::Pcg64;

use crate::common::{Scratch, assert_contains, npy, succeeded};
use dtof_data::photons::npy::header;

fn array(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/replay/numpy");
    folder.join(name)
}

#[test]
fn every_order_and_type_gives_the_same_events() {
    let scratch = Scratch::new();
    let defaults = scratch.file("defaults.toml", "");
    let mut all = Vec::new();
    for (name, options) in [
        ("plain.npy", "--axes captures,rows,columns,bins"),
        ("fortran.npy", "--axes captures,rows,columns,bins"),
        ("bins_first.npy", "--axes bins,captures,rows,columns"),
        ("turned.npy", "--axes columns,bins,captures,rows"),
        ("floats.npy", "--axes captures,rows,columns,bins"),
        ("doubles.npy", "--axes captures,rows,columns,bins"),
        ("one.npz", "--axes captures,rows,columns,bins"),
        ("two.npz", "--axes captures,rows,columns,bins --array lit"),
    ] {
        let settings = defaults.display();
        let options =
            format!("{options} --bin-width-ps 250 --recorded-cycles 100 --settings {settings}");
        let summary = scratch.replayed(&array(name), &options);
        assert_eq!(
            [&summary["pixels"], &summary["photons"]],
            [8, 808],
            "{name}"
        );
        assert_eq!(summary["warnings"], serde_json::json!([]), "{name}");
        all.push((name, scratch.events()));
    }
    for (name, events) in &all {
        assert_eq!(events, &all[0].1, "{name}");
    }
    // The peak bin is the pixel's number; that of the last is bin 7 with one photon more.
    let events = &all[0].1;
    assert!(events.len() >= 8 && events.iter().all(|event| event[1] == event[3]));
}

#[test]
fn without_names_the_last_axis_is_the_bins() {
    let scratch = Scratch::new();
    let named = scratch.replayed(&array("plain.npy"), "--axes captures,rows,columns,bins");
    let events = scratch.events();
    let summary = scratch.replayed(&array("plain.npy"), "");
    assert_eq!(scratch.events(), events);
    assert_eq!(summary, named);
}

/// 40 bins of 8x8 pixels, read as 40 rows of 8 pixels with 8 bins each unless the axes are named.
#[test]
fn a_shape_that_may_begin_with_the_bins_is_said_unless_the_axes_are_named() {
    let scratch = Scratch::new();
    let path = scratch.file("bins.npy", npy("<u2", "(40, 8, 8)", &[5; 2 * 40 * 8 * 8]));
    let warnings = |options: &str| scratch.replayed(&path, options)["warnings"].to_string();
    assert_contains(
        &warnings(""),
        "40x8x8: read as 40 rows of 8 columns with 8 bins;",
    );
    for named in ["bins,rows,columns", "rows,columns,bins"] {
        let warnings = warnings(&format!("--axes {named}"));
        assert!(!warnings.contains("40x8x8"), "{warnings}");
    }
}

#[test]
fn a_capture_has_a_length_of_its_own() {
    let scratch = Scratch::new();
    // The first capture is ten times as bright as the second.
    let data: Vec<u8> = [100u8, 10].iter().flat_map(|&count| [count; 8]).collect();
    let input = scratch.file("two.npy", npy("|u1", "(2, 8)", &data));
    let summary = scratch.replayed(&input, "--axes captures,bins");
    assert_eq!(summary["recorded_cycles"], serde_json::json!([80, 800]));
    let summary = scratch.replayed(&input, "--axes rows,bins");
    assert_eq!(summary["recorded_cycles"], serde_json::json!([800, 800]));
    assert_contains(&scratch.read("out/event-counts.svg"), ">row<");
}

#[test]
fn photon_lists_of_every_type_give_the_same_events() {
    let scratch = Scratch::new();
    let rows: String = (0..60)
        .map(|cycle| match cycle % 2 {
            0 => format!("0,{cycle},40\n3,{cycle},7\n"),
            _ => format!("0,{cycle},40\n"),
        })
        .collect();
    let csv = scratch.file("list.csv", format!("pixel,cycle,bin\n{rows}"));
    let summary = scratch.replayed(&csv, "--columns 2 --cycles 50");
    assert_eq!([&summary["photons"], &summary["not_replayed"]], [75, 15]);
    let events = scratch.read("out/events.csv");
    assert!(events.lines().count() > 2);
    for name in ["list.npy", "list_turned.npy", "list_aligned.npy"] {
        let of_array = scratch.replayed(&array(name), "--columns 2 --cycles 50");
        assert_eq!(scratch.read("out/events.csv"), events, "{name}");
        for count in ["photons", "not_replayed", "pixels", "cycles"] {
            assert_eq!(of_array[count], summary[count], "{name}");
        }
        let not_read = &of_array["recording"]["fields not read"];
        assert_eq!(not_read == "time", name == "list_turned.npy");
    }
}

#[test]
fn bins_are_padded_and_the_gate_leaves_out_what_was_added() {
    let scratch = Scratch::new();
    let mut counts = vec![1u8; 20];
    counts[12] = 200;
    let input = scratch.file("h.npy", npy("|u1", "(1, 20)", &counts));
    scratch.replay(&input, "");
    assert_contains(&scratch.read("out/report.html"), "empty bins added");
    let summary = scratch.summary();
    assert_eq!(summary["recording"]["bins of the recording"], "20");
    assert_eq!(summary["recording"]["empty bins added"], "12");
    let settings = &summary["settings"];
    assert_eq!(settings["bins"], 32);
    assert_eq!(settings["gate"], serde_json::json!([0, 19]));
    assert_eq!([&summary["photons"], &summary["gated_out"]], [219, 0]);
    // An explicit gate stays.
    let summary = scratch.replayed(&input, "--gate 4..19");
    assert_eq!(summary["settings"]["gate"], serde_json::json!([4, 19]));
}

#[test]
fn neighbours_are_added_up_and_bins_cut_off_and_all_is_counted() {
    let scratch = Scratch::new();
    let mut counts = vec![1u8; 67];
    counts[12] = 200;
    let input = scratch.file("h.npy", npy("|u1", "(1, 67)", &counts));
    // 33 pairs and a single bin: 16 pairs are kept.
    let summary = scratch.replayed(&input, "--rebin 2 --bins 16 --bin-width-ps 100");
    assert_eq!([&summary["photons"], &summary["cut_off"]], [231, 35]);
    let settings = &summary["settings"];
    assert_eq!(settings["bins"], 16);
    assert_eq!(settings["bin_width_ps"], 200.0);
    assert_eq!(settings["gate"], serde_json::Value::Null);
    let recording = &summary["recording"];
    assert_eq!(
        recording["neighbours added up"],
        "34 sums of 2, the last of 1"
    );
    assert_eq!(recording["bins cut off"], "the last 18, with 35 photons");
    assert!(scratch.events().iter().all(|event| event[3] == "6"));
    // The last bin has no partner, so the gate leaves it out with a warning.
    let summary = scratch.replayed(&input, "--rebin 2");
    assert_eq!(summary["settings"]["gate"], serde_json::json!([0, 32]));
    assert_eq!([&summary["gated_out"], &summary["cut_off"]], [1, 0]);
    // The same for photon lists.
    let rows = "0,0,255\n0,1,254\n0,2,12\n";
    let list = scratch.file("list.csv", format!("pixel,cycle,bin\n{rows}"));
    let summary = scratch.replayed(&list, "--rebin 4 --bins 64");
    assert_eq!(summary["settings"]["bin_width_ps"], 1000.0);
    assert_eq!(summary["photons"], 3);
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "less than 256 photons"
)]
#[test]
fn what_is_surely_wrong_is_said() {
    let scratch = Scratch::new();
    let defaults = scratch.file("defaults.toml", "");
    // Without a search, which would warn that 8 bins are too few.
    let warned = |input: &Path, options: &str, part: &str| {
        let options = format!("--settings {} --bin-width-ps {options}", defaults.display());
        let output = scratch.replay(input, &options);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.success() && said.lines().count() == 1,
            "{said}"
        );
        assert_contains(&said, &format!("warning: {}: ", input.display()));
        assert_contains(&said, part);
        let warnings = &scratch.summary()["warnings"];
        assert_contains(warnings[0].as_str().unwrap(), part);
        assert_contains(&scratch.read("out/report.html"), part);
        let output = scratch.replay(input, &format!("{options} --quiet"));
        assert!(output.stderr.is_empty());
    };
    let dark = scratch.file("dark.npy", npy("|u1", "(2, 8)", &[0; 16]));
    warned(&dark, "250", "no photons: all 2 histograms are empty");
    let plain = array("plain.npy");
    warned(
        &plain,
        "0.25",
        "bins of 0.25 ps: --bin-width-ps takes picoseconds; 0.25 ns are 250",
    );
    warned(
        &plain,
        "250 --recorded-cycles 9",
        "--recorded-cycles 9: half of the histograms have a bin of 10",
    );
    let summary = scratch.replayed(&plain, "--bin-width-ps 250 --recorded-cycles 1000");
    assert_eq!(summary["warnings"].as_array().map(Vec::len), Some(1));
    // 16 bins, the pulse in bin 9, before 4 rows of 8 columns.
    let mut rng = Pcg64::seed_from_u64(1);
    let mut photons = |mean: f64| Poisson::new(mean).unwrap().sample(&mut rng) as u8;
    let means = (0..16 * 32).map(|at| if at / 32 == 9 { 150.0 } else { 10.0 });
    let counts: Vec<u8> = means.map(&mut photons).collect();
    let turned = scratch.file("turned.npy", npy("|u1", "(16, 4, 8)", &counts));
    warned(&turned, "250", "the first axis looks like the bins");
    let summary = scratch.replayed(&turned, "--bin-width-ps 250 --axes bins,rows,columns");
    assert_eq!(summary["warnings"], serde_json::json!([]));
}

#[test]
fn arrays_that_hold_no_counts_are_refused() {
    let scratch = Scratch::new();
    let inputs = ["fraction.npy", "two.npz", "list.npy", "plain.npy"];
    for name in inputs {
        fs::copy(array(name), scratch.path(name)).unwrap();
    }
    scratch.file("list.csv", "pixel,cycle,bin\n0,0,5\n1,0,5\n");
    scratch.file("long.npy", npy("|u1", "(1, 1500)", &[1; 1500]));
    scratch.all_refused(
        "replay --out out --input",
        "
            fraction.npy | fraction.npy: element [1, 0, 1, 3] is 0.5
            two.npz | two.npz: 2 arrays: choose one with --array: dark, lit
            plain.npy --array a | --array is for .npz files
            plain.npy --axes rows,columns,bins | has 3 names, but the array [2, 2, 2, 8] has 4 axes
            plain.npy --axes rows,columns | one axis must be the bins
            plain.npy --axes rows,rows,bins | rows is given twice
            plain.npy --axes x,bins | captures, rows, columns, bins
            plain.npy --axes bins,captures,rows,columns | 2 bins: must be from 8 to 4096
            plain.npy --columns 3 | --columns 3: plain.npy has 2; this is for photon lists
            plain.npy --rebin 2 | makes 4 whole bins of 8
            plain.npy --rebin 0 | --rebin
            list.npy --axes bins | --axes is for arrays of histograms
            list.npy --recorded-cycles 5 | is for histograms
            list.npy --bins 32 | list.npy: record 0: bin 40 is past the last of 32 bins
            list.npy --binning 1 | list.npy: --binning needs the array: give --columns
            list.csv --binning 1 | list.csv: --binning needs the array: give --columns
            list.npy --rule window --window 3 --neighbours 8 --dead-time 0 | list.npy: --neighbours needs the array: give --columns
            plain.npy --axes captures,rows,columns,bins --rule window --window 3 --neighbours 8 | --neighbours needs one capture of columns and rows
            long.npy | 1500 bins are more than 1024: add up neighbours with --rebin 2
            plain.npy --rebin 400 | makes 0 whole bins of 8
            list.npy --rebin 400 | list.npy: --rebin 400: makes bins of 250 ps too wide
        ",
    );
}

#[test]
fn records_that_are_not_photons_are_named_by_number() {
    let scratch = Scratch::new();
    let record = |pixel: i16, cycle: i32, bin: i16| {
        [
            &pixel.to_le_bytes()[..],
            &cycle.to_le_bytes(),
            &bin.to_le_bytes(),
        ]
        .concat()
    };
    let fields = "[('pixel', '<i2'), ('cycle', '<i4'), ('bin', '<i2')]";
    let refused = |records: &[Vec<u8>], parts: &[&str]| {
        let header = header(fields, &[records.len() as u64], 128);
        let input = scratch.file("list.npy", [header, records.concat()].concat());
        scratch.refused(&scratch.replay(&input, ""), parts);
    };
    let good = record(0, 5, 1);
    let cases = [
        (record(-1, 5, 1), "a number is negative"),
        (record(0, 4, 1), "cycle 4 comes after cycle 5"),
        (record(0, 5, 128), "bin 128 is past the last of 128 bins"),
    ];
    for (bad, part) in cases {
        refused(&[good.clone(), bad], &["list.npy: record 1: ", part]);
    }
    refused(&[], &["list.npy", "no photons"]);
}

#[test]
fn events_csv_is_left_out_and_that_of_an_earlier_run_removed() {
    let scratch = Scratch::new();
    let input = array("plain.npy");
    let with = scratch.replayed(&input, "");
    let aer = fs::read(scratch.path("out/events.aer")).unwrap();
    let without = scratch.replayed(&input, "--no-csv");
    assert_eq!(with, without);
    assert!(!scratch.path("out/events.csv").exists());
    assert_eq!(fs::read(scratch.path("out/events.aer")).unwrap(), aer);
    // Files that no run has written stay.
    scratch.file("out/events.csv", "mine\n");
    let output = scratch.replay(&input, "--no-csv");
    assert!(!output.status.success());
    assert_eq!(scratch.read("out/events.csv"), "mine\n");
    let scene = scratch.file(
        "scene.toml",
        "cycles = 100\n[[surface]]\nrange_mm = 1000\nsignal = 1\n",
    );
    fs::remove_dir_all(scratch.path("out")).unwrap();
    scratch.simulated(&scene, "--no-csv");
    assert!(!scratch.path("out/events.csv").exists() && scratch.path("out/events.aer").exists());
}

#[test]
fn blocks_do_not_reach_across_captures() {
    let scratch = Scratch::new();
    let options = "--axes captures,rows,columns,bins --binning 1";
    scratch.file("three.npy", npy("|u1", "(2, 3, 4, 8)", &[1; 192]));
    scratch.all_refused(
        "replay --out out --input",
        &format!("three.npy {options} | three.npy: --binning 1: blocks of 2x2 pixels would reach across captures"),
    );
    let four = scratch.file("four.npy", npy("|u1", "(2, 4, 4, 8)", &[1; 256]));
    scratch.replayed(&four, options);
}

/// Four axes without names may have captures first; two may be an array that was flattened.
#[test]
fn neighbours_and_blocks_need_to_know_the_axes() {
    let scratch = Scratch::new();
    let counts = [1; 2 * 4 * 4 * 8];
    let needs = "needs the array: say with --axes which axes are captures, rows and columns";
    for (shape, names) in [
        ("(2, 4, 4, 8)", "captures,rows,columns,bins"),
        ("(32, 8)", "columns,bins"),
    ] {
        let path = scratch.file("a.npy", npy("|u1", shape, &counts));
        for options in ["--binning 1", "--rule window --window 3 --neighbours 4"] {
            let error = String::from_utf8(scratch.replay(&path, options).stderr).unwrap();
            assert!(error.contains(needs), "{error}");
        }
        // As the axes are named, blocks are possible: each in one capture.
        scratch.replayed(&path, &format!("--binning 1 --axes {names}"));
        scratch.replayed(&path, "");
    }
    let path = scratch.file("a.npy", npy("|u1", "(8, 4, 8)", &counts));
    scratch.replayed(&path, "--binning 1");
}

#[test]
fn exposures_of_masked_pixels_are_not_counted() {
    let scratch = Scratch::new();
    let path = scratch.file("a.npy", npy("|u1", "(2, 2, 8)", &[0; 32]));
    for (options, each) in [("", 5), ("--x 7 --l2 1999", 4), ("--frame 300", 33)] {
        for (mask, pixels) in [("", 4), ("--mask 1", 3), ("--mask 0,1,2,3", 0)] {
            let summary = scratch.replayed(&path, &format!("{options} {mask}"));
            assert_eq!(summary["expired"], each * pixels, "{options} {mask}");
        }
    }
}

#[test]
fn what_was_assumed_stands_in_the_rows() {
    let scratch = Scratch::new();
    scratch.file("a.npy", npy("|u1", "(2, 4, 8)", &[9; 64]));
    let line = "replay a.npy --out out --alpha 4";
    let width = "assumed: 250 ps; --bin-width-ps gives another";
    let output = scratch.run(line);
    let warning = "bins are taken to be 250 ps wide; --bin-width-ps changes that";
    let said = String::from_utf8(output.stderr.clone()).unwrap();
    assert_contains(&said, &format!("warning: a.npy: {warning}\n"));
    let warnings = || scratch.summary()["warnings"].to_string();
    assert_contains(&warnings(), warning);
    let printed = succeeded(output);
    assert_contains(&printed, &format!("bin width             {width}"));
    let report = || std::fs::read_to_string(scratch.path("out/report.html")).unwrap();
    for text in [
        width,
        "assumed for times: 10 MHz; --laser-hz gives another",
        "assumed for points: 60x32.2 degrees; export --fov gives another",
    ] {
        assert_contains(&report(), text);
    }
    scratch.file("rays.toml", "[rays]\nfield_of_view_degrees = [60, 30]\n");
    let given = "--bin-width-ps 250 --laser-hz 5000000 --settings rays.toml";
    let printed = scratch.printed(&format!("{line} {given}"));
    assert!(!(printed + &report()).contains("assumed"));
    assert!(!warnings().contains("taken to be"));
}

#[test]
fn a_folder_is_no_recording() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("a.npy")).unwrap();
    scratch.refused(
        &scratch.run("replay a.npy --out out"),
        &["a.npy: is a folder; name a file in it"],
    );
}

/// A pipe that nobody writes into is refused at once: a program that opens one would never go on.
#[cfg(unix)]
#[test]
fn a_pipe_is_no_recording() {
    let scratch = Scratch::new();
    scratch.file("counts.npy", npy("|u1", "(2, 8)", &[9; 16]));
    for name in ["pipe", "a.npy", "a.npz", "a.json", "a.csv", "a.aer"] {
        let made = Command::new("mkfifo").arg(scratch.path(name)).status();
        assert!(made.unwrap().success());
    }
    scratch.all_refused(
        "",
        "
            replay pipe --out out | pipe: is a pipe or a device; save it as a file first
            replay a.npy --out out | a.npy: is a pipe
            replay a.npz --out out | a.npz: is a pipe
            replay a.json --out out | a.json: is a pipe
            replay a.csv --out out | a.csv: is a pipe
            replay /dev/zero --out out | /dev/zero: is a pipe or a device
            calibrate a.json --out out.toml | a.json: is a pipe
            compare a.npy --out out | a.npy: is a pipe
            compare counts.npy --bin-width-ps 250 --truth a.npy --out out | a.npy: is a pipe or a device; save it as a file first
            simulate --depth a.npy --out out | a.npy: is a pipe
            export a.aer --format csv --out x | a.aer: is a pipe
            view a.aer | a.aer: is a pipe
        ",
    );
}

#[test]
fn three_columns_of_integers_are_photons() {
    let scratch = Scratch::new();
    let photons: Vec<[u16; 3]> = (0..300).map(|at| [at % 3, at / 3, 60]).collect();
    let data: Vec<u8> = photons
        .iter()
        .flatten()
        .flat_map(|number| number.to_le_bytes())
        .collect();
    let path = scratch.file("a.npy", npy("<u2", "(300, 3)", &data));
    let summary = scratch.replayed(&path, "--columns 3");
    assert_eq!(
        (&summary["photons"], &summary["pixels"]),
        (&300.into(), &3.into())
    );
    assert_eq!(summary["cycles"], 100);
    let text: String = photons
        .iter()
        .map(|[pixel, cycle, bin]| format!("{pixel},{cycle},{bin}\n"))
        .collect();
    let events = scratch.events();
    let csv = scratch.file("a.csv", format!("pixel,cycle,bin\n{text}"));
    scratch.replayed(&csv, "--columns 3");
    assert_eq!(scratch.events(), events);
    // Three pixels, as the axes say.
    let summary = scratch.replayed(&path, "--axes bins,columns --cycles 1000000");
    assert_eq!(summary["pixels"], 3);
}

#[test]
fn what_a_photon_list_leaves_open_is_said() {
    let scratch = Scratch::new();
    let list = |pixels: u64, first: u64| {
        let rows =
            (0..10 * pixels).map(|at| format!("{},{},60\n", at % pixels, first + at / pixels));
        scratch.file(
            "p.csv",
            format!("pixel,cycle,bin\n{}", rows.collect::<String>()),
        )
    };
    for (pixels, first, options, warning) in [
        (
            16,
            0,
            "",
            "16 pixels are taken as one row; --columns 4 makes 4x4",
        ),
        (16, 0, "--columns 4", ""),
        (
            15,
            0,
            "--columns 4",
            "15 pixels do not fill rows of 4 columns",
        ),
        (3, 10_000, "", ""),
        (3, 9999, "--cycles 10000", ""),
        (
            3,
            10_000,
            "--cycles 10000",
            "--cycles takes more, or count laser cycles from 0",
        ),
    ] {
        let options = format!("--bin-width-ps 250 {options}");
        let output = scratch.replay(&list(pixels, first), &options);
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.success() && error.is_empty() == warning.is_empty(),
            "{error}"
        );
        assert_contains(&error, warning);
    }
    let printed = scratch.printed("replay p.csv --out out --cycles 10000");
    assert_contains(&printed, "30 not replayed: --cycles N takes more");
    assert_contains(
        &printed,
        "all photons come after the laser cycles that were replayed: --cycles N takes more",
    );
    list(3, 0);
    let printed = scratch.printed("replay p.csv --out out --gate 100..120");
    assert_contains(&printed, "all photons are outside the range gate");
}
