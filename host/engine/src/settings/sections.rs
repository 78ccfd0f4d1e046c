//! The other sections of a settings file: sensor, rays and run.

use std::fmt::Display;
use std::str::FromStr;

use dtof_core::CentredWindow;
use dtof_core::fixed::traits::Fixed;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use serde::Serialize;
use serde::ser::{Error as _, Serializer};

use dtof_options::numbers::{
    MOST_WHOLE, bins, fixed, list, positive, real, shortest, truth, whole, within,
};
use dtof_options::{NO_OPTION, Refused};
use dtof_photons::axes::Axes;
use dtof_photons::geometry::{FieldOfView, FieldOfViewError};

/// Each field of `$these`, or that of `$others`.
macro_rules! first_of {
    ($these:expr, $others:expr; $($field:ident),+) => {
        Self { $($field: $these.$field.or($others.$field)),+ }
    };
}
pub(super) use first_of;

/// `[sensor]`: what is known of a sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sensor {
    /// Laser cycles a second.
    pub laser_hz: Option<u64>,
    /// Columns of the array.
    pub columns: Option<u32>,
    /// Bins of a histogram.
    pub bins: Option<u16>,
    /// Picoseconds a bin.
    #[serde(serialize_with = "decimal")]
    pub bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range.
    #[serde(serialize_with = "decimal")]
    pub offset_mm: Option<I24F8>,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// Addresses of hot and dead pixels. They neither decide nor count in a block.
    pub masked: Option<Vec<u16>>,
    /// Standard deviation of the pulse in bins.
    #[serde(serialize_with = "decimal")]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rays {
    /// Horizontal and vertical angle from edge to edge of the array.
    pub field_of_view_degrees: Option<[f64; 2]>,
    /// A file with a ray and a bias for each pixel, beside the settings file.
    pub calibration: Option<String>,
}

/// `[run]`: what is replayed or simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
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
    #[serde(serialize_with = "as_text")]
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

    /// Sets a key of the section.
    ///
    /// # Errors
    /// Why it cannot be so.
    pub(super) fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        let rate = within(0.0..=1e6);
        match key {
            "laser_hz" => self.laser_hz = Some(whole(1..=1_000_000_000_000)(text)?),
            "columns" => self.columns = Some(whole(1..=65_536)(text)?),
            "bins" => self.bins = Some(bins(text)?),
            "bin_width_ps" => self.bin_width_ps = Some(fixed(text)?),
            "offset_mm" => self.offset_mm = Some(fixed(text)?),
            "gate" => self.gate = Some(gate(text)?),
            "masked" => self.masked = Some(list(text, &[','], whole(0..=u16::MAX))?),
            "sigma_bins" => self.sigma_bins = Some(pulse(fixed(text)?)?),
            "one_hit_tdc" => self.one_hit_tdc = Some(truth(text)?),
            "background" => self.background = Some(rate(text)?),
            "glass" => self.glass = Some(rate(text)?),
            "glass_bins" => self.glass_bins = Some(list(text, &[','], rate)?),
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }
}

/// Reads the first and the last bin of a gate, as `20..119` or `20,119`.
fn gate(text: &str) -> Result<(u16, u16), String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    let ends = ends.and_then(|(first, last)| {
        let bin = whole(0..=u16::MAX);
        Some((bin(first).ok()?, bin(last).ok()?))
    });
    ends.ok_or("must be FIRST..LAST, as 20..119".to_owned())
}

/// `sigma`, if a pulse can be so wide: its standard deviation in bins.
///
/// # Errors
/// If there is no such pulse.
fn pulse(sigma: U8F8) -> Result<U8F8, String> {
    const WIDEST: U8F8 = CentredWindow::WIDEST_PULSE;
    if sigma == U8F8::ZERO || sigma > WIDEST {
        return Err(format!("must be above 0 and at most {WIDEST}"));
    }
    Ok(sigma)
}

impl Rays {
    /// Sets a key of the section.
    ///
    /// # Errors
    /// Why it cannot be so.
    pub(super) fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        match key {
            "field_of_view_degrees" => {
                let none = || FieldOfViewError.to_string();
                let angles = list(text, &['x', ','], |angle| real(angle).ok_or_else(none))?;
                let angles = <[f64; 2]>::try_from(angles).map_err(|_| none())?;
                FieldOfView::new(angles).map_err(|error| error.to_string())?;
                self.field_of_view_degrees = Some(angles);
            }
            "calibration" => self.calibration = Some(text.to_owned()),
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }

    pub(super) fn check(&self) -> Result<(), Refused> {
        if self.field_of_view_degrees.is_some() && self.calibration.is_some() {
            return Err(Refused::new(
                "field_of_view_degrees",
                "cannot be used with `calibration`",
            ));
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

    /// Sets a key of the section.
    ///
    /// # Errors
    /// Why it cannot be so.
    pub(super) fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
        match key {
            "cycles" => self.cycles = Some(whole(1..=MOST_WHOLE)(text)?),
            "seed" => self.seed = Some(whole(0..=MOST_WHOLE)(text)?),
            "photons_per_cycle" => self.photons_per_cycle = Some(positive(text)?),
            "recorded_cycles" => self.recorded_cycles = Some(whole(1..=MOST_WHOLE)(text)?),
            "frame" => self.frame = Some(whole(1..=u16::MAX)(text)?),
            "axes" => self.axes = Some(text.parse()?),
            "array" => self.array = Some(text.to_owned()),
            "rebin" => self.rebin = Some(whole(1..=512)(text)?),
            _ => return Err(NO_OPTION.to_owned()),
        }
        Ok(())
    }

    pub(super) fn check(&self) -> Result<(), Refused> {
        if self.photons_per_cycle.is_some() && self.recorded_cycles.is_some() {
            return Err(Refused::new(
                "photons_per_cycle",
                "cannot be used with `recorded_cycles`",
            ));
        }
        Ok(())
    }
}

/// As a text, as an option has it.
fn as_text<T: Display, S: Serializer>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error> {
    match value {
        None => serializer.serialize_none(),
        Some(value) => serializer.collect_str(value),
    }
}

/// A fixed-point number as a decimal one, with as few digits as name it.
pub(super) fn decimal<T: Fixed + FromStr, S: Serializer>(
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
