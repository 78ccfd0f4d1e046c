//! Sensors as their registers show them, written from data sheets and vendors' drivers and not
//! from the drivers of `dtof-sensors`. Unit tests and the fuzzer put them on buses of their own.

mod tdc7200;
pub mod tmf8829;
mod tmf882x;

pub use self::tdc7200::Tdc7200;
pub use self::tmf882x::Tmf882x;
pub use self::tmf8829::Tmf8829;

/// The registers of a sensor.
pub trait Chip {
    /// Bytes are written, the register or the command first.
    fn write(&mut self, bytes: &[u8]);
    /// Bytes are read from a register or after a command.
    fn read(&mut self, register: u8, bytes: &mut [u8]);
    /// Whether the interrupt line is low.
    fn interrupts(&self) -> bool;
    /// ENABLE goes low: the sensor forgets everything.
    fn reset(&mut self);
}
