//! A sensor is on only if its driver was started and goes on with its measurement: not before a start, not after
//! a stop, an error or a drop of the driver. For each driver of the program: those that block, or those that are awaited.

use std::cell::Cell;

use crate::common::bus::Fault;
use crate::common::part::{Bench, Driven, POLLS, Part};
use crate::common::{Broken, SinkCall};
use crate::parts::each;
use dtof_sensors::Polled;
use embedded_hal::digital::OutputPin;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// Each of the faults in each of these transfers or after each of these polls.
fn at_each(faults: &[Fault]) -> impl Iterator<Item = (Fault, u32)> {
    let at = |&fault| (0..POLLS).map(move |at| (fault, at));
    faults.iter().flat_map(at)
}

#[test]
fn these_polls_cover_two_frames() {
    fn of<P: Part>() {
        for &is_wired in P::Driver::WIRED {
            let bench = Bench::<P>::after(POLLS, is_wired);
            assert!(bench.bus.shines() && bench.is_measuring());
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
            let mut bench = Bench::<P>::new(true, was_on);
            assert_eq!(bench.bus.shines(), was_on);
            assert!(bench.is_stopping());
            for _ in 0..100 {
                assert_eq!(bench.poll(), Ok(Polled::Idle));
                assert!(bench.bus.is_off() && !bench.is_stopping());
            }
            assert_eq!(bench.bus.0.borrow().driven, [false]);
            assert_eq!((bench.transfers(), bench.sink.take().len()), (0, 0));
        }
    }
    each!(of);
}

#[test]
fn a_driver_that_is_dropped_or_released_leaves_it_dark() {
    fn of<P: Part>() {
        for polls in 0..POLLS {
            let Bench { sensor, bus, .. } = Bench::<P>::after(polls, true);
            drop(sensor);
            assert!(bus.is_off(), "{polls}");

            let Bench { sensor, bus, .. } = Bench::<P>::after(polls, true);
            let (_, failed) = sensor.into_driver().give_back();
            assert!(bus.is_off() && failed.is_none(), "{polls}");

            // The caller has the pin, and can try again.
            let Bench { sensor, bus, .. } = Bench::<P>::after(polls, true);
            bus.break_enable(true);
            let (mut enable, failed) = sensor.into_driver().give_back();
            assert_eq!(failed, Some(Broken));
            bus.break_enable(false);
            enable.set_low().unwrap();
            assert!(bus.is_off(), "{polls}");
        }
    }
    each!(of);
}

/// Also if the chip ignores the command to stop.
#[test]
fn a_stop_ends_the_light_at_once() {
    fn of<P: Part>() {
        for polls in 0..POLLS {
            let mut bench = Bench::<P>::after(polls, true);
            if polls % 2 == 1 {
                bench.bus.fail_next(Fault::Ignored);
            }
            bench.sensor.stop();
            assert!(bench.bus.is_off(), "{polls}");
            bench.ends_its_stop();
            // And begins again.
            bench.sensor.start();
            let shines = (0..POLLS).any(|_| bench.poll().is_ok() && bench.bus.shines());
            assert!(shines, "{polls}");
        }
    }
    each!(of);
}

/// For 50 ms, until the bus works again. ENABLE alone is enough if it is wired, and the command if it is not.
#[test]
fn each_poll_tries_a_stop_again_that_the_bus_has_failed() {
    fn of<P: Part>() {
        for &is_wired in P::Driver::WIRED {
            let mut tried = 0;
            for (fault, polls) in at_each(&[Fault::Late, Fault::Nack]) {
                let mut bench = Bench::<P>::after(polls, is_wired);
                let before = bench.transfers();
                bench.bus.fail(fault, 0, u32::MAX);
                bench.sensor.stop();
                assert!(!bench.bus.shines() || !is_wired && bench.is_stopping());
                // It may measure, so it is told.
                if bench.transfers() > before {
                    tried += 1;
                    // What ENABLE has switched off does not acknowledge, which is no error.
                    let is_error = fault == Fault::Late || !P::Driver::HAS_NACK;
                    for polls in 1..=50 {
                        assert!(bench.is_stopping());
                        assert_eq!(bench.errors(), polls * u32::from(is_error));
                        assert_eq!(bench.transfers(), before + polls);
                        let polled = bench.poll();
                        assert_eq!(polled.is_err(), is_error);
                        assert!(is_error || polled == Ok(Polled::Idle));
                    }
                    assert!(bench.is_stopping());
                }
                bench.bus.heal();
                bench.ends_its_stop();
            }
            assert!(tried > POLLS || P::Driver::TRUSTED.is_none(), "{tried}");
        }
    }
    each!(of);
}

/// What is not acknowledged for 100 ms counts as off. Other failures do not.
#[test]
fn each_poll_tries_a_stop_again_for_100_ms_or_without_end() {
    fn of<P: Part>() {
        for &is_wired in P::Driver::WIRED {
            for fault in [Fault::Late, Fault::Nack] {
                let mut bench = Bench::<P>::after(POLLS, is_wired);
                bench.bus.fail(fault, 0, u32::MAX);
                bench.sensor.stop();
                let is_error = fault == Fault::Late || !P::Driver::HAS_NACK;
                let mut polls = 0;
                while bench.is_stopping() && polls < 1000 {
                    assert_eq!(bench.poll().is_err(), is_error);
                    polls += 1;
                }
                let expected = match P::Driver::TRUSTED {
                    None => 0..=0,
                    Some(_) if is_error => 1000..=1000,
                    Some(_) => 90..=110,
                };
                assert!(expected.contains(&polls), "{fault:?}: {polls}");
            }
        }
    }
    each!(of);
}

#[test]
fn each_poll_tries_a_stop_again_that_the_pin_has_failed() {
    fn of<P: Part>() {
        for &is_wired in P::Driver::WIRED {
            for polls in 0..POLLS {
                let mut bench = Bench::<P>::after(polls, is_wired);
                bench.bus.break_enable(true);
                bench.sensor.stop();
                for errors in 1..4 {
                    assert!(bench.is_stopping());
                    assert_eq!(bench.errors(), errors);
                    // The command has ended the light.
                    assert!(!bench.bus.shines() || P::Driver::TRUSTED.is_none());
                    assert!(bench.poll().is_err());
                }
                bench.bus.break_enable(false);
                bench.ends_its_stop();
            }
        }
        // A driver that was not started tries likewise.
        let mut bench = Bench::<P>::new(true, true);
        bench.bus.break_enable(true);
        assert!(bench.poll().is_err() && bench.is_stopping());
        bench.bus.break_enable(false);
        bench.ends_its_stop();
    }
    each!(of);
}

/// At each transfer one fails. Then the bus works, or goes on to fail, or the chip ignores the command to stop.
#[test]
fn a_poll_that_fails_leaves_it_dark() {
    fn of<P: Part>() {
        let wired = |later, was_on| (true, later, was_on);
        for (is_wired, later, was_on) in [
            wired(None, false),
            wired(None, true),
            wired(Some(Fault::Late), false),
            wired(Some(Fault::Nack), false),
            wired(Some(Fault::Ignored), false),
            wired(Some(Fault::Ignored), true),
            (false, None, false),
        ] {
            if !P::Driver::WIRED.contains(&is_wired) {
                continue;
            }
            // Faults while it shone, which have ended that.
            let mut darkened = 0;
            for (fault, at) in at_each(&[Fault::Late, Fault::Nack, Fault::Ignored]) {
                let mut bench = Bench::<P>::new(is_wired, was_on);
                bench.sensor.start();
                bench.bus.fail(fault, at, 1);
                if let Some(later) = later {
                    bench.bus.fail(later, at + 1, u32::MAX);
                }
                let has_failed = (0..2 * POLLS).any(|_| bench.poll().is_err());
                // The sensor may go on without a command that it has ignored.
                assert!(has_failed || fault == Fault::Ignored);
                if has_failed {
                    assert!(bench.transfers() > at && !bench.is_measuring());
                    let is_dark = !bench.bus.shines();
                    let is_right = is_dark || bench.may_stay_on();
                    assert!(is_right, "{fault:?} at {at}, {later:?}");
                    darkened += u32::from(is_dark && bench.bus.0.borrow().has_shone);
                }
            }
            let least = match (later, P::Driver::TRUSTED) {
                // Only right after the command to measure.
                (Some(Fault::Ignored), Some(0)) => 2,
                _ => POLLS / 2,
            };
            assert!(darkened >= least, "{later:?}: {darkened}");
        }
    }
    each!(of);
}

#[derive(Clone, Copy, Debug)]
enum Op {
    Start,
    /// If it is awaited, it is dropped after so many polls of it.
    Stop(u32),
    DropPoll(u32),
    Polls(u32),
    Bus(Fault, u32, u32),
    Hang(Option<u32>),
    Enable(bool),
    Interrupt(bool),
}

fn op() -> impl Strategy<Value = Op> {
    let fault = prop_oneof![
        Just(Fault::Nack),
        Just(Fault::Late),
        Just(Fault::Ignored),
        any::<u8>().prop_map(Fault::All),
        (0usize..8, 0u8..8).prop_map(|(at, bit)| Fault::Bit(at, bit)),
    ];
    prop_oneof![
        2 => Just(Op::Start),
        1 => (1u32..8).prop_map(Op::Stop),
        2 => (1u32..16).prop_map(Op::DropPoll),
        6 => (1u32..150).prop_map(Op::Polls),
        3 => (fault, 0u32..60, 1u32..4).prop_map(|(fault, after, of)| Op::Bus(fault, after, of)),
        1 => prop::option::weighted(0.3, 0u32..60).prop_map(Op::Hang),
        1 => prop::bool::weighted(0.3).prop_map(Op::Enable),
        1 => prop::bool::weighted(0.3).prop_map(Op::Interrupt),
    ]
}

/// After each call or drop: it shines only if it was started, not stopped since, and the last poll has not given it up.
/// After how many polls it shines.
fn shines_only_under_control<P: Part>(ops: &[Op], was_on: bool) -> u32 {
    let mut bench = Bench::<P>::new(true, was_on);
    let (mut is_on, mut shone) = (false, 0);
    for &op in ops {
        let check = |bench: &Bench<P>, may_shine| {
            let is_broken = bench.bus.0.borrow().is_enable_broken;
            assert!(!bench.bus.shines() || may_shine || is_broken, "{op:?}");
        };
        let check_poll = |bench: &Bench<P>, is_ok| {
            let may_shine = is_ok || bench.is_measuring() || bench.may_stay_on();
            check(bench, is_on && may_shine);
        };
        match op {
            Op::Start => {
                bench.sensor.start();
                is_on = true;
            }
            Op::Stop(polls) => {
                bench.sensor.drop_stop(polls);
                is_on = false;
                check(&bench, false);
            }
            Op::DropPoll(polls) => {
                let polled = bench.look(|sensor, now, sink| sensor.drop_poll(now, sink, polls));
                check_poll(&bench, polled.is_some_and(|polled| polled.is_ok()));
            }
            Op::Polls(polls) => {
                for _ in 0..polls {
                    let is_ok = bench.poll().is_ok();
                    check_poll(&bench, is_ok);
                    shone += u32::from(bench.bus.shines());
                }
            }
            Op::Bus(fault, after, transfers) => bench.bus.fail(fault, after, transfers),
            Op::Hang(after) => bench.sensor.hang(after),
            Op::Enable(is_broken) => bench.bus.break_enable(is_broken),
            Op::Interrupt(is_broken) => bench.bus.0.borrow_mut().is_interrupt_broken = is_broken,
        }
        bench.sink.take();
        bench.bus.0.borrow_mut().log.clear();
    }
    bench.bus.break_enable(false);
    drop(bench.sensor);
    assert!(bench.bus.is_off());
    shone
}

#[test]
fn whatever_happens_it_shines_only_under_control() {
    fn of<P: Part>() {
        let mut runner = TestRunner::new(ProptestConfig::with_cases(300));
        let sequences = (prop::collection::vec(op(), 1..40), any::<bool>());
        let shone = Cell::new(0);
        let tried = runner.run(&sequences, |(ops, was_on)| {
            shone.set(shone.get() + shines_only_under_control::<P>(&ops, was_on));
            Ok(())
        });
        tried.unwrap();
        assert!(shone.get() > 10_000, "{shone:?}");
    }
    each!(of);
}
