//! A simulated sensor that is not tied to a clock: however slowly the host reads, the events are those
//! of pixels with unlimited room.

use crate::common::host::{CONFIGURATION, Call, Host, device};
use crate::common::script;
use dtof_core::PixelAddress;
use dtof_link::{Configuration, Source, message};
use dtof_sensors::{PhotonSink, Sensor, simulated};

const CYCLES: u16 = 20_000;

/// Records the calls of a sensor.
#[derive(Default)]
struct Calls(Vec<Call>);

impl PhotonSink for Calls {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        self.0.push(Call::Photon(pixel.raw(), code));
    }
    fn end_laser_cycles(&mut self, cycles: u16) {
        self.0.push(Call::End(cycles));
    }
    fn begin_frame(&mut self, _: u32) {
        panic!("a frame");
    }
    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {
        panic!("a histogram");
    }
}

/// Checks the events if the host takes `messages` messages every `wait_ms` milliseconds. Returns how
/// often the sensor had to wait for the host.
fn check_events(messages: usize, wait_ms: u32) -> u32 {
    let requested = Configuration {
        pixels: 16,
        ..CONFIGURATION
    };
    let mut calls = Calls::default();
    simulated::scene().laser_cycles(CYCLES, &mut calls);
    let calls = [calls.0];
    let expected = script::reference(&calls, &script::config(&requested));

    let mut sensor = simulated::scene();
    let mut device = device::<16>(Some(sensor.info()));
    let mut left = CYCLES.into();
    // No photons are simulated before the device is configured.
    device.simulate(&mut sensor, &mut left);
    assert_eq!(left, u64::from(CYCLES));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, &requested);
    let (mut now_ms, mut waits) = (0, 0);
    while left > 0 || host.events.len() < expected.len() {
        now_ms += 1;
        assert!(now_ms < 1_000_000, "{left} laser cycles left");
        let before = left;
        device.simulate(&mut sensor, &mut left);
        waits += u32::from(left > 0 && left == before);
        host.exchange(&mut device, now_ms);
        if now_ms.is_multiple_of(wait_ms) {
            host.read(messages);
        }
    }
    assert!(expected.len() > 5_000 && host.events == expected);
    let report = host.report(&mut device, now_ms);
    let statistics = report.statistics;
    assert_eq!(report.cycles, u64::from(CYCLES));
    assert_eq!(statistics.photons(), script::photons(&calls));
    assert_eq!(statistics.events, expected.len() as u64);
    assert_eq!(statistics.deferred + report.unaddressed, 0);
    waits
}

#[test]
fn the_sensor_waits_for_a_slow_host_and_no_event_changes() {
    assert_eq!(check_events(4, 1), 0);
    assert!(check_events(1, 20) > 1_000);
}

#[test]
fn no_photons_are_simulated_while_they_come_from_the_link() {
    let mut sensor = simulated::scene();
    let mut device = device::<16>(Some(sensor.info()));
    let mut host = Host::new(1, 0);
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    host.configure(&mut device, 0, &requested);
    let mut left = 10;
    device.simulate(&mut sensor, &mut left);
    assert_eq!(left, 10);
    host.configure(&mut device, 0, &CONFIGURATION);
    device.simulate(&mut sensor, &mut left);
    assert_eq!(left, 0);
    let answer = host.answer(&mut device, 0, message::SYNCHRONISE, b"");
    assert!(answer.is_empty());
    assert_eq!(host.report(&mut device, 0).cycles, 10);
}
