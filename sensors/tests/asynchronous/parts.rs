//! The drivers that are awaited.

use std::cell::Cell;
use std::rc::Rc;

use dtof_chips::{Tmf882x as NineChip, Tmf8829 as TmfChip};
use dtof_sensors::protocol::{Driver, Protocol};
use dtof_sensors::tmf882x::Tmf882xProtocol;
use dtof_sensors::tmf8829::{Interface, Tmf8829Protocol};
use dtof_sensors::{Polled, SensorFault};
use embedded_hal::i2c::ErrorKind;

use crate::common::bus::{Bus, IMAGE, Lit};
use crate::common::part::{Driven, Part, config_8829, config_nine, driven};
use crate::common::{Broken, RecordingSink};
use crate::transfers::{Clocked, Slow, drop_after, run_at, timing};

const BUS_MS: u32 = 50;

pub type On<P, C> = Driver<P, Slow<Bus<C>>, Bus<C>, Bus<C>>;

/// A driver with its time.
pub struct Awaited<P: Protocol, C: Lit> {
    pub driver: On<P, C>,
    pub timing: Clocked,
    pub clock: Rc<Cell<u32>>,
    left: Rc<Cell<Option<u32>>>,
}

impl<P, C> Part for Awaited<P, C>
where
    P: Protocol<Error<ErrorKind, Broken>: Into<SensorFault>>,
    C: Lit,
    On<P, C>: Driven<Chip = C, Bus = Slow<Bus<C>>>,
{
    type Driver = On<P, C>;
    fn on(bus: &Bus<C>) -> Self {
        let slow = Slow::new(bus.clone());
        let (clock, timing) = timing(BUS_MS);
        Self {
            left: Rc::clone(&slow.left),
            driver: Driven::new(slow, bus),
            timing,
            clock,
        }
    }
    fn driver(&self) -> &Self::Driver {
        &self.driver
    }
    fn into_driver(self) -> Self::Driver {
        self.driver
    }
    fn start(&mut self) {
        self.driver.start_async();
    }
    fn stop(&mut self) {
        run_at(&self.clock, self.driver.stop_async(&mut self.timing));
    }
    fn is_stopping(&self) -> bool {
        self.driver.is_stopping()
    }
    fn poll(&mut self, now_ms: u32, sink: &mut RecordingSink) -> Result<Polled, SensorFault> {
        self.clock.set(now_ms);
        let poll = self.driver.poll_within(&mut self.timing, sink);
        run_at(&self.clock, poll).0.map_err(Into::into)
    }
    fn drop_stop(&mut self, polls: u32) {
        drop_after(self.driver.stop_async(&mut self.timing), polls);
    }
    fn drop_poll(
        &mut self,
        now_ms: u32,
        sink: &mut RecordingSink,
        polls: u32,
    ) -> Option<Result<Polled, SensorFault>> {
        let polled = drop_after(self.driver.poll_async(now_ms, sink), polls)?;
        Some(polled.map_err(Into::into))
    }
    fn hang(&self, after: Option<u32>) {
        self.left.set(after);
    }
}

pub type Of8829 = Awaited<Tmf8829Protocol<'static, 252>, TmfChip>;
pub type OfNine = Awaited<Tmf882xProtocol<'static>, NineChip>;

driven! {
    On<Tmf8829Protocol<'static, 252>, TmfChip>, Slow<Bus<TmfChip>>, TmfChip, is_measuring, Some(32),
    (IMAGE, config_8829(Interface::I2c { address: 0x41 }))
}
// It is trusted as soon as it measures.
driven! {
    On<Tmf882xProtocol<'static>, NineChip>, Slow<Bus<NineChip>>, NineChip, is_measuring, Some(0),
    (IMAGE, config_nine())
}

/// The test of each driver.
macro_rules! each {
    ($of:ident) => {
        $of::<$crate::parts::Of8829>();
        $of::<$crate::parts::OfNine>();
    };
}
pub(crate) use each;
