//! One file a command.

pub mod calibrate;
pub mod compare;
pub mod decode;
pub mod demo;
mod dynamic_depth;
pub mod export;
pub mod monitor;
pub mod replay;
pub mod simulate;
pub mod tune;
mod view;

use std::io::{self, Write};
use std::path::Path;

use dtof::calibrate::{Change, RunPhotons, glass_change};
use dtof::events::output::Output;
use dtof::events::summary::Summary;
use dtof::rows::{Row, aligned};
use dtof::settings::{Sensor, SettingsFile};

/// Tells whether the cover glass has become brighter than the settings say.
fn watch_glass(said: &SettingsFile, output: &Output, summary: &mut Summary) {
    let Sensor {
        glass_bins, gate, ..
    } = &said.sensor;
    if let (Some(bins), Some(glass), Some((first, _))) = (output.bins(), glass_bins, gate) {
        let run = RunPhotons {
            bins,
            cycles: summary.cycles,
            pixels: (summary.pixels - summary.settings.masked.len()) as u64,
        };
        if let Change::Brighter(times, least) = glass_change(&run, glass, *first) {
            summary.cover_glass = Some([times, least]);
        }
    }
}

/// Says on standard error what to know of `file`, a line each, unless `quiet`.
fn warn(file: &Path, warnings: impl IntoIterator<Item = String>, quiet: bool) {
    for warning in warnings.into_iter().filter(|_| !quiet) {
        eprintln!("warning: {}: {warning}", file.display());
    }
}

/// Prints the summary of a run.
fn print_summary(summary: &Summary, more: &[Row], folder: &Path) -> io::Result<()> {
    let detection = summary.settings.detection_rows();
    let rows = [&summary.rows()[..], more, &detection].concat();
    let report = folder.join("report.html");
    let mut out = io::stdout().lock();
    write!(
        out,
        "{}\nOpen {} in a browser.\n",
        aligned(&rows),
        report.display()
    )?;
    out.flush()
}
