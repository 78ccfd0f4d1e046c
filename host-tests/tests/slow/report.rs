//! The scripts of the pages in Node.js, and the pages in a real browser, which `host-tests/report/check.py`
//! operates like a reader. Needs Node.js, Chromium and Python.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow report
//! cp out/check-report/report.png docs/figures/     # updates the pictures of the docs
//! cp out/check-view/live.png docs/figures/
//! ```

use std::fs;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::rp2040::NODE;
use crate::{dtof, enabled, python, root, succeed};

/// The most bytes of a picture of the docs.
const MOST_BYTES: u64 = 300_000;

/// The reports: a static scene, a moving one with more events than a report shows, an array whose maps
/// leave room for fewer, a few pixels and a single one in front of a moving target, and neighbours that
/// confirm each other.
const REPORTS: [(&str, &str); 6] = [
    ("static", "demo --quiet --out"),
    (
        "moving",
        "simulate --quiet --scene scenes/fan.toml --cycles 100000 --alpha 8 --dynamic-depth --out",
    ),
    ("large", "demo --quiet --array 256x256 --cycles 2000 --out"),
    (
        "few",
        "simulate --quiet --scene host-tests/report/approach.toml --alpha 8 --out",
    ),
    (
        "single",
        "simulate --quiet --scene host-tests/report/approach.toml --array 1x1 --alpha 8 --out",
    ),
    (
        "confirmed",
        "simulate --quiet --scene scenes/static.toml --array 16x16 --cycles 3000 --rule window --window 5 \
         --neighbours 8 --out",
    ),
];

#[test]
fn scripts_of_the_pages_pass_their_tests() -> Result<()> {
    let Some(_alone) = enabled("scripts of the pages", &[NODE]) else {
        return Ok(());
    };
    let mut node = Command::new(NODE);
    node.arg("--test");
    for package in ["run", "live"] {
        let folder = root().join("host").join(package).join("tests");
        let mut files = Vec::new();
        for entry in fs::read_dir(&folder)? {
            files.push(entry?.path());
        }
        files.retain(|path| path.to_string_lossy().ends_with(".test.js"));
        ensure!(files.len() >= 3, "{} has no tests", folder.display());
        node.args(files);
    }
    succeed(&mut node)
}

#[test]
fn reports_in_a_browser_are_drawn_turned_and_closed() -> Result<()> {
    let test = "reports in a browser";
    let Some(_alone) = enabled(test, &["chromium", "python3"]) else {
        return Ok(());
    };
    let Some(python) = python(test, "host-tests/report/requirements.txt") else {
        return Ok(());
    };
    let dtof = dtof()?;
    let root = root();
    let folder = root.join("out/check-report");
    let mut check = Command::new(python);
    check.arg(root.join("host-tests/report/check.py"));
    check.arg("chromium").arg(&folder);
    for (name, arguments) in REPORTS {
        let out = folder.join(name);
        let mut command = Command::new(&dtof);
        let command = command.current_dir(&root).args(arguments.split(' '));
        succeed(command.arg(out.canonicalize().unwrap_or(out.clone())))?;
        check.arg(out.join("report.html"));
    }
    succeed(&mut check)?;

    let bytes = fs::metadata(folder.join("report.png"))?.len();
    ensure!(bytes < MOST_BYTES, "report.png has {bytes} bytes");
    Ok(())
}

#[test]
fn a_recording_in_a_browser_waits_is_moved_and_slowed_down() -> Result<()> {
    let test = "a recording in a browser";
    let Some(_alone) = enabled(test, &["chromium", "python3"]) else {
        return Ok(());
    };
    let Some(python) = python(test, "host-tests/report/requirements.txt") else {
        return Ok(());
    };
    let (dtof, root) = (dtof()?, root());
    let folder = root.join("out/check-view");
    let mut demo = Command::new(&dtof);
    succeed(
        demo.current_dir(&root)
            .args(["demo", "--quiet", "--out"])
            .arg(&folder),
    )?;
    let picture = folder.join("live.png");
    for (script, output) in [("view.py", &folder), ("live.py", &picture)] {
        let mut check = Command::new(&python);
        check.arg(root.join("host-tests/report").join(script));
        check
            .arg("chromium")
            .arg(output)
            .arg(&dtof)
            .arg(folder.join("events.aer"));
        succeed(&mut check)?;
    }
    let bytes = fs::metadata(picture)?.len();
    ensure!(bytes < MOST_BYTES, "live.png has {bytes} bytes");
    Ok(())
}
