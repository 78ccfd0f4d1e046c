//! `cargo xtask emulate` and `cargo xtask flash`: an image where it runs.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};

use crate::firmware::{Board, Sensor};
use crate::tools::{DEFMT_PRINT, PROBE_RS, QEMU};
use crate::{log, qemu};

/// Where the serial port is unless said otherwise.
const PORT: u16 = 5386;

/// How often it is seen to whether the emulator should end.
const POLL: Duration = Duration::from_millis(20);

/// The controller of the Discovery board, as probe-rs calls it.
const CHIP: &str = "STM32F407VGTx";

/// Runs the sidecar in QEMU until it ends or is interrupted; with `--until
/// end-of-input` at the latest when standard input ends.
pub fn emulate(root: &Path, arguments: &[&str]) -> Result<()> {
    let (mut port, mut is_over, mut words) = (PORT, None, Vec::new());
    let mut arguments = arguments.iter();
    while let Some(&argument) = arguments.next() {
        match argument {
            "--port" => {
                let number = arguments.next().context("--port wants a number")?;
                port = number
                    .parse()
                    .with_context(|| format!("no port: `{number}`"))?;
            }
            "--until" => {
                let what = arguments.next();
                ensure!(what == Some(&"end-of-input"), "--until end-of-input");
                is_over = Some(end_of_input());
            }
            "exit" | "panic" | "fault" => words.push(argument),
            _ => bail!("what is `{argument}`? --port, exit, panic or fault"),
        }
    }
    let is_over = || {
        let ended = is_over.as_ref();
        ended.is_some_and(|ended| ended.load(Ordering::Relaxed))
    };
    QEMU.require()?;
    let board = Board::Mps2An386;
    let image = board.sidecar(root, &[])?;
    if is_over() {
        return Ok(());
    }
    let mut command = qemu::command(board, &image, Some(port), &words)?;
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
    let mut decoder = match emulator.stdout.take() {
        Some(stdout) => Some(log::decoder(&image).stdin(stdout).spawn()?),
        None => None,
    };
    let status = loop {
        if let Some(status) = emulator.try_wait()? {
            break Some(status);
        }
        let decoder_ended = match &mut decoder {
            Some(decoder) => decoder.try_wait()?.is_some(),
            None => false,
        };
        if is_over() || decoder_ended {
            emulator.kill()?;
            emulator.wait()?;
            break None;
        }
        thread::sleep(POLL);
    };
    if let Some(mut decoder) = decoder {
        let status = decoder.wait()?;
        ensure!(status.success(), "{}: {status}", DEFMT_PRINT.program);
    }
    match status {
        Some(status) if !status.success() => bail!("QEMU: {status}"),
        _ => Ok(()),
    }
}

/// Becomes true when standard input has ended.
fn end_of_input() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let ends = Arc::clone(&ended);
    thread::spawn(move || {
        // An error is an end as well.
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        ends.store(true, Ordering::Relaxed);
    });
    ended
}

/// Writes the sidecar onto the board and shows its log until interrupted.
pub fn flash(root: &Path, arguments: &[&str]) -> Result<()> {
    let (mut chip, mut connected) = (CHIP, None);
    let mut arguments = arguments.iter();
    while let Some(&argument) = arguments.next() {
        match argument {
            "--chip" => chip = arguments.next().context("--chip wants a name")?,
            _ if argument.starts_with('-') || connected.is_some() => bail!(
                "what is `{argument}`? cargo xtask flash [--chip CHIP] [tdc7200 | tmf882x | self-test]"
            ),
            _ => connected = Some(argument),
        }
    }
    let sensor = match connected {
        None | Some("self-test") => None,
        Some(name) => Some(Sensor::named(name)?),
    };
    // Before anything is built.
    PROBE_RS.require()?;
    let image = match (sensor, connected) {
        (Some(sensor), _) => sensor.sidecar(root)?,
        // What it writes comes through semihosting.
        (None, Some(_)) => Board::Stm32F405.self_test(root)?,
        (None, None) => Board::Stm32F405.sidecar(root, &[])?,
    };
    let status = Command::new(PROBE_RS.program)
        .args(["run", "--non-interactive", "--chip", chip])
        .arg(&image)
        .stdin(Stdio::null())
        .status()
        .context("probe-rs does not start")?;
    ensure!(status.success(), "probe-rs: {status}");
    Ok(())
}
