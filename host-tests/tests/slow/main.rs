//! Checks that take minutes and need additional tools: images in QEMU, exported files in other
//! projects' readers, reports in a browser.
//!
//! A check runs if `DTOF_SLOW` is set. Otherwise, or if a tool is missing, it prints a line that
//! begins with `SKIPPED:`. `cargo xtask setup` installs most of the tools.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow boards -- --nocapture
//! ```

mod boards;
mod compare;
mod debugger;
mod emulator;
mod enable;
mod hil;
mod histograms;
mod large;
mod laser;
mod own_board;
mod pico;
mod ports;
mod readers;
mod report;
mod rp2040;
#[path = "../../../host/cli/tests/program/common/sensed.rs"]
mod sensed;
mod soak;
mod stack;

use std::env;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, ensure};

/// A lock if `test` is enabled and its programs are installed. Tests run one at a time, as some
/// measure time.
fn enabled(test: &str, programs: &[&str]) -> Option<MutexGuard<'static, ()>> {
    static ALONE: Mutex<()> = Mutex::new(());
    if env::var_os("DTOF_SLOW").is_none() {
        skipped(test, "it takes minutes; DTOF_SLOW=1 runs it");
        return None;
    }
    for program in programs {
        if version(program).is_none() {
            let why = format!("{program} is missing: `cargo xtask setup` installs it");
            skipped(test, &why);
            return None;
        }
    }
    Some(ALONE.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Prints the reason past the test harness, which hides the output of passing tests.
fn skipped(test: &str, why: &str) {
    // One write: other tests write at the same time.
    let _ = io::stderr().write_all(format!("SKIPPED: {test}: {why}\n").as_bytes());
}

/// The version that a program prints, if it is installed.
fn version(program: &str) -> Option<String> {
    let mut command = Command::new(program);
    let command = command.arg("--version").stdin(Stdio::null());
    let output = command.stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    output.status.success().then_some(text)
}

/// The folder of the workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The build folder of cargo.
fn target_folder() -> PathBuf {
    let folder = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    root().join(folder)
}

/// Runs cargo in the workspace. Returns its output.
fn cargo(arguments: &[&str]) -> Result<String> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let cargo = cargo.current_dir(root()).arg("--locked").args(arguments);
    let cargo = cargo.stdin(Stdio::null()).stderr(Stdio::inherit());
    let output = cargo.output().context("cargo does not start")?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    ensure!(
        output.status.success(),
        "cargo {} fails, see above",
        arguments.join(" ")
    );
    Ok(text)
}

/// Builds the program as `cargo run --release` does.
fn dtof() -> Result<PathBuf> {
    cargo(&["build", "--quiet", "--release", "--package", "dtof"])?;
    Ok(target_folder().join("release/dtof").canonicalize()?)
}

/// Builds the program with the server for Foxglove, in the profile of the tests. Its path differs from
/// [`dtof`]'s.
fn dtof_with_foxglove() -> Result<PathBuf> {
    cargo(&[
        "build",
        "--quiet",
        "--profile",
        "test",
        "--package",
        "dtof",
        "--all-features",
    ])?;
    Ok(target_folder().join("debug/dtof").canonicalize()?)
}

/// A Python with the packages of a requirements file of the workspace. Prints the reason if it
/// cannot be installed.
fn python(test: &str, requirements: &str) -> Option<PathBuf> {
    match cargo(&["xtask", "python", requirements]) {
        Ok(path) => Some(path.into()),
        Err(_) => {
            skipped(test, "no Python with its packages, see above");
            None
        }
    }
}

/// Runs a command that must succeed, without input.
fn succeed(command: &mut Command) -> Result<()> {
    let name = command.get_program().display().to_string();
    let status = command.stdin(Stdio::null()).status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name}: {status}, see above");
    Ok(())
}
