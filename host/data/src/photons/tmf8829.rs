//! Recorded histograms from a log of the TMF8829, as the vendor's viewer writes it: a JSON
//! object with a frame in each `Result_Set`, and in each frame a histogram a pixel,
//! `mp_histo[row][column].bin`. Pixel address = (frame × rows + row) × columns + column.
//!
//! The sensor's own results are not read.

use std::io::Read;

use anyhow::{Context, Result, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::tmf8829::FINEST_BIN_PS;
use serde::Deserialize;

use crate::options::rows::Row;
use crate::photons::histograms::Histograms;
use crate::photons::tmf8820::not_a_log;

/// Bins of its histograms.
pub const BINS: usize = 64;
/// The sensor's default: four of its bins make one.
const BIN_SHIFT: u32 = 2;

/// The frames of a log.
#[derive(Clone, Debug)]
pub struct Tmf8829Log {
    /// Of one frame.
    pub array: Array,
    /// A histogram for each pixel, frame by frame.
    pub histograms: Histograms,
    /// Picoseconds a bin.
    pub bin_width_ps: U16F16,
    /// The bins that were measured in full, from the first on: all, if the log does not say.
    pub measured_bins: usize,
    /// The `bin_shift` that was assumed, if the log does not say.
    pub assumed_shift: Option<u32>,
    /// What was left out.
    pub rows: Vec<Row>,
}

/// The fields that are read.
#[derive(Deserialize)]
struct Log {
    #[serde(rename = "Result_Set")]
    frames: Vec<Frame>,
    configuration: Option<Configuration>,
}

#[derive(Deserialize)]
struct Frame {
    mp_histo: Option<Vec<Vec<Pixel>>>,
}

#[derive(Deserialize, PartialEq)]
struct Pixel {
    bin: Vec<u64>,
}

#[derive(Deserialize)]
struct Configuration {
    /// 2 to this power of the sensor's own bins make one of the log.
    bin_shift: Option<u32>,
    /// How many of its own bins the sensor measured.
    histogram_bins: Option<u32>,
}

/// Reads the log from the text of the file `name`.
///
/// # Errors
/// Returns what is wrong with the file, after its name and the line if there is one.
pub fn read(name: &str, text: impl Read) -> Result<Tmf8829Log> {
    let log: Log =
        serde_json::from_reader(text).map_err(|error| not_a_log(name, "TMF8829 log", error))?;
    parse_log(log).with_context(|| name.to_owned())
}

fn parse_log(log: Log) -> Result<Tmf8829Log> {
    ensure!(!log.frames.is_empty(), "no frames");
    let mut frames = Vec::new();
    for (number, frame) in log.frames.into_iter().enumerate() {
        let histograms = frame.mp_histo.filter(|rows| !rows.is_empty());
        frames.push(
            histograms
                .with_context(|| format!("frame {number} has no mp_histo: histograms were off"))?,
        );
    }
    let (rows, columns) = (frames[0].len(), frames[0][0].len());
    for (number, frame) in frames.iter().enumerate() {
        let is_alike = frame.len() == rows && frame.iter().all(|row| row.len() == columns);
        ensure!(
            is_alike && columns > 0,
            "frame {number} is not of {rows} rows and {columns} columns as frame 0"
        );
        for (row, pixels) in frame.iter().enumerate() {
            for (column, pixel) in pixels.iter().enumerate() {
                let bins = pixel.bin.len();
                ensure!(
                    bins == BINS,
                    "frame {number}, row {row}, column {column} has {bins} bins, not {BINS}"
                );
            }
        }
    }
    // Some viewers write the same column once for each column of the sensor.
    let mut all = frames.iter().flatten();
    let is_copied = columns > 1 && all.all(|row| row.iter().all(|pixel| *pixel == row[0]));
    let columns_kept = if is_copied { 1 } else { columns };
    let pixels = frames
        .into_iter()
        .flatten()
        .flat_map(|row| row.into_iter().take(columns_kept));
    let histograms = Histograms::of(pixels.map(|pixel| pixel.bin))?;
    let configuration = log.configuration.as_ref();
    let known_shift = configuration.and_then(|of| of.bin_shift);
    let shift = known_shift.unwrap_or(BIN_SHIFT);
    let width = 1u16
        .checked_shl(shift)
        .and_then(|own| FINEST_BIN_PS.checked_mul_int(own.into()));
    let measured = configuration.and_then(|of| of.histogram_bins);
    let measured = measured.and_then(|bins| usize::try_from(bins.checked_shr(shift)?).ok());
    let measured = measured.filter(|bins| (1..BINS).contains(bins));
    let copies = format!(
        "{} of {columns}, each the same as the first",
        columns - columns_kept
    );
    let array = Array::new(u32::try_from(columns_kept)?, u32::try_from(rows)?);
    Ok(Tmf8829Log {
        array: array.context("more than 65,536 pixels")?,
        histograms,
        bin_width_ps: width.with_context(|| format!("bin_shift {shift}: bins are too wide"))?,
        measured_bins: measured.unwrap_or(BINS),
        assumed_shift: known_shift.is_none().then_some(shift),
        rows: is_copied
            .then(|| ("columns left out".to_owned(), copies))
            .into_iter()
            .collect(),
    })
}

#[cfg(test)]
mod tests;
