//! Protocols without input and output, and what drives them over embedded-hal.
//!
//! A [`Protocol`] is the state machine of a sensor without a bus or pins. It returns its next
//! [`Request`] and takes the answer. [`Driver`] executes requests over embedded-hal as a
//! [`Sensor`](crate::Sensor), which never waits, or over embedded-hal-async
//! (`Driver::next`, with the feature `async`). Both make the same transfers.
//! The [`Bus`] is I²C or, for a TMF8829, SPI.
//!
//! # When the sensor is off
//!
//! The sensor measures, and its laser fires, only between a start and a stop. When a driver returns, the
//! sensor is on only if the next poll goes on with its measurement:
//!
//! | what happens | the driver |
//! |---|---|
//! | it was not started | drives ENABLE low at its first poll |
//! | it is stopped | drives ENABLE low, then sends the command to stop. If one of them fails, each poll tries both again |
//! | a poll fails before the sensor measures, with a TMF8829 before its first frame | drives ENABLE low, then sends the command to stop |
//! | a later error ends the measurement | sends the command to stop. If that fails, it drives ENABLE low |
//! | a poll is dropped within a transfer that cannot be repeated, or the bus hangs | drives ENABLE low |
//! | it is dropped or released | drives ENABLE low |
//!
//! # What it cannot do
//!
//! - Wire ENABLE, with a pull-down. Without it the commands alone switch the sensor off: not when the driver is dropped, not
//!   after a reset of the board, and not at an address of its own after a stop.
//! - A sensor that ENABLE has switched off acknowledges nothing. So a stop that is not acknowledged for 100 ms counts as done.
//!   An I²C driver that reports a missing acknowledgement as another error makes each poll after a stop fail.
//! - A driver that is kept, but neither polled nor stopped, leaves the sensor as it is. A watchdog has to cover that.
//! - Some errors do not end a measurement, such as a missed frame: the sensor stays on.

#[cfg(feature = "async")]
mod asynchronous;
mod blocking;
mod bus;

use embedded_hal::digital::OutputPin;
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};

use crate::enable::Enable;
use crate::timer::Since;
use crate::{PhotonSink, Polled, ReleaseError, SensorInfo};

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

    /// Whether the sensor measures.
    fn is_measuring(&self) -> bool;

    /// Whether the next request drives ENABLE low.
    fn is_reset_next(&self) -> bool;

    /// Abandons the present measurement; the next requests begin again.
    fn restart(&mut self);

    /// ENABLE was driven low. Abandons the present measurement; the next requests begin with a reset.
    fn reset(&mut self);

    /// A transfer was begun and its future dropped, so that the sensor may have executed it. Begins
    /// again, unless the transfer can be repeated. What is lost is counted.
    fn dropped(&mut self);

    /// The command that stops the sensor, if it may measure. Restarts the protocol.
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

/// What came of a command, if there was one.
type Sent<B, P> = Option<Result<(), Failure<B, P>>>;

/// What the sensor is to do.
#[derive(Clone, Copy, Debug)]
enum Power {
    /// To be off, and it is as far as a driver can know.
    Off,
    /// To be off. Each poll tells it again; the first of these polls was then.
    Stopping { since: Option<Since> },
    /// To measure.
    On,
}

impl Power {
    const STOPPING: Self = Self::Stopping { since: None };
}

/// A sensor that ENABLE has switched off does not acknowledge a stop. One whose ENABLE is not wired does, unless the bus is
/// disturbed: each poll tries again for so many milliseconds.
const UNANSWERED_MS: u32 = 100;

/// A sensor's protocol on a bus, with INT and ENABLE. The [module](self) says when the sensor is off.
///
/// The driver owns INT. Nothing else may wait for the same pin.
#[derive(Debug)]
pub struct Driver<P, BUS, INT, EN: OutputPin> {
    protocol: P,
    bus: BUS,
    interrupt: INT,
    enable: Enable<EN>,
    power: Power,
}

impl<P: Protocol, BUS, INT, EN: OutputPin> Driver<P, BUS, INT, EN> {
    /// The description for a host. The `Config` of the sensor has the same as a constant.
    pub fn info(&self) -> SensorInfo {
        self.protocol.info()
    }

    /// Whether the sensor measures.
    pub fn is_measuring(&self) -> bool {
        self.protocol.is_measuring()
    }

    /// Begins to measure with the next poll, and abandons the present measurement.
    fn switch_on(&mut self) {
        self.protocol.restart();
        self.power = Power::On;
    }

    /// What came of a stop: of ENABLE, and of the command if there was one. `now_ms` is that of a poll.
    fn switched_off<B>(
        &mut self,
        now_ms: Option<u32>,
        low: Result<(), EN::Error>,
        sent: Sent<B, EN::Error>,
    ) -> Result<Polled, Failure<B, EN::Error>> {
        let Power::Stopping { since } = &mut self.power else {
            return Ok(Polled::Idle);
        };
        let began = now_ms.map(|now_ms| (*since.get_or_insert(Since::new(now_ms)), now_ms));
        low.map_err(Failure::Pin)?;
        match sent {
            None | Some(Ok(())) => self.power = Power::Off,
            Some(Err(Failure::Nack(_))) => {
                if began.is_some_and(|(since, now_ms)| since.is_over(UNANSWERED_MS, now_ms)) {
                    self.power = Power::Off;
                }
            }
            Some(Err(failure)) => return Err(failure),
        }
        Ok(Polled::Idle)
    }

    /// Drives ENABLE low. If the pin fails, the next poll begins with it.
    fn drive_low(&mut self) {
        let _ = self.enable.set(false);
        self.protocol.reset();
    }
}

impl<P, BUS, INT, EN: OutputPin> Driver<P, BUS, INT, EN> {
    pub(crate) const fn of(protocol: P, bus: BUS, interrupt: INT, enable: EN) -> Self {
        Self {
            protocol,
            bus,
            interrupt,
            enable: Enable::new(enable),
            power: Power::STOPPING,
        }
    }

    pub(crate) const fn protocol(&self) -> &P {
        &self.protocol
    }

    /// Whether the last stop may not have reached the sensor. Each poll tries again.
    pub const fn is_stopping(&self) -> bool {
        matches!(self.power, Power::Stopping { .. })
    }

    /// Drives ENABLE low, and gives the bus and the pins (INT, ENABLE) back.
    ///
    /// # Errors
    /// Fails if ENABLE does; the error has the bus and the pins.
    pub fn release(self) -> Result<(BUS, INT, EN), ReleaseError<BUS, INT, EN>> {
        self.enable.release(self.bus, self.interrupt)
    }
}
