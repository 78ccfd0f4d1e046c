//! Protocols without input and output, and what drives them over embedded-hal.
//!
//! A [`Protocol`] knows a sensor and neither a bus nor a pin. It says what it wants next as a
//! [`Request`], and is told when that is done. [`Driver`] does it over embedded-hal as a
//! [`Sensor`](crate::Sensor), which never waits, or over embedded-hal-async
//! (`Driver::poll_async`, with the feature `async`). Both make the same transfers.

#[cfg(feature = "async")]
mod asynchronous;
mod blocking;

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};

use crate::{About, PhotonSink, Polled};

/// What a protocol wants of its bus and its pins.
#[derive(Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Nothing: the poll is over, and this came of it.
    Nothing(Polled),
    /// Drive ENABLE high, or else low.
    Enable(bool),
    /// Look at INT.
    Interrupt,
    /// Write to the I²C address: the register first, then what goes there.
    Write {
        /// 7 bits.
        address: u8,
        /// One transaction.
        bytes: &'a [u8],
    },
    /// Write the register to the I²C address, and fill `bytes` in the same transaction.
    Read {
        /// 7 bits.
        address: u8,
        /// Where to read from.
        register: u8,
        /// At least one.
        bytes: &'a mut [u8],
    },
}

/// A transfer that failed. `B` is the error of the bus, `P` that of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Failure<B, P> {
    /// Nobody acknowledged the address, or the bus does not tell what was not acknowledged.
    Nack(B),
    /// The bus failed otherwise.
    Bus(B),
    /// A pin failed.
    Pin(P),
}

impl<B: embedded_hal::i2c::Error, P> Failure<B, P> {
    /// A device that does not acknowledge a byte has acknowledged its address, so it is there.
    fn of_bus(error: B) -> Self {
        use NoAcknowledgeSource::{Address, Unknown};
        match error.kind() {
            ErrorKind::NoAcknowledge(Address | Unknown) => Self::Nack(error),
            _ => Self::Bus(error),
        }
    }
}

/// A request that was done.
enum Done {
    /// There was none, and the poll is over.
    Over(Polled),
    /// There was; the level of INT if that was asked.
    Level(bool),
}

/// A sensor's protocol. Whoever drives it repeats: [`Self::request`], the transfer, and then
/// [`Self::answered`] or [`Self::failed`].
pub trait Protocol {
    /// An error of the bus, of a pin or of the device.
    type Error<B, P>: From<Failure<B, P>>;

    /// The description for a host.
    fn about(&self) -> About;

    /// Gives up what is under way; the next requests begin anew.
    fn restart(&mut self);

    /// Tells the sensor to rest, if it can be told; restarts.
    fn stop(&mut self) -> Request<'_>;

    /// What is wanted now.
    fn request(&mut self, now_ms: u32) -> Request<'_>;

    /// The request was done; `is_high` is the level of INT, if that was asked. `None` if this
    /// poll goes on with the next request, else what came of it.
    ///
    /// # Errors
    /// What is wrong with the answer. [`Self::failed`] is to be told.
    fn answered<B, P>(
        &mut self,
        is_high: bool,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Option<Polled>, Self::Error<B, P>>;

    /// A request failed, or its answer was wrong: counts it, and chooses how to go on.
    fn failed<B, P>(&mut self, error: &Self::Error<B, P>);
}

/// A sensor's protocol on an I²C bus, with INT and ENABLE.
#[derive(Debug)]
pub struct Driver<P, I2C, INT, EN> {
    protocol: P,
    i2c: I2C,
    interrupt: INT,
    enable: EN,
    /// A transfer was begun and has not ended: who awaited it gave it up.
    #[cfg(feature = "async")]
    is_under_way: bool,
}

impl<P, I2C, INT, EN> Driver<P, I2C, INT, EN> {
    pub(crate) const fn of(protocol: P, i2c: I2C, interrupt: INT, enable: EN) -> Self {
        Self {
            protocol,
            i2c,
            interrupt,
            enable,
            #[cfg(feature = "async")]
            is_under_way: false,
        }
    }

    pub(crate) const fn protocol(&self) -> &P {
        &self.protocol
    }

    /// Gives the bus and the pins (INT, ENABLE) back.
    pub fn release(self) -> (I2C, INT, EN) {
        (self.i2c, self.interrupt, self.enable)
    }
}
