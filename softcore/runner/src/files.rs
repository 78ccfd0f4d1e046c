//! The files with the figures: their lines, and their comparison with new measurements.

use std::fs;
use std::iter;
use std::str::{FromStr, Split};

use anyhow::{Context, Result, ensure};

use crate::root;
use Column::{Percent, PercentIfMeasured, Unchecked};

/// A line of a file.
pub trait Line {
    const FILE: &str;
    const HEADER: &str;
    /// A simulation gives the same cycle for cycle. But a change anywhere moves code, and in
    /// a cache with one way other lines are then filled; what a processor does when it is as
    /// busy as can be is then not the same at all.
    const COLUMNS: &[Column];

    /// As it is written.
    fn csv(&self) -> String;
}

/// One that is also read.
pub trait ReadLine: Line + Sized {
    /// Reads the cells of a line.
    fn of(cells: &mut Cells<'_>) -> Option<Self>;

    fn parse(line: &str) -> Option<Self> {
        let mut cells = Cells(line.split(','));
        let read = Self::of(&mut cells)?;
        cells.0.next().is_none().then_some(read)
    }
}

/// The cells of a line, one after the other.
pub struct Cells<'a>(Split<'a, char>);

impl Cells<'_> {
    pub fn read<T: FromStr>(&mut self) -> Option<T> {
        self.0.next()?.parse().ok()
    }

    /// One that may be empty.
    pub fn optional<T: FromStr>(&mut self) -> Option<Option<T>> {
        match self.0.next()? {
            "" => Some(None),
            cell => Some(Some(cell.parse().ok()?)),
        }
    }

    /// Core and instruction set, with a comma between.
    pub fn core(&mut self) -> Option<String> {
        Some(format!("{},{}", self.0.next()?, self.0.next()?))
    }
}

/// How a column is compared.
#[derive(Clone, Copy)]
pub enum Column {
    Name,
    /// May differ by up to this many percent.
    Percent(f64),
    /// The same; and never differs where nothing was measured.
    PercentIfMeasured(f64),
    /// Not compared.
    Unchecked,
}

/// Writes files.
pub fn write(files: impl IntoIterator<Item = (&'static str, String)>) -> Result<()> {
    for (file, text) in files {
        fs::write(root().join(file), text).context(file)?;
        println!("{file}: written");
    }
    Ok(())
}

/// A file and its text.
pub fn text<L: Line>(lines: &[L]) -> (&'static str, String) {
    let lines = iter::once(L::HEADER.to_owned()).chain(lines.iter().map(L::csv));
    (L::FILE, lines.map(|line| line + "\n").collect())
}

/// The lines of a file but for its header.
pub fn lines<L: ReadLine>() -> Result<Vec<L>> {
    let (file, header) = (L::FILE, L::HEADER);
    let text = fs::read_to_string(root().join(file)).context(file)?;
    let mut lines = text.lines();
    ensure!(lines.next() == Some(header), "{file}: not headed {header}");
    let parse = |line| L::parse(line).with_context(|| format!("{file}: what is `{line}`?"));
    lines.map(parse).collect()
}

/// Compares what was measured with the file that `command` writes, but for the lines of it that
/// are not kept.
pub fn check<L: Line>(measured: &[L], keeps: impl Fn(&str) -> bool, command: &str) -> Result<()> {
    let file = L::FILE;
    let text = fs::read_to_string(root().join(file)).context(file)?;
    let kept = text
        .lines()
        .filter(|&line| line == L::HEADER || keeps(line));
    let differences = differences(kept, measured);
    for difference in &differences {
        println!("{difference}");
    }
    ensure!(
        differences.is_empty(),
        "not what {file} says, see above; `{command}` writes it"
    );
    Ok(())
}

/// The lines that differ.
fn differences<'a, L: Line>(
    mut expected: impl Iterator<Item = &'a str>,
    measured: &[L],
) -> Vec<String> {
    let (_, measured) = text(measured);
    let mut measured = measured.lines();
    let mut differences = Vec::new();
    loop {
        match (expected.next(), measured.next()) {
            (None, None) => return differences,
            (Some(expected), Some(measured)) if is_near(expected, measured, L::COLUMNS) => {}
            (expected, measured) => differences.push(format!(
                "- {}\n+ {}",
                expected.unwrap_or_default(),
                measured.unwrap_or_default()
            )),
        }
    }
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
        (Percent(percent) | PercentIfMeasured(percent), Ok(a), Ok(b)) => {
            (a - b).abs() <= a.abs() * percent / 100.0
        }
        (PercentIfMeasured(_), Ok(_), Err(_)) => b.is_empty(),
        _ => a == b,
    };
    a.len() == b.len() && a.len() == columns.len() && a.iter().zip(&b).zip(columns).all(is_near)
}

#[cfg(test)]
mod tests {
    use super::Column::Name;
    use super::*;

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
            ("a,100,5", "a,,5", false),
            ("a,1,5", "a,1,x", false),
        ] {
            assert_eq!(is_near(a, b, &columns), near, "{a} {b}");
        }
        assert!(!is_near("a,1", "a,1", &columns));
    }

    #[test]
    fn what_was_not_measured_is_not_compared() {
        let columns = [Name, PercentIfMeasured(2.0)];
        for (a, b, near) in [
            ("a,100", "a,", true),
            ("a,100", "a,102", true),
            ("a,100", "a,103", false),
            ("a,100", "a,x", false),
            ("a,", "a,", true),
            ("a,", "a,1", false),
            ("a,100", "b,", false),
        ] {
            assert_eq!(is_near(a, b, &columns), near, "{a} {b}");
        }
    }

    #[test]
    fn a_line_too_few_or_too_many_differs() {
        struct Figure(&'static str);
        impl Line for Figure {
            const FILE: &str = "";
            const HEADER: &str = "figure";
            const COLUMNS: &[Column] = &[Name];

            fn csv(&self) -> String {
                self.0.to_owned()
            }
        }
        let differ = |file: &str, measured: &[Figure]| differences(file.lines(), measured).len();
        assert_eq!(differ("figure\na\nb\n", &[Figure("a"), Figure("b")]), 0);
        assert_eq!(differ("figure\na\nb\n", &[Figure("a")]), 1);
        assert_eq!(differ("figure\na\n", &[Figure("a"), Figure("b")]), 1);
        assert_eq!(differ("figures\na\n", &[Figure("b")]), 2);
    }
}
