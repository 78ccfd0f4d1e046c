//! A Python with the packages a check needs, in the build folder: nothing is installed
//! elsewhere.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

/// What brings Python with its `venv`.
const INSTALL: &str = "sudo apt-get install --yes python3-venv";

/// The Python of a virtual environment that has these packages, each as `name==version`.
/// Needs a network only for what is not there yet.
///
/// # Errors
/// If there is no Python, or the packages cannot be had.
pub fn venv(packages: &[&str]) -> Result<PathBuf> {
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    let root = crate::root()?.join(target);
    let folder = root.join("python");
    let python = folder.join("bin").join("python");
    if !python.exists() {
        ensure!(is_there(), "python3 with venv is missing: {INSTALL}");
        run(Command::new("python3").args(["-m", "venv"]).arg(&folder))?;
    }
    if !has(&python, packages)? {
        println!("{}: installing {}", folder.display(), packages.join(", "));
        let mut pip = Command::new(&python);
        pip.args(["-m", "pip", "install", "--quiet", "--no-input"]);
        pip.args(["--disable-pip-version-check"]).args(packages);
        run(&mut pip)?;
    }
    Ok(python)
}

/// Installs what `venv` needs if it is missing and `package` says how; else says what to
/// type.
pub fn set_up(package: impl FnOnce(&str) -> Option<Command>) {
    if is_there() {
        println!("python3 with venv: there");
        return;
    }
    if let Some(mut command) = package("python3-venv") {
        println!("python3-venv: installing");
        // What goes wrong is said by what is still missing.
        let _ = command.stdin(Stdio::null()).status();
    }
    if !is_there() {
        println!("python3 with venv is missing: {INSTALL}");
    }
}

/// Whether an environment can be made.
fn is_there() -> bool {
    let mut python = Command::new("python3");
    python.args(["-m", "ensurepip", "--version"]);
    python.stdout(Stdio::null()).stderr(Stdio::null());
    python.status().is_ok_and(|status| status.success())
}

/// Whether all `packages` are among those installed.
fn has(python: &Path, packages: &[&str]) -> Result<bool> {
    let output = Command::new(python)
        .args(["-m", "pip", "freeze", "--disable-pip-version-check"])
        .output()
        .with_context(|| python.display().to_string())?;
    let installed = String::from_utf8_lossy(&output.stdout).to_lowercase();
    let is_installed = |name: &&str| installed.lines().any(|line| line == name.to_lowercase());
    Ok(packages.iter().all(is_installed))
}

fn run(command: &mut Command) -> Result<()> {
    let name = format!("{command:?}");
    let status = command.stdin(Stdio::null()).status();
    let status = status.with_context(|| name.clone())?;
    ensure!(status.success(), "{name}: {status}");
    Ok(())
}
