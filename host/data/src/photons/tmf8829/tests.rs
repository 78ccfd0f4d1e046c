use super::*;

/// A log of frames of rows of pixels as JSON. All bins of a pixel have the same count.
fn log(frames: &[&[&[u64]]], configuration: &str) -> String {
    let pixel = |count: &u64| format!("{{\"bin\": {:?}}}", [*count; BINS]);
    let row = |row: &&[u64]| {
        let pixels: Vec<String> = row.iter().map(pixel).collect();
        format!("[{}]", pixels.join(", "))
    };
    let frame = |rows: &&[&[u64]]| {
        let rows: Vec<String> = rows.iter().map(row).collect();
        format!("{{\"mp_histo\": [{}], \"results\": []}}", rows.join(", "))
    };
    let frames: Vec<String> = frames.iter().map(frame).collect();
    format!("{{\"Result_Set\": [{}]{configuration}}}", frames.join(", "))
}

fn parse(text: &str) -> Result<Tmf8829Log> {
    read("a.json", text.as_bytes())
}

fn configured(configuration: &str) -> String {
    let configuration = format!(", \"configuration\": {{{configuration}}}");
    log(&[&[&[1]]], &configuration)
}

#[test]
fn frames_are_captures_of_rows_and_columns() {
    let frames: [&[&[u64]]; 2] = [&[&[1, 2, 3], &[4, 5, 6]], &[&[7, 7, 7], &[8, 8, 8]]];
    let read = parse(&log(&frames, "")).unwrap();
    assert_eq!(read.array, Array::new(3, 2).unwrap());
    let pixels = [1, 2, 3, 4, 5, 6, 7, 7, 7, 8, 8, 8];
    assert!(read.histograms.iter().eq(pixels.map(|count| [count; BINS])));
    assert_eq!(read.rows, []);
}

#[test]
fn columns_that_are_all_the_same_are_read_once() {
    let frames: [&[&[u64]]; 2] = [&[&[1, 1, 1], &[4, 4, 4]], &[&[7, 7, 7], &[8, 8, 8]]];
    let copied = parse(&log(&frames, "")).unwrap();
    assert_eq!(copied.array, Array::new(1, 2).unwrap());
    let pixels = [1, 4, 7, 8].map(|count| [count; BINS]);
    assert!(copied.histograms.iter().eq(pixels));
    let row = ("columns left out", "2 of 3, each the same as the first");
    assert_eq!(copied.rows, [(row.0.to_owned(), row.1.to_owned())]);
    // One column has no copy.
    let single = parse(&log(&[&[&[1], &[1]]], "")).unwrap();
    assert_eq!(single.array, Array::new(1, 2).unwrap());
    assert_eq!(single.rows, []);
}

#[test]
fn the_configuration_tells_how_wide_the_bins_are_and_which_were_measured() {
    let own = FINEST_BIN_PS;
    for (configuration, expected) in [
        ("", (4 * own, 64, Some(2))),
        ("\"bin_shift\": 0", (own, 64, None)),
        ("\"bin_shift\": 8", (256 * own, 64, None)),
        // 54 of four, and one of two. Of an assumed shift, too.
        (
            "\"bin_shift\": 2, \"histogram_bins\": 218",
            (4 * own, 54, None),
        ),
        ("\"histogram_bins\": 218", (4 * own, 54, Some(2))),
        ("\"bin_shift\": 0, \"histogram_bins\": 63", (own, 63, None)),
        // No number of them that could be.
        ("\"bin_shift\": 0, \"histogram_bins\": 65", (own, 64, None)),
        (
            "\"bin_shift\": 2, \"histogram_bins\": 3",
            (4 * own, 64, None),
        ),
    ] {
        let log = parse(&configured(configuration)).unwrap();
        let read = (log.bin_width_ps, log.measured_bins, log.assumed_shift);
        assert_eq!(read, expected, "{configuration}");
    }
    for shift in [9, 16, 40] {
        let error = parse(&configured(&format!("\"bin_shift\": {shift}"))).unwrap_err();
        let expected = format!("a.json: bin_shift {shift}: bins are too wide");
        assert_eq!(format!("{error:#}"), expected);
    }
}

#[test]
fn logs_that_are_damaged_are_refused() {
    let off = "frame 1 has no mp_histo: histograms were off";
    let good = log(&[&[&[1, 2]]], "");
    let with = |frame: &str| good.replacen("]}]}", &format!("]}}, {frame}]}}"), 1);
    for (text, expected) in [
        ("{\"Result_Set\": []}", "no frames"),
        (&with("{}"), off),
        (&with("{\"mp_histo\": []}"), off),
        (
            "{\"Result_Set\": [{\"mp_histo\": [[]]}]}",
            "frame 0 is not of 1 rows and 0 columns as frame 0",
        ),
        (
            &log(&[&[&[1, 2], &[3, 4]], &[&[1, 2]]], ""),
            "frame 1 is not of 2 rows and 2 columns as frame 0",
        ),
        (
            &log(&[&[&[1, 2], &[3]]], ""),
            "frame 0 is not of 2 rows and 2 columns as frame 0",
        ),
        (
            &good.replacen("2, 2,", "2,", 1),
            "frame 0, row 0, column 1 has 63 bins, not 64",
        ),
    ] {
        let error = format!("{:#}", parse(text).unwrap_err());
        assert_eq!(error, format!("a.json: {expected}"));
    }
    for (text, expected) in [
        (
            "{\"a\": 1}",
            "missing field `Result_Set` at line 1 column 8",
        ),
        (
            "{\n\"Result_Set\": [{}",
            "EOF while parsing a list at line 2 column 17",
        ),
    ] {
        let error = parse(text).unwrap_err().to_string();
        let line = 1 + text.matches('\n').count();
        assert_eq!(
            error,
            format!("a.json:{line}: not a TMF8829 log: {expected}")
        );
    }
}
