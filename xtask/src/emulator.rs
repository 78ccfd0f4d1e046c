//! Runs images in emulators: QEMU, and for the Pico rp2040js in Node.js.

use std::io::Read;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::firmware::{Board, Emulator};
use crate::tools::{NODE, NPM, QEMU};
use crate::{root, succeed};

/// Far longer than an image runs.
const PATIENCE: Duration = Duration::from_secs(300);

/// The folder of the runner for the Pico's images, with its packages.
const RP2040: &str = "firmware/rp2040js";

/// Installs the packages of the runner for the Pico's images, unless they are installed.
pub fn install_rp2040js() -> Result<()> {
    let folder = root()?.join(RP2040);
    // npm writes it last.
    if folder.join("node_modules/.package-lock.json").exists() {
        return Ok(());
    }
    NODE.require()?;
    NPM.require()?;
    let mut npm = Command::new(NPM.program);
    npm.args(["ci", "--silent", "--no-audit", "--no-fund"]);
    succeed(npm.current_dir(folder))
}

/// The reason to skip the emulator of `board`, if there is one.
pub fn cannot_run(board: Board) -> Result<Option<String>> {
    let name = board.name();
    match board.row().emulator {
        Emulator::None => Ok(Some(format!(
            "{name}: linked and not run: it has no emulator"
        ))),
        Emulator::Rp2040js => install_rp2040js().map(|()| None),
        Emulator::Qemu { version, .. } => {
            let found = QEMU.require()?;
            let known = version.filter(|known| !found.contains(known));
            Ok(known.map(|known| {
                format!("SKIPPED: {name} is known to run in QEMU {known}x, this is {found}")
            }))
        }
    }
}

/// The command that starts an image. In QEMU, `word` is its command line.
///
/// # Errors
/// Fails if the board has no emulator.
pub fn command(
    board: Board,
    image: &Path,
    port: Option<u16>,
    word: Option<&str>,
) -> Result<Command> {
    match board.row().emulator {
        Emulator::None => bail!("{} has no emulator", board.name()),
        Emulator::Rp2040js => Ok(rp2040js(image, port)),
        Emulator::Qemu { arguments, .. } => Ok(qemu(arguments, image, port, word)),
    }
}

fn rp2040js(image: &Path, port: Option<u16>) -> Command {
    let mut command = Command::new(NODE.program);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .join(RP2040);
    command.arg(folder.join("run.js")).arg(image);
    match port {
        Some(port) => command.args(["--port", &port.to_string()]),
        None => command.stdin(Stdio::null()),
    };
    command
}

fn qemu(arguments: &[&str], image: &Path, port: Option<u16>, word: Option<&str>) -> Command {
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
    command.args(arguments);
    command.args(["-serial", &uart, "-semihosting-config", &semihosting]);
    command.arg("-kernel").arg(image);
    command.stdin(Stdio::null());
    command
}

/// Runs an image that ends, with additional arguments for the emulator. Returns its exit status and
/// its output.
pub fn run(board: Board, image: &Path, arguments: &[&str]) -> Result<(ExitStatus, String)> {
    // The emulator has to be there; whether its version is known is for the caller.
    cannot_run(board)?;
    let mut command = command(board, image, None, None)?;
    let program = command.get_program().display().to_string();
    let mut emulator = command
        .args(arguments)
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("{program} does not start"))?;
    let mut stdout = emulator
        .stdout
        .take()
        .context("no output of the emulator")?;
    let output = thread::spawn(move || {
        let mut bytes = Vec::new();
        // Keeps the text before an error.
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
            bail!("the image did not end within {PATIENCE:?}");
        }
        thread::sleep(Duration::from_millis(5));
    };
    let bytes = output.join().unwrap_or_default();
    Ok((status, String::from_utf8_lossy(&bytes).into_owned()))
}
