//! INT of the chip for drivers that wait for it.

use std::future::poll_fn;
use std::task::Poll;

use embedded_hal::digital::InputPin;
use embedded_hal_async::digital::Wait;

use crate::common::Broken;
use crate::common::tmf8829::bus::Bus;

/// INT goes low when the chip does: each look is one of the test's milliseconds.
impl Wait for Bus {
    async fn wait_for_low(&mut self) -> Result<(), Broken> {
        poll_fn(|_| match self.is_low() {
            Ok(false) => Poll::Pending,
            low => Poll::Ready(low.map(drop)),
        })
        .await
    }
    async fn wait_for_high(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_rising_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_falling_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
    async fn wait_for_any_edge(&mut self) -> Result<(), Broken> {
        unreachable!("nothing waits for it")
    }
}
