//! Sensors that can be unplugged, on buses that answer as their registers would.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use super::mocks::Line;
use dtof_chips::Chip;
pub use dtof_chips::{Tdc7200 as Tdc, Tmf882x as Tmf};

/// How a bus answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// As the sensor does.
    Sensor,
    /// With an error: on I²C nobody acknowledges.
    Error,
    /// All ones, as a bus with a pull-up.
    Ones,
    /// As the sensor does, whose interrupt line is stuck at this level, for no reason.
    Stuck(bool),
}

/// A bus with one sensor; clones are the same bus.
#[derive(Clone)]
pub struct Bus<C> {
    chip: Rc<RefCell<C>>,
    answers: Rc<Cell<Answers>>,
    transfers: Rc<Cell<u32>>,
    pub interrupt: Line,
    pub enable: Line,
}

impl<C: Chip + Default> Bus<C> {
    pub fn new() -> Self {
        Self {
            chip: Rc::default(),
            answers: Rc::new(Cell::new(Answers::Sensor)),
            transfers: Rc::default(),
            interrupt: Line::new(true),
            enable: Line::new(false),
        }
    }

    /// Sets how the bus answers from now on. A sensor that is plugged in has just got power.
    pub fn set_answers(&self, answers: Answers) {
        self.answers.set(answers);
        self.chip.take();
        self.interrupt.set(true);
    }

    /// Transfers so far.
    pub fn transfers(&self) -> u32 {
        self.transfers.get()
    }

    /// A transfer: bytes are written, and others may be read. `false` if the bus fails.
    fn exchange(&self, written: &[u8], read: Option<&mut [u8]>, status: u8) -> bool {
        self.transfers.set(self.transfers.get() + 1);
        // The chip forgets everything when ENABLE was low since the last transfer.
        if self.enable.driven.take().contains(&false) {
            self.chip.borrow_mut().reset();
        }
        let answers = self.answers.get();
        match (answers, read) {
            (Answers::Error, _) => return false,
            (Answers::Ones, Some(bytes)) => bytes.fill(0xff),
            (Answers::Ones, None) => {}
            (_, None) => self.chip.borrow_mut().write(written),
            (_, Some(bytes)) => {
                self.chip.borrow_mut().read(written[0], bytes);
                if written == [status] && matches!(answers, Answers::Stuck(_)) {
                    bytes.fill(0);
                }
            }
        }
        match answers {
            Answers::Sensor => self.interrupt.set(!self.chip.borrow().interrupts()),
            Answers::Stuck(level) => self.interrupt.set(level),
            Answers::Error | Answers::Ones => {}
        }
        true
    }
}

impl<C> spi::ErrorType for Bus<C> {
    type Error = spi::ErrorKind;
}

impl SpiDevice for Bus<Tdc> {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        let is_done = match operations {
            [spi::Operation::Write(bytes)] => self.exchange(bytes, None, 0x02),
            [spi::Operation::Write(register), spi::Operation::Read(bytes)] => {
                self.exchange(register, Some(bytes), 0x02)
            }
            other => panic!("{other:?}"),
        };
        is_done.then_some(()).ok_or(spi::ErrorKind::Other)
    }
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
        let is_done = match operations {
            // Nobody pulls SDA low to acknowledge.
            _ if self.answers.get() == Answers::Ones => false,
            [i2c::Operation::Write(bytes)] => self.exchange(bytes, None, 0xE1),
            [i2c::Operation::Write(register), i2c::Operation::Read(bytes)] => {
                self.exchange(register, Some(bytes), 0xE1)
            }
            other => panic!("{other:?}"),
        };
        let source = NoAcknowledgeSource::Address;
        is_done
            .then_some(())
            .ok_or(i2c::ErrorKind::NoAcknowledge(source))
    }
}
