//! Checks that take minutes and need what not every computer has: the images in QEMU,
//! exported files in other projects' readers, the report in a browser.
//!
//! Each runs if `DTOF_SLOW` is set and prints a line that begins with `SKIPPED:` if
//! not, or if something is missing. `cargo xtask setup` installs most of it.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow boards -- --nocapture
//! ```

mod boards;
mod compare;
mod debugger;
mod emulator;
mod hil;
mod histograms;
mod laser;
mod pico;
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

/// Whether `test` is to run, with what it needs: then alone, as some measure time.
fn wanted(test: &str, programs: &[&str]) -> Option<MutexGuard<'static, ()>> {
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

/// Says so past the test harness, which hides what passing tests print.
fn skipped(test: &str, why: &str) {
    // In one piece: other tests write at the same time.
    let _ = io::stderr().write_all(format!("SKIPPED: {test}: {why}\n").as_bytes());
}

/// What a program says of its version, if it is there.
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

/// Where cargo builds.
fn target_folder() -> PathBuf {
    let folder = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    root().join(folder)
}

/// Runs cargo in the workspace; the line that it prints.
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

/// The program as `cargo run --release` builds it.
fn dtof() -> Result<PathBuf> {
    cargo(&["build", "--quiet", "--release", "--package", "dtof"])?;
    Ok(target_folder().join("release/dtof").canonicalize()?)
}

/// The program with the server for Foxglove, as tests have built it. It lies elsewhere, so that neither
/// takes the place of the other.
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

/// A Python with the packages of a requirements file of the workspace; says why if
/// there is none.
fn python(test: &str, requirements: &str) -> Option<PathBuf> {
    match cargo(&["xtask", "python", requirements]) {
        Ok(path) => Some(path.into()),
        Err(_) => {
            skipped(test, "no Python with its packages, see above");
            None
        }
    }
}

/// Runs a command that may not ask.
fn succeed(command: &mut Command) -> Result<()> {
    let name = command.get_program().display().to_string();
    let status = command.stdin(Stdio::null()).status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name}: {status}, see above");
    Ok(())
}
