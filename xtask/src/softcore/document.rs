//! `docs/bench/softcore.md`: the figures as tables.

use std::fmt::Write as _;

use super::image::Sizes;
use super::photons::Sustained;
use super::table::Row;

const START: &str = "\
# Figures of the soft-cores

Made by `cargo xtask softcore`; do not edit. What they are figures of is in [softcore.md](../softcore.md).
";

/// Bytes of the program for so many macropixels of an instruction set.
pub struct Memory {
    pub isa: &'static str,
    pub macropixels: u32,
    pub sizes: Sizes,
    pub stack: u64,
}

/// The whole file.
pub fn text(rows: &[Row], photons: &[(String, Sustained)], memory: &[Memory]) -> String {
    format!("{START}{}{}{}", cycles(rows), rates(photons), bytes(memory))
}

/// Operations downwards, processors beside each other.
fn cycles(rows: &[Row]) -> String {
    let mut cores: Vec<&str> = rows.iter().map(|row| &*row.core).collect();
    cores.dedup();
    let mut text = "\n## Cycles, and instructions in brackets\n\n| operation |".to_owned();
    for core in &cores {
        let _ = write!(text, " {} |", core.replace(',', ", "));
    }
    let _ = writeln!(text, "\n|---|{}", "---|".repeat(cores.len()));
    let Some(first) = cores.first() else {
        return text;
    };
    for Row { operation, .. } in rows.iter().filter(|row| row.core == *first) {
        let _ = write!(text, "| {operation} |");
        for core in &cores {
            let same = |row: &&Row| row.core == *core && row.operation == *operation;
            let cell = rows.iter().find(same).map(Row::cell).unwrap_or_default();
            let _ = write!(text, " {cell} |");
        }
        text.push('\n');
    }
    text
}

/// Two lines a processor: the highest rate, and half of it.
fn rates(photons: &[(String, Sustained)]) -> String {
    let mut text = "
## Photons sustained

Of four macropixels together, at 100 MHz and a laser of 10 MHz.

| core | photons a laser cycle | photons a second | laser cycles between looks | photons | events | most words in the FIFO |
|---|---|---|---|---|---|---|
"
    .to_owned();
    for (core, sustained) in photons {
        let _ = writeln!(
            text,
            "| {} | {:.4} | {:.0} thousand | {:.1} | {} | {} | {} |",
            core.replace(',', ", "),
            sustained.rate(),
            // Ten million laser cycles a second.
            sustained.rate() * 1e4,
            sustained.between_looks(),
            sustained.photons,
            sustained.events,
            sustained.fill,
        );
    }
    text
}

fn bytes(memory: &[Memory]) -> String {
    let mut text = "
## Bytes

| instruction set | macropixels | code and constants | data | stack |
|---|---|---|---|---|
"
    .to_owned();
    for Memory {
        isa,
        macropixels,
        sizes: Sizes { code, data },
        stack,
    } in memory
    {
        let _ = writeln!(
            text,
            "| {isa} | {macropixels} | {code} | {data} | {stack} |"
        );
    }
    text
}
