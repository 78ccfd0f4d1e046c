//! The buses of a TMF8829, I²C and SPI.

use dtof_chips::Tmf8829 as Chip;
use dtof_sensors::protocol;
use dtof_sensors::tmf8829::{Interface, Spi};

pub use super::super::bus::{Fault, On};

pub type Bus = super::super::bus::Bus<Chip>;

/// A bus of the driver, on these wires.
pub trait Wired: protocol::Bus + On<Chip> {
    const INTERFACE: Interface;
}

impl Wired for Bus {
    const INTERFACE: Interface = Interface::I2c { address: 0x41 };
}

impl Wired for Spi<Bus> {
    const INTERFACE: Interface = Interface::Spi;
}
