//! The driver of the TDC7200 on a mocked SPI bus: every register access in
//! order, every error, and that the driver works after each.

use std::cell::RefCell;

use crate::common::tdc7200::{
    ARM_1, Access, Bench, CALIBRATIONS, MODE_1, configure, example, mode_1, over, read,
    read_results, write, writes,
};
use crate::common::{Broken, Line, RecordingSink, SinkCall, started};
use dtof_core::PixelAddress;
use dtof_core::fixed::types::{I24F8, U16F16};
use dtof_sensors::dither::Dither;
use dtof_sensors::tdc7200::{
    CalibrationPeriods, Config, ConfigError, Counts, Edge, Error, Mode, Settings, Stops, Tdc7200,
};
use dtof_sensors::{Polled, Sensor};
use embedded_hal::spi::ErrorKind;
use embedded_hal_mock::eh1::spi::Mock;

fn armed() -> Bench<13> {
    let mut bench = Bench::new(mode_1());
    bench.bring_up(MODE_1, ARM_1);
    bench
}

#[test]
fn measures_in_mode_1() {
    let mut bench = armed();
    bench.measure();
    bench.measure();
    let counts = Counts {
        cycles: 2,
        photons: 2,
        ..Counts::default()
    };
    assert_eq!(bench.sensor.counts(), counts);
}

/// 7.061 ns into the histogram are bin 28 of 250 ps and bin 14 of 500 ps.
#[test]
fn each_start_brings_it_up_with_bins_of_its_width() {
    let mut bench = armed();
    for (bin_width, code) in [(500, 14), (250, 28)] {
        bench.sensor.start(U16F16::from_num(bin_width), Dither::OFF);
        assert!(!bench.sensor.is_armed());
        bench.bring_up(MODE_1, ARM_1);
        assert_eq!(bench.serve(&example()), Ok(Polled::Data));
        assert_eq!(
            bench.sink.take(),
            [SinkCall::Photon(7, code), SinkCall::End(1)]
        );
        bench.interrupt.set(true);
    }
}

#[test]
fn stopped_it_is_off_until_it_is_started() {
    let mut bench = armed();
    bench.enable.driven.take();
    bench.sensor.stop();
    assert_eq!(*bench.enable.driven.borrow(), [false]);
    bench.sensor.start(U16F16::lit("250"), Dither::OFF);
    bench.recover();
}

/// 240 ns are 35.975 m.
#[test]
fn it_says_where_its_bins_start() {
    let bench = armed();
    let info = bench.sensor.info();
    // It takes the first photon of a laser cycle only.
    assert_eq!(info.dead_time, u16::MAX);
    assert_eq!((info.pixels, info.bin_width), (8, None));
    assert_eq!(info.offset, I24F8::from_num(240_000.0 * 0.149_896_229));
}

#[test]
fn times_that_mode_1_does_not_measure_are_rejected() {
    let config = |mode| {
        let settings = Settings::new(PixelAddress::new(0), 8_000, U16F16::lit("8000"));
        Config::new(Settings { mode, ..settings }).unwrap()
    };
    let codes = |mode| [11_999, 12_000, 500_000, 500_001].map(|ps| config(mode).code(ps));
    assert_eq!(codes(Mode::One), [u16::MAX, 1, 62, u16::MAX]);
    assert_eq!(codes(Mode::Two), [1, 1, 62, 62]);
}

#[test]
fn every_setting_reaches_its_register() {
    let mut bench = Bench::<13>::new(Settings {
        mode: Mode::Two,
        stops: Stops::Five,
        calibration: CalibrationPeriods::Forty,
        start_edge: Edge::Falling,
        stop_edge: Edge::Falling,
        overflow: 0x1234,
        stop_mask: 0x0123,
        parity: true,
        ..mode_1()
    });
    let values = [0b1100_0100, 0x07, 0xff, 0xff, 0x12, 0x34, 0x01, 0x23];
    bench.bring_up(values, 0b1101_1011);
}

#[test]
fn the_overflow_of_mode_1_is_the_coarse_counters() {
    let mut bench = Bench::<13>::new(Settings {
        overflow: 0x0100,
        ..mode_1()
    });
    let mut values = MODE_1;
    (values[2], values[3]) = (0x01, 0x00);
    bench.bring_up(values, ARM_1);
}

/// Mode 2, five stops of which three come before the clock counter overflows,
/// read one, four or all registers at a time.
#[test]
fn reads_in_chunks_and_gives_the_stops_that_came() {
    fn run<const CHUNK: usize>() {
        let mut bench = Bench::<CHUNK>::new(Settings {
            mode: Mode::Two,
            stops: Stops::Five,
            first_bin_ps: 0,
            ..mode_1()
        });
        let mut values = MODE_1;
        values[0] = 0x44;
        assert_eq!(bench.sensor.info().dead_time, 0);
        bench.bring_up(values, ARM_1 | 0b10);
        bench.interrupt.set(false);

        // 59.18 ps a count: 1000 counts are 59.176 ns. The second stop meets an
        // edge of the reference clock.
        let results = [2000u32, 8, 1000, 9, 0, 200, 3000, 0, 0, 0, 0];
        let mut accesses = read(0x02, &[0x0c]);
        for (first, values) in (0x10..).step_by(CHUNK).zip(results.chunks(CHUNK)) {
            accesses.extend(read_results(first, values));
        }
        for (first, values) in (0x1b..).step_by(CHUNK).zip([2110, 21121].chunks(CHUNK)) {
            accesses.extend(read_results(first, values));
        }
        accesses.extend(write(0x00, ARM_1 | 0b10));
        assert_eq!(bench.poll(&accesses), Ok(Polled::Data));
        // 1000, 2000 and -1000 counts, and 8, 9 and 200 periods of 125 ns.
        let bins = [1_059_176 / 250, 1_243_353 / 250, 24_940_824 / 250];
        let photons = bins.map(|bin| SinkCall::Photon(7, u16::try_from(bin).unwrap_or(u16::MAX)));
        let [a, b, c] = photons;
        assert_eq!(bench.sink.take(), [a, b, c, SinkCall::End(1)]);
        let counts = bench.sensor.counts();
        assert_eq!((counts.photons, counts.overflowed), (3, 1));
    }
    run::<1>();
    run::<4>();
    run::<13>();
}

#[test]
fn a_bin_past_the_histogram_is_passed_on_and_one_before_it_is_rejected() {
    let mut bench = Bench::<13>::new(Settings {
        stops: Stops::Three,
        ..mode_1()
    });
    let mut values = MODE_1;
    values[0] = 0x42;
    bench.bring_up(values, ARM_1);
    // 236.7 ns, 473.4 ns and 0.496 ms.
    let results = over(0x19, &[4000, 0, 8_000, 0, 0x7f_ffff], CALIBRATIONS);
    let accesses = [results, write(0x00, ARM_1)].concat();
    assert_eq!(bench.serve(&accesses), Ok(Polled::Data));
    let [a, b, c] = [u16::MAX, 933, u16::MAX].map(|code| SinkCall::Photon(7, code));
    assert_eq!(bench.sink.take(), [a, b, c, SinkCall::End(1)]);
}

#[test]
fn a_laser_cycle_without_a_stop_is_empty_and_needs_no_calibration() {
    let mut bench = armed();
    let accesses = [over(0x0a, &[0], [0; 2]), write(0x00, ARM_1)].concat();
    assert_eq!(bench.serve(&accesses), Ok(Polled::Data));
    assert_eq!(bench.sink.take(), [SinkCall::End(1)]);
    let counts = Counts {
        cycles: 1,
        empty: 1,
        overflowed: 1,
        ..Counts::default()
    };
    assert_eq!(bench.sensor.counts(), counts);
    bench.interrupt.set(true);
    bench.measure();
}

#[test]
fn parity_is_not_part_of_the_value_and_is_checked() {
    let mut bench = Bench::<13>::new(Settings {
        parity: true,
        ..mode_1()
    });
    let arm = ARM_1 | 0b100_0000;
    bench.bring_up(MODE_1, arm);
    let even = |value: u32| value | (value.count_ones() & 1) << 23;
    let right = over(0x19, &[even(4175)], CALIBRATIONS.map(even));
    let accesses = [right, write(0x00, arm)].concat();
    assert_eq!(bench.serve(&accesses), Ok(Polled::Data));
    assert_eq!(
        bench.sink.take(),
        [SinkCall::Photon(7, 28), SinkCall::End(1)]
    );

    let calibrations = [even(2110), even(21121) ^ 0x80_0000];
    let polled = bench.poll(&over(0x19, &[even(4175)], calibrations));
    assert_eq!(polled, Err(Error::Parity { register: 0x1c }));
    assert_eq!(bench.sink.take(), []);
    bench.interrupt.set(true);
    bench.bring_up(MODE_1, arm);
}

#[test]
fn a_wrong_chip_is_an_error_each_time_and_a_right_one_works_afterwards() {
    let mut bench = Bench::<13>::new(mode_1());
    for _ in 0..2 {
        for _ in 0..2 {
            assert_eq!(bench.wait(3), Ok(Polled::Working));
        }
        bench.now_ms = bench.now_ms.wrapping_add(3);
        let accesses = [read(0x01, &[0xff]), read(0x03, &[0xff])].concat();
        let wrong = Error::WrongChip {
            config2: 0xff,
            int_mask: 0xff,
        };
        assert_eq!(bench.poll(&accesses), Err(wrong));
    }
    assert_eq!(bench.sensor.counts().errors, 2);
    bench.recover();
}

#[test]
fn a_register_that_does_not_take_its_value_is_an_error() {
    let mut bench = Bench::<13>::new(mode_1());
    for _ in 0..2 {
        bench.wait(3).unwrap();
    }
    bench.now_ms = bench.now_ms.wrapping_add(3);
    let accesses = [
        read(0x01, &[0x40]),
        read(0x03, &[0x07]),
        writes(MODE_1),
        read(0x01, &[0x40]),
        read(0x03, &[0x07]),
        read(0x04, &[0xfe]),
    ];
    let error = Error::NotWritten {
        register: 0x04,
        wrote: 0xff,
        read: 0xfe,
    };
    assert_eq!(bench.poll(&accesses.concat()), Err(error));
    bench.recover();
}

#[test]
fn a_start_that_does_not_come_times_out() {
    let mut bench = armed();
    assert_eq!(bench.wait(100), Ok(Polled::Idle));
    assert_eq!(bench.wait(1), Err(Error::Timeout));
    bench.recover();
}

#[test]
fn a_stuck_interrupt_is_an_error_at_the_limit() {
    let mut bench = armed();
    // Twice is not enough, and only polls in a row count.
    for _ in 0..2 {
        bench.interrupt.set(false);
        for _ in 0..2 {
            assert_eq!(bench.poll(&read(0x02, &[0x08])), Ok(Polled::Idle));
        }
        bench.interrupt.set(true);
        assert_eq!(bench.poll(&[]), Ok(Polled::Idle));
    }
    bench.interrupt.set(false);
    for _ in 0..2 {
        assert_eq!(bench.poll(&read(0x02, &[0x00])), Ok(Polled::Idle));
    }
    let stuck = Error::StuckInterrupt { status: 0x08 };
    assert_eq!(bench.poll(&read(0x02, &[0x08])), Err(stuck));
    bench.recover();
}

#[test]
fn a_bus_that_reads_as_ones_is_no_answer() {
    let mut bench = armed();
    assert_eq!(bench.serve(&read(0x02, &[0xff])), Err(Error::NoAnswer));
    bench.recover();
}

#[test]
fn stops_without_a_calibration_are_an_error() {
    let mut bench = armed();
    bench.interrupt.set(false);
    let error = Error::Calibration {
        calibration1: 2110,
        calibration2: 2110,
    };
    let polled = bench.poll(&over(0x19, &[4175], [2110; 2]));
    assert_eq!(polled, Err(error));
    bench.recover();
}

#[test]
fn an_error_of_the_bus_is_inside() {
    let mut bench = armed();
    bench.interrupt.set(false);
    bench.spi.is_unplugged.set(true);
    assert_eq!(bench.poll(&[]), Err(Error::Bus(ErrorKind::Other)));
    bench.spi.is_unplugged.set(false);
    bench.recover();
}

#[test]
fn an_error_of_a_pin_is_inside() {
    let mut bench = armed();
    bench.interrupt.broken.set(true);
    assert_eq!(bench.poll(&[]), Err(Error::Pin(Broken)));
    bench.interrupt.broken.set(false);
    bench.enable.broken.set(true);
    assert_eq!(bench.poll(&[]), Err(Error::Pin(Broken)));
    bench.enable.broken.set(false);
    bench.recover();
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let refused = |change: fn(&mut Settings)| {
        let mut settings = mode_1();
        change(&mut settings);
        Config::new(settings).unwrap_err()
    };
    assert_eq!(refused(|bad| bad.clock_khz = 999), ConfigError::Clock);
    assert_eq!(refused(|bad| bad.clock_khz = 16_001), ConfigError::Clock);
    let zero = refused(|bad| bad.bin_width = U16F16::ZERO);
    assert_eq!(zero, ConfigError::ZeroBinWidth);
    assert_eq!(refused(|bad| bad.overflow = 0), ConfigError::Overflow);
    let masked = refused(|bad| (bad.mode, bad.overflow, bad.stop_mask) = (Mode::Two, 5, 5));
    assert_eq!(masked, ConfigError::Overflow);
}

/// Two of them on one bus, with one chip select each.
#[test]
fn two_sensors_share_a_bus() {
    use embedded_hal_bus::spi::{NoDelay, RefCellDevice};

    let mut bus = Mock::new(&[]);
    let shared = RefCell::new(bus.clone());
    let selects = [Line::new(true), Line::new(true)];
    let interrupts = [Line::new(true), Line::new(true)];
    let config = Config::new(mode_1()).unwrap();
    let mut sensors = [0, 1].map(|index: usize| {
        let select = selects[index].clone();
        let device = RefCellDevice::new(&shared, select, NoDelay).unwrap();
        let enable = Line::new(false);
        let interrupt = interrupts[index].clone();
        started(Tdc7200::<_, _, _>::new(device, interrupt, enable, config))
    });
    let mut sink = RecordingSink::default();

    // What the bus sees: no transactions, but a flush at the end of each.
    let plain = |accesses: Vec<Access>| -> Vec<Access> {
        let start = Access::transaction_start();
        accesses
            .into_iter()
            .filter(|access| *access != start)
            .map(|access| match access == Access::transaction_end() {
                true => Access::flush(),
                false => access,
            })
            .collect()
    };
    for now_ms in [0, 3] {
        for sensor in &mut sensors {
            assert_eq!(sensor.poll(now_ms, &mut sink).unwrap(), Polled::Working);
        }
    }
    for (sensor, select) in sensors.iter_mut().zip(&selects) {
        bus.update_expectations(&plain(configure(MODE_1, ARM_1)));
        select.driven.take();
        assert_eq!(sensor.poll(6, &mut sink).unwrap(), Polled::Working);
        // One selection for each of the 19 transactions.
        assert_eq!(*select.driven.borrow(), [false, true].repeat(19));
        bus.done();
    }
    for (sensor, interrupt) in sensors.iter_mut().zip(&interrupts) {
        interrupt.set(false);
        bus.update_expectations(&plain(example()));
        assert_eq!(sensor.poll(7, &mut sink).unwrap(), Polled::Data);
        assert_eq!(sink.take(), [SinkCall::Photon(7, 28), SinkCall::End(1)]);
        bus.done();
    }
}
