//! `cargo softcore place`: cells and clock of the Verilog on an ECP5.

mod design;
mod flow;
mod page;
mod report;
mod row;
mod tree;

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail, ensure};
use lexopt::ValueExt;
use lexopt::prelude::{Long, Short};

use crate::files;
use crate::line::Line;
use crate::rtl;
use crate::table;
use design::{Kind, LANES, SIZES};
use flow::{Flow, Placements};
use row::Row;

const HELP: &str = "\
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
    /// `None` if help is asked for.
    fn parse(mut parser: lexopt::Parser) -> Result<Option<Self>> {
        let mut options = Self::default();
        while let Some(argument) = parser.next()? {
            match argument {
                Long("check") => options.check = true,
                Long("size") => {
                    let size = parser.value()?.parse()?;
                    ensure!(SIZES.contains(&size), "--size {size}: not one of {SIZES:?}");
                    options.size = Some(size);
                }
                Short('h') | Long("help") => return Ok(None),
                other => return Err(other.unexpected().into()),
            }
        }
        Ok(Some(options))
    }
}

/// Runs the command.
pub fn run(parser: lexopt::Parser) -> Result<()> {
    let Some(options) = Options::parse(parser)? else {
        println!("{HELP}");
        return Ok(());
    };
    let root = &crate::root().canonicalize()?;
    let kinds = Kind::all(options.size);
    // What is missing is told before anything takes time.
    for kind in &kinds {
        kind.sources(root)?;
    }
    rtl::check(root, "aer_port")?;
    let mut clocks = Vec::new();
    for lanes in LANES {
        clocks.push((Kind::Tree(lanes), tree::check(root, lanes)?));
    }
    let flow = Flow::install(root)?;
    let mut rows = Vec::new();
    for (kind, placements) in kinds.iter().zip(place(&flow, &kinds)?) {
        let clocks = clocks.iter().find(|(of, _)| of == kind);
        let clocks = clocks.map(|&(_, clocks)| clocks);
        rows.push(Row::of(*kind, placements, clocks)?);
    }
    let page = page::text(&rows, cycles(root)?);
    println!("\n{page}");
    if options.check {
        check(files::lines(root)?, &rows, options.size)?;
    } else if options.size.is_none() {
        for (file, text) in [files::text(&rows), (page::DOCUMENT, page)] {
            fs::write(root.join(file), text).context(file)?;
            println!("{file}: written");
        }
    }
    Ok(())
}

/// Writes the page again from its file: it compares with cycles that `cargo softcore` measures.
pub fn write_page(root: &Path) -> Result<()> {
    let page = page::text(&files::lines(root)?, cycles(root)?);
    fs::write(root.join(page::DOCUMENT), page).context(page::DOCUMENT)?;
    println!("{}: written", page::DOCUMENT);
    Ok(())
}

/// Places all designs, some at a time: a run takes a core and a gigabyte.
fn place(flow: &Flow<'_>, kinds: &[Kind]) -> Result<Vec<Placements>> {
    let workers = thread::available_parallelism()?.get().div_ceil(2);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&kind) = kinds.get(index) else {
                return Ok(done);
            };
            let start = Instant::now();
            let placements = flow.place(kind).with_context(|| kind.folder())?;
            let clocks: Vec<_> = placements
                .seeds
                .iter()
                .map(|of| format!("{:.1}", of.megahertz))
                .collect();
            let (name, seconds) = (kind.folder(), start.elapsed().as_secs());
            let (part, clocks) = (placements.part, clocks.join(", "));
            println!("{name}: {part}, {clocks} MHz; {seconds} s");
            done.push((index, placements));
        }
    };
    let mut all = Vec::new();
    thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            let done: Result<_> = worker.join().map_err(|_| anyhow!("a thread panics"))?;
            all.extend(done?);
        }
        Ok::<_, anyhow::Error>(())
    })?;
    all.sort_by_key(|&(index, _)| index);
    Ok(all.into_iter().map(|(_, placed)| placed).collect())
}

/// `VexRiscv`'s cycles for what the tree does.
fn cycles(root: &Path) -> Result<f64> {
    let rows: Vec<table::Row> = files::lines(root)?;
    let is_it = |row: &&table::Row| {
        row.core == "vexriscv,rv32im" && row.operation == page::PROCESSOR_DECISION
    };
    let row = rows.iter().find(is_it);
    Ok(row
        .with_context(|| format!("{}: no {}", table::Row::FILE, page::PROCESSOR_DECISION))?
        .cycles)
}

/// Compares with the lines of the file.
fn check(mut expected: Vec<Row>, measured: &[Row], size: Option<u32>) -> Result<()> {
    expected.retain(|row| size.is_none_or(|size| row.is_of(size)));
    let ((file, expected), (_, text)) = (files::text(&expected), files::text(measured));
    let differences = files::differences(&expected, &text, Row::COLUMNS);
    for difference in &differences {
        println!("{difference}");
    }
    if !differences.is_empty() {
        bail!("not what {file} says, see above; `cargo softcore place` writes it");
    }
    println!("{file}: {} lines as measured", measured.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::root;

    fn committed() -> Vec<Row> {
        files::lines(&root()).unwrap()
    }

    #[test]
    fn reads_what_is_asked_for() {
        let parse = |arguments: &[&str]| Options::parse(lexopt::Parser::from_args(arguments));
        let options = parse(&["--size", "16", "--check"]).unwrap().unwrap();
        assert_eq!((options.check, options.size), (true, Some(16)));
        assert_eq!(parse(&["--help"]).unwrap(), None);
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
        let page = page::text(&rows, cycles(&root).unwrap());
        assert_eq!(fs::read_to_string(root.join(page::DOCUMENT)).unwrap(), page);
    }

    #[test]
    fn what_the_page_on_soft_cores_says_of_the_clock_holds() {
        let rows = committed();
        let processors = rows
            .iter()
            .filter(|row| row.design == Kind::Processor.name());
        assert_eq!(processors.clone().count(), 1);
        assert!(processors.clone().all(|row| row.megahertz < 100.0));
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
            check(rows.clone(), &measured, None).is_ok()
        };
        assert!(is_like(&|_| ()));
        assert!(is_like(&|row| row.megahertz *= 1.02));
        assert!(!is_like(&|row| row.megahertz *= 1.04));
        assert!(!is_like(&|row| row.used.lookup_tables += 1));
        assert!(!is_like(&|row| row.clocks = None));
        assert!(check(rows.clone(), &rows[1..], None).is_err());
        let of_four: Vec<Row> = rows.iter().filter(|row| row.is_of(4)).cloned().collect();
        assert!(check(rows.clone(), &of_four, Some(4)).is_ok());
    }
}
