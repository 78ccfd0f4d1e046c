//! Recorded histograms: an array of whole numbers, one axis of which is the bins.

use std::io::Read;

use anyhow::{Context, Result, anyhow, ensure};

use super::header::{Array, Number};
use crate::axes::{Axes, Layout, index_of};
use crate::bins::MOST_BINS;
use crate::medium::Medium;
use dtof_options::Refused;

/// The histograms of one array.
#[derive(Clone, Debug)]
pub struct Histograms {
    /// Where they lie.
    pub layout: Layout,
    /// Length of the first axis.
    pub first: usize,
    /// A histogram a pixel, in the order of addresses.
    pub pixels: Vec<Vec<u64>>,
}

/// Reads the array of an `.npy` file, or one in memory. Integers of every size and floats that are whole
/// numbers are read, little- and big-endian, in C and in Fortran order.
///
/// # Errors
/// What is wrong with the file, its name first.
pub fn read(medium: &Medium, axes: Option<&Axes>) -> Result<Histograms> {
    let array = Array::open(medium).and_then(|array| of_array(array, axes));
    array.with_context(|| medium.to_string())
}

/// The same of an array whose header has been read.
pub(super) fn of_array<R: Read>(array: Array<R>, axes: Option<&Axes>) -> Result<Histograms> {
    let (shape, fortran) = (array.shape.clone(), array.fortran);
    let layout = Layout::new(&shape, fortran, axes)?;
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
            Number::Float(count) => whole(count),
        };
        count.map_err(|why| anyhow!("element {} is {why}", index_of(place, &shape, fortran)))
    })?;
    Ok(Histograms {
        first: usize::try_from(shape[0])?,
        pixels: layout.histograms(&counts).collect(),
        layout,
    })
}

fn unsigned(count: i128) -> Result<u64, String> {
    u64::try_from(count).map_err(|_| format!("negative: {count}"))
}

/// Above 2^53 not every whole number is a float: such a count is no count.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number from 0 to 2^53"
)]
fn whole(count: f64) -> Result<u64, String> {
    const MOST: f64 = (1u64 << 53) as f64;
    if count < 0.0 {
        Err(format!("negative: {count}"))
    } else if count.fract() == 0.0 && count <= MOST {
        Ok(count as u64)
    } else {
        Err(format!("{count}, which is no count of photons"))
    }
}
