//! NumPy `.npy` files: recorded histograms of any integer type, the last axis the bins, the
//! leading axes the pixels in row-major order; and pictures, also of floats.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use npyz::{DType, NpyFile, NpyHeader, Order, TypeChar, TypeStr};

use crate::input::recorded::Capture;
use crate::input::source::Geometry;

/// The histograms of one file: one capture.
#[derive(Clone, Debug)]
pub struct NpyRecording {
    /// The last leading axis is the columns, those before it the rows.
    pub geometry: Geometry,
    /// Length of the last axis.
    pub bins: usize,
    /// All pixels.
    pub capture: Capture,
}

/// Reads `path`. Little- and big-endian integers are read alike; what else NumPy
/// can write is refused.
///
/// # Errors
/// What is wrong with the file, its name first.
pub fn read(path: &Path) -> Result<NpyRecording> {
    read_file(path).with_context(|| path.display().to_string())
}

fn read_file(path: &Path) -> Result<NpyRecording> {
    let array = Array::open(path)?;
    let Some((&bins, leading)) = array.shape.split_last() else {
        bail!("the array has no axis; the last one must be the bins");
    };
    let element = array.element.clone();
    ensure!(
        matches!(element.type_char(), TypeChar::Int | TypeChar::Uint),
        "elements are {element}, not integers; convert them with .astype(numpy.uint32)"
    );
    let leading = leading.to_vec();
    let pixels: u64 = leading.iter().product();
    ensure!(
        pixels > 0 && bins > 0,
        "the array {:?} is empty",
        array.shape
    );
    ensure!(
        pixels <= 65_536,
        "{pixels} pixels; there are 65,536 addresses"
    );
    ensure!(
        (8..=1024).contains(&bins) && bins.is_power_of_two(),
        "{bins} bins on the last axis: must be a power of two from 8 to 1024"
    );

    let npy = array.npy;
    let counts: Vec<u64> = match (element.type_char(), element.size_field()) {
        (TypeChar::Int, 1) => signed(npy.into_vec::<i8>()?)?,
        (TypeChar::Int, 2) => signed(npy.into_vec::<i16>()?)?,
        (TypeChar::Int, 4) => signed(npy.into_vec::<i32>()?)?,
        (TypeChar::Int, 8) => signed(npy.into_vec::<i64>()?)?,
        (TypeChar::Uint, 1) => npy.into_vec::<u8>()?.into_iter().map(u64::from).collect(),
        (TypeChar::Uint, 2) => npy.into_vec::<u16>()?.into_iter().map(u64::from).collect(),
        (TypeChar::Uint, 4) => npy.into_vec::<u32>()?.into_iter().map(u64::from).collect(),
        (TypeChar::Uint, 8) => npy.into_vec::<u64>()?,
        _ => bail!("elements are integers of unknown size"),
    };
    let bins = usize::try_from(bins)?;
    let columns = leading.last().copied().unwrap_or(1);
    Ok(NpyRecording {
        geometry: Geometry::new(u32::try_from(columns)?, u32::try_from(pixels / columns)?),
        bins,
        capture: counts.chunks(bins).map(<[u64]>::to_vec).collect(),
    })
}

/// The numbers of a file that is a picture.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Lengths of the axes, the first that of the rows.
    pub shape: Vec<u64>,
    /// The type of the elements.
    pub element: Element,
    /// All elements, the last axis the fastest. Integers beyond 2^53 are rounded.
    pub values: Vec<f64>,
}

/// What the elements of a picture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// 32 or 64 bits.
    Float,
    /// Of 8 bits without a sign.
    Byte,
    /// Any other integer.
    Integer,
}

/// Most elements of a picture: 4096 by 4096 in three colours.
const MOST_NUMBERS: u64 = 3 << 24;

/// Reads a picture: floats of 32 or 64 bits, or integers, little- or big-endian.
///
/// # Errors
/// What is wrong with the file, its name first.
pub fn read_numbers(path: &Path) -> Result<Numbers> {
    numbers_of(path).with_context(|| path.display().to_string())
}

fn numbers_of(path: &Path) -> Result<Numbers> {
    fn widened<T: Into<f64>>(values: Vec<T>) -> Vec<f64> {
        values.into_iter().map(T::into).collect()
    }
    let Array {
        shape,
        element,
        npy,
    } = Array::open(path)?;
    let count: u64 = shape.iter().product();
    ensure!(count > 0, "the array {shape:?} is empty");
    ensure!(
        count <= MOST_NUMBERS,
        "{count} elements: must be at most {MOST_NUMBERS}"
    );
    let (kind, values) = match (element.type_char(), element.size_field()) {
        (TypeChar::Float, 4) => (Element::Float, widened(npy.into_vec::<f32>()?)),
        (TypeChar::Float, 8) => (Element::Float, npy.into_vec::<f64>()?),
        (TypeChar::Uint, 1) => (Element::Byte, widened(npy.into_vec::<u8>()?)),
        (TypeChar::Uint, 2) => (Element::Integer, widened(npy.into_vec::<u16>()?)),
        (TypeChar::Uint, 4) => (Element::Integer, widened(npy.into_vec::<u32>()?)),
        (TypeChar::Int, 1) => (Element::Integer, widened(npy.into_vec::<i8>()?)),
        (TypeChar::Int, 2) => (Element::Integer, widened(npy.into_vec::<i16>()?)),
        (TypeChar::Int, 4) => (Element::Integer, widened(npy.into_vec::<i32>()?)),
        (TypeChar::Uint, 8) => {
            let wide = npy.into_vec::<u64>()?.into_iter();
            (Element::Integer, wide.map(|value| value as f64).collect())
        }
        (TypeChar::Int, 8) => {
            let wide = npy.into_vec::<i64>()?.into_iter();
            (Element::Integer, wide.map(|value| value as f64).collect())
        }
        _ => bail!(
            "elements are {element}: must be integers, or floats of 32 or 64 bits; convert them \
             with .astype(numpy.float32)"
        ),
    };
    Ok(Numbers {
        shape,
        element: kind,
        values,
    })
}

/// An array whose header has been read, and agrees with the length of its file.
struct Array {
    shape: Vec<u64>,
    element: TypeStr,
    npy: NpyFile<BufReader<File>>,
}

impl Array {
    fn open(path: &Path) -> Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let length = file.get_ref().metadata()?.len();
        check_header(&mut file, length)?;
        file.rewind()?;
        let header = NpyHeader::from_reader(&mut file).map_err(|error| {
            // Of a drawing of where the header is wrong, the first line.
            let reason = error.to_string();
            let reason = reason.lines().next().unwrap_or_default();
            anyhow!("not an .npy file as numpy.save writes it: {reason}")
        })?;
        let data_bytes = length - file.stream_position()?;
        let shape = header.shape().to_vec();
        let DType::Plain(element) = header.dtype() else {
            bail!("elements are records, not numbers");
        };
        ensure!(
            header.order() == Order::C || shape.len() < 2,
            "the array is in Fortran order; write it with numpy.ascontiguousarray"
        );
        // The file's length is the truth: the header must agree with it before
        // anything is allocated for what it claims.
        let elements = shape
            .iter()
            .try_fold(1u64, |product, &axis| product.checked_mul(axis));
        let claimed = elements.and_then(|elements| elements.checked_mul(element.size_field()));
        ensure!(
            claimed == Some(data_bytes),
            "the header claims {shape:?} elements of {element}, which {data_bytes} bytes of data \
             are not"
        );
        Ok(Self {
            shape,
            element,
            npy: NpyFile::with_header(header, file),
        })
    }
}

/// Refuses a header that would take long to read: one longer than the file or
/// than any of plain integers, or nested deeper than a shape in a dictionary.
fn check_header(file: &mut impl Read, length: u64) -> Result<()> {
    let mut start = [0; 10];
    let read = file.read_exact(&mut start);
    ensure!(
        read.is_ok() && start.starts_with(b"\x93NUMPY"),
        "not an .npy file as numpy.save writes it"
    );
    let [.., version, _, low, high] = start;
    let mut bytes = u64::from(u16::from_le_bytes([low, high]));
    if version > 1 {
        let mut more = [0; 2];
        file.read_exact(&mut more)?;
        bytes |= u64::from(u16::from_le_bytes(more)) << 16;
    }
    ensure!(
        bytes <= length.min(4096),
        "the header is longer than one of integers can be"
    );
    let mut depth = 0u32;
    let mut header = Vec::new();
    file.take(bytes).read_to_end(&mut header)?;
    for byte in header {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        ensure!(depth <= 3, "the elements are not plain integers");
    }
    Ok(())
}

/// Counts of a signed type, none of which may be negative.
fn signed<T: Into<i64>>(counts: Vec<T>) -> Result<Vec<u64>> {
    let counts = counts.into_iter().map(T::into).enumerate();
    counts
        .map(|(index, count): (usize, i64)| {
            let unsigned = u64::try_from(count);
            unsigned.map_err(|_| anyhow!("element {index} is negative: {count}"))
        })
        .collect()
}
