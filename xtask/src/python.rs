//! A Python with the packages a check needs, in the build folder: nothing is installed
//! elsewhere.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::target_folder;
use crate::tools::PYTHON;

/// The Python of an environment below the build folder that has the packages of a file
/// of the workspace. Needs a network only for what is not there yet.
pub fn environment(root: &Path, requirements: &str) -> Result<PathBuf> {
    let file = root.join(requirements);
    let wanted = fs::read(&file).with_context(|| requirements.to_owned())?;
    let folder = Path::new(requirements).parent();
    let folder = target_folder(root)
        .join("python")
        .join(folder.context("no file")?);
    let python = folder.join("bin/python");
    // Written last: a folder with it is complete.
    let installed = folder.join("requirements.txt");
    if fs::read(&installed).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    eprintln!("{}: installing {requirements}", PYTHON.require()?);
    let mut venv = Command::new(PYTHON.program);
    venv.args(["-m", "venv", "--clear"]).arg(&folder);
    succeed(&mut venv, "python3 -m venv")?;
    let mut pip = Command::new(&python);
    // From Python 3.12 on expelliarmus comes as its source, which needs a C compiler.
    pip.args(["-m", "pip", "install", "--quiet", "--no-input"]);
    pip.arg("--disable-pip-version-check")
        .arg("--requirement")
        .arg(&file);
    succeed(&mut pip, "pip install")?;
    fs::write(&installed, wanted).with_context(|| installed.display().to_string())?;
    Ok(python)
}

/// Runs a command that may not ask. What it prints goes to standard error: standard
/// output is for the path.
fn succeed(command: &mut Command, name: &str) -> Result<()> {
    let command = command.stdin(Stdio::null()).stdout(std::io::stderr());
    let status = command.status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name} failed, see above");
    Ok(())
}
