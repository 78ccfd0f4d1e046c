//! Bytes of the programs that take photons from the FIFO.

use anyhow::Result;

use crate::ISAS;
use crate::files::Column::{self, Name, Percent, PercentIfMeasured};
use crate::files::{Cells, Line, ReadLine};
use crate::image::{Images, Sizes};

/// Macropixels of the programs.
pub const MACROPIXELS: [u8; 3] = [1, 4, 64];

/// The bytes of a program for so many macropixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    pub isa: String,
    pub macropixels: u8,
    pub sizes: Sizes,
    /// The stack, if a processor of this instruction set was run.
    pub stack: Option<u64>,
}

/// Stacks by instruction set and macropixels.
pub type Stacks = Vec<(&'static str, u8, u64)>;

impl Memory {
    /// Builds and measures all programs.
    pub fn of_all(stacks: &Stacks) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for isa in ISAS {
            let images = Images::build(isa, false)?;
            for macropixels in MACROPIXELS {
                let stacks = stacks
                    .iter()
                    .filter(|&&(of, pixels, _)| (of, pixels) == (isa, macropixels));
                all.push(Self {
                    isa: isa.to_owned(),
                    macropixels,
                    sizes: images.sizes(&format!("stream-{macropixels}"))?,
                    stack: stacks.map(|&(.., stack)| stack).max(),
                });
            }
        }
        Ok(all)
    }

    /// Its cells.
    pub fn cells(&self) -> [String; 5] {
        [
            self.isa.clone(),
            self.macropixels.to_string(),
            self.sizes.code.to_string(),
            self.sizes.data.to_string(),
            self.stack
                .map(|stack| stack.to_string())
                .unwrap_or_default(),
        ]
    }
}

impl Line for Memory {
    const FILE: &str = "docs/results/bench/softcore-bytes.csv";
    const HEADER: &str = "isa,macropixels,code and constants,data,stack";
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Percent(2.0),
        Percent(2.0),
        PercentIfMeasured(10.0),
    ];

    fn csv(&self) -> String {
        self.cells().join(",")
    }
}

impl ReadLine for Memory {
    fn of(cells: &mut Cells<'_>) -> Option<Self> {
        Some(Self {
            isa: cells.read()?,
            macropixels: cells.read()?,
            sizes: Sizes {
                code: cells.read()?,
                data: cells.read()?,
            },
            stack: cells.optional()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_file_is_read_as_it_is_written() {
        for line in ["rv32i,64,100,20,7", "rv32im,1,100,20,"] {
            assert_eq!(Memory::parse(line).unwrap().csv(), line);
        }
        for wrong in ["rv32i,64,100,20", "rv32i,64,100,x,7", "rv32i,64,100,20,x"] {
            assert_eq!(Memory::parse(wrong), None);
        }
    }
}
