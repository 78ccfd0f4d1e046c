//! `dtof monitor --record` on a device behind TCP whose bytes are dropped, flipped, doubled,
//! swapped and held up, and that hangs up or restarts: what is recorded is what the device has
//! sent, or the first of it, and then the program says so and fails.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::num::NonZeroU16;
use std::process::ExitStatus;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::Scratch;
use crate::device::listen;
use crate::device::recording::recorded;
use crate::device::wire::{Tap, Wire};
use dtof_core::fixed::types::{U0F32, U8F24};
use dtof_core::{DepthEvent, PixelAddress};
use dtof_data::events::aer_file::Event;
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_sensors::Sensor;
use dtof_sensors::simulated::{Pulse, Settings, Simulated, SimulatedPixel};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

const PIXELS: u16 = 4;
const PULSE: Pulse = Pulse::new(&[U0F32::lit("0.25"), U0F32::lit("0.5")]);
/// Longest run of a program.
const PATIENCE: Duration = Duration::from_secs(90);

/// Faults of a connection.
#[derive(Clone, Copy)]
struct Plan {
    /// One fault in so many bytes; none if 0.
    one_in: u32,
    /// Time after the first event at which the device closes the connection or restarts.
    hangs_up_ms: Option<u32>,
    restarts_ms: Option<u32>,
}

/// The device's events in a connection.
struct Sent {
    events: Vec<DepthEvent>,
    /// Number of the first ones that were acknowledged.
    delivered: usize,
    faults: u32,
    repeated: u32,
}

/// A device with a simulated sensor, independent of connections.
struct Device {
    sidecar: Sidecar<'static>,
    sensor: Simulated<'static>,
    frames: Deframer,
    started: Instant,
    rng: Pcg32,
}

/// The device after power-on.
fn sidecar_and_sensor() -> (Sidecar<'static>, Simulated<'static>) {
    let half = U8F24::lit("0.5");
    let pixel = |pixel| SimulatedPixel::new(PixelAddress::new(pixel), 20 + 20 * pixel, half, half);
    let pixels: Vec<_> = (0..PIXELS).map(|number| pixel(number).unwrap()).collect();
    let settings = Settings {
        seed: 1,
        bins: 128,
        cycles_per_second: 20_000,
        cycles_per_poll: NonZeroU16::new(1_000).unwrap(),
    };
    let sensor = Simulated::new(pixels.leak(), PULSE, settings);
    let sidecar = Sidecar::new(
        Box::leak(Box::new(heapless::Vec::<Pixel, { PIXELS as usize }>::new())),
        Box::leak(Box::new(heapless::Vec::<Block, 1>::new())),
        Some(sensor.info()),
    );
    (sidecar, sensor)
}

impl Device {
    fn new(seed: u64) -> Self {
        let (sidecar, sensor) = sidecar_and_sensor();
        Self {
            sidecar,
            sensor,
            frames: Deframer::new(),
            started: Instant::now(),
            rng: Pcg32::seed_from_u64(seed),
        }
    }

    /// Serves one connection, until the host is gone or the device closes it.
    fn serve(&mut self, stream: &mut TcpStream, plan: Plan) -> Sent {
        let [mut down, mut up] = [(); 2].map(|()| Wire::new(plan.one_in));
        let mut tap = Tap::default();
        let before = self.sidecar.endpoint().counters().retransmitted;
        // The host may disconnect at any time.
        let _ = self.carry(stream, plan, [&mut down, &mut up], &mut tap);
        let after = self.sidecar.endpoint().counters().retransmitted;
        Sent {
            events: tap.events,
            delivered: tap.delivered,
            faults: down.faults + up.faults,
            repeated: after.saturating_sub(before),
        }
    }

    fn carry(
        &mut self,
        stream: &mut TcpStream,
        plan: Plan,
        [down, up]: [&mut Wire; 2],
        tap: &mut Tap,
    ) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_millis(1)))?;
        let now = |started: Instant| u32::try_from(started.elapsed().as_millis()).unwrap();
        let (mut first, mut restarts_ms) = (None, plan.restarts_ms);
        loop {
            let now = now(self.started);
            let is_over = |ms| first.is_some_and(|first| now - first >= ms);
            if plan.hangs_up_ms.is_some_and(is_over) {
                return Ok(());
            }
            if restarts_ms.take_if(|ms| is_over(*ms)).is_some() {
                (self.sidecar, self.sensor) = sidecar_and_sensor();
                self.frames = Deframer::new();
            }
            let mut bytes = [0; 1024];
            match stream.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(length) => down.carry(&bytes[..length], now, &mut self.rng),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(error),
            }
            for byte in down.arrived(now) {
                if let Some(frame) = self.frames.push(byte) {
                    self.sidecar.receive(frame, now);
                }
            }
            self.sidecar.work(0);
            self.sidecar.poll_sensor(&mut self.sensor, now);
            self.sidecar.work(0);
            let mut wire = [0; WIRE_BYTES];
            while let length @ 1.. = self.sidecar.transmit(now, &mut wire) {
                tap.hear(&wire[..length]);
                if !tap.events.is_empty() {
                    first.get_or_insert(now);
                }
                up.carry(&wire[..length], now, &mut self.rng);
            }
            tap.look(self.sidecar.endpoint());
            stream.write_all(&up.arrived(now))?;
        }
    }
}

/// A device with planned faults in each connection, and its events.
fn device(seed: u64) -> (String, Sender<Plan>, Receiver<Sent>) {
    let (plan, plans) = mpsc::channel::<Plan>();
    let (done, sent) = mpsc::channel();
    let mut device = Device::new(seed);
    let name = listen(move |stream| {
        let Ok(plan) = plans.recv() else {
            return false;
        };
        done.send(device.serve(stream, plan)).is_ok()
    });
    (name, plan, sent)
}

/// Runs the program in `scratch`, whose output goes into files.
fn run(scratch: &Scratch, line: &str) -> ExitStatus {
    let file = |name: &str| File::create(scratch.path(name)).unwrap();
    let mut command = scratch.command(line);
    let command = command.stdout(file("stdout")).stderr(file("stderr"));
    let mut child = command.spawn().unwrap();
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if started.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("does not end: {}", scratch.read("stderr"));
        }
        thread::sleep(Duration::from_millis(10));
    }
}

/// Totals of all connections.
#[derive(Debug, Default)]
struct Totals {
    sessions: u32,
    whole: u32,
    broken: u32,
    faults: u32,
    repeated: u32,
    events: usize,
    undelivered: usize,
}

impl Totals {
    fn add(&mut self, other: &Self) {
        self.sessions += other.sessions;
        self.whole += other.whole;
        self.broken += other.broken;
        self.faults += other.faults;
        self.repeated += other.repeated;
        self.events += other.events;
        self.undelivered += other.undelivered;
    }

    /// One run of the program for so many seconds, compared with the device's events.
    fn session(&mut self, name: &str, seconds: u32, sent: impl FnOnce() -> Sent) {
        let scratch = Scratch::new();
        let line = format!("monitor --device {name} --seconds {seconds} --record events.aer");
        let status = run(&scratch, &line);
        let sent = sent();
        let (printed, said) = (scratch.read("stdout"), scratch.read("stderr"));
        let path = scratch.path("events.aer");
        let recorded = if path.exists() {
            assert_eq!(scratch.printed("decode events.aer"), printed);
            recorded(&path)
        } else {
            // Without an event there is no file, not even a temporary one.
            assert!(
                !status.success() && printed.lines().count() <= 1,
                "{printed}"
            );
            assert_eq!(fs::read_dir(scratch.path("")).unwrap().count(), 2);
            Vec::new()
        };
        let all: Vec<Event> = sent.events.into_iter().map(Event::Depth).collect();
        let errors: Vec<&str> = said
            .lines()
            .filter(|line| !line.starts_with("events/s "))
            .collect();
        if status.success() {
            assert!(
                recorded == all,
                "{} of {} events",
                recorded.len(),
                all.len()
            );
            assert!(errors.is_empty(), "{said}");
            self.whole += 1;
        } else {
            assert!(
                all.starts_with(&recorded),
                "{} of {}",
                recorded.len(),
                all.len()
            );
            assert!(recorded.len() >= sent.delivered);
            assert_eq!(status.code(), Some(1));
            let [error] = errors[..] else {
                panic!("{said}");
            };
            assert!(error.starts_with(&format!("error: {name}: ")), "{said}");
            self.broken += 1;
        }
        self.sessions += 1;
        self.faults += sent.faults;
        self.repeated += sent.repeated;
        self.events += recorded.len();
        self.undelivered += all.len() - recorded.len();
    }
}

/// Sessions on a bad wire, one after another: a complete one, one that the device ends, one in which
/// it restarts. The seed decides which comes first.
fn sessions(seed: u32, length: Duration) -> Totals {
    let (name, plan, sent) = device(seed.into());
    let mut rng = Pcg32::seed_from_u64(seed.into());
    let mut totals = Totals::default();
    let started = Instant::now();
    for kind in seed.. {
        let mut random = |below: u32| rng.next_u32() % below;
        let some_ms = random(1_000);
        plan.send(Plan {
            one_in: [8_000, 2_000, 1_000][random(3) as usize],
            hangs_up_ms: (kind % 3 == 1).then_some(some_ms),
            restarts_ms: (kind % 3 == 2).then_some(some_ms),
        })
        .unwrap();
        // A broken session ends long before its time.
        let seconds = if kind % 3 == 0 { 1 } else { 60 };
        totals.session(&name, seconds, || sent.recv().unwrap());
        if started.elapsed() >= length {
            break;
        }
    }
    totals
}

/// So many devices, each for so long.
fn devices(devices: u32, length: Duration) -> Totals {
    let started = Instant::now();
    let threads: Vec<_> = (0..devices)
        .map(|seed| thread::spawn(move || sessions(seed, length)))
        .collect();
    let mut totals = Totals::default();
    for thread in threads {
        totals.add(&thread.join().unwrap());
    }
    let Totals {
        sessions,
        whole,
        broken,
        faults,
        repeated,
        events,
        undelivered,
    } = totals;
    println!(
        "soak: tcp: {:.0} s, {faults} faults, {sessions} sessions, {whole} recorded whole, {broken} \
         with an error and all that had arrived; {events} events, 0 wrong, 0 lost in silence, \
         {undelivered} undelivered at breaks; {repeated} messages repeated by the devices",
        started.elapsed().as_secs_f64()
    );
    totals
}

#[test]
fn what_is_recorded_on_a_bad_wire_is_what_was_sent_or_the_program_says_that_it_broke() {
    let totals = devices(3, Duration::ZERO);
    assert!(totals.broken >= 2 && totals.events > 20);
}

#[test]
#[ignore = "takes a minute: `.ci/long soak` runs it"]
fn a_minute_of_monitors_on_a_bad_wire_loses_nothing_in_silence() {
    let totals = devices(12, Duration::from_secs(60));
    assert!(totals.whole > 20 && totals.broken > 40 && totals.faults > 500);
    assert!(totals.undelivered > 0 && totals.repeated > 200);
}
