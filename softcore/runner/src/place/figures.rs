//! Placed designs, as the file and the page have them.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::design::Kind;
use super::flow::Placements;
use super::report::{Placed, Used};
use crate::files::Column::{self, Name, Percent, Unchecked};
use crate::files::{Cells, Line, ReadLine};

/// The page but for its tables, each of which stands where its name is in braces.
const PAGE: &str = include_str!("../../fpga.md");

pub const DOCUMENT: &str = "docs/results/bench/fpga.md";

/// The operation of the bench in which a processor does the work of the comparator tree.
pub const PROCESSOR_DECISION: &str = "decision: whole histogram; no event";

/// The figures of a design.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub design: String,
    /// 0 if it has none.
    pub macropixels: u32,
    /// With the seed of the median clock; times rounded to tenths.
    pub placed: Placed,
    /// How many of the flip-flops are at most the registers at its ports.
    pub registers: u64,
    /// The lowest clock of all seeds, in MHz, rounded to tenths.
    pub lowest_megahertz: f64,
    /// Clocks from the start of a decision to its end, where they are always the same.
    pub clocks: Option<u64>,
    /// The smallest ECP5 that takes it, on which it is placed.
    pub part: String,
}

impl Row {
    /// From place and route with all seeds.
    pub fn of(kind: Kind, placements: Placements, clocks: Option<u64>) -> Result<Self> {
        let mut placed = placements.seeds;
        placed.sort_by(|a, b| a.megahertz.total_cmp(&b.megahertz));
        let lowest = placed.first().context("no seeds")?.megahertz;
        let middle = placed.swap_remove(placed.len() / 2);
        let tenths = |value: f64| (value * 10.0).round() / 10.0;
        Ok(Self {
            design: kind.name(),
            macropixels: kind.macropixels(),
            placed: Placed {
                megahertz: tenths(middle.megahertz),
                logic: tenths(middle.logic),
                wires: tenths(middle.wires),
                ..middle
            },
            registers: placements.registers,
            lowest_megahertz: tenths(lowest),
            clocks,
            part: placements.part.to_owned(),
        })
    }

    /// Lookup tables and flip-flops but for the registers at its ports.
    pub fn cells(&self) -> u64 {
        let used = self.placed.used;
        used.lookup_tables + used.flip_flops.saturating_sub(self.registers)
    }
}

impl Line for Row {
    const FILE: &str = "docs/results/bench/fpga.csv";
    const HEADER: &str = "design,macropixels,lookup tables,flip-flops,of them at ports,block RAMs,multipliers,RAMs of tables,MHz,lowest MHz,logic ns,wires ns,from,to,clocks a decision,part";
    // Tools of one version place the same Verilog in the same way.
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Percent(3.0),
        Percent(3.0),
        Unchecked,
        Unchecked,
        Name,
        Name,
        Name,
        Name,
    ];

    fn csv(&self) -> String {
        let placed = &self.placed;
        let cells = [
            placed.used.lookup_tables,
            placed.used.flip_flops,
            self.registers,
            placed.used.rams,
            placed.used.multipliers,
            placed.used.lookup_table_rams,
        ];
        let times = [
            placed.megahertz,
            self.lowest_megahertz,
            placed.logic,
            placed.wires,
        ];
        let clocks = self.clocks.map(|clocks| clocks.to_string());
        format!(
            "{},{},{},{},{},{},{},{}",
            self.design,
            self.macropixels,
            cells.map(|of| of.to_string()).join(","),
            times.map(|of| format!("{of:.1}")).join(","),
            placed.from,
            placed.to,
            clocks.unwrap_or_default(),
            self.part
        )
    }
}

impl ReadLine for Row {
    fn of(cells: &mut Cells<'_>) -> Option<Self> {
        let (design, macropixels) = (cells.read()?, cells.read()?);
        let (lookup_tables, flip_flops) = (cells.read()?, cells.read()?);
        let registers = cells.read()?;
        let used = Used {
            lookup_tables,
            flip_flops,
            rams: cells.read()?,
            multipliers: cells.read()?,
            lookup_table_rams: cells.read()?,
        };
        let (megahertz, lowest_megahertz) = (cells.read()?, cells.read()?);
        Some(Self {
            design,
            macropixels,
            placed: Placed {
                used,
                megahertz,
                logic: cells.read()?,
                wires: cells.read()?,
                from: cells.read()?,
                to: cells.read()?,
            },
            registers,
            lowest_megahertz,
            clocks: cells.optional()?,
            part: cells.read()?,
        })
    }
}

/// The whole file; `VexRiscv` takes so many cycles for [`PROCESSOR_DECISION`].
pub fn page(rows: &[Row], cycles: f64) -> String {
    PAGE.replace("{cells}\n", &cells(rows))
        .replace("{paths}\n", &paths(rows))
        .replace("{decisions}\n", &decisions(rows, cycles))
}

fn size(row: &Row) -> String {
    match row.macropixels {
        0 => String::new(),
        size => size.to_string(),
    }
}

fn cells(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let (used, design, size) = (row.placed.used, &row.design, size(row));
        let _ = writeln!(
            text,
            "| {design} | {size} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {} |",
            used.lookup_tables,
            used.flip_flops,
            row.registers,
            used.rams,
            used.multipliers,
            used.lookup_table_rams,
            row.placed.megahertz,
            row.lowest_megahertz,
            row.part
        );
    }
    text
}

fn paths(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let (design, size, placed) = (&row.design, size(row), &row.placed);
        let _ = writeln!(
            text,
            "| {design} | {size} | {:.1} | {:.1} | `{}` | `{}` |",
            placed.logic, placed.wires, placed.from, placed.to
        );
    }
    text
}

/// Decisions on whole histograms: the trees, and the processor's program.
fn decisions(rows: &[Row], cycles: f64) -> String {
    let tree = |row: &Row| row.clocks.and_then(|clocks| u32::try_from(clocks).ok());
    let processor = |row: &Row| (row.design == Kind::Processor.name()).then_some(cycles);
    let clocks = |row: &Row| tree(row).map(f64::from).or_else(|| processor(row));
    let of = |row| Some((row, clocks(row)?));
    let decided: Vec<_> = rows.iter().filter_map(of).collect();
    let work = |row: &Row, clocks: f64| row.cells() as f64 * clocks;
    let least = decided.iter().map(|&(row, clocks)| work(row, clocks));
    let least = least.fold(f64::INFINITY, f64::min);
    let mut text = String::new();
    for (row, clocks) in decided {
        let _ = writeln!(
            text,
            "| {} | {clocks:.0} | {:.2} | {} | {:.1} |",
            row.design,
            clocks / row.placed.megahertz,
            row.cells(),
            work(row, clocks) / least
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(megahertz: f64, to: &str) -> Placed {
        Placed {
            used: Used {
                lookup_tables: 24_289,
                flip_flops: 2,
                rams: 3,
                multipliers: 4,
                lookup_table_rams: 5,
            },
            megahertz,
            logic: 6.04,
            wires: 7.06,
            from: "a".to_owned(),
            to: to.to_owned(),
        }
    }

    fn placements(seeds: Vec<Placed>) -> Placements {
        Placements {
            part: "45k",
            seeds,
            registers: 1,
        }
    }

    #[test]
    fn a_row_has_the_middle_clock_and_its_path() {
        let seeds = vec![
            placed(90.04, "high"),
            placed(70.0, "low"),
            placed(80.0, "middle"),
        ];
        let row = Row::of(Kind::System(16), placements(seeds), None).unwrap();
        let line = "whole system,16,24289,2,1,3,4,5,80.0,70.0,6.0,7.1,a,middle,,45k";
        assert_eq!(row.csv(), line);
        assert_eq!(Row::parse(line), Some(row.clone()));
        assert_eq!(row.cells(), 24_290);

        let row = Row::of(Kind::Tree(8), placements(vec![placed(80.0, "b")]), Some(28)).unwrap();
        assert!(row.csv().ends_with(",b,28,45k"));
        assert_eq!(Row::parse(&row.csv()), Some(row));
        assert!(Row::of(Kind::Processor, placements(Vec::new()), None).is_err());
        for wrong in ["", "a,1,2", "a,1,2,3,4,5,6,7,7.0,8.0,9.0,1.0,a,b,x,25k"] {
            assert_eq!(Row::parse(wrong), None, "{wrong}");
        }
        assert_eq!(Row::HEADER.split(',').count(), Row::COLUMNS.len());
    }
}
