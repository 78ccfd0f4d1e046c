//! The unit ray of each pixel, and points in metres along it.
//!
//! The frame is the optical frame of a camera: x to the right, y down, z forward, the lens at the
//! origin. Direct time of flight measures along the ray:
//!
//! ```text
//! point = (range - range bias) × unit ray
//! ```
//!
//! The rays are those of a pinhole camera, through the middle of each pixel, or come from a
//! calibration file.

mod calibration;

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use anyhow::Context;
use dtof_core::{Array, BlockLevel, PixelAddress};

use crate::options::files::read_text;
use crate::options::numbers::real;

/// Degrees across the longer side of an array by default.
const LONGER_SIDE_DEGREES: f64 = 60.0;

/// The field of view of a pinhole camera: half of its width and height at distance 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    half: [f64; 2],
}

/// The field of view is not valid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldOfViewError;

impl fmt::Display for FieldOfViewError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("must be HORIZONTALxVERTICAL in degrees, as 60x32.2, each from 0.01 to 179")
    }
}

impl std::error::Error for FieldOfViewError {}

impl FieldOfView {
    /// Horizontal and vertical angle in degrees, from edge to edge of the array.
    ///
    /// # Errors
    /// Fails if one is not from 0.01 to 179.
    pub fn new(degrees: [f64; 2]) -> Result<Self, FieldOfViewError> {
        if !degrees.iter().all(|angle| (0.01..=179.0).contains(angle)) {
            return Err(FieldOfViewError);
        }
        let half = degrees.map(|angle| (angle / 2.0).to_radians().tan());
        Ok(Self { half })
    }

    /// The default field of view of so many columns and rows: 60 degrees across the longer
    /// side, with square pixels. For 64×32 pixels that is 60×32.2 degrees.
    #[must_use]
    pub fn default_for(size: [u32; 2]) -> Self {
        let [columns, rows] = size.map(f64::from);
        let longer = columns.max(rows);
        let half = (LONGER_SIDE_DEGREES / 2.0).to_radians().tan();
        Self {
            half: [half * columns / longer, half * rows / longer],
        }
    }

    /// Horizontal and vertical angle in degrees.
    #[must_use]
    pub fn degrees(&self) -> [f64; 2] {
        self.half.map(|half| 2.0 * half.atan().to_degrees())
    }

    /// The unit ray through a point of the image: `across` and `down` are 0 at the left and upper
    /// edge and 1 at the right and lower one.
    #[must_use]
    pub fn ray(&self, across: f64, down: f64) -> [f64; 3] {
        let [width, height] = self.half;
        unit([
            width * (2.0 * across - 1.0),
            height * (2.0 * down - 1.0),
            1.0,
        ])
    }
}

/// The format of `--fov`, rounded to two decimals or to the given precision.
impl fmt::Display for FieldOfView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = f.precision().unwrap_or(2);
        let [horizontal, vertical] = self.degrees().map(|angle| {
            let text = format!("{angle:.decimals$}");
            let short = text.trim_end_matches('0').trim_end_matches('.');
            if text.contains('.') { short } else { &text }.to_owned()
        });
        write!(f, "{horizontal}x{vertical}")
    }
}

impl FromStr for FieldOfView {
    type Err = FieldOfViewError;

    fn from_str(text: &str) -> Result<Self, FieldOfViewError> {
        Self::new(angles(text)?)
    }
}

/// Reads two numbers, as `60x32.2` or `60,32.2`.
///
/// # Errors
/// Fails if there are not two numbers.
pub fn angles(text: &str) -> Result<[f64; 2], FieldOfViewError> {
    let sides = text.split_once(['x', ',']);
    let angles =
        sides.and_then(|(horizontal, vertical)| Some([real(horizontal)?, real(vertical)?]));
    angles.ok_or(FieldOfViewError)
}

/// The ray of one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A unit vector.
    pub direction: [f64; 3],
    /// The range bias of the pixel in millimetres, positive if its ranges are too long.
    pub bias_mm: f64,
}

/// The rays of all pixels of an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Rays {
    array: Array,
    /// Row by row.
    rays: Vec<Ray>,
}

impl Rays {
    /// The rays of a pinhole camera, through the middle of each pixel.
    #[must_use]
    pub fn pinhole(array: Array, view: FieldOfView) -> Self {
        let place = |index: u32, of: u32| (f64::from(index) + 0.5) / f64::from(of);
        let ray = |row: u32, column: u32| Ray {
            direction: view.ray(place(column, array.columns()), place(row, array.rows())),
            bias_mm: 0.0,
        };
        let row = |row: u32| (0..array.columns()).map(move |column| ray(row, column));
        Self {
            array,
            rays: (0..array.rows()).flat_map(row).collect(),
        }
    }

    /// The rays of a calibration file; `docs/export.md` describes its format.
    ///
    /// # Errors
    /// Returns one line with the name of the file and the wrong line.
    pub fn read(path: &Path, array: Array) -> anyhow::Result<Self> {
        let text = read_text(path)?;
        let rays = calibration::parse(&text, array);
        let rays = rays.with_context(|| path.display().to_string())?;
        Ok(Self { array, rays })
    }

    /// For each pixel how many times as far a plane before the lens is along its ray as straight ahead, at most a
    /// hundred times.
    #[must_use]
    pub fn slants(&self) -> Vec<f64> {
        let forward = self.rays.iter().map(|ray| ray.direction[2]);
        forward.map(|forward| 1.0 / forward.max(0.01)).collect()
    }

    /// The range bias of each pixel in millimetres.
    #[must_use]
    pub fn biases(&self) -> Vec<f64> {
        self.rays.iter().map(|ray| ray.bias_mm).collect()
    }

    /// The point that a pixel sees at a range, in metres; `None` if there is no such pixel. The
    /// point of a block, whose first pixel is `pixel`, is on the mean of its rays.
    #[must_use]
    pub fn point(&self, pixel: PixelAddress, level: BlockLevel, range_mm: f64) -> Option<[f64; 3]> {
        let ray = if level == BlockLevel::PIXEL {
            *self.rays.get(usize::from(pixel.raw()))?
        } else {
            self.mean_ray(pixel, level)?
        };
        let metres = (range_mm - ray.bias_mm) / 1000.0;
        Some(ray.direction.map(|side| side * metres))
    }

    /// The mean ray of a block; `None` if there is no such block or its rays cancel.
    fn mean_ray(&self, pixel: PixelAddress, level: BlockLevel) -> Option<Ray> {
        let (mut direction, mut bias_mm, mut pixels) = ([0.0; 3], 0.0, 0.0);
        for pixel in self.array.pixels_of(pixel, level) {
            let ray = self.rays.get(usize::from(pixel.raw()))?;
            for (sum, side) in direction.iter_mut().zip(ray.direction) {
                *sum += side;
            }
            bias_mm += ray.bias_mm;
            pixels += 1.0;
        }
        let has_length = direction.iter().any(|&side| side != 0.0);
        has_length.then(|| Ray {
            direction: unit(direction),
            bias_mm: bias_mm / pixels,
        })
    }
}

/// Scales a vector to length 1.
fn unit(direction: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = direction;
    let length = x.hypot(y).hypot(z);
    direction.map(|side| side / length)
}

#[cfg(test)]
mod tests;
