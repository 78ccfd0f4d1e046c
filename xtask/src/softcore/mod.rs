//! `cargo xtask softcore`: the core on RV32 processors, in QEMU and on the processors'
//! own Verilog in simulation, cycle by cycle.

mod document;
mod image;
mod photons;
mod program;
mod rtl;
mod table;
mod virt;

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use crate::{self_test, target_folder, tools};
use document::Memory;
use image::Images;
use photons::Sustained;
use program::Ran;
use rtl::{CORES, Core, Simulator};
use table::Row;

const FILE: &str = "docs/bench/softcore.csv";
const DOCUMENT: &str = "docs/bench/softcore.md";
const PHOTONS_FILE: &str = "docs/bench/softcore-photons.csv";

/// The instruction sets with an image, the least first.
const ISAS: [&str; 3] = ["rv32i", "rv32im", "rv32imc"];

/// Far more than any program takes on the slowest processor.
const MOST_CYCLES: u64 = 2_000_000_000;
/// What ends a loop without end, which would take the others' limit.
const ENDLESS_CYCLES: u64 = 1_000_000;

/// What must fail, and with what message.
const MUST_FAIL: [(&str, &str); 3] = [
    ("wrong-vector", "vector 5 WRONG"),
    ("illegal-instruction", "trap"),
    ("endless-loop", "cycle limit"),
];

/// The bit-serial processor carries an illegal instruction out as some other, which the
/// program tells.
const DOES_NOT_TRAP: (&str, &str) = ("serv", "illegal-instruction");
const CARRIED_OUT: &str = "the illegal instruction was carried out";

/// What is asked for.
#[derive(Debug, Default, PartialEq, Eq)]
struct Options {
    qemu_only: bool,
    check: bool,
    /// All, if none is named.
    cores: Vec<String>,
}

impl Options {
    fn parse(arguments: &[&str]) -> Result<Self> {
        let mut options = Self::default();
        let mut rest = arguments.iter();
        while let Some(&argument) = rest.next() {
            match argument {
                "--qemu-only" => options.qemu_only = true,
                "--check" => options.check = true,
                "--core" => {
                    let name = *rest.next().context("--core wants a name")?;
                    let names = CORES.map(|core| core.name);
                    ensure!(
                        names.contains(&name),
                        "no core `{name}`: {}",
                        names.join(", ")
                    );
                    options.cores.push(name.to_owned());
                }
                _ => bail!("what is `{argument}`?"),
            }
        }
        ensure!(
            !options.qemu_only || options.cores.is_empty() && !options.check,
            "QEMU counts no cycles: --qemu-only stands alone"
        );
        Ok(options)
    }

    fn wants(&self, core: Core) -> bool {
        self.cores.is_empty() || self.cores.iter().any(|name| name == core.name)
    }
}

/// Sets up, builds and runs.
pub fn run(root: &Path, arguments: &[&str]) -> Result<()> {
    let options = Options::parse(arguments)?;
    tools::set_up_softcore();
    let expected = fs::read_to_string(root.join(self_test::EXPECTED))?;
    for isa in ISAS {
        in_qemu(root, isa, &expected).with_context(|| format!("QEMU, {isa}"))?;
    }
    if options.qemu_only {
        return Ok(());
    }

    rtl::check_fifo(root)?;
    let (mut rows, mut photons) = (Vec::new(), Vec::new());
    for core in CORES.into_iter().filter(|&core| options.wants(core)) {
        let on_rtl = on_rtl(root, core, &expected).with_context(|| core.name)?;
        rows.extend(on_rtl.rows);
        photons.extend(on_rtl.sustained.map(|sustained| (name(core), sustained)));
    }
    let stack = photons.iter().map(|(_, sustained)| sustained.stack).max();
    let memory = memory(root, stack.unwrap_or_default())?;
    let document = document::text(&rows, &photons, &memory);
    println!("\n{document}");

    let photons = photons.iter().map(|(core, sustained)| sustained.csv(core));
    let photons: Vec<String> = photons.collect();
    let files = [
        (FILE, table::HEADER, table::csv(&rows)),
        (PHOTONS_FILE, Sustained::HEADER, photons),
    ];
    let is_whole = options.cores.is_empty();
    if options.check {
        for (file, header, lines) in &files {
            check(root, file, header, lines, &options)?;
        }
        let committed = fs::read_to_string(root.join(DOCUMENT)).context(DOCUMENT)?;
        ensure!(
            !is_whole || committed == document,
            "not what {DOCUMENT} says; `cargo xtask softcore` writes it"
        );
    } else if is_whole {
        for (file, header, lines) in &files {
            let text = format!("{header}\n{}\n", lines.join("\n"));
            fs::write(root.join(file), text).with_context(|| (*file).to_owned())?;
        }
        fs::write(root.join(DOCUMENT), document).context(DOCUMENT)?;
        println!("{FILE}, {PHOTONS_FILE} and {DOCUMENT}: written");
    }
    Ok(())
}

/// Core and instruction set as the files have them.
fn name(core: Core) -> String {
    format!("{},{}", core.name, core.isa)
}

/// The golden vectors and what must fail, in the emulator.
fn in_qemu(root: &Path, isa: &str, expected: &str) -> Result<()> {
    let images = Images::build(root, isa, true)?;
    let stack = golden(&virt::run(&images.elf("self-test"), isa)?, expected)?;
    let bench = virt::run(&images.elf("bench"), isa)?;
    ensure!(bench.code == Some(0), "bench: {}", bench.output);
    for (program, message) in MUST_FAIL {
        let ran = virt::run(&images.elf(program), isa)?;
        // QEMU has no limit of its own.
        let (code, message) = match program {
            "endless-loop" => (ran.code.is_none(), "an endless loop follows"),
            _ => (ran.code.is_some_and(|code| code != 0), message),
        };
        must_fail(program, &ran, code, message)?;
    }
    println!(
        "QEMU, {isa}: {} lines as in {}, {stack} bytes of stack; what must fail fails",
        expected.lines().count(),
        self_test::EXPECTED
    );
    Ok(())
}

/// What a processor came to.
struct OnRtl {
    rows: Vec<Row>,
    /// The highest rate, and half of it.
    sustained: [Sustained; 2],
}

/// Everything on one processor.
fn on_rtl(root: &Path, core: Core, expected: &str) -> Result<OnRtl> {
    let images = Images::build(root, core.isa, false)?;
    let simulator = Simulator::build(root, core)?;
    let run = |program, cycles| simulator.run(&images.flat(program), cycles, None);
    let stack = golden(&run("self-test", MOST_CYCLES)?, expected)?;
    println!(
        "{}, {}: {} lines as in {}, {stack} bytes of stack",
        core.name,
        core.isa,
        expected.lines().count(),
        self_test::EXPECTED
    );
    for (program, message) in MUST_FAIL {
        let limit = match program {
            "wrong-vector" => MOST_CYCLES,
            _ => ENDLESS_CYCLES,
        };
        let ran = run(program, limit)?;
        let message = if (core.name, program) == DOES_NOT_TRAP {
            CARRIED_OUT
        } else {
            message
        };
        must_fail(
            program,
            &ran,
            ran.code.is_some_and(|code| code != 0),
            message,
        )?;
        let last = ran.errors.lines().last().unwrap_or_default();
        println!("{}: {program} fails: {message} ({last})", core.name);
    }
    let bench = run("bench", MOST_CYCLES)?;
    ensure!(
        bench.code == Some(0),
        "bench: {}{}",
        bench.output,
        bench.errors
    );
    let rows = table::rows(&name(core), &bench)?;
    let folder = target_folder(root).join("softcore");
    let sustained = photons::sustained(&simulator, &images.flat("stream-4"), &folder)?;
    Ok(OnRtl { rows, sustained })
}

/// Whether a run printed the golden vectors; the bytes of stack it used.
fn golden(ran: &Ran, expected: &str) -> Result<u64> {
    let (lines, stack) = ran
        .output
        .split_once("golden ok\nstack ")
        .with_context(|| format!("no `golden ok`: {}{}", ran.output, ran.errors))?;
    for line in self_test::differences(expected, lines) {
        println!("{line}");
    }
    ensure!(
        lines == expected,
        "differs from {}, see above",
        self_test::EXPECTED
    );
    ensure!(ran.code == Some(0), "ends with {:?}", ran.code);
    Ok(stack.trim().parse()?)
}

/// Whether a run failed as it should, with its message.
fn must_fail(program: &str, ran: &Ran, failed: bool, message: &str) -> Result<()> {
    let said = format!("{}{}", ran.output, ran.errors);
    ensure!(failed, "{program} does not fail: {:?}\n{said}", ran.code);
    ensure!(
        said.contains(message),
        "{program} does not say `{message}`\n{said}"
    );
    Ok(())
}

/// What the programs for one, four and 64 macropixels take.
fn memory(root: &Path, stack: u64) -> Result<Vec<Memory>> {
    let mut memory = Vec::new();
    for isa in ISAS {
        let images = Images::build(root, isa, false)?;
        for macropixels in [1, 4, 64] {
            let sizes = images.sizes(&format!("stream-{macropixels}"))?;
            memory.push(Memory {
                isa,
                macropixels,
                sizes,
                stack,
            });
        }
    }
    Ok(memory)
}

/// Compares with the file, as far as was measured. The simulation gives the same cycle
/// for cycle, so that nothing may differ.
fn check(root: &Path, file: &str, header: &str, lines: &[String], options: &Options) -> Result<()> {
    let text = fs::read_to_string(root.join(file)).with_context(|| file.to_owned())?;
    let committed = text.strip_prefix(&format!("{header}\n"));
    let committed = committed.with_context(|| format!("{file}: the header is not {header}"))?;
    let measured = |line: &&str| {
        let of = |core: &Core| line.starts_with(&format!("{},", name(*core)));
        CORES
            .iter()
            .find(|core| of(core))
            .is_none_or(|core| options.wants(*core))
    };
    let wanted: Vec<&str> = committed.lines().filter(measured).collect();
    let differences = self_test::differences(&wanted.join("\n"), &lines.join("\n"));
    for line in &differences {
        println!("{line}");
    }
    ensure!(
        differences.is_empty(),
        "not what {file} says, see above; `cargo xtask softcore` writes it"
    );
    println!("{file}: {} lines as measured", lines.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_is_asked_for() {
        let options = Options::parse(&["--core", "serv", "--check", "--core", "ibex"]).unwrap();
        assert!(options.check && !options.qemu_only);
        let wanted = CORES.into_iter().filter(|&core| options.wants(core));
        let names: Vec<&str> = wanted.map(|core| core.name).collect();
        assert_eq!(names, ["ibex", "serv"]);
        assert!(CORES.iter().all(|&core| Options::default().wants(core)));
        for wrong in [
            &["--core"][..],
            &["--core", "z80"],
            &["--qemu-only", "--check"],
            &["x"],
        ] {
            assert!(Options::parse(wrong).is_err(), "{wrong:?}");
        }
    }
}
