//! The options of commands that watch a device, the same for each.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof_device::HostTimeout;
use dtof_engine::settings::SettingsFile;
use dtof_link::DynamicDepth;
use dtof_options::numbers::whole;
use dtof_run::given::Operation;

use super::dynamic_depth;
use super::flags::Flags;

/// How long a device goes on without this program.
#[derive(Args)]
pub struct HostOptions {
    /// The device stops its sensor, and with it the laser, once this program has been silent for so
    /// many seconds, 0.2 to 60. With 0 it never does, which a device refuses unless its firmware
    /// was built with `laser-on-without-host` [default: 3]
    #[arg(long, value_name = "SECONDS", value_parser = HostTimeout::from_seconds, allow_hyphen_values = true)]
    host_timeout: Option<HostTimeout>,
}

impl HostOptions {
    /// Whether it was given.
    pub fn is_given(&self) -> bool {
        self.host_timeout.is_some()
    }

    /// How long it is.
    pub fn timeout(&self) -> HostTimeout {
        self.host_timeout.unwrap_or_default()
    }
}

/// The device's image, its pixels and how they operate.
#[derive(Args)]
pub struct DeviceOptions {
    /// Image that `--device qemu` runs [default: what `cargo xtask image mps2-an386` has built]
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Pixels of the sensor, with addresses from 0 [default: as the device says]
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX))]
    pub pixels: Option<u16>,
    /// Columns of the array that is drawn or recorded or has blocks, pixel = row × columns + column
    /// [default: as high as wide]
    #[arg(long, value_name = "N", value_parser = whole(1..=u16::MAX))]
    pub columns: Option<u16>,
    /// The device sends only changes of depth, with a polarity
    #[arg(long)]
    dynamic_depth: bool,
    #[command(flatten)]
    host: HostOptions,
    #[command(flatten)]
    of_dynamic_depth: dynamic_depth::DynamicDepthFlags,
    #[command(flatten)]
    operation: Flags<Operation>,
}

impl DeviceOptions {
    /// What they say of sensor and detection, and a settings file.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn said(&self) -> Result<SettingsFile> {
        let mut given = self.operation.0.given.clone();
        given.options.sensor.columns = self.columns.map(u32::from);
        given.merged()
    }

    /// Whether any was given.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn are_given(&self) -> Result<bool> {
        let is_given = self.image.is_some() || self.pixels.is_some() || self.host.is_given();
        let is_given = is_given || self.changes()?.is_some();
        Ok(is_given || self.said()? != SettingsFile::default())
    }

    /// How long the device goes on without this program.
    pub fn host_timeout(&self) -> HostTimeout {
        self.host.timeout()
    }

    /// Whether changes of depth are asked for, and which.
    ///
    /// # Errors
    /// Options of them without them.
    pub fn changes(&self) -> Result<Option<DynamicDepth>> {
        self.of_dynamic_depth.wanted(self.dynamic_depth)
    }
}
