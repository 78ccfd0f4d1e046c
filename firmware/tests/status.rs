//! What a host learns when something is wrong, and that all goes on when it is
//! right again: a sensor that is unplugged, no host, configurations that cannot
//! be. A host that stops reading is in `sidecar_sensor.rs`.

use crate::common::host::{CONFIGURATION, Host, configured, device_with_blocks};
use crate::common::mocks::Broken;
use crate::common::plug::{Answers, Bus, Tdc, Tmf};
use crate::common::{plugged, scene};
use dtof_chips::Chip;
use dtof_core::{DepthEvent, Statistics};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::endpoint::LinkCounters;
use dtof_link::message;
use dtof_link::{Configuration, FaultRecord, Refusal, Source, Token};
use dtof_sensors::tmf882x::{BootCommand, Command, DeviceError, Waiting};
use dtof_sensors::{Sensor, SensorFault, tdc7200, tmf882x};

/// One that takes photons from the link.
const GOOD: Configuration = Configuration {
    source: Source::Link,
    ..CONFIGURATION
};

/// Bytes 25 to 46 of a configuration, from the rule to tracking: the average rule cannot track.
const AVERAGE_RULE_WITH_TRACKING: [u8; 22] = {
    let mut fields = [0; 22];
    fields[0] = 2;
    fields[21] = 1;
    fields
};

/// The sensor gives data, is unplugged for a minute, and gives data again.
fn unplug<C: Chip + Default>(
    mut sensor: impl Sensor,
    bus: &Bus<C>,
    unplugged: Answers,
    most_a_second: u32,
    fault: FaultRecord,
) {
    let requested = Configuration {
        pixels: 9,
        ..CONFIGURATION
    };
    let (mut device, mut host) = configured::<9>(&requested);
    let mut now_ms = 0;
    let mut second = || {
        let report = plugged::second(&mut sensor, bus, &mut device, &mut host, &mut now_ms);
        let events = host.events.len() as u64;
        assert_eq!(report.statistics.events, events);
        (report, events)
    };
    let (report, events) = second();
    assert!(events > 10, "{report:?}");
    assert_eq!((report.sensor_errors, report.last_sensor_error), (0, 0));

    bus.set_answers(unplugged);
    let (mut before, mut errors) = (report.statistics, 0);
    for of_the_minute in 0..60 {
        let transfers = bus.transfers();
        let (report, _) = second();
        let new = report.sensor_errors - errors;
        errors = report.sensor_errors;
        assert!(new <= most_a_second, "{new} errors");
        // A missing interrupt is noticed within a second.
        if of_the_minute >= 2 {
            assert!(new > 0);
            assert_eq!(report.last_sensor_error, fault as u8);
            assert_eq!(report.statistics, before);
        }
        // At most two accesses each time it is brought up.
        assert!(bus.transfers() - transfers <= 2 * most_a_second);
        before = report.statistics;
    }

    bus.set_answers(Answers::Sensor);
    let (report, _) = second();
    let errors = report.sensor_errors;
    let (report, after) = second();
    assert!(after > before.events + 10, "{report:?}");
    // What was wrong last is still known, but it is not wrong any more.
    assert_eq!(report.sensor_errors, errors);
    assert_eq!(report.last_sensor_error, fault as u8);
}

#[test]
fn an_unplugged_tdc7200_is_reported_and_found_again() {
    for (unplugged, fault) in [
        (Answers::Error, FaultRecord::Bus),
        (Answers::Ones, FaultRecord::NoAnswer),
    ] {
        let bus = Bus::<Tdc>::new();
        let sensor = plugged::tdc7200(&bus);
        unplug(sensor, &bus, unplugged, 200, fault);
    }
}

#[test]
fn an_unplugged_tmf882x_is_reported_and_found_again() {
    let bus = Bus::<Tmf>::new();
    let sensor = plugged::tmf882x(&bus);
    unplug(sensor, &bus, Answers::Error, 60, FaultRecord::NoAnswer);
}

#[test]
fn every_error_of_a_driver_is_of_its_kind() {
    use SensorFault::{
        Bus, Data, NoAnswer, NoImage, Pin, Rejected, StuckInterrupt, Timeout, WrongChip,
    };
    type OfTdc = tdc7200::Error<Broken, Broken>;
    type OfTmf = tmf882x::Error<Broken, Broken>;
    let wrong = |config2, int_mask| OfTdc::WrongChip { config2, int_mask };
    for (error, kind) in [
        (OfTdc::Bus(Broken), Bus),
        (OfTdc::Pin(Broken), Pin),
        (OfTdc::NoAnswer, NoAnswer),
        (wrong(0, 0), NoAnswer),
        (wrong(0xff, 0xff), NoAnswer),
        (wrong(0x40, 0xff), WrongChip),
        (OfTdc::Timeout, Timeout),
        (OfTdc::Parity { register: 0x10 }, Data),
        (OfTdc::StuckInterrupt { status: 8 }, StuckInterrupt),
    ] {
        assert_eq!(SensorFault::from(error), kind, "{error}");
    }
    let (command, status) = (Command::Measure, 2);
    let bootloader = |command, answer| OfTmf::Device(DeviceError::Bootloader { command, answer });
    for (error, kind) in [
        (OfTmf::Nack(Broken), NoAnswer),
        (OfTmf::Bus(Broken), Bus),
        (OfTmf::Pin(Broken), Pin),
        (OfTmf::WrongChip { id: 7 }, WrongChip),
        (OfTmf::WrongApplication { id: 7 }, WrongChip),
        (OfTmf::Timeout(Waiting::Data), Timeout),
        (OfTmf::Timeout(Waiting::PowerUp), Rejected),
        (bootloader(BootCommand::WriteRam, [2, 0, 0xFD]), Rejected),
        (OfTmf::Refused { command, status }, Rejected),
        (OfTmf::StuckInterrupt { status }, StuckInterrupt),
        (OfTmf::NoImage, NoImage),
        (OfTmf::Device(DeviceError::WrongSize { size: 1 }), Data),
    ] {
        assert_eq!(SensorFault::from(error), kind, "{error}");
    }
}

#[test]
fn a_host_that_comes_after_a_minute_gets_what_it_would_have_got_at_once() {
    let (late, counters) = scene::over_serial(60_000, 2_000, usize::MAX);
    assert!(late.events.len() > 500);
    let clean = LinkCounters {
        frames: counters.frames,
        ..LinkCounters::default()
    };
    assert_eq!(counters, clean);
    let (at_once, _) = scene::over_serial(0, 2_000, usize::MAX);
    assert!(late.events == at_once.events);
}

/// A device without a sensor, with room for nine pixels and six blocks.
fn device() -> Sidecar<'static> {
    device_with_blocks::<9, 6>(None)
}

/// An invalid configuration of each kind, for eight pixels without a sensor.
fn refused() -> Vec<(Vec<u8>, Refusal)> {
    let good = GOOD.to_le_bytes();
    // The first byte, the bytes written there, and the refusal; numbered as in `docs/link-format.md`.
    let bad: [(usize, &[u8], Refusal); 37] = [
        (24, &[2], Refusal::Unknown),
        (25, &[3], Refusal::Unknown),
        (29, &[2], Refusal::Unknown),
        (34, &[2], Refusal::Unknown),
        (34, &[1, 2, 0, 1, 0, 0], Refusal::Unknown),
        (40, &[2], Refusal::Unknown),
        (4, &[0], Refusal::ZeroX),
        (4, &[21], Refusal::XAboveL1),
        (8, &[20], Refusal::L2NotAboveL1),
        (8, &[24], Refusal::NoLook),
        (12, &[128], Refusal::GatePastLastBin),
        (10, &[121], Refusal::GateTooNarrow),
        (16, &[0, 0, 0, 0], Refusal::Range),
        (20, &[0xff, 0xff, 0xff, 0x7f], Refusal::Range),
        (14, &[0], Refusal::Pixels),
        (14, &[10], Refusal::Pixels),
        (2, &[0, 0], Refusal::MinimumCount),
        (2, &[0, 4], Refusal::MinimumCount),
        (24, &[1], Refusal::NoSensor),
        (25, &[1, 0], Refusal::WindowWidth),
        (25, &[1, 8], Refusal::WindowWidth),
        // Half widths of 255 and 1025, where 256 to 1024 are allowed: before the place, then after it.
        (29, &[1, 0xff, 0, 0, 1], Refusal::HalfWidth),
        (29, &[1, 1, 4, 0, 1], Refusal::HalfWidth),
        (29, &[1, 0, 1, 0xff, 0], Refusal::HalfWidth),
        (29, &[1, 0, 1, 1, 4], Refusal::HalfWidth),
        (34, &[1, 0, 0], Refusal::ZeroThreshold),
        // 1/512 of a bin of 37.5 mm is 0.07 mm, 18.7 of 1/256 mm.
        (34, &[1, 0, 18], Refusal::ZeroThreshold),
        (43, &[4], Refusal::Unknown),
        (46, &[2], Refusal::Unknown),
        (47, &[0], Refusal::Unknown),
        (47, &[5], Refusal::Unknown),
        (43, &[1, 0, 0], Refusal::Patience),
        // No column, and pixels one above the other: four, two and one block.
        (41, &[0, 0, 1, 100, 0], Refusal::Blocks),
        (41, &[1, 0, 3, 100, 0], Refusal::Blocks),
        // The paper's rule, also for blocks, and that with the average of all bins.
        (46, &[1], Refusal::Tracking),
        (43, &[1, 100, 0, 1], Refusal::Tracking),
        (25, &AVERAGE_RULE_WITH_TRACKING, Refusal::Tracking),
    ];
    // Too short, and as long as that of version 3.
    let mut all = vec![
        (good[1..].to_vec(), Refusal::Unknown),
        (good[..39].to_vec(), Refusal::Unknown),
    ];
    for (from, fields, refusal) in bad {
        let mut requested = good.to_vec();
        requested[from..from + fields.len()].copy_from_slice(fields);
        all.push((requested, refusal));
    }
    all
}

/// Photons of six laser cycles, two pixels that see a surface.
fn photons() -> Vec<u8> {
    let cycle = [
        Token::Photon { code: 20 },
        Token::Advance { pixels: 7 },
        Token::Photon { code: 90 },
        Token::EndOfCycles { cycles: 1 },
    ];
    let tokens = cycle.into_iter().cycle().take(6 * cycle.len());
    tokens.flat_map(|token| token.to_bytes().to_vec()).collect()
}

#[track_caller]
fn is_refused(host: &mut Host, device: &mut Sidecar, requested: &[u8], refusal: Refusal) {
    let reason = host.answer(device, 0, message::CONFIGURE, requested);
    assert_eq!(host.answers.last().unwrap().0, message::REFUSED);
    assert_eq!(reason, [refusal as u8], "{refusal}");
}

/// Sends photons, with these refused configurations in between. Returns events, statistics and laser cycles.
fn run_with_refusals(refused: &[(Vec<u8>, Refusal)]) -> (Vec<DepthEvent>, Statistics, u64) {
    let mut device = device();
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, &GOOD);
    for turn in 0..100 {
        host.ask(message::PHOTONS, &photons());
        if let Some((requested, refusal)) = refused.get(turn % refused.len().max(1)) {
            is_refused(&mut host, &mut device, requested, *refusal);
        }
        host.exchange(&mut device, 0);
        host.read(4);
    }
    let report = host.report(&mut device, 0);
    assert_eq!(report.unknown, 0);
    (host.events, report.statistics, report.cycles)
}

#[test]
fn every_refused_configuration_names_its_reason_and_changes_nothing() {
    let all = refused();
    let mut numbers: Vec<u8> = all.iter().map(|&(_, refusal)| refusal as u8).collect();
    numbers.sort_unstable();
    numbers.dedup();
    // Refusal 12 needs a sensor.
    assert_eq!(numbers, Vec::from_iter((1..=11).chain(13..=18)));

    let undisturbed = run_with_refusals(&[]);
    assert_eq!((undisturbed.0.len(), undisturbed.2), (2 * 25, 600));
    assert_eq!(run_with_refusals(&all), undisturbed);
}

#[test]
fn a_device_that_has_refused_its_first_configuration_waits_for_a_better_one() {
    let mut device = device();
    let mut host = Host::new(1, 0);
    for (requested, refusal) in refused() {
        is_refused(&mut host, &mut device, &requested, refusal);
    }
    // There are no pixels for photons yet.
    host.ask(message::PHOTONS, &photons());
    let report = host.report(&mut device, 0);
    assert_eq!((report.unknown, report.cycles), (1, 0));
    host.configure(&mut device, 0, &GOOD);
    host.ask(message::PHOTONS, &photons());
    assert_eq!(host.report(&mut device, 0).cycles, 6);
}
