//! Recorded histograms of a TMF8820, when the public capture log lies at
//! `../shared/data/tmf8820_plane_gt/distance_data.json` beside the workspace or
//! where `TMF8820_LOG` says: as packets on a mocked bus they come out exactly as
//! recorded.

mod common;

use std::io::Write;
use std::path::PathBuf;

use common::tmf882x::{Bench, Counts, settings};
use serde_json::Value;

/// Writes past the test harness, which hides what passing tests print.
fn tell(line: &str) {
    writeln!(std::io::stderr().lock(), "{line}").unwrap();
}

fn log() -> Option<PathBuf> {
    let beside = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/data/tmf8820_plane_gt/distance_data.json"
    );
    let path = std::env::var_os("TMF8820_LOG").map_or_else(|| beside.into(), PathBuf::from);
    path.exists().then_some(path)
}

fn histogram(value: &Value) -> [u32; 128] {
    let counts = value.as_array().unwrap().iter();
    let counts: Vec<u32> = counts
        .map(|count| u32::try_from(count.as_u64().unwrap()).unwrap())
        .collect();
    counts.try_into().unwrap()
}

/// The reference first, then the nine zones.
fn counts(capture: &Value) -> Counts {
    let zones = capture["hists"].as_array().unwrap();
    let histograms: Vec<_> = [&capture["reference_hist"]]
        .into_iter()
        .chain(zones)
        .map(histogram)
        .collect();
    histograms.try_into().unwrap()
}

#[test]
fn recorded_histograms_come_out_as_recorded() {
    let Some(path) = log() else {
        tell(
            "SKIPPED: recorded histograms over I2C: no TMF8820 capture log beside the workspace, nor in TMF8820_LOG",
        );
        return;
    };
    let captures: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let captures = captures.as_array().unwrap();
    assert!(!captures.is_empty());
    let mut bench = Bench::<128>::new(settings(), &[]);
    bench.bring_up_running();
    for capture in captures {
        bench.set(&counts(capture));
    }
}
