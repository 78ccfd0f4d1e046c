//! Calibration of the sensor on the desk: the device's histograms in place of a recording.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::Args;
use dtof::progress::Bar;
use dtof::{complain, interrupt};
use dtof_calibrate::{Asked, Calibration, Length, Observed, calibrate};
use dtof_device::histograms::{Collected, SoFar, collect};
use dtof_device::monitor::array;
use dtof_device::{Client, Port, Stopped};
use dtof_engine::settings::{Sensor, SettingsFile};
use dtof_options::Refused;
use dtof_options::numbers::{MOST_WHOLE, whole};
use dtof_options::progress::Progress;
use dtof_options::rows::{Row, grouped};
use dtof_photons::open::BIN_WIDTH_PS;
use dtof_run::given::Given;

use crate::command::device_options::HostOptions;
use crate::command::warn;

/// How long photons are collected, unless somebody says.
const SECONDS: u32 = 10;

#[derive(Args)]
pub struct Desk {
    /// Calibrate the sensor of this device: tcp:HOST:PORT, a serial port, or `qemu`, which starts an
    /// emulated device
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Image that `--device qemu` runs [default: what `cargo xtask image mps2-an386` has built]
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Collect photons of the device for so many seconds, or until Ctrl-C [default: 10]
    #[arg(long, value_name = "S", value_parser = whole(1..=86_400_u32))]
    seconds: Option<u32>,
    /// End sooner, when the median pixel of the device has so many photons
    #[arg(long, value_name = "N", value_parser = whole(1..=MOST_WHOLE))]
    photons: Option<u64>,
    #[command(flatten)]
    host: HostOptions,
}

/// What was found, from whatever it is.
pub struct Gathered {
    pub found: Calibration,
    /// What file or device say of the sensor.
    pub known: SettingsFile,
    /// How much was collected.
    pub rows: Vec<Row>,
}

impl Desk {
    /// Options that say nothing about a recording are refused.
    ///
    /// # Errors
    /// If there are any.
    pub fn suits_file(&self) -> Result<()> {
        let of_devices = [
            ("image", self.image.is_some()),
            ("seconds", self.seconds.is_some()),
            ("photons", self.photons.is_some()),
            ("host_timeout", self.host.is_given()),
        ];
        for (key, is_there) in of_devices {
            ensure!(
                !is_there,
                Refused::new(key, "is of `device`, not of recordings")
            );
        }
        Ok(())
    }

    /// Opens the device.
    ///
    /// # Errors
    /// If none is named, there is none, or options that are given do not suit it.
    pub fn open(&self, given: &Given) -> Result<Box<dyn Port>> {
        let name = self.device.as_deref();
        let name = name.ok_or_else(|| Refused::new("input", "is needed, or `device`"))?;
        given.suits_device()?;
        dtof_device::open(name, self.image.as_deref())
    }

    /// Collects and calibrates.
    ///
    /// # Errors
    /// If the device or an option does not suit, or nothing comes.
    pub fn calibrate(
        &self,
        (name, port): (&str, Box<dyn Port>),
        said: &SettingsFile,
        asked: &Asked,
        quiet: bool,
    ) -> Result<Gathered> {
        let mut client = Client::new(port)?;
        interrupt::listen(|| ())?;
        let sensor = client.sensor()?.context("the device has no sensor")?;
        let pixels = sensor.pixels.min(client.pixels());
        ensure!(pixels > 0, "the device has no pixels");
        let bins = client.bins();
        ensure!(
            said.sensor.bins.is_none_or(|said| said == bins),
            "the settings are for {} bins, the device has {bins}",
            said.sensor.bins.unwrap_or_default(),
        );
        let array = array(pixels, said.sensor.columns);
        let array = array.filter(|array| array.pixels() == u32::from(pixels));
        let array = array.ok_or_else(|| {
            let reason = format!("the device has {pixels} pixels, which do not fill such rows");
            Refused::value("columns", said.sensor.columns.unwrap_or(1), reason)
        })?;
        let known = SettingsFile {
            sensor: Sensor {
                laser_hz: Some(sensor.laser_millihertz / 1000).filter(|&hz| hz > 0),
                columns: Some(array.columns()),
                bins: Some(bins),
                bin_width_ps: Some(sensor.bin_width.unwrap_or(BIN_WIDTH_PS)),
                offset_mm: Some(sensor.offset).filter(|offset| !offset.is_zero()),
                ..Sensor::default()
            },
            ..SettingsFile::default()
        };
        let bin_width_ps = said.sensor.bin_width_ps.or(known.sensor.bin_width_ps);
        // Bins alone: how pixels decide is not for this.
        let settings = SettingsFile {
            sensor: Sensor {
                bin_width_ps,
                ..Sensor::default()
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
        let captures = [collected.histograms];
        let observed = Observed {
            array,
            captures: &captures,
            length: Length::Cycles(median),
            cycles: Some(&collected.cycles),
            bin_width_ps: settings.bin_width_ps.to_num(),
            truth_mm: None,
        };
        let found = calibrate(&observed, asked)?;
        ensure!(
            found.pulse.is_some() || !interrupt::is_interrupted(),
            "ended too soon: no peak is bright enough to measure the pulse; nothing is written"
        );
        Ok(Gathered {
            found,
            known,
            rows: vec![row(&collected.cycles)],
        })
    }

    /// Shows how far `collect` is, and tells it when to end.
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

/// How much was collected.
fn row(cycles: &[u64]) -> Row {
    let [least, most] = [cycles.iter().min(), cycles.iter().max()];
    let [least, most] = [least, most].map(|end| grouped(end.copied().unwrap_or(0)));
    (
        "laser cycles".to_owned(),
        format!("{least} to {most} a pixel"),
    )
}
