//! A bus with one chip, and pins. While there is input it says how each transfer goes.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use dtof_chips::Chip;
use embedded_hal::digital::{self, ErrorKind, InputPin, OutputPin};
use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, SpiDevice};

use crate::Input;

/// A read, as the driver saw it.
#[derive(Clone, Debug)]
pub struct Answer {
    pub register: u8,
    /// Nothing if the transfer failed, or was a write.
    pub bytes: Vec<u8>,
}

/// The interrupt line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    Chip,
    High,
    Low,
    /// Both pins fail.
    Broken,
}

/// What all that hangs on the bus share.
struct Wires<'a, C> {
    chip: RefCell<C>,
    input: RefCell<Input<'a>>,
    line: Cell<Line>,
    answers: RefCell<Vec<Answer>>,
}

/// The bus; clones are the same.
pub struct Bus<'a, C>(Rc<Wires<'a, C>>);

impl<C> Clone for Bus<'_, C> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<'a, C: Chip> Bus<'a, C> {
    pub fn new(chip: C, input: Input<'a>) -> Self {
        Self(Rc::new(Wires {
            chip: RefCell::new(chip),
            input: RefCell::new(input),
            line: Cell::new(Line::Chip),
            answers: RefCell::default(),
        }))
    }

    /// The next byte of the input, while there is one.
    pub fn next(&self) -> Option<u8> {
        let mut input = self.0.input.borrow_mut();
        (!input.is_empty()).then(|| input.byte())
    }

    pub fn set_line(&self, line: Line) {
        self.0.line.set(line);
    }

    /// The transfers since the last call.
    pub fn take_answers(&self) -> Vec<Answer> {
        self.0.answers.take()
    }

    /// A transfer: what is written, and what is then read into.
    fn exchange(&self, written: &[u8], read: Option<&mut [u8]>) -> Result<(), u8> {
        let mut input = self.0.input.borrow_mut();
        // Good answers behind the end.
        let how = if input.is_empty() { 0 } else { input.byte() };
        let register = written.first().copied().unwrap_or(0);
        let mut answer = Answer {
            register,
            bytes: Vec::new(),
        };
        let failed = (128..144).contains(&how);
        if !failed {
            let mut chip = self.0.chip.borrow_mut();
            match read {
                None => chip.write(written),
                Some(bytes) => {
                    chip.read(register, bytes);
                    match how {
                        0..144 => {}
                        144..192 => {
                            let other = input.bytes(bytes.len());
                            bytes[..other.len()].copy_from_slice(other);
                        }
                        192..208 => bytes.fill(input.byte()),
                        _ => {
                            let at = usize::from(input.byte()) % bytes.len();
                            bytes[at] ^= 1 << (how & 7);
                        }
                    }
                    answer.bytes = bytes.to_vec();
                }
            }
        }
        self.0.answers.borrow_mut().push(answer);
        if failed { Err(how & 3) } else { Ok(()) }
    }
}

impl<C> spi::ErrorType for Bus<'_, C> {
    type Error = spi::ErrorKind;
}

impl<C: Chip> SpiDevice for Bus<'_, C> {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        let done = match operations {
            [spi::Operation::Write(written)] => self.exchange(written, None),
            [spi::Operation::Write(written), spi::Operation::Read(read)] => {
                self.exchange(written, Some(read))
            }
            _ => panic!("no transfer of this driver"),
        };
        done.map_err(|_| spi::ErrorKind::Other)
    }
}

impl<C> i2c::ErrorType for Bus<'_, C> {
    type Error = i2c::ErrorKind;
}

impl<C: Chip> I2c for Bus<'_, C> {
    fn transaction(
        &mut self,
        _: u8,
        operations: &mut [i2c::Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        let done = match operations {
            [i2c::Operation::Write(written)] => self.exchange(written, None),
            [i2c::Operation::Write(written), i2c::Operation::Read(read)] => {
                self.exchange(written, Some(read))
            }
            _ => panic!("no transfer of this driver"),
        };
        done.map_err(|error| match error {
            0 => i2c::ErrorKind::Bus,
            1 => i2c::ErrorKind::ArbitrationLoss,
            2 => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            _ => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
        })
    }
}

/// A pin that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Torn;

impl digital::Error for Torn {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// The two pins of a bus.
pub struct Pin<'a, C>(pub Bus<'a, C>);

impl<C> digital::ErrorType for Pin<'_, C> {
    type Error = Torn;
}

impl<C: Chip> InputPin for Pin<'_, C> {
    fn is_high(&mut self) -> Result<bool, Torn> {
        match self.0.0.line.get() {
            Line::Chip => Ok(!self.0.0.chip.borrow().interrupts()),
            Line::High => Ok(true),
            Line::Low => Ok(false),
            Line::Broken => Err(Torn),
        }
    }

    fn is_low(&mut self) -> Result<bool, Torn> {
        self.is_high().map(|is_high| !is_high)
    }
}

impl<C: Chip> OutputPin for Pin<'_, C> {
    fn set_low(&mut self) -> Result<(), Torn> {
        if self.0.0.line.get() == Line::Broken {
            return Err(Torn);
        }
        self.0.0.chip.borrow_mut().reset();
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Torn> {
        (self.0.0.line.get() != Line::Broken)
            .then_some(())
            .ok_or(Torn)
    }
}
