//! A device with a sensor, and how it is to operate: what was said, what the device says, and
//! what follows.

use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Result, bail, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::I24F8;
use dtof_link::SensorRecord;

use super::monitor::array;
use super::{Client, Stopped};
use dtof_engine::settings::Settings;
use dtof_engine::settings::{Sensor, SettingsFile};
use dtof_events::aer_file::Header;
use dtof_events::clock::LaserClock;
use dtof_options::Refused;
use dtof_photons::masked;

/// How a device operates.
#[derive(Clone, Debug)]
pub struct Setup {
    /// What was said.
    pub asked: SettingsFile,
    /// The same, and of the rest what the device says.
    pub said: SettingsFile,
    /// What follows from it.
    pub settings: Settings,
    /// Pixels, addresses 0 up.
    pub pixels: u16,
    /// Their array.
    pub array: Array,
    /// Laser cycles in a thousand seconds; 0 if that is not known.
    pub laser_millihertz: u64,
    /// What was said is not what the device says, or the device has failed before.
    pub warnings: Vec<String>,
    /// Bins that the sensor measures.
    pub measured_bins: u16,
    /// When its laser cycles began.
    pub began: SystemTime,
}

impl Setup {
    /// That of a device with its first `pixels`, or as many as its sensor has.
    ///
    /// # Errors
    /// If the device is gone, or what was `said` does not suit it.
    pub fn of(client: &mut Client, said: SettingsFile, pixels: Option<u16>) -> Result<Self> {
        // A device without a sensor says so when it is configured.
        let sensor = client.sensor()?.unwrap_or(SensorRecord {
            pixels: client.pixels(),
            bin_width: None,
            offset: I24F8::ZERO,
            laser_millihertz: 0,
            bins: client.bins(),
        });
        let report = client.report()?;
        let pixels = pixels.unwrap_or(sensor.pixels.min(client.pixels()));
        ensure!(pixels > 0, "the device has no pixels");
        let asked = said.clone();
        let said = said.or(SettingsFile {
            sensor: Sensor {
                bin_width_ps: sensor.bin_width,
                offset_mm: Some(sensor.offset),
                ..Sensor::default()
            },
            ..SettingsFile::default()
        });
        ensure!(
            said.sensor.bins.is_none_or(|bins| bins == client.bins()),
            "the settings are for {} bins, the device has {}",
            said.sensor.bins.unwrap_or_default(),
            client.bins()
        );
        let columns = said.sensor.columns;
        // A sensor may be slower than its settings promise.
        let own = LaserClock::from_millihertz(sensor.laser_millihertz);
        let told = said.sensor.laser_hz.map(LaserClock::new).transpose()?;
        let (clock, warning) = LaserClock::known(told, own, "the device");
        let said = with_gate(said, sensor.bins, client.bins());
        let settings = said.settings(client.bins().into())?;
        masked::check(&settings.masked, pixels.into())?;
        if let Some(columns) = columns.filter(|&columns| columns > u32::from(pixels)) {
            bail!(Refused::value(
                "columns",
                columns,
                format!("there are {pixels} pixels")
            ));
        }
        let array = array(pixels, columns);
        Ok(Self {
            settings,
            asked,
            said,
            pixels,
            array: array.ok_or_else(|| {
                let reason = format!("with {pixels} pixels it makes more than 65,536");
                Refused::value("columns", columns.unwrap_or_default(), reason)
            })?,
            laser_millihertz: clock.map_or(0, |clock| clock.millihertz()),
            warnings: warning
                .into_iter()
                .chain(Stopped::warning(&report))
                .collect(),
            measured_bins: sensor.bins,
            began: SystemTime::now(),
        })
    }

    /// The header of its events.
    #[must_use]
    pub fn header(&self) -> Header {
        let start = self.began.duration_since(UNIX_EPOCH).unwrap_or_default();
        Header {
            #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
            bins: self.settings.bins as u32,
            array: self.array,
            bin_width_ps: self.settings.bin_width_ps,
            offset_mm: self.settings.offset_mm,
            laser_millihertz: self.laser_millihertz,
            start_us: i64::try_from(start.as_micros()).unwrap_or(0),
        }
    }
}

/// Without a gate, that of the bins the sensor measures, if it does not measure all.
#[must_use]
pub fn with_gate(settings: SettingsFile, measured_bins: u16, bins: u16) -> SettingsFile {
    let last = measured_bins
        .checked_sub(1)
        .filter(|_| measured_bins < bins);
    let gate = settings.sensor.gate.or(last.map(|last| (0, last)));
    SettingsFile {
        sensor: Sensor {
            gate,
            ..settings.sensor
        },
        ..settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gate_ends_with_the_sensor_unless_it_is_given() {
        let gate = |given, measured| {
            let mut settings = SettingsFile::default();
            settings.sensor.gate = given;
            with_gate(settings, measured, 128).sensor.gate
        };
        assert_eq!(gate(None, 128), None);
        assert_eq!(gate(None, 117), Some((0, 116)));
        assert_eq!(gate(Some((8, 127)), 117), Some((8, 127)));
        assert_eq!(gate(None, 0), None);
    }
}
