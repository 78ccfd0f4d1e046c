//! What is true of the pixels of a recording or a scene.

use anyhow::{Result, ensure};
use dtof_core::PixelAddress;

use dtof_photons::medium::Medium;
use dtof_photons::npy::numbers;
use dtof_simulate::scene::Scene;

/// What reports are compared with.
#[derive(Clone, Debug)]
pub enum Truth {
    /// A simulated scene.
    Scene(Box<Scene>),
    /// A range in millimetres for each pixel that has one.
    Ranges(Vec<Option<f64>>),
    /// The same, where nothing better is known: that of all photons of the pixel.
    OfAllPhotons(Vec<Option<f64>>),
}

impl Truth {
    /// Reads ranges in millimetres, an `.npy` array with as many numbers as pixels, a file or in
    /// memory. A pixel
    /// without a target is 0, negative or not a number.
    ///
    /// # Errors
    /// What is wrong with it, its name first.
    pub fn read(medium: &Medium, pixels: usize) -> Result<Self> {
        let numbers = numbers::read(medium)?;
        let there = numbers.values.len();
        ensure!(
            there == pixels,
            "{medium}: {there} ranges, but there are {pixels} pixels"
        );
        let ranges = numbers.values.into_iter();
        let ranges: Vec<_> = ranges
            .map(|range| Some(range).filter(|range| range.is_finite() && *range > 0.0))
            .collect();
        let any = ranges.iter().any(Option::is_some);
        ensure!(any, "{medium}: no pixel has a range");
        Ok(Self::Ranges(ranges))
    }

    /// The ranges that a report of `pixel` may have in a laser cycle: of the nearest surface,
    /// and of the one behind it. None without a target, or where nothing is known.
    #[must_use]
    pub fn ranges(&self, pixel: PixelAddress, cycle: u64) -> [Option<f64>; 2] {
        match self {
            Self::Scene(scene) => {
                let end = f64::from(scene.bins) * scene.mm_per_bin();
                let views = scene.views(pixel, cycle);
                views.map(|view| view.map(|view| view.range_mm).filter(|range| *range < end))
            }
            Self::Ranges(ranges) | Self::OfAllPhotons(ranges) => {
                [ranges.get(usize::from(pixel.0)).copied().flatten(), None]
            }
        }
    }

    /// Whether `pixel` has a target in a laser cycle.
    #[must_use]
    pub fn has_target(&self, pixel: PixelAddress, cycle: u64) -> bool {
        self.ranges(pixel, cycle)[0].is_some()
    }

    /// With so many millimetres more, if it is a list of ranges.
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

    /// How errors come about, in a sentence.
    #[must_use]
    pub const fn told(&self) -> &'static str {
        match self {
            Self::Scene(_) | Self::Ranges(_) => "errors are against the true range",
            Self::OfAllPhotons(_) => "errors are against the range of all photons of the pixel",
        }
    }
}
