//! `cargo softcore place`: cells and clock of the Verilog on an ECP5.

mod design;
mod figures;
mod flow;
mod report;
mod tree;

use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use lexopt::ValueExt;
use lexopt::prelude::Long;
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use crate::files::{self, Line};
use crate::rtl;
use crate::table;
use design::{Kind, LANES, SIZES};
use figures::Row;
use flow::{Flow, Placements};

pub const HELP: &str = "\
cargo softcore place [--size N] [--check]

Places the pixel processor, VexRiscv and both together on a Lattice ECP5, and the paper's
comparator tree, which it first compares with its model. It writes docs/results/bench/fpga.csv
and fpga.md. Yosys and nextpnr are installed below the build folder.

  --size N   with 4, 16 or 64 macropixels only; writes nothing
  --check    compare with the files instead of writing them";

/// The options of the command line.
#[derive(Debug, Default, PartialEq, Eq)]
struct Options {
    check: bool,
    size: Option<u32>,
}

impl Options {
    fn parse(mut parser: lexopt::Parser) -> Result<Self> {
        let mut options = Self::default();
        while let Some(argument) = parser.next()? {
            match argument {
                Long("check") => options.check = true,
                Long("size") => {
                    let size = parser.value()?.parse()?;
                    ensure!(SIZES.contains(&size), "--size {size}: not one of {SIZES:?}");
                    options.size = Some(size);
                }
                other => return Err(other.unexpected().into()),
            }
        }
        Ok(options)
    }
}

/// Runs the command.
pub fn run(parser: lexopt::Parser) -> Result<()> {
    let options = Options::parse(parser)?;
    let kinds = Kind::all(options.size);
    // What is missing is told before anything takes time.
    for kind in &kinds {
        kind.sources()?;
    }
    rtl::check("aer_port")?;
    let mut clocks = Vec::new();
    for lanes in LANES {
        clocks.push((Kind::Tree(lanes), tree::check(lanes)?));
    }
    let flow = Flow::install()?;
    let mut rows = Vec::new();
    for (kind, placements) in kinds.iter().zip(place(&flow, &kinds)?) {
        let clocks = clocks.iter().find(|(of, _)| of == kind);
        let clocks = clocks.map(|&(_, clocks)| clocks);
        rows.push(Row::of(*kind, placements, clocks)?);
    }
    let page = figures::page(&rows, cycles()?);
    println!("\n{page}");
    if options.check {
        check(&rows, options.size)?;
    } else if options.size.is_none() {
        files::write([files::text(&rows), (figures::DOCUMENT, page)])?;
    }
    Ok(())
}

/// Writes the page again from its file: it compares with cycles that `cargo softcore` measures.
pub fn write_page() -> Result<()> {
    let page = figures::page(&files::lines()?, cycles()?);
    files::write([(figures::DOCUMENT, page)])
}

/// Places all designs, some at a time: a run takes a core and a gigabyte.
fn place(flow: &Flow, kinds: &[Kind]) -> Result<Vec<Placements>> {
    let place = |&kind: &Kind| {
        let start = Instant::now();
        let name = kind.folder();
        let placements = flow.place(kind).with_context(|| name.clone())?;
        let clocks = placements.seeds.iter();
        let clocks: Vec<_> = clocks.map(|of| format!("{:.1}", of.megahertz)).collect();
        let (part, clocks) = (placements.part, clocks.join(", "));
        let seconds = start.elapsed().as_secs();
        println!("{name}: {part}, {clocks} MHz; {seconds} s");
        Ok(placements)
    };
    let workers = thread::available_parallelism()?.get().div_ceil(2);
    let workers = ThreadPoolBuilder::new().num_threads(workers).build()?;
    workers.install(|| kinds.par_iter().with_max_len(1).map(place).collect())
}

/// `VexRiscv`'s cycles for what the tree does.
fn cycles() -> Result<f64> {
    let rows: Vec<table::Row> = files::lines()?;
    let is_it = |row: &&table::Row| {
        row.core == "vexriscv,rv32im" && row.operation == figures::PROCESSOR_DECISION
    };
    let row = rows.iter().find(is_it);
    let row = row.with_context(|| format!("no {}", figures::PROCESSOR_DECISION))?;
    Ok(row.cycles)
}

/// Compares with the lines of the file: all, or those of one size and those without a size.
fn check(measured: &[Row], size: Option<u32>) -> Result<()> {
    let is_of = |line: &str, size: u32| {
        let macropixels = line.split(',').nth(1);
        macropixels.is_some_and(|of| of == "0" || of == size.to_string())
    };
    let keeps = |line: &str| size.is_none_or(|size| is_of(line, size));
    files::check(measured, keeps, "cargo softcore place")?;
    println!("{}: {} lines as measured", Row::FILE, measured.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::root;

    fn committed() -> Vec<Row> {
        files::lines().unwrap()
    }

    #[test]
    fn reads_what_is_asked_for() {
        let parse = |arguments: &[&str]| Options::parse(lexopt::Parser::from_args(arguments));
        let options = parse(&["--size", "16", "--check"]).unwrap();
        assert_eq!((options.check, options.size), (true, Some(16)));
        for wrong in [&["--size", "5"][..], &["--size"], &["--core"], &["x"]] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn the_files_are_read_as_they_are_written() {
        let root = root();
        let rows = committed();
        let (file, text) = files::text(&rows);
        assert_eq!(fs::read_to_string(root.join(file)).unwrap(), text);
        let page = figures::page(&rows, cycles().unwrap());
        assert_eq!(
            fs::read_to_string(root.join(figures::DOCUMENT)).unwrap(),
            page
        );
    }

    #[test]
    fn what_the_page_on_soft_cores_says_of_the_clock_holds() {
        let rows = committed();
        let processors = rows
            .iter()
            .filter(|row| row.design == Kind::Processor.name());
        assert_eq!(processors.clone().count(), 1);
        assert!(processors.clone().all(|row| row.placed.megahertz < 100.0));
        let trees = rows.iter().filter(|row| row.clocks.is_some());
        assert_eq!(trees.clone().count(), LANES.len());
        assert!(trees.clone().all(|row| row.lowest_megahertz > 100.0));
    }

    #[test]
    fn cells_are_compared_exactly_and_clocks_nearly() {
        let rows = committed();
        let row = rows.iter().find(|row| row.clocks.is_some()).unwrap();
        let is_like = |change: &dyn Fn(&mut Row)| {
            let mut measured = rows.clone();
            let index = rows.iter().position(|of| of == row).unwrap();
            change(&mut measured[index]);
            check(&measured, None).is_ok()
        };
        assert!(is_like(&|_| ()));
        assert!(is_like(&|row| row.placed.megahertz *= 1.02));
        assert!(!is_like(&|row| row.placed.megahertz *= 1.04));
        assert!(!is_like(&|row| row.placed.used.lookup_tables += 1));
        assert!(!is_like(&|row| row.clocks = None));
        assert!(check(&rows[1..], None).is_err());
        let mut of_four = rows.clone();
        of_four.retain(|row| [0, 4].contains(&row.macropixels));
        assert!(check(&of_four, Some(4)).is_ok() && check(&of_four, None).is_err());
    }
}
