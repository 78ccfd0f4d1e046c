//! Drivers over embedded-hal-async: the same transfers and the same data as over embedded-hal, and
//! each transfer is awaited.

mod common;

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use common::Notes;
use common::tmf8829::Chip;
use common::tmf8829::bench::{IMAGE, settings, some};
use common::tmf8829::bus::{Bus, Fault};
use dtof_core::fixed::types::U16F16;
use dtof_sensors::tmf8829::{Config, Tmf8829, Zones};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use embedded_hal_async::i2c::I2c;

/// A bus on which each transfer takes a while.
struct Slow(Bus);

impl ErrorType for Slow {
    type Error = ErrorKind;
}

impl I2c for Slow {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let mut waits = 3;
        std::future::poll_fn(|context| {
            if waits == 0 {
                return Poll::Ready(());
            }
            waits -= 1;
            context.waker().wake_by_ref();
            Poll::Pending
        })
        .await;
        embedded_hal::i2c::I2c::transaction(&mut self.0, address, operations)
    }
}

/// What came of a future, and how often it was not ready.
fn run<T>(future: impl Future<Output = T>) -> (T, u32) {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    let mut pending = 0;
    loop {
        match future.as_mut().poll(&mut context) {
            Poll::Ready(done) => return (done, pending),
            Poll::Pending => pending += 1,
        }
    }
}

#[test]
fn an_awaited_tmf8829_makes_the_same_transfers() {
    let config = Config::new(settings(Zones::Z8x8)).unwrap();
    let buses = [(); 2].map(|()| Bus::new(Chip::new(&IMAGE, some())));
    let [blocking, waiting] = &buses;
    let pins = |bus: &Bus| (bus.clone(), bus.clone());
    let (interrupt, enable) = pins(blocking);
    let mut sensor = Tmf8829::<_, _, _>::new(blocking.clone(), interrupt, enable, &IMAGE, config);
    let (interrupt, enable) = pins(waiting);
    let slow = Slow(waiting.clone());
    let mut awaited = Tmf8829::<_, _, _>::new(slow, interrupt, enable, &IMAGE, config);
    let mut sinks = [(); 2].map(|()| Notes::default());
    let mut data = 0;
    for now_ms in 0..3000 {
        // Each fault on the way up and while it measures.
        let fault = match now_ms % 500 {
            20 => Some(Fault::Late),
            300 => Some(Fault::Nack),
            400 => Some(Fault::Bit(1, 1)),
            _ => None,
        };
        for bus in &buses {
            bus.0.borrow_mut().fault = fault;
            bus.0.borrow_mut().log.clear();
        }
        let [first, second] = &mut sinks;
        let polled = sensor.poll(now_ms, first);
        let (later, pending) = run(awaited.poll_async(now_ms, second));
        assert_eq!(polled, later);
        data += u32::from(polled == Ok(Polled::Data));
        let logs = [blocking, waiting].map(|bus| bus.0.borrow().log.clone());
        assert_eq!(logs[0], logs[1]);
        assert_eq!(pending, 3 * u32::try_from(logs[1].len()).unwrap());
        assert_eq!(first.take(), second.take());
    }
    assert!(data > 300, "{data}");
    assert_eq!(sensor.counts(), awaited.counts());
    assert!(awaited.counts().errors > 5);

    run(awaited.stop_async());
    sensor.stop();
    assert!(!waiting.0.borrow().chip.is_measuring);
    awaited.start_async();
    sensor.start(U16F16::ZERO);
    assert_eq!(
        blocking.0.borrow().log.last(),
        waiting.0.borrow().log.last()
    );
}
