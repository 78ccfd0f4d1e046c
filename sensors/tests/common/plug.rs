//! Sensors that can be unplugged, on buses that answer as their registers would.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use super::Line;
use super::tmf882x::packets;

/// How a bus answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// As the sensor does.
    Sensor,
    /// With an error: on I²C nobody acknowledges.
    Error,
    /// All ones, as a bus with a pull-up.
    Ones,
}

/// A bus with one sensor; clones are the same bus.
#[derive(Clone)]
pub struct Bus<Chip> {
    chip: Rc<RefCell<Chip>>,
    answers: Rc<Cell<Answers>>,
    transfers: Rc<Cell<u32>>,
    pub interrupt: Line,
}

impl<Chip: Default> Bus<Chip> {
    pub fn new() -> Self {
        Self {
            chip: Rc::default(),
            answers: Rc::new(Cell::new(Answers::Sensor)),
            transfers: Rc::default(),
            interrupt: Line::new(true),
        }
    }

    /// Plugs a sensor in that has just got power, or takes it out.
    pub fn plug(&self, answers: Answers) {
        self.answers.set(answers);
        self.chip.take();
        self.interrupt.set(true);
    }

    /// Transfers so far.
    pub fn transfers(&self) -> u32 {
        self.transfers.get()
    }

    /// How this transfer goes.
    fn begin(&self) -> Answers {
        self.transfers.set(self.transfers.get() + 1);
        self.answers.get()
    }
}

/// A TDC7200 that measures one stop at 247.061 ns at once.
#[derive(Clone, Default)]
pub struct Tdc {
    written: [u8; 10],
}

impl<C> spi::ErrorType for Bus<C> {
    type Error = spi::ErrorKind;
}

impl SpiDevice for Bus<Tdc> {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        let answers = self.begin();
        let written = &mut self.chip.borrow_mut().written;
        match (answers, operations) {
            (Answers::Error, _) => return Err(spi::ErrorKind::Other),
            (Answers::Ones, [_, spi::Operation::Read(bytes)]) => bytes.fill(0xff),
            (Answers::Sensor, [spi::Operation::Write([command, value])]) => {
                let register = command & 0x3f;
                written[usize::from(register)] = *value;
                if (register, value & 1) == (0, 1) {
                    self.interrupt.set(false);
                }
            }
            (
                Answers::Sensor,
                [
                    spi::Operation::Write([command]),
                    spi::Operation::Read(bytes),
                ],
            ) => {
                match (command & 0x3f, &mut **bytes) {
                    (0x02, [status]) => *status = 0x19,
                    // What is there after a reset is what is written later.
                    (0x01, [config2]) => *config2 = 0x40,
                    (0x03, [mask]) => *mask = 0x07,
                    (register, [value]) => *value = written[usize::from(register)],
                    (0x10, bytes) => bytes.copy_from_slice(&4175u32.to_be_bytes()[1..]),
                    (_, bytes) => {
                        let (first, second) = bytes.split_at_mut(3);
                        first.copy_from_slice(&2110u32.to_be_bytes()[1..]);
                        second.copy_from_slice(&21121u32.to_be_bytes()[1..]);
                    }
                }
            }
            (_, _) => {}
        }
        Ok(())
    }
}

/// A TMF8820 that runs its application and, when it measures, always has the next
/// packet of histograms with a peak in bin 40.
#[derive(Clone, Default)]
pub struct Tmf {
    status: u8,
    packet: usize,
}

impl<C> i2c::ErrorType for Bus<C> {
    type Error = i2c::ErrorKind;
}

impl I2c for Bus<Tmf> {
    fn transaction(
        &mut self,
        _: u8,
        operations: &mut [i2c::Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        if self.begin() != Answers::Sensor {
            let source = NoAcknowledgeSource::Address;
            return Err(i2c::ErrorKind::NoAcknowledge(source));
        }
        let chip = &mut *self.chip.borrow_mut();
        match operations {
            [i2c::Operation::Write([0x08, command])] => {
                let measures = *command == 0x10;
                chip.status = u8::from(measures);
                chip.packet = 0;
                self.interrupt.set(!measures);
            }
            [
                i2c::Operation::Write([register]),
                i2c::Operation::Read(bytes),
            ] => match (*register, &mut **bytes) {
                (0x00, [application]) => *application = 0x03,
                (0x08, [status]) => *status = chip.status,
                (0x20, [page]) => *page = 0x16,
                (0xE0, [enable]) => *enable = 0x41,
                (0xE1, [interrupt]) => *interrupt = 0x08,
                (0xE3, [id]) => *id = 0x08,
                (0x20, bytes) => {
                    let mut counts = [[10; 128]; 10];
                    for counts in &mut counts {
                        counts[40] = 1000;
                    }
                    bytes.copy_from_slice(&packets(&counts)[chip.packet]);
                    chip.packet = (chip.packet + 1) % 30;
                }
                (register, _) => panic!("register {register:#04x}"),
            },
            _ => {}
        }
        Ok(())
    }
}
