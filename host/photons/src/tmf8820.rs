//! Recorded histograms from the public TMF8820 capture log: a JSON list of captures of the 3×3-zone
//! sensor, each with nine histograms of 128 bins. Pixel address = capture × 9 + zone; zone 4 is the
//! centre.

use std::io::Read;

use anyhow::{Result, anyhow, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::{I24F8, U16F16};
use serde::Deserialize;

use crate::recorded::Capture;

/// Zones of the sensor.
pub const ZONES: u32 = 9;
/// The array of a capture.
pub const ARRAY: Array = Array::new(ZONES, 1).unwrap();
/// The centre zone.
pub const CENTRE: u32 = 4;
/// The names of the columns and rows of a log.
pub const AXIS_NAMES: [&str; 2] = ["zone", "capture"];
/// Bins of its histograms.
pub const BINS: usize = 128;
/// The bin width. A fit of pulse positions to distances from 30 to 400 mm gives 13.80 mm a bin; the
/// log's authors state 91 ps.
pub const BIN_WIDTH_PS: U16F16 = U16F16::lit("92.1");
/// Moves the ranges of the centre zone of the public log to its ground truth from 30 to 400 mm.
pub const OFFSET_MM: I24F8 = I24F8::lit("-179.5");

/// The captures of a log.
#[derive(Clone, Debug)]
pub struct Tmf8820Log {
    /// Nine histograms each.
    pub captures: Vec<Capture>,
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

/// Reads the log from the text of the file `name`.
///
/// # Errors
/// Returns what is wrong with the file, after its name and the line if there is one.
pub fn read(name: &str, text: impl Read) -> Result<Tmf8820Log> {
    let entries: Vec<LogEntry> = serde_json::from_reader(text).map_err(|error| {
        let line = error.line();
        anyhow!("{name}:{line}: not a TMF8820 capture log: {error}")
    })?;
    ensure!(!entries.is_empty(), "{name}: no captures");
    for (index, entry) in entries.iter().enumerate() {
        let zones = entry.hists.len();
        ensure!(
            zones == ZONES as usize,
            "{name}: capture {index} has {zones} zones, not 9"
        );
        for (zone, histogram) in entry.hists.iter().enumerate() {
            let bins = histogram.len();
            ensure!(
                bins == BINS,
                "{name}: capture {index}, zone {zone} has {bins} bins, not 128"
            );
        }
    }
    let truth = entries
        .iter()
        .flat_map(|entry| (0..ZONES).map(|zone| entry.dist_to_plane.filter(|_| zone == CENTRE)));
    let truth: Vec<Option<f64>> = truth.map(|metres| Some(metres? * 1000.0)).collect();
    let truth_mm = truth.iter().any(Option::is_some).then_some(truth);
    Ok(Tmf8820Log {
        captures: entries.into_iter().map(|entry| entry.hists).collect(),
        truth_mm,
    })
}
