//! `docs/results/bench/softcore.md`: the figures of the files as tables.

use std::fmt::Write as _;

use anyhow::Result;

use crate::files::{self, Line};
use crate::memory::Memory;
use crate::table::{COLD, Row};
use crate::trials::sustained::SustainedRate;

const DOCUMENT: &str = "docs/results/bench/softcore.md";

/// The page but for its tables, each of which stands where its name is in braces.
const PAGE: &str = include_str!("../page.md");

/// Clock cycles in 2.4 µs at 100 MHz.
const CYCLES: f64 = 240.0;
/// Operations from a look to what comes of it.
const AGAINST: [&str; 5] = [
    "decision: kept peak; no event",
    "decision: look; no event",
    "decision: whole histogram; no event",
    "decision: kept peak; event and depth",
    "event: look to packed word",
];

/// The figures of all files.
#[derive(Default)]
pub struct Figures {
    pub operations: Vec<Row>,
    pub sustained_rates: Vec<SustainedRate>,
    pub memory: Vec<Memory>,
}

impl Figures {
    /// The whole page.
    pub fn page(&self) -> String {
        PAGE.replace("{cycles}\n", &cycles(&self.operations))
            .replace("{against}\n", &against(&self.operations))
            .replace("{rates}\n", &rates(&self.sustained_rates))
            .replace("{bytes}\n", &bytes(&self.memory))
    }

    /// Writes the files and the page.
    pub fn write(&self) -> Result<()> {
        files::write([
            files::text(&self.operations),
            files::text(&self.sustained_rates),
            files::text(&self.memory),
            (DOCUMENT, self.page()),
        ])
    }

    /// Compares with the files, but for lines of processors that are not selected.
    pub fn check(&self, selects: impl Fn(&str) -> bool) -> Result<()> {
        let command = "cargo softcore";
        let checks = [
            files::check(&self.operations, &selects, command),
            files::check(&self.sustained_rates, &selects, command),
            files::check(&self.memory, |_| true, command),
        ];
        // All differences are told.
        checks.into_iter().collect::<Result<()>>()?;
        println!(
            "{}, {}, {}: {} lines as measured",
            Row::FILE,
            SustainedRate::FILE,
            Memory::FILE,
            self.operations.len() + self.sustained_rates.len() + self.memory.len()
        );
        Ok(())
    }
}

/// The processors, each once.
fn cores(rows: &[Row]) -> Vec<&str> {
    let mut cores: Vec<&str> = rows.iter().map(|row| &*row.core).collect();
    cores.dedup();
    cores
}

/// An operation as a processor does it warm, and cold if that is not the same.
fn find<'a>(rows: &'a [Row], core: &str, operation: &str) -> (Option<&'a Row>, Option<&'a Row>) {
    let of_core = || rows.iter().filter(|row| row.core == core);
    let cold = format!("{operation}{COLD}");
    (
        of_core().find(|row| row.operation == operation),
        of_core().find(|row| row.operation == cold),
    )
}

/// Operations downwards, processors beside each other.
fn cycles(rows: &[Row]) -> String {
    let cores = cores(rows);
    let has_cold = |core: &str| {
        let mut of_core = rows.iter().filter(|row| row.core == core);
        of_core.any(|row| row.operation.ends_with(COLD))
    };
    let mut text = "| operation |".to_owned();
    let mut columns = 1;
    for &core in &cores {
        let name = core.replace(',', ", ");
        if has_cold(core) {
            let _ = write!(text, " {name}, warm | lines filled | cold | lines filled |");
            columns += 4;
        } else {
            let _ = write!(text, " {name} |");
            columns += 1;
        }
    }
    let _ = writeln!(text, "\n|{}", "---|".repeat(columns));
    let Some(first) = cores.first() else {
        return text;
    };
    let warm = rows
        .iter()
        .filter(|row| row.core == *first && !row.operation.ends_with(COLD));
    for Row { operation, .. } in warm {
        let _ = write!(text, "| {operation} |");
        for &core in &cores {
            let (warm, cold) = find(rows, core, operation);
            let lines = |row: &Row| format!("{:.0} + {:.0}", row.code_lines, row.data_lines);
            let cell = |row: &Row| format!("{:.1} ({:.1})", row.cycles, row.instructions);
            let _ = write!(text, " {} |", warm.map(cell).unwrap_or_default());
            if let Some(cold) = cold {
                let warm = warm.map(lines).unwrap_or_default();
                let _ = write!(text, " {warm} | {:.1} | {} |", cold.cycles, lines(cold));
            }
        }
        text.push('\n');
    }
    text
}

/// Operations against [`CYCLES`]; bold ones are within.
fn against(rows: &[Row]) -> String {
    let mut text = "| core |".to_owned();
    for operation in AGAINST {
        let _ = write!(text, " {operation} | cold |");
    }
    let _ = writeln!(text, "\n|---|{}", "---|".repeat(2 * AGAINST.len()));
    for core in cores(rows) {
        let _ = write!(text, "| {} |", core.replace(',', ", "));
        for operation in AGAINST {
            let (warm, cold) = find(rows, core, operation);
            for row in [warm, cold.or(warm)] {
                let cell = row.map(|row| match row.cycles {
                    cycles if cycles <= CYCLES => format!("**{cycles:.1}**"),
                    cycles => format!("{cycles:.1}"),
                });
                let _ = write!(text, " {} |", cell.unwrap_or_default());
            }
        }
        text.push('\n');
    }
    text
}

/// Some lines a processor: the highest rate, and parts of it.
fn rates(photons: &[SustainedRate]) -> String {
    let mut text = String::new();
    for sustained in photons {
        let _ = writeln!(
            text,
            "| {} | {:.5} | {:.1} thousand | {:.1} | {} | {} | {} | {:.0} | {} |",
            sustained.core.replace(',', ", "),
            sustained.rate(),
            // Ten million laser cycles a second.
            sustained.rate() * 1e4,
            sustained.between_looks,
            sustained.photons,
            sustained.events,
            sustained.expired,
            sustained.events_a_second(),
            sustained.fill,
        );
    }
    text
}

fn bytes(memory: &[Memory]) -> String {
    let mut text = String::new();
    for memory in memory {
        let _ = writeln!(text, "| {} |", memory.cells().join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::root;

    fn committed() -> Figures {
        Figures {
            operations: files::lines().unwrap(),
            sustained_rates: files::lines().unwrap(),
            memory: files::lines().unwrap(),
        }
    }

    #[test]
    fn files_and_page_are_read_as_they_are_written() {
        let figures = committed();
        for (file, text) in [
            files::text(&figures.operations),
            files::text(&figures.sustained_rates),
            files::text(&figures.memory),
            (DOCUMENT, figures.page()),
        ] {
            assert_eq!(
                fs::read_to_string(root().join(file)).unwrap(),
                text,
                "{file}"
            );
        }
    }

    #[test]
    fn what_differs_from_the_files_is_told() {
        let mut measured = committed();
        measured.memory[0].stack = None;
        assert!(measured.check(|_| true).is_ok());
        measured.operations[0].cycles *= 1.11;
        assert!(measured.check(|_| true).is_err());
        let core = measured.operations[0].core.clone();
        measured.operations.retain(|row| row.core != core);
        measured.sustained_rates.retain(|row| row.core != core);
        assert!(measured.check(|line| !line.starts_with(&core)).is_ok());
        assert!(measured.check(|_| true).is_err());
        measured.memory.pop();
        assert!(measured.check(|line| !line.starts_with(&core)).is_err());
    }

    #[test]
    fn what_the_page_says_of_240_cycles_holds() {
        let rows = committed().operations;
        let is_within = |core: &str, operation| {
            let (warm, cold) = find(&rows, core, operation);
            let warm = warm.unwrap();
            [warm, cold.unwrap_or(warm)].map(|row| row.cycles <= CYCLES)
        };
        for core in cores(&rows) {
            let [decision, look, others @ ..] = AGAINST.map(|operation| is_within(core, operation));
            assert_eq!(others, [[false; 2]; 3], "{core}");
            match core {
                "vexriscv,rv32im" => assert_eq!((decision, look[1]), ([true, false], false)),
                _ => assert_eq!((decision, look), ([false; 2], [false; 2])),
            }
        }
        // Cold, each line filled costs ten to fourteen cycles. Most lines are code.
        let (warm, cold) = find(&rows, cores(&rows)[0], AGAINST[0]);
        let (warm, cold) = (warm.unwrap(), cold.unwrap());
        let more = cold.code_lines + cold.data_lines - warm.code_lines - warm.data_lines;
        assert!((10.0 * more..14.0 * more).contains(&(cold.cycles - warm.cycles)));
        assert!(cold.code_lines > 2.0 * cold.data_lines);
    }

    #[test]
    fn the_rates_are_a_highest_one_and_parts_of_it() {
        let photons = committed().sustained_rates;
        for of_core in photons.chunks(3) {
            assert!(of_core.iter().all(|one| one.core == of_core[0].core));
            assert_eq!(of_core[1].rate, of_core[0].rate / 2);
            // X = 4 is held at no rate.
            assert!(of_core.iter().all(|one| one.between_looks > 4.0));
        }
        assert_eq!(photons.len(), 3 * 3);
    }

    #[test]
    fn a_core_with_caches_has_columns_of_its_own() {
        let row = |core: &str, operation: &str, cycles, lines| Row {
            core: core.to_owned(),
            operation: operation.to_owned(),
            cycles,
            instructions: 1.0,
            code_lines: lines,
            data_lines: 1.0,
        };
        let rows = [
            row("a,x", "decision: look; no event; cold", 300.0, 2.0),
            row("a,x", "decision: look; no event", 240.0, 0.0),
            row("b,y", "decision: look; no event", 240.01, 0.0),
        ];
        let table = cycles(&rows);
        assert!(table.contains(
            "| operation | a, x, warm | lines filled | cold | lines filled | b, y |\n|---|---|---|---|---|---|\n"
        ));
        assert!(table.contains(
            "| decision: look; no event | 240.0 (1.0) | 0 + 1 | 300.0 | 2 + 1 | 240.0 (1.0) |\n"
        ));
        let table = against(&rows);
        assert!(table.contains("| a, x |  |  | **240.0** | 300.0 |  |  |  |  |  |  |\n"));
        assert!(table.contains("| b, y |  |  | 240.0 | 240.0 |  |  |  |  |  |  |\n"));
    }
}
