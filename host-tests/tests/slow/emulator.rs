//! QEMU with an image, its serial port on a TCP port, and under a debugger's control.

use std::io::Read;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use dtof::device::{self, Port};

use crate::cargo;
use crate::debugger::Debugger;
use crate::stack::{self, Image};

/// How long anything may take that takes no time.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// What an image asks for that ends: `SYS_EXIT` and `SYS_EXIT_EXTENDED` of
/// Arm's semihosting.
const SYS_EXIT: [u32; 2] = [0x18, 0x20];

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";

/// A board that QEMU emulates.
#[derive(Clone, Copy, Debug)]
pub enum Board {
    Mps2An386,
    Stm32F405,
}

impl Board {
    /// Its name for `cargo xtask image`.
    fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Stm32F405 => "stm32f405",
        }
    }

    /// The path of its image, of the sidecar unless something else is named.
    pub fn image(self, what: &[&str]) -> Result<PathBuf> {
        let image = [&["xtask", "image", "--emulator", self.name()], what].concat();
        Ok(cargo(&image)?.into())
    }
}

/// How to start an image. `words` are what the image finds on its command line
/// behind its name.
fn command(board: Board, image: &Path, port: u16, words: &[&str]) -> Command {
    let mut semihosting = "enable=on,target=native,arg=image".to_owned();
    for word in words {
        semihosting.push_str(",arg=");
        semihosting.push_str(word);
    }
    let mut command = Command::new(QEMU);
    command.args(["-display", "none", "-monitor", "none"]);
    match board {
        Board::Mps2An386 => command.args(["-machine", "mps2-an386"]),
        // The first is USART1, ours USART2.
        Board::Stm32F405 => command.args(["-machine", "netduinoplus2", "-serial", "null"]),
    };
    let uart = format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
    command.args(["-serial", &uart, "-semihosting-config", &semihosting]);
    command.arg("-kernel").arg(image);
    command.stdin(Stdio::null());
    command
}

/// An emulator, ended when dropped. It is under a debugger's control, so that
/// the stack can be read before it ends.
pub struct Emulator {
    child: Child,
    port: u16,
    debugger: Debugger,
    image: Image,
    output: Option<JoinHandle<Vec<u8>>>,
}

/// How an image has ended its emulator.
pub struct End {
    pub status: ExitStatus,
    /// What was printed.
    pub output: Vec<u8>,
    /// Bytes of the stack that were used.
    pub stack: u64,
}

impl Emulator {
    /// Starts an image with its serial port on a free TCP port; before its first
    /// instruction it waits.
    pub fn start(board: Board, path: &Path, words: &[&str]) -> Result<Self> {
        let image = Image::read(path)?;
        let [port, debugger_port] = free_ports()?;
        let mut child = command(board, path, port, words)
            .args(["-S", "-gdb", &format!("tcp:127.0.0.1:{debugger_port}")])
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("{QEMU} does not start"))?;
        let mut stdout = child.stdout.take().context("no output of QEMU")?;
        let output = thread::spawn(move || {
            let mut bytes = Vec::new();
            // What came before an error is all there is.
            let _ = stdout.read_to_end(&mut bytes);
            bytes
        });
        let debugger = match open(&mut child, || Debugger::connect(debugger_port, PATIENCE)) {
            Ok(debugger) => debugger,
            Err(error) => {
                // It may have ended by itself.
                let _ = child.kill();
                let _ = child.wait();
                return Err(error);
            }
        };
        Ok(Self {
            child,
            port,
            debugger,
            image,
            output: Some(output),
        })
    }

    /// Lets the image run and connects to its serial port.
    pub fn connect(&mut self) -> Result<Box<dyn Port>> {
        self.debugger.resume()?;
        let port = format!("tcp:127.0.0.1:{}", self.port);
        open(&mut self.child, || device::open(&port, None))
    }

    /// Lets the image run until it ends QEMU. With QEMU ends its memory, so the
    /// image is stopped before whatever it asks of the emulator.
    pub fn wait(mut self) -> Result<End> {
        let start = Instant::now();
        for &address in &self.image.semihosting {
            self.debugger.set_breakpoint(address, true)?;
        }
        loop {
            self.debugger.resume()?;
            self.debugger.wait_for_stop()?;
            let registers = self.debugger.registers()?;
            if SYS_EXIT.contains(&registers[0]) {
                break;
            }
            if start.elapsed() > PATIENCE {
                bail!("the image does not end after {PATIENCE:?}");
            }
            let address = registers[15].into();
            self.debugger.set_breakpoint(address, false)?;
            self.debugger.step()?;
            self.debugger.set_breakpoint(address, true)?;
        }
        let stack = self.stack()?;
        for &address in &self.image.semihosting {
            self.debugger.set_breakpoint(address, false)?;
        }
        self.debugger.resume()?;
        let status = loop {
            if let Some(status) = self.child.try_wait()? {
                break status;
            }
            if start.elapsed() > PATIENCE {
                bail!("the image does not end after {PATIENCE:?}");
            }
            thread::sleep(Duration::from_millis(20));
        };
        Ok(End {
            status,
            output: self
                .output
                .take()
                .and_then(|output| output.join().ok())
                .unwrap_or_default(),
            stack,
        })
    }

    /// Ends QEMU; bytes of the stack that were used.
    pub fn stop(mut self) -> Result<u64> {
        self.debugger.interrupt()?;
        self.stack()
    }

    /// Bytes of the stack that were used.
    fn stack(&mut self) -> Result<u64> {
        let memory = self.debugger.memory(self.image.stack.clone())?;
        Ok(stack::high_water(&memory))
    }
}

/// Two TCP ports that are free now; should another take one meanwhile, the emulator ends
/// at once.
pub fn free_ports() -> Result<[u16; 2]> {
    let bind = || TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
    let (first, second) = (bind()?, bind()?);
    Ok([first.local_addr()?.port(), second.local_addr()?.port()])
}

/// Opens what an emulator is about to open.
pub fn open<T, E: Into<anyhow::Error>>(
    child: &mut Child,
    open: impl Fn() -> Result<T, E>,
) -> Result<T> {
    let start = Instant::now();
    loop {
        let error = match open() {
            Ok(opened) => return Ok(opened),
            Err(error) => error,
        };
        if let Some(status) = child.try_wait()? {
            bail!("the emulator ended at once: {status}");
        }
        if start.elapsed() > PATIENCE {
            return Err(error.into()).context("the emulator does not open its ports");
        }
        thread::sleep(Duration::from_millis(20));
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
