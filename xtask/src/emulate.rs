//! `cargo xtask emulate` and `cargo xtask flash`: an image where it runs.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::firmware::Board;
use crate::tools::{DEFMT_PRINT, PROBE_RS, QEMU};
use crate::{log, qemu};

/// Where the serial port is unless said otherwise.
const PORT: u16 = 5386;

/// The controller of the Discovery board.
pub const CHIP: &str = "STM32F407VGTx";

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
/// `chip` is probe-rs's name for the controller.
pub fn flash(root: &Path, chip: &str) -> Result<()> {
    run_on_board(&Board::Stm32F405.sidecar(root, &[])?, chip)
}

/// Writes the self-test onto the board in its place and shows what it writes, which
/// comes through semihosting, until it ends.
pub fn flash_self_test(root: &Path, chip: &str) -> Result<()> {
    run_on_board(&Board::Stm32F405.self_test(root)?, chip)
}

fn run_on_board(image: &Path, chip: &str) -> Result<()> {
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
