//! A host on a good wire, and a sensor that gives what a script says.

use std::ops::Range;

use dtof_core::events::DynamicDepthEvent;
use dtof_core::fixed::types::U16F16;
use dtof_core::{AerDecoder, AerRecord, AerWord, DepthEvent, PixelAddress};
use dtof_firmware::sidecar::{Block, Pixel, Sidecar};
use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, FrameError, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{Configuration, Report};
use dtof_sensors::dither::Dither;
use dtof_sensors::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

/// A configuration that takes photons from the sensor.
pub const CONFIGURATION: Configuration = Configuration {
    l1: 20,
    l2: 200,
    pixels: 8,
    columns: 8,
    echo_guard_bins: 0,
    echo_wait: 4,
    ..Configuration::DEFAULT
};

/// A device with room for so many pixels and no block.
pub fn device<const PIXELS: usize>(sensor: Option<SensorInfo>) -> Sidecar<'static> {
    device_with_blocks::<PIXELS, 0>(sensor)
}

/// A device with room for so many pixels and blocks, which stays until the tests have ended.
pub fn device_with_blocks<const PIXELS: usize, const BLOCKS: usize>(
    sensor: Option<SensorInfo>,
) -> Sidecar<'static> {
    Sidecar::new(
        Box::leak(Box::new(heapless::Vec::<Pixel, PIXELS>::new())),
        Box::leak(Box::new(heapless::Vec::<Block, BLOCKS>::new())),
        sensor,
    )
}

/// A device with a sensor, and a host that has configured it.
pub fn configured<const PIXELS: usize>(requested: &Configuration) -> (Sidecar<'static>, Host) {
    configured_with::<PIXELS>(SensorInfo::new(256), requested)
}

/// The same with another sensor.
pub fn configured_with<const PIXELS: usize>(
    sensor: SensorInfo,
    requested: &Configuration,
) -> (Sidecar<'static>, Host) {
    let mut device = device::<PIXELS>(Some(sensor));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, requested);
    (device, host)
}

/// Gives the frames among these bytes to `receive`.
pub fn deliver<'a>(
    deframer: &mut Deframer,
    bytes: impl IntoIterator<Item = &'a u8>,
    mut receive: impl FnMut(Result<&[u8], FrameError>),
) {
    for &byte in bytes {
        if let Some(frame) = deframer.push(byte) {
            receive(frame);
        }
    }
}

pub struct Host {
    pub endpoint: Endpoint,
    up: Deframer,
    down: Deframer,
    decoder: AerDecoder,
    /// All events so far.
    pub events: Vec<DepthEvent>,
    /// All changes of depth so far.
    pub changes: Vec<DynamicDepthEvent>,
    /// All answers so far, and the events that came before each.
    pub answers: Vec<(u8, Vec<u8>, usize)>,
}

impl Host {
    pub fn new(session: u16, now_ms: u32) -> Self {
        Self {
            endpoint: Endpoint::host(session, greeting(0, 0), now_ms),
            up: Deframer::new(),
            down: Deframer::new(),
            decoder: AerDecoder::new(),
            events: Vec::new(),
            changes: Vec::new(),
            answers: Vec::new(),
        }
    }

    /// Everything that is due goes over the wire, both ways.
    pub fn exchange(&mut self, device: &mut Sidecar, now_ms: u32) {
        let mut wire = [0; WIRE_BYTES];
        loop {
            let length = self.endpoint.transmit(now_ms, &mut wire);
            deliver(&mut self.down, &wire[..length], |frame| {
                device.receive(frame, now_ms);
            });
            device.work(0);
            let answer = device.transmit(now_ms, &mut wire);
            self.hear(&wire[..answer], now_ms);
            if length + answer == 0 {
                return;
            }
        }
    }

    /// Takes bytes off the wire.
    pub fn hear<'a>(&mut self, bytes: impl IntoIterator<Item = &'a u8>, now_ms: u32) {
        deliver(&mut self.up, bytes, |frame| {
            self.endpoint.receive(frame, now_ms);
        });
    }

    /// Each millisecond the device asks its sensor, everything goes over the wire, and
    /// the host takes up to so many messages.
    pub fn run(
        &mut self,
        device: &mut Sidecar,
        sensor: &mut impl Sensor,
        milliseconds: Range<u32>,
        messages: usize,
    ) {
        for now_ms in milliseconds {
            device.poll_sensor(sensor, now_ms);
            self.exchange(device, now_ms);
            self.read(messages);
        }
    }

    /// Takes up to `messages` messages.
    pub fn read(&mut self, messages: usize) {
        for _ in 0..messages {
            let Some(message) = self.endpoint.take() else {
                return;
            };
            if message.kind != message::EVENTS {
                let body = message.body.to_vec();
                self.answers.push((message.kind, body, self.events.len()));
                continue;
            }
            for word in message.body.chunks(16) {
                let word = AerWord::from_le_bytes(word.try_into().unwrap());
                match self.decoder.decode(word).unwrap() {
                    AerRecord::Event(event) => self.events.push(event),
                    AerRecord::Time(_) => {}
                    AerRecord::DynamicDepth(change) => self.changes.push(change),
                    other => panic!("{other:?}"),
                }
            }
        }
    }

    pub fn ask(&mut self, kind: u8, body: &[u8]) {
        self.endpoint.offer(kind, body).unwrap();
    }

    /// Exchanges until the question is answered; the sensor stands still.
    pub fn answer(&mut self, device: &mut Sidecar, now_ms: u32, kind: u8, body: &[u8]) -> Vec<u8> {
        let before = self.answers.len();
        while !self.endpoint.is_open() {
            self.exchange(device, now_ms);
        }
        self.ask(kind, body);
        for _ in 0..1000 {
            self.exchange(device, now_ms);
            self.read(1);
            if let Some((_, body, _)) = self.answers.get(before) {
                return body.clone();
            }
        }
        panic!("no answer to {kind:#04x}");
    }

    pub fn configure(&mut self, device: &mut Sidecar, now_ms: u32, requested: &Configuration) {
        self.answer(device, now_ms, message::CONFIGURE, &requested.to_le_bytes());
        assert_eq!(self.answers.last().unwrap().0, message::CONFIGURED);
    }

    pub fn report(&mut self, device: &mut Sidecar, now_ms: u32) -> Report {
        let body = self.answer(device, now_ms, message::STATISTICS_REQUEST, &[]);
        Report::from_le_bytes(&body).unwrap()
    }
}

/// One call of the sink.
#[derive(Clone, Debug)]
pub enum Call {
    Photon(u16, u16),
    End(u16),
    Frame(u32),
    Histogram(u16, Box<[u32; 128]>),
}

/// Gives the next item each time it is asked; `None` is an error.
pub struct Scripted<I> {
    pub calls: I,
}

pub fn scripted<I>(calls: I) -> Scripted<I> {
    Scripted { calls }
}

impl<I: Iterator<Item = Option<Vec<Call>>>> Sensor for Scripted<I> {
    type Error = SensorFault;

    fn info(&self) -> SensorInfo {
        SensorInfo::new(256)
    }

    fn start(&mut self, _: U16F16, _: Dither) {}

    fn stop(&mut self) {}

    fn poll(&mut self, _: u32, sink: &mut impl PhotonSink) -> Result<Polled, SensorFault> {
        let calls = self.calls.next().unwrap_or(Some(Vec::new()));
        for call in calls.ok_or(SensorFault::Data)? {
            match call {
                Call::Photon(pixel, code) => sink.photon(PixelAddress::new(pixel), code),
                Call::End(cycles) => sink.end_laser_cycles(cycles),
                Call::Frame(cycles) => sink.begin_frame(cycles),
                Call::Histogram(pixel, counts) => sink.histogram(PixelAddress::new(pixel), &counts),
            }
        }
        // One item a poll.
        Ok(Polled::Idle)
    }
}
