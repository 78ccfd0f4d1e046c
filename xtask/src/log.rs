//! What an image logs, made readable by defmt-print.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;

use anyhow::{Context, Result, ensure};

use crate::tools::DEFMT_PRINT;

/// A decoder of what comes from its standard input.
pub fn decoder(image: &Path) -> Command {
    let mut command = Command::new(DEFMT_PRINT.program);
    command.arg("-e").arg(image);
    command
}

/// The lines in `bytes`.
pub fn decode(image: &Path, bytes: Vec<u8>) -> Result<String> {
    DEFMT_PRINT.require()?;
    let mut child = decoder(image)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("defmt-print does not start")?;
    let mut stdin = child.stdin.take().context("no input of defmt-print")?;
    // Should it end early, its status says so.
    let writer = thread::spawn(move || stdin.write_all(&bytes));
    let output = child.wait_with_output()?;
    let _ = writer.join();
    ensure!(output.status.success(), "defmt-print: {}", output.status);
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
