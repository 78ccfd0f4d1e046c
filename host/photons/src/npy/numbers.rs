//! Pictures: integers or floats of an `.npy` file.

use anyhow::{Context, Result, bail, ensure};

use super::header::{Array, Number};
use crate::medium::Medium;

/// The numbers of a picture.
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
pub fn read(medium: &Medium) -> Result<Numbers> {
    numbers_of(medium).with_context(|| medium.to_string())
}

fn numbers_of(medium: &Medium) -> Result<Numbers> {
    let array = Array::open(medium)?;
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
        (_, Some(_)) => Element::Float,
        (Some((1, false)), _) => Element::Byte,
        (Some(_), _) => Element::Integer,
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
