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

use dtof_data::option_table;
use dtof_data::options::keys::{
    Kind, POSITIVE, Reader, above_zero, bins, boolean, fixed, integer, real,
};
use dtof_data::options::numbers::{self, MAX_INTEGER, MAX_LASER_HZ, list, shortest};
use dtof_data::photons::axes::Axes;
use dtof_data::photons::geometry::{FieldOfView, Rays, angles};

option_table! {
    /// `[sensor]`: what is known of a sensor.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct SensorSettings {
        laser_hz: u64 = integer(1, MAX_LASER_HZ), "HZ",
            "Laser cycles a second [default: unknown]",
            "laser cycles a second";
        columns: u32 = integer(1, Array::MOST_PIXELS as u64), "N",
            "Photon lists: columns of the array, pixel = row × columns + column [default: one row]",
            "pixel = row * columns + column";
        bins: u16 = bins(), "N",
            "Number of bins after `rebin`, a power of two from 8 to 1024. Longer histograms lose their last bins \
             [default: the file's, or the next power of two; 128 for photon lists]",
            "of a histogram";
        #[serde(serialize_with = "decimal")]
        bin_width_ps: U16F16 = fixed(), "PS",
            "Width of a bin of the file in picoseconds, rounded to 1/65536; in a settings file that of a bin after `rebin` \
             [default: 250; for logs the sensor's]",
            "picoseconds a bin, after rebin";
        #[serde(serialize_with = "decimal")]
        offset_mm: I24F8 = fixed(), "MM",
            "Millimetres added to every range, rounded to 1/256 [default: 0; for logs the sensor's]",
            "added to every range";
        #[serde(serialize_with = "decimals")]
        offsets_mm: Vec<I24F8> = OFFSETS, "MM,MM,...",
            "Millimetres added to `offset_mm` for each pixel, in the order of the addresses, rounded to 1/256 [default: \
             0]",
            "added to that, one for each pixel";
        gate: (u16, u16) = GATE, "FIRST..LAST",
            "First and last bin that may hold the peak, as 20..119 [default: all bins]",
            "first and last bin that may hold a peak";
        masked: Vec<u16> = MASKED, "PIXELS",
            "Pixels to leave out, such as hot and dead ones, as 3,70, beside those that are found; none leaves out none",
            "addresses of pixels that are left out";
        #[serde(serialize_with = "decimal")]
        sigma_bins: U8F8 = PULSE, "S",
            "Standard deviation of the pulse in bins, at most 1.75, rounded to 1/256. It sets the window for the depth \
             [default: the depth is the centroid of three bins]",
            "standard deviation of the pulse";
        dead_time: u16 = integer(0, 65_535), "BINS",
            "Bins for which the TDC is blind after a photon, 0 to 65535. With all bins of a histogram it takes the \
             first photon of a laser cycle only. Fewer are for the window rule without `binning` [default: the \
             sensor's, else 0]",
            "bins for which the TDC is blind after a photon";
        dither_bins: u16 = DITHER, "BINS",
            "Dither against other LiDARs: the longest laser cycle takes so many bins more than the shortest, an even \
             number up to 254; 0 is off [default: 128, or as many as the sensor can]",
            "by which the longest laser cycle is longer than the shortest";
        dither_seed: u64 = integer(0, MAX_INTEGER), "N",
            "Seed of the random lengths of laser cycles [default: from the clock]",
            "of the lengths of laser cycles";
        background: f64 = RATE, "",
            "Background photons a bin and laser cycle of the median pixel",
            "photons a bin and laser cycle of the median pixel";
        glass: f64 = RATE, "",
            "Photons a laser cycle and pixel that the cover glass sends back, before the gate",
            "photons a laser cycle and pixel of the cover glass";
        glass_bins: Vec<f64> = RATES, "",
            "The same for each bin before the gate, from bin 0 on",
            "the same for each bin before the gate";
    }
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

const DITHER: Reader<u16> = Reader::new(Kind::Even(Dither::MOST as u64), |_, text| dither(text));

/// Reads the range of a dither.
fn dither(text: &str) -> Result<u16, String> {
    let range = numbers::integer(0..=Dither::MOST.into())(text)?;
    match Dither::new(range, 0) {
        Ok(_) => Ok(range),
        Err(error) => Err(error.to_string()),
    }
}

const GATE: Reader<(u16, u16)> =
    Reader::new(Kind::Integers("two bins, [20, 119]"), |_, text| gate(text));

/// Reads the first and the last bin of a gate, as `20..119` or `20,119`.
fn gate(text: &str) -> Result<(u16, u16), String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    let ends = ends.and_then(|(first, last)| {
        let bin = numbers::integer(0..=u16::MAX);
        Some((bin(first).ok()?, bin(last).ok()?))
    });
    let (first, last) = ends.ok_or("must be FIRST..LAST, as 20..119; in a file [20, 119]")?;
    if first > last {
        return Err("the first bin must come before the last".to_owned());
    }
    Ok((first, last))
}

/// The offset of each pixel.
const OFFSETS: Reader<Vec<I24F8>> =
    Reader::new(Kind::SignedNumbers("numbers, one a pixel"), |_, text| {
        list(text, &[','], numbers::fixed)
    });

/// Addresses; `none` leaves no pixel out, whatever a search finds.
const MASKED: Reader<Vec<u16>> = Reader::new(
    Kind::Integers("addresses, [3, 70], or 'none'; [] adds none"),
    |_, text| match text {
        "none" => Ok(Vec::new()),
        text => list(text, &[','], numbers::integer(0..=u16::MAX)),
    },
);

/// The widest pulse that a window for the depth suits, in bins.
const WIDEST_PULSE: f64 = CentredWindow::WIDEST_PULSE.to_bits() as f64 / 256.0;

const PULSE: Reader<U8F8> = Reader::new(Kind::AboveZero(WIDEST_PULSE), |_, text| pulse(text));

/// Reads the standard deviation of a pulse in bins.
fn pulse(text: &str) -> Result<U8F8, String> {
    let too_wide = |range| match numbers::real(text) {
        Some(sigma) if sigma > WIDEST_PULSE => {
            format!("{range}; `rebin` 2 halves the pulse in bins, as does a TDC with wider bins")
        }
        _ => range,
    };
    above_zero(WIDEST_PULSE).read(text).map_err(too_wide)?;
    numbers::fixed(text)
}

/// Photons a laser cycle.
const RATE: Reader<f64> = real(0.0, 1e6);

const RATES: Reader<Vec<f64>> = Reader::new(Kind::Numbers("numbers, one a bin"), |_, text| {
    list(text, &[','], |text| RATE.read(text))
});

option_table! {
    /// `[rays]`: where pixels look.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct RaySettings {
        field_of_view_degrees: [f64; 2] = DEGREES, "HxV",
            "Field of view in degrees from edge to edge, so that a flat target gives the offset of each pixel [default: \
             unknown]",
            "horizontal, vertical";
        calibration: PathBuf = Reader::new(Kind::File, |_, text| Ok(text.into())), "FILE",
            "Instead of `field_of_view_degrees`: TOML file with a direction for each pixel; docs/export.md lists its keys",
            "file with a ray for each pixel";
    }
}

const DEGREES: Reader<[f64; 2]> = Reader::new(Kind::Numbers("two numbers, [60, 40]"), |_, text| {
    degrees(text)
});

/// Reads the angles of a field of view.
fn degrees(text: &str) -> Result<[f64; 2], String> {
    let angles = angles(text).and_then(|angles| FieldOfView::new(angles).map(|_| angles));
    angles.map_err(|error| format!("{error}; in a file [60, 32.2]"))
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

option_table! {
    /// `[run]`: what is replayed or simulated.
    #[derive(Clone, Debug, Default, PartialEq, Serialize)]
    pub struct RunSettings {
        cycles: u64 = integer(1, MAX_INTEGER), "N",
            "Laser cycles to replay at most [default: all of a photon list and with `decide_once`, else 10000]",
            "laser cycles";
        seed: u64 = integer(0, MAX_INTEGER), "N",
            "Seed of every random number [default: 1]",
            "of every random number";
        photons_per_cycle: f64 = POSITIVE, "R",
            "Histograms: photons a laser cycle in the brightest unmasked pixel of each capture [default: 1]",
            "in the brightest pixel of a recording";
        recorded_cycles: u64 = integer(1, MAX_INTEGER), "N",
            "Histograms: laser cycles of each capture",
            "laser cycles of a recording";
        frame: u16 = integer(1, 65_535), "N",
            "Simulate a frame-based sensor for comparison: every N laser cycles each pixel reports its highest bin, if \
             that is above the background",
            "laser cycles, of a frame-based sensor";
        decide_once: bool = boolean(), "YES",
            "Events are the decisions of depth.npy, one a pixel on all of its photons, instead of asynchronous ones. \
             Takes all laser cycles unless `cycles` says less",
            "on all photons of a pixel";
        #[serde(serialize_with = "as_text")]
        axes: Axes = Reader::new(Kind::Names("names of axes"), |_, text| text.parse()), "AXIS,AXIS,...",
            "Arrays of histograms: meaning of each axis: captures, rows, columns or bins [default: the last is bins, \
             the one before columns, all others are rows]",
            "of a recorded array";
        array: String = Reader::new(Kind::Text, |_, text| Ok(text.to_owned())), "NAME",
            ".npz: name of the array [default: the only one]",
            "of an archive";
        capture: u32 = integer(0, 65_535), "N",
            "Arrays with captures, and logs: the capture or frame to use, counted from 0 [default: all]",
            "to use of a recording, from 0";
        rebin: u16 = integer(1, 512), "K",
            "Number of neighbouring bins to add up [default: 1]",
            "neighbouring bins that are added up";
    }
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
