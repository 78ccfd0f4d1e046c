//! The true ranges of the pixels of a recording or a scene.

use anyhow::{Result, ensure};
use dtof_core::PixelAddress;

use dtof_data::photons::input::Input;
use dtof_data::photons::npy::numbers;
use dtof_light::scene::Scene;

/// The true ranges that reports are compared with.
#[derive(Clone, Debug)]
pub enum Truth {
    /// A simulated scene.
    Scene(Box<Scene>),
    /// A range in millimetres for each pixel that has one.
    Ranges(Vec<Option<f64>>),
    /// The range of all photons of each pixel, where nothing better is known.
    OfAllPhotons(Vec<Option<f64>>),
}

impl Truth {
    /// Reads ranges in millimetres: an `.npy` array, as a file or in memory, with one number for each
    /// pixel. The number of a pixel without a target is 0, negative or not a number.
    ///
    /// # Errors
    /// Fails if the array cannot be read, has another number of ranges, or none that is positive; the
    /// error begins with its name.
    pub fn read(input: &Input, pixels: usize) -> Result<Self> {
        let numbers = numbers::read(input)?;
        let there = numbers.values.len();
        ensure!(
            there == pixels,
            "{input}: {there} ranges, but there are {pixels} pixels"
        );
        let ranges = numbers.values.into_iter();
        let ranges: Vec<_> = ranges
            .map(|range| Some(range).filter(|range| range.is_finite() && *range > 0.0))
            .collect();
        let any = ranges.iter().any(Option::is_some);
        ensure!(any, "{input}: no pixel has a range");
        Ok(Self::Ranges(ranges))
    }

    /// Warns if all ranges of an array are so short that they are probably metres.
    #[must_use]
    pub fn in_metres(&self) -> Option<String> {
        let Self::Ranges(ranges) = self else {
            return None;
        };
        let most = ranges.iter().flatten().copied().fold(0.0, f64::max);
        (most < 20.0).then(|| {
            format!("no true range is more than {most} mm: --truth takes millimetres; {most} m are {:.0}", most * 1000.0)
        })
    }

    /// The true ranges of `pixel` in a laser cycle: that of the nearest surface, and that of the one
    /// behind it.
    #[must_use]
    pub fn ranges(&self, pixel: PixelAddress, cycle: u64) -> [Option<f64>; 2] {
        match self {
            Self::Scene(scene) => {
                let end = f64::from(scene.bins) * scene.mm_per_bin();
                let views = scene.hits(pixel, cycle);
                views.map(|view| view.map(|view| view.range_mm).filter(|range| *range < end))
            }
            Self::Ranges(ranges) | Self::OfAllPhotons(ranges) => [
                ranges.get(usize::from(pixel.raw())).copied().flatten(),
                None,
            ],
        }
    }

    /// Whether `pixel` has a target in a laser cycle.
    #[must_use]
    pub fn has_target(&self, pixel: PixelAddress, cycle: u64) -> bool {
        self.ranges(pixel, cycle)[0].is_some()
    }

    /// The same with `mm` added, if it is a list of ranges.
    #[must_use]
    pub fn moved(self, mm: f64) -> Self {
        match self {
            Self::Ranges(ranges) => {
                let moved = ranges.into_iter().map(|range| Some(range? + mm));
                Self::Ranges(moved.collect())
            }
            other => other,
        }
    }

    /// The same with the range bias of each pixel of a capture added, if it is a list of ranges: reports have it as well.
    #[must_use]
    pub fn with_biases(self, biases: &[f64]) -> Self {
        match self {
            Self::Ranges(ranges) => {
                let ranges = ranges.into_iter().zip(biases.iter().cycle());
                Self::Ranges(ranges.map(|(range, bias)| Some(range? + bias)).collect())
            }
            other => other,
        }
    }

    /// What errors are relative to, as a sentence.
    #[must_use]
    pub const fn description(&self) -> &'static str {
        match self {
            Self::Scene(_) | Self::Ranges(_) => "errors are against the true range",
            Self::OfAllPhotons(_) => "errors are against the range of all photons of the pixel",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_are_probably_metres_are_warned_of() {
        let warning = |ranges: &[Option<f64>]| Truth::Ranges(ranges.to_vec()).in_metres();
        let text = "no true range is more than 1.5 mm: --truth takes millimetres; 1.5 m are 1500";
        assert_eq!(warning(&[Some(0.8), None, Some(1.5)]).unwrap(), text);
        assert_eq!(warning(&[Some(0.8), Some(1500.0)]), None);
    }
}
