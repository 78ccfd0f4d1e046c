//! All of dtof-sensors but its awaited drivers: see [`crate::awaited`].

use core::fmt::Display;
use core::num::NonZeroU16;

use dtof_core::fixed::types::{U0F32, U8F24, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::i2c::SoftwareI2c;
use dtof_sensors::simulated::{Pulse, Simulated, SimulatedPixel, scene};
use dtof_sensors::tdc7200::{CalibrationPeriods, Edge, Mode, Stops};
use dtof_sensors::tmf882x::SpadMap;
use dtof_sensors::tmf8829::{Preset, Results, Spi, Zones, snr};
use dtof_sensors::{Sensor, SensorFault, photon_timer, simulated, tdc7200, tmf882x, tmf8829};
use embedded_hal::i2c::{Error as _, I2c, Operation};

use crate::devices::{Device, Sink};
use crate::values::{
    address, byte, double, half, keep, more, one_of, or_text, some, some_mut, values, word,
};

pub fn all() {
    tdc7200();
    calibrations();
    tmf882x();
    tmf8829();
    photon_timer();
    simulated();
    dithers();
    software_i2c();
}

fn run<S: Sensor>(mut sensor: S) -> S
where
    S::Error: Display,
{
    let info = sensor.info();
    keep((info, info.has_bins_of(U16F16::from_bits(word()))));
    while more() {
        if more() {
            sensor.start(U16F16::from_bits(word()), dither());
        }
        if more() {
            sensor.stop();
        }
        match sensor.poll(word(), &mut Sink) {
            Ok(polled) => keep(polled),
            Err(error) => {
                let error = &error;
                keep(or_text::<()>(Err(error)));
            }
        }
        if let Err(error) = sensor.poll(word(), &mut Sink) {
            keep::<SensorFault>(error.into());
        }
        keep(sensor.is_stopping());
    }
    sensor
}

fn dither() -> Dither {
    or_text(Dither::new(half(), double())).unwrap_or_default()
}

#[inline(never)]
fn tdc7200() {
    let settings = tdc7200::Settings {
        first_bin_ps: word(),
        laser_millihertz: double(),
        mode: if more() { Mode::One } else { Mode::Two },
        stops: one_of([
            Stops::One,
            Stops::Two,
            Stops::Three,
            Stops::Four,
            Stops::Five,
        ]),
        calibration: periods(),
        start_edge: one_of([Edge::Rising, Edge::Falling]),
        stop_edge: one_of([Edge::Rising, Edge::Falling]),
        overflow: half(),
        stop_mask: half(),
        parity: more(),
        timeout_ms: word(),
        stuck_limit: byte(),
        ..tdc7200::Settings::new(address(), half(), U16F16::from_bits(word()))
    };
    let Some(config) = or_text(tdc7200::Config::new(settings)) else {
        return;
    };
    keep(config.code(double().cast_signed()));
    let sensor = run(tdc7200::Tdc7200::<_, _, _>::new(
        Device, Device, Device, config,
    ));
    keep((sensor.counts(), sensor.is_armed()));
    let sensor = run(tdc7200::Tdc7200::<_, _, _, 4>::new(
        Device, Device, Device, config,
    ));
    keep(or_text(sensor.release()));
}

fn periods() -> CalibrationPeriods {
    one_of([
        CalibrationPeriods::Two,
        CalibrationPeriods::Ten,
        CalibrationPeriods::Twenty,
        CalibrationPeriods::Forty,
    ])
}

/// By themselves, so that nothing is known of the numbers.
#[inline(never)]
fn calibrations() {
    if let Some(calibration) = tdc7200::Calibration::new(half(), periods(), word(), word()) {
        keep(calibration.mode_1(word()));
        keep(calibration.mode_2(word(), word(), word()));
    }
}

#[inline(never)]
fn tmf882x() {
    let Some(config) = tmf882x_config() else {
        return;
    };
    keep(config.info());
    let image = &values::<u8, 300>(byte);
    let sensor = tmf882x::Tmf882x::<_, _, _>::new(Device, Device, Device, some(image), config);
    let sensor = run(sensor);
    keep((sensor.counts(), sensor.address(), sensor.is_measuring()));
    let sensor = tmf882x::Tmf882x::<_, _, _, 32>::new(Device, Device, Device, some(image), config);
    keep(or_text(run(sensor).release()));
}

pub fn tmf882x_config() -> Option<tmf882x::Config> {
    let maps = [
        SpadMap::Map1,
        SpadMap::Map2,
        SpadMap::Map3,
        SpadMap::Map6,
        SpadMap::Map8,
        SpadMap::Map9,
        SpadMap::Map11,
        SpadMap::Map12,
    ];
    let settings = tmf882x::Settings {
        first_pixel: address(),
        reference: more().then(address),
        address: byte(),
        period_ms: half(),
        kilo_iterations: half(),
        zones: if more() {
            tmf882x::Zones::SixtyFour
        } else {
            tmf882x::Zones::Nine(one_of(maps))
        },
        command_timeout_ms: word(),
        data_timeout_ms: word(),
        stuck_limit: byte(),
    };
    or_text(tmf882x::Config::new(settings))
}

#[inline(never)]
fn tmf8829() {
    keep(snr(byte()));
    let Some(config) = tmf8829_config() else {
        return;
    };
    keep((config.info(), config.settings().zones.size()));
    let image = &values::<u8, 300>(byte);
    let sensor = tmf8829::Tmf8829::<_, _, _>::new(Device, Device, Device, some(image), config);
    let sensor = run(sensor);
    keep((sensor.counts(), sensor.address(), sensor.is_measuring()));
    let sensor =
        tmf8829::Tmf8829::<_, _, _, 32>::new(Spi(Device), Device, Device, some(image), config);
    keep(or_text(run(sensor).release()).map(|(bus, ..)| bus.0));
}

pub fn tmf8829_config() -> Option<tmf8829::Config> {
    let settings = tmf8829::Settings {
        first_pixel: address(),
        reference: more().then(address),
        zones: one_of(Zones::ALL),
        preset: one_of([Preset::Standard, Preset::LongRange, Preset::HighAccuracy]),
        results: Results {
            peaks: byte(),
            signal: more(),
            noise: more(),
            crosstalk: more(),
        },
        interface: if more() {
            tmf8829::Interface::Spi
        } else {
            tmf8829::Interface::I2c { address: byte() }
        },
        period_ms: half(),
        kilo_iterations: half(),
        command_timeout_ms: word(),
        data_timeout_ms: word(),
        stuck_limit: byte(),
    };
    or_text(tmf8829::Config::new(settings))
}

/// Shift registers with any samples, which may overtake their reader.
struct Sampler;

impl photon_timer::Sampler for Sampler {
    const KEPT: u32 = 100;

    fn start(&mut self, config: &photon_timer::Config, dither: Dither) {
        keep((
            config.laser_counters(dither.range()),
            config.sampler_counter(dither.range()),
        ));
    }

    fn stop(&mut self) {}

    fn completed(&mut self) -> u32 {
        word()
    }

    fn samples(&self, _: u32) -> photon_timer::Samples {
        photon_timer::Samples {
            before: word(),
            even: values(word),
            odd: values(word),
        }
    }

    fn has_stalled(&self) -> bool {
        more()
    }
}

#[inline(never)]
fn photon_timer() {
    let settings = photon_timer::Settings {
        laser_hz: word(),
        pulse_ns: word(),
    };
    let config = if more() {
        photon_timer::Config::new(settings)
    } else {
        photon_timer::Config::beyond_limits(settings)
    };
    let Some(config) = or_text(config) else {
        return;
    };
    keep((config.unsampled_clocks(), config.laser_clocks()));
    let sensor = run(photon_timer::PhotonTimer::new(Sampler, config));
    keep(sensor.lost());
}

#[inline(never)]
fn simulated() {
    let rate = || U8F24::from_bits(word());
    let pixel = SimulatedPixel::new(address(), half(), rate(), rate());
    let (Some(pixel), Some(cycles_per_poll)) = (or_text(pixel), NonZeroU16::new(half())) else {
        return;
    };
    let settings = simulated::Settings {
        seed: double(),
        bins: half(),
        cycles_per_second: word(),
        cycles_per_poll,
    };
    let shares = [U0F32::from_bits(word()), U0F32::from_bits(word())];
    let pixels = [pixel; 3];
    let sensor = run(Simulated::new(
        some(&pixels),
        Pulse::new(some(&shares)),
        settings,
    ));
    let mut sensor = sensor.without_clock();
    keep(sensor.laser_cycles(half(), &mut Sink));
    keep(sensor.skipped());
    keep(run(scene()).skipped());
}

#[inline(never)]
fn dithers() {
    let mut added = dither().added();
    while more() {
        keep(added.next());
    }
}

#[inline(never)]
fn software_i2c() {
    let mut bus = SoftwareI2c::new(Device, Device, Device);
    let (mut read, written) = ([0; 40], values::<u8, 40>(byte));
    while more() {
        let (first, second) = read.split_at_mut(20);
        let mut operations = [
            Operation::Write(some(&written)),
            Operation::Read(some_mut(first)),
            Operation::Read(some_mut(second)),
            Operation::Write(some(&written)),
        ];
        if let Err(error) = bus.transaction(byte(), some_mut(&mut operations)) {
            keep(error.kind());
            keep(or_text::<()>(Err(error)));
        }
        keep(read);
    }
    keep(bus.release());
}
