//! The program of the example for embassy, against a simulated chip.

#[path = "../../examples/embassy/src/depth.rs"]
mod depth;

use std::cell::{Cell, RefCell};
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Waker};

use crate::common::tmf8829::bus::{Bus, Fault};
use crate::wait::Timer;
use dtof_chips::Tmf8829 as Chip;
use dtof_sensors::SensorFault;
use dtof_sensors::protocol::Timing;
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::i2c::I2c;

const PROGRAM: [u8; 500] = [0x5A; 500];
/// A pulse in this bin of the sensor, in all zones.
const PULSE: usize = 10;

/// A bus whose transfers take a millisecond.
struct Awaited(Bus, Timer);

impl ErrorType for Awaited {
    type Error = ErrorKind;
}

impl I2c for Awaited {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        self.1.delay_ms(1).await;
        embedded_hal::i2c::I2c::transaction(&mut self.0, address, operations)
    }
}

#[test]
fn the_example_reports_events_in_millimetres() {
    let scene = Rc::new(|_, zone: Option<_>, bins: usize| {
        let mut counts = vec![10; if zone.is_some() { bins } else { 64 }];
        counts[PULSE] = 1000;
        counts
    });
    let bus = Bus::new(Chip::new(&PROGRAM, scene));
    let clock = Rc::new(Cell::new(0));
    let now = Rc::clone(&clock);
    let timer = Timer(Rc::clone(&clock));
    let reports = RefCell::new(Vec::new());
    let awaited = Awaited(bus.clone(), timer.clone());
    let pins = (awaited, bus.clone(), bus.clone());
    let timing = Timing::new(move || now.get(), timer, 100);
    let report = |report| reports.borrow_mut().push(report);
    let mut program = pin!(depth::run(pins, timing, &PROGRAM, report));
    let mut context = Context::from_waker(Waker::noop());
    for now_ms in 0..2000 {
        clock.set(now_ms);
        // An error of the bus: it is reported once, and all goes on.
        if now_ms == 1000 {
            bus.fail_next(Fault::Late);
        }
        assert!(program.as_mut().poll(&mut context).is_pending());
    }
    let reports = reports.borrow();
    let faults: Vec<_> = reports.iter().filter_map(|report| report.err()).collect();
    assert_eq!(faults, [SensorFault::Bus]);
    let mut events = [0; 64];
    for (pixel, range) in reports.iter().flatten() {
        // The middle of bin 10 of 814.6 ps, less 439.4 mm.
        assert_eq!(range.round(), 843);
        events[usize::from(pixel.raw())] += 1;
    }
    assert!(events.iter().all(|&events| events > 2), "{events:?}");
}

/// It ends, so that its board can reset the bus.
#[test]
fn the_example_ends_when_its_bus_hangs() {
    struct Hangs;
    impl ErrorType for Hangs {
        type Error = ErrorKind;
    }
    impl I2c for Hangs {
        async fn transaction(&mut self, _: u8, _: &mut [Operation<'_>]) -> Result<(), Self::Error> {
            std::future::pending().await
        }
    }
    let clock = Rc::new(Cell::new(0));
    let timer = Timer(Rc::clone(&clock));
    let now = Rc::clone(&clock);
    let bus = Bus::new(Chip::new(&PROGRAM, dtof_chips::tmf8829::varied_counts()));
    let timing = Timing::new(move || now.get(), timer, 100);
    let mut reports = Vec::new();
    let report = |report| reports.push(report);
    let mut program = Box::pin(depth::run(
        (Hangs, bus.clone(), bus),
        timing,
        &PROGRAM,
        report,
    ));
    let mut context = Context::from_waker(Waker::noop());
    let ended = (0..1000).any(|now_ms| {
        clock.set(now_ms);
        program.as_mut().poll(&mut context).is_ready()
    });
    drop(program);
    assert!(ended);
    assert_eq!(reports, [Err(SensorFault::Bus)]);
}

/// Bus, pins and timer of a board come on top.
#[test]
fn the_example_is_short() {
    let lines = include_str!("../../examples/embassy/src/depth.rs").lines();
    assert!(lines.count() <= 60);
}
