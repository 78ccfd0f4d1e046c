//! Output of `dtof export` and `dtof view --foxglove`, read by other projects' programs and checked by
//! `host-tests/readers/check.py` and `live.py`. Needs Python. The readers are installed in the build
//! folder, from the package index if they are missing.
//!
//! ```sh
//! DTOF_SLOW=1 cargo test --package dtof-host-tests --test slow readers
//! ```

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;

use crate::{dtof, dtof_with_foxglove, enabled, python, root, succeed, target_folder};

/// A scene with a moving target, for changes of depth.
const SCENE: &str = "scenes/radial.toml";
const CYCLES: &str = "40000";

#[test]
#[ignore = "takes minutes: `.ci/long boards` runs it"]
fn other_readers_find_in_exported_files_what_is_in_them() -> Result<()> {
    let test = "exported files in other readers";
    let Some(_alone) = enabled(test, &["python3"]) else {
        return Ok(());
    };
    let Some(python) = python(test, "host-tests/readers/requirements.txt") else {
        return Ok(());
    };
    let dtof = dtof()?;
    let root = root().canonicalize()?;
    let folder = scene(&dtof, "readers")?;

    let mut compare = Command::new(python);
    compare
        .arg(root.join("host-tests/readers/check.py"))
        .arg(&dtof);
    compare
        .arg("scene/events.aer")
        .arg(root.join("docs/export.md"));
    // No .pyc files in the repository.
    compare.env("PYTHONDONTWRITEBYTECODE", "1");
    succeed(compare.current_dir(&folder))
}

#[test]
#[ignore = "takes minutes: `.ci/long boards` runs it"]
fn another_client_finds_in_live_data_what_is_in_the_recording() -> Result<()> {
    let test = "live data in other readers";
    let Some(_alone) = enabled(test, &["python3"]) else {
        return Ok(());
    };
    let Some(python) = python(test, "host-tests/readers/requirements.txt") else {
        return Ok(());
    };
    let dtof = dtof_with_foxglove()?;
    let folder = scene(&dtof, "live")?;
    let root = root().canonicalize()?;
    let mut compare = Command::new(python);
    compare
        .arg(root.join("host-tests/readers/live.py"))
        .arg(&dtof);
    compare
        .arg("scene/events.aer")
        .arg(root.join("docs/view.md"));
    compare.env("PYTHONDONTWRITEBYTECODE", "1");
    succeed(compare.current_dir(&folder))
}

/// A folder of this name with a simulation in `scene`.
fn scene(dtof: &Path, name: &str) -> Result<PathBuf> {
    let folder = target_folder().join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder)?;
    let mut simulate = Command::new(dtof);
    simulate.arg("simulate").arg("--scene");
    simulate.arg(root().canonicalize()?.join(SCENE));
    simulate.args(["--cycles", CYCLES, "--quiet", "--out", "scene"]);
    succeed(simulate.current_dir(&folder))?;
    Ok(folder)
}
