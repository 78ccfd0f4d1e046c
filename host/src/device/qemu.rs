//! An emulated device of one's own: `cargo xtask emulate` in this workspace.

use std::env;
use std::io::{self, IsTerminal};
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::port::{self, Port};

/// The image may have to be built first.
const PATIENCE: Duration = Duration::from_secs(300);

/// An emulator and its serial port; it ends with this.
pub struct Emulator {
    cargo: Child,
    port: Box<dyn Port>,
}

impl Emulator {
    /// Builds the image if need be and starts it.
    ///
    /// # Errors
    /// If it does not start, as without QEMU; the reason is on standard error.
    pub fn start() -> Result<Self> {
        // Free now; should another take it meanwhile, QEMU ends at once.
        let number = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?
            .local_addr()?
            .port();
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        command
            .current_dir(workspace)
            .args(["xtask", "emulate", "--port", &number.to_string()])
            // However this program ends, the other end of the pipe then does.
            .args(["--until", "end-of-input"])
            .stdin(Stdio::piped())
            .stdout(Stdio::null());
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt;
            // Of its own, so that the emulator ends with the cargo that ran it.
            command.process_group(0);
        }
        if io::stderr().is_terminal() {
            eprintln!("starting the emulator; its image may have to be built first");
        }
        let mut cargo = command.spawn().context("cargo does not start")?;
        let since = Instant::now();
        loop {
            if let Ok(stream) = port::tcp(&format!("127.0.0.1:{number}")) {
                return Ok(Self {
                    cargo,
                    port: Box::new(stream),
                });
            }
            if let Some(status) = cargo.try_wait()? {
                bail!("`cargo xtask emulate` ended with {status}, see above");
            }
            if since.elapsed() > PATIENCE {
                end(&mut cargo);
                bail!(
                    "the emulator does not start within {} seconds",
                    PATIENCE.as_secs()
                );
            }
            thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Port for Emulator {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.port.receive(bytes)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        end(&mut self.cargo);
    }
}

/// Ends cargo and all it has started.
fn end(cargo: &mut Child) {
    drop(cargo.stdin.take());
    let since = Instant::now();
    while since.elapsed() < Duration::from_secs(2) {
        if !matches!(cargo.try_wait(), Ok(None)) {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
    // The minus sign names the group. Where there is no `kill`, cargo alone ends.
    let group = format!("-{}", cargo.id());
    let _ = Command::new("kill").args(["-TERM", "--", &group]).status();
    let _ = cargo.kill();
    let _ = cargo.wait();
}
