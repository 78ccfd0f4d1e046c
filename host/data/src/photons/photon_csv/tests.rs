use proptest::prelude::*;

use super::*;

const HEADER: &str = "pixel,cycle,bin\n";

/// The photons of a file, or its error.
fn photons(text: impl Into<Vec<u8>>) -> Result<Vec<RawPhoton>, String> {
    let read = || {
        let mut reader = CsvReader::open(&Input::in_memory("a.csv", text))?;
        let mut photons = Vec::new();
        // No test has more.
        while photons.len() < 5
            && let Some(photon) = reader.next().with_context(|| reader.place())?
        {
            photons.push(photon);
        }
        anyhow::Ok(photons)
    };
    read().map_err(|error| format!("{error:#}"))
}

/// Columns by their names, in any order and case, beside others, between commas, semicolons or tabs. Spreadsheets may add
/// a byte order mark, other line ends and blank lines.
#[test]
fn columns_are_found_by_name() {
    for text in [
        "pixel,cycle,bin\n7,300,60\n0,301,5\n",
        "cycle,bin,pixel\n300,60,7\n301,5,0",
        "Bin;Pixel;Cycle\n60;7;300\n5;0;301\n",
        "pixel\tcycle\tbin\ttime\n7\t300\t60\t0.5 s\n0\t301\t5\t\n",
        " Pixel , note , Cycle , BIN\n7 , \"a\" , 300 , 60\n0, b,301 ,5\n",
        "\u{feff}pixel,cycle,bin\r\n\r\n7,300,60\r\n\n\n0,301,5\r\n\r\n",
        "pixel;cycle;bin;\r\n7;300;60;\r\n\r\n0;301;5;\r",
        "pixel,cycle,bin\n007,0300, 60\n0 ,301,5\r",
    ] {
        assert_eq!(photons(text), Ok(vec![[7, 300, 60], [0, 301, 5]]), "{text}");
    }
    assert_eq!(photons(HEADER), Ok(vec![]));
}

#[test]
fn numbers_have_up_to_64_bits() {
    let rows = "9999999999999999999,18446744073709551615,00000000000000000000003\n";
    let photon = [9_999_999_999_999_999_999, u64::MAX, 3];
    assert_eq!(photons(format!("{HEADER}{rows}")), Ok(vec![photon]));
}

#[test]
fn files_without_the_columns_are_refused() {
    for (text, expected) in [
        (&b""[..], "the file is empty"),
        (
            b"cycle,pixels,bin\n0,1,2\n",
            "the header must have the columns pixel, cycle and bin, not \"cycle,pixels,bin\"",
        ),
        (
            b"pixel\n0\n",
            "the header must have the columns pixel, cycle and bin, not \"pixel\"",
        ),
        (
            b"pi\xffel,cycle,bin\n",
            "the header must have the columns pixel, cycle and bin, not \"bytes that are not UTF-8\"",
        ),
        (
            b"pixel,cycle,bin, Pixel\n0,1,2,0\n",
            "the header must have the columns pixel, cycle and bin once, not pixel twice",
        ),
        (
            b"bin;pixel;cycle;cycle;CYCLE\n",
            "the header must have the columns pixel, cycle and bin once, not cycle twice",
        ),
    ] {
        assert_eq!(photons(text), Err(format!("a.csv:1: {expected}")));
    }
}

#[test]
fn rows_that_are_not_photons_are_refused_with_their_line() {
    for (rows, expected) in [
        ("0,1,2\n0,2\n", "3: 2 fields, not 3"),
        ("0,1,2\n0,2,3,4\n", "3: 4 fields, not 3"),
        ("0,1,2\n\n\n0,2\n\n", "5: 2 fields, not 3"),
        ("0;1;2\n", "2: pixel \"0;1;2\" is not a whole number from 0"),
        ("+1,0,2\n", "2: pixel \"+1\" is not a whole number from 0"),
        ("0, x,2\n", "2: cycle \" x\" is not a whole number from 0"),
        ("0,-1,2\n", "2: cycle \"-1\" is not a whole number from 0"),
        ("0,0,2.5\n", "2: bin \"2.5\" is not a whole number from 0"),
        (",0,2\n", "2: pixel \"\" is not a whole number from 0"),
        ("0,,2\n", "2: cycle \"\" is not a whole number from 0"),
        ("0,0,\n", "2: bin \"\" is not a whole number from 0"),
        (
            "0,18446744073709551616,2\n",
            "2: cycle \"18446744073709551616\" is not a whole number from 0",
        ),
    ] {
        let refused = photons(format!("{HEADER}{rows}"));
        assert_eq!(refused, Err(format!("a.csv:{expected}")));
    }
    let wide = "pixel,cycle,bin,time\n0,1,2,\n0,1,2\n";
    assert_eq!(photons(wide), Err("a.csv:3: 3 fields, not 4".to_owned()));
    let no_text = [HEADER.as_bytes(), b"0,\xff,2\n"].concat();
    assert_eq!(photons(no_text), Err("a.csv:2: not text".to_owned()));
}

#[test]
fn a_line_has_at_most_4096_bytes() {
    let line = |bytes| photons(format!("{HEADER}{:bytes$}\n0,2,3\n", "0,1,2"));
    assert_eq!(line(4095), Ok(vec![[0, 1, 2], [0, 2, 3]]));
    let refused = "a.csv:2: a line of more than 4096 bytes".to_owned();
    assert_eq!(line(4096), Err(refused));
}

#[test]
fn a_file_must_not_end_before_the_end_that_it_had() {
    let mut reader = reader("");
    assert!(!reader.read_line().unwrap());
    reader.left = 1;
    assert_eq!(
        reader.read_line().unwrap_err().to_string(),
        "the file became shorter while it was read"
    );
}

/// A reader at the end of its file, after `line`.
fn reader(line: &str) -> CsvReader {
    CsvReader {
        input: Input::File("photons.csv".into()),
        file: BufReader::new(Box::new(std::io::empty())),
        left: 0,
        line: line.into(),
        line_number: 1,
        columns: Columns::new("pixel,cycle,bin").unwrap(),
    }
}

proptest! {
    #[test]
    fn a_plain_row_is_the_photon_that_any_row_is(line in prop_oneof![
        "[0-9]{1,20},[0-9]{1,20},[0-9]{1,20}",
        "[0-9,. +x-]{0,12}",
    ]) {
        if let Some(photon) = plain(line.as_bytes(), ',') {
            prop_assert_eq!(reader(&line).parse().unwrap(), photon);
        } else {
            let is_long = line.split(',').any(|field| field.len() > 19);
            // Only any row may have spaces beside its numbers.
            let is_plain = !is_long && !line.contains(' ');
            prop_assert!(!is_plain || reader(&line).parse().is_err());
        }
    }
}
