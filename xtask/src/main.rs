//! `cargo xtask`: what set-up and checks need beyond cargo itself.

mod bench;
mod boards;
mod debugger;
mod emulate;
mod firmware;
mod image;
mod log;
mod panics;
mod python;
mod qemu;
mod readers;
mod report;
mod self_test;
mod sizes;
mod softcore;
mod source;
mod stack;
mod stack_bound;
mod symbols;
mod thumb;
mod toolchain;
mod tools;

use std::env;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};

const HELP: &str = "\
cargo xtask <command>

  setup         install what rust-toolchain.toml names and is not there yet;
                QEMU, defmt-print, GNU parallel, Chromium and Python as well if
                that needs no question
  check-image   link dtof-core for every target; no panic, float or allocation
  check-source  no floating-point type and no unsafe in core/src

  image BOARD [SENSOR]
                build the sidecar for mps2-an386 or stm32f405; for the latter also
                with tdc7200 or tmf882x connected instead of simulated photons
  sizes         flash, RAM and stack of each image
  emulate [--port PORT] [exit|panic|fault]
                run the sidecar in QEMU, its serial port on a TCP port (5386)
  flash [--chip CHIP] [SENSOR | self-test]
                write the sidecar onto an STM32F405 or STM32F407 and show its log, or
                the self-test and show its lines, which should be those of
                firmware/self-test.out; the chip as probe-rs names it, by default
                that of the Discovery
  check-boards  the images start, decide and end in QEMU, and keep to their
                stack
  check-report [--picture]
                the reports in headless Chromium: drawn, turned, without a network;
                --picture writes docs/figures/report.png
  check-export  the files of dtof export agree with what other projects' readers find in
                them; installs those below target/ first
  self-test     the core works out the same on the target; --bless writes down
                what it works out here
  bench         instructions the core's operations take on the target; writes
                docs/bench/instructions.csv, or with --check compares with it
  softcore [--qemu-only] [--core NAME]... [--check]
                the core on RV32 processors: golden vectors in QEMU and on the
                Verilog of VexRiscv, PicoRV32, SERV and Ibex, cycles and photon rates
                there; writes docs/bench/softcore*.csv and softcore.md if all cores
                run, or with --check compares with them";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["setup"] => {
            toolchain::set_up(root()?)?;
            tools::set_up();
            Ok(())
        }
        ["check-image"] => image::check(root()?),
        ["check-source"] => source::check(root()?),
        ["image", board] => firmware::image(root()?, board, None),
        ["image", board, sensor] => firmware::image(root()?, board, Some(sensor)),
        ["sizes"] => sizes::print(root()?),
        ["emulate", ref rest @ ..] => emulate::emulate(root()?, rest),
        ["flash", ref rest @ ..] => emulate::flash(root()?, rest),
        ["check-boards"] => boards::check(root()?),
        ["check-report"] => report::check(root()?, false),
        ["check-report", "--picture"] => report::check(root()?, true),
        ["check-export"] => readers::check(root()?),
        ["self-test"] => self_test::run(root()?),
        ["self-test", "--bless"] => self_test::bless(root()?),
        ["bench"] => bench::run(root()?),
        ["bench", "--check"] => bench::check(root()?),
        ["softcore", ref rest @ ..] => softcore::run(root()?, rest),
        ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            Ok(())
        }
        _ => bail!("which command?\n\n{HELP}"),
    }
}

/// The folder of the workspace.
fn root() -> Result<&'static Path> {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .context("xtask lies in no workspace")
}

/// Where cargo builds.
fn target_folder(root: &Path) -> PathBuf {
    let folder = env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
    root.join(folder)
}
