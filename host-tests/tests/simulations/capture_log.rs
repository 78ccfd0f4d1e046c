//! The public TMF8820 capture log, if it is at `../shared/data/tmf8820_plane_gt/distance_data.json`
//! beside the workspace, or at the path in `TMF8820_LOG`.

#![allow(dead_code, reason = "not every test needs all of it")]

use std::io::Write;
use std::path::PathBuf;

use dtof_data::photons::open::Counts;

/// Writes past the test harness, which hides the output of passing tests.
pub fn tell(line: &str) {
    let mut out = std::io::stderr().lock();
    writeln!(out, "{line}").unwrap();
}

/// Its path. Prints a line if it is missing.
pub fn log() -> Option<PathBuf> {
    let beside = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8820_plane_gt/distance_data.json"
    );
    if let Some(named) = std::env::var_os("TMF8820_LOG") {
        return Some(named.into()); // and fail if it is not there
    }
    let found = Some(PathBuf::from(beside)).filter(|path| path.exists());
    if found.is_none() {
        tell(
            "SKIPPED: recorded photons: no TMF8820 capture log beside the workspace, nor in TMF8820_LOG",
        );
    }
    found
}

/// Distance to the plane of each capture in millimetres.
pub fn ground_truth(log: &PathBuf) -> Vec<f64> {
    let text = std::fs::read_to_string(log).unwrap();
    let captures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let captures = captures.as_array().unwrap().iter();
    captures
        .map(|capture| capture["dist_to_plane"].as_f64().unwrap() * 1000.0)
        .collect()
}

/// The histograms of each capture.
pub fn captures(recorded: &Counts) -> Vec<Vec<Vec<u64>>> {
    let histograms: Vec<_> = recorded.histograms.iter().collect();
    let captures = histograms.chunks(recorded.array.pixels() as usize);
    captures.map(<[_]>::to_vec).collect()
}
