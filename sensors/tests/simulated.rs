//! The simulated sensor: exact probabilities, the rates and shapes it was given,
//! and the same photons for the same seed however often it is asked.

use std::num::NonZeroU16;

use crate::common::{RecordingSink, SinkCall, started};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::{Pulse, RateError, Settings, Simulated, SimulatedPixel};
use dtof_sensors::{Polled, Sensor, SensorInfo};

const SHARES: [U0F32; 2] = [U0F32::lit("0.25"), U0F32::lit("0.5")];
const PULSE: Pulse = Pulse::new(&SHARES);

fn settings(seed: u64) -> Settings {
    Settings {
        seed,
        bins: 128,
        cycles_per_second: 100_000,
        cycles_per_poll: NonZeroU16::MAX,
    }
}

fn pixel(address: u16, position: u16, signal: f64, background: f64) -> SimulatedPixel {
    let [signal, background] = [signal, background].map(U8F24::from_num);
    SimulatedPixel::new(PixelAddress::new(address), position, signal, background).unwrap()
}

/// Polls until `cycles` laser cycles have ended; what was given.
fn run(sensor: &mut Simulated, cycles: u32) -> Vec<SinkCall> {
    let mut sink = RecordingSink::default();
    assert_eq!(sensor.poll(0, &mut sink), Ok(Polled::Idle));
    for now_ms in 1..=cycles / 100 {
        assert_eq!(sensor.poll(now_ms, &mut sink), Ok(Polled::Data));
    }
    let given = sink.take();
    assert_eq!(ended(&given), cycles);
    given
}

fn ended(given: &[SinkCall]) -> u32 {
    let cycles = given.iter().map(|given| match given {
        SinkCall::End(0) => panic!("no laser cycle has ended"),
        SinkCall::End(cycles) => u32::from(*cycles),
        _ => 0,
    });
    cycles.sum()
}

/// Pixel and code of each photon, with its laser cycle.
fn photons(given: &[SinkCall]) -> Vec<(u32, u16, u16)> {
    let mut cycle = 0;
    let mut photons = Vec::new();
    for given in given {
        match given {
            SinkCall::Photon(pixel, code) => photons.push((cycle, *pixel, *code)),
            SinkCall::End(cycles) => cycle += u32::from(*cycles),
            SinkCall::Frame(_) | SinkCall::Histogram(..) | SinkCall::Target(..) => {
                panic!("a histogram")
            }
        }
    }
    photons
}

#[test]
fn says_how_fast_its_laser_is_and_how_many_pixels_it_has() {
    let pixels = [pixel(0, 60, 0.1, 0.1), pixel(6, 60, 0.1, 0.1)];
    let info = Simulated::new(&pixels, PULSE, settings(1)).info();
    assert_eq!((info.laser_millihertz, info.pixels), (100_000_000, 7));
}

#[test]
fn bins_are_as_wide_as_those_of_a_sensor_within_a_sixteenth() {
    let own = U16F16::lit("256");
    let sensor = SensorInfo {
        bin_width: Some(own),
        ..SensorInfo::new(1)
    };
    let least = own - own / 16;
    let most = own + own / 16;
    for (width, is_near) in [
        (least - U16F16::DELTA, false),
        (least, true),
        (own, true),
        (most, true),
        (most + U16F16::DELTA, false),
    ] {
        assert_eq!(sensor.has_bins_of(width), is_near, "{width}");
        assert!(SensorInfo::new(1).has_bins_of(width));
    }
}

#[test]
fn photons_come_at_their_rates_in_their_bins() {
    const CYCLES: u32 = 100_000;
    let pixels = [pixel(3, 60, 0.5, 0.0), pixel(4, 9, 0.2, 1.28)];
    let mut sensor = started(Simulated::new(&pixels, PULSE, settings(5)));
    let photons = photons(&run(&mut sensor, CYCLES));
    let count = |pixel: u16, code: u16| {
        let of_bin = |photon: &&(u32, u16, u16)| (photon.1, photon.2) == (pixel, code);
        photons.iter().filter(of_bin).count() as f64
    };
    // Each bin is a Poisson count of its own: five standard deviations.
    let check = |pixel: u16, code: u16, rate: f64| {
        let expected = rate * f64::from(CYCLES);
        let difference = (count(pixel, code) - expected).abs();
        assert!(difference <= 5.0 * expected.sqrt(), "{pixel}, {code}");
    };
    for code in 0..128u16 {
        let signal = |position: u16, rate: f64| match code.checked_sub(position) {
            Some(0 | 2) => 0.25 * rate,
            Some(1) => 0.5 * rate,
            _ => 0.0,
        };
        check(3, code, signal(60, 0.5));
        check(4, code, 0.01 + signal(9, 0.2));
    }
    assert!(photons.iter().all(|photon| photon.2 < 128));
    assert!(photons.is_sorted_by_key(|photon| photon.0));
}

#[test]
fn a_pulse_past_the_last_bin_is_passed_on() {
    let pixels = [pixel(0, 127, 1.0, 0.0), pixel(1, u16::MAX, 1.0, 0.0)];
    let mut sensor = started(Simulated::new(&pixels, PULSE, settings(5)));
    let photons = photons(&run(&mut sensor, 1000));
    let codes = |pixel| {
        let mut codes: Vec<u16> = photons
            .iter()
            .filter(|photon| photon.1 == pixel)
            .map(|photon| photon.2)
            .collect();
        codes.sort_unstable();
        codes.dedup();
        codes
    };
    assert_eq!((codes(0), codes(1)), (vec![127, 128, 129], vec![u16::MAX]));
}

#[test]
fn the_same_seed_gives_the_same_photons_however_often_it_is_asked() {
    let pixels = [pixel(0, 20, 0.3, 0.4), pixel(1, 90, 0.01, 0.02)];
    let stream = |seed, step: usize| {
        let mut sensor = started(Simulated::new(&pixels, PULSE, settings(seed)));
        let mut sink = RecordingSink::default();
        for now_ms in (0..=600).step_by(step) {
            sensor.poll(now_ms, &mut sink).unwrap();
        }
        let given = sink.take();
        assert_eq!(ended(&given), 60_000);
        photons(&given)
    };
    let once = stream(1, 600);
    assert_eq!(once, stream(1, 1));
    assert_eq!(once, stream(1, 24));
    assert_ne!(once, stream(2, 600));
    // Golden: what a host that runs the same code sees too.
    assert_eq!(once[..4], GOLDEN);
}

const GOLDEN: [(u32, u16, u16); 4] = [(0, 0, 9), (1, 0, 21), (1, 0, 22), (2, 0, 115)];

#[test]
fn the_time_says_how_many_laser_cycles_are_due() {
    let dark = [pixel(0, 0, 0.0, 0.0)];
    let mut sensor = started(Simulated::new(
        &dark,
        PULSE,
        Settings {
            cycles_per_second: 1500,
            cycles_per_poll: NonZeroU16::new(10).unwrap(),
            ..settings(0)
        },
    ));
    let mut sink = RecordingSink::default();
    let start = u32::MAX - 2;
    let mut poll = |after: u32| {
        let polled = sensor.poll(start.wrapping_add(after), &mut sink).unwrap();
        let given = sink.take();
        let expected = [Polled::Data, Polled::Idle][usize::from(given.is_empty())];
        assert_eq!(polled, expected);
        // Empty laser cycles come in one call.
        assert!(given.len() <= 1);
        (ended(&given), sensor.skipped())
    };
    assert_eq!(poll(0), (0, 0));
    // 1.5 laser cycles a millisecond; halves are not lost.
    assert_eq!(poll(1), (1, 0));
    assert_eq!(poll(2), (2, 0));
    assert_eq!(poll(2), (0, 0));
    assert_eq!(poll(8), (9, 0));
    // 15 are due, 10 are made up for.
    assert_eq!(poll(18), (10, 5));
    assert_eq!(poll(19), (1, 5));
    // What a start finds due is from before it.
    sensor.start(U16F16::ONE, Dither::OFF);
    assert_eq!(sensor.poll(7, &mut sink), Ok(Polled::Idle));
    assert_eq!(sensor.poll(8, &mut sink), Ok(Polled::Data));
    assert_eq!(ended(&sink.take()), 1);
}

#[test]
fn too_many_photons_are_refused() {
    let two = U8F24::lit("2");
    let more = two + U8F24::DELTA;
    let new = |signal, background| SimulatedPixel::new(PixelAddress::new(0), 0, signal, background);
    assert!(new(two, two).is_ok());
    assert!(matches!(new(two, more), Err(RateError { .. })));
    assert!(new(U8F24::MAX, U8F24::MAX).is_err());
}

#[test]
fn laser_cycles_that_are_asked_for_are_those_of_the_clock() {
    let pixels = [pixel(3, 60, 0.5, 0.0), pixel(4, 9, 0.2, 1.28)];
    let mut sensor = started(Simulated::new(&pixels, PULSE, settings(5)));
    let by_clock = photons(&run(&mut sensor, 1_000));
    let mut sensor = started(Simulated::new(&pixels, PULSE, settings(5)).without_clock());
    let mut sink = RecordingSink::default();
    assert_eq!(sensor.laser_cycles(0, &mut sink), Polled::Idle);
    for cycles in [1, 99, 900] {
        assert_eq!(sensor.laser_cycles(cycles, &mut sink), Polled::Data);
        for now_ms in [0, 1_000, 2_000] {
            assert_eq!(sensor.poll(now_ms, &mut sink), Ok(Polled::Idle));
        }
    }
    let given = sink.take();
    assert_eq!(ended(&given), 1_000);
    assert_eq!(photons(&given), by_clock);
    assert_eq!(sensor.skipped(), 0);
    // Nor does it keep photons of a laser cycle back.
    assert_eq!(sensor.info().dead_time, 0);
}

/// Photons come only between a start and a stop.
#[test]
fn it_gives_photons_only_while_it_is_on() {
    let pixels = [pixel(0, 5, 1.0, 0.0)];
    let mut sensor = Simulated::new(&pixels, PULSE, settings(1));
    let given = |sensor: &mut Simulated<'_>, from_ms| {
        let mut sink = RecordingSink::default();
        for now_ms in from_ms..from_ms + 50 {
            let _ = sensor.poll(now_ms, &mut sink).unwrap();
        }
        !sink.0.is_empty()
    };
    assert!(!given(&mut sensor, 0));
    for round in 1..3 {
        sensor.start(U16F16::ZERO, Dither::OFF);
        assert!(given(&mut sensor, 200 * round));
        sensor.stop();
        assert!(!given(&mut sensor, 200 * round + 100));
        assert!(!sensor.is_stopping());
    }
}
