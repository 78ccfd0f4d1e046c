//! Pins and buses with anything behind them: they answer any bytes, or fail.

use core::future::poll_fn;
use core::task::Poll;

use dtof_core::PixelAddress;
use dtof_sensors::{PhotonSink, Target};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::i2c::{self, NoAcknowledgeSource};
use embedded_hal::spi;

use crate::values::{byte, keep, more};

/// A pin, a bus with one device, and a timer.
pub struct Device;

fn pin() -> Result<(), digital::ErrorKind> {
    done(digital::ErrorKind::Other)
}

fn done<E>(error: E) -> Result<(), E> {
    if more() { Ok(()) } else { Err(error) }
}

fn fill(bytes: &mut [u8]) {
    bytes.iter_mut().for_each(|place| *place = byte());
}

impl digital::ErrorType for Device {
    type Error = digital::ErrorKind;
}

impl InputPin for Device {
    fn is_high(&mut self) -> Result<bool, digital::ErrorKind> {
        pin().map(|()| more())
    }

    fn is_low(&mut self) -> Result<bool, digital::ErrorKind> {
        self.is_high()
    }
}

impl OutputPin for Device {
    fn set_low(&mut self) -> Result<(), digital::ErrorKind> {
        pin()
    }

    fn set_high(&mut self) -> Result<(), digital::ErrorKind> {
        pin()
    }
}

impl DelayNs for Device {
    fn delay_ns(&mut self, ns: u32) {
        keep(ns);
    }
}

impl i2c::ErrorType for Device {
    type Error = i2c::ErrorKind;
}

impl i2c::I2c for Device {
    fn transaction(
        &mut self,
        address: u8,
        operations: &mut [i2c::Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        keep(address);
        for operation in operations {
            match operation {
                i2c::Operation::Read(bytes) => fill(bytes),
                i2c::Operation::Write(bytes) => keep(*bytes),
            }
        }
        done(if more() {
            i2c::ErrorKind::Bus
        } else {
            i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
        })
    }
}

impl spi::ErrorType for Device {
    type Error = spi::ErrorKind;
}

impl spi::SpiDevice for Device {
    fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        for operation in operations {
            match operation {
                spi::Operation::Read(bytes) | spi::Operation::TransferInPlace(bytes) => fill(bytes),
                spi::Operation::Write(bytes) => keep(*bytes),
                spi::Operation::Transfer(read, written) => {
                    keep(*written);
                    fill(read);
                }
                spi::Operation::DelayNs(ns) => keep(*ns),
            }
        }
        done(spi::ErrorKind::Other)
    }
}

/// Ready at once, later or never.
async fn ready<T>(output: impl Fn() -> T) -> T {
    poll_fn(|_| {
        if more() {
            Poll::Ready(output())
        } else {
            Poll::Pending
        }
    })
    .await
}

impl embedded_hal_async::digital::Wait for Device {
    async fn wait_for_high(&mut self) -> Result<(), digital::ErrorKind> {
        ready(pin).await
    }

    async fn wait_for_low(&mut self) -> Result<(), digital::ErrorKind> {
        ready(pin).await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), digital::ErrorKind> {
        ready(pin).await
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), digital::ErrorKind> {
        ready(pin).await
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), digital::ErrorKind> {
        ready(pin).await
    }
}

impl embedded_hal_async::delay::DelayNs for Device {
    async fn delay_ns(&mut self, ns: u32) {
        ready(|| keep(ns)).await;
    }
}

impl embedded_hal_async::i2c::I2c for Device {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [i2c::Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        ready(|| ()).await;
        i2c::I2c::transaction(self, address, operations)
    }
}

impl embedded_hal_async::spi::SpiDevice for Device {
    async fn transaction(
        &mut self,
        operations: &mut [spi::Operation<'_, u8>],
    ) -> Result<(), spi::ErrorKind> {
        ready(|| ()).await;
        spi::SpiDevice::transaction(self, operations)
    }
}

/// Takes what sensors give.
pub struct Sink;

impl PhotonSink for Sink {
    fn photon(&mut self, pixel: PixelAddress, code: u16) {
        keep((pixel, code));
    }

    fn end_laser_cycles(&mut self, cycles: u16) {
        keep(cycles);
    }

    fn begin_frame(&mut self, cycles: u32) {
        keep(cycles);
    }

    fn histogram(&mut self, pixel: PixelAddress, counts: &[u32; 128]) {
        keep((pixel, counts));
    }

    fn target(&mut self, pixel: PixelAddress, target: &Target) {
        keep((pixel, target));
    }
}
