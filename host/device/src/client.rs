//! The host's end of the link over a real port.

mod wait;

use std::panic::resume_unwind;
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, Result, bail, ensure};
use dtof_core::{AER_VERSION, AerDecoder, AerRecord, AerWord, PixelAddress};
use dtof_link::endpoint::{Endpoint, LinkCounters, Message};
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, LINK_VERSION, greeting};
use dtof_link::{Configuration, Refusal, Report, SensorRecord};

use super::assembly::{Assembly, HistogramAnswer};
use super::port::Port;
use super::stopped::Stopped;
use dtof_events::aer_file::Event;
use dtof_options::Refused;
use wait::Wait;

/// A device that says nothing for so long is gone.
const SILENCE: Duration = Duration::from_secs(5);
/// A device that has not heard of the end of its session by then is left to its host timeout.
const END: Duration = Duration::from_millis(300);

/// A session with a device. It ends when this is dropped: the device stops its sensor then, and
/// with it the laser.
pub struct Client {
    port: Box<dyn Port>,
    /// The port has failed, and is not used again.
    is_gone: bool,
    endpoint: Endpoint,
    deframer: Deframer,
    decoder: AerDecoder,
    started: Instant,
    events: Vec<Event>,
    /// Events so far.
    arrived: u64,
    histograms: Assembly,
    /// Messages are taken no more often than this: a slow reader, for tests.
    pub reads_every: Duration,
    read: Instant,
    bins: u16,
    pixels: u16,
    /// Pixels of the configuration in force.
    configured: u16,
    /// What [`Self::poll_report`] waits for.
    asked: Option<Wait>,
}

impl Client {
    /// Begins a session.
    ///
    /// # Errors
    /// If nobody answers, or one of another version.
    pub fn new(port: Box<dyn Port>) -> Result<Self> {
        // Any number but that of the session before will do.
        let time = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        let session = (time.as_millis() % 65_521) as u16;
        let now = Instant::now();
        let mut client = Self {
            port,
            is_gone: false,
            endpoint: Endpoint::host(session, greeting(0, 0), 0),
            deframer: Deframer::new(),
            decoder: AerDecoder::new(),
            started: now,
            events: Vec::new(),
            arrived: 0,
            histograms: Assembly::default(),
            reads_every: Duration::ZERO,
            read: now,
            bins: 0,
            pixels: 0,
            configured: 0,
            asked: None,
        };
        let mut wait = Wait::new(0);
        while !client.endpoint.is_open() {
            let answered = client.exchange();
            answered
                .and_then(|()| wait.goes_on(0))
                .context("no device answered")?;
        }
        let [a, b, c, d, e, f, g, h] = *client.endpoint.peer_greeting();
        let versions = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        ensure!(
            versions == (LINK_VERSION, AER_VERSION),
            "the device speaks link version {} and AER version {}, this program {LINK_VERSION} and {AER_VERSION}",
            versions.0,
            versions.1
        );
        client.bins = u16::from_le_bytes([e, f]);
        client.pixels = u16::from_le_bytes([g, h]);
        Ok(client)
    }

    /// Bins of the device's histograms.
    #[must_use]
    pub fn bins(&self) -> u16 {
        self.bins
    }

    /// Pixels the device has at most.
    #[must_use]
    pub fn pixels(&self) -> u16 {
        self.pixels
    }

    /// The host's end of the link.
    #[must_use]
    pub fn counters(&self) -> &LinkCounters {
        self.endpoint.counters()
    }

    /// Puts a configuration in force.
    ///
    /// # Errors
    /// If the device refuses it, with its reason.
    pub fn configure(&mut self, configuration: &Configuration) -> Result<()> {
        self.send(message::CONFIGURE, &configuration.to_le_bytes())?;
        let answer = self.answer()?;
        match answer.kind {
            message::CONFIGURED => {
                self.configured = configuration.pixels;
                Ok(())
            }
            message::REFUSED => {
                let refusal = answer
                    .body
                    .first()
                    .and_then(|&number| Refusal::from_number(number));
                let refusal = refusal.context("for a reason this program does not know")?;
                if configuration.host_timeout_ms == 0 && refusal == Refusal::HostTimeout {
                    let reason = format!(
                        "0 is for firmware that was built with laser-on-without-host: {refusal}"
                    );
                    return Err(Refused::new("host_timeout", reason).into());
                }
                Err(refusal).context("the device refuses the configuration")
            }
            kind => bail!("the device answers with message {kind:#04x}"),
        }
    }

    /// The device's sensor, if it has one.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn sensor(&mut self) -> Result<Option<SensorRecord>> {
        let answer = self.ask(message::SENSOR_REQUEST, message::SENSOR)?;
        SensorRecord::from_le_bytes(&answer.body).context("the device says nothing of its sensor")
    }

    /// Waits until the device has done all it was sent, and gives its events.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn synchronise(&mut self) -> Result<Vec<Event>> {
        self.ask(message::SYNCHRONISE, message::SYNCHRONISED)?;
        Ok(self.take_events())
    }

    /// The report of the device so far.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn report(&mut self) -> Result<Report> {
        self.request_report()?;
        let answer = self.answer()?;
        self.asked = None;
        report(&answer)
    }

    /// Asks what the device has done so far; [`Self::poll_report`] gives the
    /// answer.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn request_report(&mut self) -> Result<()> {
        self.asked = Some(Wait::new(self.arrived));
        self.send(message::STATISTICS_REQUEST, &[])
    }

    /// [`Self::exchange`], and takes what has arrived: events, which
    /// [`Self::take_events`] gives, and the report if it was asked for.
    ///
    /// # Errors
    /// If the device is gone, or neither answers nor sends an event for long.
    pub fn poll_report(&mut self) -> Result<Option<Report>> {
        if let Err(gone) = self.exchange() {
            // Events that have arrived before are taken all the same.
            while let Ok(Some(_)) = self.next() {}
            return Err(gone);
        }
        if let Some(answer) = self.next()? {
            self.asked = None;
            return report(&answer).map(Some);
        }
        if let Some(mut wait) = self.asked {
            wait.goes_on(self.arrived)?;
            self.asked = Some(wait);
        }
        Ok(None)
    }

    /// Asks for the histogram of a pixel. [`Self::poll_histogram`] gives the answer, also when
    /// other questions are asked meanwhile.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn request_histogram(&mut self, pixel: PixelAddress) -> Result<()> {
        self.histograms.asked(pixel);
        self.send(message::HISTOGRAM_REQUEST, &pixel.0.to_le_bytes())
    }

    /// The next answer to [`Self::request_histogram`], in their order. Without one
    /// [`Self::exchange`], and `None`.
    ///
    /// # Errors
    /// If the device is gone, or sends what nobody asked for.
    pub fn poll_histogram(&mut self) -> Result<Option<HistogramAnswer>> {
        if let Some(message) = self.next()? {
            bail!("the device sends message {:#04x} unasked", message.kind);
        }
        let answer = self.take_histogram();
        if answer.is_none() {
            self.exchange()?;
        }
        Ok(answer)
    }

    /// The next answer to [`Self::request_histogram`] that has arrived.
    pub fn take_histogram(&mut self) -> Option<HistogramAnswer> {
        self.histograms.next()
    }

    /// The events that have arrived.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Sends a message, waiting while the window is full.
    ///
    /// # Errors
    /// If the device is gone.
    pub fn send(&mut self, kind: u8, body: &[u8]) -> Result<()> {
        let mut wait = Wait::new(self.arrived);
        while self.endpoint.offer(kind, body).is_err() {
            self.exchange()?;
            if let Some(message) = self.next()? {
                bail!("the device sends message {:#04x} unasked", message.kind);
            }
            wait.goes_on(self.arrived)?;
        }
        Ok(())
    }

    /// Sends a message without a body, and waits for its answer, which is `kind`.
    fn ask(&mut self, request: u8, kind: u8) -> Result<Message> {
        self.send(request, &[])?;
        let answer = self.answer()?;
        ensure!(
            answer.kind == kind,
            "the device answers with message {:#04x}",
            answer.kind
        );
        Ok(answer)
    }

    /// Waits for the next message that is not events.
    fn answer(&mut self) -> Result<Message> {
        let mut wait = Wait::new(self.arrived);
        loop {
            if let Some(message) = self.next()? {
                return Ok(message);
            }
            wait.goes_on(self.arrived)?;
            self.exchange()?;
        }
    }

    /// Takes messages until one is not events and no histogram.
    fn next(&mut self) -> Result<Option<Message>> {
        if self.read.elapsed() < self.reads_every {
            return Ok(None);
        }
        self.read = Instant::now();
        while let Some(message) = self.endpoint.take() {
            if message.kind == message::HISTOGRAM {
                self.histograms.take(&message.body, self.bins)?;
                continue;
            }
            if message.kind != message::EVENTS {
                return Ok(Some(message));
            }
            for word in message.body.chunks(AerWord::BYTES) {
                let word = word.try_into().context("the device sends half a word")?;
                let event = match self.decoder.decode(AerWord::from_le_bytes(word))? {
                    AerRecord::Event(event) => Event::Depth(event),
                    AerRecord::DynamicDepth(event) => Event::DynamicDepth(event),
                    AerRecord::Time(_) => continue,
                    AerRecord::End { .. } => bail!("the device ends a stream it never ends"),
                };
                let (pixel, pixels) = (event.pixel().0, self.configured);
                ensure!(
                    pixel < pixels,
                    "the device sends an event of pixel {pixel}, and has {pixels} pixels"
                );
                if let Event::Depth(event) = &event {
                    let (bin, bins) = (event.peak_bin.raw(), self.bins());
                    ensure!(
                        bin < bins,
                        "the device sends an event of bin {bin}, and has {bins} bins"
                    );
                }
                self.events.push(event);
                self.arrived += 1;
            }
        }
        Ok(None)
    }

    /// Sends what is due and takes what has come. Waits a moment if nothing has.
    ///
    /// A device whose sensor runs stops it unless this is called again and again: see
    /// [`HostTimeout`](super::HostTimeout).
    ///
    /// # Errors
    /// If the device is gone or has been restarted.
    pub fn exchange(&mut self) -> Result<()> {
        let exchanged = self.transfer();
        self.is_gone |= exchanged.is_err();
        exchanged?;
        if self.endpoint.is_lost() {
            return Err(Stopped::forgotten(self.endpoint.stop_reason()).into());
        }
        let now_ms = self.now_ms();
        let silent = Duration::from_millis(self.endpoint.silent_ms(now_ms).into());
        ensure!(
            silent < SILENCE,
            "the device says nothing for {} seconds",
            SILENCE.as_secs()
        );
        Ok(())
    }

    /// Does `work`, which may take long, while the device goes on hearing this program. What the
    /// device sends waits.
    pub fn exchange_during<T: Send>(&mut self, work: impl FnOnce() -> T + Send) -> T {
        thread::scope(|scope| {
            let working = scope.spawn(work);
            // A device that is gone is so at the next exchange, too.
            while !working.is_finished() && self.exchange().is_ok() {}
            working.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    }

    /// Frames to the port and from it.
    fn transfer(&mut self) -> Result<()> {
        let mut wire = [0; WIRE_BYTES];
        loop {
            let length = self.endpoint.transmit(self.now_ms(), &mut wire);
            if length == 0 {
                break;
            }
            self.port
                .send(&wire[..length])
                .context("the device cannot be written to")?;
        }
        let mut bytes = [0; 4096];
        let length = self
            .port
            .receive(&mut bytes)
            .context("the device cannot be read from")?;
        let now_ms = self.now_ms();
        for &byte in &bytes[..length] {
            if let Some(frame) = self.deframer.push(byte) {
                self.endpoint.receive(frame, now_ms);
            }
        }
        Ok(())
    }

    /// Wraps after 49 days, as the link's clock does.
    #[allow(clippy::cast_possible_truncation)]
    fn now_ms(&self) -> u32 {
        self.started.elapsed().as_millis() as u32
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if !self.endpoint.is_open() {
            return;
        }
        self.endpoint.end(self.now_ms());
        let since = Instant::now();
        while !self.is_gone && !self.endpoint.is_lost() && since.elapsed() < END {
            self.is_gone = self.transfer().is_err();
        }
    }
}

/// A message that must be a report.
fn report(answer: &Message) -> Result<Report> {
    Report::from_le_bytes(&answer.body)
        .filter(|_| answer.kind == message::STATISTICS)
        .context("the device answers with no statistics")
}
