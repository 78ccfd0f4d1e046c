//! The charts of the documentation are those that `compare` draws.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::Scratch;

/// Where the recordings are, unless said otherwise: beside the workspace.
const LOG: &str = "../../../shared/data/tmf8820_plane_gt/distance_data.json";

fn of_package(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[track_caller]
fn drawn(input: &str, name: &str) {
    let scratch = Scratch::new();
    scratch.printed(&format!("compare --quiet --out out {input}"));
    let kept = of_package(&format!("../../docs/figures/compare-{name}.svg"));
    let kept = fs::read_to_string(kept).unwrap();
    assert!(
        scratch.read("out/compare.svg") == kept,
        "{name} has changed"
    );
}

#[test]
fn the_demo() {
    let scene = of_package("../simulate/src/demo.toml");
    drawn(&format!("--scene {}", scene.display()), "demo");
}

#[test]
fn the_recorded_log() {
    let beside = of_package(LOG);
    let log = std::env::var_os("TMF8820_LOG").map_or(beside, PathBuf::from);
    if !log.exists() {
        eprintln!(
            "SKIPPED: recorded photons: no TMF8820 capture log beside the workspace, nor in TMF8820_LOG"
        );
        return;
    }
    let input = format!(
        "--input {} --photons-per-cycle 0.5 --within 3",
        log.display()
    );
    drawn(&input, "tmf8820");
}
