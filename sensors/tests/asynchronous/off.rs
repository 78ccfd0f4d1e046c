//! As the tests of the blocking drivers: a sensor is on only if its driver was started and goes on with its
//! measurement. Also if futures are dropped at any place where they wait, and if the bus hangs.

use std::cell::Cell;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use crate::common::RecordingSink;
use crate::common::rig::{IMAGE, Lit, Rig, config_8829, config_nine};
use crate::common::tmf8829::bus::{Bus, Fault, Wired};
use crate::transfers::{Slow, WAITS, drop_after, run, run_at, timing};
use dtof_chips::{Tmf882x as NineChip, Tmf8829 as TmfChip};
use dtof_sensors::Polled;
use dtof_sensors::protocol::{Driver, Protocol};
use dtof_sensors::tmf882x::{Tmf882x, Tmf882xProtocol};
use dtof_sensors::tmf8829::{Tmf8829, Tmf8829Protocol};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

/// A protocol with its chip, to be awaited on a rig.
trait Awaits: Protocol + Sized {
    type Chip: Lit;
    fn on(bus: Slow<Rig<Self::Chip>>, rig: &Rig<Self::Chip>) -> Awaited<Self>;
}

type Awaited<P> =
    Driver<P, Slow<Rig<<P as Awaits>::Chip>>, Rig<<P as Awaits>::Chip>, Rig<<P as Awaits>::Chip>>;
type Of8829 = Tmf8829Protocol<'static, 252>;
type OfNine = Tmf882xProtocol<'static>;

impl Awaits for Of8829 {
    type Chip = TmfChip;
    fn on(bus: Slow<Rig<TmfChip>>, rig: &Rig<TmfChip>) -> Awaited<Self> {
        Tmf8829::new(
            bus,
            rig.clone(),
            rig.clone(),
            IMAGE,
            config_8829(Bus::INTERFACE),
        )
    }
}

impl Awaits for OfNine {
    type Chip = NineChip;
    fn on(bus: Slow<Rig<NineChip>>, rig: &Rig<NineChip>) -> Awaited<Self> {
        Tmf882x::new(bus, rig.clone(), rig.clone(), IMAGE, config_nine())
    }
}

/// So many polls bring each sensor up and give two frames.
const POLLS: u32 = 260;

struct Bench<P: Awaits> {
    sensor: Awaited<P>,
    rig: Rig<P::Chip>,
    /// The bus hangs after so many transfers.
    left: Rc<Cell<Option<u32>>>,
    sink: RecordingSink,
    now_ms: u32,
}

impl<P: Awaits> Bench<P> {
    fn new(is_wired: bool) -> Self {
        let rig = Rig::new(is_wired);
        let bus = Slow::new(rig.clone());
        Self {
            left: Rc::clone(&bus.left),
            sensor: P::on(bus, &rig),
            rig,
            sink: RecordingSink::default(),
            now_ms: u32::MAX - 5,
        }
    }

    /// Started, and after so many polls.
    fn after(polls: u32, is_wired: bool) -> Self {
        let mut bench = Self::new(is_wired);
        bench.sensor.start_async();
        for _ in 0..polls {
            assert!(bench.poll().is_some());
        }
        bench
    }

    /// `None` is an error.
    fn poll(&mut self) -> Option<Polled> {
        self.now_ms = self.now_ms.wrapping_add(1);
        run(self.sensor.poll_async(self.now_ms, &mut self.sink))
            .0
            .ok()
    }

    /// Polls until a poll is not ready for this time, from 0, and drops it.
    fn drop_poll(&mut self, mut waits: u32) {
        let mut context = Context::from_waker(Waker::noop());
        loop {
            self.now_ms = self.now_ms.wrapping_add(1);
            let mut poll = pin!(self.sensor.poll_async(self.now_ms, &mut self.sink));
            while poll.as_mut().poll(&mut context).is_pending() {
                if waits == 0 {
                    return;
                }
                waits -= 1;
            }
        }
    }

    /// At most three polls until it is off. Then they do nothing.
    fn ends_its_stop(&mut self) {
        for _ in 0..3 {
            if self.sensor.is_stopping() {
                assert_eq!(self.poll(), Some(Polled::Idle));
            }
        }
        let transfers = self.rig.0.borrow().transfers;
        for _ in 0..20 {
            assert!(!self.sensor.is_stopping() && self.rig.is_off());
            assert_eq!(self.poll(), Some(Polled::Idle));
        }
        assert_eq!(self.rig.0.borrow().transfers, transfers);
    }
}

macro_rules! each {
    ($of:ident) => {
        $of::<Of8829>();
        $of::<OfNine>();
    };
}

#[test]
fn before_a_start_it_is_dark_and_nothing_is_transferred() {
    fn of<P: Awaits>() {
        for was_on in [false, true] {
            let mut bench = Bench::<P>::new(true);
            if was_on {
                bench.rig.0.borrow_mut().chip.leave_on();
            }
            assert!(bench.sensor.is_stopping());
            bench.ends_its_stop();
            let wires = bench.rig.0.borrow();
            assert_eq!((&*wires.driven, wires.transfers), (&[false][..], 0));
        }
    }
    each!(of);
}

/// The next poll goes on only after a drop within a transfer that can be repeated.
#[test]
fn a_dropped_poll_goes_on_or_leaves_it_dark() {
    fn of<P: Awaits>() {
        let mut gone_on = 0;
        for waits in 0..WAITS * POLLS {
            let mut bench = Bench::<P>::new(true);
            bench.sensor.start_async();
            bench.drop_poll(waits);
            if bench.sensor.is_measuring() {
                gone_on += 1;
                assert!(bench.poll().is_some() && bench.sensor.is_measuring());
            } else {
                assert!(bench.rig.is_off(), "{waits}");
            }
            // So does a driver that is dropped after it.
            let Bench { sensor, rig, .. } = bench;
            drop(sensor);
            assert!(rig.is_off(), "{waits}");
        }
        assert!((1..WAITS * POLLS).contains(&gone_on), "{gone_on}");
    }
    each!(of);
}

#[test]
fn a_dropped_stop_is_finished_by_the_next_polls() {
    fn of<P: Awaits>() {
        let (_, mut timing) = timing(50);
        for (is_wired, polls) in [true, false]
            .into_iter()
            .flat_map(|is_wired| (0..POLLS).map(move |polls| (is_wired, polls)))
        {
            for waits in 1..=WAITS {
                let mut bench = Bench::<P>::after(polls, is_wired);
                let done = drop_after(bench.sensor.stop_async(&mut timing), waits);
                assert!(bench.rig.is_off() || !is_wired && done.is_none());
                assert!(bench.sensor.is_stopping() || done.is_some());
                bench.ends_its_stop();

                // And if it is started instead: ENABLE stays low for its time, as after a whole stop.
                let mut bench = Bench::<P>::after(polls, is_wired);
                drop_after(bench.sensor.stop_async(&mut timing), waits);
                bench.sensor.start_async();
                for _ in 0..3 {
                    assert!(bench.poll().is_some());
                    assert_eq!(bench.rig.0.borrow().driven.last(), Some(&false), "{polls}");
                }
            }
        }
    }
    each!(of);
}

#[test]
fn a_poll_that_fails_leaves_it_dark() {
    fn of<P: Awaits>() {
        for (transfers, was_on) in [(1, false), (1, true), (u32::MAX, false)] {
            for at in 0..POLLS {
                let mut bench = Bench::<P>::after(0, true);
                if was_on {
                    bench.rig.0.borrow_mut().chip.leave_on();
                }
                bench.rig.fail(Fault::Nack, at, transfers);
                while bench.poll().is_some() {}
                assert!(!bench.rig.shines() && !bench.sensor.is_measuring(), "{at}");
            }
        }
    }
    each!(of);
}

#[test]
fn a_bus_that_hangs_leaves_it_dark() {
    fn of<P: Awaits>() {
        for transfers in 0..POLLS {
            let (clock, mut timing) = timing(50);
            let mut bench = Bench::<P>::after(0, true);
            bench.left.set(Some(transfers));
            while {
                clock.set(clock.get().wrapping_add(1));
                let poll = bench.sensor.poll_within(&mut timing, &mut bench.sink);
                run_at(&clock, poll).0.is_ok()
            } {}
            assert!(
                bench.rig.is_off() && !bench.sensor.is_measuring(),
                "{transfers}"
            );
            // The bus hangs in a stop.
            for is_wired in [true, false] {
                let mut bench = Bench::<P>::after(transfers, is_wired);
                bench.left.set(Some(0));
                run_at(&clock, bench.sensor.stop_async(&mut timing));
                assert!(bench.rig.is_off() || !is_wired && bench.sensor.is_stopping());
                let poll = bench.sensor.poll_within(&mut timing, &mut bench.sink);
                let polled = run_at(&clock, poll).0;
                assert_eq!(polled.is_err(), bench.sensor.is_stopping());
                bench.left.set(None);
                bench.ends_its_stop();
            }
        }
    }
    each!(of);
}

/// `next` waits for INT, and INT fails.
#[test]
fn a_wait_that_fails_leaves_it_dark() {
    let (clock, mut timing) = timing(50);
    let mut bench = Bench::<Of8829>::after(POLLS, true);
    bench.rig.0.borrow_mut().chip.is_halted = true;
    while bench.poll() != Some(Polled::Idle) {}
    clock.set(bench.now_ms);
    let rig = bench.rig.clone();
    {
        let mut next = pin!(bench.sensor.next(&mut timing, &mut bench.sink));
        let mut context = Context::from_waker(Waker::noop());
        assert!(next.as_mut().poll(&mut context).is_pending());
        assert!(rig.shines());
        rig.0.borrow_mut().is_interrupt_broken = true;
        assert!(matches!(
            next.as_mut().poll(&mut context),
            Poll::Ready(Err(_))
        ));
    }
    assert!(rig.is_off());
    assert_eq!(bench.sensor.counts().errors, 1);
}

#[derive(Clone, Copy, Debug)]
enum Op {
    Start,
    /// Dropped after so many polls.
    Stop(u32),
    DropPoll(u32),
    Polls(u32),
    Fault(Fault, u32, u32),
    Hang(Option<u32>),
    Enable(bool),
}

fn op() -> impl Strategy<Value = Op> {
    let fault = prop_oneof![
        Just(Fault::Nack),
        Just(Fault::Late),
        any::<u8>().prop_map(Fault::All)
    ];
    prop_oneof![
        2 => Just(Op::Start),
        1 => (1u32..8).prop_map(Op::Stop),
        3 => (1u32..16).prop_map(Op::DropPoll),
        6 => (1u32..150).prop_map(Op::Polls),
        2 => (fault, 0u32..60, 1u32..4).prop_map(|(fault, after, of)| Op::Fault(fault, after, of)),
        2 => prop::option::weighted(0.3, 0u32..60).prop_map(Op::Hang),
        1 => prop::bool::weighted(0.3).prop_map(Op::Enable),
    ]
}

/// After each call or drop: it shines only if it was started, not stopped since, and was not given up. After how many
/// polls it shines.
fn shines_only_under_control<P: Awaits>(ops: &[Op]) -> u32 {
    let (clock, mut timing) = timing(100);
    let mut bench = Bench::<P>::new(true);
    let (mut is_on, mut shone) = (false, 0);
    for &op in ops {
        let shines_if = |bench: &Bench<P>, goes_on| {
            let is_broken = bench.rig.0.borrow().is_enable_broken;
            assert!(!bench.rig.shines() || goes_on || is_broken, "{op:?}");
        };
        match op {
            Op::Start => {
                bench.sensor.start_async();
                is_on = true;
            }
            Op::Stop(waits) => {
                drop_after(bench.sensor.stop_async(&mut timing), waits);
                is_on = false;
                shines_if(&bench, false);
            }
            Op::DropPoll(waits) => {
                let poll = bench.sensor.poll_async(clock.get(), &mut bench.sink);
                let is_well = drop_after(poll, waits).is_some_and(|polled| polled.is_ok());
                shines_if(&bench, is_on && (is_well || bench.sensor.is_measuring()));
            }
            Op::Polls(polls) => {
                for _ in 0..polls {
                    clock.set(clock.get().wrapping_add(1));
                    let poll = bench.sensor.poll_within(&mut timing, &mut bench.sink);
                    let is_well = run_at(&clock, poll).0.is_ok();
                    shines_if(&bench, is_on && (is_well || bench.sensor.is_measuring()));
                    shone += u32::from(bench.rig.shines());
                }
            }
            Op::Fault(fault, after, transfers) => bench.rig.fail(fault, after, transfers),
            Op::Hang(after) => bench.left.set(after),
            Op::Enable(is_broken) => bench.rig.break_enable(is_broken),
        }
    }
    bench.rig.break_enable(false);
    drop(bench.sensor);
    assert!(bench.rig.is_off());
    shone
}

#[test]
fn whatever_is_dropped_it_shines_only_under_control() {
    let mut runner = TestRunner::new(ProptestConfig::with_cases(300));
    let shone = Cell::new((0, 0));
    let tried = runner.run(&prop::collection::vec(op(), 1..40), |ops| {
        let (first, second) = shone.get();
        let one = first + shines_only_under_control::<Of8829>(&ops);
        shone.set((one, second + shines_only_under_control::<OfNine>(&ops)));
        Ok(())
    });
    tried.unwrap();
    assert!(shone.get().0.min(shone.get().1) > 10_000, "{shone:?}");
}
