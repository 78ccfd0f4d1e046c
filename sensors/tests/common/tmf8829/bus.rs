//! The buses of a TMF8829, I²C and SPI, which can be told to fail, and its pins.

use std::cell::RefCell;
use std::rc::Rc;

use dtof_chips::{Chip as _, Tmf8829 as Chip};
use dtof_sensors::protocol;
use dtof_sensors::tmf8829::{Interface, Spi};
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource, Operation};
use embedded_hal::spi::{self, SpiDevice};

use super::super::Broken;

/// What a bus does instead of the next transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nobody acknowledges the address; on SPI, the bus fails before the transfer.
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
    /// Clocks of the bus.
    pub clocks: u64,
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
            clocks: 0,
        })))
    }

    /// One transfer on I²C.
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
        // An address before each direction, and nine clocks a byte.
        let bytes = 1 + written.len() + read.as_ref().map_or(0, |read| 1 + read.len());
        wires.clocks += 9 * bytes as u64;
        let chip = &mut wires.chip;
        let is_there = wires.is_enabled && !wires.is_unplugged;
        if !is_there
            || chip.off == Some(0x22)
            || chip.address != address
            || fault == Some(Fault::Nack)
        {
            return Err(nack);
        }
        let read = match (read, written) {
            (None, _) => {
                chip.write(written);
                None
            }
            (Some(bytes), &[register]) => {
                chip.read(register, bytes);
                spoil(fault, bytes);
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

impl spi::ErrorType for Bus {
    type Error = spi::ErrorKind;
}

/// The log is that of the same transfer on I²C. Nobody drives MISO of a chip that is not there.
impl SpiDevice for Bus {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        let (mut sent, mut empty) = (Vec::new(), Vec::new());
        let mut read = None;
        for operation in operations {
            match operation {
                spi::Operation::Write(bytes) if read.is_none() => sent.extend_from_slice(bytes),
                spi::Operation::Read(bytes) if read.is_none() => read = Some(bytes),
                other => panic!("{other:?}"),
            }
        }
        let mut wires = self.0.borrow_mut();
        let wires = &mut *wires;
        let fault = wires.fault.take();
        let bytes = read.as_mut().map_or(&mut empty[..], |bytes| &mut **bytes);
        wires.clocks += 8 * (sent.len() + bytes.len()) as u64;
        let register = if bytes.is_empty() {
            &sent[1..]
        } else {
            &sent[1..2]
        };
        wires.log.push((register.to_vec(), None));
        if fault == Some(Fault::Nack) {
            return Err(spi::ErrorKind::Other);
        }
        if wires.is_enabled && !wires.is_unplugged {
            wires.chip.spi(&sent, bytes);
        } else {
            bytes.fill(0xFF);
        }
        if !bytes.is_empty() {
            spoil(fault, bytes);
        }
        if fault == Some(Fault::Late) {
            return Err(spi::ErrorKind::Other);
        }
        wires.log.last_mut().unwrap().1 = Some(bytes.to_vec());
        Ok(())
    }
}

/// What a fault makes of bytes that are read.
pub fn spoil(fault: Option<Fault>, bytes: &mut [u8]) {
    match fault {
        Some(Fault::All(byte)) => bytes.fill(byte),
        Some(Fault::Bit(at, bit)) => bytes[at % bytes.len()] ^= 1 << (bit & 7),
        _ => {}
    }
}

/// A bus of the driver, on these wires.
pub trait Wired: protocol::Bus {
    const INTERFACE: Interface;
    fn to(bus: &Bus) -> Self;
}

impl Wired for Bus {
    const INTERFACE: Interface = Interface::I2c { address: 0x41 };
    fn to(bus: &Bus) -> Self {
        bus.clone()
    }
}

impl Wired for Spi<Bus> {
    const INTERFACE: Interface = Interface::Spi;
    fn to(bus: &Bus) -> Self {
        Self(bus.clone())
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
