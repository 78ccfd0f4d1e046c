//! A driver of a TMF8829 beside its chip.

use std::fmt::Debug;

use dtof_chips::Tmf8829 as Chip;
use dtof_chips::tmf8829::varied_counts;
use dtof_core::PixelAddress;
use dtof_sensors::tmf8829::{Config, Preset, Settings, Tmf8829, Zones};
use dtof_sensors::{Polled, Sensor};

use super::super::{RecordingSink, SinkCall, started};
use super::bus::{Bus, Wired};

pub const IMAGE: [u8; 1234] = [0x5A; 1234];
pub const PRESETS: [Preset; 3] = [Preset::Standard, Preset::LongRange, Preset::HighAccuracy];

pub fn settings(zones: Zones) -> Settings {
    Settings::new(PixelAddress::new(10), zones)
}

/// Settings of the same over another bus.
pub fn over<B: Wired>(settings: Settings) -> Settings {
    Settings {
        interface: B::INTERFACE,
        ..settings
    }
}

pub struct Bench<const CHUNK: usize, B = Bus> {
    pub sensor: Tmf8829<'static, B, Bus, Bus, CHUNK>,
    pub bus: Bus,
    pub sink: RecordingSink,
    pub now_ms: u32,
}

impl<const CHUNK: usize, B: Wired<Error: Debug>> Bench<CHUNK, B> {
    pub fn new(settings: Settings) -> Self {
        let bus = Bus::new(Chip::new(&IMAGE, varied_counts()));
        Self {
            sensor: sensor(&bus, settings, &IMAGE),
            bus,
            sink: RecordingSink::default(),
            // So that the milliseconds wrap in the middle of it.
            now_ms: u32::MAX - 5,
        }
    }

    /// Another driver of the same chip.
    pub fn load_with(&mut self, settings: Settings, image: &'static [u8]) {
        self.sensor = sensor(&self.bus, settings, image);
    }

    pub fn poll(&mut self) -> Polled {
        self.now_ms = self.now_ms.wrapping_add(1);
        let before = self.sensor.counts().histograms;
        let polled = self.sensor.poll(self.now_ms, &mut self.sink).unwrap();
        // Photons have come if a histogram is whole.
        let is_whole = self.sensor.counts().histograms > before;
        assert_eq!(polled == Polled::Data, is_whole);
        polled
    }

    pub fn bring_up(&mut self) {
        for _ in 0..2000 {
            let _ = self.poll();
            if self.sensor.is_measuring() {
                return;
            }
        }
        panic!("it does not come up");
    }

    /// Polls until so many frames have come whole.
    pub fn frames(&mut self, frames: usize) -> Vec<SinkCall> {
        let until = self.bus.0.borrow().chip.sent.len() + frames;
        while self.bus.0.borrow().chip.sent.len() < until {
            self.poll();
        }
        self.sink.take()
    }

    /// Gives a frame away instead of one of the chip's.
    pub fn present(&mut self, bytes: &[u8], interrupt: u8) -> Vec<SinkCall> {
        {
            let chip = &mut self.bus.0.borrow_mut().chip;
            chip.is_halted = true;
            chip.present(bytes, interrupt);
        }
        self.sink.take();
        while !self.bus.0.borrow().chip.fifo.is_empty() {
            self.poll();
        }
        self.sink.take()
    }
}

fn sensor<const CHUNK: usize, B: Wired<Error: Debug>>(
    bus: &Bus,
    settings: Settings,
    image: &'static [u8],
) -> Tmf8829<'static, B, Bus, Bus, CHUNK> {
    let config = Config::new(settings).unwrap();
    started(Tmf8829::new(
        B::on(bus),
        bus.clone(),
        bus.clone(),
        image,
        config,
    ))
}
