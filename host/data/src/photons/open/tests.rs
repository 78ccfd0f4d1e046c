use std::path::PathBuf;

use tempfile::TempDir;

use super::*;
use crate::photons::npy::header;
use crate::photons::source::PixelPhotons;
use dtof_sensors::{tmf882x, tmf8829 as sensor};

/// A folder with a file of this name.
fn file(name: &str, bytes: impl AsRef<[u8]>) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Bytes in memory as an `.npy` file.
fn npy(descr: &str, shape: &[u64], bytes: &[u8]) -> Input {
    Input::in_memory("a.npy", [&header(descr, shape, 128), bytes].concat())
}

/// Histograms in memory.
fn histograms(shape: &[u64], counts: &[u8]) -> Input {
    npy("|u1", shape, counts)
}

/// A list of photons in memory, the first byte of a record being of a field that is not read.
fn list(photons: &[[u8; 4]]) -> Input {
    let descr = "[('gain', '|u1'), ('pixel', '|u1'), ('cycle', '|u1'), ('bin', '|u1')]";
    npy(descr, &[photons.len() as u64], photons.as_flattened())
}

/// The metadata of histograms of 8 bins, without options.
fn plain_metadata() -> Metadata {
    Metadata {
        is_list: false,
        bins: 8,
        bin_width_ps: BIN_WIDTH_PS,
        is_width_assumed: true,
        offset_mm: None,
        gate: None,
        has_shape: true,
        looks_swapped: false,
        captures: 1,
        cut_off: 0,
        rows: Vec::new(),
        warnings: Vec::new(),
    }
}

fn row(name: &str, value: &str) -> Row {
    (name.to_owned(), value.to_owned())
}

/// A recording is refused with this error, its folder left out, whichever way it is opened.
#[track_caller]
fn refused(input: impl Into<Input>, options: &ReadOptions, expected: &str) {
    let input = input.into();
    let folder = input.file().and_then(Path::parent).map(Path::to_owned);
    let error = |error: anyhow::Error| match &folder {
        Some(folder) => format!("{error:#}").replace(&format!("{}/", folder.display()), ""),
        None => format!("{error:#}"),
    };
    let counted = counts(input.clone(), options).map_err(error);
    assert_eq!(counted.unwrap_err(), expected);
    let opened = open(input, options).map_err(error);
    assert_eq!(opened.err().unwrap(), expected);
}

#[test]
fn histograms_keep_their_bins_and_all_is_said_of_them() {
    let bytes: Vec<u8> = (0..2 * 3 * 8).collect();
    let counts = counts(histograms(&[2, 3, 8], &bytes), &ReadOptions::default()).unwrap();
    assert_eq!(counts.array, Array::new(3, 2).unwrap());
    assert_eq!(counts.axis_names, ["column", "row"]);
    let pixels = bytes
        .chunks(8)
        .map(|bins| bins.iter().map(|&count| count.into()).collect());
    assert_eq!(counts.histograms, Histograms::of(pixels).unwrap());
    assert_eq!(counts.captures(), 1);
    assert_eq!((counts.cycles, counts.truth_mm), (None, None));
    assert_eq!(counts.metadata, plain_metadata());
}

#[test]
fn bins_and_captures_are_those_of_the_options() {
    // Three captures of two pixels of 19 bins. All bins of a capture have the same count.
    let bytes = [[1; 38], [2; 38], [3; 38]].concat();
    let input = histograms(&[3, 2, 19], &bytes);
    let options = ReadOptions {
        axes: Some("captures,columns,bins".parse().unwrap()),
        bin_width_ps: Some(U16F16::lit("0.5")),
        rebin: 2,
        bins: Some(8),
        ..ReadOptions::default()
    };
    let all = counts(input.clone(), &options).unwrap();
    assert_eq!(all.array, Array::new(2, 1).unwrap());
    assert_eq!(all.axis_names, ["column", "capture"]);
    let pixels = [2, 2, 4, 4, 6, 6].map(|count| [count; 8]);
    assert!(all.histograms.iter().eq(pixels));
    assert_eq!(all.captures(), 3);
    let rows = |cut_off: &str| {
        vec![
            row("bins of the recording", "19"),
            row("neighbours added up", "10 sums of 2, the last of 1"),
            row("bins cut off", cut_off),
        ]
    };
    let narrow = "bins of 0.5 ps: --bin-width-ps takes picoseconds; 0.5 ns are 500".to_owned();
    let expected = Metadata {
        bin_width_ps: U16F16::ONE,
        is_width_assumed: false,
        captures: 3,
        // Three bins of each pixel.
        cut_off: 3 * 2 * (1 + 2 + 3),
        rows: rows("the last 2, with 36 photons"),
        warnings: vec![narrow],
        ..plain_metadata()
    };
    assert_eq!(all.metadata, expected);

    let options = ReadOptions {
        capture: Some(1),
        ..options
    };
    let one = counts(input, &options).unwrap();
    assert!(one.histograms.iter().eq([[4; 8]; 2]));
    let capture = row("capture", "1 of 3, counted from 0");
    let expected = Metadata {
        cut_off: 3 * 2 * 2,
        rows: [vec![capture], rows("the last 2, with 12 photons")].concat(),
        ..expected
    };
    assert_eq!(one.metadata, expected);
}

#[test]
fn what_looks_wrong_is_warned_of() {
    let default = ReadOptions::default;
    let cycles = |cycles| ReadOptions {
        length: Some(RecordingLength::Cycles(cycles)),
        rebin: 2,
        ..default()
    };
    // 16 bins before 32 pixels, with the pulse in bin 9.
    let mut turned = [10; 16 * 32];
    turned[9 * 32..10 * 32].fill(200);
    let turned = || histograms(&[16, 4, 8], &turned);
    let named = ReadOptions {
        axes: Some("bins,rows,columns".parse().unwrap()),
        ..default()
    };
    let dim = |count| histograms(&[2, 16], &[[0; 16], [count; 16]].concat());
    for (input, options, expected) in [
        (
            dim(0),
            default(),
            Some("no photons: all 2 histograms are empty"),
        ),
        (dim(1), default(), None),
        (dim(101), cycles(101), None),
        (
            dim(102),
            cycles(101),
            Some(
                "--recorded-cycles 101: half of the histograms have a bin of 204 photons or more; it is the number of laser \
                 cycles that each histogram counted",
            ),
        ),
        (
            turned(),
            default(),
            Some(
                "the first axis looks like the bins, and the last like pixels; if so: --axes bins,rows,columns",
            ),
        ),
        (turned(), named, None),
    ] {
        let warnings = counts(input, &options).unwrap().metadata.warnings;
        assert_eq!(warnings, Vec::from_iter(expected));
    }
}

#[test]
fn the_photons_of_a_list_are_counted_and_replayed() {
    let photons = [[9, 2, 0, 5], [9, 2, 7, 5], [9, 0, 200, 255], [9, 2, 200, 6]];
    let options = ReadOptions {
        bins: Some(64),
        rebin: 4,
        ..ReadOptions::default()
    };
    let mut expected = vec![vec![0; 64]; 3];
    expected[2][1] = 3;
    expected[0][63] = 1;
    let metadata = Metadata {
        is_list: true,
        bins: 64,
        bin_width_ps: 4 * BIN_WIDTH_PS,
        has_shape: false,
        rows: vec![
            row("neighbours added up", "64 sums of 4"),
            row("fields not read", "gain"),
        ],
        ..plain_metadata()
    };
    let counts = counts(list(&photons), &options).unwrap();
    assert_eq!(counts.array, Array::new(3, 1).unwrap());
    assert_eq!(counts.axis_names, ["column", "row"]);
    assert!(counts.histograms.iter().eq(expected.clone()));
    assert_eq!((counts.cycles, &counts.truth_mm), (Some(201), &None));
    assert_eq!(counts.metadata, metadata);

    let mut checked = check(list(&photons), &options).unwrap();
    assert_eq!(
        (checked.metadata(), checked.array()),
        (&metadata, counts.array)
    );
    assert!(checked.counts().unwrap().histograms.iter().eq(expected));
    let mut recording = checked.photons(&options).unwrap();
    assert_eq!(recording.metadata, metadata);
    let slice = recording.photons.next_slice(201).unwrap();
    let photons = |pixel: &PixelPhotons| {
        let photons = pixel.photons.iter();
        photons
            .map(|photon| (photon.cycle, photon.code))
            .collect::<Vec<_>>()
    };
    let [first, last] = &slice.pixels[..] else {
        panic!("{slice:?}")
    };
    assert_eq!(photons(first), [(200, 63)]);
    assert_eq!(photons(last), [(0, 1), (7, 1), (200, 1)]);
}

#[test]
fn a_list_has_128_bins_and_may_leave_its_shape_open() {
    let sixteen: Vec<[u8; 4]> = (0..16).map(|pixel| [0, pixel, 9, 127]).collect();
    let expected = Metadata {
        is_list: true,
        bins: 128,
        ..plain_metadata()
    };
    let fields = row("fields not read", "gain");
    let columns = |columns| ReadOptions {
        columns,
        ..ReadOptions::default()
    };
    for (photons, options, has_shape, warning) in [
        (&sixteen[..1], columns(None), true, None),
        (&sixteen[..2], columns(None), false, None),
        (&sixteen[..2], columns(Some(2)), true, None),
        (
            &sixteen,
            columns(None),
            false,
            Some("16 pixels are taken as one row; --columns 4 makes 4x4"),
        ),
        (
            &sixteen[..1],
            ReadOptions {
                cycles: Some(9),
                ..columns(None)
            },
            true,
            Some(
                "no photon in the first 9 laser cycles: the first comes in laser cycle 9; --cycles takes more, or count \
                 laser cycles from 0",
            ),
        ),
    ] {
        let expected = Metadata {
            has_shape,
            rows: vec![fields.clone()],
            warnings: warning.map(str::to_owned).into_iter().collect(),
            ..expected.clone()
        };
        let checked = check(list(photons), &options).unwrap();
        assert_eq!(checked.metadata(), &expected);
    }
}

/// Rows of three integers are photons, unless their axes have names.
#[test]
fn an_array_of_three_columns_is_a_list() {
    let bytes: Vec<u8> = (0..24).collect();
    let input = histograms(&[8, 3], &bytes);
    let photons = check(input.clone(), &ReadOptions::default()).unwrap();
    assert_eq!(photons.metadata().rows, []);
    assert_eq!(photons.array(), Array::new(22, 1).unwrap());
    let options = ReadOptions {
        axes: Some("bins,columns".parse().unwrap()),
        ..ReadOptions::default()
    };
    let counts = counts(input, &options).unwrap();
    assert_eq!(counts.array, Array::new(3, 1).unwrap());
    assert_eq!(
        counts.histograms.histogram(1),
        [1, 4, 7, 10, 13, 16, 19, 22]
    );
    assert!(!counts.metadata.is_list);
}

/// The name tells the kind, in any case.
#[test]
fn files_are_told_by_their_names() {
    let default = ReadOptions::default();
    let (_folder, path) = file("LIST.CSV", "pixel,cycle,bin\n1,0,5\n");
    let list = counts(&path, &default).unwrap();
    assert!(list.metadata.is_list && list.histograms.count(1, 5) == 1);
    let array = [header("|u1", &[2, 8], 128), vec![9; 16]].concat();
    let (_folder, path) = file("a.Npy", array);
    let read = counts(&path, &default).unwrap();
    assert!(read.histograms.iter().eq([[9; 8]; 2]));
    for (name, expected) in [
        ("a.npz", "a.npz: not an .npz file as numpy.savez writes it"),
        (
            "a.json",
            "a.json:1: not a TMF8820 capture log: expected value at line 1 column 1",
        ),
        (
            "a.json.gz",
            "a.json.gz:1: not a TMF8820 capture log: expected value at line 1 column 1",
        ),
        (
            "a.csv.gz",
            "a.csv.gz: only the log of a sensor, .json.gz, is read compressed; unpack it with gunzip",
        ),
        (
            "a.txt",
            "a.txt: the name must end in .npy, .npz, .json, .json.gz or .csv; save another format from Python as an array \
             of counts with numpy.save",
        ),
    ] {
        let (_folder, path) = file(name, "some text");
        refused(&path, &default, expected);
    }
    let (folder, _) = file("a.txt", "");
    let error = format!(
        "{:#}",
        check(&folder.path().join("none.csv"), &default)
            .err()
            .unwrap()
    );
    assert!(
        error.ends_with("none.csv: No such file or directory (os error 2)"),
        "{error}"
    );
    let folder = folder.path();
    let error = format!("{:#}", check(folder, &default).err().unwrap());
    assert_eq!(
        error,
        format!("{}: is a folder; name a file in it", folder.display())
    );
}

#[test]
fn options_that_are_for_other_recordings_are_refused() {
    let default = ReadOptions::default;
    let axes = || ReadOptions {
        axes: Some("columns,bins".parse().unwrap()),
        ..default()
    };
    let capture = |capture| ReadOptions {
        capture: Some(capture),
        ..default()
    };
    let array = || ReadOptions {
        array: Some("lit".to_owned()),
        ..default()
    };
    let columns = |columns| ReadOptions {
        columns: Some(columns),
        ..default()
    };
    let counts = histograms(&[2, 3, 8], &[1; 48]);
    let captures = ReadOptions {
        axes: Some("captures,columns,bins".parse().unwrap()),
        ..capture(2)
    };
    for (input, options, expected) in [
        (
            list(&[[0; 4]]),
            axes(),
            "axes is for arrays of histograms; a.npy is something else",
        ),
        (
            list(&[[0; 4]]),
            capture(0),
            "capture is for histograms; a.npy holds photons",
        ),
        (
            list(&[[0; 4]]),
            array(),
            "array is for .npz files; a.npy is another file",
        ),
        (
            counts.clone(),
            array(),
            "array is for .npz files; a.npy is another file",
        ),
        (
            counts.clone(),
            columns(2),
            "columns 2: a.npy has 3; this is for photon lists",
        ),
        (
            counts.clone(),
            capture(1),
            "a.npy: capture 1: there is 1; axes says which axis of an array has captures",
        ),
        (
            counts.clone(),
            captures,
            "a.npy: capture 2: there are 2, counted from 0",
        ),
        (
            counts.clone(),
            ReadOptions {
                rebin: 263,
                ..default()
            },
            "a.npy: rebin 263: makes 0 whole bins of 8: must be at least 8",
        ),
        (
            list(&[[0; 4]]),
            ReadOptions {
                rebin: 263,
                ..default()
            },
            "a.npy: rebin 263: makes bins of 250 ps too wide",
        ),
    ] {
        refused(input, &options, expected);
    }
    assert!(check(counts, &columns(3)).is_ok());
    let (_folder, path) = file("a.csv", "pixel,cycle,bin\n0,0,5\n");
    for (options, expected) in [
        (
            axes(),
            "axes is for arrays of histograms; a.csv is something else",
        ),
        (capture(0), "capture is for histograms; a.csv holds photons"),
        (array(), "array is for .npz files; a.csv is another file"),
    ] {
        refused(&path, &options, expected);
    }
    let (_folder, path) = file("a.json", "[]");
    refused(
        &path,
        &axes(),
        "axes is for arrays of histograms; a.json is something else",
    );
}

/// The length, the masked pixels and the dead time are those of the options, and so is the seed.
#[test]
fn histograms_are_replayed_as_the_options_say() {
    let input = histograms(&[2, 8], &[[10; 8], [0, 0, 0, 20, 0, 0, 0, 0]].concat());
    let replay = |options: &ReadOptions| {
        let mut recording = open(input.clone(), options).unwrap();
        let photons = &mut recording.photons;
        let cycles = (photons.cycles(), photons.recorded_cycles());
        (cycles, photons.next_slice(200).unwrap().pixels)
    };
    let default = ReadOptions::default();
    // One photon a laser cycle of the brightest pixel.
    let (cycles, photons) = replay(&default);
    assert_eq!(cycles, (80, Some((80, 80))));
    assert_eq!(
        replay(&ReadOptions {
            seed: 1,
            ..default.clone()
        })
        .1,
        photons
    );
    assert!(
        replay(&ReadOptions {
            seed: 2,
            ..default.clone()
        })
        .1 != photons
    );
    let masked = ReadOptions {
        masked: vec![0],
        ..default.clone()
    };
    assert_eq!(replay(&masked).0, (20, Some((20, 20))));
    let length = Some(RecordingLength::Cycles(100));
    let known = ReadOptions {
        length,
        cycles: Some(90),
        dead_time: 7,
        ..default.clone()
    };
    let (cycles, photons) = replay(&known);
    assert_eq!(cycles, (90, Some((100, 100))));
    // With such a dead time no laser cycle has two photons.
    let cycles = photons[0]
        .photons
        .windows(2)
        .all(|pair| pair[0].cycle < pair[1].cycle);
    assert!(photons[0].photons.len() == 80 && cycles);
    let short = ReadOptions {
        length: Some(RecordingLength::Cycles(19)),
        ..known
    };
    let error = check(input, &short).unwrap().photons(&short).err().unwrap();
    assert_eq!(
        format!("{error:#}"),
        "a.npy: dead_time 7: bin 1 of pixel 0 has 10 photons, but was live in 9 of 19 laser cycles; give the laser cycles \
         with recorded_cycles, a shorter dead time, or leave the pixel out with masked 0"
    );
}

/// The log of a TMF8820 with three captures, of which the last has a true distance.
fn tmf8820_log() -> (TempDir, PathBuf) {
    let zones = |count: u64| format!("\"hists\": {:?}", vec![vec![count; 128]; 9]);
    let [first, second, third] = [1, 2, 3].map(zones);
    let text = format!("[{{{first}}}, {{{second}}}, {{{third}, \"dist_to_plane\": 0.25}}]");
    file("a.json", text)
}

#[test]
fn a_log_gives_the_bin_width_the_offset_and_true_distances() {
    let (_folder, path) = tmf8820_log();
    let of = |capture| {
        let options = ReadOptions {
            capture,
            ..ReadOptions::default()
        };
        counts(&path, &options).unwrap()
    };
    let all = of(None);
    assert_eq!(all.array, Array::new(9, 1).unwrap());
    assert_eq!(all.axis_names, ["zone", "capture"]);
    let zones = [1, 2, 3].map(|count| [[count; 128]; 9]);
    assert!(all.histograms.iter().eq(zones.as_flattened().to_vec()));
    let expected = Metadata {
        bins: 128,
        bin_width_ps: tmf882x::BIN_WIDTH_PS,
        is_width_assumed: false,
        offset_mm: Some(tmf882x::OFFSET_MM),
        captures: 3,
        ..plain_metadata()
    };
    assert_eq!(all.metadata, expected);
    let truth = |pixels, known| {
        let truth = (0..pixels).map(|pixel| (pixel == known).then_some(250.0));
        Some(truth.collect::<Vec<_>>())
    };
    assert_eq!(all.truth_mm, truth(27, 18 + 4));
    // One capture has its own truth, or none.
    assert_eq!([of(Some(0)).truth_mm, of(Some(1)).truth_mm], [None, None]);
    let last = of(Some(2));
    assert!(last.histograms.iter().eq([[3; 128]; 9]));
    assert_eq!(last.truth_mm, truth(9, 4));
    let past = ReadOptions {
        capture: Some(3),
        ..ReadOptions::default()
    };
    refused(
        &path,
        &past,
        "a.json: capture 3: there are 3, counted from 0",
    );
}

/// The log of a TMF8829 with two columns that are the same.
fn tmf8829_log(configuration: &str) -> (TempDir, PathBuf) {
    let pixel = format!("{{\"bin\": {:?}}}", [5; 64]);
    let rows = format!("[[{pixel}, {pixel}]]");
    let text = format!("{{\"Result_Set\": [{{\"mp_histo\": {rows}}}]{configuration}}}");
    file("a.json", text)
}

#[test]
fn a_log_says_what_it_leaves_open_and_what_was_left_out() {
    let copied = row("columns left out", "1 of 2, each the same as the first");
    let expected = Metadata {
        bins: 64,
        bin_width_ps: 4 * sensor::FINEST_BIN_PS,
        is_width_assumed: false,
        offset_mm: Some(OFFSET_MM),
        rows: vec![copied.clone()],
        ..plain_metadata()
    };
    let assumed = "the log has no bin_shift: 2 is taken, the sensor's default, with bins of 814.6 ps; --bin-width-ps gives \
                   another width";
    let default = ReadOptions::default;
    let (_folder, open) = tmf8829_log("");
    let warned = Metadata {
        warnings: vec![assumed.to_owned()],
        ..expected.clone()
    };
    assert_eq!(counts(&open, &default()).unwrap().metadata, warned);
    // Another width is given, and bins are added up.
    let given = ReadOptions {
        bin_width_ps: Some(U16F16::lit("100")),
        rebin: 2,
        ..default()
    };
    let summed = Metadata {
        bins: 32,
        bin_width_ps: U16F16::lit("200"),
        rows: vec![
            copied,
            row("bins of the recording", "64"),
            row("neighbours added up", "32 sums of 2"),
        ],
        ..expected.clone()
    };
    assert_eq!(counts(&open, &given).unwrap().metadata, summed);
    let configuration = ", \"configuration\": {\"bin_shift\": 2, \"histogram_bins\": 218}";
    let (_folder, known) = tmf8829_log(configuration);
    let counts = counts(&known, &default()).unwrap();
    assert!(counts.histograms.iter().eq([[5; 64]]));
    assert_eq!(counts.axis_names, ["column", "row"]);
    // 54 bins of four, and one of two.
    assert_eq!(
        counts.metadata,
        Metadata {
            gate: Some((0, 53)),
            ..expected
        }
    );
    let past = ReadOptions {
        rebin: 8,
        ..default()
    };
    refused(
        &known,
        &past,
        "a.json: rebin 8: makes 6 whole bins of 54: must be at least 8",
    );
}
