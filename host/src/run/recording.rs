//! The options that say what a recording is, the same for every command.

use crate::cli::arguments::{MOST_WHOLE, bins, fixed, positive, whole};
use crate::input::axes::Axes;
use crate::input::medium::Medium;
use crate::input::open::{BIN_WIDTH_PS, Known, Opening};
use crate::input::recorded::RecordingLength;
use crate::input::source::Geometry;
use crate::rows::grouped;
use crate::settings::{Run, Sensor, SettingsFile};
use anyhow::{Result, ensure};
use clap::Args;
use dtof_core::fixed::types::{I24F8, U16F16};

/// What a recording is.
#[derive(Args)]
pub struct Recording {
    /// Arrays of histograms: what each axis is, of captures, rows, columns and bins
    /// [default: the last is bins, the one before columns, all others are rows]
    #[arg(long, value_name = "AXIS,AXIS,...")]
    axes: Option<Axes>,
    /// .npz: the array to read [default: the only one]
    #[arg(long, value_name = "NAME")]
    array: Option<String>,
    /// Photon lists: columns of the array, pixel = row × columns + column [default: one row]
    #[arg(long, value_name = "N", value_parser = whole(1..=65_536_u32))]
    columns: Option<u32>,
    /// Add up so many neighbouring bins [default: 1]
    #[arg(long, value_name = "K", value_parser = whole(1..=512_u16))]
    rebin: Option<u16>,
    /// Bins to use, after --rebin, a power of two from 8 to 1024. Of histograms with more the
    /// last are cut off [default: as many as there are, or the next power of two; 128 of
    /// photon lists]
    #[arg(long, value_name = "N", value_parser = bins)]
    bins: Option<u16>,
    /// Picoseconds a bin of the file, rounded to 1/65536 [default: 250; of logs that of the
    /// sensor]
    #[arg(long, value_name = "PS", value_parser = fixed::<U16F16>, allow_hyphen_values = true)]
    bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range, rounded to 1/256 [default: 0; of logs that of the
    /// sensor]
    #[arg(long, value_name = "MM", value_parser = fixed::<I24F8>, allow_hyphen_values = true)]
    offset_mm: Option<I24F8>,
    /// Histograms: photons a laser cycle in the brightest pixel of each capture that is not
    /// masked [default: 1]
    #[arg(long, value_name = "R", value_parser = positive, conflicts_with = "recorded_cycles")]
    photons_per_cycle: Option<f64>,
    /// Histograms: laser cycles that each capture lasted
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    recorded_cycles: Option<u64>,
    /// Laser cycles a second [default: not known]
    #[arg(long, value_name = "HZ", value_parser = whole(1..=1_000_000_000_000_u64))]
    laser_hz: Option<u64>,
}

impl Recording {
    /// What these options say, to which `more` adds the others and the settings file.
    ///
    /// # Errors
    /// What is wrong with these.
    pub fn said(
        &self,
        more: impl FnOnce(SettingsFile) -> Result<SettingsFile>,
    ) -> Result<SettingsFile> {
        let options = SettingsFile {
            sensor: Sensor {
                laser_hz: self.laser_hz,
                columns: self.columns,
                bins: self.bins,
                offset_mm: self.offset_mm,
                ..Sensor::default()
            },
            run: Run {
                photons_per_cycle: self.photons_per_cycle,
                recorded_cycles: self.recorded_cycles,
                axes: self.axes.clone(),
                array: self.array.clone(),
                rebin: self.rebin,
                ..Run::default()
            },
            ..SettingsFile::default()
        };
        let mut said = more(options)?;
        ensure!(
            self.rebin.is_none()
                || self.bin_width_ps.is_some()
                || said.sensor.bin_width_ps.is_none(),
            "--rebin: the bins of the settings file are others; leave one of them out"
        );
        if let Some(width) = self.bin_width_ps {
            // Settings are of the bins that are used.
            let used = width.checked_mul_int(said.run.rebin.unwrap_or(1).into());
            ensure!(
                used.is_some(),
                "--bin-width-ps {width}: too much for --rebin"
            );
            said.sensor.bin_width_ps = used;
        }
        Ok(said)
    }

    /// Options that say nothing about a device are refused.
    ///
    /// # Errors
    /// If there are any.
    pub fn suits_device(&self) -> Result<()> {
        let of_files = [
            ("--axes", self.axes.is_some()),
            ("--array", self.array.is_some()),
            ("--rebin", self.rebin.is_some()),
            ("--bins", self.bins.is_some()),
        ];
        for (option, is_there) in of_files {
            ensure!(!is_there, "{option} is of recordings, not of a device");
        }
        ensure!(
            !self.has_length(),
            "--recorded-cycles and --photons-per-cycle: this device counts its laser cycles"
        );
        Ok(())
    }

    /// Whether they say how long a recording is.
    #[must_use]
    pub fn has_length(&self) -> bool {
        self.photons_per_cycle.is_some() || self.recorded_cycles.is_some()
    }

    /// Options that say nothing about a list of photons are refused.
    ///
    /// # Errors
    /// If there are any, and it is one.
    pub fn suits(&self, input: &Medium, known: &Known) -> Result<()> {
        ensure!(
            !(known.is_list && self.has_length()),
            "--photons-per-cycle and --recorded-cycles are for histograms; {input} holds photons"
        );
        Ok(())
    }
}

/// How a recording is opened, as is said.
#[must_use]
pub fn opening(said: &SettingsFile) -> Opening {
    let Run {
        cycles,
        seed,
        photons_per_cycle,
        recorded_cycles,
        axes,
        array,
        rebin,
        ..
    } = said.run.clone();
    let recorded = recorded_cycles.map(RecordingLength::Cycles);
    let rate = photons_per_cycle.map(RecordingLength::PhotonsPerCycle);
    let rebin = rebin.unwrap_or(1);
    let width = said.sensor.bin_width_ps;
    Opening {
        columns: said.sensor.columns,
        bins: said.sensor.bins,
        rebin,
        axes,
        array,
        bin_width_ps: width.map(|width| width / U16F16::from_num(rebin.max(1))),
        length: recorded.or(rate),
        cycles: cycles.unwrap_or(10_000),
        seed: seed.unwrap_or(1),
        whole: None,
        masked: said.sensor.masked.clone().unwrap_or_default(),
    }
}

/// What the file says.
#[must_use]
pub fn of_file(known: &Known, geometry: Geometry) -> SettingsFile {
    SettingsFile {
        sensor: Sensor {
            columns: Some(geometry.columns),
            bins: u16::try_from(known.bins).ok(),
            bin_width_ps: Some(known.bin_width_ps),
            offset_mm: known.offset_mm,
            gate: known.gate,
            ..Sensor::default()
        },
        ..SettingsFile::default()
    }
}

/// What is surely wrong with the recording, and what of it is left out: a line each.
pub fn warnings(known: &Known) -> impl Iterator<Item = String> + '_ {
    let cut_off = Some(known.cut_off).filter(|&photons| photons > 0);
    let cut_off =
        cut_off.map(|photons| format!("{} photons in bins that were cut off", grouped(photons)));
    known.warnings.iter().cloned().chain(cut_off)
}

/// That nobody has told how wide a bin is, if nobody has.
#[must_use]
pub fn warning_of_width(known: &Known, said: &SettingsFile) -> Option<String> {
    let is_known = said.sensor.bin_width_ps.is_some() || known.bin_width_ps != BIN_WIDTH_PS;
    (!is_known).then(|| {
        format!("bins are taken to be {BIN_WIDTH_PS} ps wide; --bin-width-ps says otherwise")
    })
}
