//! The firmware's sidecar with a simulated sensor behind a port, which can be unplugged.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering};
use std::time::Duration;

use crate::common::port::{listen, sensor, serve};
use anyhow::Result;
use dtof_core::fixed::types::I24F8;
use dtof_device::{HostTimeout, Port};
use dtof_engine::settings::SettingsFile;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::StopReason;
use dtof_live::{Device, Feed};
use dtof_sensors::{Sensor, SensorInfo};

const PIXELS: u16 = 16;

/// A device on a cable.
pub struct Plugged {
    pub name: String,
    /// The cable is pulled for a moment when this is set.
    pub pull: Arc<AtomicBool>,
    /// The firmware panics when this is set. The cable stays plugged.
    pub panics: Arc<AtomicBool>,
    /// Number of starts of the sensor.
    pub starts: Arc<AtomicU32>,
    /// The sensor runs.
    pub runs: Arc<AtomicBool>,
}

/// Each time it is plugged in, its target is 100 mm farther away.
pub fn plugged() -> Plugged {
    let times = AtomicI32::new(0);
    let pull = Arc::new(AtomicBool::new(false));
    let pulled = Arc::clone(&pull);
    let (panics, starts) = (
        Arc::new(AtomicBool::new(false)),
        Arc::new(AtomicU32::new(0)),
    );
    let runs = Arc::new(AtomicBool::new(false));
    let (panicked, started, running) =
        (Arc::clone(&panics), Arc::clone(&starts), Arc::clone(&runs));
    let name = listen(move |stream| {
        let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
        let mut blocks = heapless::Vec::<_, 4>::new();
        let mut sensor = sensor(PIXELS, 5, 1000);
        let info = SensorInfo {
            offset: I24F8::from_num(100 * times.fetch_add(1, Ordering::Relaxed)),
            ..sensor.info()
        };
        let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, Some(info));
        // It was reset with the cable.
        if panicked.swap(false, Ordering::Relaxed) {
            sidecar.set_stop_reason(Some(StopReason::Panic));
        }
        let mut was_running = false;
        // A part of a second at a time, to see whether the cable is pulled.
        let lives = Duration::from_secs(600);
        let stream2 = stream.try_clone().unwrap();
        let poll = |sidecar: &mut Sidecar<'_>, now| {
            if pulled.swap(false, Ordering::Relaxed) {
                let _ = stream2.shutdown(std::net::Shutdown::Both);
            } else if panicked.swap(false, Ordering::Relaxed) {
                let pixels = Box::leak(Box::new(heapless::Vec::<_, { PIXELS as usize }>::new()));
                let blocks = Box::leak(Box::new(heapless::Vec::<_, 4>::new()));
                *sidecar = Sidecar::new(pixels, blocks, Some(info));
                sidecar.set_stop_reason(Some(StopReason::Panic));
                was_running = false;
            }
            sidecar.poll_sensor(&mut sensor, now);
            let runs = sidecar.sensor_is_running();
            started.fetch_add(u32::from(runs && !was_running), Ordering::Relaxed);
            was_running = runs;
            running.store(runs, Ordering::Relaxed);
        };
        let _ = serve(stream, &mut sidecar, lives, poll);
        true
    });
    Plugged {
        name,
        pull,
        panics,
        starts,
        runs,
    }
}

/// The feed of the device of this name.
pub fn feed(name: &str, settings: &str) -> Feed {
    let port = name.to_owned();
    let open = move || dtof_device::open(&port, None);
    feed_of(name, settings, HostTimeout::default(), open)
}

/// The same at a port of its own.
fn feed_of(
    name: &str,
    settings: &str,
    host_timeout: HostTimeout,
    open: impl Fn() -> Result<Box<dyn Port>> + Send + 'static,
) -> Feed {
    Feed::Device(Box::new(Device {
        name: name.to_owned(),
        open: Box::new(open),
        requested: SettingsFile::parse(settings).unwrap(),
        pixels: None,
        dynamic_depth: None,
        host_timeout,
    }))
}

/// A port whose device hears nothing for so long as this is set.
struct Mute {
    port: Box<dyn Port>,
    is_mute: Arc<AtomicBool>,
}

impl Port for Mute {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.is_mute.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.port.send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.port.receive(bytes)
    }
}

/// The feed of a device that stops its sensor after 200 ms of silence, and a switch that silences the
/// host.
pub fn feed_that_may_be_mute(name: &str) -> (Feed, Arc<AtomicBool>) {
    let is_mute = Arc::new(AtomicBool::new(false));
    let (port, mute) = (name.to_owned(), Arc::clone(&is_mute));
    let open = move || {
        let (port, is_mute) = (dtof_device::open(&port, None)?, Arc::clone(&mute));
        Ok(Box::new(Mute { port, is_mute }) as Box<dyn Port>)
    };
    let timeout = HostTimeout::from_milliseconds(200).unwrap();
    (feed_of(name, "", timeout, open), is_mute)
}
