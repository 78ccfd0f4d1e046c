//! `cargo xtask check-report`: the reports of `dtof` in a real browser.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::python;
use crate::tools::CHROMIUM;

/// The picture of the README.
const PICTURE: &str = "docs/figures/report.png";
const MOST_BYTES: u64 = 300_000;

/// Makes the reports of a static scene, of a moving one and of a large array and uses them as a reader
/// does; the pictures are in `out/check-report`. With `picture` that of the README is
/// written, too.
///
/// # Errors
/// If the browser or its driver are not there, or a report is not as it should be.
pub fn check(root: &Path, picture: bool) -> Result<()> {
    CHROMIUM.require()?;
    let xtask = root.join("xtask");
    let python = python::environment(
        root,
        "browser",
        &xtask.join("check-report.requirements.txt"),
    )?;
    let folder = root.join("out").join("check-report");
    let [still, moving, large] = ["static", "moving", "large"].map(|name| folder.join(name));
    dtof(root, &["demo", "--quiet", "--out"], &still)?;
    // More events than a report shows.
    let fan = "simulate --quiet --scene scenes/fan.toml --cycles 100000 --alpha 8 --out";
    dtof(root, &fan.split(' ').collect::<Vec<_>>(), &moving)?;

    // Maps that leave room for fewer.
    let array = "demo --quiet --array 256x256 --cycles 2000 --out";
    dtof(root, &array.split(' ').collect::<Vec<_>>(), &large)?;

    let status = Command::new(python)
        .arg(xtask.join("check-report.py"))
        .args([CHROMIUM.program.as_ref(), folder.as_path()])
        .args([still, moving, large].map(|folder| folder.join("report.html")))
        .status()
        .context("the check does not start")?;
    ensure!(
        status.success(),
        "the report is not as it should be, see above"
    );

    if picture {
        let taken = folder.join("report.png");
        let bytes = fs::metadata(&taken)?.len();
        ensure!(bytes < MOST_BYTES, "{PICTURE} would have {bytes} bytes");
        fs::copy(&taken, root.join(PICTURE)).context(PICTURE)?;
    }
    Ok(())
}

/// Runs `dtof` with `out` as its last argument.
fn dtof(root: &Path, arguments: &[&str], out: &Path) -> Result<()> {
    let status = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(root)
        .args(["run", "--quiet", "--locked", "--release"])
        .args(["--package", "dtof", "--"])
        .args(arguments)
        .arg(out)
        .status()
        .context("cargo does not start")?;
    ensure!(status.success(), "dtof {}: {status}", arguments.join(" "));
    Ok(())
}
