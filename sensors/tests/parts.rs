//! The drivers that block.

use dtof_chips::{Tdc7200 as TdcChip, Tmf882x as NineChip, Tmf8829 as TmfChip};
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::tdc7200::{Config, Tdc7200};
use dtof_sensors::tmf882x::Tmf882x;
use dtof_sensors::tmf8829::{Interface, Spi, Tmf8829};
use dtof_sensors::{Polled, Sensor, SensorFault};

use crate::common::bus::{Bus, IMAGE, On};
use crate::common::part::{ChipOf, Driven, Part, config_8829, config_nine, driven};
use crate::common::tdc7200::mode_1;
use crate::common::{Broken, RecordingSink};

/// A driver on a bus that is made of the wires.
pub struct Blocking<D>(D);

impl<D> Part for Blocking<D>
where
    D: Driven<Bus: On<D::Chip>> + Sensor<Error: Into<SensorFault>>,
{
    type Driver = D;
    fn on(bus: &Bus<ChipOf<Self>>) -> Self {
        Self(D::new(D::Bus::on(bus), bus))
    }
    fn driver(&self) -> &D {
        &self.0
    }
    fn into_driver(self) -> D {
        self.0
    }
    fn start(&mut self) {
        self.0.start(U16F16::lit("250"), Dither::OFF);
    }
    fn stop(&mut self) {
        self.0.stop();
    }
    fn is_stopping(&self) -> bool {
        Sensor::is_stopping(&self.0)
    }
    fn poll(&mut self, now_ms: u32, sink: &mut RecordingSink) -> Result<Polled, SensorFault> {
        self.0.poll(now_ms, sink).map_err(Into::into)
    }
}

type Of8829<B, const CHUNK: usize> = Tmf8829<'static, B, Bus<TmfChip>, Bus<TmfChip>, CHUNK>;
pub type I2c8829 = Of8829<Bus<TmfChip>, 252>;
pub type Spi8829 = Of8829<Spi<Bus<TmfChip>>, 252>;
/// Another chunk, so that it is another type.
pub type Own8829 = Of8829<Bus<TmfChip>, 248>;
pub type Nine = Tmf882x<'static, Bus<NineChip>, Bus<NineChip>, Bus<NineChip>>;
pub type Tdc = Tdc7200<Bus<TdcChip>, Bus<TdcChip>, Bus<TdcChip>>;

driven! {
    I2c8829, Bus<TmfChip>, TmfChip, is_measuring, Some(32),
    (IMAGE, config_8829(Interface::I2c { address: 0x41 }))
}
driven! {
    Spi8829, Spi<Bus<TmfChip>>, TmfChip, is_measuring, Some(32),
    (IMAGE, config_8829(Interface::Spi)), HAS_NACK: bool = false
}
// A reset gives it back the address 0x41, where a stop does not reach it if ENABLE is not wired.
driven! {
    Own8829, Bus<TmfChip>, TmfChip, is_measuring, Some(32),
    (IMAGE, config_8829(Interface::I2c { address: 0x42 })), WIRED: &'static [bool] = &[true]
}
// It is trusted as soon as it measures.
driven! { Nine, Bus<NineChip>, NineChip, is_measuring, Some(0), (IMAGE, config_nine()) }
driven! {
    Tdc, Bus<TdcChip>, TdcChip, is_armed, None, (Config::new(mode_1()).unwrap()),
    WIRED: &'static [bool] = &[true], HAS_NACK: bool = false
}

/// The test of each driver.
macro_rules! each {
    ($of:ident) => {{
        use $crate::parts::*;
        $of::<Blocking<I2c8829>>();
        $of::<Blocking<Spi8829>>();
        $of::<Blocking<Own8829>>();
        $of::<Blocking<Nine>>();
        $of::<Blocking<Tdc>>();
    }};
}
pub(crate) use each;
