//! The firmware's sidecar with a simulated sensor behind a port, which can be unplugged.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::Duration;

use crate::common::port::{listen, sensor, serve};
use dtof::device;
use dtof::settings::SettingsFile;
use dtof::view::live::{Device, Feed};
use dtof_core::fixed::types::I24F8;
use dtof_firmware::sidecar::Sidecar;
use dtof_sensors::{About, Sensor};

const PIXELS: u16 = 16;

/// A device on a cable.
pub struct Plugged {
    pub name: String,
    /// The cable is pulled for a moment when this is set.
    pub pull: Arc<AtomicBool>,
}

/// Each time it is plugged in its sensor stands 100 mm farther away.
pub fn plugged() -> Plugged {
    let times = AtomicI32::new(0);
    let pull = Arc::new(AtomicBool::new(false));
    let pulled = Arc::clone(&pull);
    let name = listen(move |stream| {
        let mut pixels = heapless::Vec::<_, { PIXELS as usize }>::new();
        let mut blocks = heapless::Vec::<_, 4>::new();
        let mut sensor = sensor(PIXELS, 5, 1000);
        let about = About {
            offset: I24F8::from_num(100 * times.fetch_add(1, Ordering::Relaxed)),
            ..sensor.about()
        };
        let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, Some(about));
        // A part of a second at a time, to see whether the cable is pulled.
        let lives = Duration::from_secs(600);
        let stream2 = stream.try_clone().unwrap();
        let poll = |sidecar: &mut Sidecar<'_>, now| {
            if pulled.swap(false, Ordering::Relaxed) {
                let _ = stream2.shutdown(std::net::Shutdown::Both);
            }
            sidecar.poll_sensor(&mut sensor, now);
        };
        let _ = serve(stream, &mut sidecar, lives, poll);
        true
    });
    Plugged { name, pull }
}

/// The feed of the device of this name.
pub fn feed(name: &str, settings: &str) -> Feed {
    let port = name.to_owned();
    Feed::Device(Box::new(Device {
        name: name.to_owned(),
        open: Box::new(move || device::open(&port, None)),
        said: SettingsFile::parse(settings).unwrap(),
        pixels: None,
        dynamic_depth: None,
    }))
}
