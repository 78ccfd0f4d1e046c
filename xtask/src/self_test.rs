//! `cargo xtask self-test`: what the core works out on the target, beside what
//! it works out here.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use dtof_firmware::self_test;

use crate::firmware::Board;
use crate::qemu::{self, Emulator, End};
use crate::stack;

pub const EXPECTED: &str = "firmware/self-test.out";

/// Runs the image of each board in QEMU and compares.
pub fn run(root: &Path) -> Result<()> {
    let expected = fs::read_to_string(root.join(EXPECTED)).context(EXPECTED)?;
    for board in Board::ALL {
        match qemu::cannot_run(board)? {
            Some(reason) => println!("{reason}"),
            None => run_on(board, root, &expected)?,
        }
    }
    Ok(())
}

fn run_on(board: Board, root: &Path, expected: &str) -> Result<()> {
    let name = board.name();
    let image = board.self_test(root)?;
    let End {
        status,
        output,
        stack,
    } = Emulator::start(board, &image, &[])?.wait()?;

    let differences = differences(expected, &String::from_utf8_lossy(&output));
    for line in &differences {
        println!("{line}");
    }
    ensure!(
        differences.is_empty(),
        "{name}: differs from {EXPECTED}, see above"
    );
    ensure!(status.success(), "{name}: QEMU: {status}");
    ensure!(stack <= stack::MOST, "{name}: {stack} bytes of stack");
    println!(
        "{name}: {} lines as in {EXPECTED}; {stack} bytes of stack",
        expected.lines().count()
    );
    Ok(())
}

/// Writes the expected lines as the host works them out.
pub fn bless(root: &Path) -> Result<()> {
    let mut text = String::new();
    self_test::run(&mut text).context("self-test")?;
    fs::write(root.join(EXPECTED), text).context(EXPECTED)?;
    println!("{EXPECTED}: written");
    Ok(())
}

/// Lines that differ, each as it should be and as it is.
pub fn differences(expected: &str, found: &str) -> Vec<String> {
    let (mut expected_lines, mut found_lines) = (expected.lines(), found.lines());
    let mut differences = Vec::new();
    for number in 1.. {
        let pair = (expected_lines.next(), found_lines.next());
        if pair == (None, None) {
            break;
        }
        if pair.0 != pair.1 {
            for (sign, line) in [("-", pair.0), ("+", pair.1)] {
                differences.extend(line.map(|line| format!("{number}: {sign} {line}")));
            }
        }
    }
    differences
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shows_each_line_that_differs() {
        assert_eq!(differences("a\nb\n", "a\nb\n"), [""; 0]);
        assert_eq!(differences("a\nb\n", "a\nc\n"), ["2: - b", "2: + c"]);
        assert_eq!(differences("a\nb\n", "a\n"), ["2: - b"]);
        assert_eq!(differences("", "a\n"), ["1: + a"]);
    }
}
