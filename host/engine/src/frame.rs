//! A frame-based sensor to compare with: the same photons and histograms, but every pixel reads its
//! highest bin at the same time, if it is above the background. Bins are not weighed by a dead time, and
//! pile-up is not flagged.

use anyhow::{Result, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::rule::{DecisionInput, ExcludedBins, detect};
use dtof_core::{
    Count, Count16, DepthEstimator, DepthEvent, Histogram, LaserCycle, PaperRule, PixelAddress,
    RangeGate, Statistics,
};

use super::alone::sort;
use super::decisions::{Decision, LastDecision};

use crate::Engine;
use crate::settings::Settings;
use dtof_data::options::Refused;
use dtof_data::photons::source::{Photon, Slice};

/// Accepts any peak above the background.
pub const ANY: PaperRule = PaperRule::new(U8F8::ZERO, Count::saturating(1));

/// A pixel. Its counters have 16 bits, as frames may be long.
#[derive(Clone, Debug)]
pub struct FramePixel<const BINS: usize> {
    address: PixelAddress,
    /// The first laser cycle of the frame.
    first: u64,
    /// Laser cycles of a frame.
    length: u16,
    histogram: Histogram<BINS, Count16>,
    /// Photons of the frame outside the gate.
    gated_out: u32,
    statistics: Statistics,
    /// The last decision, if it is kept.
    last: Option<Box<LastDecision>>,
}

impl<const BINS: usize> FramePixel<BINS> {
    /// The first frame begins with laser cycle `first`.
    #[must_use]
    pub fn new(address: PixelAddress, first: u64, length: u16) -> Self {
        Self {
            address,
            first,
            length,
            histogram: Histogram::new(),
            gated_out: 0,
            statistics: Statistics::default(),
            last: None,
        }
    }

    /// Counts a photon of laser cycle `cycle`, unless that is before the first frame.
    pub fn count(&mut self, gate: &RangeGate<BINS>, cycle: u64, code: u16) {
        if cycle < self.first {
            return;
        }
        if usize::from(code) < BINS && !gate.contains(code) {
            self.gated_out += 1;
        } else {
            self.histogram.add(code);
        }
    }

    /// The first laser cycle after the frame.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.first + u64::from(self.length)
    }

    /// Ends the laser cycles up to and with `cycle`, which are of one frame. Returns an event when the frame ends, if a bin is above the
    /// paper's background.
    pub fn end_laser_cycle(
        &mut self,
        gate: &RangeGate<BINS>,
        estimator: &DepthEstimator,
        cycle: u64,
    ) -> Option<DepthEvent> {
        if cycle + 1 < self.end() {
            return None;
        }
        self.first = cycle + 1;
        let found = detect(&self.histogram, gate, &ANY, estimator);
        let event =
            found.map(|found| found.event(self.address, LaserCycle::new(cycle), self.length));
        if let (Some(last), Some(event)) = (&mut self.last, event) {
            last.record_input(&DecisionInput {
                histogram: &self.histogram,
                expected: None,
                excluded: ExcludedBins::NONE,
                cycles: self.length.into(),
            });
            last.record_event(event);
        }
        self.statistics = self.statistics();
        self.histogram.clear();
        self.gated_out = 0;
        match event {
            Some(_) => self.statistics.events += 1,
            None => self.statistics.expired += 1,
        }
        event
    }

    /// The counts so far, including the current frame.
    fn statistics(&self) -> Statistics {
        let mut statistics = self.statistics;
        statistics.add_photons_of(&self.histogram, self.gated_out);
        statistics
    }
}

/// Pixels that all read out at the same time.
pub struct FrameEngine<const BINS: usize> {
    gate: RangeGate<BINS>,
    estimator: DepthEstimator,
    pixels: Vec<FramePixel<BINS>>,
}

impl<const BINS: usize> FrameEngine<BINS> {
    /// Frames of `length` laser cycles, from laser cycle 0 on.
    ///
    /// # Errors
    /// Fails if the settings break a constraint.
    pub fn new(settings: &Settings, length: u16, addresses: &[PixelAddress]) -> Result<Self> {
        ensure!(
            length > 0,
            Refused::value("frame", 0, "a frame has at least one laser cycle")
        );
        let pixels = addresses.iter();
        Ok(Self {
            gate: settings.range_gate()?,
            estimator: settings.configuration.estimator,
            pixels: pixels
                .map(|&address| FramePixel::new(address, 0, length))
                .collect(),
        })
    }
}

impl<const BINS: usize> Engine for FrameEngine<BINS> {
    fn run(&mut self, slice: &Slice) -> Result<Vec<DepthEvent>> {
        let mut events = Vec::new();
        for (pixel, received) in self.pixels.iter_mut().zip(&slice.pixels) {
            let mut photons = received.photons.iter().peekable();
            let (mut now, end) = (
                slice.first_cycle,
                slice.first_cycle + u64::from(received.cycles),
            );
            // Up to the end of each frame, and of the slice.
            while now < end {
                let next = pixel.end().clamp(now + 1, end);
                let cycle = |photon: &Photon| slice.first_cycle + u64::from(photon.cycle);
                while let Some(photon) = photons.next_if(|photon| cycle(photon) < next) {
                    pixel.count(&self.gate, cycle(photon), photon.code);
                }
                events.extend(pixel.end_laser_cycle(&self.gate, &self.estimator, next - 1));
                now = next;
            }
        }
        sort(&mut events, slice.first_cycle);
        Ok(events)
    }

    fn statistics(&self) -> [Statistics; 2] {
        let mut sum = Statistics::default();
        for pixel in &self.pixels {
            sum += pixel.statistics();
        }
        [sum, Statistics::default()]
    }

    fn keep_decisions(&mut self, is_kept: &dyn Fn(PixelAddress) -> bool) {
        for pixel in &mut self.pixels {
            pixel.last = LastDecision::allocate(is_kept(pixel.address));
        }
    }

    fn decisions(&self) -> Vec<Decision> {
        let all = self.pixels.iter().filter_map(|pixel| pixel.last.as_ref());
        all.filter_map(|last| last.decision()).collect()
    }
}
