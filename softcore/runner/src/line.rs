//! A line of a file of figures, and how its columns are compared.

/// A line of a file.
pub trait Line: Sized {
    const FILE: &str;
    const HEADER: &str;
    /// A simulation gives the same cycle for cycle. But a change anywhere moves code, and in
    /// a cache with one way other lines are then filled; what a processor does when it is as
    /// busy as can be is then not the same at all.
    const COLUMNS: &[Column];

    /// As it is written.
    fn csv(&self) -> String;

    /// Reads the cells of a line.
    fn of(words: &[&str]) -> Option<Self>;

    fn parse(line: &str) -> Option<Self> {
        Self::of(&line.split(',').collect::<Vec<_>>())
    }
}

/// How a column is compared.
#[derive(Clone, Copy)]
pub enum Column {
    Name,
    /// May differ by up to this many percent.
    Percent(f64),
    /// Not compared.
    Unchecked,
}
