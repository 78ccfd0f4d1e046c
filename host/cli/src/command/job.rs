//! The options of commands that write a folder of results, and of those that can decide on a device.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use dtof::{interrupt, path};
use dtof_data::events::echoes::Echo;
use dtof_data::photons::source::PhotonSource;
use dtof_device::{Client, DeviceEngine};
use dtof_engine::Engine;
use dtof_engine::host::host_engine;
use dtof_engine::settings::{Settings, SettingsFile};
use dtof_run::output::Output;

use super::dynamic_depth::DynamicDepthOptions;
use super::flags::name;

/// The recording that a command reads.
#[derive(Args)]
pub struct Recorded {
    /// Histograms (.npy, .npz, or the log of a TMF8820, TMF8828 or TMF8829, .json or .json.gz), or photons
    /// (.csv with columns pixel, cycle and bin, or .npy with these fields or three columns)
    #[arg(value_name = "FILE", value_parser = path())]
    file: Option<PathBuf>,
    /// The same file
    #[arg(long, value_name = "FILE", value_parser = path(), conflicts_with = "file")]
    input: Option<PathBuf>,
}

impl Recorded {
    /// The file, if one is named.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref().or(self.input.as_deref())
    }
}

/// The folder of the results, and what goes into it.
#[derive(Args)]
pub struct ResultOptions {
    /// Folder of the results [default: out/NAME of the file]
    #[arg(long, value_name = "DIR", value_parser = path())]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub dynamic_depth: DynamicDepthOptions,
    /// Echo of each exposure that maps and report show; the files of events hold all
    /// [default: the strongest in the maps, all in the report]
    #[arg(long, value_parser = name::<Echo>())]
    pub echo: Option<Echo>,
    /// Do not write events.csv
    #[arg(long)]
    pub no_csv: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

impl ResultOptions {
    /// The folder for a job that reads `input`.
    #[must_use]
    pub fn folder(&self, input: Option<&Path>) -> PathBuf {
        self.out.clone().unwrap_or_else(|| {
            let name = input.and_then(Path::file_stem).unwrap_or_default();
            // That of `log.json.gz` is `log`.
            let name = Path::new(name);
            let name = match name.extension() {
                Some(end) if end == "json" => name.with_extension(""),
                _ => name.to_owned(),
            };
            Path::new("out").join(name)
        })
    }

    /// Refuses wrong options, and a folder that may not hold the results of `inputs`, before anything is read.
    ///
    /// # Errors
    /// Fails if an option does not suit the others, or a result would replace a file that is not one.
    pub fn check(&self, inputs: Inputs) -> Result<()> {
        self.dynamic_depth.get()?;
        Output::check(&self.folder(inputs[0]), &files(inputs))
    }

    /// Prepares the folder for a job that reads `inputs`. From now on Ctrl-C ends the photons, and the job finishes its
    /// files.
    ///
    /// # Errors
    /// Those of [`Self::check`], and fails if the folder cannot be written.
    pub fn output(
        &self,
        settings: &Settings,
        photons: &dyn PhotonSource,
        effective: SettingsFile,
        inputs: Inputs,
    ) -> Result<Output> {
        // Before the first file: nothing would remove it.
        interrupt::handle_ctrl_c()?;
        let folder = self.folder(inputs[0]);
        Ok(Output::create(&folder, settings, photons, files(inputs))?
            .with_settings(effective)
            .with_changes(self.dynamic_depth.get()?.as_ref())?
            .with_echo(self.echo, settings)
            .without_csv(self.no_csv))
    }
}

/// The recording or scene that a job reads, and its settings file.
pub type Inputs<'a> = [Option<&'a Path>; 2];

fn files(inputs: Inputs) -> Vec<PathBuf> {
    inputs.into_iter().flatten().map(Path::to_owned).collect()
}

/// The computer or device that decides.
#[derive(Args)]
pub struct EngineOptions {
    /// Device that decides: tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated
    /// device [default: this computer]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Image for `--device qemu` [default: the one built by `cargo xtask image mps2-an386`]
    #[arg(long, value_name = "FILE", requires = "device")]
    image: Option<PathBuf>,
}

impl EngineOptions {
    /// The engine for `photons`.
    ///
    /// # Errors
    /// Fails if the settings do not suit the engine, or the device cannot be opened.
    pub fn engine(
        &self,
        settings: &Settings,
        photons: &dyn PhotonSource,
    ) -> Result<Box<dyn Engine>> {
        let (array, addresses) = (photons.array(), photons.addresses());
        let Some(device) = &self.device else {
            return host_engine(settings, array, &addresses);
        };
        // Checked before the device is opened.
        dtof_device::check_looks(settings)?;
        let port = dtof_device::open(device, self.image.as_deref())?;
        let client = Client::new(port).with_context(|| device.clone())?;
        let engine = DeviceEngine::new(client, settings, array, &addresses)?;
        Ok(Box::new(engine))
    }
}
