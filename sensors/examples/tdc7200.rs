//! From a TDC7200 to millimetres: `cargo run --package dtof-sensors --example tdc7200`.
//!
//! A simulated chip answers here. On a board, bus and pins are those of its HAL.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[path = "chip/tdc7200.rs"]
mod chip;
#[path = "chip/pin.rs"]
mod pin;
#[macro_use]
mod platform;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    AsyncPixel, LaserCycle, PixelAddress, PixelConfig, RangeScale, Statistics, checked,
};
use dtof_sensors::dither::Dither;
use dtof_sensors::tdc7200::{Config, Settings, Tdc7200};
use dtof_sensors::{PhotonSink, Sensor};

// Checked when compiled: a clock of 8 MHz, bins of 250 ps from 240 ns on, one stop.
const BIN_WIDTH: U16F16 = U16F16::lit("250");
const SENSOR: Config = checked!(Config::new(Settings {
    first_bin_ps: 240_000,
    ..Settings::new(PixelAddress::new(0), 8_000, BIN_WIDTH)
}));
// One stop a laser cycle: the first photon only.
const PIXEL: PixelConfig<128> = checked!(PixelConfig::paper().dead_time(u16::MAX).build());

/// Takes the photons of one macropixel.
struct Macropixel {
    pixel: AsyncPixel<128>,
    statistics: Statistics,
    cycle: u64,
    scale: RangeScale,
    /// Millimetres of the last event.
    range: Option<I24F8>,
}

impl PhotonSink for Macropixel {
    fn photon(&mut self, _: PixelAddress, code: u16) {
        self.pixel.count(&PIXEL, code);
    }

    fn end_laser_cycles(&mut self, cycles: u16) {
        self.cycle += u64::from(cycles);
        let last = LaserCycle::new(self.cycle - 1);
        let statistics = &mut self.statistics;
        (self.pixel).end_laser_cycles(&PIXEL, statistics, last, cycles);
        if let Some(event) = self.pixel.take_event() {
            self.range = Some(self.scale.range(event.position()));
        }
    }

    fn begin_frame(&mut self, _: u32) {}

    fn histogram(&mut self, _: PixelAddress, _: &[u32; 128]) {}
}

fn main() {
    let bus = chip::Chip::default();
    let mut sensor = Tdc7200::<_, _, _>::new(bus, pin::Low, pin::Low, SENSOR);
    let scale = RangeScale::new(BIN_WIDTH, sensor.info().offset);
    let mut sink = Macropixel {
        pixel: AsyncPixel::new(PixelAddress::new(0)),
        statistics: Statistics::new(),
        cycle: 0,
        scale: scale.expect("128 bins of 250 ps fit"),
        range: None,
    };
    // As a main loop that a timer wakes each millisecond, and INTB as well.
    sensor.start(BIN_WIDTH, Dither::OFF);
    for now_ms in 0..100 {
        if let Err(error) = sensor.poll(now_ms, &mut sink) {
            print_line!("{error}");
        }
        if let Some(range) = sink.range.take() {
            print_line!("{range} mm");
            // 247.061 ns lie in bin 28, whose middle is at 247.125 ns.
            assert_eq!(range.round(), 37_043);
        }
    }
    assert_eq!(sink.statistics.events, 2);
}
