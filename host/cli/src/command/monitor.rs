//! `dtof monitor`: the events of a device with a sensor, as they come.

use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use console::Term;
use dtof::{interrupt, path};
use dtof_device::monitor::map::{LiveMap, SHOW_CURSOR};
use dtof_device::monitor::{EventFile, Outputs, Task, monitor};
use dtof_device::{Client, Setup};
use dtof_engine::settings::SettingsFile;
use dtof_options::Refused;
use dtof_options::numbers::whole;

use super::device_options::DeviceOptions;

#[derive(Args)]
pub struct Monitor {
    /// tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated device
    #[arg(long, value_name = "DEVICE")]
    device: String,
    /// End after so many seconds [default: at Ctrl-C]
    #[arg(long, value_name = "S", value_parser = whole(0..=u32::MAX))]
    seconds: Option<u32>,
    /// Draw the ranges of all pixels on standard error, which must be a terminal. Events still
    /// go to standard output, unless that is a terminal, too
    #[arg(long)]
    map: bool,
    /// Write the events into an AER file as well, for `dtof decode` and `dtof export`
    #[arg(long, value_name = "FILE.aer", value_parser = path())]
    record: Option<PathBuf>,
    #[command(flatten)]
    options: DeviceOptions,
}

impl Monitor {
    pub fn run(&self) -> Result<()> {
        let said = self.options.said()?;
        let watched = self.watch(said.clone());
        watched.map_err(|error| said.blame(error))
    }

    fn watch(&self, said: SettingsFile) -> Result<()> {
        let dynamic_depth = self.options.changes()?;
        ensure!(
            !self.map || io::stderr().is_terminal(),
            Refused::new("map", "draws on standard error, which is no terminal here")
        );
        let has_blocks = said.detection.binning.is_some_and(|levels| levels > 0);
        ensure!(
            self.options.columns.is_none() || self.map || self.record.is_some() || has_blocks,
            Refused::new("columns", "is of `map`, `record` and `binning`")
        );
        let image = self.options.image.as_deref();
        let name = || self.device.clone();
        let mut client = Client::new(dtof_device::open(&self.device, image)?).with_context(name)?;
        interrupt::listen(|| {
            if io::stderr().is_terminal() {
                let _ = write!(io::stderr(), "{SHOW_CURSOR}");
            }
        })?;
        let setup = Setup::of(&mut client, said, self.options.pixels).with_context(name)?;
        super::warn(Path::new(&self.device), setup.warnings.clone(), false);
        let length = self
            .seconds
            .map(|seconds| Duration::from_secs(seconds.into()));
        let (pixels, array) = (setup.pixels, setup.array);
        let mut map = self.map.then(|| {
            let terminal = Term::stderr();
            let asked = terminal.clone();
            let room = move || {
                let (lines, columns) = asked.size();
                (lines.into(), columns.into())
            };
            let room = Box::new(room);
            LiveMap::new(Box::new(terminal), room, pixels, array)
        });
        let mut events: Box<dyn Write> = if self.map && io::stdout().is_terminal() {
            Box::new(io::sink())
        } else {
            Box::new(BufWriter::new(io::stdout().lock()))
        };
        let mut recording = match &self.record {
            None => None,
            Some(file) => Some(EventFile::new(file, image.as_slice(), &setup.header())?),
        };
        let task = Task {
            settings: &setup.settings,
            pixels,
            columns: array.columns(),
            dynamic_depth,
            host_timeout: self.options.host_timeout(),
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
        // The sensor does not wait for the disk.
        drop(client);
        let finish = if monitored.is_ok() {
            EventFile::finish
        } else {
            EventFile::finish_after_failure
        };
        let recorded = recording.map_or(Ok(()), finish);
        match (monitored, recorded) {
            // Why it ended, and where the events are.
            (Err(ended), Err(kept)) => bail!("{ended:#}; {kept:#}"),
            (monitored, recorded) => monitored.and(recorded),
        }
    }
}
