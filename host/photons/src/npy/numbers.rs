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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::NpyArray;
    use std::sync::Arc;

    /// NumPy's `arange(24).reshape(shape)`, saved in both orders.
    #[test]
    fn both_orders_give_the_same_numbers() {
        for shape in [vec![24u64], vec![4, 6], vec![2, 3, 4], vec![2, 1, 3, 4]] {
            let lengths = shape
                .iter()
                .map(u64::to_string)
                .collect::<Vec<_>>()
                .join(", ");
            let of = |order: &str, data: Vec<u8>| {
                let text = format!(
                    "{{'descr': '|u1', 'fortran_order': {order}, 'shape': ({lengths},), }}"
                );
                let mut header = b"\x93NUMPY\x01\x00".to_vec();
                header.extend(u16::try_from(text.len()).unwrap().to_le_bytes());
                header.extend(text.bytes());
                let (name, data) = ("a".to_owned(), Box::new(data));
                let array = NpyArray { name, header, data };
                read(&Input::Array(Arc::new(array))).unwrap().values
            };
            // The place in C order of each element in Fortran order.
            let places = (0..24u64).map(|mut left| {
                let (mut place, mut stride) = (0, 24);
                for side in &shape {
                    stride /= side;
                    place += left % side * stride;
                    left /= side;
                }
                u8::try_from(place).unwrap()
            });
            let expected: Vec<f64> = (0..24).map(f64::from).collect();
            assert_eq!(of("False", (0..24).collect()), expected, "{shape:?}");
            assert_eq!(of("True", places.collect()), expected, "{shape:?}");
        }
    }
}
