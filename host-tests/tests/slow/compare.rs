//! The charts in the documentation are the output of `dtof compare`.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow compare
//! ```

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::{dtof, enabled, root, skipped, succeed};

fn drawn(name: &str, arguments: &[&str]) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let mut compare = Command::new(dtof()?);
    let compare = compare.current_dir(root()).args(["compare", "--quiet"]);
    succeed(compare.args(arguments).arg("--out").arg(folder.path()))?;
    let kept = format!("docs/figures/compare-{name}.svg");
    let drawn = fs::read_to_string(folder.path().join("compare.svg"))?;
    ensure!(
        drawn == fs::read_to_string(root().join(&kept))?,
        "{kept} has changed"
    );
    Ok(())
}

#[test]
fn the_chart_of_the_demo() -> Result<()> {
    match enabled("compare: the demo", &[]) {
        Some(_alone) => drawn("demo", &["--scene", "host/simulate/src/demo.toml"]),
        None => Ok(()),
    }
}

#[test]
fn the_chart_of_the_recorded_log() -> Result<()> {
    let test = "compare: the recorded log";
    let Some(_alone) = enabled(test, &[]) else {
        return Ok(());
    };
    let beside = PathBuf::from("../shared/data/tmf8820_plane_gt/distance_data.json");
    let log = env::var_os("TMF8820_LOG").map_or(beside, PathBuf::from);
    if !root().join(&log).exists() {
        skipped(
            "recorded photons",
            "no TMF8820 capture log beside the workspace, nor in TMF8820_LOG",
        );
        return Ok(());
    }
    let log = log.display().to_string();
    let input = [
        "--input",
        &log,
        "--photons-per-cycle",
        "0.5",
        "--within",
        "3",
    ];
    drawn("tmf8820", &input)
}
