//! The engine beside the sensor: pixels, configuration, link.
//!
//! One call does all that is due and never waits: [`Sidecar::poll`] takes bytes
//! from the serial port, acts on the messages they make, moves events from the
//! pixels' slots through the queue into messages, and sends bytes while the port
//! takes them.
//!
//! Photons come from the link or from a sensor. From the link they wait while
//! an event cannot leave its slot: the host stops being acknowledged, stops
//! sending, and the events are those of an engine with all the room in the
//! world. A sensor does not wait; there the slot stays full and the pixel puts
//! its decisions off, as the paper has it.

use dtof_core::fixed::types::{I24F8, U8F8, U16F16};
use dtof_core::{
    AER_VERSION, AerEncoder, AerWord, AsyncPixel, Count, LaserCycle, Look, PaperRule, PixelAddress,
    PixelConfig, RangeGate, RangeScale, Statistics,
};
use embedded_io::{Read, ReadReady, Write, WriteReady};
use heapless::spsc::Queue;
use heapless::vec::{Vec, VecView};

use crate::link::endpoint::{BODY_BYTES, Endpoint, Message};
use crate::link::frame::{Deframer, FrameError, WIRE_BYTES};
use crate::link::message::{self, Configuration, LINK_VERSION, Refusal, Report, Source, Token};

/// Bins of every histogram.
pub const BINS: usize = 128;

/// Words that wait for the link: of an event one, and now and then a time word.
const QUEUE: usize = 64;
/// Words in one message.
const WORDS: usize = BODY_BYTES / AerWord::BYTES;

/// The kind and the body of a message.
type Answer = (u8, Vec<u8, BODY_BYTES>);

/// A photons message and how far it has been worked through.
#[derive(Debug)]
struct Photons {
    body: Vec<u8, BODY_BYTES>,
    next: usize,
    pixel: usize,
    /// Laser cycles of the token before `next` that have not ended yet.
    cycles: u16,
}

/// Macropixels of 128 bins behind a link.
pub struct Sidecar<'a> {
    endpoint: Endpoint,
    deframer: Deframer,
    /// A frame on its way, and how much of it has gone.
    wire: [u8; WIRE_BYTES],
    wire_length: usize,
    wire_sent: usize,
    pixels: &'a mut VecView<AsyncPixel<BINS>>,
    config: Option<PixelConfig<BINS>>,
    source: Source,
    has_sensor: bool,
    photons: Option<Photons>,
    /// Waits for room in the window; nothing else is done before it.
    answer: Option<Answer>,
    encoder: AerEncoder,
    words: Queue<AerWord, QUEUE>,
    cycle: u64,
    unaddressed: u64,
    unknown: u32,
    sensor_errors: u32,
}

impl<'a> Sidecar<'a> {
    /// Waits for a host. `pixels` is the room for them, `has_sensor` says whether
    /// photons may come from anywhere but the link.
    #[must_use]
    pub fn new(pixels: &'a mut VecView<AsyncPixel<BINS>>, has_sensor: bool) -> Self {
        pixels.clear();
        let room = u16::try_from(pixels.capacity()).unwrap_or(u16::MAX);
        #[allow(clippy::cast_possible_truncation, reason = "128")]
        let greeting = greeting(BINS as u16, room);
        Self {
            endpoint: Endpoint::device(greeting),
            deframer: Deframer::new(),
            wire: [0; WIRE_BYTES],
            wire_length: 0,
            wire_sent: 0,
            pixels,
            config: None,
            source: Source::Link,
            has_sensor,
            photons: None,
            answer: None,
            encoder: AerEncoder::new(),
            words: Queue::new(),
            cycle: 0,
            unaddressed: 0,
            unknown: 0,
            sensor_errors: 0,
        }
    }

    /// Does all that can be done without waiting: takes what `serial` has
    /// received, works on it, and gives it what there is to send and it takes.
    /// `lost` is what the port has lost so far.
    ///
    /// # Errors
    /// Those of `serial`.
    pub fn poll<S: Read + ReadReady + Write + WriteReady>(
        &mut self,
        serial: &mut S,
        lost: u32,
        now_ms: u32,
    ) -> Result<(), S::Error> {
        let mut bytes = [0; 64];
        while serial.read_ready()? {
            let length = serial.read(&mut bytes)?;
            let mut deframer = core::mem::take(&mut self.deframer);
            for &byte in bytes.iter().take(length) {
                if let Some(frame) = deframer.push(byte) {
                    self.receive(frame, now_ms);
                }
            }
            self.deframer = deframer;
            self.work(lost);
            self.send(serial, now_ms)?;
        }
        self.work(lost);
        self.send(serial, now_ms)
    }

    /// Frames onto the wire, as far as it takes them.
    fn send<S: Write + WriteReady>(&mut self, serial: &mut S, now_ms: u32) -> Result<(), S::Error> {
        loop {
            while let Some(rest @ [_, ..]) = self.wire.get(self.wire_sent..self.wire_length) {
                if !serial.write_ready()? {
                    return Ok(());
                }
                self.wire_sent += serial.write(rest)?;
            }
            self.wire_sent = 0;
            self.wire_length = self.endpoint.transmit(now_ms, &mut self.wire);
            if self.wire_length == 0 {
                return Ok(());
            }
        }
    }

    /// The link.
    #[must_use]
    pub const fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Takes what was found on the wire.
    pub fn receive(&mut self, frame: Result<&[u8], FrameError>, now_ms: u32) {
        self.endpoint.receive(frame, now_ms);
        if self.endpoint.take_began() {
            self.start_over();
        }
    }

    /// The next frame to put on the wire, or 0 bytes if none is due.
    pub fn transmit(&mut self, now_ms: u32, wire: &mut [u8; WIRE_BYTES]) -> usize {
        self.endpoint.transmit(now_ms, wire)
    }

    /// Does all that can be done now: messages, photons, events. `overrun` is
    /// what the serial port has lost so far.
    pub fn work(&mut self, overrun: u32) {
        loop {
            self.drain();
            if let Some((kind, body)) = &self.answer {
                if self.endpoint.offer(*kind, body).is_err() {
                    return;
                }
                self.answer = None;
            }
            if self.photons.is_some() {
                self.work_through();
                if self.photons.is_some() {
                    return;
                }
                continue;
            }
            // What the host asks next is answered after all events before it.
            let drained = self.is_drained();
            let Some(next) = self.endpoint.peek() else {
                return;
            };
            if next.kind != message::PHOTONS && !drained {
                return;
            }
            let Some(message) = self.endpoint.take() else {
                return;
            };
            self.answer = self.act(message, overrun);
        }
    }

    fn act(&mut self, message: Message, overrun: u32) -> Option<Answer> {
        match message.kind {
            message::CONFIGURE => {
                let configuration = Configuration::from_le_bytes(&message.body);
                let configured = configuration.ok_or(Refusal::Unknown);
                Some(
                    match configured.and_then(|configuration| self.configure(&configuration)) {
                        Ok(()) => (message::CONFIGURED, Vec::new()),
                        Err(refusal) => (message::REFUSED, [refusal as u8].into_iter().collect()),
                    },
                )
            }
            message::PHOTONS if self.config.is_some() && self.source == Source::Link => {
                self.photons = Some(Photons {
                    body: message.body,
                    next: 0,
                    pixel: 0,
                    cycles: 0,
                });
                None
            }
            message::SYNCHRONISE => Some((message::SYNCHRONISED, message.body)),
            message::STATISTICS_REQUEST => {
                let report = self.report(overrun).to_le_bytes();
                Some((message::STATISTICS, report.into_iter().collect()))
            }
            _ => {
                self.unknown = self.unknown.saturating_add(1);
                None
            }
        }
    }

    /// Validates a configuration and takes it on, all pixels at the beginning of
    /// an exposure. The one before stays if it is refused.
    fn configure(&mut self, wanted: &Configuration) -> Result<(), Refusal> {
        let source = match (wanted.source, wanted.rule) {
            (0, 0) => Source::Link,
            (1, 0) if self.has_sensor => Source::Sensor,
            (1, 0) => return Err(Refusal::NoSensor),
            _ => return Err(Refusal::Unknown),
        };
        let minimum = Count::saturating(wanted.minimum_count.into());
        if !(1..=1023).contains(&wanted.minimum_count) {
            return Err(Refusal::MinimumCount);
        }
        if wanted.pixels == 0 || usize::from(wanted.pixels) > self.pixels.capacity() {
            return Err(Refusal::Pixels);
        }
        let gate = RangeGate::new(wanted.gate_first, wanted.gate_last)?;
        let rule = PaperRule::new(U8F8::from_bits(wanted.alpha), minimum);
        let config = PixelConfig::new(wanted.x, wanted.l1, wanted.l2, gate, rule)?;
        RangeScale::new(
            U16F16::from_bits(wanted.bin_width),
            I24F8::from_bits(wanted.offset),
        )?;
        self.pixels.clear();
        for address in 0..wanted.pixels {
            // There is room: checked above.
            let _ = self.pixels.push(AsyncPixel::new(PixelAddress(address)));
        }
        self.config = Some(config);
        self.source = source;
        self.unaddressed = 0;
        self.cycle = 0;
        Ok(())
    }

    /// A new session: nothing is left of the one before.
    fn start_over(&mut self) {
        self.pixels.clear();
        self.config = None;
        self.source = Source::Link;
        self.photons = None;
        self.answer = None;
        self.encoder = AerEncoder::new();
        self.cycle = 0;
        self.unaddressed = 0;
        while self.words.dequeue().is_some() {}
    }

    /// Works through a photons message until it is done or an event cannot
    /// leave its slot.
    fn work_through(&mut self) {
        let Some(mut photons) = self.photons.take() else {
            return;
        };
        loop {
            while photons.cycles > 0 {
                if self.pixels.iter().any(AsyncPixel::request) {
                    self.photons = Some(photons);
                    return;
                }
                if self.end_laser_cycle() {
                    self.drain();
                }
                photons.cycles -= 1;
            }
            let left = photons.body.get(photons.next..).unwrap_or_default();
            let Some((token, rest)) = Token::split_first(left) else {
                // Nothing left, or nothing that means anything.
                self.unknown = self.unknown.saturating_add(u32::from(!left.is_empty()));
                return;
            };
            photons.next = photons.body.len() - rest.len();
            match token {
                Token::Photon { code } => self.count(photons.pixel, code),
                Token::Advance { pixels } => photons.pixel += usize::from(pixels),
                Token::EndOfCycles { cycles } => {
                    photons.pixel = 0;
                    photons.cycles = cycles;
                }
            }
        }
    }

    fn count(&mut self, pixel: usize, code: u16) {
        match (self.pixels.get_mut(pixel), &self.config) {
            (Some(pixel), Some(config)) => pixel.count(config, code),
            _ => self.unaddressed += 1,
        }
    }

    /// Whether one of the pixels fired.
    fn end_laser_cycle(&mut self) -> bool {
        let Some(config) = &self.config else {
            return false;
        };
        let cycle = LaserCycle(self.cycle);
        self.cycle += 1;
        let mut fired = false;
        for pixel in self.pixels.iter_mut() {
            fired |= pixel.end_laser_cycle(config, cycle) == Look::Event;
        }
        fired
    }

    /// Slots to queue, queue to messages, as far as there is room.
    fn drain(&mut self) {
        self.send_words();
        for pixel in self.pixels.iter_mut() {
            if !pixel.request() {
                continue;
            }
            // An event may need a time word before it.
            if self.words.capacity() - self.words.len() < 2 {
                return;
            }
            if let Some(event) = pixel.acknowledge() {
                let (time, word) = self.encoder.encode(&event);
                for word in time.into_iter().chain([word]) {
                    let _ = self.words.enqueue(word); // there is room for both
                }
            }
        }
        self.send_words();
    }

    /// A full message at once, a smaller one only when nothing else is under way.
    fn send_words(&mut self) {
        while self.words.len() >= WORDS || (!self.words.is_empty() && self.endpoint.is_settled()) {
            if !self.endpoint.has_room() {
                return;
            }
            let words = core::iter::from_fn(|| self.words.dequeue()).take(WORDS);
            let body: Vec<u8, BODY_BYTES> = words.flat_map(AerWord::to_le_bytes).collect();
            // There is room: asked above.
            let _ = self.endpoint.offer(message::EVENTS, &body);
        }
    }

    /// Whether every event has become a message.
    fn is_drained(&self) -> bool {
        self.words.is_empty() && !self.pixels.iter().any(AsyncPixel::request)
    }

    fn report(&self, overrun: u32) -> Report {
        let mut statistics = Statistics::default();
        for pixel in self.pixels.iter() {
            statistics += pixel.statistics();
        }
        Report {
            cycles: self.cycle,
            statistics,
            unaddressed: self.unaddressed,
            overrun,
            unknown: self.unknown,
            sensor_errors: self.sensor_errors,
            link: *self.endpoint.counters(),
        }
    }
}

/// What an end says of itself: versions of link and AER words, and of a device
/// its bins and pixels.
#[must_use]
pub const fn greeting(bins: u16, pixels: u16) -> [u8; 8] {
    let [a, b] = LINK_VERSION.to_le_bytes();
    let [c, d] = AER_VERSION.to_le_bytes();
    let [e, f] = bins.to_le_bytes();
    let [g, h] = pixels.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}
