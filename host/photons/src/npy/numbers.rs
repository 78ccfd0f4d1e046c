//! Pictures: integers or floats of an `.npy` file.

use anyhow::{Context, Result, bail, ensure};

use super::header::{Array, Number};
use crate::input::Input;

/// The numbers of a picture.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Lengths of the axes; the first is the rows.
    pub shape: Vec<u64>,
    /// The type of the elements.
    pub element: ElementKind,
    /// All elements; the last axis changes fastest. Integers above 2^53 are rounded.
    pub values: Vec<f64>,
}

/// The type of the elements of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// 32 or 64 bits.
    Float,
    /// 8 bits, unsigned.
    Byte,
    /// Any other integer.
    Integer,
}

/// The most elements of a picture: 4096 by 4096 in three colours.
const MOST_NUMBERS: u64 = 3 << 24;

/// Reads a picture of floats of 16, 32 or 64 bits, or of integers, little- or big-endian.
///
/// # Errors
/// Returns what is wrong with the file, after its name.
pub fn read(input: &Input) -> Result<Numbers> {
    numbers_of(input).with_context(|| input.to_string())
}

fn numbers_of(input: &Input) -> Result<Numbers> {
    let array = Array::open(input)?;
    let (shape, fortran) = (array.shape.clone(), array.fortran);
    ensure!(
        !fortran || shape.len() < 2,
        "the array is in Fortran order; write it with numpy.ascontiguousarray"
    );
    let count: u64 = shape.iter().product();
    ensure!(count > 0, "the array {shape:?} is empty");
    ensure!(
        count <= MOST_NUMBERS,
        "{count} elements: must be at most {MOST_NUMBERS}"
    );
    let kind = match (array.element.integer(), array.element.float()) {
        (_, Some(_)) => ElementKind::Float,
        (Some((1, false)), _) => ElementKind::Byte,
        (Some(_), _) => ElementKind::Integer,
        (None, None) => bail!(
            "elements are {}: must be integers, or floats of 32 or 64 bits; convert them with \
             .astype(numpy.float32)",
            array.element
        ),
    };
    let values = array.elements(|_, number| {
        Ok(match number {
            Number::Integer(value) => value as f64,
            Number::Float(value) => value,
        })
    })?;
    Ok(Numbers {
        shape,
        element: kind,
        values,
    })
}
