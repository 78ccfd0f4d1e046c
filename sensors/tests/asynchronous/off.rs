//! A sensor that is awaited is off, too, if futures are dropped at any place where they wait, and if the bus hangs.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use crate::common::part::{Bench, POLLS, Part};
use crate::parts::{Of8829, each};
use crate::transfers::WAITS;
use dtof_sensors::Polled;

/// The next poll goes on only after a drop within a transfer that can be repeated.
#[test]
fn a_dropped_poll_goes_on_or_leaves_it_dark() {
    fn of<P: Part>() {
        let mut gone_on = 0;
        for waits in 0..WAITS * POLLS {
            let mut bench = Bench::<P>::after(0, true);
            // Whichever poll is not ready for this time, from 0, is dropped.
            while {
                let polls = 1 + waits - WAITS * bench.transfers();
                let polled = bench.look(|sensor, now, sink| sensor.drop_poll(now, sink, polls));
                polled.is_some()
            } {}
            if bench.is_measuring() {
                gone_on += 1;
                assert!(bench.poll().is_ok() && bench.is_measuring());
            } else {
                assert!(bench.bus.is_off(), "{waits}");
            }
            // So does a driver that is dropped after it.
            let Bench { sensor, bus, .. } = bench;
            drop(sensor);
            assert!(bus.is_off(), "{waits}");
        }
        assert!((1..WAITS * POLLS).contains(&gone_on), "{gone_on}");
    }
    each!(of);
}

#[test]
fn a_dropped_stop_is_finished_by_the_next_polls() {
    fn of<P: Part>() {
        for (is_wired, polls) in [true, false]
            .into_iter()
            .flat_map(|is_wired| (0..POLLS).map(move |polls| (is_wired, polls)))
        {
            for waits in 1..=WAITS {
                let mut bench = Bench::<P>::after(polls, is_wired);
                bench.sensor.drop_stop(waits);
                assert!(bench.bus.is_off() || !is_wired && bench.is_stopping());
                bench.ends_its_stop();

                // And if it is started instead: ENABLE stays low for its time, as after a whole stop.
                let mut bench = Bench::<P>::after(polls, is_wired);
                bench.sensor.drop_stop(waits);
                bench.sensor.start();
                for _ in 0..3 {
                    assert!(bench.poll().is_ok());
                    assert_eq!(bench.bus.0.borrow().driven.last(), Some(&false), "{polls}");
                }
            }
        }
    }
    each!(of);
}

#[test]
fn a_bus_that_hangs_leaves_it_dark() {
    fn of<P: Part>() {
        for transfers in 0..POLLS {
            let mut bench = Bench::<P>::after(0, true);
            bench.sensor.hang(Some(transfers));
            while bench.poll().is_ok() {}
            assert!(bench.bus.is_off() && !bench.is_measuring(), "{transfers}");
            // The bus hangs in a stop.
            for is_wired in [true, false] {
                let mut bench = Bench::<P>::after(transfers, is_wired);
                bench.sensor.hang(Some(0));
                bench.sensor.stop();
                assert!(bench.bus.is_off() || !is_wired && bench.is_stopping());
                assert_eq!(bench.poll().is_err(), bench.is_stopping());
                bench.sensor.hang(None);
                bench.ends_its_stop();
            }
        }
    }
    each!(of);
}

/// `next` waits for INT, and INT fails.
#[test]
fn a_wait_that_fails_leaves_it_dark() {
    let mut bench = Bench::<Of8829>::after(POLLS, true);
    bench.bus.0.borrow_mut().chip.is_halted = true;
    while bench.poll() != Ok(Polled::Idle) {}
    let (awaited, bus) = (&mut bench.sensor, &bench.bus);
    awaited.clock.set(bench.now_ms);
    {
        let mut next = pin!(awaited.driver.next(&mut awaited.timing, &mut bench.sink));
        let mut context = Context::from_waker(Waker::noop());
        assert!(next.as_mut().poll(&mut context).is_pending());
        assert!(bus.shines());
        bus.0.borrow_mut().is_interrupt_broken = true;
        let failed = next.as_mut().poll(&mut context);
        assert!(matches!(failed, Poll::Ready(Err(_))));
    }
    assert!(bus.is_off());
    assert_eq!(bench.errors(), 1);
}
