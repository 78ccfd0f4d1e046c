//! A placed design, as the file has it.

use anyhow::{Context, Result};

use super::design::Kind;
use super::flow::Placements;
use super::report::Used;
use crate::line::Column::{self, Name, Percent, Unchecked};
use crate::line::Line;

/// The figures of a design.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub design: String,
    /// 0 if it has none.
    pub macropixels: u32,
    pub used: Used,
    /// How many of the flip-flops are at most the registers at its ports.
    pub registers: u64,
    /// The median clock of all seeds, in MHz, rounded to tenths.
    pub megahertz: f64,
    /// The lowest clock of all seeds, in MHz.
    pub lowest_megahertz: f64,
    /// Of the path that limits the median clock: ns in cells, rounded to tenths, and in wires.
    pub logic: f64,
    pub wires: f64,
    /// Where that path starts and ends.
    pub from: String,
    pub to: String,
    /// Clocks from the start of a decision to its end, where they are always the same.
    pub clocks: Option<u64>,
    /// The smallest ECP5 that takes it, on which it is placed.
    pub part: String,
}

impl Row {
    /// From place and route with all seeds.
    pub fn of(kind: Kind, placements: Placements, clocks: Option<u64>) -> Result<Self> {
        let Placements {
            part,
            seeds: mut placed,
            registers,
        } = placements;
        placed.sort_by(|a, b| a.megahertz.total_cmp(&b.megahertz));
        let lowest = placed.first().context("no seeds")?.megahertz;
        let middle = placed.swap_remove(placed.len() / 2);
        let tenths = |value: f64| (value * 10.0).round() / 10.0;
        Ok(Self {
            design: kind.name(),
            macropixels: kind.macropixels(),
            used: middle.used,
            registers,
            megahertz: tenths(middle.megahertz),
            lowest_megahertz: tenths(lowest),
            logic: tenths(middle.logic),
            wires: tenths(middle.wires),
            from: middle.from,
            to: middle.to,
            clocks,
            part: part.to_owned(),
        })
    }

    /// Whether it is of this size, or of no size.
    pub fn is_of(&self, size: u32) -> bool {
        self.macropixels == 0 || self.macropixels == size
    }

    /// Lookup tables and flip-flops but for the registers at its ports.
    pub fn cells(&self) -> u64 {
        self.used.lookup_tables + self.used.flip_flops.saturating_sub(self.registers)
    }
}

impl Line for Row {
    const FILE: &str = "docs/results/bench/fpga.csv";
    const HEADER: &str = "design,macropixels,lookup tables,flip-flops,of them at ports,block RAMs,multipliers,RAMs of tables,MHz,lowest MHz,logic ns,wires ns,from,to,clocks a decision,part";
    // Tools of one version place the same Verilog in the same way.
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Name,
        Percent(3.0),
        Percent(3.0),
        Unchecked,
        Unchecked,
        Name,
        Name,
        Name,
        Name,
    ];

    fn csv(&self) -> String {
        let Used {
            lookup_tables,
            flip_flops,
            rams,
            multipliers,
            lookup_table_rams,
        } = self.used;
        let (design, macropixels, part) = (&self.design, self.macropixels, &self.part);
        let cells = [
            lookup_tables,
            flip_flops,
            self.registers,
            rams,
            multipliers,
            lookup_table_rams,
        ]
        .map(|of| of.to_string());
        let times = [
            self.megahertz,
            self.lowest_megahertz,
            self.logic,
            self.wires,
        ];
        let (cells, times) = (
            cells.join(","),
            times.map(|of| format!("{of:.1}")).join(","),
        );
        let clocks = self
            .clocks
            .map(|clocks| clocks.to_string())
            .unwrap_or_default();
        let (from, to) = (&self.from, &self.to);
        format!("{design},{macropixels},{cells},{times},{from},{to},{clocks},{part}")
    }

    fn of(words: &[&str]) -> Option<Self> {
        let &[
            design,
            macropixels,
            lookup_tables,
            flip_flops,
            registers,
            rams,
            multipliers,
            lookup_table_rams,
            ref rest @ ..,
        ] = words
        else {
            return None;
        };
        let &[megahertz, lowest, logic, wires, from, to, clocks, part] = rest else {
            return None;
        };
        let clocks = match clocks {
            "" => None,
            clocks => Some(clocks.parse().ok()?),
        };
        Some(Self {
            design: design.to_owned(),
            macropixels: macropixels.parse().ok()?,
            used: Used {
                lookup_tables: lookup_tables.parse().ok()?,
                flip_flops: flip_flops.parse().ok()?,
                rams: rams.parse().ok()?,
                multipliers: multipliers.parse().ok()?,
                lookup_table_rams: lookup_table_rams.parse().ok()?,
            },
            registers: registers.parse().ok()?,
            megahertz: megahertz.parse().ok()?,
            lowest_megahertz: lowest.parse().ok()?,
            logic: logic.parse().ok()?,
            wires: wires.parse().ok()?,
            from: from.to_owned(),
            to: to.to_owned(),
            clocks,
            part: part.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::Placed;
    use super::*;

    fn placed(megahertz: f64, to: &str) -> Placed {
        Placed {
            used: Used {
                lookup_tables: 24_289,
                flip_flops: 2,
                rams: 3,
                multipliers: 4,
                lookup_table_rams: 5,
            },
            megahertz,
            logic: 6.04,
            wires: 7.06,
            from: "a".to_owned(),
            to: to.to_owned(),
        }
    }

    fn placements(seeds: Vec<Placed>) -> Placements {
        Placements {
            part: "45k",
            seeds,
            registers: 1,
        }
    }

    #[test]
    fn a_row_has_the_middle_clock_and_its_path() {
        let seeds = vec![
            placed(90.04, "high"),
            placed(70.0, "low"),
            placed(80.0, "middle"),
        ];
        let row = Row::of(Kind::System(16), placements(seeds), None).unwrap();
        let line = "whole system,16,24289,2,1,3,4,5,80.0,70.0,6.0,7.1,a,middle,,45k";
        assert_eq!(row.csv(), line);
        assert_eq!(Row::parse(line), Some(row.clone()));
        assert_eq!(row.cells(), 24_290);
        assert!(row.is_of(16) && !row.is_of(4));

        let row = Row::of(Kind::Tree(8), placements(vec![placed(80.0, "b")]), Some(28)).unwrap();
        assert!(row.csv().ends_with(",b,28,45k") && row.is_of(4));
        assert_eq!(Row::parse(&row.csv()), Some(row));
        assert!(Row::of(Kind::Processor, placements(Vec::new()), None).is_err());
        for wrong in ["", "a,1,2", "a,1,2,3,4,5,6,7,7.0,8.0,9.0,1.0,a,b,x,25k"] {
            assert_eq!(Row::parse(wrong), None, "{wrong}");
        }
        assert_eq!(Row::HEADER.split(',').count(), Row::COLUMNS.len());
    }
}
