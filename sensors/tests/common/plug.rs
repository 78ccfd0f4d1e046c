//! Sensors that can be unplugged, on buses that answer as their registers would.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use super::Line;
pub use super::chips::tdc7200::Chip as Tdc;
pub use super::chips::tmf882x::Chip as Tmf;

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

impl<C> spi::ErrorType for Bus<C> {
    type Error = spi::ErrorKind;
}

impl SpiDevice for Bus<Tdc> {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        match (self.begin(), &mut *operations) {
            (Answers::Error, _) => return Err(spi::ErrorKind::Other),
            (Answers::Ones, [_, spi::Operation::Read(bytes)]) => bytes.fill(0xff),
            (Answers::Ones, _) => {}
            (answers, _) => {
                let is_low = self.chip.borrow_mut().answer(operations);
                self.interrupt.set(!is_low);
                if let Answers::Stuck(level) = answers {
                    self.interrupt.set(level);
                    if let [spi::Operation::Write([0x02]), spi::Operation::Read(status)] =
                        operations
                    {
                        status.fill(0);
                    }
                }
            }
        }
        Ok(())
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
        let answers = self.begin();
        if matches!(answers, Answers::Error | Answers::Ones) {
            let source = NoAcknowledgeSource::Address;
            return Err(i2c::ErrorKind::NoAcknowledge(source));
        }
        let is_low = self.chip.borrow_mut().answer(operations);
        self.interrupt.set(!is_low);
        if let Answers::Stuck(level) = answers {
            self.interrupt.set(level);
            if let [i2c::Operation::Write([0xE1]), i2c::Operation::Read(status)] = operations {
                status.fill(0);
            }
        }
        Ok(())
    }
}
