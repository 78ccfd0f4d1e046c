//! Which axis of an array of histograms is what.

use std::fmt;
use std::str::FromStr;

use anyhow::{Context, Result, bail, ensure};
use dtof_core::Array;

use dtof_options::Refused;

/// What an axis counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    Captures,
    Rows,
    Columns,
    Bins,
}

/// The names of the axes, in the order of the address space.
const NAMES: [(Axis, &str); 4] = [
    (Axis::Captures, "captures"),
    (Axis::Rows, "rows"),
    (Axis::Columns, "columns"),
    (Axis::Bins, "bins"),
];

/// The axes of an array by name, in the order of its shape.
///
/// ```
/// use dtof_photons::axes::Axes;
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
            let found = NAMES.iter().find(|(_, name)| *name == word.trim());
            let Some(&(axis, name)) = found else {
                return Err("must be some of captures, rows, columns, bins".to_owned());
            };
            if axes.contains(&axis) {
                return Err(format!("{name} is there twice"));
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
        let name = |axis: &Axis| NAMES.iter().find(|(named, _)| named == axis);
        let names: Vec<&str> = self.0.iter().filter_map(name).map(|name| name.1).collect();
        formatter.write_str(&names.join(","))
    }
}

/// Where the elements of an array lie: of each axis its length, and how far apart in the file
/// its neighbours are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The axes of pixels, the one that changes fastest last.
    pixels: Vec<(usize, usize)>,
    bins: (usize, usize),
    /// The array of one capture.
    pub array: Array,
    /// The names of columns and rows.
    pub sides: [&'static str; 2],
}

impl Layout {
    /// Of an array of `shape`. Without `axes` the last axis is the bins, the one before it the
    /// columns, and all before it are rows of one capture.
    ///
    /// # Errors
    /// If there are more pixels than addresses, or not as many axes as names.
    pub fn new(shape: &[u64], fortran: bool, axes: Option<&Axes>) -> Result<Self> {
        ensure!(
            !shape.is_empty(),
            "the array has no axis; one must be the bins"
        );
        ensure!(!shape.contains(&0), "the array {shape:?} is empty");
        let lengths = shape.iter().map(|&length| usize::try_from(length));
        let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
        let placed = placed(&lengths, fortran);
        let Some(axes) = axes else {
            let Some((&bins, pixels)) = placed.split_last() else {
                bail!("the array has no axis");
            };
            let columns = pixels.last().map_or(1, |axis| axis.0);
            return Ok(Self {
                pixels: pixels.to_vec(),
                bins,
                array: array(columns, pixels_of(pixels)?)?,
                sides: ["column", "row"],
            });
        };
        ensure!(
            axes.0.len() == placed.len(),
            Refused::value(
                "axes",
                axes,
                format!(
                    "has {} names, but the array {shape:?} has {} axes",
                    axes.0.len(),
                    placed.len()
                )
            )
        );
        let place = |wanted: Axis| {
            let place = axes.0.iter().position(|&axis| axis == wanted);
            place.map(|place| placed[place])
        };
        let [captures, rows, columns] = [Axis::Captures, Axis::Rows, Axis::Columns].map(place);
        let pixels: Vec<_> = [captures, rows, columns].into_iter().flatten().collect();
        let all = pixels_of(&pixels)?;
        let length = |axis: Option<(usize, usize)>| axis.map_or(1, |axis| axis.0);
        let by_capture = captures.is_some() && rows.is_none();
        Ok(Self {
            array: array(length(columns), all / length(captures))?,
            sides: ["column", if by_capture { "capture" } else { "row" }],
            pixels,
            bins: place(Axis::Bins).context("no axis of bins")?,
        })
    }

    /// Bins of a histogram.
    #[must_use]
    pub fn bins(&self) -> usize {
        self.bins.0
    }

    /// The histograms of `elements`, in the order of addresses.
    pub fn histograms(&self, elements: &[u64]) -> impl Iterator<Item = Vec<u64>> {
        let pixels: usize = self.pixels.iter().map(|axis| axis.0).product();
        (0..pixels).map(move |mut address| {
            let mut first = 0;
            for (length, apart) in self.pixels.iter().rev() {
                first += address % length * apart;
                address /= length;
            }
            let (bins, apart) = self.bins;
            (0..bins).map(|bin| elements[first + bin * apart]).collect()
        })
    }
}

/// Each axis with how far apart its neighbours are.
fn placed(lengths: &[usize], fortran: bool) -> Vec<(usize, usize)> {
    let mut apart = 1usize;
    let mut next = |&length: &usize| {
        let axis = (length, apart);
        apart = apart.saturating_mul(length);
        axis
    };
    if fortran {
        return lengths.iter().map(next).collect();
    }
    let mut axes: Vec<_> = lengths.iter().rev().map(&mut next).collect();
    axes.reverse();
    axes
}

/// The index, as NumPy writes it, of element `place` of the file.
#[must_use]
pub fn index_of(place: usize, shape: &[u64], fortran: bool) -> String {
    let lengths = shape.iter().map(|&length| usize::try_from(length));
    let lengths = lengths.collect::<Result<Vec<_>, _>>().unwrap_or_default();
    let placed = placed(&lengths, fortran);
    let index = placed.iter().map(|(length, apart)| place / apart % length);
    let index: Vec<String> = index.map(|index| index.to_string()).collect();
    format!("[{}]", index.join(", "))
}

fn pixels_of(axes: &[(usize, usize)]) -> Result<usize> {
    let pixels = axes
        .iter()
        .try_fold(1usize, |all, axis| all.checked_mul(axis.0));
    let pixels = pixels.context("more pixels than can be counted")?;
    ensure!(
        pixels <= 65_536,
        Refused::input(format!(
            "{pixels} pixels; there are 65,536 addresses (see `axes` if one axis is the bins)"
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
                let layout = Layout::new(&shape, fortran, Some(&axes)).unwrap();
                let histograms: Vec<_> = layout.histograms(&elements).collect();
                assert_eq!(histograms, expected, "{names} {fortran}");
                assert_eq!(layout.array, Array::new(4, 3).unwrap());
            }
        }
    }

    #[test]
    fn an_element_is_named_by_its_index() {
        assert_eq!(index_of(17, &[2, 3, 4], false), "[1, 1, 1]");
        assert_eq!(index_of(17, &[2, 3, 4], true), "[1, 2, 2]");
        assert_eq!(index_of(0, &[8], false), "[0]");
    }
}
