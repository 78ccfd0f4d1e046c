//! The bus of a TMF8829, which can be told to fail, and its pins.

use std::cell::RefCell;
use std::rc::Rc;

use dtof_chips::{Chip as _, Tmf8829 as Chip};
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource, Operation};

use super::super::Broken;

/// What a bus does instead of the next transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nobody acknowledges the address.
    Nack,
    /// An error of the bus, after the chip has taken the transfer.
    Late,
    /// All bytes that are read are this one.
    All(u8),
    /// A bit of a byte that is read is wrong: at this place, this one.
    Bit(usize, u8),
}

/// The chip, and how its bus fails.
pub struct Wires {
    pub chip: Chip,
    /// Of the next transfer.
    pub fault: Option<Fault>,
    pub is_unplugged: bool,
    /// ENABLE is high.
    is_enabled: bool,
    /// INT is at this level, whatever the chip says.
    pub stuck: Option<bool>,
    /// Each transfer: what was written, and what was read.
    pub log: Vec<(Vec<u8>, Option<Vec<u8>>)>,
}

/// A bus with the chip, and both pins; clones are the same.
#[derive(Clone)]
pub struct Bus(pub Rc<RefCell<Wires>>);

impl Bus {
    pub fn new(chip: Chip) -> Self {
        Self(Rc::new(RefCell::new(Wires {
            chip,
            fault: None,
            is_unplugged: false,
            is_enabled: false,
            stuck: None,
            log: Vec::new(),
        })))
    }

    /// One transfer.
    pub fn exchange(
        &self,
        address: u8,
        written: &[u8],
        read: Option<&mut [u8]>,
    ) -> Result<(), ErrorKind> {
        let mut wires = self.0.borrow_mut();
        let wires = &mut *wires;
        let fault = wires.fault.take();
        let nack = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
        wires.log.push((written.to_vec(), None));
        let chip = &mut wires.chip;
        let is_there = wires.is_enabled && !wires.is_unplugged;
        if !is_there || chip.address != address || fault == Some(Fault::Nack) {
            return Err(nack);
        }
        let read = match (read, written) {
            (None, _) => {
                chip.write(written);
                None
            }
            (Some(bytes), &[register]) => {
                chip.read(register, bytes);
                match fault {
                    Some(Fault::All(byte)) => bytes.fill(byte),
                    Some(Fault::Bit(at, bit)) => bytes[at % bytes.len()] ^= 1 << (bit & 7),
                    _ => {}
                }
                Some(bytes.to_vec())
            }
            _ => panic!("a read names one register"),
        };
        if fault == Some(Fault::Late) {
            return Err(ErrorKind::Bus);
        }
        wires.log.last_mut().unwrap().1 = Some(read.unwrap_or_default());
        Ok(())
    }
}

impl i2c::ErrorType for Bus {
    type Error = ErrorKind;
}

impl I2c for Bus {
    fn transaction(&mut self, to: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        match operations {
            [Operation::Write(bytes)] => self.exchange(to, bytes, None),
            [Operation::Write(register), Operation::Read(bytes)] => {
                self.exchange(to, register, Some(bytes))
            }
            other => panic!("{other:?}"),
        }
    }
}

impl PinErrorType for Bus {
    type Error = Broken;
}

impl InputPin for Bus {
    fn is_high(&mut self) -> Result<bool, Broken> {
        let wires = self.0.borrow();
        let is_low = wires.chip.interrupts() && !wires.is_unplugged;
        Ok(wires.stuck.unwrap_or(!is_low))
    }
    fn is_low(&mut self) -> Result<bool, Broken> {
        self.is_high().map(|is_high| !is_high)
    }
}

impl OutputPin for Bus {
    fn set_low(&mut self) -> Result<(), Broken> {
        let mut wires = self.0.borrow_mut();
        wires.is_enabled = false;
        wires.chip.reset();
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Broken> {
        self.0.borrow_mut().is_enabled = true;
        Ok(())
    }
}

/// INT goes low when the chip does: each look is one of the test's milliseconds.
#[cfg(feature = "async")]
impl embedded_hal_async::digital::Wait for Bus {
    async fn wait_for_low(&mut self) -> Result<(), Broken> {
        std::future::poll_fn(|_| match self.is_low() {
            Ok(false) => std::task::Poll::Pending,
            low => std::task::Poll::Ready(low.map(drop)),
        })
        .await
    }
    async fn wait_for_high(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_rising_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_falling_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_any_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
}
