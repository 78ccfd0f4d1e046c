//! Options that describe a recording, the same for every job.

use anyhow::{Result, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::U16F16;

use super::given::Given;
use dtof_data::options::keys::Key;
use dtof_data::options::rows::grouped;
use dtof_data::options::{Refused, plain};
use dtof_data::photons::input::Input;
use dtof_data::photons::masked;
use dtof_data::photons::open::{BIN_WIDTH_PS, Metadata, ReadOptions};
use dtof_data::photons::recorded::RecordingLength;
use dtof_engine::settings::{RunSettings, SensorSettings, SettingsFile};

/// The options that describe a recording.
pub const RECORDING: &[Key] = &[
    Key::of(RunSettings::KEYS, "axes"),
    Key::of(RunSettings::KEYS, "array"),
    Key::of(RunSettings::KEYS, "capture"),
    Key::of(SensorSettings::KEYS, "columns"),
    Key::of(RunSettings::KEYS, "rebin"),
    Key::of(SensorSettings::KEYS, "bins"),
    Key::of(SensorSettings::KEYS, "bin_width_ps"),
    Key::of(SensorSettings::KEYS, "offset_mm"),
    Key::of(SensorSettings::KEYS, "offsets_mm"),
    Key::of(RunSettings::KEYS, "photons_per_cycle"),
    Key::of(RunSettings::KEYS, "recorded_cycles"),
    Key::of(SensorSettings::KEYS, "laser_hz"),
];
/// The options for the laser cycles of recorded histograms.
const LENGTH: &[&str] = &["photons_per_cycle", "recorded_cycles"];

/// Refuses photons that count once per bin, if that is on and the recording is no list of photons.
///
/// # Errors
/// Returns the reason.
pub(super) fn check_once_per_bin(is_on: bool, is_list: bool) -> Result<(), Refused> {
    if is_on && !is_list {
        let reason = "needs photons: a histogram does not say which came in one laser cycle";
        return Err(Refused::new("once_per_bin", reason));
    }
    Ok(())
}

impl Given {
    /// The options over the file, for a recording.
    ///
    /// # Errors
    /// Fails if the file cannot be read, or if `rebin` and `bin_width_ps` do not fit.
    pub fn merged_for_recording(&self) -> Result<SettingsFile> {
        self.for_recording_over(self.read()?)
    }

    /// The options over `file`. A bin width among the options is that of the recorded bins, one in the
    /// file that of bins after `rebin`.
    pub(super) fn for_recording_over(&self, file: SettingsFile) -> Result<SettingsFile> {
        let mut options = self.options.clone();
        let width = options.sensor.bin_width_ps.take();
        let of_file = file.run.rebin.unwrap_or(1);
        let mut merged = options.or(file);
        ensure!(
            self.options.run.rebin.unwrap_or(of_file) == of_file
                || width.is_some()
                || merged.sensor.bin_width_ps.is_none(),
            Refused::new(
                "rebin",
                "changes the bins that the settings file is for; give `bin_width_ps`, that of the recording, with it"
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

    /// Checks that options suit a device.
    ///
    /// # Errors
    /// Returns an option that is only for recordings.
    pub fn suits_device(&self) -> Result<(), Refused> {
        let keys = &["axes", "array", "capture", "rebin", "bins"];
        self.refuse(keys, "is for recordings, not for a device")?;
        self.refuse(
            LENGTH,
            "is for recordings: this device counts its laser cycles",
        )
    }

    /// Checks that options suit a recording.
    ///
    /// # Errors
    /// Returns an option that is only for histograms, if it is a photon list.
    pub fn suits(&self, input: &Input, metadata: &Metadata) -> Result<(), Refused> {
        if !metadata.is_list {
            return Ok(());
        }
        self.refuse(
            LENGTH,
            &format!("is for histograms; {} holds photons", plain(input)),
        )
    }
}

/// Makes the pixels that are left out those of the capture that is used. They are addresses of all `captures` if one of
/// them is past the `pixels` of a capture. A mask of other captures only is none.
///
/// # Errors
/// Fails if an address is past those of all captures.
pub(super) fn mask_capture(
    masked: &mut Option<Vec<u16>>,
    capture: Option<u32>,
    pixels: u32,
    captures: usize,
) -> Result<()> {
    let (Some(capture), Some(addresses)) = (capture, &masked) else {
        return Ok(());
    };
    masked::check(addresses, captures * pixels as usize)?;
    if addresses.iter().any(|&pixel| u32::from(pixel) >= pixels) {
        let of_capture = |&pixel: &u16| {
            let own = u32::from(pixel).checked_sub(capture.checked_mul(pixels)?)?;
            u16::try_from(own).ok().filter(|_| own < pixels)
        };
        let own: Vec<u16> = addresses.iter().filter_map(of_capture).collect();
        *masked = Some(own).filter(|own| !own.is_empty());
    }
    Ok(())
}

/// How to open a recording with these settings.
#[must_use]
pub fn read_options(requested: &SettingsFile) -> ReadOptions {
    let RunSettings {
        cycles,
        seed,
        photons_per_cycle,
        recorded_cycles,
        axes,
        array,
        capture,
        rebin,
        decide_once,
        ..
    } = requested.run.clone();
    let recorded = recorded_cycles.map(RecordingLength::Cycles);
    let rate = photons_per_cycle.map(RecordingLength::PhotonsPerCycle);
    let rebin = rebin.unwrap_or(1);
    let width = requested.sensor.bin_width_ps;
    ReadOptions {
        columns: requested.sensor.columns,
        bins: requested.sensor.bins,
        rebin,
        axes,
        array,
        capture,
        bin_width_ps: width.map(|width| width / U16F16::from_num(rebin.max(1))),
        length: recorded.or(rate),
        cycles: cycles.or(decide_once.filter(|&once| once).map(|_| u64::MAX)),
        seed: seed.unwrap_or(1),
        masked: requested.sensor.masked.clone().unwrap_or_default(),
        // Whether or not the rule weighs it.
        dead_time: requested
            .sensor
            .dead_time
            .or(requested.dead_time_of_sensor)
            .unwrap_or(0),
        once_per_bin: requested.detection.once_per_bin == Some(true),
    }
}

/// The settings that a recording contains.
#[must_use]
pub fn settings_of_file(metadata: &Metadata, array: Array) -> SettingsFile {
    SettingsFile {
        sensor: SensorSettings {
            columns: Some(array.columns()),
            bins: u16::try_from(metadata.bins).ok(),
            bin_width_ps: Some(metadata.bin_width_ps),
            offset_mm: metadata.offset_mm,
            gate: metadata.gate,
            ..SensorSettings::default()
        },
        // Its times count from the own pulses on, whatever the dither of the laser was.
        dither_of_laser: Some((0, 0)),
        ..SettingsFile::default()
    }
}

/// Warnings about a recording, and about photons that are left out: a line each.
pub fn warnings(metadata: &Metadata) -> impl Iterator<Item = String> + '_ {
    let cut_off = Some(metadata.cut_off).filter(|&photons| photons > 0);
    let cut_off =
        cut_off.map(|photons| format!("{} photons in bins that were cut off", grouped(photons)));
    metadata.warnings.iter().cloned().chain(cut_off)
}

/// Warns that the bin width was assumed, if it was.
#[must_use]
pub fn bin_width_warning(metadata: &Metadata) -> Option<String> {
    metadata.is_width_assumed.then(|| {
        format!("bins are taken to be {BIN_WIDTH_PS} ps wide; --bin-width-ps changes that")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_of_another_capture_is_none() {
        let masked = |addresses: &[u16]| {
            let mut masked = Some(addresses.to_vec());
            mask_capture(&mut masked, Some(1), 4, 3).map(|()| masked)
        };
        assert_eq!(masked(&[1, 5, 9]).unwrap(), Some(vec![1]));
        // As if the file had no other capture.
        assert_eq!(masked(&[3]).unwrap(), Some(vec![3]));
        assert_eq!(masked(&[]).unwrap(), Some(Vec::new()));
        // Those that are found take its place.
        assert_eq!(masked(&[8, 11]).unwrap(), None);
        let error = masked(&[5, 12]).unwrap_err().to_string();
        assert!(error.contains("there are 12 pixels"), "{error}");
    }
}
