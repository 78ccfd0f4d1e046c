//! The options of commands that watch a device, the same for each.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use dtof::cli::arguments::{fixed, whole};
use dtof::device::HostTimeout;
use dtof::run::operation::Operation;
use dtof::settings::{Sensor, SettingsFile};
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_link::DynamicDepth;

use super::dynamic_depth;

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
    /// Picoseconds a bin, rounded to 1/65536 [default: as the device says, 250 if any will do]
    #[arg(long, value_name = "PS", value_parser = fixed::<U16F16>, allow_hyphen_values = true)]
    bin_width_ps: Option<U16F16>,
    /// Millimetres added to every range, rounded to 1/256 [default: as the device says]
    #[arg(long, value_name = "MM", value_parser = fixed::<I24F8>, allow_hyphen_values = true)]
    offset_mm: Option<I24F8>,
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
    of_dynamic_depth: dynamic_depth::Options,
    #[command(flatten)]
    operation: Operation,
}

impl DeviceOptions {
    /// What they say of sensor and detection, and a settings file.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn said(&self) -> Result<SettingsFile> {
        self.operation.said(SettingsFile {
            sensor: Sensor {
                columns: self.columns.map(u32::from),
                bin_width_ps: self.bin_width_ps,
                offset_mm: self.offset_mm,
                ..Sensor::default()
            },
            ..SettingsFile::default()
        })
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
