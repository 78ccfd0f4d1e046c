//! `cargo xtask bench`: instruction counts of the core's operations on the targets, counted in
//! emulators.

mod laser_rates;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::emulator;
use crate::firmware::Board;

/// A processor, and the emulated board that has it.
struct Processor {
    name: &'static str,
    board: Board,
    file: &'static str,
    /// Emulator arguments that make it count: see `firmware/src/bin/bench/counter.rs`.
    count: &'static [&'static str],
}

const PROCESSORS: [Processor; 2] = [
    Processor {
        name: "Cortex-M4F",
        board: Board::Mps2An386,
        file: "docs/results/bench/instructions.csv",
        // An instruction takes 256 ns of the emulator's clock.
        count: &["-icount", "shift=8"],
    },
    Processor {
        name: "Cortex-M0+",
        board: Board::Pico,
        file: "docs/results/bench/instructions-m0plus.csv",
        count: &["--count"],
    },
];

const HEADER: &str = "operation,variant,opt,instructions";

/// [`check`] fails if a figure changes by more than one part in so many.
const TOLERANCE: u64 = 50;

/// The printed width of names.
const WIDTH: usize = 62;

/// One figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Operation, variant and optimisation level, with commas between.
    name: String,
    /// Instructions in hundredths.
    hundredths: u64,
}

/// Counts and writes the files.
pub fn run(root: &Path) -> Result<()> {
    for processor in &PROCESSORS {
        let file = processor.file;
        let rows = processor.count(root)?;
        processor.print(&rows)?;
        fs::write(root.join(file), text(&rows)).context(file)?;
        println!("{file}: written");
    }
    Ok(())
}

/// Counts and compares with the files.
pub fn check(root: &Path) -> Result<()> {
    for processor in &PROCESSORS {
        let file = processor.file;
        let committed = parse(&fs::read_to_string(root.join(file)).context(file)?).context(file)?;
        let rows = processor.count(root)?;
        processor.print(&rows)?;
        let differences = differences(&committed, &rows);
        for line in &differences {
            println!("{line}");
        }
        ensure!(
            differences.is_empty(),
            "differs from {file}, see above; `cargo xtask bench` writes it"
        );
        println!("{file}: all {} figures are up to date", committed.len());
    }
    Ok(())
}

impl Processor {
    /// Every figure, at both optimisation levels.
    fn count(&self, root: &Path) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        for (level, small) in [("3", false), ("s", true)] {
            let image = self.board.bench(root, small)?;
            let (status, output) = emulator::run(self.board, &image, self.count)?;
            ensure!(status.success(), "emulator: {status}: {}", output.trim());
            rows.extend(self::rows(&output, level)?);
        }
        Ok(rows)
    }

    /// Prints a line for each operation, with both levels, and for the first processor the table of
    /// `README.md`.
    fn print(&self, rows: &[Row]) -> Result<()> {
        let title = format!("instructions, {}", self.name);
        println!("{title:<WIDTH$} {:>10} {:>10}", "O3", "Os");
        for row in rows {
            let Some(name) = row.name.strip_suffix(",3") else {
                continue;
            };
            let small = rows.iter().find(|row| row.name == format!("{name},s"));
            let small = small.map_or_else(String::new, |row| decimal(row.hundredths));
            let name = name.replacen(',', ": ", 1);
            println!("{name:<WIDTH$} {:>10} {small:>10}", decimal(row.hundredths));
        }
        if self.board == PROCESSORS[0].board {
            println!("\n{}", laser_rates::table(rows)?);
        }
        Ok(())
    }
}

/// Parses the figures that an image printed.
pub fn rows(output: &str, level: &str) -> Result<Vec<Row>> {
    let row = |line| measured(line, level).with_context(|| format!("not understood: `{line}`"));
    output.lines().map(row).collect()
}

/// A table of clock cycles on a real board, beside the instructions of `board` in the emulator, or
/// of an emulated board with the same instruction set.
pub fn beside(root: &Path, board: Board, rows: &[Row]) -> Result<String> {
    let like = board.row().counts_like;
    let of_like = PROCESSORS.iter().find(|processor| processor.board == like);
    let file = of_like.context("no figures of this board")?.file;
    let counted = parse(&fs::read_to_string(root.join(file)).context(file)?).context(file)?;
    let mut text = String::from("\n| operation | clock cycles | instructions |\n|---|---|---|\n");
    for Row { name, hundredths } in rows {
        let instructions = counted.iter().find(|row| row.name == *name);
        let instructions = instructions.map_or_else(|| "–".into(), |row| decimal(row.hundredths));
        let name = name.trim_end_matches(",3").replacen(',', ": ", 1);
        let _ = writeln!(
            text,
            "| {name} | {} | {instructions} |",
            decimal(*hundredths)
        );
    }
    Ok(text)
}

/// A line of the image: operation, variant, instructions of all runs, runs.
fn measured(line: &str, level: &str) -> Option<Row> {
    let (rest, runs) = line.rsplit_once(',')?;
    let (name, total) = rest.rsplit_once(',')?;
    let (total, runs) = (total.parse::<u64>().ok()?, runs.parse::<u64>().ok()?);
    Some(Row {
        name: format!("{name},{level}"),
        hundredths: (total * 100 + runs / 2).checked_div(runs)?,
    })
}

/// Figures that are missing on one side, or differ by more than the tolerance.
fn differences(committed: &[Row], rows: &[Row]) -> Vec<String> {
    let mut lines = Vec::new();
    for Row { name, hundredths } in committed {
        match rows.iter().find(|row| row.name == *name) {
            None => lines.push(format!("{name}: missing")),
            Some(row) if row.hundredths.abs_diff(*hundredths) > hundredths / TOLERANCE => {
                let better = ["", ", better"][usize::from(row.hundredths < *hundredths)];
                let [is, was] = [row.hundredths, *hundredths].map(decimal);
                lines.push(format!("{name}: {is}, was {was}{better}"));
            }
            Some(_) => {}
        }
    }
    for Row { name, hundredths } in rows {
        if committed.iter().all(|row| row.name != *name) {
            lines.push(format!("{name}: {}, new", decimal(*hundredths)));
        }
    }
    lines
}

fn text(rows: &[Row]) -> String {
    let mut text = format!("{HEADER}\n");
    for Row { name, hundredths } in rows {
        let _ = writeln!(text, "{name},{}", decimal(*hundredths));
    }
    text
}

fn parse(text: &str) -> Result<Vec<Row>> {
    let mut lines = text.lines();
    ensure!(lines.next() == Some(HEADER), "the header is not {HEADER}");
    let row = |line: &str| {
        let (name, number) = line.rsplit_once(',')?;
        let (whole, part) = number.split_once('.')?;
        let hundredths = part.parse::<u64>().ok().filter(|_| part.len() == 2)?;
        Some(Row {
            name: name.into(),
            hundredths: whole.parse::<u64>().ok()? * 100 + hundredths,
        })
    };
    lines
        .map(|line| row(line).with_context(|| format!("not a figure: `{line}`")))
        .collect()
}

fn decimal(hundredths: u64) -> String {
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, hundredths: u64) -> Row {
        Row {
            name: name.into(),
            hundredths,
        }
    }

    #[test]
    fn a_line_is_the_mean_of_its_runs() {
        assert_eq!(measured("a,b,200,3", "s"), Some(row("a,b,s", 6667)));
        assert_eq!(measured("a,b,200,0", "s"), None);
        assert_eq!(measured("a panic", "s"), None);
    }

    #[test]
    fn reads_what_it_writes() {
        let rows = [row("a,b,3", 1005), row("a,b,s", 7)];
        assert_eq!(text(&rows), format!("{HEADER}\na,b,3,10.05\na,b,s,0.07\n"));
        assert_eq!(parse(&text(&rows)).unwrap(), rows);
        assert!(parse("a,b,3,1.00\n").is_err());
        assert!(parse(&format!("{HEADER}\na,b,3,1.0\n")).is_err());
    }

    #[test]
    fn two_percent_pass_and_more_or_less_or_a_line_on_one_side_alone_fails() {
        let committed = ["a", "b", "c", "d", "e"].map(|name| row(name, 10_000));
        let rows = [
            row("b", 10_201),
            row("a", 10_200),
            row("f", 1),
            row("d", 9800),
            row("e", 9799),
        ];
        assert_eq!(
            differences(&committed, &rows),
            [
                "b: 102.01, was 100.00",
                "c: missing",
                "e: 97.99, was 100.00, better",
                "f: 0.01, new"
            ]
        );
    }
}
