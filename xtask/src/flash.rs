//! `cargo xtask flash`: an image onto a board.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::firmware::{Board, Build};
use crate::tools::PROBE_RS;

/// The controller of the Discovery board, as probe-rs calls it.
const CHIP: &str = "STM32F407VGTx";

/// Writes an image onto the board and shows what it logs until interrupted.
pub fn flash(root: &Path, chip: Option<&str>, what: Build) -> Result<()> {
    // Before anything is built.
    PROBE_RS.require()?;
    let image = Board::Stm32F405.build(root, what)?;
    let status = Command::new(PROBE_RS.program)
        .args(["run", "--non-interactive", "--chip", chip.unwrap_or(CHIP)])
        .arg(&image)
        .stdin(Stdio::null())
        .status()
        .context("probe-rs does not start")?;
    ensure!(status.success(), "probe-rs: {status}");
    Ok(())
}
