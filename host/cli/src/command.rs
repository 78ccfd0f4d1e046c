//! The commands, a file each.

pub mod calibrate;
pub mod compare;
pub mod decode;
pub mod demo;
mod device_options;
mod dynamic_depth;
pub mod export;
pub mod flags;
mod job;
pub mod monitor;
pub mod replay;
mod scene_options;
pub mod simulate;
pub mod tune;
pub mod view;

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Result, ensure};
use dtof::complain;
use dtof_data::options::rows::{Row, aligned, grouped, printable};
use dtof_run::summary::Summary;

/// Prints warnings, about `file` if there is one, on standard error, a line each, unless `quiet`.
fn warn<'a>(
    file: impl Into<Option<&'a Path>>,
    warnings: impl IntoIterator<Item = String>,
    quiet: bool,
) {
    let file = file.into().map(|file| format!("{}: ", file.display()));
    let file = file.unwrap_or_default();
    for warning in warnings.into_iter().filter(|_| !quiet) {
        complain(&printable(&format!("warning: {file}{warning}")));
    }
}

/// Says where the settings are that were in the output folder, unless `quiet`.
fn say_kept(kept: Option<&Path>, quiet: bool) -> io::Result<()> {
    match kept.filter(|_| !quiet) {
        None => Ok(()),
        Some(kept) => {
            let line = format!("{} has the settings that were here", kept.display());
            writeln!(io::stdout(), "{}", printable(&line))
        }
    }
}

/// Fails if a run of `all` laser cycles has ended before.
fn check_complete(summary: &Summary, all: u64, folder: &Path) -> Result<()> {
    ensure!(
        summary.cycles == all,
        "ended by Ctrl-C after {} of {} laser cycles; {} has the results until then",
        grouped(summary.cycles),
        grouped(all),
        folder.display()
    );
    Ok(())
}

/// The heading of what was found in a recording.
const FOUND: &str = "Found in the recording";

/// What the terminal shows of what was found in a recording, unless there is none.
const BRIEF: [&str; 8] = [
    "bin width",
    "hot pixels",
    "dead pixels",
    "pulse",
    "cover glass",
    "gate",
    "rule",
    "overridden",
];

/// Prints what was found in the recording, the totals of a run, and `more` rows. The report has the rest.
fn print_summary(summary: &Summary, more: &[Row], folder: &Path) -> io::Result<()> {
    let mut rows = [&summary.brief()[..], more].concat();
    let map = folder.join("depth.npy");
    let with_depth = rows
        .iter_mut()
        .find(|(name, _)| name == "pixels with depth");
    with_depth
        .into_iter()
        .for_each(|(_, value)| *value += &format!(", in {} in mm", map.display()));
    let mut out = io::stdout().lock();
    if !summary.found.is_empty() {
        let found = summary.found.iter();
        let found = found.filter(|(name, _)| BRIEF.contains(&name.as_str()));
        let found: Vec<Row> = found
            .filter(|(_, value)| !value.starts_with("none"))
            .cloned()
            .collect();
        let settings = folder.join("dtof.toml");
        let heading = format!("{FOUND}, saved as {}", settings.display());
        writeln!(
            out,
            "{}:\n{}",
            printable(&heading),
            aligned(&found).trim_end()
        )?;
    }
    let report = folder.join("report.html");
    writeln!(
        out,
        "{}Open {} in a browser.",
        aligned(&rows),
        report.display()
    )?;
    out.flush()
}
