//! A calibration as a settings file.

use anyhow::{Context, Result};
use dtof_core::fixed::types::{I24F8, U4F12, U16F16};

use super::{Calibration, Glass, Length, Tdc};
use dtof_engine::settings::{DetectionSettings, RuleName, SensorSettings, SettingsFile};

impl Calibration {
    /// The settings of the sensor. Keys that were not found are taken from `before`: an older calibration
    /// or the options of the user.
    ///
    /// # Errors
    /// Fails if a number does not fit its format.
    pub fn settings(&self, before: SettingsFile) -> Result<SettingsFile> {
        let is_absolute = self.length != Length::Unknown;
        let whole = |value: f64| is_absolute.then(|| four_digits(value));
        let offsets = self.pixel_offsets.as_ref().map(|pixels| &pixels.mm);
        let offsets = offsets.filter(|offsets| !offsets.is_empty()).map(|mm| {
            let tenths = mm.iter().map(|mm| (mm * 10.0).round() / 10.0);
            tenths.map(I24F8::saturating_from_num).collect()
        });
        let offset = self.offset.map(|offset| {
            let mm = I24F8::checked_from_num(offset.mm);
            mm.with_context(|| format!("an offset of {:.0} mm is too large", offset.mm))
        });
        let width = U16F16::checked_from_num(self.bin_width_ps);
        let glass = self.glass().filter(|_| self.gate.0 > 0);
        let sensor = SensorSettings {
            laser_hz: before.sensor.laser_hz,
            dither_bins: before.sensor.dither_bins,
            dither_seed: before.sensor.dither_seed,
            columns: before.sensor.columns,
            bins: u16::try_from(self.bins).ok(),
            bin_width_ps: Some(width.context("the bin width is too large")?),
            offset_mm: offset.transpose()?.or(before.sensor.offset_mm),
            offsets_mm: offsets.or(before.sensor.offsets_mm),
            gate: self.written_gate(),
            masked: Some(self.masked()?).filter(|masked| !masked.is_empty()),
            sigma_bins: Some(self.detection.sigma_bins),
            dead_time: match self.tdc {
                Some(Tdc::DeadTime { bins, .. }) => Some(u16::try_from(bins)?),
                _ => None,
            },
            background: whole(self.pixels.background),
            glass: glass.and_then(|glass| whole(glass.photons)),
            glass_bins: glass.filter(|_| is_absolute).map(|glass| {
                let before_gate = glass.shape.iter().take(self.gate.0.into());
                before_gate.map(|&rate| four_digits(rate)).collect()
            }),
        };
        // The z that was found is for looks.
        let has_looks = before.run.decide_once != Some(true);
        let z = |found: Option<f64>| found.filter(|_| has_looks);
        let found = &self.detection;
        let detection = DetectionSettings {
            rule: Some(RuleName::Window),
            window: Some(found.window),
            z: z(found.z).map(U4F12::saturating_from_num),
            false_alarm: z(found.z).is_none().then_some(found.false_alarm),
            half_widths: found.half_widths,
            min_count: Some(found.min_count),
            l1: Some(found.l1),
            l2: Some(found.l2),
            x: Some(found.x),
            ..DetectionSettings::default()
        };
        // The offset was found with the window of this pulse.
        let mut older = before.detection;
        (older.estimator, older.half_widths) = (None, None);
        let found = SettingsFile {
            sensor,
            detection: detection.or(older),
            rays: before.rays,
            run: before.run,
            file: before.file,
            dead_time_of_sensor: None,
            dither_of_laser: None,
        };
        Ok(found.without_recording())
    }

    /// The gate, if it excludes a bin.
    #[must_use]
    pub fn written_gate(&self) -> Option<(u16, u16)> {
        let (first, last) = self.gate;
        (first > 0 || usize::from(last) + 1 < self.bins).then_some(self.gate)
    }

    /// The crosstalk of the cover glass, if there is any.
    #[must_use]
    pub const fn glass(&self) -> Option<&Glass> {
        self.nearest.glass()
    }

    /// Addresses of the hot and dead pixels of all captures.
    ///
    /// # Errors
    /// Fails if there are more than 65,536 pixels.
    pub fn masked(&self) -> Result<Vec<u16>> {
        let mut masked = Vec::new();
        for capture in 0..self.captures {
            for pixel in self.pixels.hot.iter().chain(&self.pixels.dead) {
                let address = u16::try_from(capture * self.array_pixels + pixel);
                masked.push(address.context("more than 65,536 pixels")?);
            }
        }
        masked.sort_unstable();
        Ok(masked)
    }
}

/// To four significant digits.
fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
