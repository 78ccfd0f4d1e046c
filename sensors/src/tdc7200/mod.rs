//! TI TDC7200: a time-to-digital converter on SPI that measures the time from
//! START to up to five stops.
//!
//! One measurement is one laser cycle. The driver arms the device, which raises
//! TRIGG; the laser fires and gives START; each stop is a photon, whose bin is
//! `(time - first_bin_ps) / bin_width`, rounded down. The driver passes on a bin past the histogram
//! unchanged, and the pixel counts it as rejected. When a counter
//! overflows before all stops have come the photons are those that came; a
//! laser cycle without any is counted as empty.
//!
//! # Where the numbers come from
//!
//! Addresses, the fields of CONFIG1, CONFIG2, `INT_STATUS` and `INT_MASK` and their
//! values after reset: data sheet SNAS647D, section 8.6 "Register Maps". The
//! formulas and their example: section 8.4.2. `START_MEAS` clears the results, so
//! a result of 0 is a stop that did not come: description of CONFIG1. SPI: mode
//! 0, at most 20 MHz.
//!
//! # Its clock
//!
//! All times are fractions of the reference clock, and no other clock checks it: a clock
//! that is 2 % faster than [`Settings::clock_khz`] makes every time, and every range, 2 % too
//! long, and a slower one too short. The calibration corrects the chip's own oscillator, not the
//! clock. A crystal oscillator of 50 ppm adds 0.05 mm a metre; an RC oscillator is not good enough.
//!
//! # Wiring
//!
//! CSB belongs to the `SpiDevice`. ENABLE is an output; INTB is an input with a pull-up; TRIGG goes to the laser
//! driver. ENABLE is low, and so TRIGG silent, before a start, after a stop, after an error of a poll, and once the
//! driver is dropped or released.
//!
//! # Cost
//!
//! A laser cycle takes `1 + 1` bytes for `INT_STATUS`, `1` a transfer and `3` a
//! register for the results, and `2` to arm again: with one stop in mode 1,
//! `2 + 4 + 7 + 2 = 15` bytes, 6 µs at 20 MHz.

mod config;
mod error;
mod registers;
mod results;
mod time;

use dtof_core::fixed::types::U16F16;
use embedded_hal::digital::{ErrorType as PinErrorType, InputPin, OutputPin};
use embedded_hal::spi::{Operation, SpiDevice};

use self::registers::{
    AUTO_INCREMENT, CALIBRATION1, CALIBRATION2, CLOCK_CNTR_OVF_H, CLOCK_CNTR_STOP_MASK_H,
    COARSE_CNTR_OVF_H, CONFIG1, CONFIG2, CONFIG2_RESET, INT_MASK, INT_MASK_RESET, INT_STATUS, OVER,
    RESULTS, START_MEAS, TIME1, WRITE,
};
use self::results::Results;
use crate::dither::Dither;
use crate::enable::Enable;
use crate::timer::Since;
use crate::{PhotonSink, Polled, ReleaseError, Sensor, SensorInfo};

pub use self::config::{Config, ConfigError, Edge, Mode, Settings, Stops};
pub use self::error::Error;
pub use self::time::{Calibration, CalibrationPeriods};

/// ENABLE stays low this long; no minimum is known.
const RESET_MS: u32 = 1;
/// From ENABLE high to a stable regulator: 1.5 ms (section 8.4.7 "Wait Times
/// for TDC7200 Startup", T3), rounded up.
const START_MS: u32 = 2;

/// A TDC7200 on an SPI device, with INTB and ENABLE.
///
/// `CHUNK` is how many 24-bit registers are read in one SPI transaction, 1 to
/// 13 (checked when compiled). Another device on the bus may have to wait for that
/// long.
#[derive(Debug)]
pub struct Tdc7200<SPI, INT, EN: OutputPin, const CHUNK: usize = RESULTS> {
    spi: SPI,
    interrupt: INT,
    enable: Enable<EN>,
    config: Config,
    state: State,
    counts: Counts,
}

/// Counts of the measurements so far. They stop at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counts {
    /// Laser cycles given to the sink.
    pub cycles: u32,
    /// Laser cycles without a photon.
    pub empty: u32,
    /// Laser cycles ended by the overflow of a counter.
    pub overflowed: u32,
    /// Photons given to the sink.
    pub photons: u32,
    /// Errors. A measurement that ends with one gives nothing to the sink.
    pub errors: u32,
}

/// The state of the driver.
#[derive(Clone, Copy, Debug)]
enum State {
    /// ENABLE is low until the next start.
    Off,
    /// Drive ENABLE low, and leave it so.
    Stopping,
    /// Reset the device next.
    Reset,
    /// ENABLE is low.
    Resetting { since: Since },
    /// ENABLE is high, the regulator is not stable yet.
    Starting { since: Since },
    /// A measurement runs. `stuck` polls found INTB low for no reason.
    Armed { since: Since, stuck: u8 },
}

type Result<T, SPI, INT> = core::result::Result<
    T,
    Error<<SPI as embedded_hal::spi::ErrorType>::Error, <INT as PinErrorType>::Error>,
>;

impl<SPI, INT, EN, const CHUNK: usize> Tdc7200<SPI, INT, EN, CHUNK>
where
    SPI: SpiDevice,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    /// A driver that has not accessed its device yet.
    pub const fn new(spi: SPI, interrupt: INT, enable: EN, config: Config) -> Self {
        const { assert!(CHUNK >= 1 && CHUNK <= RESULTS, "CHUNK must be from 1 to 13") };
        Self {
            spi,
            interrupt,
            enable: Enable::new(enable),
            config,
            state: State::Stopping,
            counts: Counts {
                cycles: 0,
                empty: 0,
                overflowed: 0,
                photons: 0,
                errors: 0,
            },
        }
    }

    /// Counts of the measurements so far.
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether a measurement is armed: the sensor is up.
    pub const fn is_armed(&self) -> bool {
        matches!(self.state, State::Armed { .. })
    }

    /// Drives ENABLE low, and gives the bus and the pins (INTB, ENABLE) back.
    ///
    /// # Errors
    /// Fails if ENABLE does; the error has the bus and the pins.
    pub fn release(self) -> core::result::Result<(SPI, INT, EN), ReleaseError<SPI, INT, EN>> {
        self.enable.release(self.spi, self.interrupt)
    }

    fn step(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SPI, INT> {
        let since = Since::new(now_ms);
        match self.state {
            State::Off => return Ok(Polled::Idle),
            State::Stopping => {
                self.enable.set(false).map_err(Error::Pin)?;
                self.state = State::Off;
                return Ok(Polled::Idle);
            }
            State::Reset => {
                self.enable.set(false).map_err(Error::Pin)?;
                self.state = State::Resetting { since };
            }
            State::Resetting { since: began } => {
                if !began.is_over(RESET_MS, now_ms) {
                    return Ok(Polled::Idle);
                }
                self.enable.set(true).map_err(Error::Pin)?;
                self.state = State::Starting { since };
            }
            State::Starting { since: began } => {
                if !began.is_over(START_MS, now_ms) {
                    return Ok(Polled::Idle);
                }
                self.check_chip()?;
                self.configure()?;
                self.arm(now_ms)?;
            }
            State::Armed {
                since: began,
                stuck,
            } => {
                if self.interrupt.is_low().map_err(Error::Pin)? {
                    return self.serve(now_ms, began, stuck, sink);
                }
                if began.is_over(self.config.settings().timeout_ms, now_ms) {
                    return Err(Error::Timeout);
                }
                self.state = State::Armed {
                    since: began,
                    stuck: 0,
                };
                return Ok(Polled::Idle);
            }
        }
        Ok(Polled::Working)
    }

    /// The device has no identification: its registers after reset have to do.
    fn check_chip(&mut self) -> Result<(), SPI, INT> {
        let config2 = self.read(CONFIG2)?;
        let int_mask = self.read(INT_MASK)?;
        if (config2, int_mask) == (CONFIG2_RESET, INT_MASK_RESET) {
            Ok(())
        } else {
            Err(Error::WrongChip { config2, int_mask })
        }
    }

    /// Writes the configuration and reads it back.
    fn configure(&mut self) -> Result<(), SPI, INT> {
        let [[coarse_h, coarse_l], [clock_h, clock_l]] =
            self.config.overflows().map(u16::to_be_bytes);
        let [mask_h, mask_l] = self.config.settings().stop_mask.to_be_bytes();
        let registers = [
            (CONFIG2, self.config.config2()),
            (INT_MASK, INT_MASK_RESET),
            (COARSE_CNTR_OVF_H, coarse_h),
            (COARSE_CNTR_OVF_H + 1, coarse_l),
            (CLOCK_CNTR_OVF_H, clock_h),
            (CLOCK_CNTR_OVF_H + 1, clock_l),
            (CLOCK_CNTR_STOP_MASK_H, mask_h),
            (CLOCK_CNTR_STOP_MASK_H + 1, mask_l),
        ];
        for (register, value) in registers {
            self.write(register, value)?;
        }
        for (register, wrote) in registers {
            let read = self.read(register)?;
            if read != wrote {
                return Err(Error::NotWritten {
                    register,
                    wrote,
                    read,
                });
            }
        }
        Ok(())
    }

    /// Starts the next measurement.
    fn arm(&mut self, now_ms: u32) -> Result<(), SPI, INT> {
        self.write(CONFIG1, self.config.config1() | START_MEAS)?;
        self.state = State::Armed {
            since: Since::new(now_ms),
            stuck: 0,
        };
        Ok(())
    }

    /// INTB is low: passes the photons on and arms again.
    fn serve(
        &mut self,
        now_ms: u32,
        since: Since,
        stuck: u8,
        sink: &mut impl PhotonSink,
    ) -> Result<Polled, SPI, INT> {
        let status = self.read(INT_STATUS)?;
        if status == 0xff {
            return Err(Error::NoAnswer);
        }
        if status & OVER == 0 {
            let stuck = stuck.saturating_add(1);
            if stuck >= self.config.settings().stuck_limit {
                return Err(Error::StuckInterrupt { status });
            }
            self.state = State::Armed { since, stuck };
            return Ok(Polled::Idle);
        }
        let mut results = Results::default();
        let last = results::last(self.config.settings());
        self.read_results(&mut results, TIME1, last)?;
        self.read_results(&mut results, CALIBRATION1, CALIBRATION2)?;
        let times = results.times(self.config.settings());
        let [calibration1, calibration2] = results.calibrations();
        let times = times.ok_or(Error::Calibration {
            calibration1,
            calibration2,
        })?;
        let mut photons = 0;
        for time_ps in times.into_iter().flatten() {
            sink.photon(self.config.settings().pixel, self.config.code(time_ps));
            photons += 1;
        }
        sink.end_laser_cycles(1);

        let overflowed = status & registers::OVERFLOW != 0;
        let count = |counter: &mut u32, by: u32| *counter = counter.saturating_add(by);
        count(&mut self.counts.cycles, 1);
        count(&mut self.counts.empty, u32::from(photons == 0));
        count(&mut self.counts.overflowed, u32::from(overflowed));
        count(&mut self.counts.photons, photons);

        self.arm(now_ms)?;
        Ok(Polled::Data)
    }

    /// Reads the result registers `first..=last`, `CHUNK` at a time.
    fn read_results(&mut self, results: &mut Results, first: u8, last: u8) -> Result<(), SPI, INT> {
        let mut register = first;
        let values = results.range(first, last);
        for chunk in values.chunks_mut(CHUNK) {
            let bytes = chunk.as_flattened_mut();
            let command = [AUTO_INCREMENT | register];
            self.spi
                .transaction(&mut [Operation::Write(&command), Operation::Read(bytes)])
                .map_err(Error::Bus)?;
            for value in chunk {
                let ones: u32 = value.iter().map(|byte| byte.count_ones()).sum();
                if self.config.settings().parity && !ones.is_multiple_of(2) {
                    return Err(Error::Parity { register });
                }
                register += 1;
            }
        }
        Ok(())
    }

    fn read(&mut self, register: u8) -> Result<u8, SPI, INT> {
        let mut value = [0];
        self.spi
            .transaction(&mut [Operation::Write(&[register]), Operation::Read(&mut value)])
            .map_err(Error::Bus)?;
        let [value] = value;
        Ok(value)
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), SPI, INT> {
        self.spi
            .write(&[WRITE | register, value])
            .map_err(Error::Bus)
    }
}

impl<SPI, INT, EN, const CHUNK: usize> Sensor for Tdc7200<SPI, INT, EN, CHUNK>
where
    SPI: SpiDevice,
    INT: InputPin,
    EN: OutputPin + PinErrorType<Error = INT::Error>,
{
    type Error = Error<SPI::Error, INT::Error>;

    fn info(&self) -> SensorInfo {
        let settings = self.config.settings();
        SensorInfo {
            pixels: settings.pixel.raw().saturating_add(1),
            bin_width: None,
            bins: 128,
            offset: self.config.offset(),
            gives_histograms: false,
            laser_millihertz: settings.laser_millihertz,
            most_dither: 0,
            dead_time: match settings.stops {
                Stops::One => u16::MAX,
                // The first stops only; how long the TDC is blind between them is unknown.
                Stops::Two | Stops::Three | Stops::Four | Stops::Five => 0,
            },
        }
    }

    fn start(&mut self, bin_width: U16F16, _: Dither) {
        self.config.set_bin_width(bin_width);
        self.state = State::Reset;
    }

    /// ENABLE goes low.
    fn stop(&mut self) {
        self.state = match self.enable.set(false) {
            Ok(()) => State::Off,
            Err(_) => {
                self.counts.errors = self.counts.errors.saturating_add(1);
                State::Stopping
            }
        };
    }

    fn is_stopping(&self) -> bool {
        matches!(self.state, State::Stopping)
    }

    /// After an error ENABLE is low, and the next polls configure the device again, within some 5 ms.
    fn poll(&mut self, now_ms: u32, sink: &mut impl PhotonSink) -> Result<Polled, SPI, INT> {
        let polled = self.step(now_ms, sink);
        if polled.is_err() {
            self.counts.errors = self.counts.errors.saturating_add(1);
            if !self.is_stopping() {
                // Now, as the caller may not poll again. If the pin fails, the next poll begins with it.
                let _ = self.enable.set(false);
                self.state = State::Reset;
            }
        }
        polled
    }
}
