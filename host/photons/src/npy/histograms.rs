//! Recorded histograms: an array of whole numbers with an axis of bins.

use std::io::Read;

use anyhow::{Context, Result, anyhow, bail, ensure};

use super::header::{Array, Number};
use crate::axes::{Axes, AxisLayout, index_of};
use crate::bins::MOST_BINS;
use crate::input::Input;
use dtof_options::Refused;

/// The histograms of one array.
#[derive(Clone, Debug)]
pub struct Histograms {
    /// The layout in the file.
    pub layout: AxisLayout,
    /// Lengths of the axes but the last.
    pub axes: Vec<usize>,
    /// One histogram a pixel, in the order of addresses.
    pub pixels: Vec<Vec<u64>>,
}

/// Reads an `.npy` file, or an array in memory. The elements may be integers of any size or floats
/// that are whole numbers, little- or big-endian, in C or Fortran order.
///
/// # Errors
/// Returns what is wrong with the file, after its name.
pub fn read(input: &Input, axes: Option<&Axes>) -> Result<Histograms> {
    let array = Array::open(input).and_then(|array| read_array(array, axes));
    array.with_context(|| input.to_string())
}

/// Reads the elements of an array whose header has been read.
pub(super) fn read_array<R: Read>(array: Array<R>, axes: Option<&Axes>) -> Result<Histograms> {
    let (shape, fortran) = (array.shape.clone(), array.fortran);
    match (&shape[..], axes) {
        ([_, 3], None) if array.element.integer().is_none() => bail!(
            "elements are {}: photons are rows of three integers: pixel, cycle and bin; convert them with \
             .astype(numpy.int64)",
            array.element
        ),
        ([_, columns @ 4..8], None) => bail!(Refused::input(format!(
            "{columns} bins: must be from 8 to {MOST_BINS}; photons are rows of three: pixel, cycle and bin"
        ))),
        _ => {}
    }
    let layout = AxisLayout::new(&shape, fortran, axes)?;
    ensure!(
        layout.bins() <= MOST_BINS,
        Refused::input(format!(
            "{} bins: must be at most {MOST_BINS} (`axes` says which axis they are)",
            layout.bins()
        ))
    );
    ensure!(
        array.element.integer().is_some() || array.element.float().is_some(),
        "elements are {}: must be integers, or floats that are whole numbers; convert them with \
         .astype(numpy.uint32)",
        array.element
    );
    let counts = array.elements(|place, number| {
        let count = match number {
            Number::Integer(count) => unsigned(count),
            Number::Float(count) => whole_count(count),
        };
        count.map_err(|why| anyhow!("element {} is {why}", index_of(place, &shape, fortran)))
    })?;
    Ok(Histograms {
        axes: shape[..shape.len() - 1]
            .iter()
            .map(|&length| usize::try_from(length))
            .collect::<Result<_, _>>()?,
        pixels: layout.histograms(&counts).collect(),
        layout,
    })
}

fn unsigned(count: i128) -> Result<u64, String> {
    u64::try_from(count).map_err(|_| format!("negative: {count}"))
}

/// Above 2^53, a float is not an exact count.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number from 0 to 2^53"
)]
fn whole_count(count: f64) -> Result<u64, String> {
    const MOST: f64 = (1u64 << 53) as f64;
    if count < 0.0 {
        Err(format!("negative: {count}"))
    } else if count.fract() == 0.0 && count <= MOST {
        Ok(count as u64)
    } else {
        Err(format!("{count}, which is not a number of photons"))
    }
}
