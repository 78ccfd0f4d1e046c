//! Recorded photons from a CSV file with the columns `pixel`, `cycle` and `bin`.

use std::io::{BufRead, BufReader, Read};

use anyhow::{Context, Result, bail, ensure};

use crate::photons::input::Input;
use crate::photons::photon_list::{PhotonReader, RawPhoton};

/// Rows are shorter. A longer line is not read to its end, and refused.
const LINE_BYTES: u64 = 4096;

/// Reads the rows of a file.
pub struct CsvReader {
    input: Input,
    file: BufReader<Box<dyn Read>>,
    /// Bytes of the file when it was opened that have not been read.
    left: u64,
    line: Vec<u8>,
    line_number: u64,
    columns: Columns,
}

const NAMES: [&str; 3] = ["pixel", "cycle", "bin"];

/// Where a row has what.
#[derive(Clone, Copy)]
struct Columns {
    separator: char,
    all: usize,
    /// Of the [`NAMES`].
    places: [usize; 3],
}

impl Columns {
    /// The name of a column that a header has more than once.
    fn twice(header: &str) -> Option<&'static str> {
        let is = |name: &str, text: &str| text.trim().eq_ignore_ascii_case(name);
        let number = |name: &str| {
            let names = header.split([',', ';', '\t']);
            names.filter(|text| is(name, text)).count()
        };
        NAMES.into_iter().find(|name| number(name) > 1)
    }

    /// From a header: names in any order and case, between commas, semicolons or tabs. Other columns are left out.
    fn new(header: &str) -> Option<Self> {
        let separator = [',', ';', '\t']
            .into_iter()
            .find(|&one| header.contains(one))?;
        let names: Vec<String> = header
            .split(separator)
            .map(|name| name.trim().to_ascii_lowercase())
            .collect();
        let place = |wanted: &str| {
            let mut found = (0..names.len()).filter(|&place| names[place] == wanted);
            found.next().filter(|_| found.next().is_none())
        };
        let [pixel, cycle, bin] = NAMES.map(place);
        Some(Self {
            separator,
            all: names.len(),
            places: [pixel?, cycle?, bin?],
        })
    }
}

impl PhotonReader for CsvReader {
    fn open(input: &Input) -> Result<Self> {
        let name = input;
        let (file, length) = input.open().with_context(|| name.to_string())?;
        let mut rows = Self {
            input: input.clone(),
            file: BufReader::new(file),
            left: length,
            line: Vec::new(),
            line_number: 0,
            columns: Columns {
                separator: ',',
                all: 3,
                places: [0, 1, 2],
            },
        };
        let is_there = rows.read_line().with_context(|| rows.place())?;
        ensure!(is_there, "{name}:1: the file is empty");
        // Some spreadsheets begin a file with a byte order mark.
        let header = rows.text().unwrap_or("bytes that are not UTF-8");
        let header = header.strip_prefix('\u{feff}').unwrap_or(header);
        let Some(columns) = Columns::new(header) else {
            if let Some(twice) = Columns::twice(header) {
                bail!(
                    "{name}:1: the header must have the columns pixel, cycle and bin once, not {twice} twice"
                );
            }
            bail!(
                "{name}:1: the header must have the columns pixel, cycle and bin, not {header:?}"
            );
        };
        rows.columns = columns;
        Ok(rows)
    }

    fn next(&mut self) -> Result<Option<RawPhoton>> {
        loop {
            if !self.read_line()? {
                return Ok(None);
            }
            if self.columns.all == 3
                && let Some(photon) = plain(self.bytes(), self.columns.separator)
            {
                return Ok(Some(self.columns.places.map(|place| photon[place])));
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
    /// Reads the next line. Returns `false` at the end of the file, which must not be before the end that it had.
    fn read_line(&mut self) -> Result<bool> {
        self.line.clear();
        self.line_number += 1;
        let mut limited = self.file.by_ref().take(LINE_BYTES);
        let read = limited.read_until(b'\n', &mut self.line)?;
        let is_cut = read as u64 == LINE_BYTES && !self.line.ends_with(b"\n");
        ensure!(!is_cut, "a line of more than {LINE_BYTES} bytes");
        self.left = self.left.saturating_sub(read as u64);
        ensure!(
            read > 0 || self.left == 0,
            "the file became shorter while it was read"
        );
        Ok(read > 0)
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
        let Columns {
            separator,
            all,
            places,
        } = self.columns;
        let mut photon = RawPhoton::default();
        let mut fields = 0;
        for (place, text) in self.text()?.split(separator).enumerate() {
            fields += 1;
            let Some(which) = places.iter().position(|&one| one == place) else {
                continue;
            };
            let digits = text.trim();
            let is_number = digits.bytes().all(|byte| byte.is_ascii_digit());
            let number = digits.parse().ok().filter(|_| is_number);
            photon[which] = number.with_context(|| {
                format!("{} {text:?} is not a whole number from 0", NAMES[which])
            })?;
        }
        ensure!(fields == all, "{fields} fields, not {all}");
        Ok(photon)
    }
}

/// The numbers of a row of three of up to 19 digits, and nothing else: most rows, in half of the time.
fn plain(line: &[u8], separator: char) -> Option<[u64; 3]> {
    let mut numbers = [0u64; 3];
    let mut fields = numbers.iter_mut();
    let (mut field, mut digits) = (fields.next()?, 0);
    for &byte in line {
        match byte {
            b'0'..=b'9' if digits < 19 => {
                *field = 10 * *field + u64::from(byte - b'0');
                digits += 1;
            }
            _ if char::from(byte) == separator && digits > 0 => {
                (field, digits) = (fields.next()?, 0);
            }
            _ => return None,
        }
    }
    (digits > 0 && fields.next().is_none()).then_some(numbers)
}

#[cfg(test)]
mod tests;
