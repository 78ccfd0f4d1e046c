//! Recorded histograms: an array of whole numbers with an axis of bins.

use std::io::Read;

use anyhow::{Result, bail, ensure};

use super::header::{Array, Header, Number};
use crate::options::Refused;
use crate::photons::axes::{Axes, AxisLayout};
use crate::photons::bins::MOST_BINS;
use crate::photons::histograms::Histograms;

/// The histograms of one array.
#[derive(Clone, Debug)]
pub struct ArrayHistograms {
    /// The layout in the file.
    pub layout: AxisLayout,
    /// Lengths of the axes but the last.
    pub axes: Vec<usize>,
    /// One histogram a pixel, in the order of addresses.
    pub histograms: Histograms,
}

/// Reads the elements of an array: integers of any size, or floats that are whole numbers, little- or big-endian, in C or
/// Fortran order.
///
/// # Errors
/// Returns what is wrong with them.
pub fn read<R: Read>(array: Array<R>, axes: Option<&Axes>) -> Result<ArrayHistograms> {
    let element = array.element()?;
    let Header { shape, fortran, .. } = &array.header;
    match (&shape[..], axes) {
        ([_, 3], None) if element.integer().is_none() => bail!(
            "elements are {element}: photons are rows of three integers: pixel, cycle and bin; convert them with \
             .astype(numpy.int64)"
        ),
        ([_, columns @ 4..8], None) => bail!(Refused::input(format!(
            "{columns} bins: must be from 8 to {MOST_BINS}; photons are rows of three: pixel, cycle and bin"
        ))),
        _ => {}
    }
    let layout = AxisLayout::new(shape, *fortran, axes)?;
    ensure!(
        layout.bins() <= MOST_BINS,
        Refused::input(format!(
            "{} bins: must be at most {MOST_BINS} (`axes` says which axis they are)",
            layout.bins()
        ))
    );
    ensure!(
        element.integer().is_some() || element.float().is_some(),
        "elements are {element}: must be integers, or floats that are whole numbers; convert them with \
         .astype(numpy.uint32)"
    );
    let axes = shape[..shape.len() - 1].iter();
    let axes = axes.map(|&length| usize::try_from(length));
    let axes = axes.collect::<Result<_, _>>()?;
    let count = |number| match number {
        Number::Integer(count) => unsigned(count),
        Number::Float(count) => whole_count(count),
    };
    let mut in_file = Histograms::new(layout.bins());
    array.elements(count, |counts| in_file.extend(counts))?;
    Ok(ArrayHistograms {
        histograms: layout.histograms(in_file),
        axes,
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
