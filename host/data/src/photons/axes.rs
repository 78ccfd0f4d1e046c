//! The meaning of each axis of an array of histograms.

use std::fmt;
use std::str::FromStr;

use anyhow::{Context, Result, ensure};
use dtof_core::Array;

use crate::named_values;
use crate::options::rows::grouped;
use crate::options::{Named, Refused, named};
use crate::photons::histograms::Histograms;

named_values! {
    /// The meaning of an axis, in the order of the address space.
    #[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
    enum Axis {
        /// Captures
        Captures = "captures",
        /// Rows
        Rows = "rows",
        /// Columns
        Columns = "columns",
        /// Bins
        Bins = "bins",
    }
}

/// The names of the axes of an array, in the order of its shape.
///
/// ```
/// use dtof_data::photons::axes::Axes;
///
/// let axes: Axes = "bins,rows,columns".parse().unwrap();
/// assert_eq!(axes.to_string(), "bins,rows,columns");
/// assert!("rows,columns".parse::<Axes>().is_err()); // no bins
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axes(Vec<Axis>);

impl FromStr for Axes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut axes = Vec::new();
        for word in text.split(',') {
            let axis: Axis = named(word.trim())
                .map_err(|_| "must be some of captures, rows, columns, bins".to_owned())?;
            if axes.contains(&axis) {
                return Err(format!("{} is given twice", word.trim()));
            }
            axes.push(axis);
        }
        if !axes.contains(&Axis::Bins) {
            return Err("one axis must be the bins".to_owned());
        }
        Ok(Self(axes))
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        let name = |axis: &Axis| Axis::NAMES[*axis as usize].0;
        let names: Vec<&str> = self.0.iter().map(name).collect();
        formatter.write_str(&names.join(","))
    }
}

/// The elements of an array in its file: the length and the stride of each axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisLayout {
    /// The axes of pixels. The last changes fastest.
    pixels: Vec<(usize, usize)>,
    bins: (usize, usize),
    /// The array of one capture.
    pub array: Array,
    /// The names of columns and rows.
    pub axis_names: [&'static str; 2],
    /// Whether the axes of pixels are surely columns and rows of one capture or of several: they have names, or there
    /// is nothing else that they could be.
    pub is_shape_known: bool,
}

impl AxisLayout {
    /// The layout of an array of `shape`. Without `axes` the last axis is the bins, the one before
    /// it the columns, and all others are rows of one capture.
    ///
    /// # Errors
    /// Fails if there are more pixels than addresses, or if the numbers of axes and names differ.
    pub fn new(shape: &[u64], fortran: bool, axes: Option<&Axes>) -> Result<Self> {
        ensure!(
            !shape.is_empty(),
            "the array has no axis; one must be the bins"
        );
        ensure!(!shape.contains(&0), "the array {shape:?} is empty");
        let lengths = shape.iter().map(|&length| usize::try_from(length));
        let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
        let strides = strides(&lengths, fortran);
        let mut default = Axes(vec![Axis::Rows; shape.len()]);
        let last = default.0.iter_mut().rev();
        last.zip([Axis::Bins, Axis::Columns])
            .for_each(|(axis, meaning)| *axis = meaning);
        let is_named = axes.is_some();
        let axes = axes.unwrap_or(&default);
        ensure!(
            axes.0.len() == strides.len(),
            Refused::value(
                "axes",
                axes,
                format!(
                    "has {} names, but the array {shape:?} has {} axes",
                    axes.0.len(),
                    strides.len()
                )
            )
        );
        let mut named: Vec<_> = axes.0.iter().copied().zip(strides).collect();
        named.sort_by_key(|(axis, _)| *axis);
        let (_, bins) = named.pop().context("no axis of bins")?;
        let of = |axis| named.iter().filter(move |(other, _)| *other == axis);
        let length = |axis| of(axis).map(|(_, (length, _))| length).product::<usize>();
        let by_capture = of(Axis::Captures).count() > of(Axis::Rows).count();
        let pixels: Vec<_> = named.iter().map(|(_, stride)| *stride).collect();
        let all = pixels_of(&pixels)?;
        // Two axes of pixels are rows and columns. More may be captures, and one may be an array that was flattened.
        let is_shape_known = is_named || all == 1 || shape.len() == 3;
        Ok(Self {
            is_shape_known,
            array: array(length(Axis::Columns), all / length(Axis::Captures))?,
            axis_names: ["column", if by_capture { "capture" } else { "row" }],
            pixels,
            bins,
        })
    }

    /// Bins of a histogram.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.bins.0
    }

    /// Whether elements come histogram by histogram, in the order of addresses.
    fn is_in_order(&self) -> bool {
        let mut stride = 1;
        let mut axes = [self.bins]
            .into_iter()
            .chain(self.pixels.iter().rev().copied());
        axes.all(|(length, own)| {
            let is_next = own == stride || length == 1;
            stride *= length;
            is_next
        })
    }

    /// The histograms of an array whose `elements` have the order of its file.
    #[must_use]
    pub fn histograms(&self, elements: Histograms) -> Histograms {
        if self.is_in_order() {
            return elements;
        }
        let first_of = |mut address| {
            let mut first = 0;
            for (length, stride) in self.pixels.iter().rev() {
                first += address % length * stride;
                address /= length;
            }
            first
        };
        let (_, stride) = self.bins;
        elements.rearranged(first_of, stride)
    }
}

/// The length and the stride of each axis.
fn strides(lengths: &[usize], fortran: bool) -> Vec<(usize, usize)> {
    let mut stride = 1usize;
    let mut next = |&length: &usize| {
        let axis = (length, stride);
        stride = stride.saturating_mul(length);
        axis
    };
    if fortran {
        return lengths.iter().map(next).collect();
    }
    let mut axes: Vec<_> = lengths.iter().rev().map(&mut next).collect();
    axes.reverse();
    axes
}

/// The index of element `place` of the file, as NumPy writes it.
#[must_use]
pub fn index_of(place: usize, shape: &[u64], fortran: bool) -> String {
    let lengths = shape.iter().map(|&length| usize::try_from(length));
    let lengths = lengths.collect::<Result<Vec<_>, _>>().unwrap_or_default();
    let strides = strides(&lengths, fortran);
    let index = strides
        .iter()
        .map(|(length, stride)| place / stride % length);
    let index: Vec<String> = index.map(|index| index.to_string()).collect();
    format!("[{}]", index.join(", "))
}

fn pixels_of(axes: &[(usize, usize)]) -> Result<usize> {
    let pixels = axes
        .iter()
        .try_fold(1usize, |all, axis| all.checked_mul(axis.0));
    let pixels = pixels.context("more pixels than can be counted")?;
    ensure!(
        pixels <= Array::MOST_PIXELS as usize,
        Refused::input(format!(
            "{} pixels are more than 65,536: cut the array into tiles, as docs/recordings.md shows (see `axes` if one \
             axis is the bins)",
            grouped(pixels as u64)
        ))
    );
    Ok(pixels)
}

fn array(columns: usize, pixels: usize) -> Result<Array> {
    let array = Array::new(u32::try_from(columns)?, u32::try_from(pixels / columns)?);
    array.context("an array without pixels")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An array whose element at capture c, row r, column k, bin b is 1000 c + 100 r + 10 k + b,
    /// with its axes in any order, gives the same histograms.
    #[test]
    fn every_order_of_the_axes_gives_the_same_histograms() {
        let lengths = [("captures", 2), ("rows", 3), ("columns", 4), ("bins", 8)];
        let value = |index: [usize; 4]| {
            let [c, r, k, b] = index;
            (1000 * c + 100 * r + 10 * k + b) as u64
        };
        let mut expected = Vec::new();
        for pixel in 0..24 {
            let bins = (0..8).map(|bin| value([pixel / 12, pixel / 4 % 3, pixel % 4, bin]));
            expected.push(bins.collect::<Vec<_>>());
        }
        for order in 0..256 {
            let order = [order & 3, order >> 2 & 3, order >> 4 & 3, order >> 6];
            let names = order.map(|axis| lengths[axis].0).join(",");
            let Ok(axes) = names.parse::<Axes>() else {
                continue; // one of them twice
            };
            let shape = order.map(|axis| lengths[axis].1);
            for fortran in [false, true] {
                let elements: Vec<u64> = (0..192)
                    .map(|place| {
                        let mut index = [0; 4];
                        let mut left = place;
                        let slowest_last: Vec<usize> = if fortran {
                            (0..4).collect()
                        } else {
                            (0..4).rev().collect()
                        };
                        for axis in slowest_last {
                            let length = usize::try_from(shape[axis]).unwrap();
                            index[order[axis]] = left % length;
                            left /= length;
                        }
                        value(index)
                    })
                    .collect();
                let layout = AxisLayout::new(&shape, fortran, Some(&axes)).unwrap();
                let mut in_file = Histograms::new(layout.bins());
                in_file.extend(&elements);
                let histograms = layout.histograms(in_file);
                assert!(
                    histograms.iter().eq(expected.iter().cloned()),
                    "{names} {fortran}"
                );
                assert_eq!(layout.array, Array::new(4, 3).unwrap());
                assert_eq!(layout.bins(), 8);
            }
        }
    }

    #[test]
    fn names_are_printed_as_they_are_read_and_one_must_be_the_bins() {
        let known = "must be some of captures, rows, columns, bins";
        for (text, expected) in [
            ("bins,rows,columns", Ok("bins,rows,columns")),
            (" captures, bins ", Ok("captures,bins")),
            ("bins", Ok("bins")),
            ("rows,columns", Err("one axis must be the bins")),
            ("bins,rows, rows", Err("rows is given twice")),
            ("bins,layers", Err(known)),
            ("", Err(known)),
        ] {
            let read = text.parse::<Axes>().map(|axes| axes.to_string());
            let read = read.as_deref().map_err(String::as_str);
            assert_eq!(read, expected, "{text}");
        }
    }

    #[test]
    fn arrays_that_have_no_layout_are_refused() {
        let axes: Axes = "bins,columns".parse().unwrap();
        for (shape, axes, expected) in [
            (&[][..], None, "the array has no axis; one must be the bins"),
            (&[0, 8], None, "the array [0, 8] is empty"),
            (
                &[2, 3, 8],
                Some(&axes),
                "axes bins,columns: has 2 names, but the array [2, 3, 8] has 3 axes",
            ),
            (
                &[256, 257, 8],
                None,
                "65,792 pixels are more than 65,536: cut the array into tiles, as docs/recordings.md shows (see axes if \
                 one axis is the bins)",
            ),
        ] {
            let error = AxisLayout::new(shape, false, axes).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
    }

    #[test]
    fn an_element_is_named_by_its_index() {
        assert_eq!(index_of(17, &[2, 3, 4], false), "[1, 1, 1]");
        assert_eq!(index_of(17, &[2, 3, 4], true), "[1, 2, 2]");
        assert_eq!(index_of(0, &[8], false), "[0]");
    }
}
