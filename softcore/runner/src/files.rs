//! The files with the figures, and their comparison with new measurements.

use std::fs;
use std::iter;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::document;
use crate::line::Column::{self, Percent, Unchecked};
use crate::line::Line;
use crate::memory::Memory;
use crate::table::Row;
use crate::trials::sustained::SustainedRate;

pub const DOCUMENT: &str = "docs/results/bench/softcore.md";

/// The figures of all files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    pub operations: Vec<Row>,
    pub sustained_rates: Vec<SustainedRate>,
    pub memory: Vec<Memory>,
}

impl Figures {
    /// The figures in the files.
    pub fn read(root: &Path) -> Result<Self> {
        Ok(Self {
            operations: lines(root)?,
            sustained_rates: lines(root)?,
            memory: lines(root)?,
        })
    }

    /// Writes the files and the document.
    pub fn write(&self, root: &Path) -> Result<()> {
        let document = document::text(&self.operations, &self.sustained_rates, &self.memory);
        for (file, text) in self.texts().into_iter().chain([(DOCUMENT, document)]) {
            fs::write(root.join(file), text).context(file)?;
            println!("{file}: written");
        }
        Ok(())
    }

    /// The files with their text.
    fn texts(&self) -> [(&'static str, String); 3] {
        [
            text(&self.operations),
            text(&self.sustained_rates),
            text(&self.memory),
        ]
    }

    /// The figures of the processors that `selects` accepts.
    pub fn only(mut self, selects: impl Fn(&str) -> bool) -> Self {
        self.operations.retain(|row| selects(&row.core));
        self.sustained_rates
            .retain(|sustained| selects(&sustained.core));
        self
    }

    /// Lines of `measured` that differ. A stack that was not measured never differs.
    pub fn differences(&self, measured: &Self) -> Vec<String> {
        let mut expected = self.clone();
        for (expected, measured) in expected.memory.iter_mut().zip(&measured.memory) {
            expected.stack = expected.stack.filter(|_| measured.stack.is_some());
        }
        let texts = expected.texts().into_iter().zip(measured.texts());
        let columns = [Row::COLUMNS, SustainedRate::COLUMNS, Memory::COLUMNS];
        texts
            .zip(columns)
            .flat_map(|(((_, expected), (_, measured)), columns)| {
                differences(&expected, &measured, columns)
            })
            .collect()
    }

    /// Compares `measured` with the files.
    pub fn check(&self, measured: &Self) -> Result<()> {
        let differences = self.differences(measured);
        for difference in &differences {
            println!("{difference}");
        }
        let [operations, sustained_rates, memory] = [Row::FILE, SustainedRate::FILE, Memory::FILE];
        ensure!(
            differences.is_empty(),
            "not what {operations}, {sustained_rates} and {memory} say, see above; `cargo softcore` writes them"
        );
        println!(
            "{operations}, {sustained_rates}, {memory}: {} lines as measured",
            measured.operations.len() + measured.sustained_rates.len() + measured.memory.len()
        );
        Ok(())
    }
}

/// Lines of two texts that differ.
pub fn differences(expected: &str, measured: &str, columns: &[Column]) -> Vec<String> {
    let mut differences = Vec::new();
    let (mut expected, mut measured) = (expected.lines(), measured.lines());
    loop {
        match (expected.next(), measured.next()) {
            (None, None) => return differences,
            (Some(expected), Some(measured)) if is_near(expected, measured, columns) => {}
            (expected, measured) => differences.push(format!(
                "- {}\n+ {}",
                expected.unwrap_or_default(),
                measured.unwrap_or_default()
            )),
        }
    }
}

/// A file and its text.
pub fn text<L: Line>(lines: &[L]) -> (&'static str, String) {
    let lines = iter::once(L::HEADER.to_owned()).chain(lines.iter().map(L::csv));
    (L::FILE, lines.map(|line| line + "\n").collect())
}

/// The lines of a file but for its header.
pub fn lines<L: Line>(root: &Path) -> Result<Vec<L>> {
    let (file, header) = (L::FILE, L::HEADER);
    let text = fs::read_to_string(root.join(file)).context(file)?;
    let mut lines = text.lines();
    ensure!(lines.next() == Some(header), "{file}: not headed {header}");
    let parse = |line| L::parse(line).with_context(|| format!("{file}: what is `{line}`?"));
    lines.map(parse).collect()
}

/// Whether two lines, or headers, are the same, or nearly.
fn is_near(a: &str, b: &str, columns: &[Column]) -> bool {
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split(',').collect(), b.split(',').collect());
    let is_near = |((a, b), column): ((&&str, &&str), &Column)| match (
        column,
        a.parse::<f64>(),
        b.parse::<f64>(),
    ) {
        (Unchecked, Ok(_), Ok(_)) => true,
        (Percent(percent), Ok(a), Ok(b)) => (a - b).abs() <= a.abs() * percent / 100.0,
        _ => a == b,
    };
    a.len() == b.len() && a.len() == columns.len() && a.iter().zip(&b).zip(columns).all(is_near)
}

#[cfg(test)]
mod tests {
    use super::Column::Name;
    use super::*;
    use crate::image::Sizes;
    use crate::root;

    #[test]
    fn figures_may_differ_by_little() {
        let columns = [Name, Percent(2.0), Unchecked];
        for (a, b, near) in [
            ("a,100,5", "a,102,5", true),
            ("a,100,5", "a,98,9", true),
            ("a,100,5", "a,103,5", false),
            ("a,100,5", "b,100,5", false),
            ("a,100,5", "a,100", false),
            ("a,0,5", "a,1,5", false),
            ("a,,5", "a,,5", true),
            ("a,,5", "a,1,5", false),
            ("a,1,5", "a,1,x", false),
        ] {
            assert_eq!(is_near(a, b, &columns), near, "{a} {b}");
        }
        assert!(!is_near("a,1", "a,1", &columns));
    }

    #[test]
    fn what_was_not_measured_is_not_compared_and_all_else_is() {
        let row = |core: &str, cycles| Row {
            core: core.to_owned(),
            operation: "o".to_owned(),
            cycles,
            instructions: 1.0,
            code_lines: 0.0,
            data_lines: 0.0,
        };
        let memory = |stack| Memory {
            isa: "rv32i".to_owned(),
            macropixels: 1,
            sizes: Sizes { code: 9, data: 1 },
            stack,
        };
        let figures = Figures {
            operations: vec![row("a,x", 10.0), row("b,x", 20.0)],
            sustained_rates: Vec::new(),
            memory: vec![memory(Some(4))],
        };
        let of_a = figures.clone().only(|core| core == "a,x");
        let mut measured = Figures {
            operations: vec![row("a,x", 10.1)],
            sustained_rates: Vec::new(),
            memory: vec![memory(None)],
        };
        assert!(of_a.check(&measured).is_ok());
        assert_eq!(figures.differences(&measured).len(), 1);
        measured.operations[0].cycles = 11.01;
        assert!(of_a.check(&measured).is_err());
        measured.operations[0].cycles = 10.0;
        measured.memory[0].stack = Some(5);
        assert_eq!(of_a.differences(&measured).len(), 1);
        measured.memory.clear();
        assert_eq!(of_a.differences(&measured).len(), 1);
    }

    #[test]
    fn the_files_are_read_as_they_are_written() {
        let root = root();
        let figures = Figures::read(&root).unwrap();
        for (file, text) in figures.texts() {
            assert_eq!(fs::read_to_string(root.join(file)).unwrap(), text, "{file}");
        }
    }
}
