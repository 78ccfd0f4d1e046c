//! Python environments for checks, in the build folder.

use std::fs;
use std::io::stderr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::tools::PYTHON;
use crate::{succeed, target_folder};

/// The Python of an environment in the build folder with the packages of a requirements file.
/// Needs a network only for missing packages.
pub fn environment(root: &Path, requirements: &str) -> Result<PathBuf> {
    let file = root.join(requirements);
    let requirements_text = fs::read(&file).with_context(|| requirements.to_owned())?;
    let folder = Path::new(requirements).parent().context("no file")?;
    // One folder for each file, because a new environment clears its folder.
    let name = folder.display().to_string().replace('/', "-");
    let folder = target_folder(root).join("python").join(name);
    let python = folder.join("bin/python");
    // Written last: a folder that has it is complete.
    let installed = folder.join("requirements.txt");
    if fs::read(&installed).is_ok_and(|installed| installed == requirements_text) {
        return Ok(python);
    }
    eprintln!("{}: installing {requirements}", PYTHON.require()?);
    let mut venv = Command::new(PYTHON.program);
    venv.args(["-m", "venv", "--clear"]).arg(&folder);
    // Standard output has the path alone.
    succeed(venv.stdout(stderr()))?;
    let mut pip = Command::new(&python);
    // From Python 3.12 on, expelliarmus has no wheel and needs a C compiler.
    pip.args(["-m", "pip", "install", "--quiet", "--no-input"]);
    pip.arg("--disable-pip-version-check")
        .arg("--requirement")
        .arg(&file);
    succeed(pip.stdout(stderr()))?;
    fs::write(&installed, requirements_text).with_context(|| installed.display().to_string())?;
    Ok(python)
}

/// Builds the package `dtof` as one wheel for all versions of Python from 3.9 on.
pub fn wheel(root: &Path) -> Result<PathBuf> {
    let python = environment(root, "bindings/python/wheel/requirements.txt")?;
    let wheels = target_folder(root).join("wheels");
    // Removes the wheels of earlier versions.
    if wheels.exists() {
        fs::remove_dir_all(&wheels).with_context(|| wheels.display().to_string())?;
    }
    let mut maturin = Command::new(python);
    maturin.args(["-m", "maturin", "build", "--quiet", "--release", "--locked"]);
    maturin.arg("--manifest-path");
    maturin.arg(root.join("bindings/python/Cargo.toml"));
    maturin.arg("--out").arg(&wheels);
    succeed(maturin.stdout(stderr()))?;
    let made = fs::read_dir(&wheels).with_context(|| wheels.display().to_string())?;
    let made: Vec<PathBuf> = made.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    ensure!(
        made.len() == 1,
        "{}: {} files",
        wheels.display(),
        made.len()
    );
    made.into_iter().next().context("no wheel")
}
