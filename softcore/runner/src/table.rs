//! Cycles and instructions of the operations, from the marks of a run.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};

use crate::files::Column::{self, Name, Percent, Unchecked};
use crate::files::{Cells, Line, ReadLine};
use crate::program::ProgramRun;

/// The first operation of the bench: a call that does nothing, taken off the others.
const CALL: &str = "call";

/// The end of an operation's name when no cache holds any of it.
pub const COLD: &str = "; cold";
/// The end of an operation's name when it was done just before.
const WARM: &str = "; warm";

/// The figures of an operation on one processor, rounded to hundredths.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Core and instruction set, with a comma between.
    pub core: String,
    /// Warm, if the name does not end with [`COLD`].
    pub operation: String,
    pub cycles: f64,
    pub instructions: f64,
    /// Lines that the instruction cache filled.
    pub code_lines: f64,
    /// Lines that the data cache filled.
    pub data_lines: f64,
}

/// The counts of the testbench: cycles, instructions, lines of code and of data.
const COUNTS: [&str; 4] = ["cycle", "instructions", "code", "data"];
type Counts = [u64; COUNTS.len()];

/// The rows of a run of the bench, one for each operation, less the cost of an empty call. Cold
/// operations have rows only with `caches`; without them, cold and warm must cost the same.
pub fn rows(core: &str, caches: bool, ran: &ProgramRun) -> Result<Vec<Row>> {
    let totals = totals(&ran.errors)?;
    let mut operations = Vec::new();
    for line in ran.output.lines() {
        if let Some(rest) = line.strip_prefix("operation ") {
            let mut words = rest.splitn(3, ' ');
            let mut number = || words.next()?.parse::<u64>().ok();
            let (index, times) = (number(), number());
            let (Some(index), Some(times), Some(name)) = (index, times, words.next()) else {
                anyhow::bail!("what is `{line}`?");
            };
            operations.push((index, times, name));
        }
    }
    let mut pairs = operations.chunks_exact(2);
    let mut empty_calls = [(Counts::default(), 0); 2];
    let mut rows = Vec::new();
    for (number, pair) in pairs.by_ref().enumerate() {
        let mut both = Vec::new();
        for ((end, empty_call), &(index, times, name)) in
            [COLD, WARM].iter().zip(&mut empty_calls).zip(pair)
        {
            let name = name.strip_suffix(end);
            let name = name.with_context(|| format!("operation {index} is not{end}"))?;
            let marks = totals.get(&index);
            let &(total, measured) = marks.with_context(|| format!("{name}: no marks"))?;
            if number == 0 {
                ensure!(name == CALL, "the first operation is not `{CALL}`");
                ensure!(times == measured, "{measured} marks for {times} calls");
                *empty_call = (total, measured);
                continue;
            }
            let cost_per_call = |of: usize| {
                // Multiplied by the number of empty calls, which may differ from that of operations.
                let scale = empty_call.1.max(1);
                let rest = (total[of] * scale).checked_sub(empty_call.0[of] * measured);
                let rest = rest.with_context(|| format!("{name}: less than an empty call"))?;
                let times = times.max(1) * scale;
                anyhow::Ok(((rest * 100 + times / 2) / times) as f64 / 100.0)
            };
            both.push(Row {
                core: core.to_owned(),
                operation: name.to_owned(),
                cycles: cost_per_call(0)?,
                instructions: cost_per_call(1)?,
                // An empty call may fill a line that the operation does not.
                code_lines: cost_per_call(2).unwrap_or_default(),
                data_lines: cost_per_call(3).unwrap_or_default(),
            });
        }
        let [cold, warm] = &mut both[..] else {
            continue;
        };
        if caches {
            cold.operation += COLD;
        } else {
            ensure!(cold == warm, "without a cache: {cold:?}, {warm:?}");
            both.remove(0);
        }
        rows.extend(both);
    }
    ensure!(
        pairs.remainder().is_empty() && !rows.is_empty(),
        "{} operations, which must be pairs of cold and warm",
        operations.len()
    );
    Ok(rows)
}

/// The sum of counts from each mark 2 k + 1 to the next mark 2 k + 2, and their number, by k.
fn totals(lines: &str) -> Result<BTreeMap<u64, (Counts, u64)>> {
    let mut totals = BTreeMap::<u64, (Counts, u64)>::new();
    let mut begun: Option<(u64, Counts)> = None;
    for mark in marks(lines) {
        let (number, counts) = mark?;
        match begun.take() {
            None => {
                ensure!(
                    number % 2 == 1,
                    "mark {number} ends an operation that did not begin"
                );
                begun = Some((number, counts));
            }
            Some((before, start)) => {
                ensure!(number == before + 1, "mark {number} does not end {before}");
                let (total, times) = totals.entry(before / 2).or_default();
                for ((total, count), start) in total.iter_mut().zip(counts).zip(start) {
                    *total += count - start;
                }
                *times += 1;
            }
        }
    }
    ensure!(begun.is_none(), "the last operation does not end");
    Ok(totals)
}

/// The marks of a run.
pub fn marks(lines: &str) -> impl Iterator<Item = Result<(u64, Counts)>> {
    let marks = lines.lines().filter_map(|line| line.strip_prefix("mark "));
    marks.map(|rest| mark(rest).with_context(|| format!("what is `mark {rest}`?")))
}

/// The rest of `mark N cycle C instructions I code C data D`.
fn mark(rest: &str) -> Option<(u64, Counts)> {
    let mut words = rest.split(' ');
    let number = words.next()?.parse().ok()?;
    let mut counts = Counts::default();
    for (name, count) in COUNTS.iter().zip(&mut counts) {
        words.next().filter(|word| word == name)?;
        *count = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some((number, counts))
}

impl Line for Row {
    const FILE: &str = "docs/results/bench/softcore.csv";
    const HEADER: &str = "core,isa,operation,cycles,instructions,code lines,data lines";
    const COLUMNS: &[Column] = &[
        Name,
        Name,
        Name,
        Percent(10.0),
        Percent(2.0),
        Unchecked,
        Unchecked,
    ];

    fn csv(&self) -> String {
        let counts = [
            self.cycles,
            self.instructions,
            self.code_lines,
            self.data_lines,
        ];
        let counts = counts.map(|count| format!("{count:.2}")).join(",");
        format!("{},{},{counts}", self.core, self.operation)
    }
}

impl ReadLine for Row {
    fn of(cells: &mut Cells<'_>) -> Option<Self> {
        Some(Self {
            core: cells.core()?,
            operation: cells.read()?,
            cycles: cells.read()?,
            instructions: cells.read()?,
            code_lines: cells.read()?,
            data_lines: cells.read()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "\
operation 0 1 call; cold
operation 1 2 call; warm
operation 2 4 a: b; cold
operation 3 4 a: b; warm
stack 4
";
    const MARKS: &str = "\
mark 1 cycle 10 instructions 1 code 0 data 0
mark 2 cycle 40 instructions 3 code 2 data 4
mark 3 cycle 50 instructions 4 code 2 data 4
mark 4 cycle 55 instructions 6 code 2 data 4
mark 3 cycle 60 instructions 7 code 2 data 4
mark 4 cycle 65 instructions 9 code 2 data 4
mark 5 cycle 70 instructions 9 code 2 data 4
mark 6 cycle 150 instructions 31 code 6 data 12
mark 7 cycle 160 instructions 31 code 6 data 12
mark 8 cycle 201 instructions 53 code 6 data 12
exit 0x0 cycle 250 instructions 60
";

    #[test]
    fn takes_a_call_of_the_same_kind_off_and_divides_by_the_times() {
        let rows = rows("vexriscv,rv32im", true, &ProgramRun::success(OUTPUT, MARKS)).unwrap();
        let lines: Vec<String> = rows.iter().map(Row::csv).collect();
        let cold = "vexriscv,rv32im,a: b; cold,12.50,5.00,0.50,1.00";
        assert_eq!(lines, [cold, "vexriscv,rv32im,a: b,9.00,5.00,0.00,0.00"]);
        for (row, line) in rows.iter().zip(&lines) {
            assert_eq!(Row::parse(line).as_ref(), Some(row));
        }
        for wrong in ["", "a,b,c,1,2,3", "a,b,c,1.00,2.00,3.00,x", "a,b,1,2,3"] {
            assert_eq!(Row::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_processor_without_a_cache_has_nothing_cold() {
        let error = rows(
            "picorv32,rv32im",
            false,
            &ProgramRun::success(OUTPUT, MARKS),
        )
        .unwrap_err();
        assert!(error.to_string().starts_with("without a cache"));
        let same = "\
mark 1 cycle 1 instructions 1 code 0 data 0
mark 2 cycle 2 instructions 2 code 0 data 0
mark 3 cycle 3 instructions 3 code 0 data 0
mark 4 cycle 4 instructions 4 code 0 data 0
mark 5 cycle 5 instructions 5 code 0 data 0
mark 6 cycle 8 instructions 8 code 0 data 0
mark 7 cycle 9 instructions 9 code 0 data 0
mark 8 cycle 12 instructions 12 code 0 data 0
";
        let output = OUTPUT.replace("1 2 call", "1 1 call");
        let rows = rows(
            "picorv32,rv32im",
            false,
            &ProgramRun::success(&output, same),
        )
        .unwrap();
        let lines: Vec<String> = rows.iter().map(Row::csv).collect();
        assert_eq!(lines, ["picorv32,rv32im,a: b,0.50,0.50,0.00,0.00"]);
    }

    #[test]
    fn marks_out_of_order_and_operations_without_marks_fail() {
        let rows = |output: &str, marks: &str| rows("", true, &ProgramRun::success(output, marks));
        assert!(rows(OUTPUT, MARKS).is_ok());
        assert!(rows(OUTPUT, &MARKS.replacen("mark 3", "mark 2", 1)).is_err());
        let unended = format!("{MARKS}mark 1 cycle 999 instructions 60 code 6 data 12\n");
        assert!(rows(OUTPUT, &unended).is_err());
        let more = format!("{OUTPUT}operation 4 1 c; cold\noperation 5 1 c; warm\n");
        assert!(rows(&more, MARKS).is_err());
        let odd = OUTPUT.replace("operation 3 4 a: b; warm\n", "");
        assert!(rows(&odd, MARKS).is_err());
        assert!(rows(&OUTPUT.replace("call", "c"), MARKS).is_err());
        assert!(rows("", MARKS).is_err());
    }
}
