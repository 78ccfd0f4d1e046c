//! A Python with the packages a check needs, in the build folder: nothing is installed
//! elsewhere.

use std::fs;
use std::io::stderr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::tools::PYTHON;
use crate::{succeed, target_folder};

/// The Python of an environment below the build folder that has the packages of a file
/// of the workspace. Needs a network only for what is not there yet.
pub fn environment(root: &Path, requirements: &str) -> Result<PathBuf> {
    let file = root.join(requirements);
    let wanted = fs::read(&file).with_context(|| requirements.to_owned())?;
    let folder = Path::new(requirements).parent().context("no file")?;
    // Beside each other, for what is made anew is cleared.
    let name = folder.display().to_string().replace('/', "-");
    let folder = target_folder(root).join("python").join(name);
    let python = folder.join("bin/python");
    // Written last: a folder with it is complete.
    let installed = folder.join("requirements.txt");
    if fs::read(&installed).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    eprintln!("{}: installing {requirements}", PYTHON.require()?);
    let mut venv = Command::new(PYTHON.program);
    venv.args(["-m", "venv", "--clear"]).arg(&folder);
    // Standard output is for the path.
    succeed(venv.stdout(stderr()))?;
    let mut pip = Command::new(&python);
    // From Python 3.12 on expelliarmus comes as its source, which needs a C compiler.
    pip.args(["-m", "pip", "install", "--quiet", "--no-input"]);
    pip.arg("--disable-pip-version-check")
        .arg("--requirement")
        .arg(&file);
    succeed(pip.stdout(stderr()))?;
    fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    Ok(python)
}

/// Builds the package `dtof` as a wheel, the same for all versions of Python from 3.9 on.
pub fn wheel(root: &Path) -> Result<PathBuf> {
    let python = environment(root, "bindings/python/wheel/requirements.txt")?;
    let wheels = target_folder(root).join("wheels");
    // What an earlier version left is not this one's.
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
