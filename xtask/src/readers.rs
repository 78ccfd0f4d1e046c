//! `cargo xtask check-export`: what `dtof export` writes, read by other projects'
//! programs and compared by `host-tests/readers/check.py`.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::target_folder;
use crate::tools::PYTHON;

/// A scene in which something moves, so that there are changes of depth.
const SCENE: &str = "scenes/radial.toml";
const CYCLES: &str = "40000";

/// Exports, reads and compares. The readers are installed below `target/` first, from the
/// package index, unless they are there.
pub fn check(root: &Path) -> Result<()> {
    let target = target_folder(root);
    let readers = root.join("host-tests/readers");
    let python = install(&target.join("readers"), &readers.join("requirements.txt"))?;
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
    succeed(simulate.current_dir(&folder), "dtof simulate")?;

    let mut compare = Command::new(python);
    compare.arg(readers.join("check.py")).arg(&dtof);
    compare
        .arg("scene/events.aer")
        .arg(root.join("docs/export.md"));
    // No .pyc files in the repository.
    compare.env("PYTHONDONTWRITEBYTECODE", "1");
    succeed(compare.current_dir(&folder), "the comparison")
}

/// A Python of our own with the packages of `requirements`, and where it is.
fn install(folder: &Path, requirements: &Path) -> Result<PathBuf> {
    let python = folder.join("bin/python");
    let wanted = fs::read(requirements).with_context(|| requirements.display().to_string())?;
    // Written last: a folder with it is complete.
    let installed = folder.join("requirements.txt");
    if fs::read(&installed).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    println!("{}: installing readers", PYTHON.require()?);
    let mut venv = Command::new(PYTHON.program);
    venv.args(["-m", "venv", "--clear"]).arg(folder);
    succeed(&mut venv, "python3 -m venv")?;
    let mut pip = Command::new(&python);
    // From Python 3.12 on expelliarmus comes as its source, which needs a C compiler.
    pip.args(["-m", "pip", "install", "--quiet", "--no-input"]);
    pip.arg("--disable-pip-version-check")
        .arg("--requirement")
        .arg(requirements);
    succeed(&mut pip, "pip install")?;
    fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    Ok(python)
}

/// Builds the program as `cargo run --release` does, and says where it is.
fn build(root: &Path, target: &Path) -> Result<PathBuf> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--locked", "--quiet", "--release"]);
    cargo.args(["--bin", "dtof", "--target-dir"]);
    succeed(cargo.arg(target).current_dir(root), "cargo build")?;
    Ok(target.join("release/dtof"))
}

fn succeed(command: &mut Command, name: &str) -> Result<()> {
    let status = command.status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name} failed, see above");
    Ok(())
}
