//! Recorded histograms: an array of whole numbers, one axis of which is the bins.

use std::io::Read;

use anyhow::{Context, Result, anyhow, bail, ensure};
use npyz::{Deserialize, NpyFile, TypeChar};

use super::header::Array;
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
    let Array {
        shape,
        fortran,
        element,
        npy,
    } = array;
    let layout = Layout::new(&shape, fortran, axes)?;
    ensure!(
        layout.bins() <= MOST_BINS,
        Refused::input(format!(
            "{} bins: must be at most {MOST_BINS} (`axes` says which axis they are)",
            layout.bins()
        ))
    );
    let counts = match (element.type_char(), element.size_field()) {
        (TypeChar::Uint, 1) => all(npy, |count: u8| Ok(count.into())),
        (TypeChar::Uint, 2) => all(npy, |count: u16| Ok(count.into())),
        (TypeChar::Uint, 4) => all(npy, |count: u32| Ok(count.into())),
        (TypeChar::Uint, 8) => all(npy, |count: u64| Ok(count)),
        (TypeChar::Int, 1) => all(npy, |count: i8| unsigned(count.into())),
        (TypeChar::Int, 2) => all(npy, |count: i16| unsigned(count.into())),
        (TypeChar::Int, 4) => all(npy, |count: i32| unsigned(count.into())),
        (TypeChar::Int, 8) => all(npy, unsigned),
        (TypeChar::Float, 4) => all(npy, |count: f32| whole(count.into())),
        (TypeChar::Float, 8) => all(npy, whole),
        _ => bail!(
            "elements are {element}: must be integers, or floats that are whole numbers; convert \
             them with .astype(numpy.uint32)"
        ),
    };
    let counts = counts.map_err(|wrong| match wrong {
        Wrong::Read(error) => error,
        Wrong::Element(place, why) => {
            anyhow!("element {} is {why}", index_of(place, &shape, fortran))
        }
    })?;
    Ok(Histograms {
        first: usize::try_from(shape[0])?,
        pixels: layout.histograms(&counts).collect(),
        layout,
    })
}

/// Why an array is not read.
enum Wrong {
    Read(anyhow::Error),
    /// Which element, and what is wrong with it.
    Element(usize, String),
}

fn all<T: Deserialize, R: Read>(
    npy: NpyFile<R>,
    count: impl Fn(T) -> Result<u64, String>,
) -> Result<Vec<u64>, Wrong> {
    let elements = npy.data::<T>();
    let elements = elements.map_err(|error| Wrong::Read(anyhow!("{error}")))?;
    let counts = elements.enumerate().map(|(place, element)| {
        let element = element.map_err(|error| Wrong::Read(error.into()))?;
        count(element).map_err(|why| Wrong::Element(place, why))
    });
    counts.collect()
}

fn unsigned(count: i64) -> Result<u64, String> {
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
