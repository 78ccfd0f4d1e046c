//! `cargo xtask emulate`: the sidecar in an emulator.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::emulator;
use crate::firmware::{Board, Build, Emulator};
use crate::tools::DEFMT_PRINT;

/// The default TCP port of the serial port.
const PORT: u16 = 5386;

/// Runs the sidecar in the emulator of `board` until it ends or is interrupted. In QEMU, `end` is
/// the way it ends by itself.
pub fn emulate(root: &Path, board: Board, port: Option<u16>, end: Option<&str>) -> Result<()> {
    let port = port.unwrap_or(PORT);
    if let Some(reason) = emulator::cannot_run(board)? {
        bail!("{reason}");
    }
    let image = board.build_for_emulator(root, Build::Sidecar, &[])?;
    let mut command = emulator::command(board, &image, Some(port), end)?;
    println!("the serial port is tcp:127.0.0.1:{port}; Ctrl-C ends");
    println!("bytes that the board sends without a connection are lost");
    // rp2040js has no debug probe for the log.
    let logs = !matches!(board.row().emulator, Emulator::Rp2040js);
    let decoded = logs && DEFMT_PRINT.is_installed();
    if decoded {
        command.stdout(Stdio::piped());
    } else if logs {
        println!("the log is not decoded: {}", DEFMT_PRINT.missing());
    }
    let mut emulator = command.spawn().context("the emulator does not start")?;
    if let Some(log) = emulator.stdout.take() {
        let mut decoder = Command::new(DEFMT_PRINT.program);
        let status = decoder.arg("-e").arg(&image).stdin(log).status();
        if !status.as_ref().is_ok_and(|status| status.success()) {
            // Nothing reads the log, so its end would go unnoticed.
            emulator.kill()?;
        }
        let status = status.with_context(|| format!("{} does not start", DEFMT_PRINT.program))?;
        ensure!(status.success(), "{}: {status}", DEFMT_PRINT.program);
    }
    let status = emulator.wait()?;
    ensure!(status.success(), "the emulator: {status}");
    Ok(())
}
