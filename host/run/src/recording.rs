//! The options that say what a recording is, the same for every job.

use anyhow::{Result, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::U16F16;

use super::given::Given;
use dtof_engine::settings::{Run, Sensor, SettingsFile};
use dtof_options::rows::grouped;
use dtof_options::{Refused, plain};
use dtof_photons::medium::Medium;
use dtof_photons::open::{BIN_WIDTH_PS, Known, Opening};
use dtof_photons::recorded::RecordingLength;

/// What a recording is.
pub const RECORDING: &[&str] = &[
    "axes",
    "array",
    "columns",
    "rebin",
    "bins",
    "bin_width_ps",
    "offset_mm",
    "photons_per_cycle",
    "recorded_cycles",
    "laser_hz",
];

impl Given {
    /// What holds for a recording: the options, then the file.
    ///
    /// # Errors
    /// What is wrong with these.
    pub fn merged_for_recording(&self) -> Result<SettingsFile> {
        self.for_recording_over(self.read()?)
    }

    /// The options, of which the width is that of a bin of the recording, then `file`, of which it
    /// is that of a bin that is used.
    pub(super) fn for_recording_over(&self, file: SettingsFile) -> Result<SettingsFile> {
        let mut options = self.options.clone();
        let width = options.sensor.bin_width_ps.take();
        let mut merged = options.or(file);
        ensure!(
            self.options.run.rebin.is_none()
                || width.is_some()
                || merged.sensor.bin_width_ps.is_none(),
            Refused::new(
                "rebin",
                "is for other bins than those of the settings file; leave one of them out"
            )
        );
        if let Some(width) = width {
            let used = width.checked_mul_int(merged.run.rebin.unwrap_or(1).into());
            let refused = || Refused::value("bin_width_ps", width, "is too much for `rebin`");
            merged.sensor.bin_width_ps = Some(used.ok_or_else(refused)?);
            merged.override_key("bin_width_ps");
        }
        Ok(merged)
    }

    /// Options that say nothing about a device are refused.
    ///
    /// # Errors
    /// If there are any.
    pub fn suits_device(&self) -> Result<(), Refused> {
        let Run {
            axes, array, rebin, ..
        } = &self.options.run;
        let of_files = [
            ("axes", axes.is_some()),
            ("array", array.is_some()),
            ("rebin", rebin.is_some()),
            ("bins", self.options.sensor.bins.is_some()),
        ];
        if let Some((key, _)) = of_files.iter().find(|(_, is_there)| *is_there) {
            return Err(Refused::new(*key, "is of recordings, not of a device"));
        }
        match self.length() {
            Some(key) => Err(Refused::new(
                key,
                "is of recordings: this device counts its laser cycles",
            )),
            None => Ok(()),
        }
    }

    /// The option that says how long a recording is.
    fn length(&self) -> Option<&'static str> {
        let run = &self.options.run;
        match (run.photons_per_cycle, run.recorded_cycles) {
            (Some(_), _) => Some("photons_per_cycle"),
            (None, Some(_)) => Some("recorded_cycles"),
            (None, None) => None,
        }
    }

    /// Options that say nothing about a list of photons are refused.
    ///
    /// # Errors
    /// If there are any, and it is one.
    pub fn suits(&self, input: &Medium, known: &Known) -> Result<(), Refused> {
        match self.length().filter(|_| known.is_list) {
            Some(key) => Err(Refused::new(
                key,
                format!("is for histograms; {} holds photons", plain(input)),
            )),
            None => Ok(()),
        }
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
pub fn of_file(known: &Known, array: Array) -> SettingsFile {
    SettingsFile {
        sensor: Sensor {
            columns: Some(array.columns()),
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
