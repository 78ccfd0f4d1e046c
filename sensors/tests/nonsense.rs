//! Sensors that answer nonsense: arbitrary bytes, errors of the bus and an interrupt at any level,
//! as often as proptest likes. Drivers never panic, a poll is as short as ever, what is marked as
//! wrong is not given, and all is right again once the sensor is.

use std::cell::{Cell, RefCell, RefMut};
use std::rc::Rc;

use crate::common::{Line, RecordingSink, SinkCall, started};
use dtof_chips::{Chip, Tdc7200 as TdcChip, Tmf882x as TmfChip};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::tdc7200::{self, Calibration, CalibrationPeriods, Tdc7200};
use dtof_sensors::tmf882x::{self, Tmf882x};
use dtof_sensors::{Sensor, SensorFault};
use embedded_hal::{i2c, spi};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The last of what a driver was told: a register and its bytes, which a bus error leaves out.
type Seen = (u8, Option<Vec<u8>>);

/// A bus with a sensor that answers nonsense once in so many transfers, never if 0. Clones are
/// the same bus.
#[derive(Clone)]
struct Bus<C> {
    chip: Rc<RefCell<C>>,
    rng: Rc<RefCell<Pcg32>>,
    one_in: Rc<Cell<u32>>,
    interrupt: Line,
    enable: Line,
    /// Of this poll.
    seen: Rc<RefCell<Vec<Seen>>>,
    transfers: Rc<Cell<u32>>,
}

impl<C: Chip + Default> Bus<C> {
    fn new(seed: u64, one_in: u32) -> Self {
        Self {
            chip: Rc::default(),
            rng: Rc::new(RefCell::new(Pcg32::seed_from_u64(seed))),
            one_in: Rc::new(Cell::new(one_in)),
            interrupt: Line::new(true),
            enable: Line::new(false),
            seen: Rc::default(),
            transfers: Rc::default(),
        }
    }

    /// The chip. It forgets everything when ENABLE was low since the last transfer.
    fn chip(&self) -> RefMut<'_, C> {
        let mut chip = self.chip.borrow_mut();
        if self.enable.driven.take().contains(&false) {
            chip.reset();
        }
        chip
    }

    fn chance(&self, one_in: u32) -> bool {
        one_in > 0 && self.rng.borrow_mut().next_u32().is_multiple_of(one_in)
    }

    /// One transfer: `register` is the first byte written, `answer` the bytes read, `is_low` the
    /// interrupt that the sensor wants. Whether there was no error.
    fn exchange(&self, register: u8, answer: Option<&mut [u8]>, is_low: bool) -> bool {
        self.transfers.set(self.transfers.get() + 1);
        self.interrupt.set(!is_low);
        let (mut is_error, mut bytes) = (false, answer);
        if self.chance(self.one_in.get()) {
            let mut rng = self.rng.borrow_mut();
            self.interrupt.set(rng.next_u32() & 1 == 0);
            match (rng.next_u32() % 6, &mut bytes) {
                (0, _) => is_error = true,
                (1, Some(bytes)) => bytes.fill(0),
                (2, Some(bytes)) => bytes.fill(0xff),
                (3, Some(bytes)) => rng.fill_bytes(bytes),
                (4, Some(bytes)) => {
                    let at = rng.next_u32() as usize % bytes.len();
                    bytes[at] = rng.next_u32().to_le_bytes()[0];
                }
                // Another header that may be one.
                (_, Some(bytes)) => {
                    let at = rng.next_u32() as usize % bytes.len().min(7);
                    bytes[at] = rng.next_u32().to_le_bytes()[0] % 32;
                }
                _ => {}
            }
        }
        let bytes = bytes.filter(|_| !is_error).map(|bytes| bytes.to_vec());
        self.seen.borrow_mut().push((register, bytes));
        !is_error
    }
}

/// Whether a result register is damaged, if parity is on.
fn is_odd(word: &[u8]) -> bool {
    word.iter().map(|byte| byte.count_ones()).sum::<u32>() % 2 == 1
}

impl<C> spi::ErrorType for Bus<C> {
    type Error = spi::ErrorKind;
}

impl spi::SpiDevice for Bus<TdcChip> {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        let (register, answer) = match operations {
            [spi::Operation::Write(bytes)] => {
                self.chip().write(bytes);
                (bytes[0], None)
            }
            [
                spi::Operation::Write([register]),
                spi::Operation::Read(bytes),
            ] => {
                self.chip().read(*register, bytes);
                for word in bytes
                    .chunks_mut(3)
                    .filter(|word| word.len() == 3 && is_odd(word))
                {
                    word[0] ^= 0x80;
                }
                (*register, Some(&mut **bytes))
            }
            other => panic!("{other:?}"),
        };
        let is_low = self.chip.borrow().interrupts();
        let is_right = self.exchange(register, answer, is_low);
        is_right.then_some(()).ok_or(spi::ErrorKind::Other)
    }
}

impl<C> i2c::ErrorType for Bus<C> {
    type Error = i2c::ErrorKind;
}

impl i2c::I2c for Bus<TmfChip> {
    fn transaction(
        &mut self,
        _: u8,
        operations: &mut [i2c::Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        let (register, answer) = match operations {
            [i2c::Operation::Write(bytes)] => {
                self.chip().write(bytes);
                (bytes[0], None)
            }
            [
                i2c::Operation::Write([register]),
                i2c::Operation::Read(bytes),
            ] => {
                self.chip().read(*register, bytes);
                (*register, Some(&mut **bytes))
            }
            other => panic!("{other:?}"),
        };
        let is_low = self.chip.borrow().interrupts();
        let is_right = self.exchange(register, answer, is_low);
        is_right.then_some(()).ok_or(i2c::ErrorKind::Other)
    }
}

/// What may be given of what was seen in a poll that ended so.
trait Oracle {
    fn expects(&mut self, seen: &[Seen], error: Option<SensorFault>) -> Vec<SinkCall>;
}

/// Polls with nonsense, then without. `most` transfers may a poll have; `sane` is all that is
/// given in the end. Gives how many errors there were, all of which the driver has to count.
fn survive<C: Chip + Default, S: Sensor>(
    sensor: &mut S,
    bus: &Bus<C>,
    mut oracle: impl Oracle,
    most: u32,
    sane: impl Fn(&SinkCall) -> bool,
) -> u32
where
    S::Error: Into<SensorFault>,
{
    let (mut sink, mut errors) = (RecordingSink::default(), 0);
    sensor.start(U16F16::lit("250"), Dither::OFF);
    for now_ms in 0..3000 {
        if bus.chance(bus.one_in.get()) {
            let is_high = bus.rng.borrow_mut().next_u32() & 1 == 0;
            bus.interrupt.set(is_high);
        }
        bus.seen.borrow_mut().clear();
        bus.transfers.set(0);
        let error = sensor.poll(now_ms, &mut sink).err().map(Into::into);
        errors += u32::from(error.is_some());
        assert!(
            bus.transfers.get() <= most,
            "{} transfers",
            bus.transfers.get()
        );
        let expected = oracle.expects(&bus.seen.borrow(), error);
        assert_eq!(sink.take(), expected, "{:?} {error:?}", bus.seen.borrow());
    }
    bus.one_in.set(0);
    for now_ms in 3000..6000 {
        let polled = sensor.poll(now_ms, &mut sink).map_err(Into::into);
        errors += u32::from(polled.is_err());
        // Until the last nonsense has had its consequences.
        if now_ms < 4500 {
            sink.take();
        } else {
            assert!(polled.is_ok(), "{polled:?}");
        }
    }
    assert!(
        sink.0.len() > 100 && sink.0.iter().all(sane),
        "{:?}",
        sink.0.last()
    );
    errors
}

/// From the data sheet: what `INT_STATUS`, the results and the calibration say.
struct OfTdc {
    config: tdc7200::Config,
}

impl Oracle for OfTdc {
    fn expects(&mut self, seen: &[Seen], _: Option<SensorFault>) -> Vec<SinkCall> {
        let read = |register| {
            let seen = seen.iter().find(|(at, _)| *at == register);
            seen.and_then(|(_, bytes)| bytes.as_deref())
        };
        let (Some([status]), Some(&[high, middle, low]), Some(calibration)) =
            (read(0x02), read(0x90), read(0x9b))
        else {
            return Vec::new();
        };
        let words = [[high, middle, low].as_slice(), calibration].concat();
        let is_marked = self.config.settings().parity && words.chunks(3).any(is_odd);
        if *status == 0xff || status & 0x17 == 0 || is_marked {
            return Vec::new();
        }
        let value = |word: &[u8]| u32::from_be_bytes([0, word[0], word[1], word[2]]) & 0x7f_ffff;
        let [time, first, second] = [0, 1, 2].map(|at| value(&words[3 * at..]));
        if time == 0 {
            return vec![SinkCall::End(1)];
        }
        let calibration = Calibration::new(8_000, CalibrationPeriods::Ten, first, second);
        calibration.map_or(Vec::new(), |calibration| {
            let code = self.config.code(calibration.mode_1(time));
            vec![SinkCall::Photon(0, code), SinkCall::End(1)]
        })
    }
}

/// Packets in their order, from 0 on.
#[derive(Default)]
struct OfTmf(Vec<Vec<u8>>);

impl Oracle for OfTmf {
    fn expects(&mut self, seen: &[Seen], error: Option<SensorFault>) -> Vec<SinkCall> {
        let packets = seen.iter().filter_map(|(register, bytes)| {
            let bytes = bytes.as_ref().filter(|bytes| bytes.len() == 135);
            bytes.filter(|_| *register == 0x20)
        });
        let mut given = Vec::new();
        for packet in packets {
            let number = usize::from(packet[4]);
            if packet[0] != 0x81 || packet[5] != 128 {
                self.0.clear();
                continue;
            }
            if number != self.0.len() {
                self.0.clear();
                if number != 0 {
                    continue;
                }
            }
            self.0.push(packet.clone());
            if number == 0 {
                given.push(SinkCall::Frame(537 * 1024));
            }
            if let (20.., Some(channel)) = (number, (number % 10).checked_sub(1)) {
                let byte = |packet: usize, bin: usize| u32::from(self.0[packet][7 + bin]);
                let planes = [number - 20, number - 10, number];
                let count = |bin| {
                    let [low, middle, high] = planes.map(|packet| byte(packet, bin));
                    low + (middle << 8) + (high << 16)
                };
                let channel = u16::try_from(channel).unwrap();
                given.push(SinkCall::Histogram(channel, (0..128).map(count).collect()));
            }
            if number == 29 {
                self.0.clear();
            }
        }
        // Any other error ends the measurement, and the set with it.
        if error.is_some_and(|fault| fault != SensorFault::Data) {
            self.0.clear();
        }
        given
    }
}

/// Tries it with seeds, and nonsense once in so many transfers.
fn all(name: &str, survives: impl Fn(u64, u32, bool) -> u32) {
    let cases = match std::env::var_os("DTOF_LONG") {
        Some(_) => 5_000,
        None => 64,
    };
    let mut runner = TestRunner::new(ProptestConfig::with_cases(cases));
    let errors = Cell::new(0);
    let tried = runner.run(
        &(any::<u64>(), 1u32..=200, any::<bool>()),
        |(seed, one_in, parity)| {
            let more = survives(seed, one_in, parity);
            errors.set(errors.get() + u64::from(more));
            Ok(())
        },
    );
    tried.unwrap();
    assert!(errors.get() > u64::from(cases), "hardly any nonsense");
    println!(
        "faults: {name} with nonsense, {cases} times 3 s: {} errors counted, 0 panics, nothing given that \
         is marked as wrong, right again each time",
        errors.get()
    );
}

#[test]
fn a_tdc7200_that_answers_nonsense() {
    all("TDC7200", |seed, one_in, parity| {
        let bus = Bus::<TdcChip>::new(seed, one_in);
        let settings = tdc7200::Settings {
            first_bin_ps: 240_000,
            parity,
            ..tdc7200::Settings::new(PixelAddress::new(0), 8_000, U16F16::lit("250"))
        };
        let config = tdc7200::Config::new(settings).unwrap();
        let (interrupt, enable) = (bus.interrupt.clone(), bus.enable.clone());
        let sensor: Tdc7200<_, _, _> = Tdc7200::new(bus.clone(), interrupt, enable, config);
        let mut sensor = started(sensor);
        let sane = [SinkCall::Photon(0, 28), SinkCall::End(1)];
        let is_sane = |given: &SinkCall| sane.contains(given);
        let errors = survive(&mut sensor, &bus, OfTdc { config }, 19, is_sane);
        assert_eq!(sensor.counts().errors, errors);
        errors
    });
}

#[test]
fn a_tmf882x_that_answers_nonsense() {
    let count = |bin| if bin == 40 { 1000 } else { 10 };
    let sane: Vec<u32> = (0..128).map(count).collect();
    all("TMF8820", |seed, one_in, _| {
        let bus = Bus::<TmfChip>::new(seed, one_in);
        let settings = tmf882x::Settings::new(PixelAddress::new(0));
        let config = tmf882x::Config::new(settings).unwrap();
        let (interrupt, enable) = (bus.interrupt.clone(), bus.enable.clone());
        let sensor: Tmf882x<'_, _, _, _> =
            Tmf882x::new(bus.clone(), interrupt, enable, &[1, 2, 3], config);
        let mut sensor = started(sensor);
        let is_sane = |given: &SinkCall| match given {
            SinkCall::Frame(cycles) => *cycles == 537 * 1024,
            SinkCall::Histogram(pixel, counts) => *pixel < 9 && *counts == sane,
            _ => false,
        };
        let errors = survive(&mut sensor, &bus, OfTmf::default(), 6, is_sane);
        assert_eq!(sensor.counts().errors, errors);
        errors
    });
}
