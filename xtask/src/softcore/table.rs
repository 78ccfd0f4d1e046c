//! Cycles and instructions of the operations, from the marks of a run.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};

use super::program::Ran;

/// What the first operation of the bench is: a call that does nothing, taken off the
/// others.
const CALL: &str = "call";

/// One figure of one processor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Core and instruction set, with a comma between.
    pub core: String,
    pub operation: String,
    /// In hundredths.
    pub cycles: u64,
    /// In hundredths.
    pub instructions: u64,
}

pub const HEADER: &str = "core,isa,operation,cycles,instructions";

/// A count of the testbench at a mark.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    cycle: u64,
    instructions: u64,
}

/// The operations of a run of the bench.
pub fn rows(core: &str, ran: &Ran) -> Result<Vec<Row>> {
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
    let &(first, times, CALL) = operations.first().context("no operations")? else {
        anyhow::bail!("the first operation is not `{CALL}`");
    };
    let (call, calls) = totals.get(&first).context("no marks of the first")?;
    ensure!(times == *calls, "{calls} marks for {times} calls");

    let mut rows = Vec::new();
    for &(index, times, name) in &operations[1..] {
        let &(total, measured) = totals
            .get(&index)
            .with_context(|| format!("{name}: no marks"))?;
        // A call of nothing takes the same every time but for the first, if at all.
        let less = |total: u64, call: u64| {
            let call = call * measured / calls;
            (total.saturating_sub(call) * 100 + times / 2) / times.max(1)
        };
        rows.push(Row {
            core: core.to_owned(),
            operation: name.to_owned(),
            cycles: less(total.cycle, call.cycle),
            instructions: less(total.instructions, call.instructions),
        });
    }
    Ok(rows)
}

/// What was counted between marks 2 k + 1 and 2 k + 2, and how often, by k.
fn totals(lines: &str) -> Result<BTreeMap<u64, (Count, u64)>> {
    let mut totals = BTreeMap::<u64, (Count, u64)>::new();
    let mut begun: Option<(u64, Count)> = None;
    for line in lines.lines() {
        let Some(rest) = line.strip_prefix("mark ") else {
            continue;
        };
        let (number, count) = mark(rest).with_context(|| format!("what is `{line}`?"))?;
        match begun.take() {
            None => {
                ensure!(number % 2 == 1, "`{line}` ends what did not begin");
                begun = Some((number, count));
            }
            Some((before, start)) => {
                ensure!(number == before + 1, "`{line}` does not end {before}");
                let (total, times) = totals.entry(before / 2).or_default();
                total.cycle += count.cycle - start.cycle;
                total.instructions += count.instructions - start.instructions;
                *times += 1;
            }
        }
    }
    ensure!(begun.is_none(), "the last operation does not end");
    Ok(totals)
}

/// The rest of `mark N cycle C instructions I`.
fn mark(rest: &str) -> Option<(u64, Count)> {
    let words: Vec<&str> = rest.split(' ').collect();
    let [number, "cycle", cycle, "instructions", instructions] = words[..] else {
        return None;
    };
    let count = Count {
        cycle: cycle.parse().ok()?,
        instructions: instructions.parse().ok()?,
    };
    Some((number.parse().ok()?, count))
}

/// The lines of the file.
pub fn csv(rows: &[Row]) -> Vec<String> {
    let line = |row: &Row| {
        let (cycles, instructions) = (decimal(row.cycles), decimal(row.instructions));
        format!("{},{},{cycles},{instructions}", row.core, row.operation)
    };
    rows.iter().map(line).collect()
}

fn decimal(hundredths: u64) -> String {
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

impl Row {
    /// Cycles, and in brackets instructions, to be looked at.
    pub fn cell(&self) -> String {
        let (cycles, instructions) = (hundredths(self.cycles), hundredths(self.instructions));
        format!("{cycles:.1} ({instructions:.1})")
    }
}

#[allow(clippy::cast_precision_loss, reason = "to be looked at")]
fn hundredths(value: u64) -> f64 {
    value as f64 / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ran(output: &str, errors: &str) -> Ran {
        Ran {
            code: Some(0),
            output: output.into(),
            errors: errors.into(),
        }
    }

    const OUTPUT: &str = "operation 0 2 call\noperation 1 8 a: b\nstack 4\n";
    const MARKS: &str = "\
mark 1 cycle 10 instructions 1
mark 2 cycle 15 instructions 3
mark 3 cycle 20 instructions 4
mark 4 cycle 70 instructions 30
exit 0x0 cycle 80 instructions 40
mark 1 cycle 90 instructions 50
mark 2 cycle 95 instructions 52
";

    #[test]
    fn takes_the_call_off_and_divides_by_the_times() {
        let rows = rows("serv,rv32i", &ran(OUTPUT, MARKS)).unwrap();
        assert_eq!(csv(&rows), ["serv,rv32i,a: b,5.63,3.00"]);
        assert_eq!(rows[0].cell(), "5.6 (3.0)");
    }

    #[test]
    fn marks_out_of_order_and_operations_without_marks_fail() {
        let swapped = MARKS.replace("mark 3", "mark 2");
        assert!(rows("", &ran(OUTPUT, &swapped)).is_err());
        let unended = format!("{MARKS}mark 1 cycle 99 instructions 60\n");
        assert!(rows("", &ran(OUTPUT, &unended)).is_err());
        let more = format!("{OUTPUT}operation 2 1 c\n");
        assert!(rows("", &ran(&more, MARKS)).is_err());
        assert!(rows("", &ran("", MARKS)).is_err());
    }
}
