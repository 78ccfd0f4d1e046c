//! Devices at the other end of a port: the engine, the monitor and its recordings, calibration.

mod bad_wire;
#[cfg(target_os = "linux")]
mod cable;
mod calibrate;
mod calibrate_refused;
mod clock;
mod dither;
mod engine;
mod masked;
mod monitor;
mod recording;
#[cfg(target_os = "linux")]
mod saved;
mod stopped;
mod wall_sensor;
#[path = "../../../../firmware/tests/common/wire.rs"]
mod wire;

use std::io::{self, ErrorKind, Write};

use crate::common::port::{listen, serve};
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule};
use dtof_device::Client;
use dtof_engine::settings::Settings;

fn client(name: &str) -> Client {
    Client::new(dtof_device::open(name, None).unwrap()).unwrap()
}

/// Settings for the monitor's devices.
fn settings() -> Settings {
    Settings::static_scene(0).configured(|array| {
        array.rule = PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into();
        array.l1 = 40;
        array.x = 4;
    })
}

/// An output that accepts so many bytes, then is closed.
struct Closing(usize);

impl Write for Closing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let room = self.0.checked_sub(bytes.len());
        self.0 = room.ok_or(ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
