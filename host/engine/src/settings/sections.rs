//! The other sections of a settings file: sensor, rays and run.

use std::fmt::Display;
use std::path::PathBuf;
use std::str::FromStr;

use dtof_core::fixed::traits::Fixed;
use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{Array, CentredWindow};
use dtof_sensors::dither::Dither;
use serde::Serialize;
use serde::ser::{Error as _, Serializer};

use dtof_options::NO_OPTION;
use dtof_options::numbers::{
    MAX_INTEGER, bins, boolean, fixed, integer, laser_hz, list, positive, real, shortest, within,
};
use dtof_photons::axes::Axes;
use dtof_photons::geometry::{FieldOfView, Rays, angles};

/// Defines the keys of a section in the order in which they are written: how each is read, and its
/// comment in the file.
macro_rules! section {
    ($section:ident: $($key:ident = $read:expr, $comment:literal;)+) => {
        impl $section {
            /// The keys of the section.
            pub const KEYS: &'static [&'static str] = &[$(stringify!($key)),+];
            /// The comment of each key.
            pub(super) const COMMENTS: &'static [&'static str] = &[$($comment),+];

            /// Sets one of [`Self::KEYS`].
            ///
            /// # Errors
            /// Says what the value must be.
            pub(super) fn set(&mut self, key: &str, text: &str) -> Result<(), String> {
                match key {
                    $(stringify!($key) => self.$key = Some($read(text)?),)+
                    _ => return Err(NO_OPTION.to_owned()),
                }
                Ok(())
            }

            /// Each key of `self`, or that of `other` if `self` lacks it.
            fn first_of(self, other: Self) -> Self {
                Self { $($key: self.$key.or(other.$key)),+ }
            }
        }
    };
}
pub(super) use section;

/// `[sensor]`: what is known of a sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SensorSettings {
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
    /// For each pixel, in the order of the addresses: millimetres added to that.
    #[serde(serialize_with = "decimals")]
    pub offsets_mm: Option<Vec<I24F8>>,
    /// First and last bin that may hold the peak, both inclusive.
    pub gate: Option<(u16, u16)>,
    /// Addresses of hot and dead pixels. They neither decide nor count in a block.
    pub masked: Option<Vec<u16>>,
    /// Standard deviation of the pulse in bins.
    #[serde(serialize_with = "decimal")]
    pub sigma_bins: Option<U8F8>,
    /// Bins for which the TDC is blind after a photon; as many as the histogram has, or more, if it
    /// takes the first photon of a laser cycle only.
    pub dead_time: Option<u16>,
    /// By how many bins the longest laser cycle is longer than the shortest.
    pub dither_bins: Option<u16>,
    /// The seed of the laser cycles' lengths.
    pub dither_seed: Option<u64>,
    /// Background photons a bin and laser cycle of the median pixel.
    pub background: Option<f64>,
    /// Photons a laser cycle and pixel that the cover glass sends back, before the gate.
    pub glass: Option<f64>,
    /// The same for each bin before the gate, from bin 0 on.
    pub glass_bins: Option<Vec<f64>>,
}

/// `[rays]`: where pixels look.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RaySettings {
    /// Horizontal and vertical angle from edge to edge of the array.
    pub field_of_view_degrees: Option<[f64; 2]>,
    /// A file with a ray and a bias for each pixel. A relative path starts at the settings file.
    pub calibration: Option<PathBuf>,
}

/// `[run]`: what is replayed or simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunSettings {
    /// Laser cycles.
    pub cycles: Option<u64>,
    /// The seed of every random number.
    pub seed: Option<u64>,
    /// Recorded histograms: photons a laser cycle in the brightest pixel.
    pub photons_per_cycle: Option<f64>,
    /// Recorded histograms: laser cycles.
    pub recorded_cycles: Option<u64>,
    /// Laser cycles of a frame, if it is a frame-based sensor.
    pub frame: Option<u16>,
    /// Whether pixels decide once, on all photons.
    pub decide_once: Option<bool>,
    /// Recorded arrays: the meaning of each axis.
    #[serde(serialize_with = "as_text")]
    pub axes: Option<Axes>,
    /// Archives: the name of the array.
    pub array: Option<String>,
    /// Recordings: the capture to use, counted from 0.
    pub capture: Option<u32>,
    /// Recordings: how many neighbouring bins are summed.
    pub rebin: Option<u16>,
}

section! {
    SensorSettings:
    laser_hz = laser_hz, "laser cycles a second";
    columns = integer(1..=Array::MOST_PIXELS), "pixel = row * columns + column";
    bins = bins, "of a histogram";
    bin_width_ps = fixed, "picoseconds a bin";
    offset_mm = fixed, "added to every range";
    offsets_mm = offsets, "added to that, one for each pixel";
    gate = gate, "first and last bin that may hold a peak";
    masked = masked, "addresses of pixels that are left out";
    sigma_bins = pulse, "standard deviation of the pulse";
    dead_time = integer(0..=u16::MAX), "bins for which the TDC is blind after a photon";
    dither_bins = dither, "by which the longest laser cycle is longer than the shortest";
    dither_seed = integer(0..=MAX_INTEGER), "of the lengths of laser cycles";
    background = rate, "photons a bin and laser cycle of the median pixel";
    glass = rate, "photons a laser cycle and pixel of the cover glass";
    glass_bins = rates, "the same for each bin before the gate";
}

impl SensorSettings {
    /// These settings, and those of `other` that they lack.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        self.first_of(other)
    }

    /// The offset of each pixel in millimetres, if they have any.
    #[must_use]
    pub fn pixel_offsets_mm(&self) -> Vec<f64> {
        let offsets = self.offsets_mm.iter().flatten();
        offsets.map(|mm| mm.to_num()).collect()
    }
}

/// The range of the dither of a laser that can, in bins, unless an option says otherwise. Another LiDAR as bright as
/// the target then makes no more false alarms than there are without it, except in the dark: see
/// `docs/results/methods.md`.
pub const DITHER_BINS: u16 = 128;

/// Reads the range of a dither.
fn dither(text: &str) -> Result<u16, String> {
    let range = integer(0..=Dither::MOST.into())(text)?;
    match Dither::new(range, 0) {
        Ok(_) => Ok(range),
        Err(error) => Err(error.to_string()),
    }
}

/// Reads the first and the last bin of a gate, as `20..119` or `20,119`.
fn gate(text: &str) -> Result<(u16, u16), String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    let ends = ends.and_then(|(first, last)| {
        let bin = integer(0..=u16::MAX);
        Some((bin(first).ok()?, bin(last).ok()?))
    });
    let (first, last) = ends.ok_or("must be FIRST..LAST, as 20..119")?;
    if first > last {
        return Err("the first bin must come before the last".to_owned());
    }
    Ok((first, last))
}

/// Reads the offset of each pixel.
fn offsets(text: &str) -> Result<Vec<I24F8>, String> {
    list(text, &[','], fixed)
}

/// Reads addresses; `none` leaves no pixel out, whatever a search finds.
fn masked(text: &str) -> Result<Vec<u16>, String> {
    match text {
        "none" => Ok(Vec::new()),
        text => list(text, &[','], integer(0..=u16::MAX)),
    }
}

/// Reads the standard deviation of a pulse in bins.
fn pulse(text: &str) -> Result<U8F8, String> {
    const WIDEST: U8F8 = CentredWindow::WIDEST_PULSE;
    let range = format!("must be a number above 0, at most {WIDEST}");
    match real(text) {
        Some(sigma) if sigma > f64::from(WIDEST) => Err(format!(
            "{range}; `rebin` 2 halves the pulse in bins, as does a TDC with wider bins"
        )),
        Some(sigma) if sigma > 0.0 => fixed(text),
        _ => Err(range),
    }
}

/// Reads photons a laser cycle.
fn rate(text: &str) -> Result<f64, String> {
    within(0.0..=1e6)(text)
}

fn rates(text: &str) -> Result<Vec<f64>, String> {
    list(text, &[','], rate)
}

section! {
    RaySettings:
    field_of_view_degrees = degrees, "horizontal, vertical";
    calibration = file, "file with a ray for each pixel";
}

/// Reads the angles of a field of view.
fn degrees(text: &str) -> Result<[f64; 2], String> {
    let angles = angles(text).and_then(|angles| FieldOfView::new(angles).map(|_| angles));
    angles.map_err(|error| error.to_string())
}

fn file(text: &str) -> Result<PathBuf, String> {
    Ok(text.into())
}

impl RaySettings {
    /// These settings, or `other` if there are none: a field of view replaces a calibration, and
    /// the other way round.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        if self != Self::default() {
            other = Self::default();
        }
        self.first_of(other)
    }

    /// [`Rays::slants`] and [`Rays::biases`], if the rays are known.
    ///
    /// # Errors
    /// Fails as [`Self::rays`] does.
    pub fn slants(&self, array: Array) -> anyhow::Result<Option<[Vec<f64>; 2]>> {
        let is_known = *self != Self::default();
        let rays = is_known.then(|| self.rays(array)).transpose()?;
        Ok(rays.map(|(rays, _)| [rays.slants(), rays.biases()]))
    }

    /// The rays of an array, and where they come from: "60x32.2 degrees", or the calibration file.
    ///
    /// # Errors
    /// Fails if the calibration file cannot be read or is for another array.
    pub fn rays(&self, array: Array) -> anyhow::Result<(Rays, String)> {
        if let Some(path) = &self.calibration {
            return Ok((Rays::read(path, array)?, path.display().to_string()));
        }
        let view = match self.field_of_view_degrees {
            Some(degrees) => FieldOfView::new(degrees)?,
            None => FieldOfView::default_for([array.columns(), array.rows()]),
        };
        Ok((Rays::pinhole(array, view), format!("{view} degrees")))
    }
}

section! {
    RunSettings:
    cycles = integer(1..=MAX_INTEGER), "laser cycles";
    seed = integer(0..=MAX_INTEGER), "of every random number";
    photons_per_cycle = positive, "in the brightest pixel of a recording";
    recorded_cycles = integer(1..=MAX_INTEGER), "laser cycles of a recording";
    frame = integer(1..=u16::MAX), "laser cycles, of a frame-based sensor";
    decide_once = boolean, "on all photons of a pixel";
    axes = str::parse, "of a recorded array";
    array = name, "of an archive";
    capture = integer(0..=u16::MAX.into()), "to use of a recording, from 0";
    rebin = integer(1..=512), "neighbouring bins that are added up";
}

fn name(text: &str) -> Result<String, String> {
    Ok(text.to_owned())
}

impl RunSettings {
    /// These settings, and those of `other` that they lack. A recording has one length.
    #[must_use]
    pub fn or(self, mut other: Self) -> Self {
        if self.photons_per_cycle.is_some() || self.recorded_cycles.is_some() {
            (other.photons_per_cycle, other.recorded_cycles) = (None, None);
        }
        self.first_of(other)
    }
}

/// A value as text.
fn as_text<T: Display, S: Serializer>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error> {
    match value {
        None => serializer.serialize_none(),
        Some(value) => serializer.collect_str(value),
    }
}

/// Fixed-point numbers as decimal ones with the fewest digits.
fn decimals<T: Fixed + FromStr, S: Serializer>(
    numbers: &Option<Vec<T>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let Some(numbers) = numbers else {
        return serializer.serialize_none();
    };
    let shortest = numbers.iter().map(|number| shortest(*number).parse());
    let shortest: Result<Vec<f64>, _> = shortest.collect();
    serializer.collect_seq(shortest.map_err(S::Error::custom)?)
}

/// A fixed-point number as a decimal one with the fewest digits.
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
