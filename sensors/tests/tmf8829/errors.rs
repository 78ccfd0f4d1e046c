//! Every error of the driver of the TMF8829, and that it works after each.

use crate::common::tmf8829::bench::{Bench, settings};
use crate::common::tmf8829::bus::Fault;
use crate::common::{Broken, SinkCall};
use dtof_chips::Chip;
use dtof_chips::tmf8829::frame;
use dtof_core::fixed::types::U16F16;
use dtof_sensors::dither::Dither;
use dtof_sensors::tmf8829::{
    BootCommand, Command, DeviceError, Error, Interface, Settings, Waiting, Zones,
};
use dtof_sensors::{Polled, Sensor, SensorFault};
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};

type Of = Error<ErrorKind, Broken>;

const NACK: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);

fn bench() -> Bench<128> {
    Bench::new(settings(Zones::Z8x8))
}

fn measuring() -> Bench<128> {
    let mut bench = bench();
    bench.bring_up();
    bench
}

fn poll(bench: &mut Bench<128>) -> Result<Polled, Of> {
    bench.now_ms = bench.now_ms.wrapping_add(1);
    bench.sensor.poll(bench.now_ms, &mut bench.sink)
}

/// Polls until there is an error, so many milliseconds at most.
fn error(bench: &mut Bench<128>, within_ms: u32) -> Of {
    for _ in 0..within_ms {
        if let Err(error) = poll(bench) {
            assert!(!error.to_string().contains('\n'));
            return error;
        }
    }
    panic!("no error within {within_ms} ms");
}

/// It comes up again, and whole frames come.
fn recovers(bench: &mut Bench<128>) {
    let errors = bench.sensor.counts().errors;
    bench.bring_up();
    bench.sink.take();
    let given = bench.frames(3);
    let frames = given
        .iter()
        .filter(|given| matches!(given, SinkCall::Frame(_)));
    assert!(frames.count() >= 1);
    assert_eq!(bench.sensor.counts().errors, errors);
}

/// Writes to the chip behind the driver's back.
fn write(bench: &Bench<128>, bytes: &[u8]) {
    bench.bus.0.borrow_mut().chip.write(bytes);
}

/// Polls until the last transfer is such a write.
fn until_written(bench: &mut Bench<128>, start: &[u8]) {
    for _ in 0..500 {
        poll(bench).unwrap();
        if bench.bus.written(start) > 0 {
            return;
        }
    }
    panic!("{start:02x?} is not written");
}

#[test]
fn a_bus_or_a_sensor_that_fails_costs_one_error_and_a_new_start() {
    for fault in [Fault::Nack, Fault::Late] {
        let mut bench = measuring();
        bench.frames(1);
        // In the middle of a frame.
        poll(&mut bench).unwrap();
        poll(&mut bench).unwrap();
        bench.bus.fail_next(fault);
        let expected = match fault {
            Fault::Nack => Error::Nack(NACK),
            _ => Error::Bus(ErrorKind::Bus),
        };
        assert_eq!(poll(&mut bench), Err(expected));
        assert!(!bench.sensor.is_measuring());
        assert_eq!(bench.sensor.counts().broken, 1);
        recovers(&mut bench);
    }
    let mut bench = measuring();
    bench.bus.0.borrow_mut().is_unplugged = true;
    let mut errors = 0;
    // INT is high: only silence shows it at first.
    for _ in 0..3000 {
        let before = bench.bus.0.borrow().log.len();
        let unplugged = [Error::Nack(NACK), Error::Timeout(Waiting::Data)];
        let polled = poll(&mut bench);
        let log = &bench.bus.0.borrow().log[before..];
        if let Err(error) = polled {
            assert!(unplugged.contains(&error), "{error}");
            errors += 1;
            // The transfer that failed, and the command to stop.
            assert_eq!(log.len(), 1 + usize::from(error == Error::Nack(NACK)));
            assert_eq!(log.last().unwrap().0, [0x08, 0xFF]);
        } else {
            assert!(log.len() <= 1);
        }
    }
    assert!(errors > 50);
    assert_eq!(errors, bench.sensor.counts().errors);
    bench.bus.0.borrow_mut().chip.reset();
    bench.bus.0.borrow_mut().is_unplugged = false;
    while poll(&mut bench).is_err() {}
    recovers(&mut bench);
}

#[test]
fn another_chip_another_program_no_image() {
    for (register, value, expected) in [
        (0xE3, 0x08, Error::WrongChip { id: 0x08 }),
        (0x00, 0x03, Error::WrongApplication { id: 0x03 }),
    ] {
        let mut bench = bench();
        bench.bus.0.borrow_mut().chip.set(register, value);
        assert_eq!(error(&mut bench, 20), expected);
        recovers(&mut bench);
    }
    for (image, expected) in [
        (Vec::new(), Error::NoImage),
        (
            vec![1; 16 * 1024 + 1],
            Error::Device(DeviceError::LongImage),
        ),
    ] {
        let mut bench = bench();
        bench.load_with(settings(Zones::Z8x8), image.leak());
        assert_eq!(error(&mut bench, 20), expected);
    }
    assert_eq!(SensorFault::from(Of::NoImage), SensorFault::NoImage);
    assert_eq!(
        SensorFault::from(Of::Device(DeviceError::LongImage)),
        SensorFault::Rejected
    );
}

#[test]
fn a_processor_that_is_never_ready() {
    let mut bench = bench();
    bench.bus.0.borrow_mut().chip.is_dead = true;
    assert_eq!(error(&mut bench, 100), Error::Timeout(Waiting::PowerUp));
    bench.bus.0.borrow_mut().chip.is_dead = false;
    recovers(&mut bench);
}

#[test]
fn a_bootloader_that_refuses_or_never_ends() {
    let command = BootCommand::Upload;
    for status in [1, 2, 3] {
        let mut bench = bench();
        until_written(&mut bench, &[0x08, 0x45]);
        bench.bus.0.borrow_mut().chip.set(0x08, status);
        let expected = Error::Device(DeviceError::Bootloader { command, status });
        assert_eq!(error(&mut bench, 2), expected);
        recovers(&mut bench);
    }
    let mut bench = bench();
    until_written(&mut bench, &[0x08, 0x45]);
    bench.bus.0.borrow_mut().chip.set(0x08, 0x45);
    let expected = Error::Timeout(Waiting::Bootloader(command));
    assert_eq!(error(&mut bench, 60), expected);
    recovers(&mut bench);
}

#[test]
fn an_image_that_does_not_arrive_or_start() {
    let mut bench = bench();
    until_written(&mut bench, &[0xFF]);
    // It counts more words than will come.
    write(&bench, &[0x08, 0x45, 6, 0, 0, 1, 0, 0xFF, 0x0F]);
    let expected = Error::Timeout(Waiting::Bootloader(BootCommand::Upload));
    assert_eq!(error(&mut bench, 200), expected);
    recovers(&mut bench);

    let mut bench = self::bench();
    until_written(&mut bench, &[0x08, 0x16]);
    bench.bus.0.borrow_mut().chip.set(0x00, 0x80);
    assert_eq!(error(&mut bench, 100), Error::Timeout(Waiting::Application));
    recovers(&mut bench);
}

#[test]
fn an_application_that_refuses_never_ends_or_shows_another_page() {
    let refused = |start: &[u8], command| {
        let mut bench = bench();
        until_written(&mut bench, start);
        bench.bus.0.borrow_mut().chip.answer(6);
        let expected = Error::Refused { command, status: 6 };
        assert_eq!(error(&mut bench, 2), expected);
        recovers(&mut bench);
    };
    refused(&[0x08, 0x40], Command::LoadPreset(0x40));
    refused(&[0x08, 0x15], Command::WritePage);
    refused(&[0x08, 0x10], Command::Measure);

    let mut bench = bench();
    bench.bus.0.borrow_mut().chip.run();
    until_written(&mut bench, &[0x08, 0xFF]);
    bench.bus.0.borrow_mut().chip.answer(0xFF);
    let expected = Error::Timeout(Waiting::Command(Command::Stop));
    assert_eq!(error(&mut bench, 60), expected);
    recovers(&mut bench);

    let mut bench = self::bench();
    until_written(&mut bench, &[0x08, 0x40]);
    bench.bus.0.borrow_mut().chip.answer(0);
    bench.bus.0.borrow_mut().chip.set(0x20, 0x18);
    assert_eq!(error(&mut bench, 3), Error::WrongPage { page: 0x18 });
    recovers(&mut bench);
}

#[test]
fn an_interrupt_that_is_stuck() {
    let mut bench = measuring();
    bench.frames(3);
    bench.bus.0.borrow_mut().chip.is_halted = true;
    while !bench.bus.0.borrow().chip.fifo.is_empty() {
        poll(&mut bench).unwrap();
    }
    bench.bus.0.borrow_mut().stuck = Some(false);
    let expected = Error::StuckInterrupt { status: 0 };
    assert_eq!(error(&mut bench, 5), expected);
    bench.bus.0.borrow_mut().stuck = None;
    bench.bus.0.borrow_mut().chip.is_halted = false;
    recovers(&mut bench);

    bench.bus.0.borrow_mut().stuck = Some(true);
    let expected = Error::Timeout(Waiting::Data);
    assert_eq!(error(&mut bench, 10_000), expected);
    bench.bus.0.borrow_mut().stuck = None;
    recovers(&mut bench);
}

/// Bytes that are no frame of this measurement.
#[test]
fn what_is_no_frame_ends_the_measurement() {
    let results = [0; 384];
    let histograms = [0; 25_344];
    let mut overrun = frame(0x20, 0, 9, &histograms, 1);
    overrun[0] = 0x20;
    let cases = [
        (
            overrun,
            Error::Device(DeviceError::Overrun { status: 0x20 }),
        ),
        // Of another mode, of another format, of a time slot there is not, a reference frame.
        (frame(0x22, 0, 9, &histograms, 1), foreign(0x22, 0, 25_368)),
        (frame(0x10, 3, 9, &results, 1), foreign(0x10, 3, 408)),
        (frame(0x10, 0x42, 9, &results, 1), foreign(0x10, 0x42, 408)),
        (frame(0x20, 2, 9, &histograms, 1), foreign(0x20, 2, 25_368)),
        (frame(0x30, 0, 9, &results, 1), foreign(0x30, 0, 408)),
        // Of another length.
        (
            frame(0x20, 1, 9, &histograms[3..], 1),
            foreign(0x20, 1, 25_365),
        ),
        (vec![0; 21], foreign(0, 0, 0)),
        (
            vec![0xFF; 21],
            Error::Device(DeviceError::Overrun { status: 0xFF }),
        ),
    ];
    for (bytes, expected) in cases {
        let mut bench = measuring();
        bench.bus.0.borrow_mut().chip.is_halted = true;
        bench.bus.0.borrow_mut().chip.present(&bytes, 8);
        bench.sink.take();
        assert_eq!(error(&mut bench, 5), expected);
        assert_eq!(bench.sink.take(), []);
        assert!(!bench.sensor.is_measuring());
        bench.bus.0.borrow_mut().chip.is_halted = false;
        recovers(&mut bench);
    }
}

fn foreign(id: u8, part: u8, payload: u16) -> Of {
    Error::Device(DeviceError::ForeignFrame { id, part, payload })
}

/// Its FIFO may stay out of step: to stop and to measure again does not help, so it is switched off and
/// on.
#[test]
fn a_sensor_that_gives_no_frame_is_reset() {
    let astray = |bench: &Bench<128>| {
        let mut wires = bench.bus.0.borrow_mut();
        if wires.chip.is_measuring && wires.chip.page(0xE1) == 0 {
            wires.chip.present(&[0; 21], 8);
        }
        wires.chip.is_halted = true;
    };
    let mut bench = measuring();
    bench.frames(3);
    bench.bus.0.borrow_mut().chip.fifo.clear();
    let mut errors = Vec::new();
    for _ in 0..200 {
        astray(&bench);
        errors.extend(poll(&mut bench).err());
        if bench.bus.0.borrow().chip.ram.is_empty() {
            break;
        }
    }
    // One of the measurement that went well before, one of that which never does.
    assert_eq!(errors, [foreign(0, 0, 0); 2]);
    bench.bus.0.borrow_mut().chip.is_halted = false;
    recovers(&mut bench);
}

/// A preset has the default address.
#[test]
fn a_sensor_that_begins_again_keeps_its_address() {
    let mut bench = Bench::<128>::new(Settings {
        interface: Interface::I2c { address: 0x42 },
        ..settings(Zones::Z8x8)
    });
    bench.bring_up();
    bench.frames(1);
    bench.bus.fail_next(Fault::Late);
    while poll(&mut bench).is_ok() {}
    bench.bus.0.borrow_mut().log.clear();
    recovers(&mut bench);
    assert_eq!(bench.sensor.address(), 0x42);
    // It was not loaded again.
    assert_eq!(bench.bus.written(&[0x08, 0x16]), 0);
}

/// Its histograms so far have been given; that it broke off is counted.
#[test]
fn a_frame_without_its_end_is_broken() {
    let mut bench = measuring();
    let bytes = frame(0x20, 1, 9, &[0; 25_344], 1);
    bench.bus.0.borrow_mut().chip.is_halted = true;
    bench.bus.0.borrow_mut().chip.present(&bytes[..20_000], 8);
    bench.sink.take();
    assert_eq!(
        error(&mut bench, 500),
        Error::Device(DeviceError::NoEnd { marker: 0 })
    );
    assert_eq!(bench.sensor.counts().broken, 1);
    bench.bus.0.borrow_mut().chip.is_halted = false;
    recovers(&mut bench);
}

#[test]
fn missed_frames_are_counted_and_the_next_is_good() {
    let mut bench = measuring();
    bench.frames(2);
    bench.bus.0.borrow_mut().chip.number += 3;
    let missed = error(&mut bench, 500);
    assert_eq!(
        missed,
        Error::Device(DeviceError::Missed {
            expected: 103,
            found: 106
        })
    );
    assert!(bench.sensor.is_measuring());
    bench.frames(4);
    let counts = bench.sensor.counts();
    assert_eq!((counts.missed, counts.errors, counts.broken), (3, 1, 0));
    // The whole of 2³² numbers.
    bench.bus.0.borrow_mut().chip.number = 0;
    assert!(matches!(
        error(&mut bench, 500),
        Error::Device(DeviceError::Missed { found: 0, .. })
    ));
    assert_eq!(bench.sensor.counts().missed, 3);
}

#[test]
fn frames_that_are_not_valid_are_counted() {
    for (flags, counted) in [(0x00, 1), (0x41, 1), (0x81, 1), (0x01, 0), (0x39, 0)] {
        let mut bench = measuring();
        bench.frames(1);
        bench.bus.0.borrow_mut().chip.flags = flags;
        bench.frames(1);
        bench.bus.0.borrow_mut().chip.flags = 1;
        if counted > 0 {
            assert_eq!(
                error(&mut bench, 500),
                Error::Device(DeviceError::Aborted { flags })
            );
        }
        bench.frames(3);
        let counts = bench.sensor.counts();
        assert_eq!((counts.aborted, counts.errors), (counted, counted));
        assert_eq!(counts.limited, u32::from(flags == 0x39));
        assert!(bench.sensor.is_measuring());
    }
}

#[test]
fn a_stop_stops_the_chip_and_a_start_begins_anew() {
    let mut bench = measuring();
    bench.frames(1);
    bench.sensor.stop();
    assert!(!bench.bus.0.borrow().chip.is_measuring);
    bench.bus.0.borrow_mut().log.clear();
    bench.sensor.start(U16F16::ZERO, Dither::OFF);
    recovers(&mut bench);
    bench.sensor.stop();
    bench.sensor.stop();
    // Both at the end: the first may be lost. When it came up it had been switched off, and was not measuring.
    assert_eq!(bench.bus.written(&[0x08, 0xFF]), 2);
}

/// After an error at any transfer from the command to measure on, with an ENABLE that is not wired.
#[test]
fn a_stop_after_an_error_sends_the_command_to_stop() {
    let (mut before, mut later) = (0, 0);
    for transfers in 0..120 {
        let mut bench = bench();
        for _ in 0..transfers {
            bench.poll();
        }
        bench.bus.fail_next(Fault::Late);
        error(&mut bench, 500);
        let was_sent = bench.bus.written(&[0x08, 0x10]) > 0;
        bench.bus.0.borrow_mut().log.clear();
        bench.sensor.stop();
        let stops = bench.bus.written(&[0x08, 0xFF]);
        assert_eq!(stops, usize::from(was_sent), "{transfers}");
        *(if was_sent { &mut later } else { &mut before }) += 1;
    }
    assert!(before > 10 && later > 10, "{before} {later}");
}

/// Its laser is off then, whatever the bus does.
#[test]
fn a_stop_that_the_chip_does_not_acknowledge_switches_it_off() {
    // The driver has met the error before, and has switched it off, or meets it now.
    for has_failed in [false, true] {
        let mut bench = measuring();
        bench.bus.0.borrow_mut().is_unplugged = true;
        if has_failed {
            error(&mut bench, 10_000);
        }
        assert_eq!(bench.sensor.is_measuring(), !has_failed);
        assert_eq!(bench.bus.0.borrow().chip.is_measuring, !has_failed);
        bench.sensor.stop();
        assert!(!bench.bus.0.borrow().chip.is_measuring);
        bench.bus.0.borrow_mut().is_unplugged = false;
        bench.sensor.start(U16F16::ZERO, Dither::OFF);
        recovers(&mut bench);
    }
}

/// Polls a millisecond until the next transfer.
fn until_the_next_transfer(bench: &mut Bench<128>) -> u32 {
    let before = bench.bus.0.borrow().log.len();
    let mut waited_ms = 0;
    while bench.bus.0.borrow().log.len() == before {
        poll(bench).unwrap();
        waited_ms += 1;
    }
    waited_ms
}

/// More than 3 ms from ENABLE to the first access, as long before it if ENABLE goes low, and more than 10 ms from the start
/// of the image.
#[test]
fn a_sensor_that_starts_is_given_its_time() {
    let mut bench = bench();
    // The first poll drives ENABLE.
    assert_eq!(until_the_next_transfer(&mut bench), 1 + 4);
    until_written(&mut bench, &[0x08, 0x16]);
    assert_eq!(until_the_next_transfer(&mut bench), 11);
    let mut bench = Bench::<128>::new(Settings {
        interface: Interface::I2c { address: 0x42 },
        ..settings(Zones::Z8x8)
    });
    assert_eq!(until_the_next_transfer(&mut bench), 1 + 4 + 4);
}

/// Of an image that fills its transfers no empty one is sent. The longest fits.
#[test]
fn an_image_is_sent_in_as_many_transfers_as_it_needs() {
    for (bytes, transfers) in [(1, 1), (128, 1), (129, 2), (256, 2), (16 * 1024, 128)] {
        let mut bench = bench();
        bench.load_with(settings(Zones::Z8x8), vec![0x5A; bytes].leak());
        // The program is not that of the chip, so it does not start.
        while poll(&mut bench).is_ok() {}
        let wires = bench.bus.0.borrow();
        let is_data = |written: &Vec<u8>| written.first() == Some(&0xFF) && written.len() > 1;
        let data = wires.log.iter().filter(|(written, _)| is_data(written));
        let empty = wires.log.iter().filter(|(written, read)| {
            written == &[0xFF] && read.as_ref().is_some_and(Vec::is_empty)
        });
        assert_eq!((data.count(), empty.count()), (transfers, 0), "{bytes}");
    }
}

/// A sensor that measures keeps its program.
#[test]
fn a_start_switches_off_only_a_sensor_that_does_not_measure() {
    let uploads = |bench: &Bench<128>| bench.bus.written(&[0x08, 0x45]);
    let mut bench = measuring();
    assert_eq!(uploads(&bench), 1);
    bench.sensor.start(U16F16::ONE, Dither::OFF);
    recovers(&mut bench);
    assert_eq!(uploads(&bench), 1);
    // After the program has begun it is switched off, and needs its program again.
    let mut bench = self::bench();
    until_written(&mut bench, &[0x08, 0x40]);
    bench.sensor.start(U16F16::ONE, Dither::OFF);
    recovers(&mut bench);
    assert_eq!(uploads(&bench), 2);
}
