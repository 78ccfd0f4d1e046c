//! Bad input gives one clear line and a failure, never a panic and never a
//! half-written result.

use std::fs::File;
use std::process::Stdio;
use std::time::{Duration, Instant};

use dtof_data::photons::npy::header;

use crate::common::{Scratch, assert_contains, names, npy, table};

const CSV_HEADER: &str = "pixel,cycle,bin\n";
/// One photon.
const PHOTON: &str = "pixel,cycle,bin\n0,0,0\n";

/// `dtof replay` of a file with these bytes must be refused.
#[track_caller]
fn refused(name: &str, bytes: impl AsRef<[u8]>, parts: &[impl AsRef<str>]) {
    let scratch = Scratch::new();
    let input = scratch.file(name, bytes);
    scratch.refused(&scratch.replay(&input, ""), parts);
}

#[test]
fn rows_that_are_not_photons_are_named_by_line() {
    for row in table(
        r#"
        0,1,2\n0,2\n | photons.csv:3: 2 fields, not 3
        0,5,2\n0,4,2\n | photons.csv:3: cycle 4 comes after cycle 5: photons must be in order of their cycles
        0,5,128\n | photons.csv:2: bin 128 is past the last of 128 bins (see --bins and --rebin)
    "#,
    ) {
        refused("photons.csv", format!("{CSV_HEADER}{}", row[0]), &row[1..]);
    }
}

#[test]
fn npy_files_that_are_not_recordings_are_refused() {
    for (bytes, part) in [
        (
            npy("<i4", "(4, 8)", &[255; 128]),
            "recorded.npy: element [0, 0] is negative: -1",
        ),
        (
            npy("<u4", "(3, 16)", &[0; 128]),
            "recorded.npy: the header claims [3, 16] elements",
        ),
        (
            b"nonsense".to_vec(),
            "recorded.npy: not an .npy file as numpy.save writes it",
        ),
    ] {
        refused("recorded.npy", bytes, &[part]);
    }
}

#[test]
fn a_damaged_archive_is_refused() {
    let mut damaged = include_bytes!("numpy/one.npz").to_vec();
    // The checksum in the list of arrays.
    let entry = damaged.windows(4).position(|four| four == b"PK\x01\x02");
    damaged[entry.unwrap() + 16] ^= 1;
    refused(
        "one.npz",
        damaged,
        &[
            "one.npz: array ",
            "the archive is damaged: Invalid checksum",
        ],
    );
}

#[test]
fn json_files_that_are_not_logs_are_refused() {
    for row in table(
        r#"
        [\n{"hists": [[1,\n | log.json:3: not a TMF8820 capture log
        {"Result_Set": []} | log.json: no frames
    "#,
    ) {
        refused("log.json", &row[0], &row[1..]);
    }
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTON);
    scratch.all_refused(
        "replay --out out --input photons.csv",
        r#"
            --l1 100 --l2 100 | --l2 100: must be greater than --l1 100
            --x 0 | --x 0: must be a whole number from 1 to 65535
            --x 50 | --x 50: must not be greater than l1 40
            --x 30 --l2 50 | --x 30: no multiple of it lies strictly between l1 40 and --l2 50
            --l2 65536 | 65536
            --alpha 256 | --alpha
            --alpha -1 | must be a number from 0 to
            --alpha NaN | --alpha
            --alpha 0.001 | less than half
            --bins 100 | power of two
            --threshold-mm 50 | --threshold-mm needs --dynamic-depth
            --dynamic-depth --threshold-mm 0.01 | --threshold-mm 0.01: | less than 1/512 bin
            --bins 4 | power of two
            --bins 2048 | power of two
            --columns 0 | --columns
            --gate 0..128 | past the last bin
            --gate 20..26 | fewer than 8 bins
            --gate 30..20 | the first bin must come before the last
            --gate 20 | FIRST..LAST
            --min-count 0 | --min-count
            --min-count 1024 | --min-count
            --bin-width-ps 0 | --bin-width-ps 0: too narrow: a bin would be 0 mm; give picoseconds
            --bin-width-ps 0.00003 | --bin-width-ps 0.00003: too narrow
            --bin-width-ps 65535 | 8388 m
            --bin-width-ps wide | --bin-width-ps
            --offset-mm 9e9 | --offset-mm
            --cycles 0 | --cycles
            --photons-per-cycle 1 | --photons-per-cycle is for histograms
            --recorded-cycles 0 | --recorded-cycles
            --nonsense | --nonsense
            --apha 4 | --apha is unknown; is it --alpha?
        "#,
    );
    scratch.file("wide.csv", "pixel,cycle,bin\n50000,0,1\n");
    scratch.all_refused(
        "replay --out out --input wide.csv",
        "--columns 40000 | --columns 40000: makes more than 65,536 pixels",
    );
    scratch.file("h.npy", npy("<u1", "(8,)", &[1; 8]));
    scratch.all_refused(
        "replay --out out --input h.npy",
        r#"
            --photons-per-cycle 0 | --photons-per-cycle
            --photons-per-cycle inf | --photons-per-cycle
            --photons-per-cycle 1e-300 | longer than 2^40
            --photons-per-cycle 1 --recorded-cycles 5 | cannot be used with
        "#,
    );
}

/// Two counts of pixel 3, in the second of two captures, are together more than 64 bits hold.
#[test]
fn a_pixel_with_more_photons_than_can_be_counted_is_named() {
    let scratch = Scratch::new();
    let mut counts = [1u64; 4 * 8];
    counts[25..27].fill(1 << 63);
    let data: Vec<u8> = counts
        .iter()
        .flat_map(|count| count.to_le_bytes())
        .collect();
    scratch.file("h.npy", npy("<u8", "(2, 1, 2, 8)", &data));
    scratch.file("given.toml", "");
    let named = "h.npy: pixel 3 holds more than 2^40 photons";
    for line in [
        "replay h.npy --out out",
        "replay h.npy --out out --settings given.toml",
        "calibrate h.npy --out new.toml --bin-width-ps 250",
        "compare h.npy --out out --bin-width-ps 250",
    ] {
        scratch.refused(&scratch.run(line), &[named]);
    }
}

#[test]
fn files_that_are_not_there_or_not_known_are_refused() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("folder.csv")).unwrap();
    scratch.file("a.txt", "");
    scratch.all_refused(
        "replay --out out --input",
        "
            none.csv | none.csv | No such file
            none.npy | none.npy | No such file
            none.json | none.json | No such file
            a.txt | a.txt | .npy, .npz, .json, .json.gz or .csv
            folder.csv | folder.csv
        ",
    );
    scratch.refused(&scratch.run("replay"), &["<FILE>"]);
}

#[test]
fn an_output_folder_that_cannot_be_written_is_refused() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTON);
    scratch.file("taken", "a file, not a folder");
    for folder in ["taken", "taken/below", "/proc/none"] {
        let output = scratch.run(&format!("replay --input photons.csv --out {folder}"));
        scratch.refused(&output, &[folder]);
    }
    assert_eq!(scratch.read("taken"), "a file, not a folder");
}

#[test]
fn a_folder_in_the_place_of_a_result_is_refused() {
    let scratch = Scratch::new();
    std::fs::create_dir_all(scratch.path("out/report.html")).unwrap();
    let input = scratch.file("photons.csv", PHOTON);
    let output = scratch.replay(&input, "");
    assert!(!output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_contains(&message, "report.html: exists and is not a file");
}

#[test]
fn what_a_run_that_was_killed_has_left_is_removed() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", PHOTON);
    scratch.replayed(&input, "");
    scratch.file("out/.dtof-run-left.partial", "from a run that was killed");
    let of_others = ["export-a", "recording-b"].map(|of| format!("out/.dtof-{of}.partial"));
    for name in &of_others {
        scratch.file(name, "of an export or a recording under way");
    }
    scratch.replayed(&input, "");
    assert!(!scratch.path("out/.dtof-run-left.partial").exists());
    assert!(of_others.iter().all(|name| scratch.path(name).exists()));
}

#[test]
fn a_folder_to_which_another_run_writes_is_refused() {
    let scratch = Scratch::new();
    let input = scratch.file("photons.csv", PHOTON);
    let other = scratch.file("out/.dtof-run-other.partial", "");
    let other_run = File::open(&other).unwrap();
    other_run.lock().unwrap();
    let refused = scratch.replay(&input, "");
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success());
    assert_contains(&message, "out: another run writes there");
    assert_eq!(names(&scratch.path("out")), [".dtof-run-other.partial"]);
    drop(other_run);
    scratch.replayed(&input, "");
    assert!(!other.exists());
}

#[test]
fn output_that_cannot_be_written_is_an_error_not_a_panic() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTON);
    let full = || File::options().write(true).open("/dev/full").unwrap();
    let run = |line: &str, errors: Stdio| {
        let mut command = scratch.command(line);
        command.stdout(full()).stderr(errors).output().unwrap()
    };
    let output = run("replay --input photons.csv --out out", Stdio::piped());
    assert_eq!(output.status.code(), Some(1));
    assert_contains(&String::from_utf8(output.stderr).unwrap(), "No space left");
    let output = run("decode none", full().into());
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn a_text_file_that_is_not_utf_8_is_named_with_its_line() {
    let scratch = Scratch::new();
    let photon = scratch.file("photons.csv", PHOTON);
    let bytes = b"# first\n# Pr\xfcfstand\n[run]\nseed = 1\n";
    let part = ": line 2: not UTF-8; save the file as UTF-8";
    let file = scratch.file("latin.toml", bytes);
    let output = scratch.replay(&photon, "--settings latin.toml");
    scratch.refused(&output, &[&format!("latin.toml{part}")]);
    scratch.refused(
        &scratch.simulate(&file, ""),
        &[&format!("latin.toml{part}")],
    );
}

#[test]
fn a_failed_run_leaves_the_results_of_the_one_before() {
    let scratch = Scratch::new();
    let good = scratch.file("good.csv", PHOTON);
    scratch.replayed(&good, "");
    let before = scratch.read("out/summary.json");
    let bad = scratch.file("bad.csv", format!("{CSV_HEADER}0,0,0\n0,1,x\n"));
    assert!(!scratch.replay(&bad, "").status.success());
    assert_eq!(scratch.read("out/summary.json"), before);
    let names = names(&scratch.path("out"));
    assert!(names.iter().all(|name| !name.starts_with('.')), "{names:?}");
}

/// Half a terabyte, of which the disk holds the header.
#[test]
fn an_array_with_more_pixels_than_addresses_is_refused_before_it_is_read() {
    let scratch = Scratch::new();
    let header = header("<u4", &[1 << 15, 1 << 15, 128], 128);
    let large = scratch.file("large.npy", &header);
    let file = std::fs::OpenOptions::new().write(true).open(large).unwrap();
    file.set_len(header.len() as u64 + (1 << 39)).unwrap();
    let begun = Instant::now();
    for command in [
        "replay --input large.npy --out out",
        "calibrate large.npy --out dtof.toml",
    ] {
        let line = "large.npy: 1,073,741,824 pixels are more than 65,536: cut the array into tiles, as docs/recordings.md shows";
        scratch.refused(&scratch.run(command), &[line]);
    }
    assert!(begun.elapsed() < Duration::from_secs(20));
    scratch.file("list.csv", "pixel,cycle,bin\n65536,0,1\n");
    scratch.all_refused(
        "replay --out out --input list.csv --columns",
        "1024 | pixel 65536 is above 65535, the last address: cut the array into tiles",
    );
}
