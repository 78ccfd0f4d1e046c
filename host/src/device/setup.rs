//! A device with a sensor, and how it is to operate: what was said, what the device says, and
//! what follows.

use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Result, bail, ensure};
use dtof_core::fixed::types::I24F8;
use dtof_link::SensorRecord;

use super::Client;
use super::monitor::array;
use crate::engine::settings::Settings;
use crate::events::aer_file::Header;
use crate::input::masked;
use crate::input::source::Geometry;
use crate::settings::{Sensor, SettingsFile};

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
    pub geometry: Geometry,
    /// Laser cycles in a thousand seconds; 0 if that is not known.
    pub laser_millihertz: u64,
    /// What was said is not what the device says.
    pub warning: Option<String>,
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
        });
        let pixels = pixels.unwrap_or(sensor.pixels.min(client.pixels()));
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
        let told = said.sensor.laser_hz.map_or(0, |hz| hz.saturating_mul(1000));
        let (laser_millihertz, warning) = laser(told, sensor.laser_millihertz);
        let setup = Self {
            settings: said.settings(client.bins().into())?,
            asked,
            said,
            pixels,
            geometry: array(pixels, columns),
            laser_millihertz,
            warning,
            began: SystemTime::now(),
        };
        masked::check(&setup.settings.masked, pixels.into())?;
        if let Some(columns) = columns.filter(|&columns| columns > u32::from(pixels)) {
            bail!("--columns {columns}: there are {pixels} pixels");
        }
        Ok(setup)
    }

    /// The header of its events.
    #[must_use]
    pub fn header(&self) -> Header {
        let start = self.began.duration_since(UNIX_EPOCH).unwrap_or_default();
        Header {
            #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
            bins: self.settings.bins as u32,
            geometry: self.geometry,
            bin_width_ps: self.settings.bin_width_ps,
            offset_mm: self.settings.offset_mm,
            laser_millihertz: self.laser_millihertz,
            start_us: i64::try_from(start.as_micros()).unwrap_or(0),
        }
    }
}

/// Laser cycles in a thousand seconds, and a warning: what was `said` comes before what the device
/// says, as a sensor may be slower than its settings promise. It has whole hertz: to these, what the
/// device says is exact.
fn laser(said: u64, device: u64) -> (u64, Option<String>) {
    if said == 0 || device / 1000 * 1000 == said {
        return (device, None);
    }
    let hz = |millihertz: u64| millihertz as f64 / 1000.0;
    let differ = || {
        let (device, said) = (hz(device), hz(said));
        format!("the device has a laser of {device} Hz; times are for {said} Hz, as was said")
    };
    (said, (device > 0).then(differ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_said_of_the_laser_holds_and_a_difference_is_told() {
        assert_eq!(laser(0, 0), (0, None));
        assert_eq!(laser(0, 4_165_818), (4_165_818, None));
        assert_eq!(laser(4_165_000, 4_165_818), (4_165_818, None));
        assert_eq!(laser(10_000_000, 0), (10_000_000, None));
        let (rate, warning) = laser(3_000_000, 4_165_818);
        assert_eq!(rate, 3_000_000);
        let warning = warning.unwrap();
        assert!(
            warning.contains("4165.818 Hz") && warning.contains("3000 Hz"),
            "{warning}"
        );
    }
}
