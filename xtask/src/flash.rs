//! `cargo xtask flash`: an image onto a board.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::firmware::{Board, Build};
use crate::tools::PROBE_RS;

/// The controller of a board, as probe-rs calls it: that of the Discovery.
pub const fn chip(board: Board) -> &'static str {
    match board {
        Board::Pico => "RP2040",
        Board::Mps2An386 | Board::Stm32F405 => "STM32F407VGTx",
    }
}

/// Writes an image onto the board and shows what it logs until interrupted.
pub fn flash(root: &Path, board: Board, named: Option<&str>, what: Build) -> Result<()> {
    // Before anything is built.
    PROBE_RS.require()?;
    let image = board.build(root, what)?;
    let status = Command::new(PROBE_RS.program)
        .args([
            "run",
            "--non-interactive",
            "--chip",
            named.unwrap_or(chip(board)),
        ])
        .arg(&image)
        .stdin(Stdio::null())
        .status()
        .context("probe-rs does not start")?;
    ensure!(status.success(), "probe-rs: {status}");
    Ok(())
}
