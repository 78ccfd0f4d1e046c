//! Pictures: integers or floats of an `.npy` file.

use anyhow::{Context, Result, bail, ensure};

use super::header::{Array, Header, Number};
use crate::photons::input::Input;

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
    let element = array.element()?;
    let Header { shape, fortran, .. } = &array.header;
    let (shape, fortran) = (shape.clone(), *fortran);
    let count: u64 = shape.iter().product();
    ensure!(count > 0, "the array {shape:?} is empty");
    ensure!(
        count <= MOST_NUMBERS,
        "{count} elements: must be at most {MOST_NUMBERS}"
    );
    let kind = match (element.integer(), element.float()) {
        (_, Some(_)) => ElementKind::Float,
        (Some((1, false)), _) => ElementKind::Byte,
        (Some(_), _) => ElementKind::Integer,
        (None, None) => bail!(
            "elements are {element}: must be integers, or floats of 32 or 64 bits; convert them with \
             .astype(numpy.float32)"
        ),
    };
    let mut values = Vec::new();
    let value = |number| {
        Ok(match number {
            Number::Integer(value) => value as f64,
            Number::Float(value) => value,
        })
    };
    array.elements(value, |some| values.extend_from_slice(some))?;
    Ok(Numbers {
        element: kind,
        values: match fortran {
            true => in_c_order(&values, &shape),
            false => values,
        },
        shape,
    })
}

/// The elements of an array whose first axis changes fastest, so that the last one does.
fn in_c_order(values: &[f64], shape: &[u64]) -> Vec<f64> {
    let value = |number: usize| {
        let (mut left, mut stride, mut place) = (number as u64, values.len() as u64, 0);
        for side in shape.iter().rev() {
            stride /= side;
            place += left % side * stride;
            left /= side;
        }
        usize::try_from(place)
            .ok()
            .and_then(|place| values.get(place))
    };
    (0..values.len()).filter_map(value).copied().collect()
}
