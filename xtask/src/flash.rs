//! `cargo xtask flash`: writes an image to a board.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::firmware::{Board, Build, Choice};
use crate::tools::PROBE_RS;

/// The probe-rs name of a board's controller.
pub fn chip(board: Board) -> Result<&'static str> {
    let chip = board.row().chip;
    chip.with_context(|| format!("{} is emulated only", board.name()))
}

/// Writes an image to the board and shows its log until interrupted.
pub fn flash(
    root: &Path,
    board: Board,
    named: Option<&str>,
    what: Build,
    choices: &[Choice],
) -> Result<()> {
    // Before the build.
    PROBE_RS.require()?;
    let chip = named.map_or_else(|| chip(board), Ok)?;
    let image = board.build(root, what, choices)?;
    let status = Command::new(PROBE_RS.program)
        .args(["run", "--non-interactive", "--chip", chip])
        .arg(&image)
        .stdin(Stdio::null())
        .status()
        .context("probe-rs does not start")?;
    ensure!(status.success(), "probe-rs: {status}");
    Ok(())
}
