//! Pictures: integers or floats of an `.npy` file.

use anyhow::{Context, Result, bail, ensure};
use npyz::TypeChar;

use super::header::Array;
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
    fn widened<T: Into<f64>>(values: Vec<T>) -> Vec<f64> {
        values.into_iter().map(T::into).collect()
    }
    let Array {
        shape,
        fortran,
        element,
        npy,
    } = Array::open(medium)?;
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
