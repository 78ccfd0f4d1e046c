//! `cargo xtask check-export`: what `dtof export` writes, read by other projects'
//! programs and compared by `host-tests/readers/check.py`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::{python, target_folder};

/// A scene in which something moves, so that there are changes of depth.
const SCENE: &str = "scenes/radial.toml";
const CYCLES: &str = "40000";

/// Exports, reads and compares. The readers are installed below `target/` first, from the
/// package index, unless they are there.
pub fn check(root: &Path) -> Result<()> {
    let target = target_folder(root);
    let readers = root.join("host-tests/readers");
    let python = python::environment(root, "readers", &readers.join("requirements.txt"))?;
    let dtof = build(root, &target)?;

    let folder = target.join("check-export");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let mut simulate = Command::new(&dtof);
    simulate
        .arg("simulate")
        .arg("--scene")
        .arg(root.join(SCENE));
    simulate.args(["--cycles", CYCLES, "--quiet", "--out", "scene"]);
    python::succeed(simulate.current_dir(&folder), "dtof simulate")?;

    let mut compare = Command::new(python);
    compare.arg(readers.join("check.py")).arg(&dtof);
    compare
        .arg("scene/events.aer")
        .arg(root.join("docs/export.md"));
    // No .pyc files in the repository.
    compare.env("PYTHONDONTWRITEBYTECODE", "1");
    python::succeed(compare.current_dir(&folder), "the comparison")
}

/// Builds the program as `cargo run --release` does, and says where it is.
fn build(root: &Path, target: &Path) -> Result<PathBuf> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--locked", "--quiet", "--release"]);
    cargo.args(["--bin", "dtof", "--target-dir"]);
    python::succeed(cargo.arg(target).current_dir(root), "cargo build")?;
    Ok(target.join("release/dtof"))
}
