//! QEMU, with an image and its serial port on a TCP port.

use std::fmt;
use std::io::Read;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use dtof::device::{self, Port};

use crate::firmware::Board;
use crate::tools::QEMU;

/// How long anything may take that takes no time.
const PATIENCE: Duration = Duration::from_secs(20);

/// QEMU's version: major and minor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Version(u32, u32);

impl Version {
    /// That of the QEMU there is.
    fn installed() -> Result<Self> {
        let line = QEMU.require()?;
        Self::parse(&line).with_context(|| format!("what version is `{line}`?"))
    }

    /// From `QEMU emulator version 7.2.22 (…)`.
    fn parse(line: &str) -> Option<Self> {
        let mut numbers = line.split_once("version ")?.1.split(['.', ' ']);
        Some(Self(
            numbers.next()?.parse().ok()?,
            numbers.next()?.parse().ok()?,
        ))
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.0, self.1)
    }
}

/// Why this QEMU does not run the images of `board`, if so.
pub fn cannot_run(board: Board) -> Result<Option<String>> {
    let version = Version::installed()?;
    // Of netduinoplus2 only this is known to do: QEMU 10, for one, ends at a
    // reset of the clocks.
    let known = Version(7, 2);
    let cannot = board == Board::Stm32F405 && version != known;
    Ok(cannot.then(|| {
        let board = board.name();
        format!("SKIPPED: {board} is known to run in QEMU {known}, this is {version}")
    }))
}

/// How to start an image. `words` are what the image finds on its command line
/// behind its name.
pub fn command(board: Board, image: &Path, port: Option<u16>, words: &[&str]) -> Result<Command> {
    QEMU.require()?;
    let uart = port.map_or_else(
        || "null".to_owned(),
        |port| format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on"),
    );
    let (machine, unused_uarts) = match board {
        Board::Mps2An386 => ("mps2-an386", 0),
        // The first is USART1, ours USART2.
        Board::Stm32F405 => ("netduinoplus2", 1),
    };
    let mut semihosting = "enable=on,target=native,arg=image".to_owned();
    for word in words {
        semihosting.push_str(",arg=");
        semihosting.push_str(&word.replace(',', ",,"));
    }
    let mut command = Command::new(QEMU.program);
    command.args(["-machine", machine, "-display", "none", "-monitor", "none"]);
    for _ in 0..unused_uarts {
        command.args(["-serial", "null"]);
    }
    command.args(["-serial", &uart, "-semihosting-config", &semihosting]);
    command.arg("-kernel").arg(image);
    command.stdin(Stdio::null());
    Ok(command)
}

/// A running emulator, ended when dropped.
pub struct Emulator {
    child: Child,
    port: u16,
    output: Option<JoinHandle<Vec<u8>>>,
}

impl Emulator {
    /// Starts an image with its serial port on a free TCP port.
    pub fn start(board: Board, image: &Path, words: &[&str]) -> Result<Self> {
        Self::start_with(board, image, words, &[])
    }

    /// The same with these arguments more for QEMU.
    pub fn start_with(
        board: Board,
        image: &Path,
        words: &[&str],
        arguments: &[&str],
    ) -> Result<Self> {
        // Free now; should another take it meanwhile, QEMU ends at once.
        let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?
            .local_addr()?
            .port();
        let mut child = command(board, image, Some(port), words)?
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("{} does not start", QEMU.program))?;
        let mut stdout = child.stdout.take().context("no output of QEMU")?;
        let output = thread::spawn(move || {
            let mut bytes = Vec::new();
            // What came before an error is all there is.
            let _ = stdout.read_to_end(&mut bytes);
            bytes
        });
        Ok(Self {
            child,
            port,
            output: Some(output),
        })
    }

    /// Connects to the serial port.
    pub fn connect(&mut self) -> Result<Box<dyn Port>> {
        let start = Instant::now();
        loop {
            let error = match device::open(&format!("tcp:127.0.0.1:{}", self.port)) {
                Ok(port) => return Ok(port),
                Err(error) => error,
            };
            if let Some(status) = self.child.try_wait()? {
                bail!("QEMU ended at once: {status}");
            }
            if start.elapsed() > PATIENCE {
                return Err(error).context("QEMU does not open its serial port");
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the image ends QEMU; how it did, and what was printed.
    pub fn wait(mut self) -> Result<(ExitStatus, Vec<u8>)> {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok((status, self.output()));
            }
            if start.elapsed() > PATIENCE {
                bail!("the image does not end after {PATIENCE:?}");
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends QEMU; what was printed.
    pub fn stop(mut self) -> Result<Vec<u8>> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(self.output())
    }

    fn output(&mut self) -> Vec<u8> {
        let output = self.output.take().and_then(|output| output.join().ok());
        output.unwrap_or_default()
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_version() {
        let line = "QEMU emulator version 7.2.22 (Debian 1:7.2+dfsg-7+deb12u18)";
        assert_eq!(Version::parse(line), Some(Version(7, 2)));
        let line = "QEMU emulator version 10.0.0";
        assert_eq!(Version::parse(line), Some(Version(10, 0)));
        assert_eq!(Version::parse("QEMU"), None);
    }
}
