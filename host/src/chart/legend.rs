//! What the series of a chart are called, in a table below it.

use anyhow::Result;
use plotters::prelude::*;

use super::{Area, FONT, SIZE, Series};
use crate::picture::one_line;

/// Height of a row and width of a letter, in pixels.
const ROW: u32 = 22;
const LETTER: u32 = 8;

/// The series with a name, and how many columns and rows they take.
pub(super) struct Legend<'a> {
    entries: Vec<(&'a Series, &'a str)>,
    columns: u32,
    rows: u32,
}

impl<'a> Legend<'a> {
    /// As many columns as the longest name has room for.
    pub(super) fn of(series: &'a [Series]) -> Self {
        let named = |series: &'a Series| Some((series, series.name.as_deref()?));
        let entries: Vec<_> = series.iter().filter_map(named).collect();
        let letters = |(_, name): &(&Series, &str)| name.chars().count();
        let longest = entries.iter().map(letters).max().unwrap_or_default();
        let [count, longest] =
            [entries.len(), longest].map(|number| u32::try_from(number).unwrap_or(u32::MAX));
        let width = longest.saturating_mul(LETTER).saturating_add(50);
        let columns = (SIZE.0 / width).clamp(1, count.max(1));
        Self {
            entries,
            columns,
            rows: count.div_ceil(columns),
        }
    }

    /// In pixels.
    pub(super) const fn height(&self) -> u32 {
        self.rows * ROW
    }

    pub(super) fn draw(&self, area: &Area) -> Result<()> {
        let grid = (self.rows.max(1) as usize, self.columns as usize);
        for ((series, name), cell) in self.entries.iter().zip(area.split_evenly(grid)) {
            let colour = series.colour();
            match series.style.line_width() {
                Some(width) if !series.style.has_dots() => {
                    let ends = [(16, 8), (34, 8)];
                    cell.draw(&PathElement::new(ends, colour.stroke_width(width)))?;
                }
                _ => cell.draw(&Circle::new((25, 8), 3, colour.filled()))?,
            }
            cell.draw(&Text::new(one_line(name), (42, 1), FONT))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Style;
    use super::*;

    #[test]
    fn as_many_columns_as_fit() {
        let named = |letters: usize| Series {
            name: Some("x".repeat(letters)),
            colour: 0,
            style: Style::Line,
            points: Vec::new(),
        };
        for (letters, count, expected) in [
            (5, 3, (3, 1)),
            (20, 4, (3, 2)),
            (40, 3, (2, 2)),
            (200, 3, (1, 3)),
            (5, 0, (1, 0)),
        ] {
            let series = vec![named(letters); count];
            let legend = Legend::of(&series);
            assert_eq!((legend.columns, legend.rows), expected);
        }
    }
}
