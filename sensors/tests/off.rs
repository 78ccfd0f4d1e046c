//! A sensor is on only if its driver was started and goes on with its measurement: not before a start, not after
//! a stop, an error or a drop of the driver. For the TMF8829 on both buses, the TMF8820 and the TDC7200.

use std::cell::Cell;
use std::num::NonZeroU16;

use crate::common::rig::{Bench, Lit, OfI2c, OfNine, OfSpi, OfTdc, Part};
use crate::common::tmf8829::bus::Fault;
use crate::common::{Broken, RecordingSink, SinkCall};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{U0F32, U8F24, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::simulated::{Pulse, Settings, Simulated, SimulatedPixel};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::digital::OutputPin;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// So many polls bring each sensor up and give two frames.
const POLLS: u32 = 260;

/// The test of each driver.
macro_rules! each {
    ($of:ident) => {
        $of::<OfI2c>();
        $of::<OfSpi>();
        $of::<OfNine>();
        $of::<OfTdc>();
    };
}

#[test]
fn these_polls_cover_two_frames() {
    fn of<P: Part>() {
        for is_wired in [true, P::NEEDS_ENABLE] {
            let bench = Bench::<P>::after(POLLS, is_wired);
            assert!(bench.rig.shines() && bench.sensor.goes_on());
            let is_frame =
                |given: &&SinkCall| matches!(given, SinkCall::Frame(_) | SinkCall::End(_));
            assert!(bench.sink.0.iter().filter(is_frame).count() >= 2);
        }
    }
    each!(of);
}

/// Also if an earlier firmware has left it on.
#[test]
fn before_a_start_it_is_dark_and_nothing_is_transferred() {
    fn of<P: Part>() {
        for was_on in [false, true] {
            let mut bench = Bench::<P>::new(true);
            if was_on {
                bench.rig.0.borrow_mut().chip.leave_on();
            }
            assert_eq!(bench.rig.shines(), was_on);
            assert!(bench.sensor.is_stopping());
            for _ in 0..100 {
                assert_eq!(bench.poll(), Ok(Polled::Idle));
                assert!(bench.rig.is_off() && !bench.sensor.is_stopping());
            }
            assert_eq!(bench.rig.0.borrow().driven, [false]);
            assert_eq!((bench.transfers(), bench.sink.take().len()), (0, 0));
        }
    }
    each!(of);
}

#[test]
fn a_driver_that_is_dropped_or_released_leaves_it_dark() {
    fn of<P: Part>() {
        for polls in 0..POLLS {
            let Bench { sensor, rig, .. } = Bench::<P>::after(polls, true);
            drop(sensor);
            assert!(rig.is_off(), "{polls}");

            let Bench { sensor, rig, .. } = Bench::<P>::after(polls, true);
            let (_, failed) = sensor.give_back();
            assert!(rig.is_off() && failed.is_none(), "{polls}");

            // The caller has the pin, and can try again.
            let Bench { sensor, rig, .. } = Bench::<P>::after(polls, true);
            rig.break_enable(true);
            let (mut enable, failed) = sensor.give_back();
            assert_eq!(failed, Some(Broken));
            rig.break_enable(false);
            enable.set_low().unwrap();
            assert!(rig.is_off(), "{polls}");
        }
    }
    each!(of);
}

#[test]
fn a_stop_ends_the_light_at_once() {
    fn of<P: Part>() {
        for polls in 0..POLLS {
            let mut bench = Bench::<P>::after(polls, true);
            bench.sensor.stop();
            assert!(bench.rig.is_off(), "{polls}");
            bench.ends_its_stop();
            // And begins again.
            bench.start();
            let shines = (0..POLLS).any(|_| bench.poll().is_ok() && bench.rig.shines());
            assert!(shines, "{polls}");
        }
    }
    each!(of);
}

/// Until the bus works again. ENABLE alone is enough if it is wired, and the command if it is not.
#[test]
fn each_poll_tries_a_stop_again_that_the_bus_has_failed() {
    fn of<P: Part>() {
        for is_wired in [true, P::NEEDS_ENABLE] {
            let mut tried = 0;
            for (fault, polls) in [Fault::Late, Fault::Nack]
                .into_iter()
                .flat_map(|fault| (0..POLLS).map(move |polls| (fault, polls)))
            {
                let mut bench = Bench::<P>::after(polls, is_wired);
                let before = bench.transfers();
                bench.rig.fail(fault, 0, u32::MAX);
                bench.sensor.stop();
                assert!(!bench.rig.shines() || !is_wired && bench.sensor.is_stopping());
                // It may measure, so it is told.
                if bench.transfers() > before {
                    tried += 1;
                    assert!(bench.sensor.is_stopping());
                    // What ENABLE has switched off does not acknowledge, which is no error.
                    let polled = bench.poll();
                    assert!(polled.is_err() || fault == Fault::Nack && polled == Ok(Polled::Idle));
                    assert_eq!(bench.sensor.errors(), 2 * u32::from(polled.is_err()));
                    assert!(bench.sensor.is_stopping());
                    assert_eq!(bench.transfers(), before + 2);
                }
                bench.rig.fail(fault, 0, 0);
                bench.ends_its_stop();
            }
            assert!(tried > POLLS || P::NEEDS_ENABLE, "{tried}");
        }
    }
    each!(of);
}

#[test]
fn each_poll_tries_a_stop_again_that_the_pin_has_failed() {
    fn of<P: Part>() {
        for (is_wired, polls) in [true, P::NEEDS_ENABLE]
            .into_iter()
            .flat_map(|is_wired| (0..POLLS).map(move |polls| (is_wired, polls)))
        {
            let mut bench = Bench::<P>::after(polls, is_wired);
            bench.rig.break_enable(true);
            bench.sensor.stop();
            for errors in 1..4 {
                assert!(bench.sensor.is_stopping());
                assert_eq!(bench.sensor.errors(), errors);
                // The command has ended the light.
                assert!(!bench.rig.shines() || P::NEEDS_ENABLE);
                assert!(bench.poll().is_err());
            }
            bench.rig.break_enable(false);
            bench.ends_its_stop();
        }
        // A driver that was not started tries likewise.
        let mut bench = Bench::<P>::new(true);
        bench.rig.0.borrow_mut().chip.leave_on();
        bench.rig.break_enable(true);
        assert!(bench.poll().is_err() && bench.sensor.is_stopping());
        bench.rig.break_enable(false);
        bench.ends_its_stop();
    }
    each!(of);
}

/// At each transfer one fails, or the bus from there on if ENABLE is wired.
#[test]
fn a_poll_that_fails_leaves_it_dark() {
    fn of<P: Part>() {
        for (is_wired, transfers, was_on) in [
            (true, 1, false),
            (true, 1, true),
            (true, u32::MAX, false),
            (P::NEEDS_ENABLE, 1, false),
        ] {
            let mut failed = 0;
            for (fault, at) in [Fault::Late, Fault::Nack]
                .into_iter()
                .flat_map(|fault| (0..POLLS).map(move |at| (fault, at)))
            {
                let mut bench = Bench::<P>::new(is_wired);
                if was_on {
                    bench.rig.0.borrow_mut().chip.leave_on();
                }
                bench.start();
                bench.rig.fail(fault, at, transfers);
                while bench.poll().is_ok() {}
                assert!(bench.transfers() > at && !bench.sensor.goes_on());
                assert!(!bench.rig.shines(), "{fault:?} at {at}");
                failed += 1;
            }
            assert_eq!(failed, 2 * POLLS);
        }
    }
    each!(of);
}

#[test]
fn simulated_photons_come_only_between_a_start_and_a_stop() {
    let pixel = SimulatedPixel::new(PixelAddress::new(0), 5, U8F24::lit("1"), U8F24::ZERO);
    let pixels = [pixel.unwrap()];
    let settings = Settings {
        seed: 1,
        bins: 128,
        cycles_per_second: 10_000,
        cycles_per_poll: NonZeroU16::new(1000).unwrap(),
    };
    const PULSE: Pulse = Pulse::new(&[U0F32::MAX]);
    let mut sensor = Simulated::new(&pixels, PULSE, settings);
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

#[derive(Clone, Copy, Debug)]
enum Op {
    Start,
    Stop,
    Polls(u32),
    Bus(Fault, u32, u32),
    Enable(bool),
    Interrupt(bool),
}

fn op() -> impl Strategy<Value = Op> {
    let fault = prop_oneof![
        Just(Fault::Nack),
        Just(Fault::Late),
        any::<u8>().prop_map(Fault::All),
        (0usize..8, 0u8..8).prop_map(|(at, bit)| Fault::Bit(at, bit)),
    ];
    prop_oneof![
        2 => Just(Op::Start),
        1 => Just(Op::Stop),
        6 => (1u32..150).prop_map(Op::Polls),
        3 => (fault, 0u32..60, 1u32..4).prop_map(|(fault, after, of)| Op::Bus(fault, after, of)),
        1 => prop::bool::weighted(0.3).prop_map(Op::Enable),
        1 => prop::bool::weighted(0.3).prop_map(Op::Interrupt),
    ]
}

/// After each call: it shines only if it was started, not stopped since, and the last poll has not given it up.
/// After how many polls it shines.
fn shines_only_under_control<P: Part>(ops: &[Op], was_on: bool) -> u32 {
    let mut bench = Bench::<P>::new(true);
    if was_on {
        bench.rig.0.borrow_mut().chip.leave_on();
    }
    let may_shine = |bench: &Bench<P>| bench.rig.0.borrow().is_enable_broken;
    let (mut is_on, mut shone) = (false, 0);
    for &op in ops {
        match op {
            Op::Start => {
                bench.start();
                is_on = true;
            }
            Op::Stop => {
                bench.sensor.stop();
                is_on = false;
                assert!(!bench.rig.shines() || may_shine(&bench));
            }
            Op::Polls(polls) => {
                for _ in 0..polls {
                    let polled = bench.poll();
                    let goes_on = is_on && (polled.is_ok() || bench.sensor.goes_on());
                    assert!(!bench.rig.shines() || goes_on || may_shine(&bench));
                    shone += u32::from(bench.rig.shines());
                }
            }
            Op::Bus(fault, after, transfers) => bench.rig.fail(fault, after, transfers),
            Op::Enable(is_broken) => bench.rig.break_enable(is_broken),
            Op::Interrupt(is_broken) => bench.rig.0.borrow_mut().is_interrupt_broken = is_broken,
        }
    }
    bench.rig.break_enable(false);
    drop(bench.sensor);
    assert!(bench.rig.is_off());
    shone
}

#[test]
fn whatever_happens_it_shines_only_under_control() {
    let mut runner = TestRunner::new(ProptestConfig::with_cases(300));
    let sequences = (prop::collection::vec(op(), 1..40), any::<bool>());
    let shone = Cell::new([0; 4]);
    let tried = runner.run(&sequences, |(ops, was_on)| {
        let more = [
            shines_only_under_control::<OfI2c>(&ops, was_on),
            shines_only_under_control::<OfSpi>(&ops, was_on),
            shines_only_under_control::<OfNine>(&ops, was_on),
            shines_only_under_control::<OfTdc>(&ops, was_on),
        ];
        let mut sums = shone.get();
        sums.iter_mut()
            .zip(more)
            .for_each(|(sum, more)| *sum += more);
        shone.set(sums);
        Ok(())
    });
    tried.unwrap();
    assert!(
        shone.get().into_iter().all(|polls| polls > 10_000),
        "{shone:?}"
    );
}
