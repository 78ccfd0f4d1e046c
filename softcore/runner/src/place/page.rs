//! `docs/results/bench/fpga.md`: the figures of the file as tables.

use std::fmt::Write as _;

use super::row::Row;

/// The page but for its tables, each of which stands where its name is in braces.
const PAGE: &str = include_str!("../../fpga.md");

pub const DOCUMENT: &str = "docs/results/bench/fpga.md";

/// The operation of the bench in which a processor does the work of the comparator tree.
pub const PROCESSOR_DECISION: &str = "decision: whole histogram; no event";

/// The whole file; `VexRiscv` takes so many cycles for [`PROCESSOR_DECISION`].
pub fn text(rows: &[Row], cycles: f64) -> String {
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
        let (used, design, size) = (row.used, &row.design, size(row));
        let _ = writeln!(
            text,
            "| {design} | {size} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {} |",
            used.lookup_tables,
            used.flip_flops,
            row.registers,
            used.rams,
            used.multipliers,
            used.lookup_table_rams,
            row.megahertz,
            row.lowest_megahertz,
            row.part
        );
    }
    text
}

fn paths(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let (design, size, from, to) = (&row.design, size(row), &row.from, &row.to);
        let (logic, wires) = (row.logic, row.wires);
        let _ = writeln!(
            text,
            "| {design} | {size} | {logic:.1} | {wires:.1} | `{from}` | `{to}` |"
        );
    }
    text
}

/// Decisions on whole histograms: the trees, and the processor's program.
fn decisions(rows: &[Row], cycles: f64) -> String {
    let tree = |row: &Row| row.clocks.and_then(|clocks| u32::try_from(clocks).ok());
    let processor = |row: &Row| (row.design == "VexRiscv with RAM").then_some(cycles);
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
            clocks / row.megahertz,
            row.cells(),
            work(row, clocks) / least
        );
    }
    text
}
