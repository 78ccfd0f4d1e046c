//! An I²C bus on two pins, made by software, which never waits without a limit.
//!
//! The I²C drivers of chip crates wait without end on a bus that nothing pulls up, which is the case
//! while the sensor is unplugged. Here every wait ends. Any two open-drain pins that can be read
//! back will do. The processor is busy while a byte is on the wire, as with any blocking driver.
//! Interrupts only make the clock slower, which I²C allows.
//!
//! The times are those of fast mode in NXP's UM10204, table 10: at most 400 kHz,
//! SCL low for at least 1.3 µs.

use core::fmt;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::i2c::{self, ErrorType, I2c, NoAcknowledgeSource, Operation};

/// SCL low, and the bus free between STOP and START.
const LOW_NS: u32 = 1300;
/// SDA keeps its level for this long of `LOW_NS`, for devices that see SCL fall
/// late (note 3).
const HOLD_NS: u32 = 300;
/// SCL high; with `LOW_NS` the period of 400 kHz. Hold and set-up times of START
/// and STOP are shorter.
const HIGH_NS: u32 = 1200;
/// The pull-up resistor decides how fast SCL rises. It is read at this interval until it is high;
/// its high time begins then.
const RISE_POLL_NS: u32 = 100;
/// After so many reads, a microsecond, a device is stretching the clock. From then on SCL is read
/// every `LOW_NS`.
const RISE_POLLS: u32 = 10;
/// The longest time that devices may stretch the clock in a transaction, all bits together: the
/// `T_LOW:SEXT` of `SMBus`. Only the pauses count, not the reads between them.
const STRETCH_NS: u32 = 25_000_000;
/// Clocks after which an interrupted device has released SDA (UM10204, section 3.1.16 "Bus clear").
const CLEAR: u32 = 9;

/// A bus with one controller. `SCL` and `SDA` are open-drain outputs that can be
/// read, pulled up.
#[derive(Debug)]
pub struct SoftwareI2c<SCL, SDA, D> {
    scl: SCL,
    sda: SDA,
    delay: D,
    /// The rest of `STRETCH_NS` in this transaction.
    stretch_left_ns: u32,
}

/// An error of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Error {
    /// No device acknowledges its address.
    NoDevice,
    /// The device does not acknowledge a byte.
    NotAcknowledged,
    /// SCL stays low: devices have stretched the clock for 25 ms of a transaction, or nothing pulls
    /// it up.
    ClockLow,
    /// SDA stays low: a device holds it through a bus clear or does not release it for START or
    /// STOP, or nothing pulls it up. Bytes read before are invalid.
    DataLow,
    /// A pin failed.
    Pin,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoDevice => "no device acknowledges its address",
            Self::NotAcknowledged => "a byte is not acknowledged",
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
            Self::NotAcknowledged => i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
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
    /// A bus that is not in use yet; both pins are high.
    pub const fn new(scl: SCL, sda: SDA, delay: D) -> Self {
        Self {
            scl,
            sda,
            delay,
            stretch_left_ns: STRETCH_NS,
        }
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

    /// Waits for the rest of SCL's low time, raises it, and waits for its high time.
    // Not inlined to save flash: its speed does not matter.
    #[inline(never)]
    fn raise_scl(&mut self) -> Result {
        self.delay.delay_ns(LOW_NS - HOLD_NS);
        self.scl.set_high().map_err(|_| Error::Pin)?;
        let mut polls = 0;
        while self.scl.is_low().map_err(|_| Error::Pin)? {
            let mut pause_ns = RISE_POLL_NS;
            if polls == RISE_POLLS {
                pause_ns = LOW_NS;
                let left = self.stretch_left_ns.checked_sub(pause_ns);
                self.stretch_left_ns = left.ok_or(Error::ClockLow)?;
            } else {
                polls += 1;
            }
            self.delay.delay_ns(pause_ns);
        }
        self.delay.delay_ns(HIGH_NS);
        Ok(())
    }

    #[inline(never)]
    fn lower_scl(&mut self) -> Result {
        self.scl.set_low().map_err(|_| Error::Pin)?;
        self.delay.delay_ns(HOLD_NS);
        Ok(())
    }

    /// Fails if SDA is low where no device may drive it.
    fn check_sda(&mut self) -> Result {
        if self.sda()? {
            Ok(())
        } else {
            Err(Error::DataLow)
        }
    }

    /// The bit on SDA during a clock.
    #[inline(never)]
    fn clock(&mut self) -> Result<bool> {
        self.raise_scl()?;
        let bit = self.sda()?;
        self.lower_scl()?;
        Ok(bit)
    }

    /// START, with a bus clear if SDA is low.
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
        self.check_sda()?;
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
        self.set_sda(true)?;
        self.delay.delay_ns(LOW_NS);
        self.check_sda()
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

    /// Does not acknowledge the last byte, so that the device releases SDA.
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

    /// Runs the operations. Those of the same kind need no START between them.
    #[inline(never)]
    fn run(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result {
        let mut before = None;
        let mut rest = operations.iter_mut().filter(|operation| {
            // An empty read does nothing. An empty write tests whether the device answers.
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
                            return Err(Error::NotAcknowledged);
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
    /// Skips operations that read nothing. After an error it releases the bus, and returns the
    /// first error even if that fails.
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result {
        self.stretch_left_ns = STRETCH_NS;
        let done = self.run(address, operations);
        let ended = match done {
            Err(Error::NoDevice | Error::NotAcknowledged) => self.stop(),
            _ => done,
        };
        if ended.is_err() {
            // The error is known already; the next START clears the rest.
            let _ = self.sda.set_high();
            let _ = self.scl.set_high();
        }
        done
    }
}
