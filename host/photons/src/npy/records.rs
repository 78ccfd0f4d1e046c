//! Recorded photons from a structured `.npy` array with the fields `pixel`, `cycle` and
//! `bin`: integers of any type, in any order. Other fields are not read.

use std::io::{BufReader, Read};

use anyhow::{Context, Result, bail, ensure};

use super::header::{Elements, Field, Header};
use crate::medium::Medium;
use crate::photon_list::{Row, Rows};

/// The fields of a photon.
const NAMES: [&str; 3] = ["pixel", "cycle", "bin"];
/// Records read at a time.
const BLOCK: usize = 1 << 13;

/// Where a number lies in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Number {
    offset: usize,
    is_big_endian: bool,
    /// Bits of eight bytes that are not of the number.
    unused: u32,
    is_signed: bool,
}

impl Number {
    fn of(offset: usize, field: &Field) -> Result<Self> {
        let integer = field.element.as_ref();
        let integer = integer.and_then(|element| Some((element, element.integer()?)));
        let (element, (size, is_signed)) = integer.with_context(|| {
            format!("field {} is {}: must be an integer", field.name, field.text)
        })?;
        Ok(Self {
            offset,
            is_big_endian: element.is_big_endian(),
            unused: 64 - 8 * size,
            is_signed,
        })
    }

    /// The number of a record at the start of `bytes`, after which there are seven more.
    #[inline(always)]
    fn value(&self, bytes: &[u8]) -> Option<u64> {
        let bytes = *bytes[self.offset..].first_chunk::<8>()?;
        // With its highest bit at the top.
        let value = match self.is_big_endian {
            true => u64::from_be_bytes(bytes) & (u64::MAX << self.unused),
            false => u64::from_le_bytes(bytes) << self.unused,
        };
        let is_negative = self.is_signed && value >> 63 == 1;
        (!is_negative).then_some(value >> self.unused)
    }
}

/// The records of a file.
pub struct Records {
    medium: Medium,
    file: BufReader<Box<dyn Read>>,
    numbers: [Number; 3],
    record: usize,
    /// Some records, and eight bytes.
    block: Vec<u8>,
    /// Where in it the next record begins, and where the last ends.
    next: usize,
    end: usize,
    /// Records before the block.
    before: u64,
    /// Records after it.
    after: u64,
}

/// The fields that are not read, if the file's elements are records.
///
/// # Errors
/// If it is no `.npy` file; its name first.
pub fn other_fields(medium: &Medium) -> Result<Option<Vec<String>>> {
    let header = || {
        let (file, length) = medium.open()?;
        Header::read(&mut BufReader::new(file), length)
    };
    let header = header().with_context(|| medium.to_string())?;
    let Elements::Records(fields) = header.elements else {
        return Ok(None);
    };
    let names = fields.into_iter().map(|field| field.name);
    // Padding has no name.
    let others = names.filter(|name| !name.is_empty() && !NAMES.contains(&name.as_str()));
    Ok(Some(others.collect()))
}

impl Records {
    fn of_medium(medium: &Medium) -> Result<Self> {
        let (file, length) = medium.open()?;
        let mut file = BufReader::with_capacity(1 << 16, file);
        let header = Header::read(&mut file, length)?;
        let &[records] = &header.shape[..] else {
            bail!("a list of photons has one axis, not {:?}", header.shape);
        };
        let Elements::Records(fields) = header.elements else {
            bail!("the elements are no records");
        };
        let record = size(&fields)?;
        Ok(Self {
            medium: medium.clone(),
            file,
            numbers: numbers(&fields)?,
            record,
            block: vec![0; BLOCK * record + 8],
            next: 0,
            end: 0,
            before: 0,
            after: records,
        })
    }

    /// Reads on; `false` at the end.
    #[cold]
    fn read_block(&mut self) -> Result<bool> {
        self.before += (self.end / self.record) as u64;
        let records = usize::try_from(self.after).map_or(BLOCK, |after| after.min(BLOCK));
        self.next = 0;
        self.end = records * self.record;
        self.file
            .read_exact(&mut self.block[..self.end])
            .context("the file became shorter while it was read")?;
        self.after -= records as u64;
        Ok(records > 0)
    }
}

impl Rows for Records {
    fn open(medium: &Medium) -> Result<Self> {
        Self::of_medium(medium).with_context(|| medium.to_string())
    }

    #[inline(always)]
    fn next(&mut self) -> Result<Option<Row>> {
        if self.next == self.end && !self.read_block()? {
            return Ok(None);
        }
        let bytes = &self.block[self.next..];
        self.next += self.record;
        let [pixel, cycle, bin] = &self.numbers;
        match (pixel.value(bytes), cycle.value(bytes), bin.value(bytes)) {
            (Some(pixel), Some(cycle), Some(bin)) => Ok(Some([pixel, cycle, bin])),
            _ => bail!("a number is negative"),
        }
    }

    fn place(&self) -> String {
        let read = self.before + (self.next / self.record) as u64;
        let last = read.saturating_sub(1);
        format!("{}: record {last}", self.medium)
    }
}

fn size(fields: &[Field]) -> Result<usize> {
    let mut sizes = fields.iter().map(|field| field.bytes);
    let bytes = sizes.try_fold(0u64, u64::checked_add);
    let bytes = bytes.context("records of no fixed size")?;
    ensure!(
        (1..=4096).contains(&bytes),
        "records of {bytes} bytes: must be at most 4096"
    );
    Ok(usize::try_from(bytes)?)
}

fn numbers(fields: &[Field]) -> Result<[Number; 3]> {
    let mut found = [None; 3];
    let mut offset = 0;
    for field in fields {
        if let Some(place) = NAMES.iter().position(|wanted| *wanted == field.name) {
            found[place] = Some(Number::of(offset, field)?);
        }
        offset += usize::try_from(field.bytes)?;
    }
    let [Some(pixel), Some(cycle), Some(bin)] = found else {
        let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
        bail!(
            "the records have the fields {}: must have pixel, cycle and bin",
            names.join(", ")
        );
    };
    Ok([pixel, cycle, bin])
}

#[cfg(test)]
mod tests {
    use super::super::header::Element;
    use super::*;

    #[test]
    fn numbers_of_every_size_and_order_are_read() {
        let bytes = [0x81, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x88, 0, 0, 0, 0];
        for (descr, expected) in [
            ("|u1", Some(0x81)),
            ("|i1", None),
            ("<u2", Some(0x0281)),
            (">u2", Some(0x8102)),
            ("<i2", Some(0x0281)),
            (">i2", None),
            ("<u4", Some(0x0403_0281)),
            (">u4", Some(0x8102_0304)),
            ("<u8", Some(0x8807_0605_0403_0281)),
            (">u8", Some(0x8102_0304_0506_0788)),
            ("<i8", None),
        ] {
            let element = Element::parse(descr);
            let field = Field {
                name: "bin".to_owned(),
                text: descr.to_owned(),
                bytes: 8,
                element,
            };
            let number = Number::of(0, &field).unwrap();
            assert_eq!(number.value(&bytes), expected, "{descr}");
        }
    }
}
