//! `cargo xtask`: set-up, images and their checks.

mod bench;
mod c_bindings;
mod emulate;
mod emulator;
mod firmware;
mod flash;
mod hil;
mod image;
mod laser;
mod layout;
mod python;
mod release;
mod self_test;
mod sizes;
mod toolchain;
mod tools;
mod uf2;

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail, ensure};
use lexopt::prelude::{Long, Short, Value};
use lexopt::{Parser, ValueExt};

use firmware::{Board, Build, Choice};

const HELP: &str = "\
cargo xtask <command>

  setup         install the missing parts of rust-toolchain.toml, and the other tools
                (emulators, Verilator, compilers); prints the command for those that
                need an administrator, and fails if a tool is still missing
  image BOARD [SENSOR | self-test] [--emulator] [--count8] [LASER]
                build an image and print its path: the sidecar, which is the firmware beside a
                sensor, or the self-test. BOARD is mps2-an386, pico, pico2 or stm32f405. SENSOR
                is tdc7200, tmf8829, tmf8829-spi, tmf882x or tmf8828-8x8 on stm32f405,
                photon-timer on pico and pico2. For these two it also writes a .uf2, to copy onto
                the board without a probe. --emulator builds for QEMU, with its slower clock and
                without the sensor's own program. --count8 gives pixels counters of 8 bits, and
                the board room for more. LASER is --laser-beyond-limits (the photon timer may
                have pulses over 1 us and a duty cycle over 2 %) or --laser-on-without-host (a
                host may let the laser stay on after it falls silent)
  flash [--chip CHIP] [BOARD] [SENSOR | self-test] [--count8] [LASER]
                write an image onto a board (stm32f405) with a debug probe, and show its
                log. CHIP is the probe-rs name, by default that of the Discovery
  hil --device DEVICE [--chip CHIP] [--out DIR] [BOARD]
                hardware in the loop: test a board (stm32f405) with a debug probe and its serial
                line at DEVICE: the self-test, the clock cycles of the core's operations, and
                the events of the demo against this computer's. Writes BOARD.md to DIR, by
                default out/hil
  emulate [--port PORT] [BOARD] [exit | panic | fault | overflow]
                run the sidecar of a board (mps2-an386) in its emulator, with its serial
                port on a TCP port (5386). The last word makes mps2-an386 end that way
  release       write the images of boards that need no vendor's program to out/release, with
                licences and SHA-256 sums
  sizes         print flash, RAM and stack of each image
  check-image [--all]
                link dtof-core, dtof-link and dtof-sensors for Cortex-M4F, Cortex-M0+ and RV32IM: no
                panic, float or allocation.
                Check the stack frames of pixel_array, an example of dtof-core: at most 2 kB
                in the images for speed and for size, 3 kB without optimisation.
                --all: every target both for speed and for size, not only the Cortex-M4F for speed
  self-test [--bless]
                run the self-test in emulators and compare its lines with
                firmware/self-test.out; --bless writes the file
  bench [--check]
                count the instructions of the core's operations in emulators and write
                docs/results/bench/instructions*.csv; --check compares with the files
                instead
  c-bindings [--bless]
                build bindings/c and its examples, run them here and in QEMU, and compare
                them with Rust; --bless writes the header and the figures of its README
  stack FILE... print the most bytes of stack that Cortex-M images can need
  python FILE   install the packages of a requirements file in the build folder and print
                the path of a Python that has them
  wheel         build the Python package and print the path of its wheel, which installs
                without a compiler on computers with the same system";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The options of all commands.
#[derive(Default)]
struct Options {
    all: bool,
    bless: bool,
    check: bool,
    chip: Option<String>,
    device: Option<String>,
    out: Option<String>,
    emulator: bool,
    port: Option<u16>,
    choices: Vec<Choice>,
}

fn run() -> Result<()> {
    let mut parser = Parser::from_env();
    let command = match parser.next()? {
        Some(Value(command)) => command.string()?,
        Some(Short('h') | Long("help")) => "help".to_owned(),
        Some(other) => return Err(other.unexpected().into()),
        None => bail!("a command is missing: `cargo xtask help` lists them"),
    };
    let mut options = Options::default();
    let mut words = Vec::new();
    while let Some(argument) = parser.next()? {
        match (&*command, argument) {
            ("self-test" | "c-bindings", Long("bless")) => options.bless = true,
            ("bench", Long("check")) => options.check = true,
            ("check-image", Long("all")) => options.all = true,
            ("hil", Long("out")) => options.out = Some(parser.value()?.string()?),
            ("hil", Long("device")) => options.device = Some(parser.value()?.string()?),
            ("flash" | "hil", Long("chip")) => options.chip = Some(parser.value()?.string()?),
            ("image", Long("emulator")) => options.emulator = true,
            ("image" | "flash", Long("laser-beyond-limits")) => {
                options.choices.push(Choice::LaserBeyondLimits);
            }
            ("image" | "flash", Long("laser-on-without-host")) => {
                options.choices.push(Choice::LaserOnWithoutHost);
            }
            ("image" | "flash", Long("count8")) => options.choices.push(Choice::Count8),
            ("emulate", Long("port")) => {
                let number = parser.value()?.string()?;
                let port = number.parse();
                options.port = Some(port.with_context(|| format!("not a port: `{number}`"))?);
            }
            (_, Short('h') | Long("help")) => {
                println!("{HELP}");
                return Ok(());
            }
            (_, Value(word)) => words.push(word.string()?),
            (_, other) => return Err(other.unexpected().into()),
        }
    }
    let root = root()?;
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match (&*command, &words[..]) {
        ("help", []) => println!("{HELP}"),
        ("setup", []) => {
            toolchain::set_up(root)?;
            let tools = tools::set_up();
            let rp2040js = emulator::install_rp2040js().context("rp2040js");
            // Both are tried. The list of missing tools comes first: npm may be one of them.
            tools?;
            rp2040js?;
        }
        ("image", [board, what @ ..]) if what.len() < 2 => {
            firmware::image(
                root,
                board,
                what.first().copied(),
                options.emulator,
                &options.choices,
            )?;
        }
        ("flash", words) => {
            let (board, what) = Board::chosen(words, Board::Stm32F405);
            ensure!(what.len() < 2, "flash: one image at a time");
            let what = Build::named(board, what.first().copied())?;
            flash::flash(root, board, options.chip.as_deref(), what, &options.choices)?;
        }
        ("hil", words) => {
            let (board, []) = Board::chosen(words, Board::Stm32F405) else {
                bail!("`{}` is not a board", words.join(" "));
            };
            hil::run(&hil::Rig::new(
                root,
                board,
                options.chip,
                options.device,
                options.out,
            )?)?;
        }
        ("emulate", words) => {
            let (board, end) = Board::chosen(words, Board::Mps2An386);
            let end = match (board, end) {
                (_, []) => None,
                (Board::Mps2An386, &[end @ ("exit" | "panic" | "fault" | "overflow")]) => Some(end),
                _ => bail!("`{}` is not an end: see `cargo xtask help`", end.join(" ")),
            };
            emulate::emulate(root, board, options.port, end)?;
        }
        ("release", []) => release::release(root)?,
        ("sizes", []) => sizes::print(root)?,
        ("stack", files) if !files.is_empty() => {
            for file in files {
                println!(
                    "{:>8} {file}",
                    xtask::stack_bound::of_image(Path::new(file))?
                );
            }
        }
        ("check-image", []) => image::check(root, options.all)?,
        ("self-test", []) if options.bless => self_test::bless(root)?,
        ("self-test", []) => self_test::check(root)?,
        ("bench", []) if options.check => bench::check(root)?,
        ("bench", []) => bench::run(root)?,
        ("c-bindings", []) => c_bindings::check(root, options.bless)?,
        ("python", &[requirements]) => {
            println!("{}", python::environment(root, requirements)?.display());
        }
        ("wheel", []) => println!("{}", python::wheel(root)?.display()),
        _ => bail!(
            "unknown command `{}`: `cargo xtask help` lists all",
            [&[&*command], &words[..]].concat().join(" ")
        ),
    }
    Ok(())
}

/// The folder of the workspace.
fn root() -> Result<&'static Path> {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .context("xtask is not in a workspace")
}

/// The build folder of cargo.
fn target_folder(root: &Path) -> PathBuf {
    let folder = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    root.join(folder)
}

/// The folder of cargo's registry.
fn cargo_home() -> Result<PathBuf> {
    let home = || Some(env::home_dir()?.join(".cargo"));
    let folder = env::var_os("CARGO_HOME").map(PathBuf::from).or_else(home);
    folder.context("no CARGO_HOME")
}

/// Runs a command that must succeed. Its input is empty, so it cannot ask.
fn succeed(command: &mut Command) -> Result<()> {
    let name = command.get_program().display().to_string();
    let status = command.stdin(Stdio::null()).status();
    let status = status.with_context(|| format!("{name} does not start"))?;
    ensure!(status.success(), "{name}: {status}, see above");
    Ok(())
}

/// The cargo that runs this program.
fn cargo() -> Command {
    Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}
