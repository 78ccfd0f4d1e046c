//! The golden vectors: the lines of `dtof_firmware::self_test`, compared as they are
//! printed with those the host writes.

use core::fmt::{self, Write};

use dtof_firmware::self_test;

/// The lines as the host writes them.
pub const EXPECTED: &[u8] = include_bytes!("../../firmware/self-test.out");

/// Prints all lines and a verdict: whether they are the expected ones.
///
/// # Errors
/// The errors of `out`.
pub fn run(expected: &[u8], out: &mut impl Write) -> Result<bool, fmt::Error> {
    let mut lines = Lines {
        out,
        rest: expected,
        number: 1,
        is_right: true,
        wrong: 0,
    };
    self_test::run(&mut lines)?;
    let all = lines.wrong == 0 && lines.rest.is_empty();
    let verdict = if all { "ok" } else { "WRONG" };
    writeln!(out, "golden {verdict}")?;
    Ok(all)
}

/// Passes on what is written and compares it.
struct Lines<'a, W> {
    out: &'a mut W,
    /// The bytes expected next.
    rest: &'a [u8],
    /// The number of the line being written.
    number: u32,
    /// Whether this line is right so far.
    is_right: bool,
    /// Lines that are not as expected.
    wrong: u32,
}

impl<W: Write> Lines<'_, W> {
    fn next_line(&mut self) -> fmt::Result {
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let (left, rest) = match end {
            Some(end) => self.rest.split_at(end + 1),
            None => (self.rest, &[][..]),
        };
        if !self.is_right || left != b"\n" {
            self.wrong += 1;
            writeln!(self.out, "vector {} WRONG", self.number)?;
        }
        self.rest = rest;
        self.number += 1;
        self.is_right = true;
        Ok(())
    }
}

impl<W: Write> Write for Lines<'_, W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for part in text.split_inclusive('\n') {
            self.out.write_str(part)?;
            let line = part.strip_suffix('\n').unwrap_or(part);
            match self.rest.strip_prefix(line.as_bytes()) {
                Some(rest) if self.is_right => self.rest = rest,
                _ => self.is_right = false,
            }
            if line.len() < part.len() {
                self.next_line()?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::string::String;
    use std::vec::Vec;

    use super::*;

    fn verdict(expected: &[u8]) -> (bool, String) {
        let mut text = String::new();
        let all = run(expected, &mut text).unwrap();
        (all, text)
    }

    #[test]
    fn the_expected_lines_pass_as_they_are() {
        let (all, text) = verdict(EXPECTED);
        let expected = core::str::from_utf8(EXPECTED).unwrap();
        assert!(all);
        assert_eq!(text.strip_prefix(expected), Some("golden ok\n"));
    }

    #[test]
    fn a_wrong_byte_fails_its_line_alone() {
        for (number, line) in EXPECTED.split_inclusive(|&byte| byte == b'\n').enumerate() {
            let before: usize = EXPECTED
                .split_inclusive(|&byte| byte == b'\n')
                .take(number)
                .map(<[u8]>::len)
                .sum();
            for place in [0, line.len() / 2, line.len() - 2] {
                let mut wrong = Vec::from(EXPECTED);
                wrong[before + place] ^= 1;
                let (all, text) = verdict(&wrong);
                assert!(!all);
                assert_eq!(text.matches("WRONG").count(), 2, "{number} {place}");
                let named = std::format!("vector {} WRONG\n", number + 1);
                assert!(text.contains(&named), "{number} {place}");
            }
        }
    }

    #[test]
    fn a_line_too_few_or_too_many_fails() {
        assert!(!verdict(&EXPECTED[..EXPECTED.len() - 4]).0);
        let mut more = Vec::from(EXPECTED);
        more.extend(b"end\n");
        assert!(!verdict(&more).0);
        assert!(!verdict(b"").0);
    }
}
