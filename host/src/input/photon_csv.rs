//! Recorded photons from a CSV file with the header `pixel,cycle,bin`, in
//! non-decreasing laser cycle.
//!
//! The file is read twice: once to check every row before anything is written,
//! and to learn which pixels there are and when the recording ends; once to
//! replay it, without ever holding more than a slice.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use dtof_core::PixelAddress;

use crate::input::source::{Geometry, Photon, PhotonSource, PixelPhotons, Slice};

/// One row.
#[derive(Clone, Copy, Debug)]
struct Row {
    pixel: u16,
    cycle: u64,
    bin: u16,
}

/// Longer than any row can be; a longer line is not read to its end.
const LINE_BYTES: u64 = 256;

/// The rows of a file, each checked.
struct Rows {
    path: PathBuf,
    file: BufReader<File>,
    line: Vec<u8>,
    line_number: u64,
    bins: usize,
    last_cycle: u64,
}

impl Rows {
    fn open(path: &Path, bins: usize) -> Result<Self> {
        let name = path.display();
        let file = File::open(path).with_context(|| name.to_string())?;
        let kind = file.metadata().with_context(|| name.to_string())?;
        ensure!(kind.is_file(), "{name}: not a file that can be read twice");
        let mut rows = Self {
            path: path.to_owned(),
            file: BufReader::new(file),
            line: Vec::new(),
            line_number: 0,
            bins,
            last_cycle: 0,
        };
        ensure!(rows.read_line()?, "{name}:1: the file is empty");
        // Some spreadsheets begin a file with a byte order mark.
        let header = rows.text().unwrap_or("bytes that are not UTF-8");
        let header = header.strip_prefix('\u{feff}').unwrap_or(header);
        ensure!(
            header == "pixel,cycle,bin",
            "{name}:1: the header must be pixel,cycle,bin, not {header:?}"
        );
        Ok(rows)
    }

    fn next(&mut self) -> Result<Option<Row>> {
        loop {
            if !self.read_line()? {
                return Ok(None);
            }
            // A blank line is no photon and no damage.
            if !self.text().is_ok_and(str::is_empty) {
                break;
            }
        }
        let row = self.parse();
        let row = row.with_context(|| format!("{}:{}", self.path.display(), self.line_number))?;
        self.last_cycle = row.cycle;
        Ok(Some(row))
    }

    /// Reads the next line; `false` at the end of the file.
    fn read_line(&mut self) -> Result<bool> {
        self.line.clear();
        self.line_number += 1;
        let mut limited = self.file.by_ref().take(LINE_BYTES);
        let read = limited.read_until(b'\n', &mut self.line);
        Ok(read.with_context(|| format!("{}:{}", self.path.display(), self.line_number))? > 0)
    }

    /// The line without its end.
    fn text(&self) -> Result<&str> {
        let text = str::from_utf8(&self.line).ok().context("not text")?;
        let text = text.strip_suffix('\n').unwrap_or(text);
        Ok(text.strip_suffix('\r').unwrap_or(text))
    }

    fn parse(&self) -> Result<Row> {
        let fields: Vec<&str> = self.text()?.split(',').collect();
        let &[pixel, cycle, bin] = fields.as_slice() else {
            bail!("{} fields, not 3", fields.len());
        };
        let number = |name: &str, text: &str| {
            let digits = text.bytes().all(|byte| byte.is_ascii_digit());
            let number = text.parse::<u64>().ok().filter(|_| digits);
            number.with_context(|| format!("{name} {text:?} is not a whole number from 0"))
        };
        let pixel = number("pixel", pixel)?;
        let cycle = number("cycle", cycle)?;
        let bin = number("bin", bin)?;
        let Ok(pixel) = u16::try_from(pixel) else {
            bail!("pixel {pixel} is above 65535, the last address");
        };
        if cycle < self.last_cycle {
            bail!("cycle {cycle} comes after cycle {}", self.last_cycle);
        }
        match u16::try_from(bin) {
            Ok(bin) if usize::from(bin) < self.bins => Ok(Row { pixel, cycle, bin }),
            _ => bail!(
                "bin {bin} is past the last of {} bins (see --bins)",
                self.bins
            ),
        }
    }
}

/// A checked photon list.
pub struct PhotonCsv {
    addresses: Vec<PixelAddress>,
    geometry: Geometry,
    cycles: u64,
    not_replayed: u64,
    next_cycle: u64,
    rows: Rows,
    /// Read, but of a later slice.
    ahead: Option<Row>,
}

impl PhotonCsv {
    /// Checks all of `path`, whose photons lie in `bins` bins, to replay its
    /// first `cycles` laser cycles. The recording lasts until the laser cycle
    /// of its last photon. The array has `columns`; without, it is one row.
    ///
    /// # Errors
    /// What is wrong with the file; its name and the line first.
    pub fn open(path: &Path, bins: usize, columns: Option<u32>, cycles: u64) -> Result<Self> {
        let mut rows = Rows::open(path, bins)?;
        let mut pixels = BTreeSet::new();
        let mut not_replayed = 0;
        let mut recorded = 0;
        while let Some(row) = rows.next()? {
            pixels.insert(row.pixel);
            recorded = row.cycle.saturating_add(1);
            if row.cycle >= cycles {
                not_replayed += 1;
            }
        }
        ensure!(!pixels.is_empty(), "{}:2: no photons", path.display());
        let pixels_in_file = u32::from(pixels.last().copied().unwrap_or(0)) + 1;
        let columns = columns.unwrap_or(pixels_in_file);
        let mut rows = Rows::open(path, bins)?;
        Ok(Self {
            geometry: Geometry {
                columns,
                rows: pixels_in_file.div_ceil(columns),
            },
            addresses: pixels.into_iter().map(PixelAddress).collect(),
            cycles: cycles.min(recorded),
            not_replayed,
            next_cycle: 0,
            ahead: rows.next()?,
            rows,
        })
    }
}

impl PhotonSource for PhotonCsv {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn addresses(&self) -> Vec<PixelAddress> {
        self.addresses.clone()
    }

    fn cycles(&self) -> u64 {
        self.cycles
    }

    fn not_replayed(&self) -> u64 {
        self.not_replayed
    }

    fn next_slice(&mut self, cycles: u16) -> Result<Slice> {
        let first_cycle = self.next_cycle;
        self.next_cycle += u64::from(cycles);
        let mut pixels = vec![
            PixelPhotons {
                cycles,
                photons: Vec::new()
            };
            self.addresses.len()
        ];
        while let Some(row) = self
            .ahead
            .take_if(|row| row.cycle < first_cycle + u64::from(cycles))
        {
            let changed = || format!("{} changed while it was read", self.rows.path.display());
            let pixel = self.addresses.binary_search(&PixelAddress(row.pixel));
            let photons = &mut pixels[pixel.ok().with_context(changed)?].photons;
            let cycle = row.cycle.checked_sub(first_cycle).with_context(changed)?;
            photons.push(Photon {
                cycle: u16::try_from(cycle)?,
                code: row.bin,
            });
            self.ahead = self.rows.next()?;
        }
        Ok(Slice {
            first_cycle,
            pixels,
        })
    }
}
