//! Devices behind a TCP port of this computer.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::num::NonZeroU16;
use std::thread;
use std::time::{Duration, Instant};

use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_sensors::simulated::{Pulse, Settings, Simulated, SimulatedPixel};

const PULSE: Pulse = Pulse::new(&[U0F32::lit("0.25"), U0F32::lit("0.5")]);

/// A sensor of so many pixels. The target of each is some bins farther than that of the last pixel.
pub fn sensor(pixels: u16, bins_apart: u16, cycles_per_second: u32) -> Simulated<'static> {
    let half = U8F24::lit("0.5");
    let pixels: Vec<_> = (0..pixels)
        .map(|pixel| {
            SimulatedPixel::new(
                PixelAddress::new(pixel),
                20 + bins_apart * pixel,
                half,
                half,
            )
            .unwrap()
        })
        .collect();
    let settings = Settings {
        seed: 1,
        bins: 128,
        cycles_per_second,
        cycles_per_poll: NonZeroU16::new(50).unwrap(),
    };
    Simulated::new(pixels.leak(), PULSE, settings)
}

/// A TCP port of this computer that serves one connection after another.
pub fn listen(mut serve: impl FnMut(&mut TcpStream) -> bool + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let name = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || while serve(&mut listener.accept().unwrap().0) {});
    name
}

/// Runs `sidecar` until the host is gone. Returns whether `lives` passed before. `poll` is called in
/// each turn and once more when the host is gone.
pub fn serve(
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
