//! The driver of the TMF8820/21/28 on a mocked I²C bus: every register access
//! in order. Errors are in `tmf882x_errors.rs`.

use std::cell::RefCell;

use crate::common::tmf882x::{
    Bench, Counts, IMAGE, NACK, measure, measuring, packet, packets, page, read, settings,
    some_counts, stopped, write,
};
use crate::common::{Line, RecordingSink, started};
use dtof_core::PixelAddress;
use dtof_sensors::tmf882x::{Config, ConfigError, Error, Settings, SpadMap, Tmf882x, Zones};
use dtof_sensors::{Polled, Sensor};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Access};
use proptest::prelude::*;

#[test]
fn zones_are_nine_or_sixty_four() {
    assert_eq!(Zones::Nine(SpadMap::Map12).number(), 9);
    assert_eq!(Zones::SixtyFour.number(), 64);
}

#[test]
fn a_sensor_that_runs_the_application_is_not_loaded() {
    let mut bench = measuring();
    bench.set(&some_counts());
    bench.set(&some_counts());
    let counts = bench.sensor.counts();
    assert_eq!((counts.histograms, counts.packets), (20, 60));
    assert_eq!((counts.left_out, counts.errors), (0, 0));
}

#[test]
fn a_sensor_that_runs_the_bootloader_is_loaded_in_chunks() {
    static LONG: [u8; 300] = [0xA5; 300];
    fn run<const CHUNK: usize>() {
        let mut bench = Bench::<CHUNK>::new(settings(), &LONG);
        let done = || read(0x41, 0x08, &[0x00, 0x00, 0xFF]);
        bench.switch_on(false);
        // In standby at first, then not ready yet.
        let standby = [read(0x41, 0xE0, &[0x30]), write(0x41, &[0xE0, 0x31])];
        assert_eq!(bench.poll(&standby), Ok(Polled::Idle));
        assert_eq!(bench.poll(&[read(0x41, 0xE0, &[0x31])]), Ok(Polled::Idle));
        bench.identify(0x80, &[0x08, 0x14, 0x01, 0x29, 0xC1]);
        let busy = read(0x41, 0x08, &[0x14, 0x00, 0xEB]);
        assert_eq!(bench.poll(&[busy]), Ok(Polled::Idle));
        bench.work(&[done(), write(0x41, &[0x08, 0x43, 0x02, 0x00, 0x00, 0xBA])]);
        for chunk in LONG.chunks(CHUNK.min(128)) {
            let mut message = vec![0x41, u8::try_from(chunk.len()).unwrap()];
            message.extend(chunk);
            let sum: u32 = message.iter().copied().map(u32::from).sum();
            message.push((0xFF ^ (sum & 0xFF)).try_into().unwrap());
            message.insert(0, 0x08);
            bench.work(&[done(), write(0x41, &message)]);
        }
        bench.work(&[done(), write(0x41, &[0x08, 0x11, 0x00, 0xEE])]);
        bench.wait(10);
        assert_eq!(bench.poll(&[]), Ok(Polled::Idle));
        bench.wait(1);
        assert_eq!(bench.poll(&[read(0x41, 0x00, &[0x80])]), Ok(Polled::Idle));
        bench.work(&[read(0x41, 0x00, &[0x03]), write(0x41, &[0x08, 0x16])]);
        bench.configure();
        bench.set(&some_counts());
    }
    run::<135>();
    run::<100>();
    run::<7>();
}

#[test]
fn every_setting_reaches_its_register() {
    let mut bench = Bench::<128>::new(
        Settings {
            period_ms: 0x0123,
            kilo_iterations: 0x0456,
            zones: Zones::Nine(SpadMap::Map12),
            ..settings()
        },
        IMAGE,
    );
    bench.switch_on(false);
    bench.identify(0x03, &[0x08, 0xFF]);
    bench.work(&stopped(0x41));
    bench.work(&[
        read(0x41, 0x08, &[0x00]),
        read(0x41, 0x20, &[0x16]),
        write(0x41, &[0x24, 0x23, 0x01, 0x56, 0x04]),
        write(0x41, &[0x34, 12]),
        write(0x41, &[0x39, 1]),
        write(0x41, &[0x08, 0x15]),
    ]);
}

#[test]
fn a_reference_that_nobody_wants_is_not_given() {
    let settings = Settings {
        reference: None,
        ..settings()
    };
    let mut bench = Bench::<128>::new(settings, IMAGE);
    bench.bring_up_running();
    for bytes in packets(&some_counts()) {
        bench.packet(&bytes).unwrap();
    }
    // The frame and the zones.
    assert_eq!(bench.sink.take().len(), 1 + 9);
}

/// Histograms come out as they went in, whatever the counts and the chunks.
mod sets {
    use super::*;

    fn counts() -> impl Strategy<Value = Counts> {
        let count = prop_oneof![0u32..1 << 24, 0u32..1 << 10, Just(0), Just((1 << 24) - 1)];
        proptest::collection::vec(count, 1280).prop_map(|counts| {
            let mut counts = counts.into_iter();
            [(); 10].map(|()| [(); 128].map(|()| counts.next().unwrap()))
        })
    }

    fn round_trip<const CHUNK: usize>(first: &Counts, second: &Counts) {
        let mut bench = Bench::<CHUNK>::new(settings(), IMAGE);
        bench.bring_up_running();
        bench.set(first);
        bench.set(second);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn come_out_as_they_went_in(first in counts(), second in counts()) {
            round_trip::<135>(&first, &second);
            round_trip::<32>(&second, &first);
        }
    }
}

/// Pixels are numbered from 0 to the last one, zone or reference.
#[test]
fn the_number_of_pixels_follows_the_last_one() {
    let pixels = |first: u16, reference: Option<u16>| {
        let config = Config::new(Settings {
            first_pixel: PixelAddress::new(first),
            reference: reference.map(PixelAddress::new),
            ..settings()
        });
        config.unwrap().info().pixels
    };
    assert_eq!(pixels(20, None), 29);
    assert_eq!(pixels(20, Some(29)), 30);
    assert_eq!(pixels(20, Some(100)), 101);
    assert_eq!(pixels(20, Some(19)), 29);
    assert_eq!(pixels(20, Some(0)), 29);
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = settings();
        change(&mut settings);
        Config::new(settings).unwrap_err()
    };
    assert_eq!(refused(|bad| bad.address = 0x07), ConfigError::Address);
    assert_eq!(refused(|bad| bad.address = 0x78), ConfigError::Address);
    assert_eq!(refused(|bad| bad.address = 0xFF), ConfigError::Address);
    for address in [0x08, 0x77] {
        let settings = settings();
        assert!(
            Config::new(Settings {
                address,
                ..settings
            })
            .is_ok()
        );
    }
    let zero = refused(|bad| bad.kilo_iterations = 0);
    assert_eq!(zero, ConfigError::ZeroIterations);
    let pixels = refused(|bad| bad.first_pixel = PixelAddress::new(u16::MAX - 7));
    assert_eq!(pixels, ConfigError::Pixels);
    let reference = refused(|bad| {
        bad.reference = Some(PixelAddress::new(bad.first_pixel.raw() + 8));
    });
    assert_eq!(reference, ConfigError::Reference);
    assert_eq!(refused(|bad| bad.period_ms = 1000), ConfigError::Timeout);
}

/// From an application that runs at 0x41 to measuring at `address`.
fn move_to(address: u8) -> [Vec<Access>; 4] {
    let mut page = page(0x41);
    let last = page.pop().unwrap();
    page.extend([
        write(0x41, &[0x3B, address << 1]),
        write(0x41, &[0x3E, 0]),
        last,
    ]);
    [
        page,
        vec![read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x21])],
        measure(address),
        vec![read(address, 0x08, &[0x01])],
    ]
}

#[test]
fn an_address_that_is_not_taken_starts_over_at_the_first() {
    let mut bench = Bench::<128>::new(
        Settings {
            address: 0x42,
            ..settings()
        },
        IMAGE,
    );
    for _ in 0..2 {
        bench.switch_on(true);
        assert_eq!(bench.sensor.address(), 0x41);
        bench.identify(0x03, &[0x08, 0xFF]);
        bench.work(&stopped(0x41));
        let [page, change, ..] = move_to(0x42);
        bench.work(&page);
        bench.work(&change);
        assert_eq!(bench.sensor.address(), 0x42);
        let polled = bench.poll(&[read(0x42, 0x08, &[0]).with_error(NACK)]);
        assert_eq!(polled, Err(Error::Nack(NACK)));
    }
    // It answers at the first address once it has been off.
    bench.switch_on(true);
    assert_eq!(bench.sensor.address(), 0x41);
}

/// Two on one bus, brought up one after the other, each at its own address.
#[test]
fn two_sensors_share_a_bus() {
    use embedded_hal_bus::i2c::RefCellDevice;

    let mut bus = Mock::new(&[]);
    let shared = RefCell::new(bus.clone());
    let mut sink = RecordingSink::default();
    let addresses = [0x42, 0x43];
    let interrupts = [Line::new(true), Line::new(true)];
    let mut sensors = [0, 1].map(|index: usize| {
        let config = Config::new(Settings {
            address: addresses[index],
            ..settings()
        });
        let device = RefCellDevice::new(&shared);
        let interrupt = interrupts[index].clone();
        let enable = Line::new(false);
        started(Tmf882x::<_, _, _>::new(
            device,
            interrupt,
            enable,
            &[],
            config.unwrap(),
        ))
    });

    let mut now_ms = 0;
    for (sensor, address) in sensors.iter_mut().zip(addresses) {
        let identify = vec![
            read(0x41, 0xE0, &[0x41]),
            read(0x41, 0xE3, &[0x08]),
            read(0x41, 0x00, &[0x03]),
            write(0x41, &[0x08, 0xFF]),
        ];
        let load = stopped(0x41).to_vec();
        // ENABLE low, ENABLE high, ready to be asked.
        let steps = [vec![], vec![], vec![], identify, load];
        for accesses in steps.into_iter().chain(move_to(address)) {
            bus.update_expectations(&accesses);
            let polled = sensor.poll(now_ms, &mut sink);
            assert_eq!(polled, Ok(Polled::Working));
            bus.done();
            now_ms += 11;
        }
        assert!(sensor.is_measuring());
        assert_eq!(sensor.address(), address);
    }
    // Their packets come by turns.
    for bytes in packets(&some_counts()) {
        for index in [0, 1] {
            interrupts[index].set(false);
            bus.update_expectations(&packet(addresses[index], &bytes, 135));
            sensors[index].poll(now_ms, &mut sink).unwrap();
            bus.done();
        }
    }
    assert_eq!(sink.take().len(), 2 * (1 + 10));
}

#[test]
fn the_laser_rate_is_the_mean_over_a_period() {
    let rate = |kilo_iterations, period_ms| {
        let settings = Settings {
            kilo_iterations,
            period_ms,
            ..settings()
        };
        let mut bench = Bench::<128>::new(settings, IMAGE);
        bench.i2c.done();
        // Zones are pixels 10 to 18, the reference is pixel 99.
        assert_eq!(bench.sensor.info().pixels, 100);
        bench.sensor.info().laser_millihertz
    };
    // 549,888 pulses in 132 ms: 4,165,818.18 Hz.
    assert_eq!(rate(537, 132), 4_165_818_181);
    assert_eq!(rate(1, 500), 2_048_000);
    assert_eq!(rate(537, 0), 0);
    let config = Settings::new(PixelAddress::new(0));
    assert_eq!((config.kilo_iterations, config.period_ms), (537, 132));
}
