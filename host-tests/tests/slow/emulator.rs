//! Runs an image in QEMU, with its serial port on a TCP port and a debugger attached.

use std::ffi::OsStr;
use std::io::Read;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use dtof_device::Port;

use crate::cargo;
use crate::debugger::Debugger;
use crate::stack::{self, Image};

/// The longest wait for something that should take no time.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// The longest run of an image that ends by itself, on a busy computer. The self-test takes half a second. From stop to
/// stop it is [`PATIENCE`].
const LONGEST: Duration = Duration::from_secs(120);

/// The semihosting operations that end an image: `SYS_EXIT` and `SYS_EXIT_EXTENDED`.
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

    /// The path of its image, by default the sidecar.
    pub fn image(self, what: &[&str]) -> Result<PathBuf> {
        let image = [&["xtask", "image", "--emulator", self.name()], what].concat();
        Ok(cargo(&image)?.into())
    }
}

/// The command that starts an image. `words` follow its name on its command line.
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
        // The first serial port is USART1, ours is USART2.
        Board::Stm32F405 => command.args(["-machine", "netduinoplus2", "-serial", "null"]),
    };
    let uart = format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
    command.args(["-serial", &uart, "-semihosting-config", &semihosting]);
    command.arg("-kernel").arg(image);
    command.stdin(Stdio::null());
    command
}

/// What is done to a running image of a board with a flash at `0x0800_0000`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planted {
    /// A function that panics is called.
    Panic,
    /// The next instruction lies where no memory is: a hard fault.
    Fault,
    /// A function begins with no room on the stack.
    Overflow,
    /// A loop without end; interrupts go on.
    Hang,
    /// The handler of the processor's timer returns at once: no millisecond ends any more.
    Clock,
}

/// An emulator, ended when dropped. A debugger reads its stack before it ends.
pub struct Emulator {
    board: Board,
    child: Child,
    port: u16,
    debugger: Debugger,
    image: Image,
    output: Option<JoinHandle<Vec<u8>>>,
}

/// The result of a run that ended.
pub struct End {
    pub status: ExitStatus,
    /// The output.
    pub output: Vec<u8>,
    /// The bytes of stack used.
    pub stack: u64,
    /// The laser of mps2-an386 during the run and at the end; LED0 stands for it.
    pub laser: Option<Laser>,
}

/// A laser that was on during the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Laser {
    pub is_on: bool,
    /// Words of the statics that have changed since.
    pub changed: usize,
}

/// The result of a stack overflow.
pub struct Overflow {
    /// The logs before and after the reset.
    pub logs: [Vec<u8>; 2],
    /// Words of the statics that changed before the reset.
    pub changed: usize,
}

impl Emulator {
    /// Starts an image with its serial port on a free TCP port. It waits before its first
    /// instruction.
    pub fn start(board: Board, path: &Path, words: &[&str]) -> Result<Self> {
        Self::spawn(board, path, words, &[])
    }

    /// Starts an image as [`Self::start`] does. The file `log` gets a line for each access to a part that QEMU does not
    /// have.
    pub fn start_logged(board: Board, path: &Path, log: &Path) -> Result<Self> {
        Self::spawn(
            board,
            path,
            &[],
            &[
                "-d".as_ref(),
                "unimp".as_ref(),
                "-D".as_ref(),
                log.as_os_str(),
            ],
        )
    }

    fn spawn(board: Board, path: &Path, words: &[&str], more: &[&OsStr]) -> Result<Self> {
        let image = Image::read(path)?;
        let [port, debugger_port] = free_ports()?;
        let mut child = command(board, path, port, words)
            .args(more)
            .args(["-S", "-gdb", &format!("tcp:127.0.0.1:{debugger_port}")])
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("{QEMU} does not start"))?;
        let mut stdout = child.stdout.take().context("no output of QEMU")?;
        let output = thread::spawn(move || {
            let mut bytes = Vec::new();
            // Keeps the output before an error.
            let _ = stdout.read_to_end(&mut bytes);
            bytes
        });
        let debugger = match open(&mut child, || Debugger::connect(debugger_port, PATIENCE)) {
            Ok(debugger) => debugger,
            Err(error) => {
                // It may already have ended.
                let _ = child.kill();
                let _ = child.wait();
                return Err(error);
            }
        };
        Ok(Self {
            board,
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
        open(&mut self.child, || dtof_device::open(&port, None))
    }

    /// Lets the image run until it ends QEMU. Its memory is gone then, so the debugger stops it before
    /// each semihosting call.
    pub fn wait(mut self) -> Result<End> {
        let start = Instant::now();
        for &address in &self.image.semihosting {
            self.debugger.set_breakpoint(address, true)?;
        }
        let mut statics = None;
        loop {
            self.debugger.resume()?;
            self.debugger.wait_for_stop()?;
            let registers = self.debugger.registers()?;
            if statics.is_none() && self.laser_is_on()? {
                statics = Some(self.statics()?);
            }
            if SYS_EXIT.contains(&registers[0]) {
                break;
            }
            if start.elapsed() > LONGEST {
                bail!("the image did not end within {LONGEST:?}");
            }
            let address = registers[15].into();
            self.debugger.set_breakpoint(address, false)?;
            self.debugger.step()?;
            self.debugger.set_breakpoint(address, true)?;
        }
        let stack = self.stack()?;
        let laser = match statics {
            None => None,
            Some(before) => Some(Laser {
                is_on: self.laser_is_on()?,
                changed: changed(&before, &self.statics()?),
            }),
        };
        for &address in &self.image.semihosting {
            self.debugger.set_breakpoint(address, false)?;
        }
        self.debugger.resume()?;
        let status = loop {
            if let Some(status) = self.child.try_wait()? {
                break status;
            }
            if start.elapsed() > LONGEST {
                bail!("the image did not end within {LONGEST:?}");
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
            laser,
        })
    }

    /// Stops the image while it runs.
    pub fn interrupt(&mut self) -> Result<()> {
        self.debugger.interrupt()
    }

    /// Lets the image run.
    pub fn resume(&mut self) -> Result<()> {
        self.debugger.resume()
    }

    /// The milliseconds that an image has counted, while it is stopped.
    pub fn milliseconds(&mut self) -> Result<u32> {
        let place = self.image.function("12MILLISECONDS")?;
        let bytes = self.debugger.memory(place..place + 4)?;
        let bytes = bytes.as_slice().try_into().context("no word")?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Plants a fault into an image that is stopped.
    pub fn plant(&mut self, what: Planted) -> Result<()> {
        const NO_MEMORY: u32 = 0x6000_0000;
        /// `bx lr`, and an instruction that does nothing.
        const RETURN: u32 = 0xbf00_4770;
        /// `cpsie i`, and a branch to itself.
        const ON_FOR_EVER: u32 = 0xe7fe_b662;
        /// Reserved vectors: a `Location` without a file.
        const ZEROS: u32 = 0x0800_001c;
        let image = &self.image;
        let at = |part: &str| anyhow::Ok(u32::try_from(image.function(part)?)?);
        let registers = match what {
            // An empty message, and the place of the panic. An image that reports nothing may have the other alone.
            Planted::Panic => vec![
                (0, ZEROS),
                (1, 0),
                (2, ZEROS),
                (
                    15,
                    at("9panicking5panic").or_else(|_| at("9panicking9panic_fmt"))?,
                ),
            ],
            Planted::Fault => vec![(15, NO_MEMORY)],
            // The first instruction of `main` is a push.
            Planted::Overflow => {
                let full = u32::try_from(image.stack.start)? + 4;
                vec![
                    (13, full),
                    (15, u32::try_from(image.address("main")? & !1)?),
                ]
            }
            // Stopped while it sleeps, the image has interrupts off. The loop replaces a function that is not called.
            Planted::Hang => {
                let place = at("9panicking5panic")?;
                self.debugger.write(place.into(), ON_FOR_EVER)?;
                vec![(15, place)]
            }
            Planted::Clock => {
                let handler = image.address("SysTick")? & !1;
                return self.debugger.write(handler, RETURN);
            }
        };
        self.debugger.set_registers(&registers)
    }

    /// Plants a fault into an image whose laser is on, and counts the instructions until it is off.
    pub fn instructions_until_dark(&mut self, what: Planted, most: u32) -> Result<u32> {
        let start = Instant::now();
        loop {
            thread::sleep(Duration::from_millis(20));
            self.debugger.interrupt()?;
            if self.laser_is_on()? {
                break;
            }
            ensure!(start.elapsed() < PATIENCE, "the laser is never on");
            self.debugger.resume()?;
        }
        self.plant(what)?;
        for instructions in 0..most {
            self.debugger.step()?;
            if !self.laser_is_on()? {
                return Ok(instructions);
            }
        }
        bail!("the laser is on {most} instructions after {what:?}")
    }

    /// Lets the image run for a while, then call a function on a full stack, which resets its board,
    /// and run again.
    pub fn overflow(mut self) -> Result<Overflow> {
        let while_it_runs = Duration::from_millis(300);
        self.debugger.resume()?;
        thread::sleep(while_it_runs);
        self.debugger.interrupt()?;
        let before = self.statics()?;
        self.plant(Planted::Overflow)?;
        let reset = self.image.address("Reset")? & !1;
        self.debugger.set_breakpoint(reset, true)?;
        self.debugger.resume()?;
        self.debugger.wait_for_stop()?;
        let next = self.debugger.registers()?[15];
        ensure!(
            u64::from(next) == reset,
            "it stopped at {next:#x} instead of its reset"
        );
        let changed = changed(&before, &self.statics()?);
        let first = self.log()?;
        self.debugger.set_breakpoint(reset, false)?;
        self.debugger.resume()?;
        thread::sleep(while_it_runs);
        self.debugger.interrupt()?;
        let second = self.log()?;
        Ok(Overflow {
            logs: [first, second],
            changed,
        })
    }

    /// The log since the start of the image: the first up channel of RTT, which nothing else reads.
    fn log(&mut self) -> Result<Vec<u8>> {
        let block = self.image.address("_SEGGER_RTT")?;
        // A 16-byte ID, two numbers of channels, a name; then the buffer, its size and write position.
        let words = self.debugger.memory(block + 28..block + 40)?;
        let (words, _) = words.as_chunks();
        let words: Vec<u64> = words
            .iter()
            .map(|word| u32::from_le_bytes(*word).into())
            .collect();
        let &[buffer, size, full] = &*words else {
            bail!("no channel of RTT");
        };
        ensure!(full < size, "no channel of RTT");
        self.debugger.memory(buffer..buffer + full)
    }

    /// Whether LED0 of mps2-an386 is lit: bit 0 of the first register of its FPGA's I/O.
    fn laser_is_on(&mut self) -> Result<bool> {
        const LED: u64 = 0x4002_8000;
        Ok(match self.board {
            Board::Mps2An386 => self.debugger.memory(LED..LED + 4)?[0] & 1 != 0,
            Board::Stm32F405 => false,
        })
    }

    /// The statics of an image that is stopped.
    pub fn statics(&mut self) -> Result<Vec<u8>> {
        self.debugger.memory(self.image.statics.clone())
    }

    /// Ends QEMU. Returns the bytes of stack used.
    pub fn stop(mut self) -> Result<u64> {
        self.debugger.interrupt()?;
        self.stack()
    }

    /// The bytes of stack used.
    fn stack(&mut self) -> Result<u64> {
        let memory = self.debugger.memory(self.image.stack.clone())?;
        Ok(stack::high_water(&memory))
    }
}

/// The number of words that differ.
fn changed(before: &[u8], after: &[u8]) -> usize {
    let words = before.chunks(4).zip(after.chunks(4));
    words.filter(|(before, after)| before != after).count()
}

/// Two free TCP ports. If another program takes one meanwhile, the emulator ends at once.
pub fn free_ports() -> Result<[u16; 2]> {
    let bind = || TcpListener::bind((Ipv4Addr::LOCALHOST, 0));
    let (first, second) = (bind()?, bind()?);
    Ok([first.local_addr()?.port(), second.local_addr()?.port()])
}

/// Connects to a port that the emulator is about to open.
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
            return Err(error.into()).context("the emulator did not open its ports");
        }
        thread::sleep(Duration::from_millis(20));
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may already have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
