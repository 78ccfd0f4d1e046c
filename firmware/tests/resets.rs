//! The device is reset between any two bytes that it sends, also in the middle of an event: the
//! host has whole events up to there, learns that the session is over, and gets every event of
//! the next one.

use crate::common::host::{CONFIGURATION, Host, deliver, device};
use crate::common::script;
use dtof_core::DepthEvent;
use dtof_firmware::sidecar::Sidecar;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::{Configuration, Source, message};
use rand_core::SeedableRng;
use rand_pcg::Pcg32;

const PIXELS: usize = 8;
/// A host whose device is reset hears of it so soon.
const SOON_MS: u32 = 100;

/// A host that sends photons.
struct Session<'a> {
    host: Host,
    down: Deframer,
    photons: std::slice::Iter<'a, Vec<u8>>,
    now_ms: u32,
    /// Bytes that the host has heard.
    heard: usize,
}

impl Session<'_> {
    fn new(number: u16) -> Self {
        Self {
            host: Host::new(number, 0),
            down: Deframer::new(),
            photons: [].iter(),
            now_ms: 0,
            heard: 0,
        }
    }

    /// A millisecond with `device`, of whose bytes the host hears no more than up to byte
    /// `until` of the session. Whether it may hear more.
    fn turn(&mut self, device: &mut Sidecar, until: usize) -> bool {
        let mut wire = [0; WIRE_BYTES];
        while self.host.endpoint.is_open() && self.host.endpoint.has_room() {
            let Some(body) = self.photons.next() else {
                break;
            };
            self.host.ask(message::PHOTONS, body);
        }
        while let length @ 1.. = self.host.endpoint.transmit(self.now_ms, &mut wire) {
            deliver(&mut self.down, &wire[..length], |frame| {
                device.receive(frame, self.now_ms);
            });
        }
        device.work(0);
        while let length @ 1.. = device.transmit(self.now_ms, &mut wire) {
            let length = length.min(until - self.heard);
            self.host.hear(&wire[..length], self.now_ms);
            self.heard += length;
        }
        self.host.read(usize::MAX);
        self.now_ms += 1;
        self.heard < until
    }
}

/// Eight pixels' photons, and the events that they make.
fn script() -> (Vec<Vec<u8>>, Vec<DepthEvent>) {
    let calls = script::script(400, &mut Pcg32::seed_from_u64(21));
    let events = script::reference(&calls, &script::config(&CONFIGURATION));
    (script::messages(&calls), events)
}

/// Opens a session and configures the device.
fn begin<'a>(number: u16, device: &mut Sidecar, photons: &'a [Vec<u8>]) -> Session<'a> {
    let mut session = Session::new(number);
    let requested = Configuration {
        source: Source::Link,
        ..CONFIGURATION
    };
    while !session.host.endpoint.is_open() {
        session.turn(device, usize::MAX);
    }
    session
        .host
        .ask(message::CONFIGURE, &requested.to_le_bytes());
    while session.host.answers.is_empty() {
        session.turn(device, usize::MAX);
    }
    session.photons = photons.iter();
    session.heard = 0;
    session
}

#[test]
fn a_reset_between_any_two_bytes_loses_no_event_that_came_before_and_makes_none() {
    let (photons, events) = script();
    assert!(events.len() > 60, "{} events", events.len());
    let (mut resets, mut half, mut slowest) = (0, 0, 0);
    let mut all = 0;
    // Until a session ends before the reset.
    for cut in 0.. {
        let mut first = device::<PIXELS>(None);
        let mut session = begin(1, &mut first, &photons);
        let mut goes_on = true;
        while goes_on && session.host.events.len() < events.len() {
            goes_on = session.turn(&mut first, cut);
        }
        if goes_on {
            all = cut;
            break;
        }
        let before = session.host.events.len();
        let corrupt = session.host.endpoint.counters().corrupt;
        assert!(events.starts_with(&session.host.events), "byte {cut}");

        let (mut second, reset_ms) = (device::<PIXELS>(None), session.now_ms);
        session.down = Deframer::new();
        while !session.host.endpoint.is_lost() {
            assert!(
                session.now_ms - reset_ms < SOON_MS,
                "byte {cut}: not noticed"
            );
            session.turn(&mut second, usize::MAX);
        }
        resets += 1;
        slowest = slowest.max(session.now_ms - reset_ms);
        half += session.host.endpoint.counters().corrupt - corrupt;
        assert_eq!(
            session.host.events.len(),
            before,
            "byte {cut}: an event of a reset device"
        );
        // A frame in half is one that is counted as corrupt, at most.
        assert!(session.host.endpoint.counters().corrupt - corrupt <= 1);

        let mut session = begin(2, &mut second, &photons);
        while session.host.events.len() < events.len() {
            assert!(
                session.now_ms < 10_000,
                "byte {cut}: {} events",
                session.host.events.len()
            );
            session.turn(&mut second, usize::MAX);
        }
        assert!(
            session.host.events == events,
            "byte {cut}: the next session"
        );
    }
    assert!(
        all > 1000 && half > resets / 2,
        "{all} bytes, {half} halves"
    );
    println!(
        "faults: device reset after each of {resets} bytes: 0 half events, {half} halves of frames counted, \
         noticed within {slowest} ms, all {} events in the next session",
        events.len()
    );
}
