//! A protocol over embedded-hal-async.

use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal_async::i2c::I2c;

use super::{Done, Driver, Failure, Protocol, Request};
use crate::{PhotonSink, Polled};

impl<P, I2C, INT, EN> Driver<P, I2C, INT, EN>
where
    P: Protocol,
    I2C: I2c,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// [`Sensor::poll`](crate::Sensor::poll) that awaits its transfers: the same ones, in the same
    /// order. It awaits nothing else. After a poll that is [`Polled::Idle`] await an edge of
    /// INT or a millisecond, whichever comes first.
    ///
    /// The future may be dropped. If it is dropped within a transfer, the state of the sensor is
    /// unknown, and the next poll begins to bring it up again.
    ///
    /// # Errors
    /// Fails if this step fails. The next polls bring the sensor up again.
    pub async fn poll_async(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<I2C::Error, INT::Error>> {
        if core::mem::replace(&mut self.is_under_way, true) {
            self.protocol.restart();
        }
        let polled = self.step_async(now_ms, sink).await;
        self.is_under_way = false;
        polled.inspect_err(|error| self.protocol.failed(error))
    }

    /// Starts with a new configuration: abandons the present measurement.
    pub fn start_async(&mut self) {
        self.protocol.restart();
    }

    /// Drives ENABLE low, and also sends the command to stop, as ENABLE may not be wired. Errors are
    /// ignored.
    pub async fn stop_async(&mut self) {
        // Before the first await: a dropped future has stopped the sensor all the same.
        let _ = self.enable.set_low();
        if let Request::Write { address, bytes } = self.protocol.stop() {
            let _ = self.i2c.write(address, bytes).await;
        }
    }

    async fn transfer_async(
        &mut self,
        now_ms: u32,
    ) -> Result<Done, Failure<I2C::Error, INT::Error>> {
        match self.protocol.request(now_ms) {
            Request::Nothing(polled) => return Ok(Done::Over(polled)),
            Request::Interrupt => {
                let level = self.interrupt.is_high();
                return level.map(Done::Level).map_err(Failure::Pin);
            }
            Request::Enable(high) => {
                let set = self.enable.set_state(high.into());
                set.map_err(Failure::Pin)?;
            }
            Request::Write { address, bytes } => {
                let written = self.i2c.write(address, bytes).await;
                written.map_err(Failure::of_bus)?;
            }
            Request::Read {
                address,
                register,
                bytes,
            } => {
                let read = self.i2c.write_read(address, &[register], bytes).await;
                read.map_err(Failure::of_bus)?;
            }
        }
        Ok(Done::Level(false))
    }

    async fn step_async(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<I2C::Error, INT::Error>> {
        loop {
            match self.transfer_async(now_ms).await? {
                Done::Over(polled) => return Ok(polled),
                Done::Level(is_high) => {
                    if let Some(polled) = self.protocol.answered(is_high, now_ms, sink)? {
                        return Ok(polled);
                    }
                }
            }
        }
    }
}
