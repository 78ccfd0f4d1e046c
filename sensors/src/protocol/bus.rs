//! The buses that a driver takes.

use embedded_hal::i2c::I2c;

use super::Failure;

/// Transfers to a sensor. Every `I2c` of embedded-hal is a bus, and so is
/// [`tmf8829::Spi`](crate::tmf8829::Spi).
pub trait Bus {
    /// The error of a transfer.
    type Error;

    /// Writes `bytes` in one transaction: the register first, then its values.
    ///
    /// # Errors
    /// Fails if the bus does.
    fn write(&mut self, address: u8, bytes: &[u8]) -> Result<(), Self::Error>;

    /// Fills `bytes` from the register on, in one transaction.
    ///
    /// # Errors
    /// Fails if the bus does.
    fn read(&mut self, address: u8, register: u8, bytes: &mut [u8]) -> Result<(), Self::Error>;

    /// What kind of failure an error is.
    fn failure<P>(error: Self::Error) -> Failure<Self::Error, P>;
}

impl<T: I2c> Bus for T {
    type Error = T::Error;

    fn write(&mut self, address: u8, bytes: &[u8]) -> Result<(), T::Error> {
        I2c::write(self, address, bytes)
    }

    fn read(&mut self, address: u8, register: u8, bytes: &mut [u8]) -> Result<(), T::Error> {
        self.write_read(address, &[register], bytes)
    }

    fn failure<P>(error: T::Error) -> Failure<T::Error, P> {
        Failure::of_i2c(error)
    }
}

/// [`Bus`] with transfers that are awaited. Every `I2c` of embedded-hal-async is one.
#[cfg(feature = "async")]
#[allow(
    async_fn_in_trait,
    reason = "as in embedded-hal-async: executors of microcontrollers have one thread"
)]
pub trait AsyncBus {
    /// The error of a transfer.
    type Error;

    /// As [`Bus::write`].
    ///
    /// # Errors
    /// Fails if the bus does.
    async fn write(&mut self, address: u8, bytes: &[u8]) -> Result<(), Self::Error>;

    /// As [`Bus::read`].
    ///
    /// # Errors
    /// Fails if the bus does.
    async fn read(
        &mut self,
        address: u8,
        register: u8,
        bytes: &mut [u8],
    ) -> Result<(), Self::Error>;

    /// What kind of failure an error is.
    fn failure<P>(error: Self::Error) -> Failure<Self::Error, P>;
}

#[cfg(feature = "async")]
impl<T: embedded_hal_async::i2c::I2c> AsyncBus for T {
    type Error = T::Error;

    async fn write(&mut self, address: u8, bytes: &[u8]) -> Result<(), T::Error> {
        embedded_hal_async::i2c::I2c::write(self, address, bytes).await
    }

    async fn read(&mut self, address: u8, register: u8, bytes: &mut [u8]) -> Result<(), T::Error> {
        self.write_read(address, &[register], bytes).await
    }

    fn failure<P>(error: T::Error) -> Failure<T::Error, P> {
        Failure::of_i2c(error)
    }
}
