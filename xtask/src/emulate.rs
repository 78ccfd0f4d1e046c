//! `cargo xtask emulate` and `cargo xtask flash`: an image where it runs.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::firmware::{Board, Sensor};
use crate::tools::{DEFMT_PRINT, PROBE_RS, QEMU};
use crate::{log, qemu};

/// Where the serial port is unless said otherwise.
const PORT: u16 = 5386;

/// The controller of the Discovery board, as probe-rs calls it.
const CHIP: &str = "STM32F407VGTx";

/// Runs the sidecar in QEMU until it ends or is interrupted.
pub fn emulate(root: &Path, arguments: &[&str]) -> Result<()> {
    let (port, words) = match arguments {
        ["--port", port, words @ ..] => {
            let port = port.parse().with_context(|| format!("no port: `{port}`"))?;
            (port, words)
        }
        words => (PORT, words),
    };
    QEMU.require()?;
    let board = Board::Mps2An386;
    let image = board.sidecar(root, &[])?;
    let mut command = qemu::command(board, &image, Some(port), words)?;
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
    if decoded {
        let stdout = emulator.stdout.take().context("no output of QEMU")?;
        let status = log::decoder(&image).stdin(stdout).status();
        if !status.is_ok_and(|status| status.success()) {
            // It may have ended by itself.
            let _ = emulator.kill();
            emulator.wait()?;
            bail!("{} failed", DEFMT_PRINT.program);
        }
    }
    let status = emulator.wait()?;
    ensure!(status.success(), "QEMU: {status}");
    Ok(())
}

/// Writes the sidecar onto the board and shows its log until interrupted.
pub fn flash(root: &Path, arguments: &[&str]) -> Result<()> {
    let (chip, rest) = match arguments {
        ["--chip", chip, rest @ ..] => (*chip, rest),
        rest => (CHIP, rest),
    };
    let image = match rest {
        [] => Board::Stm32F405.sidecar(root, &[])?,
        // What it writes comes through semihosting.
        ["self-test"] => Board::Stm32F405.self_test(root)?,
        [sensor] => Sensor::named(sensor)?.sidecar(root)?,
        [_, more, ..] => bail!("what is `{more}`?"),
    };
    PROBE_RS.require()?;
    let status = Command::new(PROBE_RS.program)
        .args(["run", "--non-interactive", "--chip", chip])
        .arg(image)
        .stdin(Stdio::null())
        .status()
        .context("probe-rs does not start")?;
    ensure!(status.success(), "probe-rs: {status}");
    Ok(())
}
