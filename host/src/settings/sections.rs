//! The other sections of a settings file.

use anyhow::{Result, anyhow, ensure};
use dtof_core::CentredWindow;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use serde::{Deserialize, Serialize};

use crate::cli::arguments::bins_of;
use crate::geometry::FieldOfView;
use crate::input::axes::Axes;
use crate::input::range::within;

/// Each field of `$these`, or that of `$others`.
macro_rules! first_of {
    ($these:expr, $others:expr; $($field:ident),+) => {
        Self { $($field: $these.$field.or($others.$field)),+ }
    };
}
pub(super) use first_of;

/// `[sensor]`: what is known of a sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sensor {
    /// Laser cycles a second.
    pub laser_hz: Option<u64>,
    /// Columns of the array.
    pub columns: Option<u32>,
    /// Bins of a histogram.
    pub bins: Option<u16>,
    /// Picoseconds a bin.
    #[serde(with = "decimal")]
    pub bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range.
    #[serde(with = "decimal")]
    pub offset_mm: Option<I24F8>,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// Addresses of hot and dead pixels. They neither decide nor count in a block.
    pub masked: Option<Vec<u16>>,
    /// Standard deviation of the pulse in bins.
    #[serde(with = "decimal")]
    pub sigma_bins: Option<U8F8>,
    /// Whether the TDC takes one photon a laser cycle, so that events say when it piles up.
    pub one_hit_tdc: Option<bool>,
    /// Background photons a bin and laser cycle of the median pixel.
    pub background: Option<f64>,
    /// Photons a laser cycle and pixel that the cover glass sends back, before the gate.
    pub glass: Option<f64>,
    /// The same for each bin before the gate, from bin 0 on.
    pub glass_bins: Option<Vec<f64>>,
}

/// `[rays]`: where pixels look.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rays {
    /// Horizontal and vertical angle from edge to edge of the array.
    pub field_of_view_degrees: Option<[f64; 2]>,
    /// A file with a ray and a bias for each pixel, beside the settings file.
    pub calibration: Option<String>,
}

/// `[run]`: what is replayed or simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Run {
    /// Laser cycles.
    pub cycles: Option<u64>,
    /// Of every random number.
    pub seed: Option<u64>,
    /// Of recorded histograms: photons a laser cycle in the brightest pixel.
    pub photons_per_cycle: Option<f64>,
    /// Of recorded histograms: laser cycles.
    pub recorded_cycles: Option<u64>,
    /// Laser cycles of a frame, if it is a frame-based sensor.
    pub frame: Option<u16>,
    /// Of recorded arrays: what each axis is.
    #[serde(with = "as_text")]
    pub axes: Option<Axes>,
    /// Of archives: the name of the array.
    pub array: Option<String>,
    /// Of recordings: so many neighbouring bins are added up.
    pub rebin: Option<u16>,
}

impl Sensor {
    /// These, and of `other` what these do not say.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        first_of!(
            self, other; laser_hz, columns, bins, bin_width_ps, offset_mm, gate, masked,
            sigma_bins, one_hit_tdc, background, glass, glass_bins
        )
    }

    pub(super) fn check(&self) -> Result<()> {
        if let Some(hz) = self.laser_hz {
            within("laser_hz", hz as f64, 1.0..=1e12)?;
        }
        if let Some(columns) = self.columns {
            within("columns", columns.into(), 1.0..=65_536.0)?;
        }
        if let Some(bins) = self.bins {
            bins_of(bins).map_err(|reason| anyhow!("bins {bins}: {reason}"))?;
        }
        if let Some(sigma) = self.sigma_bins {
            pulse(sigma).map_err(|reason| anyhow!("sigma_bins {sigma}: {reason}"))?;
        }
        for (key, value) in [("background", self.background), ("glass", self.glass)] {
            if let Some(value) = value {
                within(key, value, 0.0..=1e6)?;
            }
        }
        for &rate in self.glass_bins.iter().flatten() {
            within("glass_bins", rate, 0.0..=1e6)?;
        }
        Ok(())
    }
}

/// `sigma`, if a pulse can be so wide: its standard deviation in bins.
///
/// # Errors
/// If there is no such pulse.
pub fn pulse(sigma: U8F8) -> Result<U8F8, String> {
    const WIDEST: U8F8 = CentredWindow::WIDEST_PULSE;
    if sigma == U8F8::ZERO || sigma > WIDEST {
        return Err(format!("must be above 0 and at most {WIDEST}"));
    }
    Ok(sigma)
}

impl Rays {
    pub(super) fn check(&self) -> Result<()> {
        let both = self.field_of_view_degrees.is_some() && self.calibration.is_some();
        ensure!(
            !both,
            "field_of_view_degrees and calibration: give one of them"
        );
        if let Some(degrees) = self.field_of_view_degrees {
            FieldOfView::new(degrees)
                .map_err(|error| anyhow!("field_of_view_degrees {degrees:?}: {error}"))?;
        }
        Ok(())
    }
}

impl Run {
    /// These, and of `other` what these do not say.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        if self.photons_per_cycle.is_some() || self.recorded_cycles.is_some() {
            (other.photons_per_cycle, other.recorded_cycles) = (None, None);
        }
        first_of!(
            self, other; cycles, seed, photons_per_cycle, recorded_cycles, frame, axes, array, rebin
        )
    }

    pub(super) fn check(&self) -> Result<()> {
        if let Some(rate) = self.photons_per_cycle {
            ensure!(
                rate > 0.0 && rate.is_finite(),
                "photons_per_cycle {rate}: must be a number above 0"
            );
        }
        for (key, value) in [
            ("cycles", self.cycles),
            ("recorded_cycles", self.recorded_cycles),
            ("frame", self.frame.map(u64::from)),
            ("rebin", self.rebin.map(u64::from)),
        ] {
            ensure!(value != Some(0), "{key} 0: must be at least 1");
        }
        let both = self.photons_per_cycle.is_some() && self.recorded_cycles.is_some();
        ensure!(
            !both,
            "photons_per_cycle and recorded_cycles: give one of them"
        );
        Ok(())
    }
}

/// What is written as a text, as on the command line.
mod as_text {
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::de::{Deserialize, Deserializer, Error as _};
    use serde::ser::Serializer;

    pub fn serialize<T: Display, S: Serializer>(
        value: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match value {
            None => serializer.serialize_none(),
            Some(value) => serializer.collect_str(value),
        }
    }

    pub fn deserialize<'de, T: FromStr<Err: Display>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<T>, D::Error> {
        let text = Option::<String>::deserialize(deserializer)?;
        let value = text.map(|text| {
            let read = text.parse();
            read.map_err(|error| D::Error::custom(format!("{text}: {error}")))
        });
        value.transpose()
    }
}

/// A fixed-point number as a decimal one, rounded to the nearest when it is read.
pub(super) mod decimal {
    use std::str::FromStr;

    use dtof_core::fixed::traits::Fixed;
    use serde::de::{Deserialize, Deserializer, Error as _};
    use serde::ser::{Error as _, Serializer};

    use crate::cli::arguments::{fixed, shortest};

    /// With as few digits as name it.
    pub fn serialize<T: Fixed + FromStr, S: Serializer>(
        number: &Option<T>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        match number {
            None => serializer.serialize_none(),
            Some(number) => {
                let shortest = shortest(*number).parse().map_err(S::Error::custom)?;
                serializer.serialize_f64(shortest)
            }
        }
    }

    pub fn deserialize<'de, T: Fixed + FromStr, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<T>, D::Error> {
        let number = Option::<f64>::deserialize(deserializer)?;
        let number = number.map(|number| {
            fixed(&number.to_string())
                .map_err(|error| D::Error::custom(format!("{number}: {error}")))
        });
        number.transpose()
    }
}

impl From<Run> for super::SettingsFile {
    fn from(run: Run) -> Self {
        Self {
            run,
            ..Self::default()
        }
    }
}
