//! Frames of every mode, and constructed ones.

use std::fmt::Debug;
use std::rc::Rc;

use crate::common::SinkCall;
use crate::common::tmf8829::bench::{Bench, PRESETS, over, settings};
use crate::common::tmf8829::bus::{Bus, Wired};
use dtof_chips::tmf8829::{Scene, frame, order, shape, varied_counts};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf8829::{Preset, Results, Settings, Spi, Zones, snr};
use dtof_sensors::{Sensor, Target};
use proptest::prelude::*;

/// What a frame of histograms of this time slot brings: zones in the chip's order.
fn expected(zones: Zones, slot: u8, measurement: u32, merge: usize) -> Vec<SinkCall> {
    let mode = [0, 2, 3, 4, 5][zones as usize];
    let (columns, _, slots) = shape(mode);
    let bins = if mode == 0 { 256 } else { 64 };
    let frame = SinkCall::Frame(586 * 1024 / u32::from(slots));
    let histograms = order(mode, slot.into()).into_iter().map(|(x, y)| {
        let counts = varied_counts()(measurement, Some((x, y)), bins);
        let mut merged = vec![0; 128];
        for (bin, count) in counts.into_iter().enumerate() {
            if let Some(place) = merged.get_mut(bin >> merge) {
                *place += count;
            }
        }
        SinkCall::Histogram(u16::try_from(10 + y * columns + x).unwrap(), merged)
    });
    [frame].into_iter().chain(histograms).collect()
}

/// Every mode and preset, two measurements: all histograms as the chip has them, each zone once,
/// and the chip's own targets behind them.
fn round<const CHUNK: usize, B: Wired<Error: Debug>>(zones: Zones, preset: Preset) {
    let mut bench = Bench::<CHUNK, B>::new(Settings {
        preset,
        ..over::<B>(settings(zones))
    });
    bench.bring_up();
    let mode = [0, 2, 3, 4, 5][zones as usize];
    let (columns, rows, slots) = shape(mode);
    let halves = if slots > 2 { 2 } else { 1 };
    let merge = usize::from(mode == 0 && preset == Preset::HighAccuracy);
    for measurement in 0..2 {
        let mut pixels = Vec::new();
        let mut targets = Vec::new();
        for half in 0..halves {
            for slot in half * slots / halves..(half + 1) * slots / halves {
                let given = bench.frames(1);
                assert_eq!(given, expected(zones, slot, measurement, merge));
                pixels.extend(given.iter().filter_map(|given| match given {
                    SinkCall::Histogram(pixel, _) => Some(*pixel),
                    _ => None,
                }));
            }
            targets.extend(bench.frames(1));
        }
        pixels.sort_unstable();
        let all: Vec<u16> = (10..).take(columns * rows).collect();
        assert_eq!(pixels, all);
        let of = |target: &SinkCall| match target {
            SinkCall::Target(pixel, target) => {
                (*pixel, target.number, target.distance, target.confidence)
            }
            other => panic!("{other:?}"),
        };
        let mut targets: Vec<_> = targets.iter().map(of).collect();
        targets.sort_unstable();
        let quarters = |zone: u16| I24F8::from_num(zone + 1) / 4;
        let expected = (0..)
            .zip(&all)
            .map(|(zone, &pixel)| (pixel, 0, quarters(zone), 41));
        assert_eq!(targets, expected.collect::<Vec<_>>());
    }
    let counts = bench.sensor.counts();
    assert_eq!((counts.errors, counts.missed, counts.broken), (0, 0, 0));
    assert_eq!(
        counts.histograms,
        u32::try_from(2 * columns * rows).unwrap()
    );
    assert_eq!(counts.frames, u32::from(2 * (slots + halves)));
    // Of 256 bins that are not merged, a histogram holds half.
    assert_eq!(counts.beyond > 0, mode == 0 && merge == 0);
}

#[test]
fn every_mode_gives_each_zone_as_the_chip_has_it() {
    for zones in Zones::ALL {
        for preset in PRESETS {
            if preset == Preset::LongRange && zones != Zones::Z8x8 {
                continue;
            }
            round::<128, Bus>(zones, preset);
            round::<128, Spi<Bus>>(zones, preset);
        }
    }
    round::<4, Bus>(Zones::Z16x16, Preset::Standard);
    round::<252, Spi<Bus>>(Zones::Z48x32, Preset::HighAccuracy);
}

/// Zones written out by hand from the tables of x and y, beside the formula in the simulated chip:
/// the first three of a frame's first row, and the first of its second.
#[test]
fn zones_are_where_the_tables_have_them() {
    type Place = (u16, u16);
    let tables: [(Zones, u8, [Place; 4]); 11] = [
        (Zones::Z8x8, 0, [(0, 0), (1, 0), (2, 0), (0, 1)]),
        (Zones::Z8x8, 1, [(4, 0), (5, 0), (6, 0), (4, 1)]),
        (Zones::Z16x16, 1, [(8, 0), (9, 0), (10, 0), (8, 1)]),
        (Zones::Z32x32, 0, [(0, 0), (2, 0), (4, 0), (0, 2)]),
        (Zones::Z32x32, 1, [(16, 0), (18, 0), (20, 0), (16, 2)]),
        (Zones::Z32x32Pairs, 2, [(1, 0), (3, 0), (5, 0), (1, 2)]),
        (Zones::Z32x32, 7, [(17, 1), (19, 1), (21, 1), (17, 3)]),
        (Zones::Z48x32, 1, [(24, 0), (27, 0), (30, 0), (24, 2)]),
        (Zones::Z48x32, 4, [(2, 0), (5, 0), (8, 0), (2, 2)]),
        (Zones::Z48x32, 6, [(0, 1), (3, 1), (6, 1), (0, 3)]),
        (Zones::Z48x32, 11, [(26, 1), (29, 1), (32, 1), (26, 3)]),
    ];
    for (zones, slot, places) in tables {
        let mut bench = Bench::<252>::new(settings(zones));
        bench.bring_up();
        let mode = [0, 2, 3, 4, 5][zones as usize];
        bench.sensor.start(U16F16::ZERO, Dither::OFF);
        bench.bring_up();
        let given = bench.present(&frame(0x20 | mode, slot, 1, &[0; 25_344], 1), 8);
        let second_row = if zones == Zones::Z8x8 { 4 } else { 8 };
        for (index, (x, y)) in [0, 1, 2, second_row].into_iter().zip(places) {
            let SinkCall::Histogram(pixel, _) = &given[1 + index] else {
                panic!("{given:?}");
            };
            let columns = zones.size().0;
            assert_eq!(*pixel, 10 + columns * y + x, "{zones:?}, {slot}, {index}");
        }
    }
}

#[test]
fn references_are_four_pixels_if_they_are_wanted() {
    let mut bench = Bench::<128>::new(Settings {
        reference: Some(PixelAddress::new(1000)),
        ..settings(Zones::Z16x16)
    });
    assert_eq!(bench.sensor.info().pixels, 1004);
    bench.bring_up();
    let given = bench.frames(1);
    for reference in 0..4 {
        let mut counts = varied_counts()(0, None, reference);
        counts.resize(128, 0);
        let pixel = u16::try_from(1000 + reference).unwrap();
        assert_eq!(given[1 + reference], SinkCall::Histogram(pixel, counts));
    }
    assert_eq!(given[5..], expected(Zones::Z16x16, 0, 0, 0)[1..]);
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            sum >> 1 ^ if sum & 1 == 1 { 0xEDB8_8320 } else { 0 }
        })
    })
}

/// A constructed frame, all zeros but for these.
fn vector(frame: Vec<u8>, at: &[(usize, &[u8])], crc: u32) -> Vec<u8> {
    let mut bytes = frame;
    for &(at, data) in at {
        bytes[at..at + data.len()].copy_from_slice(data);
    }
    assert_eq!(crc32(&bytes), crc, "the vector is not what was agreed");
    bytes
}

#[test]
fn constructed_frames_are_read_as_agreed() {
    constructed_frames::<Bus>();
    constructed_frames::<Spi<Bus>>();
}

fn constructed_frames<B: Wired<Error: Debug>>() {
    let target = |number, quarters: i32, confidence| Target {
        number,
        distance: I24F8::from_num(quarters) / 4,
        confidence,
        signal: None,
        noise: None,
        crosstalk: None,
    };
    let peaks = |results: Results| Settings {
        results,
        ..over::<B>(settings(Zones::Z8x8))
    };
    let mut results = Settings::new(PixelAddress::new(0), Zones::Z8x8).results;
    results.peaks = 1;

    let zeros = [0; 192];
    let a = vector(
        frame(0x10, 0x01, 7, &zeros, 0x09),
        &[
            (21, &[0xA0, 0x0F, 0x28]),
            (24, &[0x01, 0x00, 0x29]),
            (210, &[0xFF; 3]),
        ],
        0x8251_A583,
    );
    assert_eq!(a.len(), 225);
    let mut bench = Bench::<128, B>::new(peaks(results));
    bench.bring_up();
    bench.frames(1);
    bench.sensor.start(U16F16::ZERO, Dither::OFF);
    bench.bring_up();
    let given = bench.present(&a, 1);
    let expected = [(0, 4000, 40), (1, 1, 41), (63, 65535, 255)];
    let expected =
        expected.map(|(zone, quarters, snr)| SinkCall::Target(10 + zone, target(0, quarters, snr)));
    assert_eq!(given, expected);
    assert_eq!(bench.sensor.counts().limited, 1);

    let all = Results {
        peaks: 1,
        signal: true,
        noise: true,
        crosstalk: true,
    };
    let b = vector(
        frame(0x10, 0x39, 7, &[0; 576], 0x01),
        &[(21, &[0xFF, 0x7F, 0x80, 0x80, 0xC4, 0x03, 0x40, 0xFF, 0xFF])],
        0x5782_B961,
    );
    assert_eq!(b.len(), 609);
    let mut bench = Bench::<128, B>::new(peaks(all));
    bench.bring_up();
    bench.sensor.start(U16F16::ZERO, Dither::OFF);
    bench.bring_up();
    let expected = Target {
        signal: Some(8_388_352),
        noise: Some(32_767),
        crosstalk: Some(32_768),
        ..target(0, 4 * 241, 64)
    };
    assert_eq!(bench.present(&b, 1), [SinkCall::Target(10, expected)]);
    assert_eq!(snr(64), 140);

    let data = [0; 25_344];
    let c = vector(
        frame(0x20, 0x01, 6, &data, 0x01),
        &[
            (30, &[0x27, 0x74, 0x00]),
            (789, &[0x01, 0x00, 0x00]),
            (10_806, &[0x68, 0x03, 0x00]),
            (25_362, &[0xFF; 3]),
        ],
        0x8753_5B5F,
    );
    assert_eq!(c.len(), 25_377);
    let mut bench = Bench::<128, B>::new(Settings {
        reference: Some(PixelAddress::new(100)),
        preset: Preset::HighAccuracy,
        ..over::<B>(settings(Zones::Z8x8))
    });
    bench.bring_up();
    bench.sensor.start(U16F16::ZERO, Dither::OFF);
    bench.bring_up();
    let given = bench.present(&c, 8);
    let counts = given.iter().filter_map(|given| match given {
        SinkCall::Histogram(pixel, counts) => Some((*pixel, counts)),
        _ => None,
    });
    let mut found = Vec::new();
    for (pixel, counts) in counts {
        let bins = counts.iter().enumerate().filter(|(_, count)| **count > 0);
        found.extend(bins.map(|(bin, &count)| (pixel, bin, count)));
    }
    // Two bins of the sensor are one.
    let zone = |x: u16, y: u16| 10 + 8 * y + x;
    let expected = [
        (100, 3, 29_735),
        (zone(4, 0), 0, 1),
        (zone(5, 3), 5, 872),
        (zone(7, 7), 127, 16_777_215),
    ];
    assert_eq!(found, expected);
    assert_eq!(given.len(), 1 + 4 + 32);
    assert_eq!(bench.sensor.counts().beyond, 0);
}

/// The formula in floating point.
#[test]
fn the_ratio_of_a_target_is_that_of_the_vendor() {
    assert_eq!([0, 1, 40, 41, 42].map(snr), [0, 1, 40, 42, 44]);
    for code in 40..=255u8 {
        let ratio = 40.0 * 1.053_676f64.powi(i32::from(code) - 40);
        let given = f64::from(snr(code));
        assert!(
            given <= ratio && ratio < given + 1.0 + 1e-6,
            "{code}: {given} {ratio}"
        );
    }
    assert_eq!((snr(255) + 5_000) / 10_000, 305);
}

#[test]
fn a_sensor_that_runs_is_not_loaded() {
    let mut bench = Bench::<128>::new(settings(Zones::Z8x8));
    bench.bus.0.borrow_mut().chip.run();
    bench.bring_up();
    assert!(bench.bus.0.borrow().chip.ram.is_empty());
    assert_eq!(bench.frames(1), expected(Zones::Z8x8, 0, 0, 0));
}

/// Register ENABLE: 0x08 is standby, 0x04 power; 0x20 is to start from RAM.
#[test]
fn a_sensor_in_standby_is_woken() {
    let mut bench = Bench::<128>::new(settings(Zones::Z8x8));
    bench.bus.0.borrow_mut().chip.run();
    bench.bus.0.borrow_mut().chip.stand_by();
    bench.bring_up();
    let enable = bench.bus.0.borrow().chip.enable();
    assert_eq!(enable & 0x2C, 0x24, "{enable:#04x}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// Whatever the counts are, they come out as they went in.
    #[test]
    fn counts_come_out_as_they_went_in(seed: u32, most in 1u32..1 << 24) {
        let scene: Scene = Rc::new(move |_, zone, bins| {
            let (zone, bins) = zone.map_or((9999, 64), |(x, y)| (100 * y + x, bins));
            let zone = u32::try_from(zone).unwrap();
            let mix = |bin: u32| (seed ^ zone << 8 ^ bin).wrapping_mul(2_654_435_761) >> 3;
            (0..u32::try_from(bins).unwrap()).map(|bin| mix(bin) % most).collect()
        });
        let mut bench = Bench::<64>::new(settings(Zones::Z16x16));
        bench.bus.0.borrow_mut().chip.scene = Rc::clone(&scene);
        bench.bring_up();
        for slot in 0..2 {
            let given = bench.frames(1);
            let zones = order(2, slot).into_iter().zip(&given[1..]);
            for (zone, given) in zones {
                let mut counts = scene(0, Some(zone), 64);
                counts.resize(128, 0);
                let pixel = u16::try_from(10 + 16 * zone.1 + zone.0).unwrap();
                prop_assert_eq!(given, &SinkCall::Histogram(pixel, counts));
            }
        }
    }
}
