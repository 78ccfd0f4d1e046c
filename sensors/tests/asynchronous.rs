//! Drivers over embedded-hal-async: the same transfers and the same data as over embedded-hal, and
//! each transfer is awaited.

mod common;

use std::cell::RefCell;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use common::tmf8828;
use common::tmf8829::bench::{IMAGE, settings};
use common::tmf8829::bus::{Bus, Fault};
use common::{RecordingSink, SinkCall};
use dtof_chips::tmf8829::varied_counts;
use dtof_chips::{Chip as _, Tmf8829 as Chip};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf882x::{self, Tmf882x};
use dtof_sensors::tmf8829::{Config, Tmf8829, Zones};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use embedded_hal_async::i2c::I2c;

/// A bus on which each transfer takes a while.
struct Slow<B>(B);

impl<B: ErrorType<Error = ErrorKind>> ErrorType for Slow<B> {
    type Error = ErrorKind;
}

impl<B: embedded_hal::i2c::I2c<Error = ErrorKind>> I2c for Slow<B> {
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
        self.0.transaction(address, operations)
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
    let buses = [(); 2].map(|()| Bus::new(Chip::new(&IMAGE, varied_counts())));
    let [blocking, waiting] = &buses;
    let pins = |bus: &Bus| (bus.clone(), bus.clone());
    let (interrupt, enable) = pins(blocking);
    let mut sensor = Tmf8829::<_, _, _>::new(blocking.clone(), interrupt, enable, &IMAGE, config);
    let (interrupt, enable) = pins(waiting);
    let slow = Slow(waiting.clone());
    let mut awaited = Tmf8829::<_, _, _>::new(slow, interrupt, enable, &IMAGE, config);
    let mut sinks = [(); 2].map(|()| RecordingSink::default());
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
    sensor.start(U16F16::ZERO, Dither::OFF);
    assert_eq!(
        blocking.0.borrow().log.last(),
        waiting.0.borrow().log.last()
    );
}

/// Who drops a poll within a transfer loses the rest of that frame, and no count is wrong.
#[test]
fn a_poll_that_is_dropped_costs_its_frame() {
    let config = Config::new(settings(Zones::Z8x8)).unwrap();
    let bus = Bus::new(Chip::new(&IMAGE, varied_counts()));
    let slow = Slow(bus.clone());
    let mut sensor = Tmf8829::<_, _, _>::new(slow, bus.clone(), bus.clone(), &IMAGE, config);
    let mut sink = RecordingSink::default();
    let mut dropped = 0;
    for now_ms in 0..3000 {
        if now_ms % 400 == 399 {
            let mut poll = pin!(sensor.poll_async(now_ms, &mut sink));
            let mut context = Context::from_waker(Waker::noop());
            dropped += u32::from(poll.as_mut().poll(&mut context).is_pending());
            // The chip was read, and nobody has the bytes.
            let mut lost = [0; 100];
            bus.0.borrow_mut().chip.read(0xFF, &mut lost);
            continue;
        }
        assert!(run(sensor.poll_async(now_ms, &mut sink)).0.is_ok());
    }
    assert_eq!(dropped, 7);
    let counts = sensor.counts();
    assert_eq!((counts.broken, counts.errors), (7, 0));
    let measurements = bus.0.borrow().chip.sent.len() / 3 + 1;
    let mut histograms = 0;
    for given in sink.take() {
        let SinkCall::Histogram(pixel, counts) = given else {
            continue;
        };
        let zone = usize::from(pixel - 10);
        let is_right = |measurement| {
            let scene = varied_counts()(measurement, Some((zone % 8, zone / 8)), 256);
            scene[..128] == counts
        };
        let measurements = u32::try_from(measurements).unwrap();
        assert!((0..measurements).any(is_right), "pixel {pixel}");
        histograms += 1;
    }
    assert!(histograms > 200, "{histograms}");
}

#[test]
fn an_awaited_tmf8828_gives_the_same() {
    let config = tmf882x::Config::new(tmf882x::Settings::of_8x8(PixelAddress::new(10))).unwrap();
    let chips = [(); 2].map(|()| Rc::new(RefCell::new(tmf8828::Chip::new(0))));
    let [one, other] = [0, 1].map(|at: usize| tmf8828::Bus(Rc::clone(&chips[at])));
    let (interrupt, enable) = (one.clone(), one.clone());
    let mut sensor = Tmf882x::<_, _, _>::new(one, interrupt, enable, &[], config);
    let (interrupt, enable) = (other.clone(), other.clone());
    let mut awaited = Tmf882x::<_, _, _>::new(Slow(other), interrupt, enable, &[], config);
    let mut sinks = [(); 2].map(|()| RecordingSink::default());
    let mut histograms = 0;
    for now_ms in 0..1000 {
        for chip in &chips {
            chip.borrow_mut().nack = now_ms % 300 == 299;
        }
        let [first, second] = &mut sinks;
        let polled = sensor.poll(now_ms, first);
        let before = chips[1].borrow().transfers;
        let (later, pending) = run(awaited.poll_async(now_ms, second));
        assert_eq!(polled, later);
        assert_eq!(pending, 3 * (chips[1].borrow().transfers - before));
        let given = first.take();
        assert_eq!(given, second.take());
        let is_histogram = |given: &&SinkCall| matches!(given, SinkCall::Histogram(..));
        histograms += given.iter().filter(is_histogram).count();
    }
    assert!(histograms > 100, "{histograms}");
    assert_eq!(sensor.counts(), awaited.counts());
    assert_eq!(sensor.counts().errors, 3);
}
