//! Calibration from the histograms of a device.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::progress::Bar;
use dtof::{complain, interrupt};
use dtof_calibrate::{Calibration, CalibrationOptions, Length, Observed, calibrate_with};
use dtof_data::options::Refused;
use dtof_data::options::numbers::{MAX_INTEGER, integer};
use dtof_data::options::progress::{Progress, shared};
use dtof_data::options::rows::{Row, grouped};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::masked;
use dtof_data::photons::open::BIN_WIDTH_PS;
use dtof_device::histograms::{Collected, SoFar, collect};
use dtof_device::monitor::array;
use dtof_device::{Client, Port, Stopped};
use dtof_engine::settings::{SensorSettings, SettingsFile};
use dtof_run::given::Given;

use crate::command::device_options::HostOptions;
use crate::command::warn;

/// Default length of a collection.
const SECONDS: u32 = 10;

#[derive(Args)]
pub struct DeviceArgs {
    /// Device whose sensor is calibrated: tcp:HOST:PORT, a serial port, or `qemu`, which starts an
    /// emulated device
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["file", "input"])]
    pub device: Option<String>,
    /// Image for `--device qemu` [default: the one built by `cargo xtask image mps2-an386`]
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Device: longest collection in seconds; Ctrl-C ends it sooner [default: 10]
    #[arg(long, value_name = "S", value_parser = integer(1..=86_400_u32))]
    seconds: Option<u32>,
    /// Device: photons of the median pixel that end the collection sooner
    #[arg(long, value_name = "N", value_parser = integer(1..=MAX_INTEGER))]
    photons: Option<u64>,
    #[command(flatten)]
    host: HostOptions,
}

/// The calibration of a device.
pub struct FromDevice {
    pub found: Calibration,
    /// The device's own settings.
    pub settings: SettingsFile,
    /// Rows of the report on the collection.
    pub rows: Vec<Row>,
}

impl DeviceArgs {
    /// Refuses the options of a device, for a recording.
    ///
    /// # Errors
    /// Fails if any is given.
    pub fn check_unused(&self) -> Result<()> {
        let device_options = [
            ("image", self.image.is_some()),
            ("seconds", self.seconds.is_some()),
            ("photons", self.photons.is_some()),
            ("host_timeout", self.host.is_given()),
        ];
        for (key, is_given) in device_options {
            ensure!(
                !is_given,
                Refused::new(key, "is for `device`, not for recordings")
            );
        }
        Ok(())
    }

    /// Opens the device.
    ///
    /// # Errors
    /// Fails if no device is given, it cannot be opened, or an option is not for devices.
    pub fn open(&self, given: &Given) -> Result<Box<dyn Port>> {
        let name = self.device.as_deref();
        let name = name.ok_or_else(|| dtof::missing("input", "is needed, or `device`"))?;
        given.suits_device()?;
        dtof_device::open(name, self.image.as_deref())
    }

    /// Collects histograms and calibrates.
    ///
    /// # Errors
    /// Fails if the device or an option does not suit, or if the collection fails.
    pub fn calibrate(
        &self,
        (name, port): (&str, Box<dyn Port>),
        requested: &SettingsFile,
        (options, masked): (&CalibrationOptions, Option<&[u16]>),
        quiet: bool,
    ) -> Result<FromDevice> {
        let mut client = Client::new(port)?;
        interrupt::handle_ctrl_c()?;
        let sensor = client.sensor()?.context("the device has no sensor")?;
        let pixels = sensor.pixels.min(client.pixels());
        ensure!(pixels > 0, "the device has no pixels");
        let bins = client.bins();
        requested.check_bins(bins)?;
        masked::check(masked.unwrap_or(&[]), pixels.into())?;
        let array = array(pixels, requested.sensor.columns);
        let array = array.filter(|array| array.pixels() == u32::from(pixels));
        let array = array.ok_or_else(|| {
            let reason = format!("the device has {pixels} pixels, which do not fill such rows");
            Refused::value("columns", requested.sensor.columns.unwrap_or(1), reason)
        })?;
        let own = SettingsFile {
            sensor: SensorSettings {
                laser_hz: Some(sensor.laser_millihertz / 1000).filter(|&hz| hz > 0),
                columns: Some(array.columns()),
                bins: Some(bins),
                bin_width_ps: Some(sensor.bin_width.unwrap_or(BIN_WIDTH_PS)),
                offset_mm: Some(sensor.offset).filter(|offset| !offset.is_zero()),
                ..SensorSettings::default()
            },
            ..SettingsFile::default()
        };
        let bin_width_ps = requested.sensor.bin_width_ps.or(own.sensor.bin_width_ps);
        // Histograms need no settings but the bin width.
        let settings = SettingsFile {
            sensor: SensorSettings {
                bin_width_ps,
                ..SensorSettings::default()
            },
            ..SettingsFile::default()
        };
        let settings = settings.settings(bins.into())?;
        let before = Stopped::warning(&client.report()?);
        warn(Path::new(name), before, quiet);
        let host_timeout = self.host.timeout();
        let collected = self.collect(quiet, |done| {
            collect(&mut client, &settings, pixels, host_timeout, done)
        })?;
        drop(client);
        if collected.full > 0 && !quiet {
            let full = grouped(collected.full);
            complain(&format!(
                "warning: {name}: {full} exposures with a full counter were left out"
            ));
        }
        let mut cycles = collected.cycles.clone();
        cycles.sort_unstable();
        let median = cycles.get(cycles.len() / 2).copied().unwrap_or(0);
        let rays = requested.rays.slants(array)?;
        let histograms = Histograms::of(collected.histograms)?;
        let observed = Observed {
            array,
            histograms: &histograms,
            masked,
            length: Length::Cycles(median),
            cycles: Some(&collected.cycles),
            bin_width_ps: settings.configuration.bin_width_ps.to_num(),
            truth_mm: None,
            slant: rays.as_ref().map(|[slants, _]| &slants[..]),
            bias_mm: rays.as_ref().map(|[_, biases]| &biases[..]),
            offsets_mm: &requested.sensor.pixel_offsets_mm(),
            times: None,
        };
        let mut bar = Bar::new(quiet);
        let found = calibrate_with(&observed, options, &shared(&mut bar, "steps"))?;
        ensure!(
            found.pulse.is_some() || !interrupt::is_interrupted(),
            "ended too soon: no peak is bright enough to measure the pulse; nothing is written"
        );
        Ok(FromDevice {
            found,
            settings: own,
            rows: vec![row(&collected.cycles)],
        })
    }

    /// Runs `collect` with a progress bar, and ends it.
    fn collect(
        &self,
        quiet: bool,
        collect: impl FnOnce(&mut dyn FnMut(&SoFar) -> bool) -> Result<Collected>,
    ) -> Result<Collected> {
        let seconds = self.seconds.unwrap_or(SECONDS);
        let mut progress = Bar::new(quiet);
        match self.photons {
            None => progress.begin(seconds.into(), "seconds"),
            Some(photons) => progress.begin(photons, "photons in the median pixel"),
        }
        let length = Duration::from_secs(seconds.into());
        let collected = collect(&mut |so_far| {
            let done = self
                .photons
                .map_or(so_far.elapsed.as_secs(), |_| so_far.photons);
            progress.at(done).is_err()
                || interrupt::is_interrupted()
                || so_far.elapsed >= length
                || self.photons.is_some_and(|most| so_far.photons >= most)
        });
        progress.end();
        collected
    }
}

/// Least and most laser cycles of a pixel.
fn row(cycles: &[u64]) -> Row {
    let [least, most] = [cycles.iter().min(), cycles.iter().max()];
    let [least, most] = [least, most].map(|end| grouped(end.copied().unwrap_or(0)));
    (
        "laser cycles".to_owned(),
        format!("{least} to {most} a pixel"),
    )
}
