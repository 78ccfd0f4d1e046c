//! The report of nextpnr: cells, clock and critical path.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;
use serde_json::Value;

/// `--report` of nextpnr, its `docs/report.md`, as far as it is used here. Times in ns.
#[derive(Debug, Deserialize)]
struct Report {
    fmax: BTreeMap<String, Clock>,
    utilization: BTreeMap<String, Cells>,
    critical_paths: Vec<Path>,
}

#[derive(Debug, Deserialize)]
struct Clock {
    achieved: f64,
}

#[derive(Debug, Deserialize)]
struct Cells {
    used: u64,
}

#[derive(Debug, Deserialize)]
struct Path {
    from: String,
    to: String,
    path: Vec<Step>,
}

#[derive(Debug, Deserialize)]
struct Step {
    delay: f64,
    #[serde(rename = "type")]
    kind: String,
    from: End,
    to: End,
}

#[derive(Debug, Deserialize)]
struct End {
    cell: String,
}

/// Cells of an ECP5, all that is in them counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Used {
    /// Lookup tables of four inputs, `TRELLIS_COMB`.
    pub lookup_tables: u64,
    /// `TRELLIS_FF`.
    pub flip_flops: u64,
    /// Block RAMs of 18 kbit, `DP16KD`.
    pub rams: u64,
    /// `MULT18X18D`.
    pub multipliers: u64,
    /// RAMs of 16 words of four bits made of lookup tables, `TRELLIS_RAMW`. The tables are
    /// among the others.
    pub lookup_table_rams: u64,
}

/// The bits of all ports of a netlist's module but for the clock.
pub fn port_bits(netlist: &str, module: &str) -> Result<u64> {
    let netlist: Value = serde_json::from_str(netlist).context("the netlist of Yosys")?;
    let ports = netlist["modules"][module]["ports"].as_object();
    let ports = ports.with_context(|| format!("no {module}"))?.iter();
    let bits = ports.filter(|(name, _)| *name != "clk");
    let bits = bits.map(|(_, port)| Some(port["bits"].as_array()?.len()));
    let bits: usize = bits.sum::<Option<_>>().context("a port without bits")?;
    Ok(bits.try_into()?)
}

/// What place and route with one seed gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    pub used: Used,
    pub megahertz: f64,
    /// The path that limits the clock: cells, clock to output and setup.
    pub logic: f64,
    /// Its wires.
    pub wires: f64,
    /// Where it starts and ends.
    pub from: String,
    pub to: String,
}

impl Placed {
    /// Reads the report of a design with one clock.
    pub fn of(report: &str) -> Result<Self> {
        let report: Report = serde_json::from_str(report).context("the report of nextpnr")?;
        let clocks: Vec<_> = report.fmax.iter().collect();
        let &[(name, clock)] = &clocks[..] else {
            bail!("{} clocks, not one", clocks.len());
        };
        let edge = format!("posedge {name}");
        let mut paths = report.critical_paths.iter();
        let limiting = paths.find(|path| path.from == edge && path.to == edge);
        let steps = &limiting.with_context(|| format!("no path of {name}"))?.path;
        let (Some(first), Some(last)) = (steps.first(), steps.last()) else {
            bail!("the path of {name} is empty");
        };
        let sum = |wires| {
            let of_kind = steps
                .iter()
                .filter(|step| (step.kind == "routing") == wires);
            of_kind.map(|step| step.delay).sum()
        };
        let (logic, wires): (f64, f64) = (sum(false), sum(true));
        // The report is rounded to hundredths; a path of another length is not the limit.
        let period = 1000.0 / clock.achieved;
        ensure!(
            (logic + wires - period).abs() < 0.2,
            "the path of {name} takes {:.2} ns of {period:.2}",
            logic + wires
        );
        let used = |cell: &str| {
            let cells = report.utilization.get(cell);
            Ok::<_, anyhow::Error>(cells.with_context(|| format!("no {cell}"))?.used)
        };
        Ok(Self {
            used: Used {
                lookup_tables: used("TRELLIS_COMB")?,
                flip_flops: used("TRELLIS_FF")?,
                rams: used("DP16KD")?,
                multipliers: used("MULT18X18D")?,
                lookup_table_rams: used("TRELLIS_RAMW")?,
            },
            megahertz: clock.achieved,
            logic,
            wires,
            from: named(&first.from.cell),
            to: named(&last.to.cell),
        })
    }
}

/// What Yosys appends to the name of the signal it makes a cell for.
const CELLS: [&str; 7] = [
    "_TRELLIS_FF",
    "_LUT4",
    "_PFUMX",
    "_L6MUX21",
    "_CCU2C",
    "_MULT18X18D",
    "$",
];

/// The signal or memory of the Verilog that a cell is named after.
fn named(cell: &str) -> String {
    let end = CELLS.iter().filter_map(|suffix| cell.find(suffix)).min();
    let mut name = cell.get(..end.unwrap_or(cell.len())).unwrap_or_default();
    // The cells of a memory are numbered.
    while let Some((memory, number)) = name.rsplit_once('.')
        && number.bytes().all(|byte| byte.is_ascii_digit())
    {
        name = memory;
    }
    name.replace(',', ";")
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPORT: &str = r#"{
        "fmax": {"clk": {"achieved": 100.0, "constraint": 120.0}},
        "utilization": {
            "TRELLIS_COMB": {"used": 11, "available": 83640},
            "TRELLIS_FF": {"used": 12, "available": 83640},
            "DP16KD": {"used": 13, "available": 208},
            "MULT18X18D": {"used": 14, "available": 156},
            "TRELLIS_RAMW": {"used": 15, "available": 10455}
        },
        "critical_paths": [
            {"from": "<async>", "to": "posedge clk", "path": []},
            {"from": "posedge clk", "to": "posedge clk", "path": [
                {"delay": 5.5, "type": "clk-to-q", "from": {"cell": "a.tags.0.12"}, "to": {"cell": "a.tags.0.12"}},
                {"delay": 4.0, "type": "routing", "from": {"cell": "a.tags.0.12"}, "to": {"cell": "b"}, "net": "n"},
                {"delay": 0.25, "type": "logic", "from": {"cell": "b"}, "to": {"cell": "b"}},
                {"delay": 0.25, "type": "setup", "from": {"cell": "b"}, "to": {"cell": "a.hit_TRELLIS_FF_Q_1_DI_LUT4_Z"}}
            ]}
        ]
    }"#;

    #[test]
    fn cells_clock_and_path_are_read() {
        let placed = Placed::of(REPORT).unwrap();
        let used = Used {
            lookup_tables: 11,
            flip_flops: 12,
            rams: 13,
            multipliers: 14,
            lookup_table_rams: 15,
        };
        assert_eq!(placed.used, used);
        assert!((placed.megahertz - 100.0).abs() < 1e-9);
        assert!((placed.logic - 6.0).abs() < 1e-9 && (placed.wires - 4.0).abs() < 1e-9);
        assert_eq!((&*placed.from, &*placed.to), ("a.tags", "a.hit"));
    }

    #[test]
    fn a_report_that_is_not_whole_is_refused() {
        for (part, with) in [
            ("\"DP16KD\"", "\"DP\""),
            (
                "\"posedge clk\", \"path\": [\n",
                "\"negedge clk\", \"path\": [\n",
            ),
            ("\"clk\": {", "\"b\": {\"achieved\": 1.0}, \"clk\": {"),
            ("100.0", "50.0"),
            ("}", ""),
        ] {
            let report = REPORT.replacen(part, with, 1);
            assert_ne!(report, REPORT, "{part}");
            assert!(Placed::of(&report).is_err(), "{part}");
        }
    }

    #[test]
    fn ports_are_counted() {
        let netlist = r#"{"modules": {
            "DP16KD": {"ports": {"CLKA": {"bits": [2]}}},
            "top": {"ports": {"clk": {"bits": [2]}, "a": {"bits": [3, 4]}, "b": {"bits": ["0"]}}}
        }}"#;
        assert_eq!(port_bits(netlist, "top").unwrap(), 3);
        assert!(port_bits(netlist, "other").is_err());
        assert!(port_bits("{}", "top").is_err());
    }

    #[test]
    fn cells_are_named_after_signals() {
        for (cell, name) in [
            ("cpu.x_TRELLIS_FF_Q_1", "cpu.x"),
            ("ready_CCU2C_A0_B1_PFUMX_Z_ALUT_LUT4_Z", "ready"),
            ("ready_A0$CCU2_COMB1", "ready_A0"),
            ("computer.ram.0.26", "computer.ram"),
            ("cpu.zz_2", "cpu.zz_2"),
            ("cpu.zz_2_TRELLIS_FF_Q", "cpu.zz_2"),
        ] {
            assert_eq!(named(cell), name);
        }
    }
}
