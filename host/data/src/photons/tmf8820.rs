//! Recorded histograms from a capture log as the public one of a TMF8820: a JSON list of captures, each
//! with a histogram of 128 bins a zone. A TMF8820 has nine zones: pixel address = capture × 9 + zone, and
//! zone 4 is the centre. A TMF8828 has 8×8: pixel address = capture × 64 + zone.

use std::io::{self, Read};

use anyhow::{Context, Error, Result, anyhow, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::tmf882x::{BIN_WIDTH_8X8_PS, BIN_WIDTH_PS, OFFSET_MM};
use serde::Deserialize;

use crate::photons::histograms::Histograms;

/// The centre of nine zones.
const CENTRE: usize = 4;
/// Bins of its histograms.
pub const BINS: usize = 128;

/// The captures of a log.
#[derive(Clone, Debug)]
pub struct Tmf8820Log {
    /// The array of a capture: 9 in a row, or 8×8.
    pub array: Array,
    /// The names of its columns and rows.
    pub axis_names: [&'static str; 2],
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// Moves pulses to distances; not known of 8×8 zones.
    pub offset_mm: Option<I24F8>,
    /// A histogram for each zone, capture by capture.
    pub histograms: Histograms,
    /// The true distance of each zone in millimetres. The log has it for centre zones, if at all.
    pub truth_mm: Option<Vec<Option<f64>>>,
}

/// The fields that are read. The log also has the sensor's own results.
#[derive(Deserialize)]
struct LogEntry {
    hists: Vec<Vec<u64>>,
    /// Of the centre zone, in metres.
    dist_to_plane: Option<f64>,
}

/// The error of a log that is not what its start looks like.
pub(crate) fn not_a_log(name: &str, kind: &str, error: serde_json::Error) -> Error {
    match error.is_io() {
        // Without a line: it is the file that cannot be read.
        true => anyhow!("{name}: {}", io::Error::from(error)),
        false => anyhow!("{name}:{}: not a {kind}: {error}", error.line()),
    }
}

/// Reads the log from the text of the file `name`.
///
/// # Errors
/// Returns what is wrong with the file, after its name and the line if there is one.
pub fn read(name: &str, text: impl Read) -> Result<Tmf8820Log> {
    let entries: Vec<LogEntry> = serde_json::from_reader(text)
        .map_err(|error| not_a_log(name, "TMF8820 capture log", error))?;
    ensure!(!entries.is_empty(), "{name}: no captures");
    let all = entries[0].hists.len();
    let (array, axis_names, bin_width_ps, offset_mm) = match all {
        64 => (Array::new(8, 8), ["column", "row"], BIN_WIDTH_8X8_PS, None),
        _ => (
            Array::new(9, 1),
            ["zone", "capture"],
            BIN_WIDTH_PS,
            Some(OFFSET_MM),
        ),
    };
    let array = array.context("an array")?;
    for (index, entry) in entries.iter().enumerate() {
        let zones = entry.hists.len();
        ensure!(
            zones == array.pixels() as usize,
            "{name}: capture {index} has {zones} zones, not {}",
            match all {
                64 => "64 as capture 0",
                _ => "9 or 64",
            }
        );
        for (zone, histogram) in entry.hists.iter().enumerate() {
            let bins = histogram.len();
            ensure!(
                bins == BINS,
                "{name}: capture {index}, zone {zone} has {bins} bins, not 128"
            );
        }
    }
    let centre = (all == 9).then_some(CENTRE);
    let truth = entries.iter().flat_map(|entry| {
        (0..entry.hists.len()).map(move |zone| entry.dist_to_plane.filter(|_| centre == Some(zone)))
    });
    let truth: Vec<Option<f64>> = truth.map(|metres| Some(metres? * 1000.0)).collect();
    let truth_mm = truth.iter().any(Option::is_some).then_some(truth);
    Ok(Tmf8820Log {
        array,
        axis_names,
        bin_width_ps,
        offset_mm,
        histograms: Histograms::of(entries.into_iter().flat_map(|entry| entry.hists))?,
        truth_mm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A capture as JSON, in which all bins of a zone have its number plus `first`.
    fn capture(zones: u64, first: u64, more: &str) -> String {
        let zone = |zone: u64| format!("{:?}", [first + zone; BINS]);
        let zones: Vec<String> = (0..zones).map(zone).collect();
        format!("{{\"hists\": [{}]{more}}}", zones.join(","))
    }

    fn parse(text: &str) -> Result<Tmf8820Log> {
        read("a.json", text.as_bytes())
    }

    #[test]
    fn nine_zones_are_a_row_and_the_truth_is_that_of_the_centre() {
        let first = capture(9, 100, ", \"result\": [1]");
        let known = capture(9, 200, ", \"dist_to_plane\": 0.25");
        let log = parse(&format!("[{first}, {known}]")).unwrap();
        assert_eq!(log.array, Array::new(9, 1).unwrap());
        assert_eq!(log.axis_names, ["zone", "capture"]);
        assert_eq!(log.bin_width_ps, BIN_WIDTH_PS);
        assert_eq!(log.offset_mm, Some(OFFSET_MM));
        let zones = |first: u64| (first..first + 9).map(|count| vec![count; BINS]);
        let captures = [100, 200].into_iter().flat_map(zones);
        assert!(log.histograms.iter().eq(captures));
        let mut truth = vec![None; 18];
        truth[9 + 4] = Some(250.0);
        assert_eq!(log.truth_mm, Some(truth));
        assert_eq!(parse(&format!("[{first}]")).unwrap().truth_mm, None);
    }

    #[test]
    fn sixty_four_zones_are_an_array_without_centre_or_offset() {
        let known = capture(64, 0, ", \"dist_to_plane\": 0.25");
        let log = parse(&format!("[{known}, {known}]")).unwrap();
        assert_eq!(log.array, Array::new(8, 8).unwrap());
        assert_eq!(log.axis_names, ["column", "row"]);
        assert_eq!(log.bin_width_ps, BIN_WIDTH_8X8_PS);
        assert_eq!((log.offset_mm, log.truth_mm), (None, None));
        assert_eq!(log.histograms.len(), 2 * 64);
        assert_eq!(log.histograms.histogram(64 + 63), [63; BINS]);
    }

    #[test]
    fn logs_that_are_damaged_are_refused() {
        let nine = capture(9, 0, "");
        for (text, expected) in [
            ("[]", ": no captures"),
            (
                "[{}]",
                ":1: not a TMF8820 capture log: missing field `hists` at line 1 column 3",
            ),
            (
                "[\n{\"hists\": [[1,\n",
                ":3: not a TMF8820 capture log: EOF while parsing a value at line 3 column 0",
            ),
            (
                &format!("[{}]", capture(16, 0, "")),
                ": capture 0 has 16 zones, not 9 or 64",
            ),
            (
                &format!("[{nine}, {}]", capture(64, 0, "")),
                ": capture 1 has 64 zones, not 9 or 64",
            ),
            (
                &format!("[{}, {nine}]", capture(64, 0, "")),
                ": capture 1 has 9 zones, not 64 as capture 0",
            ),
            (
                &format!("[{nine}, {}]", nine.replacen("1, 1,", "1,", 1)),
                ": capture 1, zone 1 has 127 bins, not 128",
            ),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!(error.to_string(), format!("a.json{expected}"));
        }
        for number in ["-1", "1.5"] {
            let text = format!("[{}]", nine.replacen("1,", &format!("{number},"), 1));
            let error = parse(&text).unwrap_err().to_string();
            assert!(
                error.starts_with("a.json:1: not a TMF8820 capture log: invalid"),
                "{error}"
            );
        }
    }
}
