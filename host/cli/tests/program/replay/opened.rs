//! Recordings as the library opens them: whole histograms, and the logs of sensors.

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use dtof_core::Array;
use dtof_photons::input::{Input, NpyArray};
use dtof_photons::npy::header;
use dtof_photons::open::{BIN_WIDTH_PS, Counts, ReadOptions, check, counts, open};
use dtof_sensors::{tmf882x, tmf8829};
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::common::Scratch;

fn counts_of(name: &str, text: &str) -> Counts {
    let scratch = Scratch::new();
    let path = scratch.file(name, text);
    counts(&path, &ReadOptions::default()).unwrap()
}

#[test]
fn photon_lists_are_summed_over_their_laser_cycles() {
    let counts = counts_of(
        "a.csv",
        // The slices are longer than that.
        "pixel,cycle,bin\n2,0,5\n2,7,5\n0,700000000,127\n2,700000000,6\n",
    );
    assert_eq!(counts.array, Array::new(3, 1).unwrap());
    assert_eq!(counts.cycles, Some(700_000_001));
    let [pixels] = &counts.captures[..] else {
        panic!("one capture")
    };
    let sums: Vec<u64> = pixels.iter().map(|bins| bins.iter().sum()).collect();
    assert_eq!(sums, [1, 0, 3]);
    assert_eq!([pixels[2][5], pixels[2][6], pixels[0][127]], [2, 1, 1]);
    assert_eq!(counts.metadata.bin_width_ps, BIN_WIDTH_PS);
    assert!(!counts.metadata.has_shape);
}

/// A slice has as many laser cycles as the brightest part of a list allows.
#[test]
fn a_list_says_how_bright_its_brightest_part_is() {
    let scratch = Scratch::new();
    let rows = "0,300,5\n".repeat(512);
    let text = format!("pixel,cycle,bin\n0,0,1\n{rows}0,1000000000,1\n");
    let path = scratch.file("burst.csv", text);
    let recording = open(&path, &ReadOptions::default()).unwrap();
    assert_eq!(recording.photons.photons_per_cycle(), 2.0);
}

#[test]
fn the_truth_of_a_log_is_that_of_its_centre_zones() {
    let zone = format!("[{}]", ["3"; 128].join(","));
    let zones = format!("\"hists\": [{}]", [zone.as_str(); 9].join(","));
    let log = format!("[{{{zones}}}, {{{zones}, \"dist_to_plane\": 0.25}}]");
    let counts = counts_of("a.json", &log);
    assert_eq!(counts.captures.len(), 2);
    let truth = counts.truth_mm.unwrap();
    let expected = |address: usize| (address == 9 + 4).then_some(250.0);
    assert_eq!(truth, (0..18).map(expected).collect::<Vec<_>>());
    assert_eq!(counts.metadata.bin_width_ps, tmf882x::BIN_WIDTH_PS);
}

#[test]
fn a_log_of_64_zones_is_that_of_a_tmf8828() {
    let zone = |count: usize| format!("[{}]", vec![count.to_string(); 128].join(","));
    let capture = |zones: usize| {
        let zones: Vec<String> = (0..zones).map(zone).collect();
        format!(
            "{{\"hists\": [{}], \"dist_to_plane\": 0.25}}",
            zones.join(",")
        )
    };
    let counts = counts_of("a.json", &format!("[{0}, {0}]", capture(64)));
    assert_eq!(
        (counts.array, counts.captures.len()),
        (Array::new(8, 8).unwrap(), 2)
    );
    assert_eq!(counts.captures[1][63], [63; 128]);
    assert_eq!(counts.metadata.bin_width_ps, tmf882x::BIN_WIDTH_8X8_PS);
    // Neither its offset nor its centre is known.
    assert_eq!((counts.metadata.offset_mm, counts.truth_mm), (None, None));
    let scratch = Scratch::new();
    scratch.file("mixed.json", format!("[{}, {}]", capture(64), capture(9)));
    scratch.file("few.json", format!("[{}]", capture(16)));
    scratch.all_refused(
        "replay --out out --input",
        "
            mixed.json | mixed.json: capture 1 has 9 zones, not 64 as capture 0
            few.json | few.json: capture 0 has 16 zones, not 9 or 64
        ",
    );
}

/// A log of two frames, two rows and two columns; `bin` gives the count of a bin in a column.
fn tmf8829_log(bin: impl Fn(usize, usize) -> usize, configuration: &str) -> String {
    let pixel = |column: usize| {
        let bins: Vec<String> = (0..64)
            .map(|place| bin(column, place).to_string())
            .collect();
        format!("{{\"bin\": [{}]}}", bins.join(","))
    };
    let row = format!("[{}, {}]", pixel(0), pixel(1));
    let frame = format!("{{\"mp_histo\": [{row}, {row}], \"results\": []}}");
    format!("{{\"Result_Set\": [{frame}, {frame}]{configuration}}}")
}

#[test]
fn a_tmf8829_log_is_told_by_its_content_and_read_packed_or_not() {
    let configuration = ", \"configuration\": {\"bin_shift\": 2, \"histogram_bins\": 218}";
    let log = tmf8829_log(|column, place| 100 * column + place, configuration);
    let plain = counts_of("a.json", &log);
    assert_eq!(plain.array, Array::new(2, 2).unwrap());
    assert_eq!(plain.captures.len(), 2);
    assert_eq!(plain.captures[1][3][7], 107);
    // 218 of the sensor's own bins are 54 of four, and one of two.
    assert_eq!(plain.metadata.gate, Some((0, 53)));
    assert_eq!(plain.metadata.bin_width_ps, 4 * tmf8829::FINEST_BIN_PS);
    assert_eq!(plain.metadata.offset_mm, Some(tmf8829::OFFSET_MM));
    // As some editors save it.
    let marked = counts_of("a.json", &format!("\u{feff}{log}"));
    assert_eq!(marked.captures, plain.captures);
    let scratch = Scratch::new();
    // The name does not reveal the format.
    for name in ["b.json.gz", "b.json"] {
        let file = File::create(scratch.path(name)).unwrap();
        let mut packed = GzEncoder::new(file, Compression::default());
        packed.write_all(log.as_bytes()).unwrap();
        packed.finish().unwrap();
        let packed = counts(&scratch.path(name), &ReadOptions::default()).unwrap();
        assert_eq!(packed.captures, plain.captures);
    }
}

#[test]
fn columns_that_are_all_the_same_are_read_once() {
    let counts = counts_of("a.json", &tmf8829_log(|_, place| place, ""));
    assert_eq!(counts.array, Array::new(1, 2).unwrap());
    assert_eq!(counts.captures[0].len(), 2);
    assert_eq!(counts.metadata.gate, None);
    let row = &counts.metadata.rows[0];
    assert_eq!(row.0, "columns left out");
    assert_eq!(row.1, "1 of 2, each the same as the first");
}

#[test]
fn logs_that_are_damaged_are_refused() {
    let scratch = Scratch::new();
    let good = tmf8829_log(|_, _| 1, "");
    scratch.file("short.json", good.replacen("1,1,", "1,", 1));
    scratch.file("empty.json", "{\"Result_Set\": []}");
    scratch.file("off.json", "{\"Result_Set\": [{}]}");
    scratch.file("other.json", "{\"a\": 1}");
    scratch.file("cut.json", &good[..good.len() / 2]);
    scratch.file("cut.json.gz", [0x1f, 0x8b, 8, 0, 0]);
    let odd = good.replacen("}, {\"bin\"", "}], [{\"bin\"", 1);
    scratch.file("odd.json", odd);
    scratch.all_refused(
        "replay --out out --input",
        "
            short.json | short.json: frame 0, row 0, column 0 has 63 bins, not 64
            empty.json | empty.json: no frames
            off.json | off.json: frame 0 has no mp_histo
            other.json | other.json:1: not a TMF8829 log: missing field
            cut.json | cut.json:1: not a TMF8829 log
            cut.json.gz | cut.json.gz
            odd.json | odd.json: frame 0 is not of 3 rows and 1 columns as frame 0
        ",
    );
}

#[test]
fn a_log_without_a_bin_shift_is_read_with_a_warning() {
    let log = |configuration: &str| tmf8829_log(|_, place| place, configuration);
    let warned = counts_of("a.json", &log(""));
    let [warning] = &warned.metadata.warnings[..] else {
        panic!("{:?}", warned.metadata.warnings);
    };
    assert!(
        warning.contains("no bin_shift: 2 is taken") && warning.contains("814.6 ps"),
        "{warning}"
    );
    let known = counts_of("a.json", &log(", \"configuration\": {\"bin_shift\": 2}"));
    assert_eq!(known.metadata.warnings, [""; 0]);
}

/// A small file may unpack to more than any memory holds.
#[test]
fn packed_logs_that_are_damaged_or_too_large_are_refused() {
    let scratch = Scratch::new();
    let packed = |name: &str, parts: usize, part: &[u8], behind: &[u8]| {
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        for _ in 0..parts {
            packed.write_all(part).unwrap();
        }
        let bytes = [packed.finish().unwrap(), behind.to_vec()].concat();
        scratch.file(name, bytes);
    };
    let good = tmf8829_log(|_, place| place, "");
    packed("behind.json.gz", 1, good.as_bytes(), b"garbage garbage");
    packed("a.csv.gz", 1, b"pixel,cycle,bin\n0,0,0\n", b"");
    packed("large.json.gz", 257, &[b' '; 1 << 20], b"");
    scratch.all_refused(
        "replay --out out --input",
        "
            behind.json.gz | behind.json.gz: the compressed file is damaged
            large.json.gz | large.json.gz: more than 256 MiB when unpacked; unpack it, as with gunzip\n
            a.csv.gz | a.csv.gz: only the log of a sensor, .json.gz, is read compressed; unpack it with gunzip\n
        ",
    );
}

/// No photon is lost silently if another program cuts a list while it is read.
#[test]
fn a_list_that_is_cut_while_it_is_read_is_refused() {
    let scratch = Scratch::new();
    let rows = |all: u64| (0..all).map(|cycle| format!("0,{cycle},60\n"));
    let csv = |all| format!("pixel,cycle,bin\n{}", rows(all).collect::<String>());
    let descr = "[('pixel', '<u2'), ('cycle', '<u4'), ('bin', '<u2')]";
    let records =
        (0..50_000u32).flat_map(|cycle| [&[0; 2], &cycle.to_le_bytes()[..], &[60, 0]].concat());
    let npy = [header(descr, &[50_000], 128), records.collect()].concat();
    let all = ReadOptions {
        cycles: u64::MAX,
        ..ReadOptions::default()
    };
    // More than is read ahead.
    for (name, bytes, cut) in [
        (
            "list.csv",
            csv(50_000).into_bytes(),
            csv(40_000).len() as u64,
        ),
        ("list.npy", npy, 128 + 8 * 40_000),
    ] {
        let path = scratch.file(name, bytes);
        let mut recording = open(&path, &all).unwrap();
        assert_eq!(recording.photons.cycles(), 50_000);
        let file = std::fs::OpenOptions::new().write(true).open(&path);
        file.unwrap().set_len(cut).unwrap();
        let slice = recording.photons.next_slice(50_000);
        let error = format!("{:#}", slice.unwrap_err());
        assert!(
            error.ends_with(": the file became shorter while it was read"),
            "{error}"
        );
    }
    // Another file is in its place.
    let path = scratch.file("list.csv", csv(500));
    let mut checked = check(&path, &all).unwrap();
    scratch.file("other.csv", csv(400));
    std::fs::rename(scratch.path("other.csv"), &path).unwrap();
    assert_eq!(checked.counts().unwrap().captures[0][0][60], 500);
    let slice = checked.photons(&all).unwrap().photons.next_slice(500);
    let error = format!("{:#}", slice.unwrap_err());
    let expected = "the file changed while it was read: it had 500 photons up to cycle 499, and now has 400 up to cycle 399";
    assert!(error.ends_with(expected), "{error}");
}

/// A photon list in memory gives the same photons and errors as a file.
#[test]
fn an_array_in_memory_is_read_as_its_file_is() {
    let scratch = Scratch::new();
    let descr = "[('pixel', '<u2'), ('cycle', '<u2'), ('bin', '|u1')]";
    let list = |rows: &[[u8; 5]]| {
        let header = header(descr, &[rows.len() as u64], 128);
        let path = scratch.path("list.npy");
        std::fs::write(&path, [&header[..], rows.as_flattened()].concat()).unwrap();
        let array = NpyArray {
            name: path.display().to_string(),
            header,
            data: Box::new(rows.concat()),
        };
        [Input::File(path), Input::Array(Arc::new(array))]
    };
    let photons = list(&[[0, 0, 0, 0, 9], [3, 0, 1, 1, 127], [0, 0, 2, 1, 5]]);
    let [file, memory] = photons.map(|input| {
        let mut recording = open(&input, &ReadOptions::default()).unwrap();
        let slice = recording.photons.next_slice(300).unwrap();
        (recording.metadata, recording.photons.cycles(), slice.pixels)
    });
    assert_eq!(file, memory);
    assert_eq!(file.1, 259);
    let refused = list(&[[0, 0, 1, 1, 0], [0, 0, 0, 1, 0]]);
    let [file, memory] = refused.map(|input| {
        let error = open(&input, &ReadOptions::default()).err().unwrap();
        format!("{error:#}")
    });
    assert_eq!(file, memory);
    assert!(file.contains("record 1: cycle 256 comes after cycle 257: photons must be in order"));
}
