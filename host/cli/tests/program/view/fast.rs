//! A device in this process that sends events as fast as it is to, over the whole link.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use crate::common::aer::depth_event;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{AER_VERSION, AerEncoder, AerWord, LaserCycle, PixelAddress};
use dtof_device::{HostTimeout, Port};
use dtof_engine::settings::SettingsFile;
use dtof_link::endpoint::{BODY_BYTES, Endpoint};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{LINK_VERSION, greeting};
use dtof_link::{Configuration, HistogramHead, Report, SensorRecord, Source, message};
use dtof_live::{Device, Feed};

/// 64 × 64.
pub const PIXELS: u16 = 4096;

/// The port of the device, and the device behind it.
pub struct Fast {
    endpoint: Endpoint,
    deframer: Deframer,
    encoder: AerEncoder,
    answers: VecDeque<(u8, Vec<u8>)>,
    began: Instant,
    /// Events a second; by default as many as the link takes.
    rate: Option<u64>,
    runs: Option<Instant>,
    /// Time of its first start.
    pub ran: Arc<OnceLock<Instant>>,
    /// All events are of pixel 0.
    pub is_one_pixel: bool,
    since: u64,
    /// Events of all sessions.
    cycle: u64,
}

impl Fast {
    pub fn new(rate: Option<u64>) -> Self {
        let mut greeting = greeting(128, PIXELS);
        for (place, version) in greeting
            .chunks_exact_mut(2)
            .zip([LINK_VERSION, AER_VERSION])
        {
            place.copy_from_slice(&version.to_le_bytes());
        }
        Self {
            endpoint: Endpoint::device(greeting),
            deframer: Deframer::new(),
            encoder: AerEncoder::new(),
            answers: VecDeque::new(),
            began: Instant::now(),
            rate,
            runs: None,
            ran: Arc::default(),
            is_one_pixel: false,
            since: 0,
            cycle: 0,
        }
    }

    fn now_ms(&self) -> u32 {
        u32::try_from(self.began.elapsed().as_millis()).unwrap()
    }

    fn answer(&mut self, kind: u8, body: &[u8]) {
        let answer = match kind {
            message::CONFIGURE => {
                let runs = Configuration::from_le_bytes(body).unwrap().source == Source::Sensor;
                self.runs = runs.then(|| *self.ran.get_or_init(Instant::now));
                self.since = 0;
                self.cycle = 0;
                self.encoder = AerEncoder::new();
                (message::CONFIGURED, Vec::new())
            }
            message::SENSOR_REQUEST => {
                let record = SensorRecord {
                    pixels: PIXELS,
                    bin_width: Some(U16F16::lit("250")),
                    offset: I24F8::ZERO,
                    laser_millihertz: 1_000_000_000,
                    bins: 128,
                    dead_time: 0,
                    most_dither: 0,
                };
                (
                    message::SENSOR,
                    SensorRecord::to_le_bytes(Some(&record), 10).to_vec(),
                )
            }
            message::STATISTICS_REQUEST => {
                let mut report = Report {
                    cycles: self.cycle,
                    ..Report::default()
                };
                report.statistics.events = self.since;
                report.statistics.counted = 37 * self.since;
                (message::STATISTICS, report.to_le_bytes().to_vec())
            }
            message::HISTOGRAM_REQUEST => {
                let head = HistogramHead {
                    pixel: PixelAddress::new(u16::from_le_bytes(body.try_into().unwrap())),
                    is_whole: false,
                    cycle: LaserCycle::new(self.cycle + 40),
                    exposure: 40,
                };
                let mut counts: Vec<u32> = (0..128)
                    .map(|bin| (bin * 7 + head.pixel.raw()) as u32 % 3)
                    .collect();
                let peak = usize::from(Self::bin(head.pixel.raw(), self.cycle));
                counts[peak] = 37;
                counts[peak + 1] = 20;
                for message in head.messages(&counts) {
                    let mut body = heapless::Vec::<u8, BODY_BYTES>::new();
                    message.write(&mut body);
                    self.answers.push_back((message::HISTOGRAM, body.to_vec()));
                }
                return;
            }
            kind => panic!("message {kind:#04x}"),
        };
        self.answers.push_back(answer);
    }

    /// A hill that moves.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 40 to 90"
    )]
    fn bin(pixel: u16, cycle: u64) -> u16 {
        let (column, row) = (f64::from(pixel % 64) - 32.0, f64::from(pixel / 64) - 32.0);
        let time = cycle as f64 / 4e6;
        let (x, y) = (column - 16.0 * time.cos(), row - 16.0 * time.sin());
        let high = 50.0 * (-(x * x + y * y) / 200.0).exp();
        (90.0 - high) as u16
    }

    /// A message with as many due events as fit.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "events of some hours"
    )]
    fn events(&mut self) -> Option<Vec<u8>> {
        let due = self.runs.map(|runs| match self.rate {
            None => u64::MAX,
            Some(rate) => (runs.elapsed().as_secs_f64() * rate as f64) as u64,
        })?;
        let mut body = Vec::new();
        while self.since < due && body.len() + 2 * AerWord::BYTES <= BODY_BYTES {
            // Spread over the array; ten laser cycles each.
            let spread = if self.is_one_pixel { 0 } else { 1531 };
            let pixel = u16::try_from(self.since * spread % u64::from(PIXELS)).unwrap();
            self.cycle += 10;
            let event = depth_event(pixel, self.cycle, Self::bin(pixel, self.cycle));
            let (time, word) = self.encoder.encode(&event);
            for word in time.into_iter().chain([word]) {
                body.extend(word.to_le_bytes());
            }
            self.since += 1;
        }
        (!body.is_empty()).then_some(body)
    }
}

impl Port for Fast {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let now = self.now_ms();
        for &byte in bytes {
            if let Some(frame) = self.deframer.push(byte) {
                self.endpoint.receive(frame, now);
            }
        }
        while let Some(message) = self.endpoint.take() {
            self.answer(message.kind, &message.body);
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut length = 0;
        let now = self.now_ms();
        loop {
            // Events wait for room and follow answers. None is lost.
            while let Some((kind, body)) = self.answers.front() {
                if self.endpoint.offer(*kind, body).is_err() {
                    break;
                }
                self.answers.pop_front();
            }
            if self.answers.is_empty()
                && let Some(body) = self.events()
            {
                self.answers.push_back((message::EVENTS, body));
                continue;
            }
            if bytes.len() - length < WIRE_BYTES {
                break;
            }
            let mut wire = [0; WIRE_BYTES];
            let more = self.endpoint.transmit(now, &mut wire);
            if more == 0 {
                break;
            }
            bytes[length..length + more].copy_from_slice(&wire[..more]);
            length += more;
        }
        if length == 0 {
            std::thread::sleep(Duration::from_micros(200));
        }
        Ok(length)
    }
}

/// The feed of this device.
pub fn feed(rate: Option<u64>) -> Feed {
    feed_of(move || Fast::new(rate))
}

/// The feed of a device that is created when its port is opened.
pub fn feed_of(make: impl Fn() -> Fast + Send + 'static) -> Feed {
    let device = Device {
        name: "a fast device".to_owned(),
        open: Box::new(move || Ok(Box::new(make()))),
        requested: SettingsFile::default(),
        pixels: None,
        dynamic_depth: None,
        host_timeout: HostTimeout::default(),
    };
    Feed::Device(Box::new(device))
}
