//! Recorded photons from a structured `.npy` array with the fields `pixel`, `cycle` and `bin`,
//! integers of any type in any order. Other fields are ignored. An array of integers with three columns is the
//! same: pixel, cycle and bin.

use std::io::{BufReader, Read};

use anyhow::{Context, Result, bail, ensure};

use super::header::{Element, Elements, Field, Header, read_all};
use crate::photons::input::Input;
use crate::photons::photon_list::{PhotonReader, RawPhoton};

/// The fields of a photon.
const NAMES: [&str; 3] = ["pixel", "cycle", "bin"];
/// Records read at a time.
const BLOCK: usize = 1 << 13;

/// An integer field of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct IntegerField {
    offset: usize,
    is_big_endian: bool,
    /// How many of 64 bits the type does not have.
    unused: u32,
    is_signed: bool,
}

impl IntegerField {
    fn new(offset: usize, field: &Field) -> Result<Self> {
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

    /// The value in the record at the start of `bytes`, which must be seven bytes longer than the
    /// record.
    #[inline(always)]
    fn value(&self, bytes: &[u8]) -> Option<u64> {
        let bytes = *bytes[self.offset..].first_chunk::<8>()?;
        // The highest bit of the value becomes bit 63.
        let value = match self.is_big_endian {
            true => u64::from_be_bytes(bytes),
            false => u64::from_le_bytes(bytes) << self.unused,
        };
        let is_negative = self.is_signed && value >> 63 == 1;
        (!is_negative).then_some(value >> self.unused)
    }
}

/// The records of a file.
pub struct RecordReader {
    input: Input,
    file: BufReader<Box<dyn Read>>,
    numbers: [IntegerField; 3],
    record: usize,
    /// Some records, and eight more bytes.
    block: Vec<u8>,
    /// The offset of the next record in the block, and the end of the last.
    next: usize,
    end: usize,
    /// Records before the block.
    before: u64,
    /// Records after it.
    after: u64,
}

/// The fields that are ignored, if the elements are photons. Those of an array whose axes have names are not,
/// unless they have fields.
#[must_use]
pub fn other_fields(header: &Header, has_axes: bool) -> Option<Vec<String>> {
    let Elements::Records(fields) = &header.elements else {
        return (is_triples(header) && !has_axes).then(Vec::new);
    };
    let names = fields.iter().map(|field| field.name.clone());
    // Padding has no name.
    let others = names.filter(|name| !name.is_empty() && !NAMES.contains(&name.as_str()));
    Some(others.collect())
}

/// Whether it is an array of photons, a row each: the integers pixel, cycle and bin. No histogram has three bins.
fn is_triples(header: &Header) -> bool {
    let Elements::Plain(element) = &header.elements else {
        return false;
    };
    matches!(header.shape[..], [_, 3]) && element.integer().is_some()
}

/// The fields of the rows of [`is_triples`].
fn fields_of_triple(element: &Element) -> Vec<Field> {
    let bytes = element.integer().map_or(0, |(bytes, _)| bytes.into());
    let field = |name: &str| Field {
        name: name.to_owned(),
        text: element.to_string(),
        bytes,
        element: Some(element.clone()),
    };
    NAMES.map(field).into()
}

impl RecordReader {
    fn open_input(input: &Input) -> Result<Self> {
        let (file, length) = input.open()?;
        let mut file = BufReader::with_capacity(1 << 16, file);
        let header = Header::read(&mut file, length)?;
        let (records, fields) = match (&header.elements, &header.shape[..]) {
            (Elements::Records(fields), &[records]) => (records, fields.clone()),
            (Elements::Records(_), shape) => {
                bail!("a list of photons has one axis, not {shape:?}")
            }
            (Elements::Plain(element), &[records, _]) if is_triples(&header) => {
                ensure!(
                    !header.fortran || records <= 1,
                    "the photons are in Fortran order; save numpy.ascontiguousarray of them"
                );
                (records, fields_of_triple(element))
            }
            (Elements::Plain(_), _) => bail!("the elements are not records"),
        };
        let record = size(&fields)?;
        Ok(Self {
            input: input.clone(),
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

    /// Reads the next block. Returns `false` at the end.
    #[cold]
    fn read_block(&mut self) -> Result<bool> {
        self.before += (self.end / self.record) as u64;
        let records = usize::try_from(self.after).map_or(BLOCK, |after| after.min(BLOCK));
        self.next = 0;
        self.end = records * self.record;
        read_all(&mut self.file, &mut self.block[..self.end])?;
        self.after -= records as u64;
        Ok(records > 0)
    }
}

impl PhotonReader for RecordReader {
    fn open(input: &Input) -> Result<Self> {
        Self::open_input(input).with_context(|| input.to_string())
    }

    #[inline(always)]
    fn next(&mut self) -> Result<Option<RawPhoton>> {
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
        format!("{}: record {last}", self.input)
    }
}

fn size(fields: &[Field]) -> Result<usize> {
    // The header holds that the sum is no larger than 64 bits hold.
    let bytes: u64 = fields.iter().map(|field| field.bytes).sum();
    ensure!(
        (1..=4096).contains(&bytes),
        "records of {bytes} bytes: must be at most 4096"
    );
    Ok(usize::try_from(bytes)?)
}

fn numbers(fields: &[Field]) -> Result<[IntegerField; 3]> {
    let mut found = [None; 3];
    let mut offset = 0;
    for field in fields {
        if let Some(place) = NAMES.iter().position(|known| *known == field.name) {
            found[place] = Some(IntegerField::new(offset, field)?);
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
            let number = IntegerField::new(0, &field).unwrap();
            assert_eq!(number.value(&bytes), expected, "{descr}");
        }
    }
}
