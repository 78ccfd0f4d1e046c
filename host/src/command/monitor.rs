//! `dtof monitor`: the events of a device with a sensor, as they come.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use console::Term;
use dtof::cli::arguments::{fixed, path, whole};
use dtof::cli::interrupt;
use dtof::device::monitor::map::{LiveMap, SHOW_CURSOR};
use dtof::device::monitor::{Outputs, Recording, Task, array, monitor};
use dtof::device::{self, Client};
use dtof::events::aer_file::Header;
use dtof::input::masked;
use dtof::jobs::operation::Operation;
use dtof::settings::{Sensor, SettingsFile};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_link::SensorRecord;

use super::dynamic_depth;

#[derive(Args)]
pub struct Monitor {
    /// tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated device
    #[arg(long, value_name = "DEVICE")]
    device: String,
    /// Image that `--device qemu` runs [default: what `cargo xtask image mps2-an386` has built]
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// Pixels of the sensor, with addresses from 0 [default: as the device says]
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX))]
    pixels: Option<u16>,
    /// End after so many seconds [default: at Ctrl-C]
    #[arg(long, value_name = "S", value_parser = whole(0..=u32::MAX))]
    seconds: Option<u32>,
    /// Picoseconds a bin, rounded to 1/65536 [default: as the device says, 250 if any will do]
    #[arg(long, value_name = "PS", value_parser = fixed::<U16F16>, allow_hyphen_values = true)]
    bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range, rounded to 1/256 [default: as the device says]
    #[arg(long, value_name = "MM", value_parser = fixed::<I24F8>, allow_hyphen_values = true)]
    offset_mm: Option<I24F8>,
    /// The device sends only changes of depth, with a polarity
    #[arg(long)]
    dynamic_depth: bool,
    #[command(flatten)]
    of_dynamic_depth: dynamic_depth::Options,
    /// Draw the ranges of all pixels on standard error, which must be a terminal. Events still
    /// go to standard output, unless that is a terminal, too
    #[arg(long)]
    map: bool,
    /// Write the events into an AER file as well, for `dtof decode` and `dtof export`
    #[arg(long, value_name = "FILE.aer", value_parser = path())]
    record: Option<PathBuf>,
    /// Columns of the array that is drawn or recorded or has blocks, pixel = row × columns + column
    /// [default: as high as wide]
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX))]
    columns: Option<u16>,
    #[command(flatten)]
    operation: Operation,
}

impl Monitor {
    pub fn run(&self) -> Result<()> {
        let said = self.operation.said(SettingsFile {
            sensor: Sensor {
                columns: self.columns.map(u32::from),
                bin_width_ps: self.bin_width_ps,
                offset_mm: self.offset_mm,
                ..Sensor::default()
            },
            ..SettingsFile::default()
        })?;
        let watched = self.watch(said.clone());
        watched.map_err(|error| said.name_origin(error))
    }

    fn watch(&self, said: SettingsFile) -> Result<()> {
        let dynamic_depth = self.of_dynamic_depth.wanted(self.dynamic_depth)?;
        ensure!(
            !self.map || io::stderr().is_terminal(),
            "--map draws on standard error, which is no terminal here"
        );
        let has_blocks = said.detection.binning.is_some_and(|levels| levels > 0);
        ensure!(
            self.columns.is_none() || self.map || self.record.is_some() || has_blocks,
            "--columns is of --map, --record and --binning"
        );
        let name = || self.device.clone();
        let mut client =
            Client::new(device::open(&self.device, self.image.as_deref())?).with_context(name)?;
        interrupt::listen(|| {
            if io::stderr().is_terminal() {
                let _ = write!(io::stderr(), "{SHOW_CURSOR}");
            }
        })?;
        // A device without a sensor says so when it is configured.
        let sensor = client.sensor().with_context(name)?;
        let sensor = sensor.unwrap_or(SensorRecord {
            pixels: client.pixels(),
            bin_width: None,
            offset: I24F8::ZERO,
            laser_millihertz: 0,
        });
        let pixels = self.pixels.unwrap_or(sensor.pixels.min(client.pixels()));
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
            "{}: the settings are for {} bins, the device has {}",
            self.device,
            said.sensor.bins.unwrap_or_default(),
            client.bins()
        );
        let settings = said.settings(client.bins().into())?;
        masked::check(&settings.masked, pixels.into())?;
        if let Some(columns) = said
            .sensor
            .columns
            .filter(|&columns| columns > u32::from(pixels))
        {
            bail!("--columns {columns}: there are {pixels} pixels");
        }
        let length = self
            .seconds
            .map(|seconds| Duration::from_secs(seconds.into()));
        let geometry = array(pixels, said.sensor.columns);
        let mut map = self.map.then(|| {
            let terminal = Term::stderr();
            let asked = terminal.clone();
            let room = move || {
                let (lines, columns) = asked.size();
                (lines.into(), columns.into())
            };
            let room = Box::new(room);
            LiveMap::new(Box::new(terminal), room, pixels, geometry.columns as usize)
        });
        let mut events: Box<dyn Write> = if self.map && io::stdout().is_terminal() {
            Box::new(io::sink())
        } else {
            Box::new(BufWriter::new(io::stdout().lock()))
        };
        let mut recording = match &self.record {
            None => None,
            Some(file) => {
                let header = Header {
                    bins: client.bins().into(),
                    geometry,
                    bin_width_ps: settings.bin_width_ps,
                    offset_mm: settings.offset_mm,
                    laser_millihertz: sensor.laser_millihertz,
                };
                Some(Recording::new(
                    file,
                    self.image.as_deref().as_slice(),
                    &header,
                )?)
            }
        };
        let task = Task {
            settings: &settings,
            pixels,
            columns: geometry.columns,
            dynamic_depth,
        };
        let monitored = monitor(
            &mut client,
            &task,
            |elapsed| interrupt::is_interrupted() || length.is_some_and(|length| elapsed >= length),
            &mut Outputs {
                events: &mut events,
                statistics: &mut io::stderr(),
                map: map.as_mut(),
                recording: recording.as_mut(),
                masked: 0,
            },
        )
        .with_context(name);
        let finish = if monitored.is_ok() {
            Recording::finish
        } else {
            Recording::finish_after_failure
        };
        let recorded = recording.map_or(Ok(()), finish);
        match (monitored, recorded) {
            // Why it ended, and where the events are.
            (Err(ended), Err(kept)) => bail!("{ended:#}; {kept:#}"),
            (monitored, recorded) => monitored.and(recorded),
        }
    }
}
