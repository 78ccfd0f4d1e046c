//! The charts in the documentation are the output of `dtof compare`. Prints its memory and time, too.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow compare -- --nocapture
//! ```

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};

use crate::{dtof, enabled, root, skipped};

/// The most memory that the demo may take.
const MOST_MB: u64 = 300;

/// The most memory of a process, which must succeed. 0 where the system does not tell.
fn peak_megabytes(mut process: Child) -> Result<u64> {
    let status = format!("/proc/{}/status", process.id());
    let mut peak = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
        if let Some(kilobytes) = kilobytes {
            peak = kilobytes.parse::<u64>()? / 1000;
        }
        if let Some(ended) = process.try_wait()? {
            ensure!(ended.success(), "dtof compare: {ended}, see above");
            return Ok(peak);
        }
        thread::sleep(Duration::from_millis(20));
    }
}

fn drawn(name: &str, arguments: &[&str]) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let mut compare = Command::new(dtof()?);
    let compare = compare.current_dir(root()).args(["compare", "--quiet"]);
    let compare = compare.args(arguments).arg("--out").arg(folder.path());
    let begun = Instant::now();
    let megabytes = peak_megabytes(compare.stdin(Stdio::null()).spawn()?)?;
    println!(
        "{name}: {megabytes} MB, {:.0} s",
        begun.elapsed().as_secs_f64()
    );
    ensure!(megabytes < MOST_MB, "{name}: {megabytes} MB");
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
        Some(_alone) => drawn("demo", &["--scene", "host/light/src/demo.toml"]),
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
