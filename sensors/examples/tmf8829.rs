//! From a TMF8829 to millimetres: `cargo run --package dtof-sensors --example tmf8829`.
//!
//! A simulated chip answers here. On a board, bus and pins are those of its HAL.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[path = "chip/tmf8829.rs"]
mod chip;
#[path = "chip/pin.rs"]
mod pin;
#[macro_use]
mod platform;

use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_core::{
    PixelAddress, PixelConfig, RangeGate, RangeScale, Statistics, WholeHistogram, checked,
};
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf8829::{Config, Settings, Tmf8829, Zones};
use dtof_sensors::{PhotonSink, Sensor, Target};

// Checked when compiled: the zones are pixels 0 to 63, each decided by the paper's rule in the bins
// that this preset measures.
const SENSOR: Config = checked!(Config::new(Settings::new(
    PixelAddress::new(0),
    Zones::Z8x8
)));
const MEASURED: RangeGate<128> = checked!(RangeGate::new(0, 53));
const ZONE: PixelConfig<128> = checked!(PixelConfig::paper().gate(MEASURED).build());

/// The vendor's program for the sensor, which the driver loads after power-up. The
/// simulated chip runs it already.
const PROGRAM: &[u8] = &[];

/// Takes whole histograms, and what the sensor itself says.
struct Zone {
    range: Option<I24F8>,
    of_sensor: Option<I24F8>,
}

struct Seen {
    scale: RangeScale,
    cycles: u64,
    statistics: Statistics,
    zones: [Zone; 64],
}

impl PhotonSink for Seen {
    fn photon(&mut self, _: PixelAddress, _: u16) {}

    fn end_laser_cycles(&mut self, _: u16) {}

    fn begin_frame(&mut self, cycles: u32) {
        self.cycles = cycles.into();
    }

    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]) {
        let (mut whole, scale) = (WholeHistogram::<128>::new(), self.scale);
        let zone = &mut self.zones[usize::from(pixel.raw())];
        zone.range = None;
        whole.decide(
            &ZONE,
            counts,
            self.cycles,
            &mut self.statistics,
            |_, found| {
                zone.range = Some(scale.range(found.position()));
            },
        );
    }

    fn target(&mut self, pixel: PixelAddress, target: &Target) {
        self.zones[usize::from(pixel.raw())].of_sensor = Some(target.distance);
    }
}

fn main() {
    let bus = chip::Chip::default();
    let mut sensor = Tmf8829::<_, _, _>::new(bus, pin::Low, pin::Low, PROGRAM, SENSOR);
    let info = sensor.info();
    assert_eq!(info.bins, 54);
    let bin_width = info.bin_width.expect("the sensor has bins of its own");
    let scale = RangeScale::new(bin_width, info.offset).expect("its ranges fit");
    let none = || Zone {
        range: None,
        of_sensor: None,
    };
    let mut sink = Seen {
        scale,
        cycles: 0,
        statistics: Statistics::new(),
        zones: [(); 64].map(|()| none()),
    };
    // As a main loop that a timer wakes each millisecond, and INT as well.
    // It has bins of its own. Before a start nothing shines.
    sensor.start(U16F16::ZERO, Dither::OFF);
    for now_ms in 0..600 {
        if let Err(error) = sensor.poll(now_ms, &mut sink) {
            print_line!("{error}");
        }
    }
    for zone in sink.zones {
        let range = zone.range.expect("each zone sees a clear pulse");
        let of_sensor = zone.of_sensor.expect("so does the sensor");
        print_line!("{range} mm, the sensor says {of_sensor} mm");
        // The middle of bin 10 of 814.6 ps, less 439.4 mm.
        assert_eq!(range.round(), 843);
        assert_eq!(of_sensor, 842);
    }
}
