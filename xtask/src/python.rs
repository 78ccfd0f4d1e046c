//! A Python with the packages a check needs, in the build folder: nothing is installed
//! elsewhere.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::target_folder;
use crate::tools::PYTHON;

/// The Python of an environment `name` below the build folder that has the packages of
/// `requirements`. Needs a network only for what is not there yet.
///
/// # Errors
/// If there is no Python, or the packages cannot be had.
pub fn environment(root: &Path, name: &str, requirements: &Path) -> Result<PathBuf> {
    let folder = &target_folder(root).join(name);
    let python = folder.join("bin/python");
    let wanted = fs::read(requirements).with_context(|| requirements.display().to_string())?;
    // Written last: a folder with it is complete.
    let installed = folder.join("requirements.txt");
    if fs::read(&installed).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    println!("{}: installing {name}", PYTHON.require()?);
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

/// Runs a command that may not ask.
///
/// # Errors
/// If it does not start or does not succeed.
pub fn succeed(command: &mut Command, name: &str) -> Result<()> {
    let status = command.stdin(Stdio::null()).status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name} failed, see above");
    Ok(())
}
