//! Any driver beside its chip, whether it blocks or is awaited.

use dtof_core::PixelAddress;
use dtof_sensors::tmf8829::{Interface, Zones};
use dtof_sensors::{Polled, SensorFault, tmf882x, tmf8829};

use super::bus::{Bus, Lit};
use super::tmf8829::bench::settings;
use super::{Broken, RecordingSink, SinkCall};

/// So many polls bring each sensor up and give two frames.
pub const POLLS: u32 = 260;

/// A driver on a bus of any kind.
pub trait Driven: Sized {
    type Chip: Lit;
    type Bus;
    /// After so many histograms of a measurement the driver trusts the sensor to stop when it acknowledges the command.
    /// `None`: it has no such command.
    const TRUSTED: Option<usize>;
    /// Whether ENABLE may be wired or not. Some sensors cannot do without it.
    const WIRED: &'static [bool] = &[true, false];
    /// A stop may be not acknowledged, which is no error.
    const HAS_NACK: bool = true;
    fn new(bus: Self::Bus, pins: &Bus<Self::Chip>) -> Self;
    /// The next poll goes on with the measurement.
    fn measures(&self) -> bool;
    fn errors(&self) -> u32;
    /// Releases it: ENABLE, and its error.
    fn give_back(self) -> (Bus<Self::Chip>, Option<Broken>);
}

pub fn config_8829(interface: Interface) -> tmf8829::Config {
    tmf8829::Config::new(tmf8829::Settings {
        interface,
        ..settings(Zones::Z8x8)
    })
    .unwrap()
}

pub fn config_nine() -> tmf882x::Config {
    tmf882x::Config::new(tmf882x::Settings::new(PixelAddress::new(0))).unwrap()
}

/// The driver, its bus and its chip, whether it measures, when it is trusted, what else its `new` takes, and what differs.
macro_rules! driven {
    (
        $driver:ty, $bus:ty, $chip:ty, $is_measuring:ident, $trusted:expr, ($($more:expr),*)
        $(, $const:ident: $type:ty = $value:expr)*
    ) => {
        impl $crate::common::part::Driven for $driver {
            type Chip = $chip;
            type Bus = $bus;
            const TRUSTED: Option<usize> = $trusted;
            $(const $const: $type = $value;)*
            fn new(bus: $bus, pins: &Bus<$chip>) -> Self {
                Self::new(bus, pins.clone(), pins.clone(), $($more),*)
            }
            fn measures(&self) -> bool {
                self.$is_measuring()
            }
            fn errors(&self) -> u32 {
                self.counts().errors
            }
            fn give_back(self) -> (Bus<$chip>, Option<Broken>) {
                match self.release() {
                    Ok((_, _, enable)) => (enable, None),
                    Err(failed) => {
                        assert_eq!(failed.to_string(), "ENABLE did not go low: Broken");
                        assert!(format!("{failed:?}").contains("error: Broken"));
                        (failed.enable, Some(failed.error))
                    }
                }
            }
        }
    };
}

pub(crate) use driven;

/// A driver that is called, or awaited.
pub trait Part: Sized {
    type Driver: Driven;
    fn on(bus: &Bus<ChipOf<Self>>) -> Self;
    fn driver(&self) -> &Self::Driver;
    fn into_driver(self) -> Self::Driver;
    fn start(&mut self);
    fn stop(&mut self);
    fn is_stopping(&self) -> bool;
    fn poll(&mut self, now_ms: u32, sink: &mut RecordingSink) -> Result<Polled, SensorFault>;

    /// Drops a stop that is not ready after so many polls, if it is awaited.
    fn drop_stop(&mut self, _polls: u32) {
        self.stop();
    }
    /// Likewise a poll.
    fn drop_poll(
        &mut self,
        now_ms: u32,
        sink: &mut RecordingSink,
        _polls: u32,
    ) -> Option<Result<Polled, SensorFault>> {
        Some(self.poll(now_ms, sink))
    }
    /// An awaited bus hangs after so many transfers.
    fn hang(&self, _after: Option<u32>) {}
}

pub type ChipOf<P> = <<P as Part>::Driver as Driven>::Chip;

/// A driver beside its chip.
pub struct Bench<P: Part> {
    pub sensor: P,
    pub bus: Bus<ChipOf<P>>,
    pub sink: RecordingSink,
    pub now_ms: u32,
    /// Histograms of the present measurement.
    histograms: usize,
    /// Up to the last poll it measured, and had given enough of them to be trusted.
    is_trusted: bool,
}

impl<P: Part> Bench<P> {
    /// Not started. The chip may have been left on.
    pub fn new(is_wired: bool, was_on: bool) -> Self {
        let bus = Bus::new(ChipOf::<P>::fresh());
        bus.0.borrow_mut().is_wired = is_wired;
        if was_on {
            bus.0.borrow_mut().chip.leave_on();
        }
        Self {
            sensor: P::on(&bus),
            bus,
            sink: RecordingSink::default(),
            // So that the milliseconds wrap in the middle of it.
            now_ms: u32::MAX - 5,
            histograms: 0,
            is_trusted: false,
        }
    }

    /// Started, and after so many polls.
    pub fn after(polls: u32, is_wired: bool) -> Self {
        let mut bench = Self::new(is_wired, false);
        bench.sensor.start();
        for _ in 0..polls {
            let _ = bench.poll().unwrap();
        }
        bench
    }

    pub fn poll(&mut self) -> Result<Polled, SensorFault> {
        self.look(P::poll)
    }

    /// A poll of some kind, a millisecond later.
    pub fn look<T>(&mut self, poll: impl FnOnce(&mut P, u32, &mut RecordingSink) -> T) -> T {
        self.now_ms = self.now_ms.wrapping_add(1);
        let (before, was_measuring) = (self.sink.0.len(), self.is_measuring());
        let polled = poll(&mut self.sensor, self.now_ms, &mut self.sink);
        let given = self.sink.0[before..].iter();
        let is_histogram = |given: &&SinkCall| matches!(given, SinkCall::Histogram(..));
        self.histograms += given.filter(is_histogram).count();
        self.is_trusted =
            was_measuring && P::Driver::TRUSTED.is_some_and(|first| self.histograms >= first);
        if !self.is_measuring() {
            self.histograms = 0;
        }
        polled
    }

    pub fn is_stopping(&self) -> bool {
        self.sensor.is_stopping()
    }

    pub fn is_measuring(&self) -> bool {
        self.sensor.driver().measures()
    }

    pub fn errors(&self) -> u32 {
        self.sensor.driver().errors()
    }

    pub fn transfers(&self) -> u32 {
        self.bus.0.borrow().transfers
    }

    /// Only here an error may leave it on: the driver trusted it, and it has acknowledged the command to stop and ignored it.
    pub fn may_stay_on(&self) -> bool {
        self.is_trusted && self.bus.0.borrow().has_ignored
    }

    /// It ends its stop within 110 ms. Then it is dark, and nothing is driven or transferred.
    pub fn ends_its_stop(&mut self) {
        let errors = self.errors();
        for _ in 0..110 {
            if self.is_stopping() {
                assert_eq!(self.poll(), Ok(Polled::Idle));
            }
        }
        let before = (self.transfers(), self.bus.0.borrow().driven.len());
        for _ in 0..20 {
            assert!(!self.is_stopping() && self.bus.is_off());
            assert_eq!(self.poll(), Ok(Polled::Idle));
        }
        let after = (self.transfers(), self.bus.0.borrow().driven.len());
        assert_eq!((after, self.errors()), (before, errors));
    }
}
