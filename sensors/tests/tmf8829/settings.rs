//! Settings of the TMF8829: what reaches the chip, what is described, what is refused.

use crate::common::tmf8829::bench::{Bench, IMAGE, PRESETS, over, settings};
use crate::common::tmf8829::bus::{Bus, Wired};
use dtof_chips::tmf8829::{Tmf8829 as Chip, varied_counts};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::tmf8829::{
    Config, ConfigError, Interface, Preset, Results, Settings, Spi, Tmf8829, Tmf8829Protocol, Zones,
};
use dtof_sensors::{Sensor, SensorFault};

#[test]
fn the_image_and_every_setting_reach_their_places() {
    let mut bench = Bench::<128>::new(Settings {
        zones: Zones::Z32x32,
        preset: Preset::HighAccuracy,
        period_ms: 0x0123,
        kilo_iterations: 0x0456,
        interface: Interface::I2c { address: 0x42 },
        results: Results {
            peaks: 2,
            signal: true,
            noise: false,
            crosstalk: true,
        },
        ..settings(Zones::Z8x8)
    });
    assert_eq!(bench.sensor.address(), 0x41);
    bench.bring_up();
    assert_eq!(bench.sensor.address(), 0x42);
    let wires = bench.bus.0.borrow();
    let page = |registers: &[u8]| {
        let values = registers.iter().map(|&register| wires.chip.page(register));
        values.collect::<Vec<_>>()
    };
    assert_eq!(
        page(&[0x20, 0x22, 0x23, 0x24, 0x25]),
        [0x46, 0x23, 0x01, 0x56, 0x04]
    );
    assert_eq!(page(&[0x26, 0x2A, 0x2B, 0x90]), [4, 0b10_1010, 1, 0x84]);
    assert_eq!(page(&[0xE2, 0xF8]), [0x09, 0x24]);
    let written = wires.log.iter().map(|(written, _)| &**written);
    let written: Vec<&[u8]> = written.collect();
    // Both buses would be on; 309 words at 0x0001_0000.
    let position = |bytes: &[u8]| {
        written
            .iter()
            .position(|written| *written == bytes)
            .unwrap()
    };
    let off = position(&[0x08, 0x20]);
    let upload = position(&[0x08, 0x45, 6, 0, 0, 1, 0, 0x35, 0x01]);
    assert!(off < upload && upload < position(&[0x08, 0x16]));
    assert_eq!(wires.chip.ram.len(), 309 * 4);
}

#[test]
fn presets_are_those_of_the_data_sheet() {
    let presets = [
        (Zones::Z8x8, [0x40, 0x41, 0x42]),
        (Zones::Z16x16, [0x43, 0, 0x44]),
        (Zones::Z32x32Pairs, [0x45, 0, 0x46]),
        (Zones::Z32x32, [0x45, 0, 0x46]),
        (Zones::Z48x32, [0x47, 0, 0x48]),
    ];
    for (zones, commands) in presets {
        for (preset, command) in PRESETS.into_iter().zip(commands) {
            if command == 0 {
                continue;
            }
            let mut bench = Bench::<128>::new(Settings {
                preset,
                ..settings(zones)
            });
            bench.bring_up();
            assert_eq!(bench.bus.0.borrow().chip.page(0x20), command);
            assert_eq!(bench.sensor.counts().errors, 0);
        }
    }
}

#[test]
fn bins_and_laser_are_described_as_they_are() {
    let info = |zones, preset| {
        let config = Config::new(Settings {
            preset,
            ..settings(zones)
        });
        let bus = Bus::new(Chip::new(&IMAGE, varied_counts()));
        Tmf8829::<_, _, _>::new(bus.clone(), bus.clone(), bus, &IMAGE, config.unwrap()).info()
    };
    let width = |text| Some(U16F16::lit(text));
    let fine = info(Zones::Z16x16, Preset::HighAccuracy);
    assert_eq!((fine.bins, fine.bin_width), (64, width("203.65")));
    let merged = info(Zones::Z8x8, Preset::HighAccuracy);
    assert_eq!(merged.bins, 109);
    assert_eq!(merged.bin_width, width("203.65").map(|bin| bin * 2));
    let long = info(Zones::Z8x8, Preset::LongRange);
    assert_eq!(long.bins, 104);
    for zones in Zones::ALL {
        let info = info(zones, Preset::Standard);
        assert_eq!(info.bins, 54);
        assert_eq!(info.bin_width, width("203.65").map(|bin| bin * 4));
        assert_eq!(info.pixels, 10 + zones.number());
        assert!(info.gives_histograms);
        // 600,064 pulses, but what twelve slots cannot share, in the period.
        let (period_ms, pulses) = match zones {
            Zones::Z8x8 | Zones::Z16x16 => (1300, 600_064),
            Zones::Z32x32Pairs | Zones::Z32x32 => (5000, 600_064),
            Zones::Z48x32 => (7500, 600_060),
        };
        assert_eq!(info.laser_millihertz, pulses * 1_000_000 / period_ms);
    }
}

#[test]
fn over_spi_data_time_out_a_second_after_the_period() {
    for zones in Zones::ALL {
        let settings = Settings::over_spi(PixelAddress::new(0), zones);
        assert_eq!(
            settings.data_timeout_ms,
            u32::from(settings.period_ms) + 1000
        );
    }
}

/// The pixels are those up to the last address, of a zone or of a reference.
#[test]
fn reference_pixels_may_come_before_the_zones() {
    for (reference, pixels) in [(None, 74), (Some(0), 74), (Some(74), 78)] {
        let config = Config::new(Settings {
            reference: reference.map(PixelAddress::new),
            ..settings(Zones::Z8x8)
        });
        assert_eq!(config.unwrap().info().pixels, pixels, "{reference:?}");
    }
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = settings(Zones::Z48x32);
        change(&mut settings);
        Config::new(settings).map(|_| ()).unwrap_err()
    };
    assert!(Config::new(settings(Zones::Z48x32)).is_ok());
    let address = |address| {
        let interface = Interface::I2c { address };
        let settings = settings(Zones::Z48x32);
        Config::new(Settings {
            interface,
            ..settings
        })
        .unwrap_err()
    };
    assert_eq!(address(0x07), ConfigError::Address);
    assert_eq!(address(0x78), ConfigError::Address);
    for address in [0x08, 0x77] {
        let settings = settings(Zones::Z48x32);
        assert!(
            Config::new(Settings {
                interface: Interface::I2c { address },
                ..settings
            })
            .is_ok()
        );
    }
    let zero = refused(|bad| bad.kilo_iterations = 0);
    assert_eq!(zero, ConfigError::ZeroIterations);
    let pixels = refused(|bad| bad.first_pixel = PixelAddress::new(u16::MAX - 1534));
    assert_eq!(pixels, ConfigError::Pixels);
    let reference = refused(|bad| bad.reference = Some(PixelAddress::new(u16::MAX - 2)));
    assert_eq!(reference, ConfigError::Pixels);
    // Zones are pixels 10 to 1545.
    for (first, is_good) in [(6, true), (7, false), (1545, false), (1546, true)] {
        let with = Config::new(Settings {
            reference: Some(PixelAddress::new(first)),
            ..settings(Zones::Z48x32)
        });
        assert_eq!(with.err(), (!is_good).then_some(ConfigError::Reference));
    }
    // 600,064 pulses, each 249 or 449 × 203.65 ps after the one before.
    for (preset, (steps, enough)) in
        PRESETS
            .into_iter()
            .zip([(249.0, 31), (449.0, 55), (249.0, 31)])
    {
        let lasts_ms = 600_064.0 * steps * 203.65e-9_f64;
        assert!(lasts_ms < f64::from(enough) && f64::from(enough - 1) < lasts_ms);
        for period_ms in [0, 1, enough - 1, enough] {
            let with = Config::new(Settings {
                preset,
                period_ms,
                ..settings(Zones::Z8x8)
            });
            let refused = (period_ms < enough).then_some(ConfigError::Period);
            assert_eq!(with.err(), refused);
        }
    }
    assert_eq!(refused(|bad| bad.period_ms = 8500), ConfigError::Timeout);
    let long = refused(|bad| bad.preset = Preset::LongRange);
    assert_eq!(long, ConfigError::LongRange);
    assert_eq!(refused(|bad| bad.results.peaks = 0), ConfigError::Peaks);
    assert_eq!(refused(|bad| bad.results.peaks = 5), ConfigError::Peaks);
    // 768 zones of 12 bytes.
    assert_eq!(
        refused(|bad| bad.results.peaks = 4),
        ConfigError::ResultSize
    );
    for (error, part) in [
        (ConfigError::LongRange, "long ranges"),
        (ConfigError::ResultSize, "8,192 bytes"),
        (ConfigError::Peaks, "1 to 4"),
    ] {
        assert!(error.text().contains(part));
        assert_eq!(error.to_string(), error.text());
    }
}

/// A bus of so many clocks a second, and how long a measurement takes.
fn measure<B: Wired<Error: std::fmt::Debug>>(zones: Zones, hertz: f64) -> f64 {
    let mut bench = Bench::<128, B>::new(over::<B>(settings(zones)));
    bench.bring_up();
    let frames = usize::from(zones.frames());
    let results = if frames > 2 { 2 } else { 1 };
    bench.bus.0.borrow_mut().clocks = 0;
    bench.frames(frames + results);
    bench.bus.0.borrow().clocks as f64 / hertz
}

/// How long the pulses of the standard preset take.
fn pulses(settings: &Settings) -> f64 {
    f64::from(settings.kilo_iterations) * 1024.0 * 50.7e-9
}

/// What the documentation says of bus and memory.
#[test]
fn a_measurement_takes_the_bus_as_long_as_is_said() {
    let first = PixelAddress::new(10);
    for (zones, i2c, spi) in [
        (Zones::Z8x8, 1.18, 0.0399),
        (Zones::Z16x16, 1.21, 0.0408),
        (Zones::Z32x32, 4.82, 0.1632),
        (Zones::Z48x32, 7.23, 0.2448),
    ] {
        let taken = measure::<Bus>(zones, 400e3);
        assert!((taken - i2c).abs() < 0.005, "{zones:?}: {taken} s");
        // The period leaves room for that.
        let settings = Settings::new(first, zones);
        let period = f64::from(settings.period_ms) / 1000.0;
        let lasts = taken + pulses(&settings);
        assert!(
            lasts < period && period < 1.2 * lasts,
            "{zones:?}: {lasts} s"
        );
        println!("TMF8829, {zones:?}: {taken:.2} s a measurement over I2C at 400 kHz");
        let taken = measure::<Spi<Bus>>(zones, 10.5e6);
        assert!((taken - spi).abs() < 0.00005, "{zones:?}: {taken} s");
        println!(
            "TMF8829, {zones:?}: {:.1} ms over SPI at 10.5 MHz",
            1e3 * taken
        );
        let taken = measure::<Spi<Bus>>(zones, 10e6);
        let settings = Settings::over_spi(first, zones);
        let period = f64::from(settings.period_ms) / 1000.0;
        // The sensor waits while it is read: the pulses come on top.
        let lasts = taken + pulses(&settings);
        assert!(
            lasts < period && period < 1.15 * lasts,
            "{zones:?}: {lasts} s"
        );
    }
    assert!((measure::<Bus>(Zones::Z16x16, 1e6) - 0.48).abs() < 0.005);
    assert!((measure::<Spi<Bus>>(Zones::Z16x16, 20e6) - 0.0214).abs() < 0.00005);
    let driver = size_of::<Tmf8829Protocol<'static>>();
    println!("TMF8829: {driver} bytes of RAM");
    assert!(driver < 1024, "{driver} bytes");
}

/// Over SPI the bootloader switches I²C off, over I²C SPI.
#[test]
fn the_other_bus_is_switched_off() {
    let mut bench =
        Bench::<128, Spi<Bus>>::new(Settings::over_spi(PixelAddress::new(0), Zones::Z8x8));
    bench.bring_up();
    assert_eq!(bench.bus.0.borrow().chip.off, Some(0x22));
    assert_eq!(bench.bus.0.borrow().chip.address, 0x41);
    let mut bench = Bench::<128>::new(settings(Zones::Z8x8));
    bench.bring_up();
    assert_eq!(bench.bus.0.borrow().chip.off, Some(0x20));
}

/// The wrong bus in the settings, and a sensor that is not there: an error, and nothing is given.
#[test]
fn spi_without_a_sensor_is_an_error() {
    fn faults(settings: Settings, is_unplugged: bool) -> Vec<SensorFault> {
        let mut bench = Bench::<128, Spi<Bus>>::new(settings);
        bench.bus.0.borrow_mut().is_unplugged = is_unplugged;
        let polls = (0..2000).map(|now_ms| bench.sensor.poll(now_ms, &mut bench.sink));
        let faults = polls
            .filter_map(|polled| polled.err().map(SensorFault::from))
            .collect();
        assert_eq!(bench.sink.take(), []);
        faults
    }
    let unplugged = faults(over::<Spi<Bus>>(settings(Zones::Z8x8)), true);
    assert!(unplugged.len() > 100);
    assert!(
        unplugged
            .iter()
            .all(|fault| *fault == SensorFault::WrongChip)
    );
    let wrong = faults(settings(Zones::Z8x8), false);
    assert!(
        wrong.len() > 10 && wrong[0] == SensorFault::Rejected,
        "{wrong:?}"
    );
}
