//! The engine beside the sensor: pixels, configuration, link.
//!
//! One call does all that is due and never waits: [`Sidecar::poll_with`] takes bytes
//! from the serial port, acts on the messages they make, polls the sensor, moves events from the
//! pixels' slots through the queue into messages, and sends bytes while the port
//! takes them.
//!
//! Photons come from the link or from a sensor. From the link they wait while
//! an event cannot leave its slot: the host gets no acknowledgement and stops
//! sending, so that no event is lost. A sensor cannot wait. While the slot is full, the pixel
//! defers its decisions, as in the paper.
//!
//! The sensor, and with it a laser, runs only on request of a host: from a configuration
//! that uses its photons until another configuration or session, the end of the session,
//! [`Sidecar::set_listening`], a port that fails, or a host that is silent for as long as it has configured.
//! Only another configuration starts it again. A sidecar that is not polled any more cannot stop its sensor:
//! drop the sensor, or let a watchdog reset the board.

mod configuration;
mod events;
mod histograms;
mod photons;
mod records;
mod sensor;

use dtof_core::events::{DynamicDepthConfig, DynamicDepthPixel};
use dtof_core::fixed::types::U16F16;
use dtof_core::{
    AerEncoder, AerWord, AnyRule, CounterWidth, PixelAddress, PixelArray, PixelPlace, binning,
};
use dtof_link::endpoint::{BODY_BYTES, Endpoint, Message};
use dtof_link::frame::{Deframer, FrameError, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{Configuration, DynamicDepth, Report, SensorRecord, Source, StopReason};
use dtof_sensors::dither::Dither;
use dtof_sensors::{SensorFault, SensorInfo};
use embedded_io::{Read, ReadReady, Write, WriteReady};
use heapless::spsc::Queue;
use heapless::vec::{Vec, VecView};

use self::photons::Photons;

/// Bins of every histogram.
pub const BINS: usize = 128;

/// Words that wait for the link: of an event one, and now and then a time word.
const QUEUE: usize = 64;
/// The most looks of all pixels in one turn of the main loop.
const LOOKS: u16 = 64;
/// The same with neighbours or a dead time, whose looks take up to 70 times as long.
const LONG_LOOKS: u16 = 2;

/// The kind and the body of a message.
type Answer = (u8, Vec<u8, BODY_BYTES>);

/// The counters of an image's pixels.
#[cfg(feature = "count8")]
pub type Counters = dtof_core::Count8;
/// The counters of an image's pixels.
#[cfg(not(feature = "count8"))]
pub type Counters = dtof_core::Count10;

/// What the dynamic depth of a pixel or a block is compared with.
type Followed = DynamicDepthPixel<{ DynamicDepth::MEAN_OF }>;

/// Room for a macropixel, which the caller of [`Sidecar::new`] provides.
pub type Pixel = PixelPlace<BINS, Counters, Followed>;

/// Room for a block of pixels.
pub type Block = binning::Block<BINS, Followed>;

/// Macropixels of 128 bins that are served over a link.
pub struct Sidecar<'a> {
    endpoint: Endpoint,
    deframer: Deframer,
    /// A frame on its way, and how much of it has gone.
    wire: [u8; WIRE_BYTES],
    wire_length: usize,
    wire_sent: usize,
    array: PixelArray<'a, BINS, AnyRule, Counters, Followed>,
    /// Of the configuration in force: changes of depth are sent, not depth events.
    dynamic_depth: Option<DynamicDepthConfig>,
    /// Of the configuration in force, for sensors that measure times.
    bin_width: U16F16,
    dither: Dither,
    source: Source,
    sensor: Option<SensorInfo>,
    /// The sensor was told once to be off.
    has_steered: bool,
    /// The sensor has been started and not been stopped.
    running: bool,
    /// It had still more when it was polled last.
    sensor_has_more: bool,
    /// It was started for the configuration in force.
    started: bool,
    /// It stays off until another configuration, for this reason.
    off: Option<StopReason>,
    /// A program has the host's port open, as far as the port can tell.
    listens: bool,
    /// Of the configuration in force: how long the host may be silent, 0 without a limit.
    host_timeout_ms: u16,
    /// Messages that arrived before it went off: no configuration among them starts it.
    stale: usize,
    /// Why the sensor is to stop, since it was polled last.
    stopping: Option<StopReason>,
    /// Why it stopped last.
    stop_reason: Option<StopReason>,
    sensor_starts: u32,
    sensor_stops: u32,
    photons: Option<Photons>,
    /// Waits for room in the window; nothing else is done before it.
    answer: Option<Answer>,
    encoder: AerEncoder,
    words: Queue<AerWord, QUEUE>,
    /// The host waits for the histogram of this pixel.
    requested_histogram: Option<PixelAddress>,
    unknown: u32,
    sensor_errors: u32,
    sensor_fault: Option<SensorFault>,
}

impl<'a> Sidecar<'a> {
    #[allow(clippy::cast_possible_truncation, reason = "at most 24")]
    const COUNTER_BITS: u8 = Counters::BITS as u8;

    /// Waits for a host. `pixels` and `blocks` provide the room for them; `sensor` describes the
    /// sensor if photons may come from one.
    #[must_use]
    pub fn new(
        pixels: &'a mut VecView<Pixel>,
        blocks: &'a mut VecView<Block>,
        sensor: Option<SensorInfo>,
    ) -> Self {
        pixels.clear();
        blocks.clear();
        // As many as there is room for.
        while pixels.push(Pixel::new()).is_ok() {}
        while blocks.push(Block::default()).is_ok() {}
        let array = PixelArray::new(pixels, blocks);
        let room = u16::try_from(array.room()).unwrap_or(u16::MAX);
        #[allow(clippy::cast_possible_truncation, reason = "128")]
        let greeting = greeting(BINS as u16, room);
        Self {
            endpoint: Endpoint::device(greeting),
            deframer: Deframer::new(),
            wire: [0; WIRE_BYTES],
            wire_length: 0,
            wire_sent: 0,
            array,
            dynamic_depth: None,
            bin_width: U16F16::ZERO,
            dither: Dither::OFF,
            source: Source::Link,
            sensor,
            has_steered: false,
            running: false,
            sensor_has_more: false,
            started: false,
            off: None,
            stale: 0,
            listens: true,
            host_timeout_ms: Configuration::HOST_TIMEOUT_MS,
            stopping: None,
            stop_reason: None,
            sensor_starts: 0,
            sensor_stops: 0,
            photons: None,
            answer: None,
            encoder: AerEncoder::new(),
            words: Queue::new(),
            requested_histogram: None,
            unknown: 0,
            sensor_errors: 0,
            sensor_fault: None,
        }
    }

    /// Leaves a pixel out from now on, for example one that is always hot: its photons do not count, in no block either, and
    /// it decides nothing. The host learns of them as photons of pixels that do not exist.
    pub fn leave_out(&mut self, pixel: PixelAddress) {
        self.array.leave_out(pixel.raw().into());
    }

    /// Processes the bytes that `serial` has received, and sends as much as it takes.
    fn serve<S: Read + ReadReady + Write + WriteReady>(
        &mut self,
        serial: &mut S,
        lost: u32,
        now_ms: u32,
    ) -> Result<(), S::Error> {
        let mut bytes = [0; 64];
        // A piece at a time, so that the main loop turns whatever the host sends.
        if serial.read_ready()? {
            let length = serial.read(&mut bytes)?;
            let mut deframer = core::mem::take(&mut self.deframer);
            for &byte in bytes.iter().take(length) {
                if let Some(frame) = deframer.push(byte) {
                    self.receive(frame, now_ms);
                }
            }
            self.deframer = deframer;
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
        if self.endpoint.take_ended() {
            self.start_over(StopReason::EndOfSession);
        }
        if self.endpoint.take_began() {
            self.start_over(StopReason::NewSession);
        }
    }

    /// The next frame to put on the wire, or 0 bytes if none is due.
    pub fn transmit(&mut self, now_ms: u32, wire: &mut [u8; WIRE_BYTES]) -> usize {
        self.endpoint.transmit(now_ms, wire)
    }

    /// Does what can be done now: messages, photons, events; of laser cycles not
    /// more than some, so that it does not take long. `overrun` is what the serial
    /// port has lost so far.
    pub fn work(&mut self, overrun: u32) {
        let config = self.array.config();
        let is_long =
            config.is_some_and(|config| config.has_neighbours() || config.pixels().dead_time() > 0);
        let mut looks = if is_long { LONG_LOOKS } else { LOOKS };
        loop {
            if let Some((kind, body)) = &self.answer {
                if self.endpoint.offer(*kind, body).is_err() {
                    return;
                }
                self.answer = None;
            }
            self.drain();
            self.send_current_histogram();
            if self.photons.is_some() {
                self.work_through(&mut looks);
                if self.photons.is_some() {
                    return;
                }
                continue;
            }
            // A request is answered after all events before it.
            let drained = self.is_drained();
            let Some(next) = self.endpoint.peek().map(|next| next.kind) else {
                return;
            };
            if !drained && !matches!(next, message::PHOTONS | message::HISTOGRAM_REQUEST) {
                return;
            }
            if matches!(next, message::CONFIGURE | message::HISTOGRAM_REQUEST) && self.give_up() {
                continue;
            }
            let Some(message) = self.endpoint.take() else {
                return;
            };
            let is_stale = self.stale > 0;
            self.stale = self.stale.saturating_sub(1);
            if next == message::HISTOGRAM_REQUEST {
                self.accept_request(&message.body);
            } else {
                let off = self.off.filter(|_| is_stale);
                self.answer = self.act(message, overrun);
                if off.is_some() {
                    // The host of a configuration that starts nothing gets the reason.
                    (self.off, self.stopping) = (off, off);
                }
            }
        }
    }

    fn act(&mut self, message: Message, overrun: u32) -> Option<Answer> {
        match message.kind {
            message::CONFIGURE => Some(match self.configure(&message.body) {
                Ok(()) => (message::CONFIGURED, Vec::new()),
                Err(refusal) => (message::REFUSED, Vec::from_array([refusal as u8])),
            }),
            message::PHOTONS if self.array.config().is_some() && self.source == Source::Link => {
                self.photons = Some(Photons::new(message.body));
                None
            }
            message::SYNCHRONISE => Some((message::SYNCHRONISED, message.body)),
            message::SENSOR_REQUEST => {
                let sensor = self.sensor.as_ref().map(records::sensor);
                let sensor = SensorRecord::to_le_bytes(sensor.as_ref(), Self::COUNTER_BITS);
                Some((message::SENSOR, Vec::from_array(sensor)))
            }
            message::STATISTICS_REQUEST => {
                let report = self.report(overrun).to_le_bytes();
                Some((message::STATISTICS, Vec::from_array(report)))
            }
            _ => {
                self.unknown = self.unknown.saturating_add(1);
                None
            }
        }
    }

    /// A session has ended or begun: drops everything of the last one.
    #[inline(never)]
    fn start_over(&mut self, reason: StopReason) {
        self.stopping.get_or_insert(reason);
        // Even if no sensor runs: the last host learns that its session is over.
        self.endpoint.set_stop_reason(reason);
        self.array.clear();
        self.dynamic_depth = None;
        self.source = Source::Link;
        self.photons = None;
        self.answer = None;
        self.requested_histogram = None;
        self.encoder = AerEncoder::new();
        while self.words.dequeue().is_some() {}
    }

    fn report(&self, overrun: u32) -> Report {
        // Events are those that were sent before the report.
        let [statistics, blocks] = self.array.statistics();
        let losses = self.array.losses();
        Report {
            cycles: self.array.cycles(),
            statistics,
            blocks,
            unaddressed: losses.unaddressed + losses.left_out,
            overrun,
            unknown: self.unknown,
            sensor_errors: self.sensor_errors,
            sensor_starts: self.sensor_starts,
            sensor_stops: self.sensor_stops,
            stop_reason: self.stop_reason.map_or(0, |reason| reason as u8),
            last_sensor_error: self
                .sensor_fault
                .map_or(0, |fault| records::fault(fault) as u8),
            link: *self.endpoint.counters(),
        }
    }
}
