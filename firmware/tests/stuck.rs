//! Interrupts that are stuck: those of the serial port never come again or without end, the line
//! of a sensor stays at one level. The main loop goes round all the same, no event is wrong, and
//! what can be known of it is said.
//!
//! A handler takes no time here. Interrupts without end fill the queue whenever the main loop is
//! about to look; if they leave it no time at all, the watchdog has to help.

use std::cell::RefCell;
use std::convert::Infallible;

use crate::common::host::{CONFIGURATION, Host, configured, device};
use crate::common::plug::{Answers, Bus, Tdc, Tmf};
use crate::common::{plugged, script};
use dtof_chips::Chip;
use dtof_core::DepthEvent;
use dtof_firmware::serial::{Buffers, Serial, SerialInterrupt};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::frame::WIRE_BYTES;
use dtof_link::{Configuration, FaultRecord, Source, message};
use dtof_sensors::simulated;
use dtof_sensors::{Sensor, SensorInfo};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A host gives a device up that is silent for longer.
const SILENCE_MS: u32 = 5_000;
/// Of the queue of received bytes, which holds one less.
const RECEIVE: usize = 2048;

/// The interrupt handler runs until the queue of received bytes is full, and loses one.
fn flood(interrupt: &RefCell<SerialInterrupt<'_>>, serial: &Serial<'_>, rng: &mut Pcg32) {
    let mut interrupt = interrupt.borrow_mut();
    let lost = serial.lost();
    // No queue holds more.
    for _ in 0..RECEIVE {
        interrupt.on_receive(rng.next_u32().to_le_bytes()[0]);
        if serial.lost() > lost {
            return;
        }
    }
    panic!("a byte is lost and not counted");
}

/// The port of the main loop, which counts what is asked of it. With `flood` the queue is full
/// again before each question.
struct Port<'a, 'b> {
    serial: &'a mut Serial<'b>,
    interrupt: &'a RefCell<SerialInterrupt<'b>>,
    flood: Option<&'a mut Pcg32>,
    reads: u32,
}

impl Port<'_, '_> {
    fn ask(&mut self) {
        self.reads += 1;
        assert!(self.reads < 1_000, "a turn without end");
        if let Some(rng) = &mut self.flood {
            flood(self.interrupt, self.serial, rng);
        }
    }
}

impl ErrorType for Port<'_, '_> {
    type Error = Infallible;
}

impl ReadReady for Port<'_, '_> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        self.ask();
        self.serial.read_ready()
    }
}

impl Read for Port<'_, '_> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        self.ask();
        self.serial.read(bytes)
    }
}

impl WriteReady for Port<'_, '_> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        self.ask();
        self.serial.write_ready()
    }
}

impl Write for Port<'_, '_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.ask();
        self.serial.write(bytes)
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        panic!("it would wait");
    }
}

/// What still works of the serial port's interrupts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interrupts {
    All,
    NoReceive,
    NoTransmit,
    None,
    /// The one of receiving comes without end.
    Flood,
}

/// A host and a device with a serial port between them, a millisecond at a time.
struct Bench<'a> {
    host: Host,
    device: Sidecar<'static>,
    serial: Serial<'a>,
    interrupt: RefCell<SerialInterrupt<'a>>,
    rng: Pcg32,
    now_ms: u32,
    /// The most that was asked of the port in one turn of the main loop.
    most: u32,
}

impl<'a> Bench<'a> {
    fn new(buffers: &'a mut Buffers<RECEIVE, 1024>, device: Sidecar<'static>) -> Self {
        let (interrupt, serial) = buffers.split(|| ());
        Self {
            host: Host::new(1, 0),
            device,
            serial,
            interrupt: RefCell::new(interrupt),
            rng: Pcg32::seed_from_u64(4),
            now_ms: 0,
            most: 0,
        }
    }

    /// A millisecond, with a sensor that may have nothing.
    fn turn(&mut self, interrupts: Interrupts, sensor: &mut impl Sensor) {
        use Interrupts::{All, Flood, NoReceive, NoTransmit};
        assert!(self.now_ms < 100_000, "out of step");
        let mut wire = [0; WIRE_BYTES];
        while let length @ 1.. = self.host.endpoint.transmit(self.now_ms, &mut wire) {
            if matches!(interrupts, All | NoTransmit | Flood) {
                let mut interrupt = self.interrupt.borrow_mut();
                wire[..length]
                    .iter()
                    .for_each(|&byte| interrupt.on_receive(byte));
            }
        }
        // Also while the main loop does something else.
        if interrupts == Flood {
            flood(&self.interrupt, &self.serial, &mut self.rng);
        }
        let lost = self.serial.lost();
        let mut port = Port {
            serial: &mut self.serial,
            interrupt: &self.interrupt,
            flood: (interrupts == Flood).then_some(&mut self.rng),
            reads: 0,
        };
        // Never an error, and never a wait: this would not end.
        let Ok(()) = self.device.poll_with(sensor, &mut port, lost, self.now_ms);
        self.most = self.most.max(port.reads);
        if matches!(interrupts, All | NoReceive | Flood) {
            let mut interrupt = self.interrupt.borrow_mut();
            let sent = std::iter::from_fn(|| interrupt.next_to_send());
            let sent: Vec<u8> = sent.take(100).collect();
            self.host.hear(&sent, self.now_ms);
        }
        self.host.read(usize::MAX);
        self.now_ms += 1;
    }

    fn configure(&mut self, requested: &Configuration, sensor: &mut impl Sensor) {
        while !self.host.endpoint.is_open() {
            self.turn(Interrupts::All, sensor);
        }
        self.host.ask(message::CONFIGURE, &requested.to_le_bytes());
        while self.host.answers.is_empty() {
            self.turn(Interrupts::All, sensor);
        }
        assert_eq!(self.host.answers[0].0, message::CONFIGURED);
    }
}

/// Photons from the link: events are those of pixels that nobody disturbs.
#[test]
fn serial_interrupts_that_never_come_again_lose_nothing_until_they_do() {
    let calls = script::script(3_000, &mut Pcg32::seed_from_u64(3));
    let events = script::reference(&calls, &script::config(&CONFIGURATION));
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    for (stuck, is_silent) in [
        (Interrupts::NoReceive, false),
        (Interrupts::NoTransmit, true),
        (Interrupts::None, true),
        (Interrupts::Flood, false),
    ] {
        let mut buffers = Buffers::new();
        let mut bench = Bench::new(&mut buffers, device::<8>(None));
        let mut sensor = simulated::scene();
        bench.configure(&requested, &mut sensor);
        let mut photons = script::messages(&calls).into_iter();
        let (mut silent_ms, mut before) = (0, 0);
        while bench.host.events.len() < events.len() {
            while bench.host.endpoint.has_room() {
                let Some(body) = photons.next() else {
                    break;
                };
                bench.host.ask(message::PHOTONS, &body);
            }
            let is_stuck = (200..10_200).contains(&bench.now_ms);
            bench.turn(if is_stuck { stuck } else { Interrupts::All }, &mut sensor);
            assert!(events.starts_with(&bench.host.events), "{stuck:?}");
            if is_stuck {
                silent_ms = silent_ms.max(bench.host.endpoint.silent_ms(bench.now_ms));
            } else if bench.now_ms < 200 {
                before = bench.host.events.len();
            }
        }
        assert!(
            before > 0 && bench.now_ms > 10_200,
            "{stuck:?}: over before"
        );
        assert_eq!(
            silent_ms > SILENCE_MS,
            is_silent,
            "{stuck:?}: {silent_ms} ms"
        );
        assert_eq!(bench.serial.lost() > 0, stuck == Interrupts::Flood);
        // A piece is read and a few frames written, twice.
        assert!(
            bench.most <= 9,
            "{stuck:?}: {} questions a turn",
            bench.most
        );
        println!(
            "faults: serial interrupts stuck for 10 s ({stuck:?}): {} events right, silent for {silent_ms} ms, \
             at most {} accesses to the port a turn, {} bytes lost and counted",
            events.len(),
            bench.most,
            bench.serial.lost()
        );
    }
}

/// Photons from the sensor, which do not wait: fewer events, and each where its surface is.
#[test]
fn a_flood_of_interrupts_keeps_neither_the_sensor_nor_the_host_waiting() {
    let mut buffers = Buffers::new();
    let mut bench = Bench::new(&mut buffers, device::<16>(Some(SensorInfo::new(256))));
    let mut sensor = simulated::scene();
    let requested = Configuration {
        pixels: 16,
        l1: 100,
        l2: 2_000,
        ..CONFIGURATION
    };
    bench.configure(&requested, &mut sensor);
    let mut events = [0; 3];
    for interrupts in [Interrupts::All, Interrupts::Flood, Interrupts::All] {
        for _ in 0..2_000 {
            bench.turn(interrupts, &mut sensor);
            // The device speaks, whatever it is told.
            assert!(bench.host.endpoint.silent_ms(bench.now_ms) < 200);
        }
        events.rotate_left(1);
        events[2] = bench.host.events.len();
    }
    assert!(events[0] > 500 && events[2] > events[1] + 500, "{events:?}");
    let is_right = |event: &&DepthEvent| {
        let bin = 20 + 6 * event.pixel.raw();
        (bin - 1..=bin + 3).contains(&event.peak_bin.raw())
    };
    let right = bench.host.events.iter().filter(is_right).count();
    // Noise makes as many wrong ones as without a flood: none with this threshold.
    assert_eq!(right, bench.host.events.len());
    bench.host.ask(message::STATISTICS_REQUEST, &[]);
    while bench.host.answers.len() < 2 {
        bench.turn(Interrupts::All, &mut sensor);
    }
    let report = dtof_link::Report::from_le_bytes(&bench.host.answers[1].1).unwrap();
    assert!(report.overrun > 0 && report.cycles > 20_000, "{report:?}");
    println!(
        "faults: receive interrupt without end for 2 s: {} bytes lost and counted, {} events before, {} while, \
         {} after, 0 wrong",
        report.overrun,
        events[0],
        events[1] - events[0],
        events[2] - events[1]
    );
}

/// The sensor gives data, its line is stuck for ten seconds, and it gives data again.
fn stuck<C: Chip + Default>(
    mut sensor: impl Sensor,
    bus: &Bus<C>,
    level: bool,
    fault: FaultRecord,
    bin: u16,
) {
    let requested = Configuration {
        pixels: 9,
        ..CONFIGURATION
    };
    let (mut device, mut host) = configured::<9>(&requested);
    let mut now_ms = 0;
    let mut seconds = |count: u32| {
        // The device answers at once, whatever its sensor does.
        let reports = (0..count)
            .map(|_| plugged::second(&mut sensor, bus, &mut device, &mut host, &mut now_ms));
        let report = reports.last().unwrap();
        assert!(host.events.iter().all(|event| event.peak_bin.raw() == bin));
        (report, host.events.len())
    };
    let (report, before) = seconds(1);
    assert!(before > 5 && report.sensor_errors == 0, "{report:?}");
    bus.set_answers(Answers::Stuck(level));
    bus.interrupt.set(level);
    let (report, while_stuck) = seconds(10);
    assert_eq!(while_stuck, before, "events out of nothing");
    assert!(report.sensor_errors >= 8, "{report:?}");
    assert_eq!(report.last_sensor_error, fault as u8);
    bus.set_answers(Answers::Sensor);
    let errors = report.sensor_errors;
    seconds(2);
    let (report, after) = seconds(1);
    assert!(after > while_stuck + 5, "{report:?}");
    println!(
        "faults: the line of a sensor stuck at {} for 10 s: {errors} errors ({fault}), 0 events, then {} again",
        u8::from(level),
        after - while_stuck
    );
}

#[test]
fn a_line_that_is_stuck_is_named_and_the_device_answers() {
    for (level, fault) in [
        (false, FaultRecord::StuckInterrupt),
        (true, FaultRecord::Timeout),
    ] {
        let bus = Bus::<Tdc>::new();
        let sensor = plugged::tdc7200(&bus);
        stuck(sensor, &bus, level, fault, 28);

        let bus = Bus::<Tmf>::new();
        let sensor = plugged::tmf882x(&bus);
        stuck(sensor, &bus, level, fault, 40);
    }
}
