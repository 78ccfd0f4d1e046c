//! A rate that a processor sustains, as the file has it.

use super::photons::UNIT;
use crate::files::Column::{self, Name, Percent, Unchecked};
use crate::files::{Cells, Line, ReadLine};

/// The results of a run at one rate.
#[derive(Clone, Debug, PartialEq)]
pub struct SustainedRate {
    /// Core and instruction set, with a comma between.
    pub core: String,
    /// Photons of all macropixels a laser cycle, in [`UNIT`].
    pub rate: u32,
    /// Laser cycles between two looks at a macropixel, in the mean, rounded up to tenths.
    pub between_looks: f64,
    pub photons: u64,
    pub events: u64,
    /// Exposures that reached L2 without one.
    pub expired: u64,
    /// The most words in the FIFO.
    pub fill: u64,
}

impl Line for SustainedRate {
    const FILE: &str = "docs/results/bench/softcore-photons.csv";
    const HEADER: &str = "core,isa,photons a laser cycle,laser cycles between looks,photons,events,expired,highest fill";
    // The rate, and what came of it.
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Percent(10.0),
        Unchecked,
        Unchecked,
        Unchecked,
        Unchecked,
        Unchecked,
    ];

    fn csv(&self) -> String {
        let (core, rate, between) = (&self.core, self.rate(), self.between_looks);
        let counts = [self.photons, self.events, self.expired, self.fill];
        let counts = counts.map(|count| count.to_string()).join(",");
        format!("{core},{rate:.5},{between:.1},{counts}")
    }
}

impl ReadLine for SustainedRate {
    fn of(cells: &mut Cells<'_>) -> Option<Self> {
        let core = cells.core()?;
        let rate = cells.read::<String>()?.replacen('.', "", 1);
        Some(Self {
            core,
            rate: (rate.len() == 6).then(|| rate.parse().ok())??,
            between_looks: cells.read()?,
            photons: cells.read()?,
            events: cells.read()?,
            expired: cells.read()?,
            fill: cells.read()?,
        })
    }
}

impl SustainedRate {
    /// Photons of all macropixels a laser cycle.
    pub fn rate(&self) -> f64 {
        f64::from(self.rate) * UNIT
    }

    /// Events of all macropixels a second, of ten million laser cycles.
    pub fn events_a_second(&self) -> f64 {
        self.events as f64 / self.photons.max(1) as f64 * self.rate() * 1e7
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_file_is_read_as_it_is_written() {
        let sustained = SustainedRate {
            core: "picorv32,rv32im".to_owned(),
            rate: 12_345,
            between_looks: 98.7,
            photons: 3,
            events: 2,
            expired: 1,
            fill: 9,
        };
        let line = sustained.csv();
        assert_eq!(line, "picorv32,rv32im,0.12345,98.7,3,2,1,9");
        assert_eq!(SustainedRate::parse(&line), Some(sustained));
        assert_eq!(
            SustainedRate::parse("picorv32,rv32im,0.12,98.7,3,2,1,9"),
            None
        );
    }
}
