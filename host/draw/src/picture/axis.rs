//! The axes of a map.

use crate::svg::{TEXT, text_width};

/// A single line of more pixels is wrapped.
const MAX_IN_LINE: usize = 256;
/// The smallest gap between two numbers along an axis.
const GAP: f64 = 14.0;

/// The name and the numbers along one side of a map.
#[derive(Debug)]
pub(super) struct Axis {
    pub name: String,
    /// Distances from the start of the axis, and their labels.
    pub numbers: Vec<(f64, String)>,
}

/// How the pixels of a map are drawn in lines.
#[derive(Debug)]
pub(super) struct Lines {
    /// Number of pixels in a line.
    pub columns: usize,
    /// Number of lines.
    pub rows: usize,
    across: String,
    down: String,
    /// The difference of the numbers of two lines.
    row_unit: usize,
}

impl Lines {
    /// The lines of a map of `columns` and `rows`, with the names of its axes.
    pub fn new(columns: usize, rows: usize, [column, row]: [&str; 2]) -> Self {
        let long = columns.max(rows);
        if columns.min(rows) > 1 || long <= MAX_IN_LINE {
            return Self {
                columns,
                rows,
                across: column.into(),
                down: row.into(),
                row_unit: 1,
            };
        }

        // The smallest power of two that does not give more lines than columns.
        let mut in_line = 1;
        while in_line * in_line < long {
            in_line *= 2;
        }
        let name = if rows == 1 { column } else { row };
        Self {
            columns: in_line,
            rows: long.div_ceil(in_line),
            across: format!("{name} − line start"),
            down: "line start".into(),
            row_unit: in_line,
        }
    }

    /// The axes below and beside the map, for pixels of the size `cell`.
    pub fn axes(self, cell: (f64, f64)) -> [Axis; 2] {
        [
            Axis {
                name: self.across,
                numbers: numbers(self.columns, 1, cell.0),
            },
            Axis {
                name: self.down,
                numbers: numbers(self.rows, self.row_unit, cell.1),
            },
        ]
    }
}

/// The numbers along an axis of `length` steps of `unit`, each `side` wide.
fn numbers(length: usize, unit: usize, side: f64) -> Vec<(f64, String)> {
    let least = text_width(&(length * unit).to_string(), TEXT).max(TEXT) + GAP;
    // Powers of two where they divide the axis evenly.
    let factors: &[usize] = if length.is_multiple_of(8) {
        &[2, 2]
    } else {
        &[5, 2]
    };
    let mut step = 1;
    for factor in factors.iter().cycle() {
        if step as f64 * side >= least || step >= length {
            break;
        }
        step *= factor;
    }
    (0..length)
        .step_by(step)
        .map(|at| ((at as f64 + 0.5) * side, (at * unit).to_string()))
        .collect()
}
