//! `dtof view`: a device or a recording live in a browser.

use std::cell::Cell;
use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use dtof::{complain, interrupt, path};
use dtof_data::options::flag;
use dtof_data::options::keys::POSITIVE;
use dtof_data::options::numbers::{integer, laser_hz};
use dtof_live::{Device, Feed, Folder, Foxglove, Origin, Playback, Served, Terminal};

use super::device_options::DeviceOptions;

#[derive(Args)]
pub struct View {
    /// AER file to play at the rate of its laser
    #[arg(value_name = "FILE.aer", value_parser = path(), required_unless_present = "device", conflicts_with = "device")]
    file: Option<PathBuf>,
    /// Device: tcp:HOST:PORT, a serial port, or `qemu`, which starts an emulated device
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// File: speed of playback relative to the recording [default: 1]
    #[arg(long, value_name = "N", value_parser = POSITIVE.parser(), conflicts_with = "device")]
    speed: Option<f64>,
    /// File: laser cycles a second, if the file has none or is wrong [default: the file's, else 10 MHz]
    #[arg(long, value_name = "HZ", value_parser = laser_hz, conflicts_with = "device")]
    laser_hz: Option<u64>,
    /// Port of the page on this computer [default: any free port]
    #[arg(long, value_name = "PORT", value_parser = integer(0..=u16::MAX), default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Folder for recordings and settings that the page saves. Existing files are not replaced
    /// [default: the page saves nothing]
    #[arg(long, value_name = "DIR", value_parser = path(), conflicts_with = "file")]
    out: Option<PathBuf>,
    /// Also serve Foxglove on this port of this computer; needs the feature foxglove [default without
    /// PORT: 8765]
    #[arg(long, value_name = "PORT", value_parser = integer(0..=u16::MAX), num_args = 0..=1, require_equals = true,
        default_missing_value = "8765")]
    foxglove: Option<u16>,
    /// Origin of other pages that may read, such as `http://localhost:8080`; may be repeated
    /// [default: Foxglove's pages only]
    #[arg(long, value_name = "ORIGIN", requires = "foxglove")]
    foxglove_origin: Vec<Origin>,
    #[command(flatten)]
    options: DeviceOptions,
}

impl View {
    pub fn run(self) -> Result<()> {
        let feed = match (self.device, self.file) {
            (Some(name), _) => {
                let image = self.options.image.clone();
                let requested = self.options.requested()?;
                let dynamic_depth = self.options.dynamic_depth()?;
                // One that is not there ends the command; one that goes away later does not.
                let first = Cell::new(Some(dtof_device::open(&name, image.as_deref())?));
                Feed::Device(Box::new(Device {
                    requested,
                    pixels: self.options.pixels,
                    dynamic_depth,
                    host_timeout: self.options.host_timeout(),
                    open: Box::new({
                        let name = name.clone();
                        move || match first.take() {
                            Some(port) => Ok(port),
                            None => dtof_device::open(&name, image.as_deref()),
                        }
                    }),
                    name,
                }))
            }
            (None, file) => {
                let file = file.unwrap_or_default();
                ensure!(
                    !self.options.are_given()?,
                    "{}: a recording has its own settings; leave out the options of a device",
                    file.display()
                );
                let speed = self.speed.unwrap_or(1.0);
                let playback = Playback::new(file.clone(), self.laser_hz, speed)?;
                super::warn(file.as_path(), playback.warning.clone(), false);
                Feed::Playback(playback)
            }
        };
        interrupt::handle_ctrl_c()?;
        let foxglove = self.foxglove;
        let foxglove = foxglove.map(|port| Foxglove::bind(port, self.foxglove_origin));
        let foxglove = foxglove.transpose()?;
        let served = Served::begin(
            feed,
            self.port,
            Folder::new(self.out.as_deref())?,
            Terminal {
                complain,
                name: flag,
            },
        )?;
        let mut out = io::stdout();
        writeln!(out, "{}", served.address)?;
        if let Some(foxglove) = &foxglove {
            writeln!(out, "{}", foxglove.address())?;
        }
        out.flush()?;
        served.with(foxglove).until(interrupt::is_interrupted)
    }
}
