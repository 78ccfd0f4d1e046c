//! `dtof monitor`: the events of a device with a sensor, as they come.

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use dtof::{interrupt, path};
use dtof_data::options::Refused;
use dtof_data::options::numbers::integer;
use dtof_device::monitor::{EventFile, Outputs, monitor};
use dtof_device::{Client, Setup};
use dtof_engine::settings::SettingsFile;

use super::device_options::DeviceOptions;

#[derive(Args)]
pub struct Monitor {
    /// Device: tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated device
    #[arg(long, value_name = "DEVICE")]
    device: String,
    /// Seconds to run [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = integer(0..=u32::MAX))]
    seconds: Option<u32>,
    /// AER file to write as well, for `dtof decode` and `dtof export`
    #[arg(long, value_name = "FILE.aer", value_parser = path())]
    record: Option<PathBuf>,
    #[command(flatten)]
    options: DeviceOptions,
}

impl Monitor {
    pub fn run(&self) -> Result<()> {
        let requested = self.options.requested()?;
        let watched = self.watch(requested.clone());
        watched.map_err(|error| requested.add_file_name(error))
    }

    fn watch(&self, requested: SettingsFile) -> Result<()> {
        let dynamic_depth = self.options.dynamic_depth()?;
        let [has_blocks, has_neighbours] =
            [requested.detection.binning, requested.detection.neighbours]
                .map(|number| number.is_some_and(|number| number > 0));
        let needs_array = self.record.is_some() || has_blocks || has_neighbours;
        ensure!(
            self.options.columns.is_none() || needs_array,
            Refused::new("columns", "needs `record`, `binning` or `neighbours`")
        );
        let image = self.options.image.as_deref();
        let name = || self.device.clone();
        let mut client = Client::new(dtof_device::open(&self.device, image)?).with_context(name)?;
        interrupt::handle_ctrl_c()?;
        let setup = Setup::of(&mut client, requested, self.options.pixels).with_context(name)?;
        super::warn(Path::new(&self.device), setup.warnings.clone(), false);
        let length = self
            .seconds
            .map(|seconds| Duration::from_secs(seconds.into()));
        let mut recording = match &self.record {
            None => None,
            Some(file) => Some(EventFile::new(
                file,
                image.as_slice(),
                &setup.header(),
                &setup.toml()?,
            )?),
        };
        let monitored = monitor(
            &mut client,
            &setup.task(dynamic_depth, self.options.host_timeout()),
            |elapsed| interrupt::is_interrupted() || length.is_some_and(|length| elapsed >= length),
            &mut Outputs {
                events: &mut BufWriter::new(io::stdout().lock()),
                statistics: &mut io::stderr(),
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
            // The first error says why it ended, the second where the events are.
            (Err(ended), Err(kept)) => bail!("{ended:#}; {kept:#}"),
            (monitored, recorded) => monitored.and(recorded),
        }
    }
}
