//! The TMF8829 on SPI.

use embedded_hal::spi::{Operation, SpiDevice};

use crate::protocol::{Bus, Failure};

/// Writes from the register that follows.
const WRITE: u8 = 0x02;
/// Reads from the register that follows, behind one dummy byte.
const READ: u8 = 0x03;

/// A TMF8829 on an SPI bus, mode 0, at most 20 MHz: the bus of the driver, with
/// [`Interface::Spi`](super::Interface::Spi) in its settings. It takes an `SpiDevice` of embedded-hal or
/// of embedded-hal-async.
///
/// SPI has no acknowledgement. A sensor that is not there reads as all ones or zeros: its error is
/// [`Error::WrongChip`](super::Error::WrongChip) or a timeout.
#[derive(Clone, Debug)]
pub struct Spi<SPI>(pub SPI);

impl<SPI: SpiDevice> Bus for Spi<SPI> {
    type Error = SPI::Error;

    fn write(&mut self, _: u8, bytes: &[u8]) -> Result<(), SPI::Error> {
        let operations = &mut [Operation::Write(&[WRITE]), Operation::Write(bytes)];
        self.0.transaction(operations)
    }

    fn read(&mut self, _: u8, register: u8, bytes: &mut [u8]) -> Result<(), SPI::Error> {
        let command = [READ, register, 0];
        let operations = &mut [Operation::Write(&command), Operation::Read(bytes)];
        self.0.transaction(operations)
    }

    fn failure<P>(error: SPI::Error) -> Failure<SPI::Error, P> {
        Failure::Bus(error)
    }
}

#[cfg(feature = "async")]
impl<SPI: embedded_hal_async::spi::SpiDevice> crate::protocol::AsyncBus for Spi<SPI> {
    type Error = SPI::Error;

    async fn write(&mut self, _: u8, bytes: &[u8]) -> Result<(), SPI::Error> {
        let operations = &mut [Operation::Write(&[WRITE]), Operation::Write(bytes)];
        self.0.transaction(operations).await
    }

    async fn read(&mut self, _: u8, register: u8, bytes: &mut [u8]) -> Result<(), SPI::Error> {
        let command = [READ, register, 0];
        let operations = &mut [Operation::Write(&command), Operation::Read(bytes)];
        self.0.transaction(operations).await
    }

    fn failure<P>(error: SPI::Error) -> Failure<SPI::Error, P> {
        Failure::Bus(error)
    }
}
