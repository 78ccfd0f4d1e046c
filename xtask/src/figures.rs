//! `cargo xtask figures`: the figures of the documentation.

use std::env;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

/// Runs `dtof figures`, which does the work, with all optimisations.
pub fn make(root: &Path, arguments: &[&str]) -> Result<()> {
    let status = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(root)
        .args([
            "run",
            "--quiet",
            "--locked",
            "--release",
            "--package",
            "dtof",
        ])
        .args(["--", "figures"])
        .args(arguments)
        .status()
        .context("cargo does not start")?;
    ensure!(status.success(), "dtof figures: {status}");
    Ok(())
}
