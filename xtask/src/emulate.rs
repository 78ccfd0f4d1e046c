//! `cargo xtask emulate`: the sidecar in QEMU.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use crate::firmware::{Board, Build};
use crate::qemu;
use crate::tools::{DEFMT_PRINT, QEMU};

/// Where the serial port is unless said otherwise.
const PORT: u16 = 5386;

/// Runs the sidecar in QEMU until it ends or is interrupted. `end` is how it is to
/// end by itself.
pub fn emulate(root: &Path, port: Option<u16>, end: Option<&str>) -> Result<()> {
    let port = port.unwrap_or(PORT);
    QEMU.require()?;
    let board = Board::Mps2An386;
    let image = board.build_for_emulator(root, Build::Sidecar)?;
    let mut command = qemu::command(board, &image, Some(port), end);
    println!("the serial port is tcp:127.0.0.1:{port}; Ctrl-C ends");
    println!("what the board sends while nobody is connected is lost");
    let decoded = DEFMT_PRINT.is_there();
    if decoded {
        command.stdout(Stdio::piped());
    } else {
        println!("the log comes as it is: {}", DEFMT_PRINT.missing());
    }
    let mut emulator = command
        .spawn()
        .with_context(|| format!("{} does not start", QEMU.program))?;
    if let Some(log) = emulator.stdout.take() {
        let mut decoder = Command::new(DEFMT_PRINT.program);
        let status = decoder.arg("-e").arg(&image).stdin(log).status();
        if !status.as_ref().is_ok_and(|status| status.success()) {
            // Nobody reads the log, and so nobody sees when it is over.
            emulator.kill()?;
        }
        let status = status.with_context(|| format!("{} does not start", DEFMT_PRINT.program))?;
        ensure!(status.success(), "{}: {status}", DEFMT_PRINT.program);
    }
    let status = emulator.wait()?;
    ensure!(status.success(), "QEMU: {status}");
    Ok(())
}
