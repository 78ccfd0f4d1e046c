//! Protocols without input and output, and what drives them over embedded-hal.
//!
//! A [`Protocol`] is the state machine of a sensor without a bus or pins. It returns its next
//! [`Request`] and takes the answer. [`Driver`] executes requests over embedded-hal as a
//! [`Sensor`](crate::Sensor), which never waits, or over embedded-hal-async
//! (`Driver::next`, with the feature `async`). Both make the same transfers.
//! The [`Bus`] is I²C or, for a TMF8829, SPI.

#[cfg(feature = "async")]
mod asynchronous;
mod blocking;
mod bus;

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};

use crate::{PhotonSink, Polled, SensorInfo};

#[cfg(feature = "async")]
pub use self::asynchronous::Timing;
#[cfg(feature = "async")]
pub use self::bus::AsyncBus;
pub use self::bus::Bus;

/// A request of a protocol to its bus or its pins.
#[derive(Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Nothing: the poll is over with this result.
    Nothing(Polled),
    /// Drive ENABLE high, or else low.
    Enable(bool),
    /// Read INT.
    Interrupt,
    /// Write to the I²C address: the register first, then its values.
    Write {
        /// 7 bits. SPI has none.
        address: u8,
        /// One transaction.
        bytes: &'a [u8],
    },
    /// Write the register to the I²C address, and fill `bytes` in the same transaction.
    Read {
        /// 7 bits. SPI has none.
        address: u8,
        /// The first register.
        register: u8,
        /// At least one.
        bytes: &'a mut [u8],
    },
}

/// A transfer that failed. `B` is the error of the bus, `P` that of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Failure<B, P> {
    /// No device acknowledged the address, or the bus does not tell which byte was not acknowledged.
    Nack(B),
    /// The bus failed otherwise.
    Bus(B),
    /// A pin failed.
    Pin(P),
    /// The bus did not finish a transfer in time.
    BusTimeout,
}

impl<B: embedded_hal::i2c::Error, P> Failure<B, P> {
    /// A device that does not acknowledge a byte has acknowledged its address, so it is there.
    fn of_i2c(error: B) -> Self {
        use NoAcknowledgeSource::{Address, Unknown};
        match error.kind() {
            ErrorKind::NoAcknowledge(Address | Unknown) => Self::Nack(error),
            _ => Self::Bus(error),
        }
    }
}

/// A request that was done.
enum Done {
    /// There was nothing to do, and the poll is over.
    Over(Polled),
    /// It is done; with the level of INT if that was read.
    Level(bool),
}

/// A sensor's protocol. Its driver repeats: [`Self::request`], the transfer, and then
/// [`Self::answered`] or [`Self::failed`].
pub trait Protocol {
    /// An error of the bus, of a pin or of the device.
    type Error<B, P>: From<Failure<B, P>>;

    /// The description for a host.
    fn info(&self) -> SensorInfo;

    /// Abandons the present measurement; the next requests begin again.
    fn restart(&mut self);

    /// A transfer was begun and its future dropped, so that the sensor may have executed it. Begins
    /// again, unless the transfer can be repeated. What is lost is counted.
    fn dropped(&mut self);

    /// The command that stops the sensor, if it is up. Restarts the protocol.
    fn stop(&mut self) -> Request<'_>;

    /// The next request.
    fn request(&mut self, now_ms: u32) -> Request<'_>;

    /// Takes the answer to the request; `is_high` is the level of INT if that was read. Returns
    /// `None` if this poll goes on with the next request, else its result.
    ///
    /// # Errors
    /// Fails if the answer is wrong. Pass the error to [`Self::failed`].
    fn answered<B, P>(
        &mut self,
        is_high: bool,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Option<Polled>, Self::Error<B, P>>;

    /// A request failed, or its answer was wrong: counts the error and chooses how to go on.
    fn failed<B, P>(&mut self, error: &Self::Error<B, P>);
}

/// A sensor's protocol on a bus, with INT and ENABLE.
///
/// The driver owns INT. Nothing else may wait for the same pin.
#[derive(Debug)]
pub struct Driver<P, BUS, INT, EN> {
    protocol: P,
    bus: BUS,
    interrupt: INT,
    enable: EN,
    /// A transfer began and did not end: its future was dropped.
    #[cfg(feature = "async")]
    is_under_way: bool,
}

impl<P: Protocol, BUS, INT, EN> Driver<P, BUS, INT, EN> {
    /// The description for a host. The `Config` of the sensor has the same as a constant.
    pub fn info(&self) -> SensorInfo {
        self.protocol.info()
    }

    /// Counts what the last poll lost if it was dropped within a transfer.
    fn settle(&mut self) {
        #[cfg(feature = "async")]
        if core::mem::take(&mut self.is_under_way) {
            self.protocol.dropped();
        }
    }
}

impl<P, BUS, INT, EN> Driver<P, BUS, INT, EN> {
    pub(crate) const fn of(protocol: P, bus: BUS, interrupt: INT, enable: EN) -> Self {
        Self {
            protocol,
            bus,
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
    pub fn release(self) -> (BUS, INT, EN) {
        (self.bus, self.interrupt, self.enable)
    }
}
