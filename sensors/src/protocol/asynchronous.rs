//! A protocol over embedded-hal-async.

use core::future::poll_fn;
use core::pin::pin;
use core::task::Poll;

use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::digital::Wait;

use super::{AsyncBus, Done, Driver, Failure, Power, Protocol, Request, Sent};
use crate::{PhotonSink, Polled};

/// Time for a driver: the clock, a timer, and how long the bus may take.
#[derive(Clone, Debug)]
pub struct Timing<N, D> {
    now_ms: N,
    delay: D,
    bus_ms: u32,
}

impl<N: FnMut() -> u32, D: DelayNs> Timing<N, D> {
    /// `now_ms` returns milliseconds, which may wrap. `bus_ms` is the most that a poll may take. It has to
    /// cover the longest poll of the sensor: a chunk, or ten short transfers. 100 is enough at 100 kHz.
    ///
    /// The time also runs while the poll waits for a bus that others use, and while the executor runs
    /// other tasks: add the longest of both.
    pub const fn new(now_ms: N, delay: D, bus_ms: u32) -> Self {
        Self {
            now_ms,
            delay,
            bus_ms,
        }
    }
}

/// The output of the future that is ready first, or of the first one if both are.
async fn race<A, B>(
    first: impl Future<Output = A>,
    second: impl Future<Output = B>,
) -> Result<A, B> {
    let (mut first, mut second) = (pin!(first), pin!(second));
    poll_fn(|context| {
        if let Poll::Ready(done) = first.as_mut().poll(context) {
            return Poll::Ready(Ok(done));
        }
        second.as_mut().poll(context).map(Err)
    })
    .await
}

impl<P, BUS, INT, EN> Driver<P, BUS, INT, EN>
where
    P: Protocol,
    BUS: AsyncBus,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// Polls until the sink has been given photons or a histogram. Between polls it waits for INT to go
    /// low or for a millisecond, whichever comes first.
    ///
    /// The future may be dropped, as with [`Self::poll_async`]. While it waits for INT nothing is lost.
    ///
    /// Call [`Self::start_async`] first: a driver that was not started waits without end.
    ///
    /// # Errors
    /// Fails if a poll fails, or if the bus takes longer than `bus_ms` ([`Failure::BusTimeout`]). Call it
    /// again: the next polls bring the sensor up again.
    pub async fn next(
        &mut self,
        timing: &mut Timing<impl FnMut() -> u32, impl DelayNs>,
        sink: &mut impl PhotonSink,
    ) -> Result<(), P::Error<BUS::Error, INT::Error>>
    where
        INT: Wait,
    {
        loop {
            match self.poll_within(timing, sink).await? {
                Polled::Data => return Ok(()),
                Polled::Working => {}
                Polled::Idle => {
                    let waited = self.wait(&mut timing.delay).await;
                    waited.map_err(|error| self.fail(Failure::Pin(error)))?;
                }
            }
        }
    }

    /// Waits a millisecond, or until INT goes low.
    async fn wait(&mut self, delay: &mut impl DelayNs) -> Result<(), INT::Error>
    where
        INT: Wait,
    {
        // It is low for no reason, or the sensor is not up.
        if self.interrupt.is_low()? {
            delay.delay_ms(1).await;
            return Ok(());
        }
        let waited = race(self.interrupt.wait_for_low(), delay.delay_ms(1)).await;
        waited.unwrap_or(Ok(()))
    }

    /// [`Self::poll_async`] that takes at most `bus_ms` milliseconds of the timer. It cannot end a
    /// bus whose futures block.
    ///
    /// A transfer that takes too long is dropped, as it is when the caller drops a poll. The bus has to
    /// end it then. The `Twim` of embassy-nrf does not: its DMA may write to the driver's buffer later.
    /// With such a bus, do not move or drop the driver after a drop, and reset the bus before the
    /// next poll, or the board.
    ///
    /// # Errors
    /// Fails if the poll fails or takes longer ([`Failure::BusTimeout`]). The next polls bring the sensor
    /// up again.
    pub async fn poll_within(
        &mut self,
        timing: &mut Timing<impl FnMut() -> u32, impl DelayNs>,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<BUS::Error, INT::Error>> {
        let now_ms = (timing.now_ms)();
        let limit = timing.delay.delay_ms(timing.bus_ms);
        match race(self.poll_async(now_ms, sink), limit).await {
            Ok(polled) => polled,
            Err(()) => Err(self.fail(Failure::BusTimeout)),
        }
    }

    /// A failure after which the bus is not tried again.
    fn fail(
        &mut self,
        failure: Failure<BUS::Error, INT::Error>,
    ) -> P::Error<BUS::Error, INT::Error> {
        let error = failure.into();
        self.protocol.failed(&error);
        self.drive_low();
        error
    }

    /// [`Sensor::poll`](crate::Sensor::poll) that awaits its transfers: the same ones, in the same
    /// order. It awaits nothing else, and as long as the bus does. [`Self::next`] calls it as often as
    /// needed.
    ///
    /// The future may be dropped. If it is dropped within a transfer of a frame, the frame is lost and
    /// counted, ENABLE goes low, and the next poll begins to bring the sensor up again. Elsewhere the next poll goes on,
    /// so the sensor stays on: if you drop a future for good, as `select` does, stop or drop the driver. A frame that
    /// the sensor has ready when it is stopped is not given and not counted.
    ///
    /// # Errors
    /// Fails if this step fails. The next polls bring the sensor up again.
    pub async fn poll_async(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<BUS::Error, INT::Error>> {
        let mut call = Call {
            driver: self,
            is_over: false,
        };
        let polled = call.driver.polled(now_ms, sink).await;
        call.is_over = true;
        polled
    }

    async fn polled(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<BUS::Error, INT::Error>> {
        let polled = match self.power {
            Power::Off => return Ok(Polled::Idle),
            Power::Stopping { .. } => self
                .switch_off_async(Some(now_ms))
                .await
                .map_err(P::Error::from),
            Power::On => self.step_async(now_ms, sink).await,
        };
        if let Err(error) = &polled {
            self.protocol.failed(error);
            if matches!(self.power, Power::On) && !self.protocol.is_measuring() {
                self.stop_after_error_async().await;
            }
        }
        polled
    }

    /// Begins to measure with the next poll. Abandons the present measurement.
    pub fn start_async(&mut self) {
        self.switch_on();
    }

    /// Drives ENABLE low, and also sends the command to stop, as ENABLE may not be wired. It takes at most
    /// `bus_ms` milliseconds of the timer. If it fails, or is dropped once it has begun, each poll tries again
    /// ([`Self::is_stopping`]).
    pub async fn stop_async(&mut self, timing: &mut Timing<impl FnMut() -> u32, impl DelayNs>) {
        self.power = Power::STOPPING;
        let limit = timing.delay.delay_ms(timing.bus_ms);
        let failure = match race(self.switch_off_async(None), limit).await {
            Ok(Ok(_)) => return,
            Ok(Err(failure)) => failure,
            Err(()) => Failure::BusTimeout,
        };
        self.fail(failure);
    }

    /// Sends the command to stop, if there is one.
    async fn send_stop_async(&mut self) -> Sent<BUS::Error, INT::Error> {
        let Request::Write { address, bytes } = self.protocol.stop() else {
            return None;
        };
        Some(self.bus.write(address, bytes).await.map_err(BUS::failure))
    }

    /// As [`Self::stop_async`], without a limit.
    async fn switch_off_async(
        &mut self,
        now_ms: Option<u32>,
    ) -> Result<Polled, Failure<BUS::Error, INT::Error>> {
        // Before the first await: the bus may hang, and the future may be dropped.
        let low = self.enable.set(false);
        self.protocol.reset();
        let sent = self.send_stop_async().await;
        self.switched_off(now_ms, low, sent)
    }

    /// As for a bus that blocks: an error has ended the measurement.
    async fn stop_after_error_async(&mut self) {
        let is_reset = self.protocol.is_reset_next();
        if is_reset {
            self.drive_low();
        }
        if !matches!(self.send_stop_async().await, Some(Ok(()))) && !is_reset {
            self.drive_low();
        }
    }

    async fn transfer_async(
        &mut self,
        now_ms: u32,
    ) -> Result<Done, Failure<BUS::Error, INT::Error>> {
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
                let written = self.bus.write(address, bytes).await;
                written.map_err(BUS::failure)?;
            }
            Request::Read {
                address,
                register,
                bytes,
            } => {
                let read = self.bus.read(address, register, bytes).await;
                read.map_err(BUS::failure)?;
            }
        }
        Ok(Done::Level(false))
    }

    async fn step_async(
        &mut self,
        now_ms: u32,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, P::Error<BUS::Error, INT::Error>> {
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

/// A poll that may be dropped.
struct Call<'a, P: Protocol, BUS, INT, EN: OutputPin> {
    driver: &'a mut Driver<P, BUS, INT, EN>,
    is_over: bool,
}

impl<P: Protocol, BUS, INT, EN: OutputPin> Drop for Call<'_, P, BUS, INT, EN> {
    fn drop(&mut self) {
        if self.is_over {
            return;
        }
        self.driver.protocol.dropped();
        if !self.driver.protocol.is_measuring() {
            self.driver.drive_low();
        }
    }
}
