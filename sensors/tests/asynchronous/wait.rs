//! What drivers wait for: INT of the chip, and a clock.

use std::cell::Cell;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

use embedded_hal::digital::InputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::digital::Wait;

use crate::common::Broken;
use crate::common::bus::{Bus, Lit};

/// A timer of a clock that the test turns, in milliseconds.
#[derive(Clone)]
pub struct Timer(pub Rc<Cell<u32>>);

impl DelayNs for Timer {
    async fn delay_ns(&mut self, ns: u32) {
        let end = self.0.get().wrapping_add(ns.div_ceil(1_000_000));
        poll_fn(|_| match end.wrapping_sub(self.0.get()) {
            0 | 0x8000_0000.. => Poll::Ready(()),
            _ => Poll::Pending,
        })
        .await;
    }
}

/// INT goes low when the chip does: each look is one of the test's milliseconds.
impl<C: Lit> Wait for Bus<C> {
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
