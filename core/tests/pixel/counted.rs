//! What an exposure has counted, as plain numbers: both models of a pixel have one.

use std::ops::RangeInclusive;

use dtof_core::{Look, Statistics};

pub struct Counted {
    gate: RangeInclusive<usize>,
    pub counts: Vec<u32>,
    /// N.
    pub exposure: u32,
    since_look: u32,
    /// Photons of the exposure with the code of a bin.
    pub in_bins: u32,
    /// A decision was put off, since the exposure began or its last echo was reported.
    pub put_off: bool,
    pub statistics: Statistics,
}

impl Counted {
    pub fn new(bins: usize, gate: RangeInclusive<usize>) -> Self {
        Self {
            gate,
            counts: vec![0; bins],
            exposure: 0,
            since_look: 0,
            in_bins: 0,
            put_off: false,
            statistics: Statistics::default(),
        }
    }

    pub fn count(&mut self, code: usize) {
        self.in_bins += u32::from(code < self.counts.len());
        if code >= self.counts.len() {
            self.statistics.rejected += 1;
        } else if !self.gate.contains(&code) {
            self.statistics.gated_out += 1;
        } else if self.counts[code] == 1023 {
            self.statistics.saturated += 1;
        } else {
            self.counts[code] += 1;
            self.statistics.counted += 1;
        }
    }

    /// Ends so many laser cycles. `None` if it is time to look, and N exceeds L1.
    pub fn end(&mut self, cycles: u32, x: u16, l1: u16) -> Option<Look> {
        self.exposure += cycles;
        self.since_look += cycles;
        if self.since_look < u32::from(x) {
            return Some(Look::NotDue);
        }
        self.since_look = 0;
        (self.exposure <= u32::from(l1)).then_some(Look::TooEarly)
    }

    /// A new exposure.
    pub fn begin(&mut self) {
        self.counts.fill(0);
        self.exposure = 0;
        self.in_bins = 0;
        self.put_off = false;
    }
}
