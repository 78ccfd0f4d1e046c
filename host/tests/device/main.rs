//! Devices at the other end of a port: the engine, the monitor and its recordings, calibration.

#[path = "../common/mod.rs"]
mod common;

mod bad_wire;
#[cfg(target_os = "linux")]
mod cable;
mod calibrate;
mod calibrate_refused;
mod desk;
mod engine;
mod map;
mod masked;
mod monitor;
mod recording;
#[cfg(target_os = "linux")]
mod saved;
#[path = "../../../firmware/tests/common/wire.rs"]
mod wire;

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use dtof::device::{self, Client};
use dtof::engine::settings::Settings;
use dtof::simulate::scene;
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, PaperRule};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::frame::{Deframer, WIRE_BYTES};

fn client(name: &str) -> Client {
    Client::new(device::open(name, None).unwrap()).unwrap()
}

/// What the monitor asks of its devices.
fn settings() -> Settings {
    Settings {
        rule: PaperRule::new(U8F8::lit("4"), Count::saturating(5)).into(),
        l1: 40,
        x: 4,
        ..scene::settings(0)
    }
}

/// A TCP port of this computer, and its connections one after the other.
fn listen(mut serve: impl FnMut(&mut TcpStream) -> bool + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let name = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || while serve(&mut listener.accept().unwrap().0) {});
    name
}

/// Runs `sidecar` until the host is gone, and says whether `lives` passed before. `poll` is
/// called at each turn and once more when the host is gone.
fn serve(
    stream: &mut TcpStream,
    sidecar: &mut Sidecar<'_>,
    lives: Duration,
    mut poll: impl FnMut(&mut Sidecar<'_>, u32),
) -> io::Result<bool> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_millis(1)))?;
    let mut deframer = Deframer::new();
    let started = Instant::now();
    while started.elapsed() < lives {
        let now = u32::try_from(started.elapsed().as_millis()).unwrap();
        let mut bytes = [0; 1024];
        let length = match stream.read(&mut bytes) {
            Ok(0) => {
                poll(sidecar, now);
                return Ok(false);
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => 0,
            read => read?,
        };
        for &byte in &bytes[..length] {
            if let Some(frame) = deframer.push(byte) {
                sidecar.receive(frame, now);
            }
        }
        sidecar.work(0);
        poll(sidecar, now);
        sidecar.work(0);
        let mut wire = [0; WIRE_BYTES];
        loop {
            let length = sidecar.transmit(now, &mut wire);
            if length == 0 {
                break;
            }
            stream.write_all(&wire[..length])?;
        }
    }
    Ok(true)
}

/// Takes so many bytes, then nobody reads any more.
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
