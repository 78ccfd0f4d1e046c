//! A depth map, and a picture of the same view, as a surface.
//!
//! A pixel sees the sample in which its middle lies. Samples are never mixed, so there are no
//! surfaces between the two sides of an edge.

use std::path::Path;

use anyhow::{Context, Result, ensure};

use super::LineOfSight;
use dtof_data::named_values;
use dtof_data::photons::npy::numbers::{self, ElementKind, Numbers};

/// The highest reflectivity of a sample, as of other surfaces.
const MOST_REFLECTIVITY: f64 = 100.0;

named_values! {
    /// The direction in which the values of a depth map are measured.
    #[derive(Debug, Default, PartialEq, Eq)]
    pub enum DepthAlong {
        /// Depth along the optical axis, as of depth cameras and renderers (z)
        #[default]
        Axis = "axis",
        /// Range along the ray of each sample
        Ray = "ray",
    }
}

/// The distance and the reflectivity of each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Columns and rows.
    size: [u32; 2],
    along: DepthAlong,
    /// Row by row; `None` where there is no surface.
    depth_mm: Vec<Option<f64>>,
    /// One for each sample; empty if all are white.
    reflectivity: Vec<f64>,
}

impl DepthMap {
    /// Reads a depth map: floats are metres, integers millimetres. Values that are 0, negative,
    /// infinite or not a number are not a surface.
    ///
    /// # Errors
    /// Returns one line with the name of the file and what is wrong with it.
    pub fn read(path: &Path, along: DepthAlong) -> Result<Self> {
        let numbers = numbers::read(&path.into())?;
        Self::from_numbers(&numbers, along).with_context(|| path.display().to_string())
    }

    fn from_numbers(numbers: &Numbers, along: DepthAlong) -> Result<Self> {
        let unit_mm = match numbers.element {
            ElementKind::Float => 1000.0,
            ElementKind::Byte | ElementKind::Integer => 1.0,
        };
        let values = numbers.values.iter().map(|value| value * unit_mm);
        let is_surface = |value: &f64| value.is_finite() && *value > 0.0;
        let depth_mm: Vec<_> = values.map(|value| Some(value).filter(is_surface)).collect();
        let &[rows, columns] = &numbers.shape[..] else {
            anyhow::bail!(
                "a depth map has two axes, rows and columns; this has {:?}",
                numbers.shape
            );
        };
        ensure!(
            depth_mm.iter().any(Option::is_some),
            "no surface anywhere: no depth is finite and above 0"
        );
        Ok(Self {
            size: [u32::try_from(columns)?, u32::try_from(rows)?],
            along,
            depth_mm,
            reflectivity: Vec::new(),
        })
    }

    /// Reads the picture: bytes from 0, black, to 255, white, or floats, the reflectivity from 0 to
    /// 100. The mean of colours is used.
    ///
    /// # Errors
    /// Returns one line with the name of the file and what is wrong with it.
    pub fn with_picture(mut self, path: &Path) -> Result<Self> {
        let numbers = numbers::read(&path.into())?;
        let reflectivity = reflectivity(&numbers, self.size);
        self.reflectivity = reflectivity.with_context(|| path.display().to_string())?;
        Ok(self)
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The range of what a pixel sees.
    pub(super) fn range_mm(&self, sight: &LineOfSight) -> Option<f64> {
        let depth_mm = self.depth_mm[self.sample(sight)]?;
        Some(match self.along {
            DepthAlong::Axis => depth_mm / sight.ray[2],
            DepthAlong::Ray => depth_mm,
        })
    }

    /// The reflectivity of what a pixel sees.
    pub(super) fn reflectivity(&self, sight: &LineOfSight) -> f64 {
        let reflectivity = self.reflectivity.get(self.sample(sight));
        reflectivity.copied().unwrap_or(1.0)
    }

    /// The smallest depth.
    pub(super) fn nearest_mm(&self) -> f64 {
        let depths = self.depth_mm.iter().flatten();
        depths.copied().fold(f64::INFINITY, f64::min)
    }

    /// The sample that sends the most photons back: its reflectivity and its depth.
    pub(super) fn brightest(&self) -> Option<(f64, f64)> {
        let samples = self.depth_mm.iter().enumerate();
        let seen = samples.filter_map(|(sample, depth_mm)| {
            let reflectivity = self.reflectivity.get(sample).copied().unwrap_or(1.0);
            Some((reflectivity, (*depth_mm)?))
        });
        let light = |(reflectivity, depth_mm): &(f64, f64)| reflectivity / depth_mm.powi(2);
        seen.max_by(|a, b| light(a).total_cmp(&light(b)))
    }

    /// The largest depth.
    pub(super) fn farthest_mm(&self) -> f64 {
        self.depth_mm.iter().flatten().copied().fold(0.0, f64::max)
    }

    /// The index of the sample in which the middle of a pixel lies; on a border the later one.
    fn sample(&self, sight: &LineOfSight) -> usize {
        let at = |index: u32, of: u32, samples: u32| {
            (2 * index as usize + 1) * samples as usize / (2 * of as usize)
        };
        let [column, row] = sight.pixel;
        let ([across, down], [columns, rows]) = (sight.size, self.size);
        at(row, down, rows) * columns as usize + at(column, across, columns)
    }
}

/// The reflectivity of each sample of a picture, which must be as large as the depth map.
fn reflectivity(numbers: &Numbers, [columns, rows]: [u32; 2]) -> Result<Vec<f64>> {
    let shape = &numbers.shape;
    let colours = match shape[..] {
        [_, _] => 1,
        [_, _, 3] => 3,
        _ => anyhow::bail!(
            "a picture has two axes, rows and columns, or a third of three colours; this has \
             {shape:?}"
        ),
    };
    ensure!(
        shape[..2] == [rows, columns].map(u64::from),
        "{} rows and {} columns, but the depth map has {rows} and {columns}",
        shape[0],
        shape[1]
    );
    let white = match numbers.element {
        ElementKind::Byte => 255.0,
        ElementKind::Float => 1.0,
        ElementKind::Integer => anyhow::bail!(
            "elements of a picture must be bytes or floats; convert them with .astype(numpy.uint8)"
        ),
    };
    let most = MOST_REFLECTIVITY * white;
    let wrong = numbers
        .values
        .iter()
        .find(|value| !(0.0..=most).contains(*value));
    if let Some(value) = wrong {
        anyhow::bail!("a value of {value}: must be from 0 to {most}, white is {white}");
    }
    let samples = numbers.values.chunks(colours);
    Ok(samples
        .map(|sample| sample.iter().sum::<f64>() / (white * colours as f64))
        .collect())
}
