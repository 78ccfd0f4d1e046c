//! The sensor, and with it a laser, runs only while a host that is alive wants it.

use crate::common::host::{CONFIGURATION, Host, deliver, device};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_firmware::serial::Buffers;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::KEEP_ALIVE_MS;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::{Configuration, Refusal, Source, StopReason, message};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use proptest::prelude::*;

const HOUR_MS: u32 = 3_600_000;

/// A sensor with a laser: a photon every tenth poll.
#[derive(Default)]
struct Laser {
    is_on: bool,
    started: u32,
    stopped: u32,
    polls: u32,
}

impl Sensor for Laser {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo::new(8)
    }

    fn start(&mut self, _: U16F16, _: Dither) {
        self.is_on = true;
        self.started += 1;
    }

    fn stop(&mut self) {
        self.is_on = false;
        self.stopped += 1;
    }

    fn poll(&mut self, _: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        assert!(self.is_on, "a sensor that is off is polled");
        self.polls += 1;
        if self.polls.is_multiple_of(10) {
            sink.photon(PixelAddress::new(0), 40);
        }
        sink.end_laser_cycles(1);
        Ok(Polled::Idle)
    }
}

fn with_timeout(host_timeout_ms: u16) -> Configuration {
    Configuration {
        host_timeout_ms,
        ..CONFIGURATION
    }
}

/// A device whose sensor runs for a host that has configured it at `now_ms`.
fn running(host_timeout_ms: u16, now_ms: u32) -> (Sidecar<'static>, Laser, Host) {
    let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
    let mut host = Host::new(1, now_ms);
    host.configure(&mut device, now_ms, &with_timeout(host_timeout_ms));
    device.poll_sensor(&mut laser, now_ms);
    assert!(laser.is_on && device.sensor_is_running());
    (device, laser, host)
}

/// The device alone for a millisecond; it cannot send.
fn alone(device: &mut Sidecar, laser: &mut Laser, now_ms: u32) {
    device.poll_sensor(laser, now_ms);
    device.work(0);
    assert_eq!(laser.is_on, device.sensor_is_running());
}

#[test]
fn a_silent_hour_stops_the_sensor_once_and_the_reason_is_reported() {
    // Also where the milliseconds begin anew.
    for from in [0, u32::MAX - 10_000] {
        let (mut device, mut laser, mut host) = running(3_000, from);
        for ms in 1..HOUR_MS {
            alone(&mut device, &mut laser, from.wrapping_add(ms));
            assert_eq!(laser.is_on, ms < 3_000, "after {ms} ms");
        }
        let later = from.wrapping_add(HOUR_MS);
        let report = host.report(&mut device, later);
        // The first stop is that of a new sidecar.
        assert_eq!((laser.started, laser.stopped), (1, 2));
        assert_eq!((report.sensor_starts, report.sensor_stops), (1, 1));
        assert_eq!(report.stop_reason, StopReason::Silence as u8);
        // The host is back, and the sensor is off all the same until it is configured anew.
        for ms in 0..1_000 {
            device.poll_sensor(&mut laser, later.wrapping_add(ms));
            host.exchange(&mut device, later.wrapping_add(ms));
            host.read(8);
            assert!(!laser.is_on);
        }
        host.configure(&mut device, later.wrapping_add(1_000), &CONFIGURATION);
        device.poll_sensor(&mut laser, later.wrapping_add(1_000));
        assert!(laser.is_on);
    }
}

#[test]
fn the_host_timeout_is_that_of_the_configuration_to_the_millisecond() {
    for timeout in [200, 201, 3_000, 60_000] {
        let (mut device, mut laser, _) = running(timeout, 5);
        let dark = (6..).find(|&now_ms| {
            alone(&mut device, &mut laser, now_ms);
            !laser.is_on
        });
        assert_eq!(dark, Some(5 + u32::from(timeout)));
    }
}

#[test]
fn a_host_that_records_for_an_hour_is_never_taken_for_silent() {
    let (mut device, mut laser, mut host) = running(200, 0);
    for now_ms in 1..HOUR_MS {
        device.poll_sensor(&mut laser, now_ms);
        host.exchange(&mut device, now_ms);
        host.read(8);
        assert!(laser.is_on, "after {now_ms} ms");
    }
    assert!(host.events.len() > 1_000, "{}", host.events.len());
    let report = host.report(&mut device, HOUR_MS);
    assert_eq!((report.sensor_starts, report.sensor_stops), (1, 0));
    assert_eq!(report.stop_reason, 0);
}

/// Nothing but keep-alives comes, of which the wire loses three of four.
#[test]
fn keep_alives_are_enough_also_where_most_are_lost() {
    let (mut device, mut laser, mut host) = running(1_000, 0);
    let (mut deframer, mut wire) = (Deframer::new(), [0; WIRE_BYTES]);
    let mut frames = 0;
    for now_ms in 1..60_000 {
        alone(&mut device, &mut laser, now_ms);
        while let length @ 1.. = host.endpoint.transmit(now_ms, &mut wire) {
            frames += 1;
            if frames % 4 == 0 {
                deliver(&mut deframer, &wire[..length], |frame| {
                    device.receive(frame, now_ms);
                });
            }
        }
        assert!(laser.is_on, "after {now_ms} ms");
    }
    assert!(frames >= 60_000 / KEEP_ALIVE_MS - 1, "{frames}");
}

/// As a terminal with an echo sends them after the host was killed.
#[test]
fn an_echo_is_no_host() {
    let (mut device, mut laser, _) = running(500, 0);
    let (mut deframer, mut wire) = (Deframer::new(), [0; WIRE_BYTES]);
    for now_ms in 1..5_000 {
        device.poll_sensor(&mut laser, now_ms);
        device.work(0);
        while let length @ 1.. = device.transmit(now_ms, &mut wire) {
            deliver(&mut deframer, &wire[..length], |frame| {
                device.receive(frame, now_ms);
            });
        }
        assert_eq!(laser.is_on, now_ms < 500, "after {now_ms} ms");
    }
    assert!(device.endpoint().counters().foreign > 20);
}

#[test]
fn the_end_of_a_session_stops_the_sensor_at_the_next_poll() {
    let (mut device, mut laser, mut host) = running(60_000, 0);
    // A configuration that has arrived and waits belonged to the session.
    host.ask(message::CONFIGURE, &CONFIGURATION.to_le_bytes());
    let (mut deframer, mut wire) = (Deframer::new(), [0; WIRE_BYTES]);
    for end in [false, true] {
        if end {
            host.endpoint.end(10);
        }
        let length = host.endpoint.transmit(10, &mut wire);
        assert!(length > 0);
        deliver(&mut deframer, &wire[..length], |frame| {
            device.receive(frame, 10);
        });
    }
    for now_ms in 10..1_000 {
        alone(&mut device, &mut laser, now_ms);
        assert!(!laser.is_on);
    }
    assert_eq!((laser.started, laser.stopped), (1, 2));
    let report = Host::new(2, 1_000).report(&mut device, 1_000);
    assert_eq!(report.stop_reason, StopReason::EndOfSession as u8);
}

#[test]
fn other_configurations_and_sessions_stop_the_sensor_and_say_so() {
    let from_link = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    for (requested, reason) in [
        (Some(from_link), StopReason::Configuration),
        (None, StopReason::NewSession),
    ] {
        let (mut device, mut laser, mut host) = running(3_000, 0);
        match requested {
            Some(requested) => host.configure(&mut device, 1, &requested),
            None => host = Host::new(2, 1),
        }
        let report = host.report(&mut device, 1);
        assert_eq!((report.sensor_stops, report.stop_reason), (0, 0));
        device.poll_sensor(&mut laser, 2);
        let report = host.report(&mut device, 2);
        assert!(!laser.is_on);
        assert_eq!((report.sensor_stops, report.stop_reason), (1, reason as u8));
    }
    // One that is refused changes nothing; another one for the sensor begins anew.
    let (mut device, mut laser, mut host) = running(3_000, 0);
    let refused = Configuration {
        x: 0,
        ..CONFIGURATION
    };
    let answer = host.answer(&mut device, 1, message::CONFIGURE, &refused.to_le_bytes());
    assert_eq!(answer, [Refusal::ZeroX as u8]);
    device.poll_sensor(&mut laser, 2);
    assert_eq!((laser.is_on, laser.started), (true, 1));
    host.configure(&mut device, 3, &CONFIGURATION);
    device.poll_sensor(&mut laser, 3);
    assert_eq!((laser.is_on, laser.started), (true, 2));
    let report = host.report(&mut device, 3);
    assert_eq!((report.sensor_starts, report.sensor_stops), (2, 1));
}

/// USB, through the two ends of the serial port.
#[test]
fn a_port_that_is_closed_stops_the_sensor_also_if_it_is_opened_again_at_once() {
    for reopens in [false, true] {
        let (mut device, mut laser, mut gone) = running(60_000, 0);
        let mut buffers = Buffers::<512, 8>::new();
        let (mut interrupt, mut serial) = buffers.split(|| {});
        assert!(serial.listens(), "a port that cannot tell");
        interrupt.set_listening(true);
        assert!(serial.listens());
        // What the program has sent last is still to be read.
        gone.ask(message::CONFIGURE, &CONFIGURATION.to_le_bytes());
        let mut wire = [0; WIRE_BYTES];
        let length = gone.endpoint.transmit(1, &mut wire);
        wire[..length]
            .iter()
            .for_each(|&byte| interrupt.on_receive(byte));
        interrupt.set_listening(false);
        if reopens {
            interrupt.set_listening(true);
        }
        for now_ms in 1..4 {
            device.set_listening(serial.listens());
            let Ok(()) = device.poll_with(&mut laser, &mut serial, 0, now_ms);
            assert!(!laser.is_on);
        }
        // Its session is over.
        gone.exchange(&mut device, 100);
        assert!(gone.endpoint.is_lost());
        assert_eq!(gone.endpoint.stop_reason(), Some(StopReason::NotListening));

        // While the port is closed no configuration starts it.
        let mut host = Host::new(2, 100);
        host.configure(&mut device, 100, &CONFIGURATION);
        device.poll_sensor(&mut laser, 100);
        assert_eq!(laser.is_on, reopens);
        interrupt.set_listening(true);
        device.set_listening(serial.listens());
        device.poll_sensor(&mut laser, 101);
        assert_eq!(laser.is_on, reopens, "it takes another configuration");
        host.configure(&mut device, 102, &CONFIGURATION);
        device.poll_sensor(&mut laser, 102);
        assert!(laser.is_on);
    }
}

/// A configuration that arrived before the host was silent waits for events that cannot leave.
#[test]
fn a_configuration_from_before_the_silence_starts_nothing_after_it() {
    let (mut device, mut laser, mut host) = running(500, 0);
    let mut wire = [0; WIRE_BYTES];
    for now_ms in 1..100 {
        // The device cannot send, and many events wait.
        device.poll_sensor(&mut laser, now_ms);
        device.work(0);
    }
    host.ask(message::CONFIGURE, &with_timeout(500).to_le_bytes());
    let length = host.endpoint.transmit(100, &mut wire);
    deliver(&mut Deframer::new(), &wire[..length], |frame| {
        device.receive(frame, 100);
    });
    for now_ms in 100..2_000 {
        alone(&mut device, &mut laser, now_ms);
    }
    assert!(!laser.is_on);
    for now_ms in 2_000..4_000 {
        host.exchange(&mut device, now_ms);
        host.read(8);
        device.poll_sensor(&mut laser, now_ms);
        assert!(!laser.is_on, "{now_ms}");
    }
    assert_eq!(host.answers.last().unwrap().0, message::CONFIGURED);
    host.configure(&mut device, 4_000, &CONFIGURATION);
    device.poll_sensor(&mut laser, 4_000);
    assert!(laser.is_on);
}

/// A port that takes all and has nothing, and fails at one of its calls, or from there on.
struct Failing {
    /// Calls that do not fail.
    left: u32,
    /// Calls that do.
    fails: u32,
    /// It has bytes.
    has_bytes: bool,
}

impl Failing {
    fn call(&mut self) -> Result<(), ErrorKind> {
        if self.left > 0 {
            self.left -= 1;
        } else if self.fails > 0 {
            self.fails -= 1;
            return Err(ErrorKind::Other);
        }
        Ok(())
    }
}

impl ErrorType for Failing {
    type Error = ErrorKind;
}

impl ReadReady for Failing {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        self.call()?;
        Ok(self.has_bytes)
    }
}

impl Read for Failing {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        self.call()?;
        // Noise.
        bytes[0] = 7;
        Ok(1)
    }
}

impl WriteReady for Failing {
    fn write_ready(&mut self) -> Result<bool, ErrorKind> {
        self.call()?;
        Ok(true)
    }
}

impl Write for Failing {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.call()?;
        Ok(bytes.len().min(3))
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Checks that the sensor is off for good, but for a configuration: the port is back, and the host hears why.
fn stays_off(device: &mut Sidecar, laser: &mut Laser, host: &mut Host, from: u32, why: StopReason) {
    for now_ms in from..from + 200 {
        host.exchange(device, now_ms);
        host.read(usize::MAX);
        alone(device, laser, now_ms);
        assert!(!laser.is_on, "after {now_ms} ms");
    }
    let report = host.report(device, from + 200);
    assert_eq!(report.stop_reason, why as u8);
    assert_eq!(report.sensor_starts, report.sensor_stops);
    host.configure(device, from + 201, &CONFIGURATION);
    device.poll_sensor(laser, from + 201);
    assert!(laser.is_on);
}

/// Before the error is returned, from whatever call, as the caller may not poll again. A configuration that has arrived
/// and is not worked on starts nothing.
#[test]
fn a_port_that_fails_stops_the_sensor_at_once_and_for_good() {
    for (left, fails, has_bytes) in (0..400)
        .flat_map(|left| [1, u32::MAX].map(|fails| (left, fails)))
        .flat_map(|(left, fails)| [false, true].map(|has_bytes| (left, fails, has_bytes)))
    {
        let (mut device, mut laser, mut host) = running(60_000, 0);
        let mut port = Failing {
            left,
            fails,
            has_bytes,
        };
        let failed = (1..1_000).find(|&now_ms| {
            let polled = device.poll_with(&mut laser, &mut port, 0, now_ms);
            assert_eq!(laser.is_on, polled.is_ok(), "{left} {now_ms}");
            polled.is_err()
        });
        let failed = failed.expect("a call that fails");
        if left % 10 == 0 {
            stays_off(
                &mut device,
                &mut laser,
                &mut host,
                failed,
                StopReason::PortFailed,
            );
        }
    }
}

/// Gives the device a configuration that it does not work on yet.
fn configure_later(device: &mut Sidecar, host: &mut Host, now_ms: u32) {
    host.ask(message::CONFIGURE, &CONFIGURATION.to_le_bytes());
    let (mut deframer, mut wire) = (Deframer::new(), [0; WIRE_BYTES]);
    while let length @ 1.. = host.endpoint.transmit(now_ms, &mut wire) {
        deliver(&mut deframer, &wire[..length], |frame| {
            device.receive(frame, now_ms);
        });
    }
}

/// Whatever has switched it off first, and also if it was never on.
#[test]
fn a_configuration_from_before_a_failure_starts_nothing_after_it() {
    for was_on in [false, true] {
        for (first, second) in [(false, false), (false, true), (true, false), (true, true)] {
            let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
            let mut host = Host::new(1, 0);
            let mut now_ms = 0;
            if was_on {
                host.configure(&mut device, 0, &CONFIGURATION);
            } else {
                host.exchange(&mut device, 0);
            }
            device.poll_sensor(&mut laser, 0);
            assert_eq!(laser.is_on, was_on);
            let mut fail = |device: &mut Sidecar, laser: &mut Laser, by_port| {
                if by_port {
                    let mut port = Failing {
                        left: 0,
                        fails: 1,
                        has_bytes: false,
                    };
                    now_ms += 1;
                    assert!(device.poll_with(laser, &mut port, 0, now_ms).is_err());
                } else {
                    // The host is silent.
                    now_ms += u32::from(Configuration::HOST_TIMEOUT_MS) + 1;
                    device.poll_sensor(laser, now_ms);
                }
                assert!(!laser.is_on);
                now_ms
            };
            let at = fail(&mut device, &mut laser, first);
            configure_later(&mut device, &mut host, at);
            let at = fail(&mut device, &mut laser, second);
            let reasons = [StopReason::Silence, StopReason::PortFailed];
            let why = reasons[usize::from(first)];
            stays_off(&mut device, &mut laser, &mut host, at + 1, why);
        }
    }
}

/// An earlier sidecar of the same firmware may have started it.
#[test]
fn a_new_sidecar_stops_its_sensor() {
    let (_, mut laser, _) = running(500, 0);
    let mut device = device::<8>(Some(SensorInfo::new(8)));
    device.poll_sensor(&mut laser, 1);
    assert!(!laser.is_on && !device.sensor_is_running());
    assert_eq!(Host::new(1, 2).report(&mut device, 2).sensor_stops, 0);
}

/// A sensor whose first stops do not reach it.
struct Deaf {
    laser: Laser,
    /// So many more.
    fails: u32,
    is_stopping: bool,
}

impl Deaf {
    fn try_to_stop(&mut self) -> Result<Polled, SensorFault> {
        self.is_stopping = self.fails > 0;
        if self.is_stopping {
            self.fails -= 1;
            return Err(SensorFault::Bus);
        }
        self.laser.is_on = false;
        Ok(Polled::Idle)
    }
}

impl Sensor for Deaf {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        self.laser.info()
    }

    fn start(&mut self, bin_width: U16F16, dither: Dither) {
        self.laser.start(bin_width, dither);
        self.is_stopping = false;
    }

    fn stop(&mut self) {
        let _ = self.try_to_stop();
    }

    fn is_stopping(&self) -> bool {
        self.is_stopping
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        if self.is_stopping {
            return self.try_to_stop();
        }
        self.laser.poll(now_ms, sink)
    }
}

/// Also one that was not started yet, as a driver cannot know what its sensor does.
#[test]
fn a_stop_that_does_not_reach_the_sensor_is_tried_again_at_every_poll() {
    for fails in 0..5 {
        let (mut device, laser, mut host) = running(500, 0);
        let mut sensor = Deaf {
            laser,
            fails,
            is_stopping: false,
        };
        for now_ms in 1..500 {
            device.poll_sensor(&mut sensor, now_ms);
            assert!(sensor.laser.is_on);
        }
        // The host is silent: the first stop, and a try at each poll after it.
        for now_ms in 500..510 {
            device.poll_sensor(&mut sensor, now_ms);
            assert_eq!(sensor.laser.is_on, now_ms - 500 < fails, "{fails} {now_ms}");
        }
        let report = host.report(&mut device, 510);
        assert_eq!((report.sensor_starts, report.sensor_stops), (1, 1));
        // The first try has no error of a poll.
        assert_eq!(report.sensor_errors, fails.saturating_sub(1));
    }
    let mut device = device::<8>(Some(SensorInfo::new(8)));
    let mut sensor = Deaf {
        laser: Laser {
            is_on: true,
            ..Laser::default()
        },
        fails: 2,
        is_stopping: false,
    };
    // The first poll tries twice.
    for is_on in [true, false, false] {
        device.poll_sensor(&mut sensor, 0);
        assert_eq!(sensor.laser.is_on, is_on);
    }
}

#[test]
fn a_sensor_that_may_not_start_says_why() {
    let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
    let mut host = Host::new(1, 0);
    device.set_listening(false);
    host.configure(&mut device, 0, &CONFIGURATION);
    device.poll_sensor(&mut laser, 0);
    device.poll_sensor(&mut laser, 1);
    assert_eq!(laser.started, 0);
    let report = host.report(&mut device, 1);
    assert_eq!((report.sensor_starts, report.sensor_stops), (0, 0));
    assert_eq!(report.stop_reason, StopReason::NotListening as u8);
}

#[test]
fn after_a_reset_the_sensor_is_off_and_hosts_are_told_why() {
    let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
    device.set_stop_reason(Some(StopReason::Watchdog));
    for now_ms in 0..10_000 {
        alone(&mut device, &mut laser, now_ms);
    }
    assert_eq!((laser.started, laser.stopped), (0, 1));
    // The host of before still speaks in its session.
    let (_, _, mut before) = running(3_000, 0);
    before
        .endpoint
        .offer(message::STATISTICS_REQUEST, &[])
        .unwrap();
    before.exchange(&mut device, 10_000);
    assert!(before.endpoint.is_lost());
    assert_eq!(before.endpoint.stop_reason(), Some(StopReason::Watchdog));
    let mut host = Host::new(2, 10_001);
    let report = host.report(&mut device, 10_001);
    assert_eq!((report.sensor_starts, report.sensor_stops), (0, 0));
    assert_eq!(report.stop_reason, StopReason::Watchdog as u8);
}

#[test]
fn never_is_refused_unless_the_firmware_was_built_for_it() {
    let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
    let mut host = Host::new(1, 0);
    let never = with_timeout(0);
    let answer = host.answer(&mut device, 0, message::CONFIGURE, &never.to_le_bytes());
    if cfg!(feature = "laser-on-without-host") {
        assert!(answer.is_empty());
        for now_ms in 0..HOUR_MS {
            alone(&mut device, &mut laser, now_ms);
        }
    } else {
        assert_eq!(answer, [Refusal::HostTimeout as u8]);
        device.poll_sensor(&mut laser, 1);
    }
    assert_eq!(laser.is_on, cfg!(feature = "laser-on-without-host"));
}

/// What a host, its port and time do.
#[derive(Clone, Copy, Debug)]
enum Action {
    /// Another host, or the same program started again.
    Hello,
    Configure(Source, u16),
    /// One that the device refuses.
    Refused,
    KeepAlive,
    End,
    Port(bool),
    Time(u32),
}

fn action() -> impl Strategy<Value = Action> {
    let source = prop_oneof![3 => Just(Source::Sensor), 1 => Just(Source::Link)];
    prop_oneof![
        2 => Just(Action::Hello),
        4 => (source, prop_oneof![Just(200u16), Just(500), Just(3_000)])
            .prop_map(|(source, timeout)| Action::Configure(source, timeout)),
        1 => Just(Action::Refused),
        4 => Just(Action::KeepAlive),
        1 => Just(Action::End),
        2 => any::<bool>().prop_map(Action::Port),
        6 => prop_oneof![1u32..60, 100u32..700, 2_500u32..3_500].prop_map(Action::Time),
    ]
}

/// When the sensor may run, without a line of the sidecar.
#[derive(Default)]
struct Model {
    session: bool,
    /// Of a configuration that takes the sensor's photons and was not stopped since.
    timeout: Option<u32>,
    heard: u32,
    is_open: bool,
}

impl Model {
    fn runs(&mut self, now_ms: u32) -> bool {
        let is_alive = |timeout| now_ms - self.heard < timeout;
        if !self.is_open || !self.timeout.is_some_and(is_alive) {
            self.timeout = None;
        }
        self.timeout.is_some()
    }
}

proptest! {
    #[test]
    fn whatever_happens_the_sensor_runs_only_when_it_may(
        actions in prop::collection::vec(action(), 1..60), begin: u32,
    ) {
        let (mut device, mut laser) = (device::<8>(Some(SensorInfo::new(8))), Laser::default());
        let mut model = Model { is_open: true, ..Model::default() };
        let (mut session, mut time) = (0, 0);
        let mut host = Host::new(session, begin);
        for action in actions {
            let now_ms = begin.wrapping_add(time);
            match action {
                Action::Hello => {
                    session += 1;
                    host = Host::new(session, now_ms);
                    host.exchange(&mut device, now_ms);
                    prop_assert!(host.endpoint.is_open());
                    model = Model { session: true, heard: time, is_open: model.is_open, timeout: None };
                }
                _ if !model.session => {}
                Action::Configure(source, host_timeout_ms) => {
                    let requested = Configuration { source, ..with_timeout(host_timeout_ms) };
                    host.configure(&mut device, now_ms, &requested);
                    model.timeout = (source == Source::Sensor).then_some(host_timeout_ms.into());
                    model.heard = time;
                }
                Action::Refused => {
                    let refused = Configuration { x: 0, ..CONFIGURATION };
                    host.answer(&mut device, now_ms, message::CONFIGURE, &refused.to_le_bytes());
                    model.heard = time;
                }
                Action::KeepAlive => {
                    // Its last frame may be too recent for another one.
                    for _ in 0..KEEP_ALIVE_MS {
                        time += 1;
                        alone(&mut device, &mut laser, begin.wrapping_add(time));
                        prop_assert_eq!(laser.is_on, model.runs(time), "{:?} {}", action, time);
                    }
                    host.exchange(&mut device, begin.wrapping_add(time));
                    host.read(usize::MAX);
                    model.heard = time;
                }
                Action::End => {
                    host.endpoint.end(now_ms);
                    host.exchange(&mut device, now_ms);
                    prop_assert!(host.endpoint.is_lost());
                    model.session = false;
                    model.timeout = None;
                }
                Action::Port(is_open) => {
                    // The session of a program that closes the port is over.
                    model.session &= is_open || !model.is_open;
                    model.is_open = is_open;
                    device.set_listening(is_open);
                }
                Action::Time(ms) => {
                    for _ in 0..ms {
                        time += 1;
                        alone(&mut device, &mut laser, begin.wrapping_add(time));
                        prop_assert_eq!(laser.is_on, model.runs(time), "{:?} {}", action, time);
                    }
                }
            }
            let now_ms = begin.wrapping_add(time);
            device.poll_sensor(&mut laser, now_ms);
            prop_assert_eq!(laser.is_on, model.runs(time), "{:?} {}", action, time);
        }
    }
}
