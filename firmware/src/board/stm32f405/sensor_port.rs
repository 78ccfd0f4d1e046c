//! Where a sensor is connected.
//!
//! | pin | TDC7200 | TMF8820/21/28, TMF8829 | TMF8829 over SPI |
//! |---|---|---|---|
//! | PC6 | ENABLE | EN | EN |
//! | PC8 | INTB | INT | INT |
//! | PB12 | CSB | | CSN |
//! | PB13 | SCLK | | SCLK |
//! | PB14 | DOUT | | MISO |
//! | PB15 | DIN | | MOSI |
//! | PA8 | | SCL | |
//! | PC9 | | SDA | |
//! | 3V | VDD | VDD; of a TMF8829 also CSN | VDD, SCL |
//! | GND | GND | GND; of a TMF8829 also SCLK, MOSI, MISO | GND, SDA |
//!
//! All at the board's 3 V. PC8 and PB14 are pulled up in the controller, and so are
//! PA8 and PC9, but too weakly for 400 kHz: the bus needs resistors of 1 to 4.7 kΩ, which
//! most modules have. PB12 to PB15 serve SPI2. Its clock is the controller's own, and no device can hold
//! it, so a byte always ends after 8 clocks.

use cortex_m::peripheral::SYST;
use dtof_core::fixed::types::U16F16;
use dtof_core::{PixelAddress, checked};
use embedded_hal::spi::SpiDevice;
use embedded_hal_bus::spi::ExclusiveDevice;
use stm32f4xx_hal::gpio::{Input, OpenDrain, Output, Pin, Pull, Speed};
use stm32f4xx_hal::pac::SPI2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::spi::{Mode, Phase, Polarity};

use crate::board::systick::SystickDelay;
use dtof_sensors::Sensor;
use dtof_sensors::i2c::SoftwareI2c;
use dtof_sensors::tdc7200::{self, Tdc7200};
use dtof_sensors::tmf882x::{self, Tmf882x};
use dtof_sensors::tmf8829::{self, Tmf8829};

/// The pins of a sensor. One sensor takes them all.
pub struct SensorPort {
    pub(super) rcc: Rcc,
    pub(super) enable: Pin<'C', 6, Output>,
    pub(super) interrupt: Pin<'C', 8, Input>,
    pub(super) spi: SPI2,
    pub(super) cs: Pin<'B', 12, Output>,
    pub(super) sck: Pin<'B', 13>,
    pub(super) miso: Pin<'B', 14>,
    pub(super) mosi: Pin<'B', 15>,
    pub(super) scl: Pin<'A', 8, Output<OpenDrain>>,
    pub(super) sda: Pin<'C', 9, Output<OpenDrain>>,
}

impl SensorPort {
    /// SPI2 at 10.5 MHz in mode 0, with its chip select high, and then INT and ENABLE.
    fn on_spi(mut self) -> (impl SpiDevice, Pin<'C', 8, Input>, Pin<'C', 6, Output>) {
        const MODE_0: Mode = Mode {
            polarity: Polarity::IdleLow,
            phase: Phase::CaptureOnFirstTransition,
        };
        // Slow edges would cost the last bit of a byte. With nothing connected the
        // bus reads as ones.
        let fast = Speed::VeryHigh;
        let pins = (
            Some(self.sck.into_alternate::<5>().speed(fast)),
            Some(self.miso.into_alternate().internal_resistor(Pull::Up)),
            Some(self.mosi.into_alternate().speed(fast)),
        );
        // A quarter of 42 MHz; without the PLL half of 16 MHz.
        let bus = self.spi.spi(pins, MODE_0, 11.MHz(), &mut self.rcc);
        let Ok(device) = ExclusiveDevice::new_no_delay(bus, self.cs);
        (device, self.interrupt, self.enable)
    }

    /// A TDC7200 with a clock of 8 MHz, on SPI2 at 10.5 MHz: one stop a
    /// measurement, rising edges. Bin 0 starts 12 ns after START, the least it can
    /// measure. Its photons are those of pixel 0.
    #[must_use]
    pub fn tdc7200(self) -> impl Sensor {
        const CONFIG: tdc7200::Config = checked!(tdc7200::Config::new(tdc7200::Settings {
            // A bin that can never hold a photon would be taken for one without
            // background.
            first_bin_ps: 12_000,
            // 500 ns, if a turn of the ring oscillator takes 3.5.
            overflow: 143,
            // A bit that is lost on the way is an error, not another depth.
            parity: true,
            ..tdc7200::Settings::new(PixelAddress::new(0), 8_000, U16F16::lit("250"))
        }));
        let (device, interrupt, enable) = self.on_spi();
        Tdc7200::<_, _, _>::new(device, interrupt, enable, CONFIG)
    }

    /// A TMF8820, TMF8821 or TMF8828 on an I²C bus of 400 kHz, map 1. Its nine
    /// zones are pixels 0 to 8, or with the feature `sensor-tmf8828-8x8` its 64 zones
    /// pixels 0 to 63. `image` is the vendor's.
    #[must_use]
    pub fn tmf882x(self, image: &'static [u8]) -> impl Sensor {
        const SETTINGS: tmf882x::Settings = if cfg!(feature = "sensor-tmf8828-8x8") {
            tmf882x::Settings::of_8x8(PixelAddress::new(0))
        } else {
            tmf882x::Settings::new(PixelAddress::new(0))
        };
        const CONFIG: tmf882x::Config = checked!(tmf882x::Config::new(SETTINGS));
        // The timer runs since the board has started.
        let delay = SystickDelay::new(SYST::get_current, self.rcc.clocks.hclk().raw());
        let bus = SoftwareI2c::new(self.scl, self.sda, delay);
        Tmf882x::<_, _, _>::new(bus, self.interrupt, self.enable, image, CONFIG)
    }

    /// A TMF8829 on the same bus: 16×16 zones, which are pixels 0 to 255, each with a histogram
    /// in some 1.3 s. `image` is the vendor's.
    #[must_use]
    pub fn tmf8829(self, image: &'static [u8]) -> impl Sensor {
        const CONFIG: tmf8829::Config = checked!(tmf8829::Config::new(tmf8829::Settings::new(
            PixelAddress::new(0),
            tmf8829::Zones::Z16x16
        )));
        let delay = SystickDelay::new(SYST::get_current, self.rcc.clocks.hclk().raw());
        let bus = SoftwareI2c::new(self.scl, self.sda, delay);
        Tmf8829::<_, _, _>::new(bus, self.interrupt, self.enable, image, CONFIG)
    }

    /// A TMF8829 over SPI2 at 10.5 MHz: the same zones and pixels, each with a histogram in some
    /// 0.15 s. `image` is the vendor's.
    #[must_use]
    pub fn tmf8829_over_spi(self, image: &'static [u8]) -> impl Sensor {
        // The sensor waits while it is read: 32 ms for its pulses, 60 for the bus with the pauses between bytes, 30
        // for decoding and decisions, computed from instructions. The rest is reserve.
        const PERIOD_MS: u16 = 150;
        const CONFIG: tmf8829::Config = checked!(tmf8829::Config::new(tmf8829::Settings {
            period_ms: PERIOD_MS,
            data_timeout_ms: PERIOD_MS as u32 + 1000,
            ..tmf8829::Settings::over_spi(PixelAddress::new(0), tmf8829::Zones::Z16x16)
        }));
        let (device, interrupt, enable) = self.on_spi();
        let bus = tmf8829::Spi(device);
        Tmf8829::<_, _, _>::new(bus, interrupt, enable, image, CONFIG)
    }
}
