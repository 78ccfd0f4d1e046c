//! A protocol over embedded-hal.

use dtof_core::fixed::types::U16F16;
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};

use super::{Bus, Done, Driver, Failure, Power, Protocol, Request, Sent};
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
                let set = self.enable.set(high);
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

    /// Sends the command to stop, if there is one.
    fn send_stop(&mut self) -> Sent<BUS::Error, INT::Error> {
        let Request::Write { address, bytes } = self.protocol.stop() else {
            return None;
        };
        Some(self.bus.write(address, bytes).map_err(BUS::failure))
    }

    /// Drives ENABLE low, and also sends the command to stop, as ENABLE may not be wired.
    fn switch_off(
        &mut self,
        now_ms: Option<u32>,
    ) -> Result<Polled, Failure<BUS::Error, INT::Error>> {
        // First, as the bus may hang.
        let low = self.enable.set(false);
        self.protocol.reset();
        let sent = self.send_stop();
        self.switched_off(now_ms, low, sent)
    }

    /// An error has ended the measurement: stops the sensor now, as the caller may not poll again.
    fn stop_after_error(&mut self) {
        // A sensor that is reset next is not known to work: it may ignore the command, or another firmware may have
        // left it on.
        let is_reset = self.protocol.is_reset_next();
        if is_reset {
            self.drive_low();
        }
        if !matches!(self.send_stop(), Some(Ok(()))) && !is_reset {
            self.drive_low();
        }
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
        self.switch_on();
    }

    /// Drives ENABLE low, and also sends the command to stop, as ENABLE may not be wired.
    fn stop(&mut self) {
        self.power = Power::STOPPING;
        if let Err(failure) = self.switch_off(None) {
            self.protocol.failed(&failure.into());
        }
    }

    fn is_stopping(&self) -> bool {
        Self::is_stopping(self)
    }

    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, Self::Error> {
        let polled = match self.power {
            Power::Off => return Ok(Polled::Idle),
            Power::Stopping { .. } => self.switch_off(Some(now_ms)).map_err(Self::Error::from),
            Power::On => self.step(now_ms, sink),
        };
        if let Err(error) = &polled {
            self.protocol.failed(error);
            if matches!(self.power, Power::On) && !self.protocol.is_measuring() {
                self.stop_after_error();
            }
        }
        polled
    }
}
