//! A device with a sensor, and how it operates: the options, the device's own values and the
//! resulting settings.

use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Result, ensure};
use dtof_core::Array;
use dtof_core::fixed::types::I24F8;
use dtof_link::{DynamicDepth, SensorRecord};

use super::monitor::array;
use super::{Client, HostTimeout, Stopped, Task};
use dtof_data::events::aer_file::Header;
use dtof_data::events::clock::LaserClock;
use dtof_data::options::Refused;
use dtof_data::photons::masked;
use dtof_engine::settings::Settings;
use dtof_engine::settings::{DITHER_BINS, SensorSettings, SettingsFile};

/// How a device operates.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The options.
    pub requested: SettingsFile,
    /// The options, completed by the device's own values.
    pub effective: SettingsFile,
    /// The resulting settings.
    pub settings: Settings,
    /// Number of pixels, with addresses from 0.
    pub pixels: u16,
    /// Array of these pixels.
    pub array: Array,
    /// Laser cycles in a thousand seconds; 0 if unknown.
    pub laser_millihertz: u64,
    /// Warnings: the options contradict the device, or it has failed before.
    pub warnings: Vec<String>,
    /// When its laser cycles began.
    pub began: SystemTime,
    sensor: SensorRecord,
    counter_bits: u8,
    bins: u16,
}

impl Setup {
    /// The setup of a device with its first `pixels`, or with as many as its sensor has.
    ///
    /// # Errors
    /// Fails if the device is gone or `requested` does not suit it.
    pub fn of(client: &mut Client, requested: SettingsFile, pixels: Option<u16>) -> Result<Self> {
        let counter_bits = client.counter_bits()?;
        // A device without a sensor refuses its configuration later.
        let sensor = client.sensor()?.unwrap_or(SensorRecord {
            pixels: client.pixels(),
            bin_width: None,
            offset: I24F8::ZERO,
            laser_millihertz: 0,
            bins: client.bins(),
            dead_time: 0,
            most_dither: 0,
        });
        let report = client.report()?;
        let pixels = pixels.unwrap_or(sensor.pixels.min(client.pixels()));
        let mut setup = Self::new(sensor, counter_bits, client.bins(), requested, pixels)?;
        setup.warnings.extend(Stopped::warning(&report));
        Ok(setup)
    }

    /// The same device with other options.
    ///
    /// # Errors
    /// Fails if `requested` does not suit the device.
    pub fn with_requested(&self, requested: SettingsFile) -> Result<Self> {
        Self::new(
            self.sensor,
            self.counter_bits,
            self.bins,
            requested,
            self.pixels,
        )
    }

    fn new(
        sensor: SensorRecord,
        counter_bits: u8,
        bins: u16,
        requested: SettingsFile,
        pixels: u16,
    ) -> Result<Self> {
        ensure!(pixels > 0, "the device has no pixels");
        check_dither(requested.sensor.dither_bins, sensor.most_dither.into())?;
        let bits = requested.detection.counter_bits.unwrap_or(counter_bits);
        check_counter_bits(bits, counter_bits)?;
        let began = SystemTime::now();
        let micros = began.duration_since(UNIX_EPOCH).unwrap_or_default();
        let range = requested.sensor.dither_bins.unwrap_or_else(|| {
            // An odd range cannot be.
            DITHER_BINS.min(sensor.most_dither.into()) & !1
        });
        // Two devices of one kind have different lengths.
        let seed = requested
            .sensor
            .dither_seed
            .or(u64::try_from(micros.as_micros()).ok());
        let mut effective = requested.clone().or(SettingsFile {
            sensor: SensorSettings {
                bin_width_ps: sensor.bin_width,
                offset_mm: Some(sensor.offset),
                ..SensorSettings::default()
            },
            dead_time_of_sensor: Some(sensor.dead_time),
            dither_of_laser: Some((range, seed.unwrap_or(0))),
            ..SettingsFile::default()
        });
        effective.detection.counter_bits = Some(counter_bits);
        effective.check_bins(bins)?;
        // A sensor may be slower than its settings promise.
        let own = LaserClock::from_millihertz(sensor.laser_millihertz);
        let requested_clock = effective.sensor.laser_hz.map(LaserClock::new).transpose()?;
        let (clock, warning) = LaserClock::prefer(requested_clock, own, "the device");
        // Without a gate, bins that the sensor does not measure are left out.
        if (1..bins).contains(&sensor.bins) {
            let measured = (0, sensor.bins - 1);
            effective.sensor.gate = effective.sensor.gate.or(Some(measured));
        }
        let mut settings = effective.settings(bins.into())?;
        masked::check(&settings.masked, pixels.into())?;
        let columns = effective.sensor.columns;
        let refused = |reason| Refused::value("columns", columns.unwrap_or_default(), reason);
        ensure!(
            columns.is_none_or(|columns| columns <= u32::from(pixels)),
            refused(format!("there are {pixels} pixels"))
        );
        let array = array(pixels, columns)
            .ok_or_else(|| refused(format!("with {pixels} pixels it makes more than 65,536")))?;
        // The last row may have more places than pixels.
        if settings.offsets_mm.len() == usize::from(pixels) {
            let places = array.pixels() as usize;
            settings.offsets_mm.resize(places, I24F8::ZERO);
        }
        settings.ranges(array)?;
        Ok(Self {
            settings,
            requested,
            effective,
            pixels,
            array,
            laser_millihertz: clock.map_or(0, |clock| clock.millihertz()),
            warnings: warning.into_iter().collect(),
            began,
            sensor,
            counter_bits,
            bins,
        })
    }

    /// The task of the device.
    #[must_use]
    pub fn task(&self, dynamic_depth: Option<DynamicDepth>, host_timeout: HostTimeout) -> Task<'_> {
        Task {
            settings: &self.settings,
            pixels: self.pixels,
            columns: self.array.columns(),
            dynamic_depth,
            host_timeout,
        }
    }

    /// The settings as a text for a file of its events. The gate has the bins that the sensor measures.
    ///
    /// # Errors
    /// Fails if they cannot be written as TOML.
    pub fn toml(&self) -> Result<String> {
        self.effective.with_settings(&self.settings).to_toml()
    }

    /// Header of a file of its events.
    #[must_use]
    pub fn header(&self) -> Header {
        let start = self.began.duration_since(UNIX_EPOCH).unwrap_or_default();
        Header {
            #[allow(clippy::cast_possible_truncation, reason = "at most 1024")]
            bins: self.settings.bins as u32,
            array: self.array,
            bin_width_ps: self.settings.configuration.bin_width_ps,
            offset_mm: self.settings.configuration.offset_mm,
            offsets_mm: self.settings.pixel_offsets(),
            laser_millihertz: self.laser_millihertz,
            start_us: i64::try_from(start.as_micros()).unwrap_or(0),
        }
    }
}

/// Fails if the pixels of a device have counters of another width.
pub(super) fn check_counter_bits(requested: u8, of_device: u8) -> Result<(), Refused> {
    if requested == of_device {
        return Ok(());
    }
    let reason = format!("the pixels of this device have counters of {of_device} bits");
    Err(Refused::value("counter_bits", requested, reason))
}

/// Refuses more dither than the sensor can have.
fn check_dither(requested: Option<u16>, most: u16) -> Result<(), Refused> {
    let reason = match most {
        0 => "this device cannot dither its laser".to_owned(),
        _ => format!("this device can dither its laser by at most {most} bins"),
    };
    match requested {
        Some(bins) if bins > most => Err(Refused::value("dither_bins", bins, reason)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gate_ends_with_the_sensor_unless_it_is_given() {
        let gate = |requested, measured| {
            let sensor = SensorRecord {
                pixels: 4,
                bin_width: None,
                offset: I24F8::ZERO,
                laser_millihertz: 0,
                bins: measured,
                dead_time: 0,
                most_dither: 0,
            };
            let mut settings = SettingsFile::default();
            settings.sensor.gate = requested;
            let setup = Setup::new(sensor, 10, 128, settings, 4).unwrap();
            // A recording says so, too.
            let recorded = SettingsFile::parse(&setup.toml().unwrap()).unwrap();
            assert_eq!(recorded.sensor.gate, setup.settings.gate());
            (setup.requested.sensor.gate, setup.settings.gate())
        };
        assert_eq!(gate(None, 128), (None, None));
        assert_eq!(gate(None, 117), (None, Some((0, 116))));
        let requested = Some((8, 127));
        assert_eq!(gate(requested, 117), (requested, requested));
        assert_eq!(gate(None, 0), (None, None));
    }

    #[test]
    fn a_laser_that_can_is_dithered_by_128_bins_unless_another_range_is_given() {
        let ranges = |text: &str, most_dither| {
            let sensor = SensorRecord {
                pixels: 1,
                bin_width: None,
                offset: I24F8::ZERO,
                laser_millihertz: 0,
                bins: 128,
                dead_time: 0,
                most_dither,
            };
            let requested = SettingsFile::parse(text).unwrap();
            let setup =
                Setup::new(sensor, 10, 128, requested, 1).map_err(|error| error.to_string())?;
            let task = setup.task(None, HostTimeout::default());
            let sources = [dtof_link::Source::Sensor, dtof_link::Source::Link];
            Ok::<_, String>(sources.map(|source| {
                let configuration = task.configuration(source).unwrap();
                (configuration.dither_bins, configuration.dither_seed)
            }))
        };
        let bins = |text, most| ranges(text, most).map(|ranges| ranges.map(|(bins, _)| bins));
        assert_eq!(bins("", 254), Ok([128, 0]));
        assert_eq!(bins("", 40), Ok([40, 0]));
        assert_eq!(bins("", 41), Ok([40, 0]));
        assert_eq!(bins("", 1), Ok([0, 0]));
        assert_eq!(bins("", 0), Ok([0, 0]));
        assert_eq!(bins("[sensor]\ndither_bins = 0", 254), Ok([0, 0]));
        assert_ne!(ranges("", 254).unwrap()[0].1, 0, "the clock's seed");
        let given = "[sensor]\ndither_bins = 64\ndither_seed = 9";
        assert_eq!(ranges(given, 64), Ok([(64, 9), (0, 0)]));
        assert_eq!(ranges("", 0), Ok([(0, 0); 2]), "no seed without a dither");
        let refused = |most| ranges(given, most).unwrap_err();
        assert!(refused(62).contains("at most 62 bins"), "{}", refused(62));
        assert!(refused(0).contains("cannot dither"), "{}", refused(0));
    }

    #[test]
    fn the_dither_of_this_device_is_not_written_into_the_settings_for_any() {
        for text in ["", "dither_bins = 2\n", "dither_seed = 9\n"] {
            for most_dither in [0, 41, 254] {
                if text.contains("bins") && most_dither == 0 {
                    continue;
                }
                let sensor = SensorRecord {
                    pixels: 1,
                    bin_width: None,
                    offset: I24F8::ZERO,
                    laser_millihertz: 0,
                    bins: 128,
                    dead_time: 0,
                    most_dither,
                };
                let requested = SettingsFile::parse(&format!("[sensor]\n{text}")).unwrap();
                let setup = Setup::new(sensor, 10, 128, requested, 1).unwrap();
                let written = setup.effective.with_settings(&setup.settings);
                assert_eq!(
                    written.sensor.dither_bins,
                    setup.requested.sensor.dither_bins
                );
                assert_eq!(
                    written.sensor.dither_seed,
                    setup.requested.sensor.dither_seed
                );
            }
        }
    }

    #[test]
    fn there_is_an_offset_for_each_pixel_of_the_device() {
        let setup = |text: &str| {
            let sensor = SensorRecord {
                pixels: 5,
                bin_width: None,
                offset: I24F8::ZERO,
                laser_millihertz: 0,
                bins: 128,
                dead_time: 0,
                most_dither: 0,
            };
            let requested = SettingsFile::parse(&format!("[sensor]\ncolumns = 3\n{text}")).unwrap();
            Setup::new(sensor, 10, 128, requested, 5)
        };
        let setup_of_five = setup("masked = [1]\noffsets_mm = [1, 2, 3, 4, 5]").unwrap();
        // The last place of the second row has no pixel.
        let expected = [Some(1), None, Some(3), Some(4), Some(5), Some(0)];
        let expected = expected.map(|mm| mm.map(I24F8::from_num::<i32>));
        let header = setup_of_five.header();
        assert_eq!(header.offsets_mm, expected);
        let task = setup_of_five.task(None, HostTimeout::default());
        assert_eq!(task.ranges().unwrap(), header.ranges().unwrap());
        for text in [
            "offsets_mm = [1, 2, 3, 4]",
            "offsets_mm = [8388607, 0, 0, 0, 0]",
        ] {
            let error = setup(text).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains("offsets_mm"), "{error}");
        }
    }

    #[test]
    fn the_dead_time_is_the_sensors_unless_it_is_given() {
        let setup = |text: &str, of_sensor| {
            let sensor = SensorRecord {
                pixels: 4,
                bin_width: None,
                offset: I24F8::ZERO,
                laser_millihertz: 0,
                bins: 128,
                dead_time: of_sensor,
                most_dither: 0,
            };
            Setup::new(sensor, 10, 128, SettingsFile::parse(text).unwrap(), 4).unwrap()
        };
        let window = "[detection]\nrule = 'window'\nwindow = 3\n";
        for (text, of_sensor, used) in [
            (window.to_owned(), 20, (20, true)),
            (window.to_owned(), u16::MAX, (128, true)),
            (format!("{window}[sensor]\ndead_time = 3"), 20, (3, false)),
            (format!("{window}[sensor]\ndead_time = 0"), 20, (0, false)),
            // The paper's rule cannot use it.
            (String::new(), 20, (0, false)),
        ] {
            let setup = setup(&text, of_sensor);
            let settings = &setup.settings;
            assert_eq!(
                (settings.dead_time(), settings.is_dead_time_of_sensor),
                used,
                "{text}"
            );
            let task = setup.task(None, HostTimeout::default());
            let configuration = task.configuration(dtof_link::Source::Sensor).unwrap();
            assert_eq!(configuration.dead_time, Some(used.0));
            // Another rule, and what the sensor says is used or not.
            let requested = SettingsFile::parse(window).unwrap();
            let changed = setup.with_requested(requested).unwrap().settings;
            assert_eq!(changed.dead_time(), of_sensor.min(128));
        }
    }
}
