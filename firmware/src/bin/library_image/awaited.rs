//! The awaited drivers of dtof-sensors.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use dtof_sensors::protocol::{AsyncBus, Driver, Protocol, Timing};
use dtof_sensors::tmf882x::Tmf882x;
use dtof_sensors::tmf8829::{Spi, Tmf8829};

use crate::devices::{Device, Sink};
use crate::sensors::{tmf882x_config, tmf8829_config};
use crate::values::{byte, keep, more, some, values, word};

pub fn all() {
    tmf882x();
    tmf8829();
    tmf8829_spi();
}

#[inline(never)]
fn tmf882x() {
    if let Some(config) = tmf882x_config() {
        let image = &values::<u8, 300>(byte);
        await_all(Tmf882x::<_, _, _>::new(
            Device,
            Device,
            Device,
            some(image),
            config,
        ));
    }
}

#[inline(never)]
fn tmf8829() {
    if let Some(config) = tmf8829_config() {
        let image = &values::<u8, 300>(byte);
        await_all(Tmf8829::<_, _, _>::new(
            Device,
            Device,
            Device,
            some(image),
            config,
        ));
    }
}

#[inline(never)]
fn tmf8829_spi() {
    if let Some(config) = tmf8829_config() {
        let image = &values::<u8, 300>(byte);
        await_all(Tmf8829::<_, _, _>::new(
            Spi(Device),
            Device,
            Device,
            some(image),
            config,
        ));
    }
}

/// Calls what is awaited in any order.
fn await_all<P: Protocol, B: AsyncBus>(mut sensor: Driver<P, B, Device, Device>) {
    let mut timing = Timing::new(word, Device, word());
    while more() {
        if more() {
            sensor.start_async();
        }
        keep(awaited(sensor.next(&mut timing, &mut Sink)).map(|done| done.is_ok()));
        keep(awaited(sensor.poll_within(&mut timing, &mut Sink)).map(|done| done.is_ok()));
        keep(awaited(sensor.poll_async(word(), &mut Sink)).map(|done| done.is_ok()));
        keep(awaited(sensor.stop_async(&mut timing)));
    }
    keep(sensor.is_stopping());
    keep(sensor.release().is_ok());
}

/// The output of a future, or nothing if it is dropped before it is ready.
fn awaited<T>(future: impl Future<Output = T>) -> Option<T> {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    while more() {
        if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
            return Some(output);
        }
    }
    None
}
