//! A device whose laser can be dithered: what it is told, by default and by options.

use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

use dtof_core::fixed::types::U16F16;
use dtof_engine::settings::SettingsFile;
use dtof_firmware::sidecar::Sidecar;
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::Simulated;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

use crate::common::Scratch;
use crate::common::port::{self, listen, serve};
use crate::view::Live;
use crate::view::device::feed;
use crate::view::http::{Stream, post};

/// The largest range of its dither.
const MOST: u8 = 40;

/// A sensor that says with which dither it starts.
struct Dithered {
    photons: Simulated<'static>,
    starts: mpsc::Sender<Dither>,
}

impl Sensor for Dithered {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo {
            most_dither: MOST,
            ..self.photons.info()
        }
    }

    fn start(&mut self, bin_width: U16F16, dither: Dither) {
        let _ = self.starts.send(dither);
        self.photons.start(bin_width, dither);
    }

    fn stop(&mut self) {}

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        let Ok(polled) = self.photons.poll(now_ms, sink);
        Ok(polled)
    }
}

fn device() -> (String, Receiver<Dither>) {
    let (starts, started) = mpsc::channel();
    let name = listen(move |stream| {
        let mut pixels = heapless::Vec::<_, 4>::new();
        let mut blocks = heapless::Vec::<_, 1>::new();
        let mut sensor = Dithered {
            photons: port::sensor(4, 20, 500),
            starts: starts.clone(),
        };
        let mut sidecar = Sidecar::new(&mut pixels, &mut blocks, Some(sensor.info()));
        let poll = |sidecar: &mut Sidecar<'_>, now| sidecar.poll_sensor(&mut sensor, now);
        let _ = serve(stream, &mut sidecar, Duration::from_secs(60), poll);
        true
    });
    (name, started)
}

/// The dither with which `command` starts the sensor.
fn started(command: &str) -> Dither {
    let (name, started) = device();
    Scratch::new().printed(&format!("{command} --device {name}"));
    started.try_recv().unwrap()
}

#[test]
fn a_laser_is_dithered_as_much_as_it_can_unless_options_say_otherwise() {
    let by_default = started("monitor --seconds 1");
    assert_eq!(by_default.range(), u16::from(MOST));
    assert_ne!(by_default, started("monitor --seconds 1"), "one seed");
    let asked = started("monitor --seconds 1 --dither-bins 8 --dither-seed 5");
    assert_eq!(asked, Dither::new(8, 5).unwrap());
    let off = started("monitor --seconds 1 --dither-bins 0 --dither-seed 5");
    assert_eq!(off.range(), 0);
}

#[test]
fn more_than_the_laser_can_is_refused_in_one_line() {
    let scratch = Scratch::new();
    let (name, started) = device();
    for (bins, reason) in [
        (
            "42",
            "--dither-bins 42: this device can dither its laser by at most 40 bins",
        ),
        (
            "7",
            "--dither-bins 7: the range of the dither must be an even number",
        ),
        (
            "256",
            "--dither-bins 256: must be a whole number from 0 to 254",
        ),
    ] {
        let line = format!("monitor --device {name} --seconds 1 --dither-bins {bins}");
        scratch.refused(&scratch.run(&line), &[reason]);
    }
    assert!(started.try_recv().is_err(), "the laser fired");
}

#[test]
fn the_live_page_says_the_dither() {
    let (name, started) = device();
    for (settings, range) in [("", MOST), ("[sensor]\ndither_bins = 0", 0)] {
        let live = Live::of(feed(&name, settings), None);
        let mut page = Stream::open(live.port, 5);
        page.until("dither", |frame| frame["source"]["ditherBins"] == range);
        assert_eq!(started.recv().unwrap().range(), u16::from(range));
    }
}

#[test]
fn saved_settings_have_the_dither_that_was_asked_for_and_not_that_of_this_device() {
    for (settings, bins, seed) in [
        ("", None, None),
        ("[sensor]\ndither_bins = 8", Some(8), None),
        ("[sensor]\ndither_seed = 5", None, Some(5)),
    ] {
        let scratch = Scratch::new();
        let (name, started) = device();
        let live = Live::of(feed(&name, settings), Some(&scratch.path("out")));
        let mut page = Stream::open(live.port, 0);
        page.until("a device", |frame| frame["connection"]["state"] == "live");
        assert_eq!(started.recv().unwrap().range(), bins.unwrap_or(MOST.into()));
        let answer = post(live.port, "/save", "{}");
        assert!(answer.body.contains("dtof.toml"), "{answer:?}");
        let saved = SettingsFile::read(&scratch.path("out/dtof.toml")).unwrap();
        let saved = (saved.sensor.dither_bins, saved.sensor.dither_seed);
        assert_eq!(saved, (bins, seed), "{settings}");
    }
}
