//! QEMU, with an image.

use std::io::Read;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::firmware::Board;
use crate::tools::QEMU;

/// Far more than any image takes that ends.
const PATIENCE: Duration = Duration::from_secs(60);

/// The QEMU that is known to run `stm32f405`: QEMU 10, for one, ends at a reset of
/// the clocks.
const KNOWN: &str = "version 7.2.";

/// Why this QEMU does not run the images of `board`, if so.
pub fn cannot_run(board: Board) -> Result<Option<String>> {
    let version = QEMU.require()?;
    let cannot = board == Board::Stm32F405 && !version.contains(KNOWN);
    Ok(cannot.then(|| {
        let board = board.name();
        format!("SKIPPED: {board} is known to run in QEMU {KNOWN}x, this is {version}")
    }))
}

/// How to start an image. `word` is what it finds on its command line.
pub fn command(board: Board, image: &Path, port: Option<u16>, word: Option<&str>) -> Command {
    let uart = port.map_or_else(
        || "null".to_owned(),
        |port| format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on"),
    );
    let mut semihosting = "enable=on,target=native,arg=image".to_owned();
    if let Some(word) = word {
        semihosting.push_str(",arg=");
        semihosting.push_str(word);
    }
    let mut command = Command::new(QEMU.program);
    command.args(["-display", "none", "-monitor", "none"]);
    match board {
        Board::Mps2An386 => command.args(["-machine", "mps2-an386"]),
        // The first is USART1, ours USART2.
        Board::Stm32F405 => command.args(["-machine", "netduinoplus2", "-serial", "null"]),
    };
    command.args(["-serial", &uart, "-semihosting-config", &semihosting]);
    command.arg("-kernel").arg(image);
    command.stdin(Stdio::null());
    command
}

/// Runs an image that ends, with these arguments more for QEMU; gives how it ended and
/// what it printed.
pub fn run(board: Board, image: &Path, arguments: &[&str]) -> Result<(ExitStatus, String)> {
    QEMU.require()?;
    let mut emulator = command(board, image, None, None)
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("{} does not start", QEMU.program))?;
    let mut stdout = emulator.stdout.take().context("no output of QEMU")?;
    let output = thread::spawn(move || {
        let mut bytes = Vec::new();
        // The text before an error is kept.
        let _ = stdout.read_to_end(&mut bytes);
        bytes
    });
    let start = Instant::now();
    let status = loop {
        if let Some(status) = emulator.try_wait()? {
            break status;
        }
        if start.elapsed() > PATIENCE {
            emulator.kill()?;
            emulator.wait()?;
            bail!("the image does not end after {PATIENCE:?}");
        }
        thread::sleep(Duration::from_millis(5));
    };
    let bytes = output.join().unwrap_or_default();
    Ok((status, String::from_utf8_lossy(&bytes).into_owned()))
}
