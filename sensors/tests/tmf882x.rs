//! The driver of the TMF8820/21/28 on a mocked I²C bus: every register access
//! in order, every error, and that the driver works after each.

mod common;

use std::cell::RefCell;

use common::tmf882x::{Bench, Counts, measure, packet, packets, page, read, settings, write};
use common::{Broken, Line, Notes};
use dtof_core::PixelAddress;
use dtof_sensors::tmf882x::{
    BootCommand, Command, Config, ConfigError, Error, Settings, SpadMap, Tmf882x, Waiting,
};
use dtof_sensors::{Polled, Sensor, SensorFault};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::{Mock, Transaction as Access};
use proptest::prelude::*;

const IMAGE: &[u8] = &[1, 2, 3];
const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

/// Counts that differ in every bin and use all three bytes.
fn some_counts() -> Counts {
    let mut count = 0u32;
    [(); 10].map(|()| {
        [(); 128].map(|()| {
            count = (count.wrapping_mul(1_664_525).wrapping_add(12345)) & 0xff_ffff;
            count
        })
    })
}

fn measuring() -> Bench<128> {
    let mut bench = Bench::new(settings(), IMAGE);
    bench.bring_up_running();
    bench
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
            spad_map: SpadMap::Map12,
            ..settings()
        },
        IMAGE,
    );
    bench.switch_on(false);
    bench.identify(0x03, &[0x08, 0xFF]);
    bench.work(&[read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x16])]);
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
    assert_eq!(bench.sink.take().len(), 9);
}

#[test]
fn a_result_is_cleared_and_results_alone_are_an_error() {
    let result = [read(0x41, 0xE1, &[0x03]), write(0x41, &[0xE1, 0x02])];
    let mut bench = measuring();
    let good = packets(&some_counts());
    for bytes in &good {
        bench.interrupt.set(false);
        bench.work(&result);
        bench.work(&result);
        bench.packet(bytes).unwrap();
    }
    assert_eq!(bench.sink.take().len(), 10);

    bench.interrupt.set(false);
    bench.work(&result);
    bench.work(&result);
    let polled = bench.poll(&result[..1]);
    assert_eq!(polled, Err(Error::StuckInterrupt { status: 0x03 }));
    stops_measuring(&mut bench, polled);

    bench.wait(1001);
    bench.interrupt.set(false);
    let polled = bench.poll(&result[..1]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Histogram)));
    stops_measuring(&mut bench, polled);
}

/// A sensor that shows one packet for ever is found out, too.
#[test]
fn packets_that_make_no_set_time_out() {
    let mut bench = measuring();
    let good = packets(&some_counts());
    assert_eq!(bench.packet(&good[7]), Ok(Polled::Idle));
    bench.wait(1000);
    assert_eq!(bench.packet(&good[7]), Ok(Polled::Idle));
    bench.wait(1);
    let polled = bench.packet(&good[7]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Histogram)));
    assert_eq!(bench.sensor.counts().left_out, 3);
    stops_measuring(&mut bench, polled);
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

/// An error while measuring that stops it; then measuring again without a reset.
fn stops_measuring(bench: &mut Bench<128>, polled: Result<Polled, Error<ErrorKind, Broken>>) {
    assert!(polled.is_err());
    assert!(!bench.sensor.is_measuring());
    assert_eq!(bench.sink.take(), []);
    bench.interrupt.set(true);
    bench.bring_up_running();
    bench.set(&some_counts());
}

/// An error on the way up; then a reset, loading and measuring.
fn starts_over(bench: &mut Bench<128>) {
    bench.bring_up_loading();
    bench.set(&some_counts());
}

#[test]
fn not_acknowledged_while_measuring() {
    let mut bench = measuring();
    bench.interrupt.set(false);
    let polled = bench.poll(&[read(0x41, 0xE1, &[0]).with_error(NACK)]);
    assert_eq!(polled, Err(Error::Nack(NACK)));
    stops_measuring(&mut bench, polled);

    // In the middle of a packet, of a set: nothing of it is left.
    let packets = packets(&some_counts());
    for bytes in &packets[..15] {
        bench.packet(bytes).unwrap();
    }
    let mut accesses = packet(0x41, &packets[15], 128);
    let last = accesses.pop().unwrap();
    accesses.push(last.with_error(NACK));
    bench.interrupt.set(false);
    let polled = bench.poll(&accesses);
    assert_eq!(polled, Err(Error::Nack(NACK)));
    stops_measuring(&mut bench, polled);
}

/// Nobody answers, or somebody does and takes no more.
#[test]
fn only_an_address_not_acknowledged_is_no_answer() {
    for (source, fault) in [
        (NoAcknowledgeSource::Address, SensorFault::NoAnswer),
        (NoAcknowledgeSource::Unknown, SensorFault::NoAnswer),
        (NoAcknowledgeSource::Data, SensorFault::Bus),
    ] {
        let kind = ErrorKind::NoAcknowledge(source);
        let mut bench = measuring();
        bench.interrupt.set(false);
        let polled = bench.poll(&[read(0x41, 0xE1, &[0]).with_error(kind)]);
        assert_eq!(polled.map_err(SensorFault::from), Err(fault));
        stops_measuring(&mut bench, polled);
    }
}

#[test]
fn an_unplugged_sensor_says_so_again_and_again_and_is_found_when_it_is_back() {
    let mut bench = measuring();
    bench.wait(1000);
    assert_eq!(bench.poll(&[]), Ok(Polled::Idle));
    bench.wait(1);
    let silent = Error::Timeout(Waiting::Histogram);
    assert_eq!(bench.poll(&[]), Err(silent));
    for reset in [false, true, true] {
        bench.switch_on(reset);
        let polled = bench.poll(&[read(0x41, 0xE0, &[0]).with_error(NACK)]);
        assert_eq!(polled, Err(Error::Nack(NACK)));
    }
    assert_eq!(bench.sensor.counts().errors, 4);
    starts_over(&mut bench);
}

#[test]
fn another_error_of_the_bus_is_inside() {
    let mut bench = measuring();
    bench.interrupt.set(false);
    let polled = bench.poll(&[read(0x41, 0xE1, &[0]).with_error(ErrorKind::ArbitrationLoss)]);
    assert_eq!(polled, Err(Error::Bus(ErrorKind::ArbitrationLoss)));
    stops_measuring(&mut bench, polled);
}

#[test]
fn an_error_of_a_pin_is_inside() {
    let mut bench = measuring();
    bench.interrupt.set_broken(true);
    let polled = bench.poll(&[]);
    assert_eq!(polled, Err(Error::Pin(Broken)));
    bench.interrupt.set_broken(false);
    bench.enable.set_broken(true);
    assert_eq!(bench.poll(&[]), Err(Error::Pin(Broken)));
    bench.enable.set_broken(false);
    starts_over(&mut bench);
}

#[test]
fn a_stuck_interrupt_is_an_error_at_the_limit() {
    let mut bench = measuring();
    for _ in 0..2 {
        bench.interrupt.set(false);
        for _ in 0..2 {
            assert_eq!(bench.poll(&[read(0x41, 0xE1, &[0x00])]), Ok(Polled::Idle));
        }
        // Only polls in a row count.
        bench.interrupt.set(true);
        assert_eq!(bench.poll(&[]), Ok(Polled::Idle));
    }
    bench.interrupt.set(false);
    for _ in 0..2 {
        assert_eq!(bench.poll(&[read(0x41, 0xE1, &[0x00])]), Ok(Polled::Idle));
    }
    let polled = bench.poll(&[read(0x41, 0xE1, &[0x40])]);
    assert_eq!(polled, Err(Error::StuckInterrupt { status: 0x40 }));
    stops_measuring(&mut bench, polled);
}

#[test]
fn a_wrong_chip() {
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    bench.switch_on(false);
    let accesses = [read(0x41, 0xE0, &[0x41]), read(0x41, 0xE3, &[0x07])];
    assert_eq!(bench.poll(&accesses), Err(Error::WrongChip { id: 0x07 }));
    starts_over(&mut bench);
}

#[test]
fn a_wrong_application_or_no_image() {
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    let runs = |id| {
        [
            read(0x41, 0xE0, &[0x41]),
            read(0x41, 0xE3, &[0xC8]), // bits 7..6 are not the chip's
            read(0x41, 0x00, &[id]),
        ]
    };
    bench.switch_on(false);
    let wrong = Error::WrongApplication { id: 0x02 };
    assert_eq!(bench.poll(&runs(0x02)), Err(wrong));
    starts_over(&mut bench);

    let mut bench = Bench::<128>::new(settings(), &[]);
    bench.switch_on(false);
    assert_eq!(bench.poll(&runs(0x80)), Err(Error::NoImage));
}

#[test]
fn a_processor_that_is_never_ready() {
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    bench.switch_on(false);
    bench.wait(50);
    assert_eq!(bench.poll(&[read(0x41, 0xE0, &[0x01])]), Ok(Polled::Idle));
    bench.wait(1);
    let polled = bench.poll(&[read(0x41, 0xE0, &[0x01])]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::PowerUp)));
    starts_over(&mut bench);
}

#[test]
fn a_bootloader_that_refuses_or_never_ends() {
    let begin = |bench: &mut Bench<128>, reset| {
        bench.switch_on(reset);
        bench.identify(0x80, &[0x08, 0x14, 0x01, 0x29, 0xC1]);
    };
    let command = BootCommand::DownloadInit;
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    // Refused; done with a wrong checksum; busy with another command.
    let answers = [[0x02, 0x00, 0xFD], [0x00, 0x00, 0xFE], [0x41, 0x00, 0xBE]];
    for (answer, reset) in answers.into_iter().zip([false, true, true]) {
        begin(&mut bench, reset);
        let polled = bench.poll(&[read(0x41, 0x08, &answer)]);
        assert_eq!(polled, Err(Error::Bootloader { command, answer }));
    }
    begin(&mut bench, true);
    let busy = [read(0x41, 0x08, &[0x14, 0x00, 0xEB])];
    bench.wait(50);
    assert_eq!(bench.poll(&busy), Ok(Polled::Idle));
    bench.wait(1);
    let waiting = Waiting::Bootloader(command);
    assert_eq!(bench.poll(&busy), Err(Error::Timeout(waiting)));
    starts_over(&mut bench);
}

#[test]
fn an_image_that_does_not_start() {
    let done = || read(0x41, 0x08, &[0x00, 0x00, 0xFF]);
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    bench.switch_on(false);
    bench.identify(0x80, &[0x08, 0x14, 0x01, 0x29, 0xC1]);
    bench.work(&[done(), write(0x41, &[0x08, 0x43, 0x02, 0x00, 0x00, 0xBA])]);
    bench.work(&[done(), write(0x41, &[0x08, 0x41, 0x03, 1, 2, 3, !0x4A])]);
    bench.work(&[done(), write(0x41, &[0x08, 0x11, 0x00, 0xEE])]);
    bench.wait(60);
    assert_eq!(bench.poll(&[read(0x41, 0x00, &[0x80])]), Ok(Polled::Idle));
    bench.wait(1);
    let polled = bench.poll(&[read(0x41, 0x00, &[0x80])]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Application)));
    starts_over(&mut bench);
}

#[test]
fn an_application_that_refuses_never_ends_or_shows_another_page() {
    let begin = |bench: &mut Bench<128>, reset| {
        bench.switch_on(reset);
        bench.identify(0x03, &[0x08, 0xFF]);
    };
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    begin(&mut bench, false);
    let refused = Error::Refused {
        command: Command::Stop,
        status: 0x06,
    };
    assert_eq!(bench.poll(&[read(0x41, 0x08, &[0x06])]), Err(refused));

    begin(&mut bench, true);
    bench.work(&[read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x16])]);
    let accesses = [read(0x41, 0x08, &[0x00]), read(0x41, 0x20, &[0x19])];
    assert_eq!(bench.poll(&accesses), Err(Error::WrongPage { page: 0x19 }));

    // `accepted` is the end of measure alone.
    begin(&mut bench, true);
    bench.work(&[read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x16])]);
    bench.work(&page(0x41));
    bench.work(&measure(0x41));
    let refused = Error::Refused {
        command: Command::Measure,
        status: 0x00,
    };
    assert_eq!(bench.poll(&[read(0x41, 0x08, &[0x00])]), Err(refused));

    begin(&mut bench, true);
    bench.wait(50);
    assert_eq!(bench.poll(&[read(0x41, 0x08, &[0xFF])]), Ok(Polled::Idle));
    bench.wait(1);
    let waiting = Waiting::Command(Command::Stop);
    let polled = bench.poll(&[read(0x41, 0x08, &[0xFF])]);
    assert_eq!(polled, Err(Error::Timeout(waiting)));
    starts_over(&mut bench);
}

/// A wrong packet in the middle of a set costs that set and nothing else; the
/// driver goes on measuring.
#[test]
fn a_wrong_packet_costs_its_set() {
    let good = packets(&some_counts());
    let broken = |at: usize, byte: usize, value: u8| {
        let mut bytes = good[at].clone();
        bytes[byte] = value;
        bytes
    };
    let cases = [
        // The calibration's histograms, and a result.
        (broken(12, 0, 0x82), Error::ForeignResult { result: 0x82 }),
        (broken(12, 0, 0x10), Error::ForeignResult { result: 0x10 }),
        (broken(12, 5, 100), Error::WrongSize { size: 100 }),
        (broken(12, 5, 0), Error::WrongSize { size: 0 }),
        // One missing, one doubled, one of another plane, one that cannot be.
        (good[13].clone(), out_of_order(12, 13)),
        (good[11].clone(), out_of_order(12, 11)),
        (good[22].clone(), out_of_order(12, 22)),
        (broken(12, 4, 30), out_of_order(12, 30)),
        (broken(12, 4, 255), out_of_order(12, 255)),
    ];
    for (bytes, error) in cases {
        let mut bench = measuring();
        for bytes in &good[..12] {
            assert_eq!(bench.packet(bytes), Ok(Polled::Working));
        }
        assert_eq!(bench.packet(&bytes), Err(error));
        assert!(bench.sensor.is_measuring());
        // The rest of the set is of no use.
        for bytes in &good[13..] {
            assert_eq!(bench.packet(bytes), Ok(Polled::Idle));
        }
        assert_eq!(bench.sink.take(), []);
        assert_eq!(bench.sensor.counts().left_out, 17);
        bench.set(&some_counts());
    }
}

/// A set that breaks off with the first packet of the next loses only itself.
#[test]
fn a_set_that_begins_too_early_is_kept() {
    let good = packets(&some_counts());
    let mut bench = measuring();
    for bytes in &good[..25] {
        bench.packet(bytes).unwrap();
    }
    assert_eq!(bench.sink.take().len(), 5);
    assert_eq!(bench.packet(&good[0]), Err(out_of_order(25, 0)));
    for bytes in &good[1..] {
        bench.packet(bytes).unwrap();
    }
    assert_eq!(bench.sink.take().len(), 10);
    bench.set(&some_counts());
}

fn out_of_order(expected: u8, found: u8) -> Error<ErrorKind, Broken> {
    Error::OutOfOrder { expected, found }
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
    let zero = refused(|bad| bad.kilo_iterations = 0);
    assert_eq!(zero, ConfigError::ZeroIterations);
    let pixels = refused(|bad| bad.first_pixel = PixelAddress(u16::MAX - 7));
    assert_eq!(pixels, ConfigError::Pixels);
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
        bench.work(&[read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x16])]);
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
    let mut sink = Notes::default();
    let addresses = [0x42, 0x43];
    let interrupts = [Line::new(true), Line::new(true)];
    let mut sensors = [0, 1].map(|index: usize| {
        let config = Config::new(Settings {
            address: addresses[index],
            ..settings()
        });
        let device = RefCellDevice::new(&shared);
        let interrupt = interrupts[index].clone();
        Tmf882x::<_, _, _>::new(device, interrupt, Line::new(false), &[], config.unwrap())
    });

    let mut now_ms = 0;
    for (sensor, address) in sensors.iter_mut().zip(addresses) {
        let identify = vec![
            read(0x41, 0xE0, &[0x41]),
            read(0x41, 0xE3, &[0x08]),
            read(0x41, 0x00, &[0x03]),
            write(0x41, &[0x08, 0xFF]),
        ];
        let load = vec![read(0x41, 0x08, &[0x00]), write(0x41, &[0x08, 0x16])];
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
    assert_eq!(sink.take().len(), 20);
}
