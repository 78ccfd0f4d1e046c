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
    fn text(&self) -> Result<&str> {
        let ([line @ .., b'\r', b'\n'] | [line @ .., b'\n' | b'\r'] | line) = &*self.line;
        str::from_utf8(line).ok().context("not text")
    }

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
