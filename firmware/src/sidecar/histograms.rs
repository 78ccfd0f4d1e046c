//! Histograms that the host asks for. They yield to events: one leaves when no event waits, and
//! leaves room for the next events. One request waits at a time, so that nothing waits behind it.

use dtof_core::{LaserCycle, PixelAddress};
use dtof_link::{HistogramHead, NoHistogram, Source, message};

use super::{BINS, Sidecar};

impl Sidecar<'_> {
    /// Takes a request on, or says at once why there is no histogram.
    #[inline(never)]
    pub(super) fn histogram_of(&mut self, body: &[u8]) {
        let Ok(pixel) = body.try_into().map(u16::from_le_bytes) else {
            self.unknown = self.unknown.saturating_add(1);
            return;
        };
        let of_sensor = self.sensor.filter(|_| self.waits_for_sensor());
        let pixels = of_sensor.map_or(u16::MAX, |sensor| sensor.pixels);
        let pixel = PixelAddress(pixel);
        let reason = if self.config.is_none() {
            NoHistogram::NoConfiguration
        } else if usize::from(pixel.0) >= self.pixels.len() || pixel.0 >= pixels {
            NoHistogram::NoPixel
        } else {
            self.wanted = Some(pixel);
            return;
        };
        self.answer_none(pixel, reason);
    }

    /// Says that there is no histogram.
    #[inline(never)]
    fn answer_none(&mut self, pixel: PixelAddress, reason: NoHistogram) {
        self.answer = Some((message::HISTOGRAM, reason.message(pixel)));
    }

    /// Whether pixels count nothing: the sensor gives whole histograms.
    fn waits_for_sensor(&self) -> bool {
        self.source == Source::Sensor && self.sensor.is_some_and(|sensor| sensor.is_whole)
    }

    /// Another message takes the place of a request that waits. Says whether there was one.
    pub(super) fn give_up(&mut self) -> bool {
        let Some(pixel) = self.wanted.take() else {
            return false;
        };
        self.answer_none(pixel, NoHistogram::GivenUp);
        true
    }

    /// Answers a request with the exposure that its pixel is in, if events leave room.
    pub(super) fn send_exposure(&mut self) {
        if let Some(pixel) = self.wanted
            && !self.waits_for_sensor()
            && !self.events_wait()
        {
            self.send_exposure_of(pixel);
        }
    }

    // Not with its counts on the stack of others.
    #[inline(never)]
    fn send_exposure_of(&mut self, pixel: PixelAddress) {
        let Some(detector) = self.pixels.get(usize::from(pixel.0)) else {
            return;
        };
        let head = HistogramHead {
            pixel,
            is_whole: false,
            cycle: LaserCycle(self.cycle),
            exposure: detector.detector.exposure().into(),
        };
        let counts = detector.detector.histogram().counts().map(u32::from);
        self.send_histogram(head, &counts);
    }

    /// Answers a request with the histogram that the sensor gives, if events leave room. If
    /// not, the next one will do.
    pub(super) fn send_whole(&mut self, pixel: PixelAddress, counts: &[u32; BINS]) {
        if self.wanted == Some(pixel) && self.waits_for_sensor() && !self.events_wait() {
            let head = HistogramHead {
                pixel,
                is_whole: true,
                cycle: LaserCycle(self.cycle),
                exposure: self.frame,
            };
            self.send_histogram(head, counts);
        }
    }

    /// Whether something goes before a histogram.
    fn events_wait(&self) -> bool {
        self.answer.is_some() || !self.words.is_empty() || self.waiting()
    }

    /// Room for one message is left to events.
    #[inline(never)]
    fn send_histogram(&mut self, head: HistogramHead, counts: &[u32; BINS]) {
        let messages = head.messages(counts);
        if self.endpoint.room() <= messages.len() {
            return;
        }
        for message in messages {
            // There is room: asked above.
            if let Ok(body) = self.endpoint.offer_empty(message::HISTOGRAM) {
                message.write(body);
            }
        }
        self.wanted = None;
    }

    /// The sensor has failed: whoever waits for a histogram of it hears that.
    pub(super) fn no_whole_histogram(&mut self) {
        if self.waits_for_sensor()
            && self.answer.is_none()
            && let Some(pixel) = self.wanted.take()
        {
            self.answer_none(pixel, NoHistogram::Sensor);
        }
    }
}
