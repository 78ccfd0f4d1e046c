//! The engine beside the sensor, and a host that sends it anything, is silent, closes its port or
//! ends its session.

use std::collections::VecDeque;

use dtof_core::fixed::types::U16F16;
use dtof_core::{AerDecoder, AerRecord, AerWord};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};

use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{Configuration, Report, Source, Token};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

use crate::Input;

/// Messages of any kind and body, over a good wire. Events are words that mean something, answers
/// come, and no photon is missing from the report. The sensor runs while it may, and not longer.
pub fn sidecar(data: &[u8]) {
    let mut pixels = heapless::Vec::<Pixel, 16>::new();
    let mut blocks = heapless::Vec::<Block, 4>::new();
    let mut device = Sidecar::new(&mut pixels, &mut blocks, Some(SensorInfo::new(16)));
    let mut host = Host::new(1, 0);
    let mut input = Input::new(data);
    let mut now = 0;
    let mut cycles = 0;
    while !input.is_empty() {
        // Kinds that there are, mostly.
        let kind = match input.byte() {
            0..32 => message::CONFIGURE,
            32..160 => message::PHOTONS,
            160..180 => message::STATISTICS_REQUEST,
            180..200 => message::SYNCHRONISE,
            200..220 => message::HISTOGRAM_REQUEST,
            220..228 => SILENCE,
            228..236 => LISTENING,
            236..240 => END,
            // Those that there are not. Those from 0x80 on are a device's.
            other => other & 0x7f,
        };
        let length = usize::from(input.byte());
        match kind {
            SILENCE => {
                host.speaks = false;
                for _ in 0..20 * length {
                    now += 1;
                    host.exchange(&mut device, now);
                }
                host.speaks = true;
                host.stale = host.configurations.len();
                continue;
            }
            LISTENING => {
                let listens = length % 2 == 0;
                device.set_listening(listens);
                if host.listens && !listens {
                    assert!(!device.endpoint().is_open());
                    host.begin_next(now);
                }
                host.listens = listens;
                continue;
            }
            END => {
                host.end(&mut device, &mut now);
                continue;
            }
            _ => {}
        }
        let body = input.bytes(length.min(BODY_BYTES));
        // Three bytes ask for up to 65,535 laser cycles, each of which all pixels may look at.
        if kind == message::PHOTONS {
            cycles += cycles_of(body);
            if cycles > MOST_CYCLES {
                break;
            }
        }
        for _ in 0..200 {
            now += 1;
            host.exchange(&mut device, now);
            if host.endpoint.is_lost() {
                return;
            }
            if host.endpoint.is_open() && host.endpoint.offer(kind, body).is_ok() {
                host.note(kind, body);
                break;
            }
        }
    }
    // All that was asked has an answer. The device looks twice with neighbours or a dead time, or
    // else 64 times, and then sees what else there is to do.
    let mut asked = false;
    for _ in 0..5000 + cycles / 2 {
        now += 1;
        host.exchange(&mut device, now);
        if host.endpoint.is_lost() || (asked && host.requests.is_empty()) {
            return;
        }
        if !asked && host.endpoint.is_open() {
            asked = host
                .endpoint
                .offer(message::STATISTICS_REQUEST, &[])
                .is_ok();
            if asked {
                host.note(message::STATISTICS_REQUEST, &[]);
            }
        }
    }
    panic!("a request has no answer");
}

/// Not messages: for a while the host says nothing; its port is closed, or open again; its session
/// ends, and the next begins.
const SILENCE: u8 = 0xf0;
const LISTENING: u8 = 0xf1;
const END: u8 = 0xf2;

/// Laser cycles of one input.
const MOST_CYCLES: u64 = 1 << 19;

fn cycles_of(mut body: &[u8]) -> u64 {
    let mut all = 0;
    while let Some((token, rest)) = Token::split_first(body) {
        if let Token::EndOfCycles { cycles } = token {
            all += u64::from(cycles);
        }
        body = rest;
    }
    all
}

/// A sensor without photons.
#[derive(Default)]
struct Laser {
    is_on: bool,
    starts: u32,
}

impl Sensor for Laser {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo::new(16)
    }

    fn start(&mut self, _: U16F16, _: Dither) {
        self.is_on = true;
        self.starts += 1;
    }

    fn stop(&mut self) {
        self.is_on = false;
    }

    fn poll(&mut self, _: u32, _: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        assert!(self.is_on, "asked while it is off");
        Ok(Polled::Idle)
    }
}

struct Host {
    session: u16,
    endpoint: Endpoint,
    deframer: Deframer,
    down: Deframer,
    decoder: AerDecoder,
    events: u64,
    /// What was sent and is not answered yet: configurations, requests of statistics, and of
    /// messages of photons how many they hold.
    requests: VecDeque<(u8, u64)>,
    /// The configurations among them.
    configurations: VecDeque<Option<Configuration>>,
    /// Photons of the link since the configuration, if there is one.
    photons: Option<u64>,
    /// Photons of the link count.
    takes_link: bool,
    laser: Laser,
    /// The sensor may run, until no frame has come for so many milliseconds.
    allowed: Option<u32>,
    listens: bool,
    speaks: bool,
    spoke_ms: u32,
    /// Configurations that may have arrived before a silence: they start nothing after it.
    stale: usize,
    /// The last one was such.
    may_be_off: bool,
}

impl Host {
    fn new(session: u16, now: u32) -> Self {
        Self {
            session,
            endpoint: Endpoint::host(session, greeting(0, 0), now),
            deframer: Deframer::new(),
            down: Deframer::new(),
            decoder: AerDecoder::new(),
            events: 0,
            requests: VecDeque::new(),
            configurations: VecDeque::new(),
            photons: None,
            takes_link: false,
            laser: Laser::default(),
            allowed: None,
            listens: true,
            speaks: true,
            spoke_ms: now,
            stale: 0,
            may_be_off: false,
        }
    }

    /// Ends the session and begins the next. The sensor is off between the two.
    fn end(&mut self, device: &mut Sidecar, now: &mut u32) {
        if !self.endpoint.is_open() {
            return;
        }
        self.endpoint.end(*now);
        self.allowed = None;
        self.configurations.clear();
        for _ in 0..300 {
            *now += 1;
            self.exchange(device, *now);
        }
        assert!(self.endpoint.is_lost() && !device.endpoint().is_open());
        self.begin_next(*now);
    }

    fn begin_next(&mut self, now: u32) {
        let next = Self::new(self.session.wrapping_add(1), now);
        let before = std::mem::replace(self, next);
        (self.laser, self.listens) = (before.laser, before.listens);
    }

    fn note(&mut self, kind: u8, mut body: &[u8]) {
        let mut photons = 0;
        if kind == message::PHOTONS {
            while let Some((token, rest)) = Token::split_first(body) {
                photons += u64::from(matches!(token, Token::Photon { .. }));
                body = rest;
            }
        }
        let kinds = [
            message::CONFIGURE,
            message::PHOTONS,
            message::STATISTICS_REQUEST,
        ];
        if kinds.contains(&kind) {
            self.requests.push_back((kind, photons));
        }
        if kind == message::CONFIGURE {
            let configuration = Configuration::from_le_bytes(body);
            self.configurations.push_back(configuration.ok());
        }
    }

    /// What was asked before this answer is done.
    fn answered(&mut self, question: u8) {
        while let Some((kind, photons)) = self.requests.pop_front() {
            if let Some(all) = self.photons.as_mut().filter(|_| self.takes_link) {
                *all += photons;
            }
            if kind == question {
                return;
            }
            assert_eq!(kind, message::PHOTONS, "an answer is missing");
        }
        panic!("an answer to nothing");
    }

    /// The one that was answered, if a device knows it.
    fn next_configuration(&mut self) -> Option<Configuration> {
        self.may_be_off = self.stale > 0;
        self.stale = self.stale.saturating_sub(1);
        self.configurations.pop_front().flatten()
    }

    fn exchange(&mut self, device: &mut Sidecar, now: u32) {
        let mut wire = [0; WIRE_BYTES];
        for rounds in 0.. {
            assert!(rounds < 10_000, "they never stop talking");
            let length = if self.speaks {
                self.endpoint.transmit(now, &mut wire)
            } else {
                0
            };
            if length > 0 {
                self.spoke_ms = now;
            }
            for &byte in &wire[..length] {
                if let Some(frame) = self.down.push(byte) {
                    device.receive(frame, now);
                }
            }
            device.work(0);
            let answer = device.transmit(now, &mut wire);
            for &byte in &wire[..answer] {
                if let Some(frame) = self.deframer.push(byte) {
                    self.endpoint.receive(frame, now);
                }
            }
            while let Some(message) = self.endpoint.take() {
                self.read(message.kind, &message.body);
            }
            if length + answer == 0 {
                break;
            }
        }
        let silent_ms = now - self.spoke_ms;
        if !self.listens || self.allowed.is_some_and(|most| silent_ms >= most) {
            self.allowed = None;
        }
        device.poll_sensor(&mut self.laser, now);
        // A device acts on a configuration before it has room for the answer.
        let mut unanswered = self.configurations.iter().flatten();
        let may_run = self.allowed.is_some()
            || self.listens
                && unanswered.any(|configuration| {
                    configuration.source == Source::Sensor
                        && silent_ms < u32::from(configuration.host_timeout_ms)
                });
        assert!(may_run || !self.laser.is_on, "the laser is on");
        let must_run = self.allowed.is_some() && self.configurations.is_empty() && !self.may_be_off;
        assert!(!must_run || self.laser.is_on, "the laser is off");
        assert_eq!(self.laser.is_on, device.sensor_is_running());
    }

    fn read(&mut self, kind: u8, body: &[u8]) {
        match kind {
            message::EVENTS => {
                let (words, rest) = body.as_chunks::<{ AerWord::BYTES }>();
                assert!(rest.is_empty(), "half a word");
                for word in words {
                    let record = self.decoder.decode(AerWord::from_le_bytes(*word));
                    match record.expect("words of a device mean something") {
                        AerRecord::Event(_) | AerRecord::DynamicDepth(_) => self.events += 1,
                        AerRecord::Time(_) => {}
                        other => panic!("a device does not send {other:?}"),
                    }
                }
            }
            // The counts begin anew.
            message::CONFIGURED => {
                self.answered(message::CONFIGURE);
                (self.events, self.photons) = (0, Some(0));
                let taken = self.next_configuration();
                let taken = taken.expect("one that a device knows");
                self.takes_link = taken.source == Source::Link;
                let timeout = Some(u32::from(taken.host_timeout_ms));
                self.allowed = timeout.filter(|_| !self.takes_link);
            }
            message::REFUSED => {
                self.answered(message::CONFIGURE);
                self.next_configuration();
            }
            message::STATISTICS => {
                self.answered(message::STATISTICS_REQUEST);
                let report = Report::from_le_bytes(body).expect("a report");
                assert_eq!(report.link.corrupt, 0, "a good wire");
                // The next configuration may have started it since.
                assert!(report.sensor_starts <= self.laser.starts);
                if self.configurations.is_empty() {
                    assert_eq!(report.sensor_starts, self.laser.starts);
                }
                let events = report.statistics.events + report.blocks.events;
                assert!(self.events <= events, "events that none has decided");
                let of = &report.statistics;
                let kept = of.counted + of.excluded;
                let lost =
                    of.saturated + of.rejected + of.gated_out + of.repeated + report.unaddressed;
                assert_eq!(self.photons.unwrap_or(0), kept + lost, "photons");
            }
            _ => {}
        }
    }
}
