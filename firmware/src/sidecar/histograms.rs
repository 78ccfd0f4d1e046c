//! Histograms on request of the host. Events have priority: a histogram is sent only while no event
//! waits, and if there is room left for the next events. Only one request waits at a time.

use dtof_core::{LaserCycle, PixelAddress};
use dtof_link::{HistogramHead, NoHistogram, Source, message};

use super::{BINS, Sidecar};

impl Sidecar<'_> {
    /// Accepts a request, or answers at once why there is no histogram.
    #[inline(never)]
    pub(super) fn accept_request(&mut self, body: &[u8]) {
        let Ok(pixel) = body.try_into().map(u16::from_le_bytes) else {
            self.unknown = self.unknown.saturating_add(1);
            return;
        };
        let of_sensor = self.sensor.filter(|_| self.uses_sensor_histograms());
        let pixels = of_sensor.map_or(u16::MAX, |sensor| sensor.pixels);
        let pixel = PixelAddress::new(pixel);
        let reason = if self.array.config().is_none() {
            NoHistogram::NoConfiguration
        } else if self.array.pixel(pixel.raw().into()).is_none() || pixel.raw() >= pixels {
            NoHistogram::NoPixel
        } else {
            self.requested_histogram = Some(pixel);
            return;
        };
        self.answer_none(pixel, reason);
    }

    /// Answers that there is no histogram.
    #[inline(never)]
    fn answer_none(&mut self, pixel: PixelAddress, reason: NoHistogram) {
        self.answer = Some((message::HISTOGRAM, reason.message(pixel)));
    }

    /// Whether histograms come from the sensor, complete. Then pixels count no photons.
    fn uses_sensor_histograms(&self) -> bool {
        self.source == Source::Sensor && self.sensor.is_some_and(|sensor| sensor.gives_histograms)
    }

    /// Another message replaces a waiting request. Returns whether there was one.
    pub(super) fn give_up(&mut self) -> bool {
        let Some(pixel) = self.requested_histogram.take() else {
            return false;
        };
        self.answer_none(pixel, NoHistogram::GivenUp);
        true
    }

    /// Answers a request with the counts of the pixel's present exposure, if events leave room.
    pub(super) fn send_current_histogram(&mut self) {
        if let Some(pixel) = self.requested_histogram
            && !self.uses_sensor_histograms()
            && !self.events_wait()
        {
            self.send_current_histogram_of(pixel);
        }
    }

    // Not inlined, to keep its counts off the stack of callers.
    #[inline(never)]
    fn send_current_histogram_of(&mut self, pixel: PixelAddress) {
        let number = pixel.raw().into();
        let (Some(detector), Some(exposure)) =
            (self.array.pixel(number), self.array.exposure(number))
        else {
            // It was left out meanwhile.
            self.requested_histogram = None;
            return self.answer_none(pixel, NoHistogram::NoPixel);
        };
        let head = HistogramHead {
            pixel,
            is_whole: false,
            cycle: LaserCycle::new(self.array.cycles()),
            exposure: exposure.into(),
        };
        let counts = detector.histogram().counts().map(Into::into);
        self.send_histogram(head, &counts);
    }

    /// Answers a request with the histogram that the sensor gives, if events leave room. If
    /// not, the next one will do.
    pub(super) fn send_sensor_histogram(&mut self, pixel: PixelAddress, counts: &[u32; BINS]) {
        if self.requested_histogram == Some(pixel)
            && self.uses_sensor_histograms()
            && !self.events_wait()
        {
            let head = HistogramHead {
                pixel,
                is_whole: true,
                cycle: LaserCycle::new(self.array.cycles()),
                exposure: self.array.frame_cycles(),
            };
            self.send_histogram(head, counts);
        }
    }

    /// Whether something goes before a histogram.
    fn events_wait(&self) -> bool {
        self.answer.is_some() || !self.words.is_empty() || self.array.has_event()
    }

    /// Room for one message is left to events.
    #[inline(never)]
    fn send_histogram(&mut self, head: HistogramHead, counts: &[u32; BINS]) {
        let messages = head.messages(counts);
        if self.endpoint.room() <= messages.len() {
            return;
        }
        for message in messages {
            // There is room: checked above.
            if let Ok(body) = self.endpoint.offer_empty(message::HISTOGRAM) {
                message.write(body);
            }
        }
        self.requested_histogram = None;
    }

    /// Answers a waiting request with the failure of the sensor.
    pub(super) fn answer_sensor_failure(&mut self) {
        if self.uses_sensor_histograms()
            && self.answer.is_none()
            && let Some(pixel) = self.requested_histogram.take()
        {
            self.answer_none(pixel, NoHistogram::Sensor);
        }
    }
}
