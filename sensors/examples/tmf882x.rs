//! From a TMF8820/21/28 to millimetres: `cargo run --package dtof-sensors --example tmf882x`.
//!
//! A simulated chip answers here. On a board, bus and pins are those of its HAL.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[path = "chip/tmf882x.rs"]
mod chip;
#[path = "chip/pin.rs"]
mod pin;
#[macro_use]
mod platform;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{PixelAddress, PixelConfig, RangeScale, Statistics, WholeHistogram, checked};
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf882x::{Config, Settings, Tmf882x};
use dtof_sensors::{PhotonSink, Sensor};

// Checked when compiled: the zones are pixels 0 to 8, each decided by the paper's rule.
const SENSOR: Config = checked!(Config::new(Settings::new(PixelAddress::new(0))));
const ZONE: PixelConfig<128> = checked!(PixelConfig::paper().build());

/// The vendor's program for the sensor, which the driver loads after power-up. The
/// simulated chip runs it already.
const PROGRAM: &[u8] = &[];

/// Takes whole histograms.
struct Zones {
    scale: RangeScale,
    cycles: u64,
    statistics: Statistics,
    /// Millimetres of each zone.
    ranges: [Option<I24F8>; 9],
}

impl PhotonSink for Zones {
    fn photon(&mut self, _: PixelAddress, _: u16) {}

    fn end_laser_cycles(&mut self, _: u16) {}

    fn begin_frame(&mut self, cycles: u32) {
        self.cycles = cycles.into();
    }

    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]) {
        let (mut whole, scale) = (WholeHistogram::<128>::new(), self.scale);
        let range = &mut self.ranges[usize::from(pixel.raw())];
        *range = None;
        whole.decide(
            &ZONE,
            counts,
            self.cycles,
            &mut self.statistics,
            |_, found| {
                *range = Some(scale.range(found.position()));
            },
        );
    }
}

fn main() {
    let bus = chip::Chip::default();
    let mut sensor = Tmf882x::<_, _, _>::new(bus, pin::Low, pin::Low, PROGRAM, SENSOR);
    let info = sensor.info();
    let bin_width = info.bin_width.expect("the sensor has bins of its own");
    let scale = RangeScale::new(bin_width, info.offset).expect("its ranges fit");
    let mut sink = Zones {
        scale,
        cycles: 0,
        statistics: Statistics::new(),
        ranges: [None; 9],
    };
    // A main loop would poll each millisecond and after each edge of INT.
    // It has bins of its own. Before a start nothing shines.
    sensor.start(U16F16::ZERO, Dither::OFF);
    for now_ms in 0..100 {
        if let Err(error) = sensor.poll(now_ms, &mut sink) {
            print_line!("{error}");
        }
    }
    for range in sink.ranges {
        let range = range.expect("each zone sees a clear pulse");
        print_line!("{range} mm");
        // The middle of bin 40 of 92.1 ps, less 179.5 mm.
        assert_eq!(range.round(), 380);
    }
}
