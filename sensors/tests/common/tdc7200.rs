//! A TDC7200 on a mocked bus: what its accesses look like, and a bench that brings
//! the driver up.

use std::cell::Cell;
use std::rc::Rc;

use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::tdc7200::{Config, Error, Settings, Tdc7200};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_hal_mock::eh1::spi::{Mock, Transaction};

use super::{Broken, Line, RecordingSink, SinkCall, started};

pub type Access = Transaction<u8>;

/// An SPI device that can be unplugged.
#[derive(Clone)]
pub struct Plug {
    pub mock: Mock<u8>,
    pub is_unplugged: Rc<Cell<bool>>,
}

impl ErrorType for Plug {
    type Error = ErrorKind;
}

impl SpiDevice for Plug {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        if self.is_unplugged.get() {
            return Err(ErrorKind::Other);
        }
        self.mock.transaction(operations)
    }
}

fn transaction<const N: usize>(accesses: [Access; N]) -> Vec<Access> {
    let start = [Access::transaction_start()].into_iter();
    let ended = start.chain(accesses).chain([Access::transaction_end()]);
    ended.collect()
}

pub fn write(register: u8, value: u8) -> Vec<Access> {
    transaction([Access::write_vec(vec![0x40 | register, value])])
}

pub fn read(command: u8, bytes: &[u8]) -> Vec<Access> {
    transaction([Access::write(command), Access::read_vec(bytes.to_vec())])
}

/// 24-bit registers, most significant byte first, with auto-increment.
pub fn read_results(first: u8, values: &[u32]) -> Vec<Access> {
    let bytes = values
        .iter()
        .flat_map(|value| value.to_be_bytes()[1..].to_vec());
    read(0x80 | first, &bytes.collect::<Vec<u8>>())
}

/// A measurement that is over: `INT_STATUS`, the results and the calibrations.
pub fn over(status: u8, results: &[u32], calibrations: [u32; 2]) -> Vec<Access> {
    [
        read(0x02, &[status]),
        read_results(0x10, results),
        read_results(0x1b, &calibrations),
    ]
    .concat()
}

/// The data sheet's example, 247.061 ns, and the next `START_MEAS`.
pub fn example() -> Vec<Access> {
    [over(0x19, &[4175], CALIBRATIONS), write(0x00, ARM_1)].concat()
}

/// Writes all that is configured.
pub fn writes(values: [u8; 8]) -> Vec<Access> {
    let registers = REGISTERS.into_iter().zip(values);
    let writes = registers.flat_map(|(register, value)| write(register, value));
    writes.collect()
}

/// The registers as they should be configured, then CONFIG1 with `START_MEAS`.
pub fn configure(values: [u8; 8], config1: u8) -> Vec<Access> {
    let reset = [read(0x01, &[0x40]), read(0x03, &[0x07])].concat();
    let registers = REGISTERS.into_iter().zip(values);
    let reads = registers.flat_map(|(register, value)| read(register, &[value]));
    let arm = write(0x00, config1);
    [reset, writes(values), reads.collect(), arm].concat()
}

/// What is configured: the registers 0x01 and 0x03 to 0x09.
const REGISTERS: [u8; 8] = [0x01, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09];
/// Their values in mode 1.
pub const MODE_1: [u8; 8] = [0x40, 0x07, 0xff, 0xff, 0xff, 0xff, 0, 0];
pub const ARM_1: u8 = 0b1000_0001;
/// The registers of the data sheet's example.
pub const CALIBRATIONS: [u32; 2] = [2110, 21121];

pub fn mode_1() -> Settings {
    Settings {
        first_bin_ps: 240_000,
        ..Settings::new(PixelAddress::new(7), 8_000, U16F16::lit("250"))
    }
}

pub struct Bench<const CHUNK: usize> {
    pub sensor: Tdc7200<Plug, Line, Line, CHUNK>,
    pub spi: Plug,
    pub interrupt: Line,
    pub enable: Line,
    pub sink: RecordingSink,
    pub now_ms: u32,
}

impl<const CHUNK: usize> Bench<CHUNK> {
    pub fn new(settings: Settings) -> Self {
        let spi = Plug {
            mock: Mock::new(&[]),
            is_unplugged: Rc::default(),
        };
        let interrupt = Line::new(true);
        let enable = Line::new(false);
        let config = Config::new(settings).unwrap();
        Self {
            sensor: started(Tdc7200::new(
                spi.clone(),
                interrupt.clone(),
                enable.clone(),
                config,
            )),
            spi,
            interrupt,
            enable,
            sink: RecordingSink::default(),
            // So that the milliseconds wrap in the middle of it.
            now_ms: u32::MAX - 3,
        }
    }

    /// Polls with exactly these accesses.
    pub fn poll(&mut self, accesses: &[Access]) -> Result<Polled, Error<ErrorKind, Broken>> {
        self.spi.mock.update_expectations(accesses);
        let polled = self.sensor.poll(self.now_ms, &mut self.sink);
        self.spi.mock.done();
        polled
    }

    /// The same with the interrupt active.
    pub fn serve(&mut self, accesses: &[Access]) -> Result<Polled, Error<ErrorKind, Broken>> {
        self.interrupt.set(false);
        self.poll(accesses)
    }

    /// Polls after so many milliseconds, without an access.
    pub fn wait(&mut self, ms: u32) -> Result<Polled, Error<ErrorKind, Broken>> {
        self.now_ms = self.now_ms.wrapping_add(ms);
        self.poll(&[])
    }

    /// From off to armed.
    pub fn bring_up(&mut self, values: [u8; 8], config1: u8) {
        self.enable.driven.take();
        assert_eq!(self.wait(0), Ok(Polled::Working));
        assert_eq!(*self.enable.driven.borrow(), [false]);
        assert_eq!(self.wait(1), Ok(Polled::Idle));
        assert_eq!(self.wait(1), Ok(Polled::Working));
        assert_eq!(*self.enable.driven.borrow(), [false, true]);
        assert_eq!(self.wait(2), Ok(Polled::Idle));
        self.now_ms = self.now_ms.wrapping_add(1);
        let polled = self.poll(&configure(values, config1));
        assert_eq!(polled, Ok(Polled::Working));
        assert!(self.sensor.is_armed());
        assert_eq!(self.wait(0), Ok(Polled::Idle));
    }

    /// One measurement of mode 1 with one stop, as the data sheet's example.
    pub fn measure(&mut self) {
        assert_eq!(self.serve(&example()), Ok(Polled::Data));
        // 247.061 ns are 7.061 ns into the histogram: bin 28.
        assert_eq!(
            self.sink.take(),
            [SinkCall::Photon(7, 28), SinkCall::End(1)]
        );
        self.interrupt.set(true);
        assert_eq!(self.poll(&[]), Ok(Polled::Idle));
    }

    /// After an error nothing was given away, and all works again.
    pub fn recover(&mut self) {
        assert!(!self.sensor.is_armed());
        assert_eq!(self.sink.take(), []);
        self.interrupt.set(true);
        self.bring_up(MODE_1, ARM_1);
        self.measure();
    }
}
