//! The laser rates that the real board can keep up with: a table for the documentation, computed
//! from the counts.

use std::fmt::Write as _;

use anyhow::{Context, Result};

use super::Row;

/// Clock cycles per second of the STM32F405, taken as instructions per second.
const INSTRUCTIONS_A_SECOND: f64 = 168e6;
/// Macropixels.
const ARRAYS: [f64; 2] = [64.0, 128.0];
/// Laser cycles between looks.
const X: [f64; 2] = [4.0, 40.0];
/// Blocks per macropixel, of 2 × 2 and of 4 × 4.
const BLOCKS: f64 = 1.0 / 4.0 + 1.0 / 16.0;

/// The work of a macropixel: a photon each laser cycle, and a look.
struct Load {
    what: &'static str,
    photon: &'static str,
    look: &'static str,
    /// Whether its share of the blocks looks as well.
    with_blocks: bool,
}

const LOADS: [Load; 5] = [
    Load {
        what: "window of 3, nothing else on",
        photon: "array",
        look: "look; array; no event",
        with_blocks: false,
    },
    Load {
        what: "silent, feeds blocks of two levels",
        photon: "array with blocks; 2 levels",
        look: "look; array; no event",
        with_blocks: true,
    },
    Load {
        what: "tracks",
        photon: "array",
        look: "look; tracking; no event",
        with_blocks: false,
    },
    Load {
        what: "holds the first of two echoes",
        photon: "array",
        look: "look; two echoes; first held, no event",
        with_blocks: false,
    },
    Load {
        what: "all on: tracks, holds an echo, feeds no block",
        photon: "array with blocks; feeds none",
        look: "look; two echoes, tracking; first held, no event",
        with_blocks: true,
    },
];

/// The table, in Markdown.
pub fn table(rows: &[Row]) -> Result<String> {
    let mut text = String::from("| macropixel |");
    for x in X {
        let _ = write!(text, " X = {x}: instructions |");
        for pixels in ARRAYS {
            let _ = write!(text, " kHz for {pixels} |");
        }
    }
    text.push_str("\n|---|---|---|---|---|---|---|\n");
    for load in &LOADS {
        let _ = write!(text, "| {} |", load.what);
        for x in X {
            let instructions = load.a_laser_cycle(rows, x)?;
            let _ = write!(text, " {instructions:.0} |");
            for pixels in ARRAYS {
                let khz = INSTRUCTIONS_A_SECOND / instructions / pixels / 1e3;
                let _ = write!(text, " {khz:.1} |");
            }
        }
        text.push('\n');
    }
    Ok(text)
}

impl Load {
    /// Instructions for a macropixel.
    fn a_laser_cycle(&self, rows: &[Row], x: f64) -> Result<f64> {
        let mut look = of(rows, "decision", self.look)?;
        if self.with_blocks {
            look += BLOCKS * of(rows, "decision", "look; block; no event")?;
        }
        Ok(of(rows, "photon", self.photon)? + look / x)
    }
}

/// The instructions of an operation, optimised for speed.
fn of(rows: &[Row], operation: &str, variant: &str) -> Result<f64> {
    let name = format!("{operation},{variant},3");
    let row = rows.iter().find(|row| row.name == name);
    let row = row.with_context(|| format!("no row {name}"))?;
    #[allow(clippy::cast_precision_loss, reason = "small numbers")]
    Ok(row.hundredths as f64 / 100.0)
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    #[test]
    fn the_documentation_has_the_table() {
        let rows = parse(include_str!("../../../docs/results/bench/instructions.csv"));
        let rows = rows.unwrap();
        let page = include_str!("../../../docs/results/bench/README.md");
        let table = table(&rows).unwrap();
        assert!(page.contains(&table), "not in the page:\n{table}");
    }

    #[test]
    fn a_rate_is_what_is_left_for_a_laser_cycle() {
        let row = |name: &str, hundredths| Row {
            name: name.into(),
            hundredths,
        };
        let rows = [
            row("photon,array,3", 3000),
            row("decision,look; array; no event,3", 4000),
        ];
        // 30 and 40/4.
        assert_eq!(LOADS[0].a_laser_cycle(&rows, 4.0).unwrap(), 40.0);
        assert!(LOADS[1].a_laser_cycle(&rows, 4.0).is_err());
    }
}
