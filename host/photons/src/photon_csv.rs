//! Recorded photons from a CSV file with the header `pixel,cycle,bin`.

use std::io::{BufRead, BufReader, Read};

use anyhow::{Context, Result, bail, ensure};

use crate::input::Input;
use crate::photon_list::{PhotonReader, RawPhoton};

/// Rows are shorter. A longer line is not read to its end.
const LINE_BYTES: u64 = 256;

/// Reads the rows of a file.
pub struct CsvReader {
    input: Input,
    file: BufReader<Box<dyn Read>>,
    line: Vec<u8>,
    line_number: u64,
}

impl PhotonReader for CsvReader {
    fn open(input: &Input) -> Result<Self> {
        let name = input;
        let (file, _) = input.open().with_context(|| name.to_string())?;
        let mut rows = Self {
            input: input.clone(),
            file: BufReader::new(file),
            line: Vec::new(),
            line_number: 0,
        };
        let is_there = rows.read_line().with_context(|| rows.place())?;
        ensure!(is_there, "{name}:1: the file is empty");
        // Some spreadsheets begin a file with a byte order mark.
        let header = rows.text().unwrap_or("bytes that are not UTF-8");
        let header = header.strip_prefix('\u{feff}').unwrap_or(header);
        ensure!(
            header == "pixel,cycle,bin",
            "{name}:1: the header must be pixel,cycle,bin, not {header:?}"
        );
        Ok(rows)
    }

    fn next(&mut self) -> Result<Option<RawPhoton>> {
        loop {
            if !self.read_line()? {
                return Ok(None);
            }
            if let Some(photon) = plain(self.bytes()) {
                return Ok(Some(photon));
            }
            // Blank lines are skipped.
            if !self.text().is_ok_and(str::is_empty) {
                return self.parse().map(Some);
            }
        }
    }

    fn place(&self) -> String {
        format!("{}:{}", self.input, self.line_number)
    }
}

impl CsvReader {
    /// Reads the next line. Returns `false` at the end of the file.
    fn read_line(&mut self) -> Result<bool> {
        self.line.clear();
        self.line_number += 1;
        let mut limited = self.file.by_ref().take(LINE_BYTES);
        Ok(limited.read_until(b'\n', &mut self.line)? > 0)
    }

    /// The line without its line break.
    fn bytes(&self) -> &[u8] {
        let ([line @ .., b'\r', b'\n'] | [line @ .., b'\n' | b'\r'] | line) = &*self.line;
        line
    }

    fn text(&self) -> Result<&str> {
        str::from_utf8(self.bytes()).ok().context("not text")
    }

    /// The photon of any row, or what is wrong with it.
    fn parse(&self) -> Result<RawPhoton> {
        let text = self.text()?;
        let mut fields = text.split(',');
        let (Some(pixel), Some(cycle), Some(bin), None) =
            (fields.next(), fields.next(), fields.next(), fields.next())
        else {
            bail!("{} fields, not 3", text.split(',').count());
        };
        let number = |name: &str, text: &str| {
            let digits = text.bytes().all(|byte| byte.is_ascii_digit());
            let number = text.parse::<u64>().ok().filter(|_| digits);
            number.with_context(|| format!("{name} {text:?} is not a whole number from 0"))
        };
        Ok([
            number("pixel", pixel)?,
            number("cycle", cycle)?,
            number("bin", bin)?,
        ])
    }
}

/// The photon of a row of three numbers of up to 19 digits, nothing else: most rows, in half of the time.
fn plain(line: &[u8]) -> Option<RawPhoton> {
    let mut photon = RawPhoton::default();
    let mut fields = photon.iter_mut();
    let (mut field, mut digits) = (fields.next()?, 0);
    for &byte in line {
        match byte {
            b'0'..=b'9' if digits < 19 => {
                *field = 10 * *field + u64::from(byte - b'0');
                digits += 1;
            }
            b',' if digits > 0 => (field, digits) = (fields.next()?, 0),
            _ => return None,
        }
    }
    (digits > 0 && fields.next().is_none()).then_some(photon)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reader(line: &str) -> CsvReader {
        CsvReader {
            input: Input::File("photons.csv".into()),
            file: BufReader::new(Box::new(std::io::empty())),
            line: line.into(),
            line_number: 1,
        }
    }

    proptest! {
        #[test]
        fn a_plain_row_is_the_photon_that_any_row_is(line in prop_oneof![
            "[0-9]{1,20},[0-9]{1,20},[0-9]{1,20}",
            "[0-9,. +x-]{0,12}",
        ]) {
            if let Some(photon) = plain(line.as_bytes()) {
                prop_assert_eq!(reader(&line).parse().unwrap(), photon);
            } else {
                let is_long = line.split(',').any(|field| field.len() > 19);
                prop_assert!(is_long || reader(&line).parse().is_err());
            }
        }
    }
}
