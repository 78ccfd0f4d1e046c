//! Every error of the driver of the TMF8820/21/28 on a mocked I²C bus, and that the
//! driver works after each.

use crate::common::tmf882x::{
    Bench, IMAGE, NACK, measure, measuring, packet, packets, page, read, settings, some_counts,
    stop, stopped, write,
};
use crate::common::{Broken, SinkCall};
use dtof_sensors::tmf882x::{BootCommand, Command, DeviceError, Error, Waiting};
use dtof_sensors::{Polled, Sensor, SensorFault};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::i2c::Transaction as Access;

/// An error while measuring that stops it; then measuring again without a reset. The poll has sent [`stop`].
fn stops_measuring(bench: &mut Bench<128>, polled: Result<Polled, Error<ErrorKind, Broken>>) {
    assert!(polled.is_err());
    assert!(!bench.sensor.is_measuring());
    let is_frame = |given: &SinkCall| matches!(given, SinkCall::Frame(_));
    assert!(bench.sink.take().iter().all(is_frame));
    bench.interrupt.set(true);
    bench.bring_up_running();
    bench.set(&some_counts());
}

/// Polls just before and just after a time limit.
fn times_out(bench: &mut Bench<128>, after_ms: u32, accesses: &[Access], waiting: Waiting) {
    bench.wait(after_ms);
    assert_eq!(bench.poll(accesses), Ok(Polled::Idle));
    bench.wait(1);
    assert_eq!(bench.poll(accesses), Err(Error::Timeout(waiting)));
}

/// An error on the way up, which has driven ENABLE low; then a reset, loading and measuring.
fn starts_over(bench: &mut Bench<128>) {
    assert_eq!(bench.enable.driven.borrow().last(), Some(&false));
    bench.bring_up_loading();
    bench.set(&some_counts());
}

#[test]
fn not_acknowledged_while_measuring() {
    let mut bench = measuring();
    let polled = bench.serve(&[read(0x41, 0xE1, &[0]).with_error(NACK), stop()]);
    assert_eq!(polled, Err(Error::Nack(NACK)));
    stops_measuring(&mut bench, polled);

    // In the middle of a packet, of a set: nothing of it is left.
    let packets = packets(&some_counts());
    for bytes in &packets[..15] {
        bench.packet(bytes).unwrap();
    }
    let mut accesses = packet(0x41, &packets[15], 128);
    let last = accesses.pop().unwrap();
    accesses.extend([last.with_error(NACK), stop()]);
    let polled = bench.serve(&accesses);
    assert_eq!(polled, Err(Error::Nack(NACK)));
    stops_measuring(&mut bench, polled);
}

/// No device answers, or one does and takes no more.
#[test]
fn only_an_address_not_acknowledged_is_no_answer() {
    for (source, fault) in [
        (NoAcknowledgeSource::Address, SensorFault::NoAnswer),
        (NoAcknowledgeSource::Unknown, SensorFault::NoAnswer),
        (NoAcknowledgeSource::Data, SensorFault::Bus),
    ] {
        let kind = ErrorKind::NoAcknowledge(source);
        let mut bench = measuring();
        let polled = bench.serve(&[read(0x41, 0xE1, &[0]).with_error(kind), stop()]);
        assert_eq!(polled.map_err(SensorFault::from), Err(fault));
        stops_measuring(&mut bench, polled);
    }
}

#[test]
fn an_unplugged_sensor_says_so_again_and_again_and_is_found_when_it_is_back() {
    let mut bench = measuring();
    bench.set(&some_counts());
    let stop = || stop().with_error(NACK);
    bench.wait(1000);
    assert_eq!(bench.poll(&[]), Ok(Polled::Idle));
    bench.wait(1);
    assert_eq!(bench.poll(&[stop()]), Err(Error::Timeout(Waiting::Data)));
    for _ in 0..3 {
        // It does not take the stop, so ENABLE has gone low.
        assert_eq!(bench.enable.driven.borrow().last(), Some(&false));
        bench.switch_on(true);
        let polled = bench.poll(&[read(0x41, 0xE0, &[0]).with_error(NACK), stop()]);
        assert_eq!(polled, Err(Error::Nack(NACK)));
    }
    assert_eq!(bench.sensor.counts().errors, 4);
    starts_over(&mut bench);
}

#[test]
fn another_error_of_the_bus_is_inside() {
    let mut bench = measuring();
    let lost = read(0x41, 0xE1, &[0]).with_error(ErrorKind::ArbitrationLoss);
    let polled = bench.serve(&[lost, stop()]);
    assert_eq!(polled, Err(Error::Bus(ErrorKind::ArbitrationLoss)));
    stops_measuring(&mut bench, polled);
}

#[test]
fn an_error_of_a_pin_is_inside() {
    let mut bench = measuring();
    bench.interrupt.broken.set(true);
    let polled = bench.poll(&[stop()]);
    assert_eq!(polled, Err(Error::Pin(Broken)));
    bench.interrupt.broken.set(false);
    bench.enable.broken.set(true);
    assert_eq!(bench.poll(&[stop()]), Err(Error::Pin(Broken)));
    bench.enable.broken.set(false);
    bench.bring_up_loading();
    bench.set(&some_counts());
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
    let polled = bench.poll(&[read(0x41, 0xE1, &[0x40]), stop()]);
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
    let not_ready = [read(0x41, 0xE0, &[0x01])];
    times_out(&mut bench, 50, &not_ready, Waiting::PowerUp);
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
        assert_eq!(
            polled,
            Err(Error::Device(DeviceError::Bootloader { command, answer }))
        );
    }
    begin(&mut bench, true);
    let busy = [read(0x41, 0x08, &[0x14, 0x00, 0xEB])];
    times_out(&mut bench, 50, &busy, Waiting::Bootloader(command));
    starts_over(&mut bench);
}

#[test]
fn an_image_that_does_not_start() {
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    bench.switch_on(false);
    bench.load();
    let bootloader = [read(0x41, 0x00, &[0x80])];
    times_out(&mut bench, 60, &bootloader, Waiting::Application);
    starts_over(&mut bench);
}

#[test]
fn an_application_that_refuses_never_ends_or_shows_another_page() {
    let begin = |bench: &mut Bench<128>, reset| {
        bench.switch_on(reset);
        bench.identify(0x03, &[0x08, 0xFF]);
    };
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    // From 0x10 on a status is a command that is under way.
    for (reset, status) in [(false, 0x06), (true, 0x0F)] {
        begin(&mut bench, reset);
        let refused = Error::Refused {
            command: Command::Stop,
            status,
        };
        assert_eq!(bench.poll(&[read(0x41, 0x08, &[status])]), Err(refused));
    }

    begin(&mut bench, true);
    bench.work(&stopped(0x41));
    let accesses = [read(0x41, 0x08, &[0x00]), read(0x41, 0x20, &[0x19])];
    assert_eq!(bench.poll(&accesses), Err(Error::WrongPage { page: 0x19 }));

    // `accepted` is the end of measure alone.
    begin(&mut bench, true);
    bench.work(&stopped(0x41));
    bench.work(&page(0x41));
    bench.work(&measure(0x41));
    let refused = Error::Refused {
        command: Command::Measure,
        status: 0x00,
    };
    let polled = bench.poll(&[read(0x41, 0x08, &[0x00]), stop()]);
    assert_eq!(polled, Err(refused));

    for status in [0x10, 0xFF] {
        begin(&mut bench, true);
        let busy = || read(0x41, 0x08, &[status]);
        bench.wait(50);
        assert_eq!(bench.poll(&[busy()]), Ok(Polled::Idle));
        bench.wait(1);
        // It may have taken the command to measure.
        let polled = bench.poll(&[busy(), stop()]);
        let timeout = Error::Timeout(Waiting::Command(Command::Stop));
        assert_eq!(polled, Err(timeout));
    }
    starts_over(&mut bench);
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
    assert_eq!(bench.sink.take().len(), 1 + 10);

    bench.interrupt.set(false);
    bench.work(&result);
    bench.work(&result);
    let polled = bench.poll(&[result[0].clone(), stop()]);
    assert_eq!(polled, Err(Error::StuckInterrupt { status: 0x03 }));
    stops_measuring(&mut bench, polled);

    bench.wait(1001);
    let polled = bench.serve(&[result[0].clone(), stop()]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Data)));
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
    let mut accesses = packet(0x41, &good[7], 128);
    accesses.push(stop());
    let polled = bench.serve(&accesses);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Data)));
    assert_eq!(bench.sensor.counts().left_out, 3);
    // It has given none that is good: to stop it does not help.
    bench.interrupt.set(true);
    starts_over(&mut bench);
    bench.wait(1001);
    let polled = bench.poll(&[stop()]);
    assert_eq!(polled, Err(Error::Timeout(Waiting::Data)));
    stops_measuring(&mut bench, polled);
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
        (
            broken(12, 0, 0x82),
            Error::Device(DeviceError::ForeignResult { result: 0x82 }),
        ),
        (
            broken(12, 0, 0x10),
            Error::Device(DeviceError::ForeignResult { result: 0x10 }),
        ),
        (
            broken(12, 5, 100),
            Error::Device(DeviceError::WrongSize { size: 100 }),
        ),
        (
            broken(12, 5, 0),
            Error::Device(DeviceError::WrongSize { size: 0 }),
        ),
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
        // Its laser cycles are over all the same.
        assert_eq!(bench.sink.take(), [SinkCall::Frame(537 * 1024)]);
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
    assert_eq!(bench.sink.take().len(), 1 + 5);
    assert_eq!(bench.packet(&good[0]), Err(out_of_order(25, 0)));
    for bytes in &good[1..] {
        bench.packet(bytes).unwrap();
    }
    assert_eq!(bench.sink.take().len(), 1 + 10);
    bench.set(&some_counts());
}

fn out_of_order(expected: u8, found: u8) -> Error<ErrorKind, Broken> {
    Error::Device(DeviceError::OutOfOrder { expected, found })
}

#[test]
fn a_stop_switches_the_chip_off_whether_or_not_it_acknowledges() {
    for (has_failed, access) in [
        (false, stop()),
        (false, stop().with_error(NACK)),
        // It has not answered the stop after the error.
        (true, stop()),
    ] {
        let mut bench = measuring();
        if has_failed {
            let polled = bench.serve(&[read(0x41, 0xE1, &[0]).with_error(NACK), stop()]);
            assert_eq!(polled, Err(Error::Nack(NACK)));
        }
        bench.enable.driven.take();
        bench.i2c.update_expectations(&[access]);
        bench.sensor.stop();
        bench.i2c.done();
        assert_eq!(*bench.enable.driven.borrow(), [false]);
    }
}

/// Nothing but the command to measure makes a command to stop needed.
#[test]
fn a_stop_before_it_measures_sends_nothing() {
    let mut bench = Bench::<128>::new(settings(), IMAGE);
    bench.switch_on(false);
    bench.identify(0x03, &[0x08, 0xFF]);
    bench.work(&stopped(0x41));
    bench.enable.driven.take();
    bench.i2c.update_expectations(&[]);
    bench.sensor.stop();
    bench.i2c.done();
    assert_eq!(*bench.enable.driven.borrow(), [false]);
}
