//! Decodes histograms and targets from the bytes of a frame as they come. It holds one histogram.

use dtof_core::PixelAddress;
use dtof_core::fixed::types::I24F8;

use super::Counts;
use super::config::Config;
use super::frame::{END, Header, Kind};
use super::zones::{FEW_BINS, REFERENCES};
use crate::{PhotonSink, Target};

/// The most bytes of a zone in a frame of results: four targets.
const RECORD: usize = 24;

/// A frame after its header.
#[derive(Debug)]
pub(super) struct Stream {
    header: Header,
    /// Bytes of it so far.
    at: u16,
    /// The present histogram or zone, and its bytes so far.
    index: u16,
    taken: u16,
    /// The present count.
    word: [u8; 3],
    counts: [u32; 128],
    record: [u8; RECORD],
    pub(super) end: [u8; END as usize],
}

impl Stream {
    pub(super) const fn new() -> Self {
        Self {
            header: Header {
                kind: Kind::Histograms { slot: 0 },
                number: 0,
                data: 0,
            },
            at: 0,
            index: 0,
            taken: 0,
            word: [0; 3],
            counts: [0; 128],
            record: [0; RECORD],
            end: [0; END as usize],
        }
    }

    /// A frame begins.
    pub(super) const fn begin(&mut self, header: Header) {
        self.header = header;
        (self.at, self.index, self.taken) = (0, 0, 0);
        self.counts = [0; 128];
    }

    /// Bytes that are still to come.
    pub(super) const fn left(&self) -> u16 {
        (self.header.data + END).saturating_sub(self.at)
    }

    /// Takes the next bytes.
    pub(super) fn take(
        &mut self,
        bytes: &[u8],
        config: &Config,
        counts: &mut Counts,
        sink: &mut impl PhotonSink,
    ) {
        for &byte in bytes {
            match self.at.checked_sub(self.header.data) {
                None => match self.header.kind {
                    Kind::Histograms { slot } => self.count(byte, slot, config, counts, sink),
                    Kind::Results { is_second } => self.note(byte, is_second, config, sink),
                },
                Some(at) => {
                    if let Some(place) = self.end.get_mut(usize::from(at)) {
                        *place = byte;
                    }
                }
            }
            self.at = self.at.saturating_add(1);
        }
    }

    /// A byte of a histogram.
    fn count(
        &mut self,
        byte: u8,
        slot: u8,
        config: &Config,
        counts: &mut Counts,
        sink: &mut impl PhotonSink,
    ) {
        let [_, low, middle] = self.word;
        self.word = [low, middle, byte];
        self.taken += 1;
        if !self.taken.is_multiple_of(3) {
            return;
        }
        let settings = config.settings();
        let zones = settings.zones;
        let zone = self.index.checked_sub(REFERENCES);
        let (bins, merge) = match zone {
            None => (FEW_BINS, 0),
            Some(_) => (zones.bins(), settings.preset.merge(zones)),
        };
        let count = u32::from_le_bytes([low, middle, byte, 0]);
        let bin = self.taken / 3 - 1;
        match self.counts.get_mut(usize::from(bin >> merge)) {
            // Two of 24 bits at most.
            Some(place) => *place = place.saturating_add(count),
            None => counts.beyond = counts.beyond.saturating_add(u64::from(count)),
        }
        if bin + 1 < bins {
            return;
        }
        let (first, zone) = match zone {
            Some(zone) => (settings.first_pixel, zones.of_histogram(slot, zone)),
            None => match settings.reference {
                Some(first) => (first, self.index),
                None => (PixelAddress::new(0), u16::MAX),
            },
        };
        if let Some(pixel) = first.raw().checked_add(zone).filter(|_| zone < u16::MAX) {
            sink.histogram(PixelAddress::new(pixel), &self.counts);
            counts.histograms = counts.histograms.saturating_add(1);
        }
        self.counts = [0; 128];
        self.index += 1;
        self.taken = 0;
    }

    /// A byte of the results of a zone.
    fn note(&mut self, byte: u8, is_second: bool, config: &Config, sink: &mut impl PhotonSink) {
        if let Some(place) = self.record.get_mut(usize::from(self.taken)) {
            *place = byte;
        }
        self.taken += 1;
        let settings = config.settings();
        let results = settings.results;
        if self.taken < results.bytes() {
            return;
        }
        let mut bytes = self.record.iter().copied();
        let mut word = || {
            let [low, high] = [(); 2].map(|()| bytes.next().unwrap_or(0));
            u16::from_le_bytes([low, high])
        };
        let noise = results.noise.then(&mut word).map(unpack);
        let crosstalk = results.crosstalk.then(&mut word).map(unpack);
        let zone = settings.zones.of_result(is_second, self.index);
        let first = settings.first_pixel.raw();
        // The last zone fits.
        let pixel = PixelAddress::new(first.saturating_add(zone));
        for number in 0..results.peaks {
            let [low, high, confidence] = [(); 3].map(|()| bytes.next().unwrap_or(0));
            let mut word = || [(); 2].map(|()| bytes.next().unwrap_or(0));
            let signal = results.signal.then(&mut word).map(u16::from_le_bytes);
            if [low, high, confidence] == [0; 3] {
                continue;
            }
            let quarters = u16::from_le_bytes([low, high]);
            let target = Target {
                number,
                distance: I24F8::from_bits(i32::from(quarters) << 6),
                confidence,
                signal: signal.map(unpack),
                noise,
                crosstalk,
            };
            sink.target(pixel, &target);
        }
        self.index += 1;
        self.taken = 0;
    }
}

/// A strength: the highest bit multiplies the others by 256.
fn unpack(packed: u16) -> u32 {
    match packed & 0x7fff {
        value if value < packed => u32::from(value) << 8,
        value => value.into(),
    }
}
