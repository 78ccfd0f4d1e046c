//! The header of an array, held against the length of its file before anything is allocated
//! for what it claims.

use std::io::{BufReader, Read};

use anyhow::{Result, anyhow, bail, ensure};
use npyz::{DType, NpyFile, NpyHeader, Order, TypeStr};

use crate::medium::Medium;

/// A header that agrees with the length of its file.
pub struct Header {
    /// Lengths of the axes.
    pub shape: Vec<u64>,
    /// Whether the first axis is the fastest.
    pub fortran: bool,
    /// What the elements are.
    pub elements: DType,
    header: NpyHeader,
}

impl Header {
    /// Reads the header of a file of `length` bytes; the data comes next.
    ///
    /// # Errors
    /// If it is none, or not that of such a file.
    pub fn read(file: &mut impl Read, length: u64) -> Result<Self> {
        let bytes = header_bytes(file, length)?;
        let header = NpyHeader::from_reader(&bytes[..]).map_err(|error| {
            // Of a drawing of where the header is wrong, the first line.
            let reason = error.to_string();
            let reason = reason.lines().next().unwrap_or_default();
            anyhow!("not an .npy file as numpy.save writes it: {reason}")
        })?;
        let data_bytes = length - bytes.len() as u64;
        let shape = header.shape().to_vec();
        let elements = header.dtype();
        let claimed = elements.num_bytes().and_then(|size| {
            let count = shape
                .iter()
                .try_fold(1u64, |product, &axis| product.checked_mul(axis))?;
            count.checked_mul(size as u64)
        });
        ensure!(
            claimed == Some(data_bytes),
            "the header claims {shape:?} elements of {}, which {data_bytes} bytes of data are not",
            elements.descr()
        );
        Ok(Self {
            shape,
            fortran: header.order() == Order::Fortran,
            elements,
            header,
        })
    }
}

/// An array of plain elements.
pub struct Array<R: Read> {
    /// Lengths of the axes.
    pub shape: Vec<u64>,
    /// Whether the first axis is the fastest.
    pub fortran: bool,
    /// What the elements are.
    pub element: TypeStr,
    /// The data.
    pub npy: NpyFile<R>,
}

impl<R: Read> Array<R> {
    /// Reads the header of a file of `length` bytes.
    ///
    /// # Errors
    /// If it is not that of an array of plain elements.
    pub fn read(mut file: R, length: u64) -> Result<Self> {
        let header = Header::read(&mut file, length)?;
        let DType::Plain(element) = header.elements else {
            bail!("elements are records, not numbers");
        };
        Ok(Self {
            shape: header.shape,
            fortran: header.fortran,
            element,
            npy: NpyFile::with_header(header.header, file),
        })
    }
}

impl Array<BufReader<Box<dyn Read>>> {
    /// The array of an `.npy` file, or one in memory.
    ///
    /// # Errors
    /// If it is not that of an array of plain elements.
    pub fn open(medium: &Medium) -> Result<Self> {
        let (file, length) = medium.open()?;
        Self::read(BufReader::new(file), length)
    }
}

/// The bytes of a header. Refuses one that would take long to read: longer than the file or
/// than any of plain elements, or nested deeper than a record in a dictionary.
fn header_bytes(file: &mut impl Read, length: u64) -> Result<Vec<u8>> {
    let mut bytes = vec![0; 10];
    let read = file.read_exact(&mut bytes);
    ensure!(
        read.is_ok() && bytes.starts_with(b"\x93NUMPY"),
        "not an .npy file as numpy.save writes it"
    );
    let mut more = u64::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    if bytes[6] > 1 {
        let mut high = [0; 2];
        file.read_exact(&mut high)?;
        bytes.extend(high);
        more |= u64::from(u16::from_le_bytes(high)) << 16;
    }
    ensure!(
        more <= length.min(4096),
        "the header is longer than one of numbers can be"
    );
    let start = bytes.len();
    file.take(more).read_to_end(&mut bytes)?;
    let mut depth = 0u32;
    for byte in &bytes[start..] {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        ensure!(depth <= 3, "the elements are not plain numbers");
    }
    Ok(bytes)
}
