//! An I²C bus on two pins, made by software, which never waits without a limit.
//!
//! The drivers of chip crates wait for a bus that nothing pulls up for as long
//! as the sensor is unplugged; here every wait ends. Any two open-drain pins that
//! can be read back will do. The processor has nothing else to do while a byte is
//! on the wire, as with a blocking driver of a peripheral; interrupts only make
//! the clock slower, which I²C allows.
//!
//! The times are those of fast mode in NXP's UM10204, table 10: at most 400 kHz,
//! SCL low for at least 1.3 µs.

use core::fmt;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::i2c::{self, ErrorType, I2c, NoAcknowledgeSource, Operation};

/// SCL low, and the bus free between STOP and START.
const LOW_NS: u32 = 1300;
/// SCL high; with `LOW_NS` the period of 400 kHz. Hold and set-up times of START
/// and STOP are shorter.
const HIGH_NS: u32 = 1200;
/// A device that is not ready holds SCL low. It is looked at again after each
/// `LOW_NS` and given up after 10 ms.
const STRETCHED: u32 = 10_000_000 / LOW_NS;
/// Clocks after which a device that was interrupted while it sent has let go of
/// SDA (UM10204, section 3.1.16 "Bus clear").
const CLEAR: u32 = 9;

/// A bus with one controller. `SCL` and `SDA` are open-drain outputs that can be
/// read, pulled up.
#[derive(Debug)]
pub struct SoftwareI2c<SCL, SDA, D> {
    scl: SCL,
    sda: SDA,
    delay: D,
}

/// What can go wrong on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error {
    /// No device acknowledges its address.
    NoDevice,
    /// The device does not acknowledge a byte.
    NotTaken,
    /// SCL stays low: a device has held it for 10 ms, or nothing pulls it up.
    ClockLow,
    /// SDA stays low: a device holds it through a bus clear, or nothing pulls it
    /// up.
    DataLow,
    /// A pin failed.
    Pin,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoDevice => "no device acknowledges its address",
            Self::NotTaken => "a byte is not acknowledged",
            Self::ClockLow => "SCL stays low",
            Self::DataLow => "SDA stays low",
            Self::Pin => "a pin failed",
        })
    }
}

impl core::error::Error for Error {}

impl i2c::Error for Error {
    fn kind(&self) -> i2c::ErrorKind {
        match self {
            Self::NoDevice => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Self::NotTaken => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            Self::ClockLow | Self::DataLow => i2c::ErrorKind::Bus,
            Self::Pin => i2c::ErrorKind::Other,
        }
    }
}

type Result<T = ()> = core::result::Result<T, Error>;

impl<SCL, SDA, D> SoftwareI2c<SCL, SDA, D>
where
    SCL: InputPin + OutputPin,
    SDA: InputPin + OutputPin,
    D: DelayNs,
{
    /// A bus that is not touched yet; both pins are high.
    pub const fn new(scl: SCL, sda: SDA, delay: D) -> Self {
        Self { scl, sda, delay }
    }

    /// Gives the pins (SCL, SDA) and the delay back.
    pub fn release(self) -> (SCL, SDA, D) {
        (self.scl, self.sda, self.delay)
    }

    fn set_sda(&mut self, high: bool) -> Result {
        self.sda.set_state(high.into()).map_err(|_| Error::Pin)
    }

    fn sda(&mut self) -> Result<bool> {
        self.sda.is_high().map_err(|_| Error::Pin)
    }

    /// SCL low for its time before, high for its time after.
    // Once in an image, not once a bit, byte and access: it takes its time anyhow.
    #[inline(never)]
    fn raise_scl(&mut self) -> Result {
        self.delay.delay_ns(LOW_NS);
        self.scl.set_high().map_err(|_| Error::Pin)?;
        for _ in 0..STRETCHED {
            if self.scl.is_high().map_err(|_| Error::Pin)? {
                self.delay.delay_ns(HIGH_NS);
                return Ok(());
            }
            self.delay.delay_ns(LOW_NS);
        }
        Err(Error::ClockLow)
    }

    fn lower_scl(&mut self) -> Result {
        self.scl.set_low().map_err(|_| Error::Pin)
    }

    /// The bit on SDA during a clock.
    fn clock(&mut self) -> Result<bool> {
        self.raise_scl()?;
        let bit = self.sda()?;
        self.lower_scl()?;
        Ok(bit)
    }

    /// START on a bus that is free, or is cleared.
    fn start(&mut self) -> Result {
        self.set_sda(true)?;
        self.raise_scl()?;
        let mut clocks = 0;
        while !self.sda()? {
            if clocks == CLEAR {
                return Err(Error::DataLow);
            }
            clocks += 1;
            self.lower_scl()?;
            self.raise_scl()?;
        }
        self.begin()
    }

    /// START again, with SCL low.
    fn restart(&mut self) -> Result {
        self.set_sda(true)?;
        self.raise_scl()?;
        self.begin()
    }

    fn begin(&mut self) -> Result {
        self.set_sda(false)?;
        self.delay.delay_ns(HIGH_NS);
        self.lower_scl()
    }

    /// STOP, with SCL low.
    fn stop(&mut self) -> Result {
        self.set_sda(false)?;
        self.raise_scl()?;
        self.set_sda(true)
    }

    /// Whether the byte is acknowledged.
    fn write_byte(&mut self, byte: u8) -> Result<bool> {
        for bit in (0..8).rev() {
            self.set_sda(byte >> bit & 1 == 1)?;
            self.clock()?;
        }
        self.set_sda(true)?;
        Ok(!self.clock()?)
    }

    /// The last byte is not acknowledged, so that the device gives SDA free.
    fn read_byte(&mut self, is_last: bool) -> Result<u8> {
        self.set_sda(true)?;
        let mut byte = 0;
        for _ in 0..8 {
            byte = byte << 1 | u8::from(self.clock()?);
        }
        self.set_sda(is_last)?;
        self.clock()?;
        Ok(byte)
    }

    fn address(&mut self, address: u8, reads: bool) -> Result {
        if self.write_byte(address << 1 | u8::from(reads))? {
            Ok(())
        } else {
            Err(Error::NoDevice)
        }
    }

    /// Operations of one kind after another need no START between them.
    #[inline(never)]
    fn run(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result {
        let mut before = None;
        let mut rest = operations.iter_mut().filter(|operation| {
            // Nothing to read is nothing to do; nothing to write asks for a device.
            !matches!(operation, Operation::Read(buffer) if buffer.is_empty())
        });
        let mut next = rest.next();
        while let Some(operation) = next {
            next = rest.next();
            let reads = matches!(operation, Operation::Read(_));
            match before {
                None => self.start()?,
                Some(before) if before != reads => self.restart()?,
                Some(_) => {}
            }
            if before != Some(reads) {
                self.address(address, reads)?;
            }
            before = Some(reads);
            match operation {
                Operation::Write(bytes) => {
                    for &byte in *bytes {
                        if !self.write_byte(byte)? {
                            return Err(Error::NotTaken);
                        }
                    }
                }
                Operation::Read(buffer) => {
                    let goes_on = matches!(next, Some(Operation::Read(_)));
                    let mut left = buffer.len();
                    for byte in buffer.iter_mut() {
                        left -= 1;
                        *byte = self.read_byte(left == 0 && !goes_on)?;
                    }
                }
            }
        }
        if before.is_some() {
            self.stop()?;
        }
        Ok(())
    }
}

impl<SCL, SDA, D> ErrorType for SoftwareI2c<SCL, SDA, D> {
    type Error = Error;
}

impl<SCL, SDA, D> I2c for SoftwareI2c<SCL, SDA, D>
where
    SCL: InputPin + OutputPin,
    SDA: InputPin + OutputPin,
    D: DelayNs,
{
    /// An operation that reads nothing is left out. After an error the bus is
    /// free again, if it can be.
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result {
        let done = self.run(address, operations);
        match done {
            Ok(()) => {}
            Err(Error::NoDevice | Error::NotTaken) => self.stop()?,
            Err(Error::ClockLow | Error::DataLow | Error::Pin) => {
                // What is wrong is known already; START clears the rest.
                let _ = self.sda.set_high();
                let _ = self.scl.set_high();
            }
        }
        done
    }
}
