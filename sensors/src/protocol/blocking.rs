//! A protocol over embedded-hal.

use dtof_core::fixed::types::U16F16;
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};

use super::{Bus, Done, Driver, Failure, Protocol, Request};
use crate::dither::Dither;
use crate::{PhotonSink, Polled, Sensor, SensorFault, SensorInfo};

impl<P, BUS, INT, EN> Driver<P, BUS, INT, EN>
where
    P: Protocol,
    BUS: Bus,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// Executes one request.
    fn transfer(&mut self, now_ms: u32) -> Result<Done, Failure<BUS::Error, INT::Error>> {
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
                let written = self.bus.write(address, bytes);
                written.map_err(BUS::failure)?;
            }
            Request::Read {
                address,
                register,
                bytes,
            } => {
                let read = self.bus.read(address, register, bytes);
                read.map_err(BUS::failure)?;
            }
        }
        Ok(Done::Level(false))
    }

    fn step(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<BUS::Error, INT::Error>> {
        loop {
            match self.transfer(now_ms)? {
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

impl<P, BUS, INT, EN> Sensor for Driver<P, BUS, INT, EN>
where
    P: Protocol,
    P::Error<BUS::Error, INT::Error>: Into<SensorFault>,
    BUS: Bus,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    type Error = P::Error<BUS::Error, INT::Error>;

    fn info(&self) -> SensorInfo {
        self.protocol.info()
    }

    fn start(&mut self, _: U16F16, _: Dither) {
        self.settle();
        self.protocol.restart();
    }

    /// Drives ENABLE low, and also sends the command to stop, as ENABLE may not be wired. Errors are
    /// ignored.
    fn stop(&mut self) {
        let _ = self.enable.set_low();
        self.settle();
        if let Request::Write { address, bytes } = self.protocol.stop() {
            let _ = self.bus.write(address, bytes);
        }
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Self::Error> {
        self.settle();
        self.step(now_ms, sink)
            .inspect_err(|error| self.protocol.failed(error))
    }
}
