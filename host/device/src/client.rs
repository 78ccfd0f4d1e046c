//! The host's end of the link over a port.

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
use dtof_data::events::aer_file::Event;
use dtof_data::options::Refused;
use wait::Wait;

/// A device that is silent for so long is gone.
const SILENCE: Duration = Duration::from_secs(5);
/// Longest wait for the device to confirm the end of a session. After that its host timeout applies.
const END: Duration = Duration::from_millis(300);

/// A session with a device. When this is dropped, the session ends and the device stops its sensor,
/// and with it the laser.
pub struct Client {
    port: Box<dyn Port>,
    /// The port has failed and is not used any more.
    is_gone: bool,
    endpoint: Endpoint,
    deframer: Deframer,
    decoder: AerDecoder,
    started: Instant,
    events: Vec<Event>,
    /// Events so far.
    arrived: u64,
    histograms: Assembly,
    /// Shortest interval between two reads of messages. Makes a slow reader, for tests.
    pub reads_every: Duration,
    read: Instant,
    bins: u16,
    pixels: u16,
    /// Number of pixels of the current configuration.
    configured: u16,
    /// The wait of [`Self::poll_report`] for a requested report.
    report_wait: Option<Wait>,
}

impl Client {
    /// Begins a session.
    ///
    /// # Errors
    /// Fails if no device answers, or if it has other versions of link or AER.
    pub fn new(port: Box<dyn Port>) -> Result<Self> {
        // Any number other than the last session's will do.
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
            report_wait: None,
        };
        let mut wait = Wait::new(0);
        while !client.endpoint.is_open() {
            let answered = client.exchange();
            answered
                .and_then(|()| wait.check(0))
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

    /// Number of bins of a histogram.
    #[must_use]
    pub fn bins(&self) -> u16 {
        self.bins
    }

    /// Largest number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u16 {
        self.pixels
    }

    /// The host's counts of the link.
    #[must_use]
    pub fn counters(&self) -> &LinkCounters {
        self.endpoint.counters()
    }

    /// Configures the device.
    ///
    /// # Errors
    /// Fails with the device's reason if it refuses the configuration, or if it is gone.
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
                        "0 needs firmware that was built with laser-on-without-host: {refusal}"
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
    /// Fails if the device is gone.
    pub fn sensor(&mut self) -> Result<Option<SensorRecord>> {
        Ok(self.sensor_and_counters()?.0)
    }

    /// The width of the counters of the device's pixels.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn counter_bits(&mut self) -> Result<u8> {
        Ok(self.sensor_and_counters()?.1)
    }

    fn sensor_and_counters(&mut self) -> Result<(Option<SensorRecord>, u8)> {
        let answer = self.request(message::SENSOR_REQUEST, message::SENSOR)?;
        SensorRecord::from_le_bytes(&answer.body)
            .context("the device sends an invalid description of its sensor")
    }

    /// Waits until the device has processed all messages, and returns its events.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn synchronise(&mut self) -> Result<Vec<Event>> {
        self.request(message::SYNCHRONISE, message::SYNCHRONISED)?;
        Ok(self.take_events())
    }

    /// Requests the device's report and waits for it.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn report(&mut self) -> Result<Report> {
        self.request_report()?;
        let answer = self.answer()?;
        self.report_wait = None;
        report(&answer)
    }

    /// Requests the device's report, which [`Self::poll_report`] returns.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn request_report(&mut self) -> Result<()> {
        self.report_wait = Some(Wait::new(self.arrived));
        self.send(message::STATISTICS_REQUEST, &[])
    }

    /// Calls [`Self::exchange`], then reads the messages that have arrived: events, which
    /// [`Self::take_events`] returns, and a requested report.
    ///
    /// # Errors
    /// Fails if the device is gone, or neither answers nor sends an event for 30 seconds.
    pub fn poll_report(&mut self) -> Result<Option<Report>> {
        if let Err(gone) = self.exchange() {
            // Events that have arrived before are kept.
            while let Ok(Some(_)) = self.next() {}
            return Err(gone);
        }
        if let Some(answer) = self.next()? {
            self.report_wait = None;
            return report(&answer).map(Some);
        }
        if let Some(mut wait) = self.report_wait {
            wait.check(self.arrived)?;
            self.report_wait = Some(wait);
        }
        Ok(None)
    }

    /// Requests the histogram of a pixel. [`Self::poll_histogram`] returns the answer. Other requests
    /// may be sent meanwhile.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn request_histogram(&mut self, pixel: PixelAddress) -> Result<()> {
        self.histograms.request(pixel);
        self.send(message::HISTOGRAM_REQUEST, &pixel.raw().to_le_bytes())
    }

    /// The next answer to [`Self::request_histogram`], in the order of the requests. If there is none
    /// yet, calls [`Self::exchange`] and returns `None`.
    ///
    /// # Errors
    /// Fails if the device is gone, or sends a message that was not requested.
    pub fn poll_histogram(&mut self) -> Result<Option<HistogramAnswer>> {
        if let Some(message) = self.next()? {
            bail!(
                "the device sends message {:#04x}, which was not requested",
                message.kind
            );
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

    /// Returns the events that have arrived.
    pub fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Sends a message, after waiting for room in the link's window.
    ///
    /// # Errors
    /// Fails if the device is gone.
    pub fn send(&mut self, kind: u8, body: &[u8]) -> Result<()> {
        let mut wait = Wait::new(self.arrived);
        while self.endpoint.offer(kind, body).is_err() {
            self.exchange()?;
            if let Some(message) = self.next()? {
                bail!(
                    "the device sends message {:#04x}, which was not requested",
                    message.kind
                );
            }
            wait.check(self.arrived)?;
        }
        Ok(())
    }

    /// Sends a message without a body, and waits for its answer of this `kind`.
    fn request(&mut self, request: u8, kind: u8) -> Result<Message> {
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
            wait.check(self.arrived)?;
            self.exchange()?;
        }
    }

    /// Takes events and histograms until another message comes, and returns that one.
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
                    AerRecord::End { .. } => {
                        bail!("the device sends the end of a file in its stream of events")
                    }
                    other => bail!("this program cannot read {other:?}"),
                };
                let (pixel, pixels) = (event.pixel().raw(), self.configured);
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

    /// Sends frames that are due and receives bytes, after a short wait if there are none.
    ///
    /// The device stops its sensor unless this is called again and again: see
    /// [`HostTimeout`](super::HostTimeout).
    ///
    /// # Errors
    /// Fails if the device is gone or has been restarted.
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

    /// Runs `work`, which may take long, while the link to the device stays alive. The device's
    /// messages wait.
    pub fn exchange_during<T: Send>(&mut self, work: impl FnOnce() -> T + Send) -> T {
        thread::scope(|scope| {
            let working = scope.spawn(work);
            // If the device is gone, the next exchange fails as well.
            while !working.is_finished() && self.exchange().is_ok() {}
            working.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    }

    /// Moves frames to the port and bytes from it.
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

/// Decodes a report.
fn report(answer: &Message) -> Result<Report> {
    Report::from_le_bytes(&answer.body)
        .filter(|_| answer.kind == message::STATISTICS)
        .context("the device answers with something other than a report")
}
