//! The options of commands that watch a device, the same for each.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof_data::options::numbers::integer;
use dtof_device::HostTimeout;
use dtof_engine::settings::SettingsFile;
use dtof_link::DynamicDepth;
use dtof_run::given::Operation;

use super::dynamic_depth;
use super::flags::Flags;

/// Longest silence of this program.
#[derive(Args)]
pub struct HostOptions {
    /// Seconds of silence of this program after which the device stops its sensor, and with it the
    /// laser: 0.2 to 60, or 0 for never, which needs firmware built with `laser-on-without-host`
    /// [default: 3]
    #[arg(long, value_name = "SECONDS", value_parser = HostTimeout::from_seconds, allow_hyphen_values = true)]
    host_timeout: Option<HostTimeout>,
}

impl HostOptions {
    /// Returns whether it was given.
    pub fn is_given(&self) -> bool {
        self.host_timeout.is_some()
    }

    /// The timeout.
    pub fn timeout(&self) -> HostTimeout {
        self.host_timeout.unwrap_or_default()
    }
}

/// The device's image, its pixels and their settings.
#[derive(Args)]
pub struct DeviceOptions {
    /// Image for `--device qemu` [default: the one built by `cargo xtask image mps2-an386`]
    #[arg(long, value_name = "FILE")]
    pub image: Option<PathBuf>,
    /// Number of pixels, with addresses from 0 [default: the device's own]
    #[arg(long, value_name = "N", value_parser = integer(1..=u16::MAX))]
    pub pixels: Option<u16>,
    /// Columns of the array for maps, recordings and blocks, pixel = row × columns + column
    /// [default: as square as possible]
    #[arg(long, value_name = "N", value_parser = integer(1..=u16::MAX))]
    pub columns: Option<u16>,
    /// Send only changes of depth, with their direction
    #[arg(long)]
    dynamic_depth: bool,
    #[command(flatten)]
    host: HostOptions,
    #[command(flatten)]
    dynamic_depth_flags: dynamic_depth::DynamicDepthFlags,
    #[command(flatten)]
    operation: Flags<Operation>,
}

impl DeviceOptions {
    /// Sensor and detection options, merged with the settings file.
    ///
    /// # Errors
    /// Fails if the file is wrong.
    pub fn requested(&self) -> Result<SettingsFile> {
        let mut given = self.operation.0.given.clone();
        given.options.sensor.columns = self.columns.map(u32::from);
        given.merged_with_looks()
    }

    /// Returns whether any was given.
    ///
    /// # Errors
    /// Fails if one is wrong.
    pub fn are_given(&self) -> Result<bool> {
        let is_given = self.image.is_some() || self.pixels.is_some() || self.host.is_given();
        let is_given = is_given || self.dynamic_depth()?.is_some();
        Ok(is_given || self.requested()? != SettingsFile::default())
    }

    /// Longest silence of this program.
    pub fn host_timeout(&self) -> HostTimeout {
        self.host.timeout()
    }

    /// Dynamic depth, if it is on.
    ///
    /// # Errors
    /// Fails if its flags are given without it.
    pub fn dynamic_depth(&self) -> Result<Option<DynamicDepth>> {
        self.dynamic_depth_flags.get_if(self.dynamic_depth)
    }
}
