//! `cargo xtask self-test`: the results of the core on the targets. A test of `dtof-firmware`
//! compares them with the host's.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::emulator;
use crate::firmware::{Board, Build};

pub const EXPECTED: &str = "firmware/self-test.out";

/// Runs the image of each board in its emulator and compares.
pub fn check(root: &Path) -> Result<()> {
    let expected = fs::read_to_string(root.join(EXPECTED)).context(EXPECTED)?;
    for board in Board::ALL {
        if let Some(reason) = emulator::cannot_run(board)? {
            println!("{reason}");
            continue;
        }
        let name = board.name();
        let found = lines(board, root)?;
        let differences = differences(&expected, &found);
        for line in &differences {
            println!("{line}");
        }
        ensure!(
            differences.is_empty(),
            "{name}: differs from {EXPECTED}, see above"
        );
        let lines = expected.lines().count();
        println!("{name}: {lines} lines as in {EXPECTED}");
    }
    Ok(())
}

/// Writes the lines that the target prints.
pub fn bless(root: &Path) -> Result<()> {
    let lines = lines(Board::Mps2An386, root)?;
    fs::write(root.join(EXPECTED), lines).context(EXPECTED)?;
    println!("{EXPECTED}: written");
    Ok(())
}

/// The lines that the image of a board prints.
fn lines(board: Board, root: &Path) -> Result<String> {
    let image = board.build_bare(root, Build::SelfTest)?;
    let (status, output) = emulator::run(board, &image, &[])?;
    let name = board.name();
    ensure!(status.success(), "{name}: emulator: {status}: {output}");
    Ok(output)
}

/// Lines that differ, each as expected and as found.
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
