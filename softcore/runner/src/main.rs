//! `cargo softcore`: the core on RV32 processors, in QEMU and on the processors'
//! own Verilog in simulation, cycle by cycle.

mod document;
mod files;
mod formal;
mod image;
mod memory;
mod pixels;
mod place;
mod program;
mod rtl;
mod table;
mod trials;
mod virt;

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};
use lexopt::ValueExt;
use lexopt::prelude::Long;

use document::Figures;
use image::Images;
use memory::{Memory, Stacks};
use program::ProgramRun;
use rtl::{CORES, Core, Simulator};

const HELP: &str = "\
cargo softcore [--qemu-only] [--core NAME]... [--check]
cargo softcore place [--size N] [--check]
cargo softcore pixels [--photons N] [--check]
cargo softcore formal
cargo softcore mutations [--sample N]

Runs the core on RV32 processors: golden vectors in QEMU, and golden vectors, cycles and
photon rates on the Verilog of VexRiscv and PicoRV32. If all of them run, it writes
docs/results/bench/softcore*.csv and softcore.md.

  --qemu-only   run QEMU only: no cycles, no Verilator
  --core NAME   run this processor only; may be repeated:
                vexriscv, picorv32 or picorv32-rv32i
  --check       compare with the files instead of writing them

`place` is cells and clock on an FPGA: cargo softcore place --help
`pixels` is the pixel processor in simulation: cargo softcore pixels --help
`formal` proves properties of its Verilog, `mutations` plants faults there, which have to show.";

/// The lines that every program has to print.
const EXPECTED: &str = "firmware/self-test.out";

/// The instruction sets with an image, the least first.
const ISAS: [&str; 3] = ["rv32i", "rv32im", "rv32imc"];

/// Far more than any program takes on the slowest processor.
const MOST_CYCLES: u64 = 2_000_000_000;
/// The limit for the endless loop, which would use up a larger one.
const ENDLESS_CYCLES: u64 = 1_000_000;

/// Programs that must fail, and what they print first.
const MUST_FAIL: [(&str, &str); 3] = [
    ("wrong-vector", "vector 5 WRONG"),
    ("illegal-instruction", "an illegal instruction follows"),
    ("endless-loop", "an endless loop follows"),
];

/// The last line of a program that must fail on a processor.
fn last_words(core: &str, program: &str) -> &'static str {
    match (core, program) {
        ("picorv32" | "picorv32-rv32i", "illegal-instruction") => "the processor stops cycle",
        (_, "illegal-instruction") => ILLEGAL,
        (_, "endless-loop") => "cycle limit",
        _ => "golden WRONG",
    }
}

/// The line of the trap handler.
const ILLEGAL: &str = "trap: illegal instruction";

type Run = fn(lexopt::Parser) -> Result<()>;

/// The words that may come first, the help of each, and what it does.
const COMMANDS: [(&str, &str, Run); 4] = [
    ("place", place::HELP, place::run),
    ("pixels", pixels::HELP, pixels::run),
    ("formal", formal::HELP, formal::run),
    ("mutations", pixels::mutations::HELP, pixels::mutations::run),
];

fn main() -> ExitCode {
    let mut arguments: Vec<OsString> = env::args_os().skip(1).collect();
    let first = arguments.first().cloned().unwrap_or_default();
    let named = COMMANDS.into_iter().find(|&(name, ..)| first == name);
    let (help, run) = match named {
        Some((_, help, run)) => {
            arguments.remove(0);
            (help, run)
        }
        None => (HELP, measure as Run),
    };
    if arguments.iter().any(|of| of == "-h" || of == "--help") {
        println!("{help}");
        return ExitCode::SUCCESS;
    }
    match run(lexopt::Parser::from_args(arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The options of the command line.
#[derive(Debug, Default, PartialEq, Eq)]
struct Options {
    qemu_only: bool,
    check: bool,
    /// All, if none is named.
    cores: Vec<Core>,
}

impl Options {
    fn parse(mut parser: lexopt::Parser) -> Result<Self> {
        let mut options = Self::default();
        while let Some(argument) = parser.next()? {
            match argument {
                Long("qemu-only") => options.qemu_only = true,
                Long("check") => options.check = true,
                Long("core") => {
                    let name = parser.value()?.string()?;
                    let core = CORES.into_iter().find(|core| core.name == name);
                    let names = CORES.map(|core| core.name).join(", ");
                    let core = core.with_context(|| format!("no core `{name}`: {names}"))?;
                    options.cores.push(core);
                }
                other => return Err(other.unexpected().into()),
            }
        }
        ensure!(
            !options.qemu_only || options.cores.is_empty() && !options.check,
            "QEMU counts no cycles: --qemu-only stands alone"
        );
        Ok(options)
    }

    fn selects(&self, core: Core) -> bool {
        self.cores.is_empty() || self.cores.contains(&core)
    }
}

/// The command without a word.
fn measure(parser: lexopt::Parser) -> Result<()> {
    let options = Options::parse(parser)?;
    let expected = fs::read_to_string(root().join(EXPECTED)).context(EXPECTED)?;
    for isa in ISAS {
        in_qemu(isa, &expected).with_context(|| format!("QEMU, {isa}"))?;
    }
    if options.qemu_only {
        return Ok(());
    }

    rtl::check_fifo()?;
    let (mut measured, mut stacks) = (Figures::default(), Stacks::new());
    for core in CORES.into_iter().filter(|&core| options.selects(core)) {
        on_rtl(core, &expected, &mut measured, &mut stacks).with_context(|| core.name)?;
    }
    measured.memory = Memory::of_all(&stacks)?;
    println!("\n{}", measured.page());
    if options.check {
        let is_of = |core, line: &str| line.starts_with(&format!("{},", name(core)));
        let mut left_out = CORES.to_vec();
        left_out.retain(|&core| !options.selects(core));
        measured.check(|line| !left_out.iter().any(|&core| is_of(core, line)))?;
    } else if options.cores.is_empty() {
        measured.write()?;
        place::write_page()?;
    }
    Ok(())
}

/// The folder of the workspace.
fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here)
}

/// Where cargo builds.
fn target_folder() -> PathBuf {
    root().join(env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// A folder of this command there, made if need be.
fn folder(name: &str) -> Result<PathBuf> {
    let folder = target_folder().join("softcore").join(name);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

/// Cargo, in the workspace.
fn cargo() -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root());
    cargo
}

/// A file's text.
fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| path.display().to_string())
}

/// Core and instruction set as the files have them.
fn name(core: Core) -> String {
    format!("{},{}", core.name, core.isa)
}

/// The golden vectors and what must fail, in the emulator.
fn in_qemu(isa: &str, expected: &str) -> Result<()> {
    let images = Images::build(isa, true)?;
    let run = |program, last_line| virt::run(&images.elf(program), isa, last_line);
    let stack = golden(&run("self-test", None)?, expected)?;
    run("bench", None)?.succeeded("bench")?;
    for (program, message) in MUST_FAIL {
        // QEMU has no limit of its own.
        let is_endless = program == "endless-loop";
        let ran = run(program, is_endless.then_some(message))?;
        let (failed, last) = if is_endless {
            (ran.timed_out, message)
        } else {
            (ran.has_failed(), last_words("QEMU", program))
        };
        must_fail(program, &ran, failed, [message, last])?;
    }
    let lines = expected.lines().count();
    println!(
        "QEMU, {isa}: {lines} lines as in {EXPECTED}, {stack} bytes of stack; what must fail fails"
    );
    Ok(())
}

/// Everything on one processor.
fn on_rtl(core: Core, expected: &str, measured: &mut Figures, stacks: &mut Stacks) -> Result<()> {
    let images = Images::build(core.isa, false)?;
    let simulator = Simulator::build(core)?;
    let run = |program, cycles| simulator.run(&images.flat(program), cycles);
    let stack = golden(&run("self-test", MOST_CYCLES)?, expected)?;
    let lines = expected.lines().count();
    let Core { name: of, isa, .. } = core;
    println!("{of}, {isa}: {lines} lines as in {EXPECTED}, {stack} bytes of stack");
    for (program, message) in MUST_FAIL {
        let limit = match program {
            "wrong-vector" => MOST_CYCLES,
            _ => ENDLESS_CYCLES,
        };
        let ran = run(program, limit)?;
        let last = last_words(of, program);
        must_fail(program, &ran, ran.has_failed(), [message, last])?;
        let end = ran.errors.lines().last().unwrap_or_default();
        println!("{of}: {program} fails: {last} ({end})");
    }
    let bench = run("bench", MOST_CYCLES)?.succeeded("bench")?;
    let rows = table::rows(&name(core), core.caches, &bench)?;
    let found = trials::run(&simulator, &images, &name(core), &rows)?;
    let (events, deferred) = found.slow;
    println!(
        "{of}: the host decides the same from the same photons and looks, each event word over REQ and ACK; \
         with a slow link {events} events, {deferred} decisions put off"
    );
    measured.operations.extend(rows);
    measured.sustained_rates.extend(found.sustained);
    let found = found.stack.into_iter();
    stacks.extend(found.map(|(pixels, stack)| (isa, pixels, stack)));
    Ok(())
}

/// Whether a run printed the golden vectors; the bytes of stack it used.
fn golden(ran: &ProgramRun, expected: &str) -> Result<u64> {
    let (lines, stack) = ran
        .output
        .split_once("golden ok\nstack ")
        .with_context(|| format!("no `golden ok`: {}", ran.output()))?;
    for (number, (expected, line)) in (1..).zip(expected.lines().zip(lines.lines())) {
        ensure!(
            line == expected,
            "line {number} of {EXPECTED} is `{expected}`, not `{line}`"
        );
    }
    ensure!(lines == expected, "other lines than {EXPECTED} has");
    ensure!(ran.code == Some(0), "ends with {:?}", ran.code);
    Ok(stack.trim().parse()?)
}

/// Whether a run failed as it should, and said so.
fn must_fail(program: &str, ran: &ProgramRun, failed: bool, messages: [&str; 2]) -> Result<()> {
    let output = ran.output();
    ensure!(failed, "{program} does not fail\n{output}");
    for message in messages {
        ensure!(
            output.contains(message),
            "{program} does not say `{message}`\n{output}"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_is_asked_for() {
        let parse = |arguments: &[&str]| Options::parse(lexopt::Parser::from_args(arguments));
        let options = parse(&["--core", "picorv32", "--check", "--core=vexriscv"]);
        let options = options.unwrap();
        assert!(options.check && !options.qemu_only);
        let selected = CORES.into_iter().filter(|&core| options.selects(core));
        let names: Vec<&str> = selected.map(|core| core.name).collect();
        assert_eq!(names, ["vexriscv", "picorv32"]);
        assert!(CORES.iter().all(|&core| Options::default().selects(core)));
        for wrong in [
            &["--core"][..],
            &["--core", "z80"],
            &["--qemu-only", "--check"],
            &["x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
