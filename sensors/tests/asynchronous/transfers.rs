//! The same transfers and the same data as over embedded-hal, and
//! each transfer is awaited.

use std::cell::Cell;
use std::fmt::Debug;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use crate::common::tmf8829::bench::{IMAGE, over, settings};
use crate::common::tmf8829::bus::{Bus, Fault};
use crate::common::{RecordingSink, SinkCall, started};
use crate::common::{bus, tmf8828};
use crate::wait::Timer;
use dtof_chips::tmf8829::varied_counts;
use dtof_chips::{Chip as _, Tmf8829 as Chip};
use dtof_core::fixed::types::U16F16;
use dtof_core::{PixelAddress, RangeGate, checked};
use dtof_sensors::dither::Dither;
use dtof_sensors::protocol::{self, AsyncBus, Timing};
use dtof_sensors::tmf882x::{self, Tmf882x};
use dtof_sensors::tmf8829::{self, Config, Settings, Spi, Tmf8829, Zones};
use dtof_sensors::{Polled, Sensor, SensorFault};
use embedded_hal::i2c::{ErrorKind, ErrorType, Operation};
use embedded_hal::spi;
use embedded_hal_async::i2c::I2c;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// A transfer: its register, and how many bytes are read.
pub type Transfer = (u8, usize);

/// A bus on which each transfer takes a while, before the chip takes it and after. `present` is the
/// one that is not over; clones share it.
#[derive(Clone)]
pub struct Slow<B> {
    bus: B,
    present: Rc<Cell<Option<Transfer>>>,
    /// After so many transfers it never ends one.
    pub left: Rc<Cell<Option<u32>>>,
}

/// The future of a transfer is not ready so often.
pub const WAITS: u32 = 4;

impl<B> Slow<B> {
    pub fn new(bus: B) -> Self {
        Self {
            bus,
            present: Rc::default(),
            left: Rc::default(),
        }
    }
}

/// Is not ready so often.
async fn wait(mut times: u32) {
    std::future::poll_fn(|context| {
        if times == 0 {
            return Poll::Ready(());
        }
        times -= 1;
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}

impl<B: ErrorType<Error = ErrorKind>> ErrorType for Slow<B> {
    type Error = ErrorKind;
}

impl<B: embedded_hal::i2c::I2c<Error = ErrorKind>> I2c for Slow<B> {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let (mut register, mut read) = (0, 0);
        for operation in &*operations {
            match operation {
                Operation::Write(bytes) => register = bytes[0],
                Operation::Read(bytes) => read = bytes.len(),
            }
        }
        self.present.set(Some((register, read)));
        match self.left.get() {
            Some(0) => std::future::pending().await,
            left => self.left.set(left.map(|left| left - 1)),
        }
        wait(WAITS / 2).await;
        let done = self.bus.transaction(address, operations);
        wait(WAITS / 2).await;
        self.present.set(None);
        done
    }
}

/// It does not wait if it is not awaited.
impl<B: embedded_hal::i2c::I2c<Error = ErrorKind>> embedded_hal::i2c::I2c for Slow<B> {
    fn transaction(&mut self, to: u8, of: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        self.bus.transaction(to, of)
    }
}

impl spi::ErrorType for Slow<Bus> {
    type Error = spi::ErrorKind;
}

impl embedded_hal_async::spi::SpiDevice for Slow<Bus> {
    async fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        wait(WAITS).await;
        embedded_hal::spi::SpiDevice::transaction(&mut self.bus, operations)
    }
}

/// What came of a future, and how often it was not ready.
pub fn run<T>(future: impl Future<Output = T>) -> (T, u32) {
    run_at(&Cell::new(0), future)
}

/// The same; a millisecond passes whenever it is not ready.
pub fn run_at<T>(clock: &Cell<u32>, future: impl Future<Output = T>) -> (T, u32) {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    let mut pending = 0;
    loop {
        match future.as_mut().poll(&mut context) {
            Poll::Ready(done) => return (done, pending),
            Poll::Pending => {
                pending += 1;
                clock.set(clock.get().wrapping_add(1));
                assert!(pending < 100_000, "it hangs");
            }
        }
    }
}

/// Polls a future until it is ready, but at most so often, and drops it. Returns what came of it if it was ready.
pub fn drop_after<T>(future: impl Future<Output = T>, polls: u32) -> Option<T> {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    (0..polls).find_map(|_| match future.as_mut().poll(&mut context) {
        Poll::Ready(done) => Some(done),
        Poll::Pending => None,
    })
}

pub type Clocked = Timing<Box<dyn FnMut() -> u32>, Timer>;

/// The clock, and the timing of a driver by it.
pub fn timing(bus_ms: u32) -> (Rc<Cell<u32>>, Clocked) {
    // The milliseconds wrap in the middle of it.
    let clock = Rc::new(Cell::new(u32::MAX - 100));
    let (now, timer) = (Rc::clone(&clock), Timer(Rc::clone(&clock)));
    let now_ms: Box<dyn FnMut() -> u32> = Box::new(move || now.get());
    (clock, Timing::new(now_ms, timer, bus_ms))
}

type OnSlowBus = Tmf8829<'static, Slow<Bus>, Bus, Bus, 252>;

/// A driver that awaits its bus, started, with 8×8 zones.
fn awaited(image: &'static [u8]) -> (OnSlowBus, Bus, Slow<Bus>) {
    let bus = Bus::new(Chip::new(image, varied_counts()));
    let slow = Slow::new(bus.clone());
    let config = Config::new(settings(Zones::Z8x8)).unwrap();
    let mut sensor = Tmf8829::new(slow.clone(), bus.clone(), bus.clone(), image, config);
    sensor.start_async();
    (sensor, bus, slow)
}

/// The same transfers and the same data, faults included.
fn makes_the_same_transfers<B, S, E: Debug + PartialEq>(
    settings: Settings,
    on: impl Fn(Bus) -> B,
    slowly_on: impl Fn(Bus) -> S,
) where
    B: protocol::Bus<Error = E>,
    S: AsyncBus<Error = E>,
{
    let config = Config::new(settings).unwrap();
    let buses = [(); 2].map(|()| Bus::new(Chip::new(&IMAGE, varied_counts())));
    let [
        [bus, interrupt, enable],
        [slow, other_interrupt, other_enable],
    ] = [0, 1].map(|at: usize| [(); 3].map(|()| buses[at].clone()));
    let sensor = Tmf8829::<_, _, _>::new(on(bus), interrupt, enable, &IMAGE, config);
    let mut sensor = started(sensor);
    let slow = slowly_on(slow);
    let mut awaited = Tmf8829::<_, _, _>::new(slow, other_interrupt, other_enable, &IMAGE, config);
    awaited.start_async();
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
            if let Some(fault) = fault {
                bus.fail_next(fault);
            }
            bus.0.borrow_mut().log.clear();
        }
        let [first, second] = &mut sinks;
        let polled = sensor.poll(now_ms, first);
        let (later, pending) = run(awaited.poll_async(now_ms, second));
        assert_eq!(polled, later);
        data += u32::from(polled == Ok(Polled::Data));
        let [log, slow_log] = [0, 1].map(|at: usize| buses[at].0.borrow().log.clone());
        assert_eq!(log, slow_log);
        assert_eq!(pending, WAITS * u32::try_from(log.len()).unwrap());
        assert_eq!(first.take(), second.take());
    }
    assert!(data > 300, "{data}");
    assert_eq!(sensor.counts(), awaited.counts());
    assert!(awaited.counts().errors > 5 && awaited.counts().histograms > 300);

    let (clock, mut timing) = timing(100);
    run_at(&clock, awaited.stop_async(&mut timing));
    sensor.stop();
    assert!(!buses[1].shines());
    let [last, slow_last] = [0, 1].map(|at: usize| buses[at].0.borrow().log.last().cloned());
    assert_eq!(last, slow_last);
}

#[test]
fn an_awaited_tmf8829_makes_the_same_transfers() {
    makes_the_same_transfers(settings(Zones::Z8x8), |bus| bus, Slow::new);
    let settings = over::<Spi<Bus>>(settings(Zones::Z16x16));
    makes_the_same_transfers(settings, Spi, |bus| Spi(Slow::new(bus)));
}

/// Polls are dropped at each place where they wait. A frame of which the header or the data were on the
/// bus is lost and counted; all others come, and what comes is right.
#[test]
fn a_poll_of_a_tmf8829_that_is_dropped_costs_at_most_its_frame() {
    let (mut sensor, bus, slow) = awaited(&IMAGE);
    let mut sink = RecordingSink::default();
    // Of reasons, headers and data; and how far each poll had come.
    let (mut reasons, mut missed, mut broken) = (0, 0, 0);
    let mut dropped_at = std::collections::BTreeSet::new();
    let mut rng = Pcg32::seed_from_u64(1);
    for poll in 0..60_000 {
        let measured = sensor.is_measuring();
        // Two of three polls that begin a frame, and some others.
        let begins = measured && bus.0.borrow().chip.interrupts();
        if !rng.next_u32().is_multiple_of(if begins { 2 } else { 300 }) {
            assert!(run(sensor.poll_async(poll, &mut sink)).0.is_ok());
            continue;
        }
        let polls = 1 + rng.next_u32() % (3 * WAITS);
        if drop_after(sensor.poll_async(poll, &mut sink), polls).is_some() {
            continue;
        }
        let transfer = slow.present.take().unwrap();
        dropped_at.insert((transfer, (polls - 1) % WAITS));
        match transfer {
            (0xE1, _) if measured => {
                reasons += 1;
                assert!(run(sensor.poll_async(poll, &mut sink)).0.is_ok());
                assert!(sensor.is_measuring(), "it need not begin again");
            }
            (0xFA, _) => missed += 1,
            (0xFF, 1..) => broken += 1,
            _ => {}
        }
    }
    assert!(
        reasons > 20 && missed > 20 && broken > 20,
        "{reasons} {missed} {broken}"
    );
    for register in [(0xE1, 0), (0xE1, 1), (0xFA, 21), (0xFF, 252)] {
        let of = dropped_at
            .iter()
            .filter(|(transfer, _)| *transfer == register);
        assert_eq!(of.count(), 4, "{register:02x?}: {dropped_at:02x?}");
    }
    let counts = sensor.counts();
    assert_eq!(
        (counts.missed, counts.broken, counts.errors),
        (missed, broken, 0)
    );
    let measurements = u32::try_from(bus.0.borrow().chip.sent.len()).unwrap();
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
        assert!((0..measurements).any(is_right), "pixel {pixel}");
        histograms += 1;
    }
    assert!(histograms > 200, "{histograms}");
}

/// An awaited poll is dropped when the FIFO has given a chunk, or the header. What is called next,
/// blocking or not, counts the frame and gives nothing of it.
#[test]
fn after_a_dropped_poll_each_call_counts_the_frame() {
    for (register, lost) in [(0xFF, [1, 0]), (0xFA, [0, 1])] {
        for call in 0..5 {
            let (mut sensor, _, slow) = awaited(&IMAGE);
            let mut sink = RecordingSink::default();
            // The chip has answered, and the driver does not know.
            let mut now_ms = 0;
            while sensor.counts().histograms < 20 || slow.present.get().is_some() {
                now_ms += 1;
                run(sensor.poll_async(now_ms, &mut sink)).0.unwrap();
            }
            loop {
                now_ms += 1;
                let mut poll = Box::pin(sensor.poll_async(now_ms, &mut sink));
                let mut context = Context::from_waker(Waker::noop());
                let mut waits = 0;
                let was_dropped = loop {
                    if poll.as_mut().poll(&mut context).is_ready() {
                        break false;
                    }
                    let found = slow
                        .present
                        .get()
                        .is_some_and(|(at, read)| at == register && read > 0);
                    waits = if found { waits + 1 } else { 0 };
                    if waits == 4 {
                        break true;
                    }
                };
                drop(poll);
                if was_dropped {
                    break;
                }
            }
            sink.take();
            match call {
                0 => drop(run(sensor.poll_async(now_ms, &mut sink)).0.unwrap()),
                1 => drop(sensor.poll(now_ms, &mut sink).unwrap()),
                2 => sensor.start(U16F16::ZERO, Dither::OFF),
                3 => sensor.start_async(),
                _ => sensor.stop(),
            }
            let counts = sensor.counts();
            assert_eq!([counts.broken, counts.missed], lost, "{register:#x} {call}");
            assert_eq!(sink.take(), []);
            assert!(!sensor.is_measuring());
        }
    }
}

#[test]
fn a_poll_of_a_tmf8828_that_is_dropped_costs_at_most_its_set() {
    let config = tmf882x::Config::new(tmf882x::Settings::of_8x8(PixelAddress::new(10))).unwrap();
    let bus = bus::Bus::new(tmf8828::Chip::new(0));
    let slow = Slow::new(bus.clone());
    let present = Rc::clone(&slow.present);
    let mut sensor = Tmf882x::<_, _, _>::new(slow, bus.clone(), bus, &[], config);
    sensor.start_async();
    let mut sink = RecordingSink::default();
    let (mut reasons, mut broken) = (0, 0);
    for poll in 0..20_000 {
        if poll % 331 != 330 {
            assert!(run(sensor.poll_async(poll, &mut sink)).0.is_ok());
            continue;
        }
        let measured = sensor.is_measuring();
        if drop_after(sensor.poll_async(poll, &mut sink), 1 + poll / 331 % 12).is_some() {
            continue;
        }
        match present.take() {
            // The reason of an interrupt is read again, so nothing is lost.
            Some((0xE1, _)) if measured => {
                reasons += 1;
                assert!(run(sensor.poll_async(poll, &mut sink)).0.is_ok());
                assert!(sensor.is_measuring());
            }
            Some((0x20, 135)) => broken += 1,
            _ => {}
        }
    }
    assert!(reasons > 10 && broken > 10, "{reasons} {broken}");
    assert_eq!(
        (sensor.counts().broken, sensor.counts().errors),
        (broken, 0)
    );
    let mut histograms = 0;
    for given in sink.take() {
        let SinkCall::Histogram(pixel, counts) = given else {
            continue;
        };
        let expected = (0..128).map(|bin| tmf8828::count(Some(pixel - 10), bin));
        assert!(counts.into_iter().eq(expected), "pixel {pixel}");
        histograms += 1;
    }
    assert!(histograms > 1000, "{histograms}");
}

/// INT wakes the driver, and a timer brings it up. Each frame comes, none twice.
#[test]
fn next_waits_for_the_sensor() {
    let (mut sensor, bus, _) = awaited(&IMAGE);
    let mut sink = RecordingSink::default();
    let config = Config::new(settings(Zones::Z8x8)).unwrap();
    assert_eq!(sensor.info(), config.info());
    let (clock, mut timing) = timing(100);
    while sensor.counts().frames < 7 {
        let before = sensor.counts().histograms;
        let (given, _) = run_at(&clock, sensor.next(&mut timing, &mut sink));
        assert_eq!(given, Ok(()));
        assert!(sensor.counts().histograms > before);
    }
    assert_eq!((sensor.counts().errors, sensor.counts().missed), (0, 0));

    // Nothing more comes: the driver waits for INT, and then it is an error.
    bus.0.borrow_mut().chip.is_halted = true;
    let began = clock.get();
    let failed = loop {
        let (given, _) = run_at(&clock, sensor.next(&mut timing, &mut sink));
        if let Err(error) = given {
            break error;
        }
    };
    assert_eq!(SensorFault::from(failed), SensorFault::Timeout);
    let waited = clock.get().wrapping_sub(began);
    let limit = config.settings().data_timeout_ms;
    assert!((limit..limit + 1000).contains(&waited), "{waited} ms");
}

/// A bus that never ends a transfer, at each transfer of the way up and of two frames: an error at the
/// limit, and all is right again once the bus is.
#[test]
fn a_bus_that_hangs_ends_a_poll_in_time() {
    const BUS_MS: u32 = 50;
    let mut hung = std::collections::BTreeSet::new();
    for transfers in 0..160 {
        let (mut sensor, _, slow) = awaited(&[7; 100]);
        let mut sink = RecordingSink::default();
        let (clock, mut timing) = timing(BUS_MS);
        slow.left.set(Some(transfers));
        let failed = loop {
            clock.set(clock.get().wrapping_add(1));
            let began = clock.get();
            let polled = run_at(&clock, sensor.poll_within(&mut timing, &mut sink)).0;
            if let Err(error) = polled {
                assert_eq!(clock.get().wrapping_sub(began), BUS_MS);
                break error;
            }
        };
        assert_eq!(failed, tmf8829::Error::BusTimeout);
        assert_eq!(sensor.counts().errors, 1);
        assert_eq!(SensorFault::from(failed), SensorFault::Bus);
        hung.insert(slow.present.take().unwrap().0);
        slow.left.set(None);
        let given = run_at(&clock, sensor.next(&mut timing, &mut sink)).0;
        assert_eq!(given, Ok(()));
    }
    // Start, commands, configuration, interrupts, headers, data.
    for register in [0xF8, 0xE3, 0x00, 0x08, 0x22, 0xE1, 0xFA, 0xFF] {
        assert!(hung.contains(&register), "{register:#04x}: {hung:02x?}");
    }
}

/// The sensor is off all the same.
#[test]
fn a_bus_that_hangs_ends_a_stop_in_time() {
    let (mut sensor, bus, slow) = awaited(&IMAGE);
    let mut sink = RecordingSink::default();
    let (clock, mut timing) = timing(50);
    run_at(&clock, sensor.next(&mut timing, &mut sink))
        .0
        .unwrap();
    assert!(bus.0.borrow().chip.is_measuring);
    slow.left.set(Some(0));
    let began = clock.get();
    run_at(&clock, sensor.stop_async(&mut timing));
    assert_eq!(clock.get().wrapping_sub(began), 50);
    assert!(!bus.0.borrow().chip.is_measuring);
}

/// What a program needs when it is compiled: the bins of the gate, the pixels, the scale.
#[test]
fn a_sensor_is_described_as_a_constant() {
    const ZONES: Config = checked!(Config::new(tmf8829::Settings::new(
        PixelAddress::new(0),
        Zones::Z16x16
    )));
    const NINE: tmf882x::Config = checked!(tmf882x::Config::new(tmf882x::Settings::new(
        PixelAddress::new(3)
    )));
    const MEASURED: RangeGate<128> = checked!(RangeGate::new(0, ZONES.info().bins - 1));
    assert_eq!(MEASURED, checked!(RangeGate::new(0, 53)));
    const PIXELS: [u16; 2] = [ZONES.info().pixels, NINE.info().pixels];
    assert_eq!(PIXELS, [256, 12]);
}

#[test]
fn an_awaited_tmf8828_gives_the_same() {
    let config = tmf882x::Config::new(tmf882x::Settings::of_8x8(PixelAddress::new(10))).unwrap();
    let buses = [(); 2].map(|()| bus::Bus::new(tmf8828::Chip::new(0)));
    let [one, other] = buses.clone();
    let (interrupt, enable) = (one.clone(), one.clone());
    let mut sensor = started(Tmf882x::<_, _, _>::new(one, interrupt, enable, &[], config));
    let (interrupt, enable) = (other.clone(), other.clone());
    let mut awaited = Tmf882x::<_, _, _>::new(Slow::new(other), interrupt, enable, &[], config);
    awaited.start_async();
    let mut sinks = [(); 2].map(|()| RecordingSink::default());
    let mut histograms = 0;
    for now_ms in 0..1000 {
        if now_ms % 300 == 299 {
            buses.iter().for_each(|bus| bus.fail_next(Fault::Nack));
        }
        let [first, second] = &mut sinks;
        let polled = sensor.poll(now_ms, first);
        let before = buses[1].0.borrow().transfers;
        let (later, pending) = run(awaited.poll_async(now_ms, second));
        assert_eq!(polled, later);
        assert_eq!(pending, WAITS * (buses[1].0.borrow().transfers - before));
        let given = first.take();
        assert_eq!(given, second.take());
        let is_histogram = |given: &&SinkCall| matches!(given, SinkCall::Histogram(..));
        histograms += given.iter().filter(is_histogram).count();
    }
    assert!(histograms > 100, "{histograms}");
    assert_eq!(sensor.counts(), awaited.counts());
    assert_eq!(sensor.counts().errors, 3);
}
