//! The cost of a program in C and in Rust, and the table in `bindings/c/README.md`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::sizes::Sizes;

const PAGE: &str = "bindings/c/README.md";
const HEADER: &str = "| | C | Rust |\n|---|---|---|\n";
/// A figure may differ from the page by one part in so many, as compilers of C differ.
const TOLERANCE: u64 = 20;
/// C may take one part in so many more than Rust: it checks the tag of each object.
const MORE: u64 = 10;
/// Rows that are mostly calls of the library, and how many. Each call checks pointers and passes
/// in memory what Rust has in registers.
const CALLS: [(&str, u64); 3] = [
    ("one photon", 1),
    ("take and pack an event", 2),
    // 44 batches, and a share of 44 calls for all pixels.
    ("exposure of one of 16 pixels", 47),
];
/// The most instructions that such a call may take beyond Rust's.
const MOST_OF_A_CALL: u64 = 45;
/// The name of the line with the checksum of all events, the same in both.
const SUM: &str = "sum of the events";

/// The figures of a program in hundredths, and the checksum of its events.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figures {
    rows: Vec<(String, u64)>,
    sum: String,
}

impl Figures {
    /// From the lines that its image printed, and the image's sizes.
    pub fn read(text: &str, sizes: &Sizes) -> Result<Self> {
        let mut rows = Vec::new();
        let mut sum = None;
        for line in text.lines() {
            let what = || format!("not understood: `{line}`");
            let [name, total, runs] = line.split(',').collect::<Vec<_>>()[..] else {
                return Err(anyhow::anyhow!(what()));
            };
            if name == SUM {
                sum = Some(total.to_owned());
                continue;
            }
            let (total, runs): (u64, u64) = (
                total.parse().with_context(what)?,
                runs.parse().with_context(what)?,
            );
            let hundredths = (total * 100 + runs / 2).checked_div(runs);
            rows.push((name.to_owned(), hundredths.with_context(what)?));
        }
        rows.push(("RAM of the program".to_owned(), sizes.ram * 100));
        rows.push(("flash of the program".to_owned(), sizes.flash * 100));
        let sum = sum.context("the program did not finish")?;
        Ok(Self { rows, sum })
    }
}

/// Compares C with Rust, and the page with both.
pub fn check(root: &Path, c: &Figures, rust: &Figures, bless: bool) -> Result<()> {
    let problems = problems(c, rust);
    let table = table(c, rust);
    println!("{table}");
    ensure!(problems.is_empty(), "{}", problems.join("\n"));
    let path = root.join(PAGE);
    let page = fs::read_to_string(&path).context(PAGE)?;
    let start = page.find(HEADER).context("no table of figures");
    let start = start.context(PAGE)?;
    let length = page[start..].find("\n\n").map_or(0, |end| end + 1);
    if bless {
        let page = [&page[..start], &table, &page[start + length..]].concat();
        fs::write(&path, page).context(PAGE)?;
        println!("{PAGE}: written");
        return Ok(());
    }
    let differences = differences(&page[start..start + length], &table);
    ensure!(
        differences.is_empty(),
        "{PAGE}: `cargo xtask c-bindings --bless` writes it\n{}",
        differences.join("\n")
    );
    println!("{PAGE}: figures are up to date");
    Ok(())
}

/// Rows where C takes too much more than Rust, and a difference of the events.
fn problems(c: &Figures, rust: &Figures) -> Vec<String> {
    let mut problems = Vec::new();
    if c.sum != rust.sum {
        problems.push("the events in C differ from those in Rust".to_owned());
    }
    if c.rows.len() != rust.rows.len() {
        problems.push("the programs have different rows".to_owned());
    }
    for ((name, of_c), (_, of_rust)) in c.rows.iter().zip(&rust.rows) {
        let calls = CALLS.iter().find(|(call, _)| call == name);
        let most = match calls {
            Some((_, calls)) => of_rust + calls * MOST_OF_A_CALL * 100,
            None => of_rust + of_rust / MORE,
        };
        if *of_c > most {
            let [c, most] = [*of_c, most].map(decimal);
            problems.push(format!("{name}: {c} in C, at most {most} allowed"));
        }
    }
    problems
}

fn table(c: &Figures, rust: &Figures) -> String {
    let mut text = HEADER.to_owned();
    for ((name, of_c), (_, of_rust)) in c.rows.iter().zip(&rust.rows) {
        let unit = if name.contains("RAM") || name.contains("flash") {
            "bytes"
        } else {
            "instructions"
        };
        let [c, rust] = [*of_c, *of_rust].map(decimal);
        let _ = writeln!(text, "| {name}, {unit} | {c} | {rust} |");
    }
    text
}

/// With one decimal, or none from 1000 on.
fn decimal(hundredths: u64) -> String {
    if hundredths.is_multiple_of(100) || hundredths >= 100_000 {
        return ((hundredths + 50) / 100).to_string();
    }
    let tenths = (hundredths + 5) / 10;
    format!("{}.{}", tenths / 10, tenths % 10)
}

/// Rows that differ between two tables.
fn differences(committed: &str, measured: &str) -> Vec<String> {
    let rows = |table: &str| -> Vec<(String, Vec<u64>)> {
        let rows = table.lines().skip(2);
        rows.map(|row| {
            let mut cells = row.trim_matches('|').split('|').map(str::trim);
            let name = cells.next().unwrap_or_default().to_owned();
            (name, cells.filter_map(tenths).collect())
        })
        .collect()
    };
    let (committed, measured) = (rows(committed), rows(measured));
    let mut differences = Vec::new();
    for (name, is) in &measured {
        let was = committed.iter().find(|(of, _)| of == name);
        let near = was.is_some_and(|(_, was)| {
            let mut pairs = was.iter().zip(is);
            was.len() == is.len() && pairs.all(|(was, is)| was.abs_diff(*is) * TOLERANCE <= *was)
        });
        if !near {
            let was = was.map(|(_, was)| was);
            differences.push(format!("{name}: {is:?} tenths, the page has {was:?}"));
        }
    }
    if committed.len() != measured.len() {
        differences.push(format!("{} rows, not {}", committed.len(), measured.len()));
    }
    differences
}

fn tenths(number: &str) -> Option<u64> {
    let (whole, part) = number.split_once('.').unwrap_or((number, "0"));
    Some(whole.parse::<u64>().ok()? * 10 + part.parse::<u64>().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(rows: &[(&str, u64)], sum: &str) -> Figures {
        let rows = rows.iter().map(|(name, of)| ((*name).to_owned(), *of));
        Figures {
            rows: rows.collect(),
            sum: sum.into(),
        }
    }

    #[test]
    fn a_figure_is_the_mean_of_its_runs() {
        let sizes = Sizes { flash: 9, ram: 8 };
        let text = "one photon,200,3\nsum of the events,7,1\n";
        let rows = [
            ("one photon", 6667),
            ("RAM of the program", 800),
            ("flash of the program", 900),
        ];
        assert_eq!(Figures::read(text, &sizes).unwrap(), figures(&rows, "7"));
        for wrong in [
            "one photon,200,3\n",
            "a,1,0\nsum of the events,7,1\n",
            "panic\n",
        ] {
            assert!(Figures::read(wrong, &sizes).is_err(), "{wrong}");
        }
    }

    #[test]
    fn c_may_take_a_tenth_more_and_a_call_some_instructions() {
        let rust = figures(&[("flash", 10_000), ("one photon", 3000)], "7");
        let good = figures(&[("flash", 11_000), ("one photon", 7500)], "7");
        assert_eq!(problems(&good, &rust), [""; 0]);
        let bad = figures(&[("flash", 11_001), ("one photon", 7501)], "8");
        assert_eq!(problems(&bad, &rust).len(), 3);
    }

    #[test]
    fn a_page_that_is_a_twentieth_off_holds() {
        let of = |figure: u64| table(&figures(&[("a", figure)], "7"), &figures(&[("a", 50)], "7"));
        assert_eq!(
            of(10_000),
            format!("{HEADER}| a, instructions | 100 | 0.5 |\n")
        );
        assert_eq!(differences(&of(10_000), &of(10_500)), [""; 0]);
        assert_eq!(differences(&of(10_000), &of(10_600)).len(), 1);
        assert_eq!(differences(HEADER, &of(10_000)).len(), 2);
    }
}
