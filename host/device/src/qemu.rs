//! An emulated device: QEMU with an image of the board `mps2-an386`.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, thread};

use anyhow::{Context, Result, bail, ensure};

use super::port::{self, Port};

use dtof_data::options::{Refused, plain};

const QEMU: &str = "qemu-system-arm";

/// The image of `cargo xtask image mps2-an386`, in cargo's target folder.
const IMAGE: &str = "images/sidecar-mps2-an386";

/// Longest start of QEMU.
const PATIENCE: Duration = Duration::from_secs(20);

/// Runs its arguments and kills them when its standard input closes. That happens whichever way
/// this program ends.
#[cfg(unix)]
const UNTIL_END_OF_INPUT: &str = "exec 3<&0
\"$@\" </dev/null 3<&- &
command=$!
{ read -r end <&3; kill -s KILL $command; } 2>/dev/null >/dev/null &
watch=$!
wait $command 2>/dev/null
status=$?
kill $watch 2>/dev/null
exit $status";

/// An emulator and its serial port. The emulator ends when this is dropped.
pub struct Emulator {
    _process: Process,
    port: TcpStream,
}

impl Emulator {
    /// Starts QEMU with `image`, or with the one that xtask has built.
    ///
    /// # Errors
    /// Fails if there is no image or no QEMU, or if QEMU does not start.
    pub fn start(image: Option<&Path>) -> Result<Self> {
        let image = image.map_or_else(built, |image| Ok(image.to_owned()))?;
        ensure!(
            image.is_file(),
            Refused::input(format!(
                "no image at {}: run `cargo xtask image mps2-an386` in a clone of dtof; `image` takes \
                 the path that it prints, which ends in target/{IMAGE}",
                plain(image.display())
            ))
        );
        let mut start = [0; 4];
        let read = File::open(&image).and_then(|mut file| file.read_exact(&mut start));
        ensure!(
            read.is_ok() && start == *b"\x7fELF",
            "{}: is not an ELF file, as an image must be",
            image.display()
        );
        let mut version = Command::new(QEMU);
        let version = version.arg("--version").stdin(Stdio::null());
        let version = version.stdout(Stdio::null()).stderr(Stdio::null());
        ensure!(
            version.status().is_ok_and(|status| status.success()),
            "{QEMU} is missing: install QEMU for Arm; in a clone of dtof `cargo xtask setup` does"
        );
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let mut command = qemu(&image, listener.local_addr()?.port());
        let command = command.stdin(Stdio::piped()).stdout(Stdio::null());
        let mut process = Process(command.spawn().context("QEMU does not start")?);
        let since = Instant::now();
        loop {
            match listener.accept() {
                Ok((stream, _)) => {
                    stream.set_nonblocking(false)?;
                    return Ok(Self {
                        _process: process,
                        port: port::prompt(stream)?,
                    });
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error.into()),
            }
            if let Some(status) = process.0.try_wait()? {
                bail!("QEMU ended with {status}, see above");
            }
            ensure!(
                since.elapsed() < PATIENCE,
                "QEMU does not start within {} seconds",
                PATIENCE.as_secs()
            );
            thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Path of the image that xtask builds, in the folder where cargo has built this program, or else where it would build
/// it in the current folder: an installed program lies elsewhere.
fn built() -> Result<PathBuf> {
    let program = env::current_exe()?;
    let folder = program.ancestors().nth(2);
    let beside = folder.context("a program in no folder")?.join(IMAGE);
    let here = PathBuf::from("target").join(IMAGE);
    Ok(match !beside.is_file() && here.is_file() {
        true => here,
        false => beside,
    })
}

/// QEMU, with the serial port of the image connected to a TCP port of this computer.
fn qemu(image: &Path, port: u16) -> Command {
    #[cfg(unix)]
    let mut command = {
        use std::os::unix::process::CommandExt;
        let mut shell = Command::new("sh");
        shell.args(["-c", UNTIL_END_OF_INPUT, "sh", QEMU]);
        // A process group of its own, so that Ctrl-C reaches this program alone.
        shell.process_group(0);
        shell
    };
    #[cfg(not(unix))]
    let mut command = Command::new(QEMU);
    command.args(["-machine", "mps2-an386", "-display", "none"]);
    command.args(["-monitor", "none", "-serial"]);
    command.arg(format!("tcp:127.0.0.1:{port},nodelay=on"));
    command.args(["-semihosting-config", "enable=on,target=native,arg=image"]);
    command.arg("-kernel").arg(image);
    command
}

impl Port for Emulator {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.port.receive(bytes)
    }
}

/// QEMU, or the shell that runs it. It ends when this is dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        if cfg!(unix) {
            // The shell then kills QEMU and ends.
            drop(self.0.stdin.take());
        } else {
            // It may have ended by itself.
            let _ = self.0.kill();
        }
        let _ = self.0.wait();
    }
}
