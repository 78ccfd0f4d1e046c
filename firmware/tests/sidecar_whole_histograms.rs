//! Histograms of a sensor that gives whole ones, which a host asks for.

use crate::common::histograms::{histograms, refused};
use crate::common::host::{CONFIGURATION, Call, Host, device, scripted};
use crate::common::script;
use dtof_core::fixed::types::U8F8;
use dtof_core::{Count, LaserCycle, PaperRule, PixelAddress};
use dtof_firmware::sidecar::Sidecar;
use dtof_link::{Configuration, HistogramHead, NoHistogram, Refusal, Source, message};
use dtof_sensors::SensorInfo;

/// A sensor of three pixels that gives whole histograms.
const WHOLE: SensorInfo = SensorInfo {
    gives_histograms: true,
    ..SensorInfo::new(3)
};

fn with_whole(requested: &Configuration) -> (Sidecar<'static>, Host) {
    let mut device = device::<8>(Some(WHOLE));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, requested);
    (device, host)
}

#[test]
fn a_whole_histogram_is_the_next_one_of_its_pixel_to_the_last_photon() {
    // Of the second every bin is full, so that it takes two messages.
    let of = |pixel: u16, scale: u32| {
        let bins = (0..128).map(|bin| scale * (100 + bin % 8 + u32::from(pixel)));
        let counts: [u32; 128] = bins.collect::<Vec<_>>().try_into().unwrap();
        Call::Histogram(pixel, Box::new(counts))
    };
    // No event but of the last.
    let (mut device, mut host) = with_whole(&Configuration {
        rule: PaperRule::new(U8F8::lit("255"), Count::saturating(5)).into(),
        ..CONFIGURATION
    });
    for (now_ms, (pixel, scale)) in [(0, 1), (1, 100_000), (2, 50), (0, 0)]
        .into_iter()
        .enumerate()
    {
        let now_ms = u32::try_from(now_ms).unwrap();
        let before = host.answers.len();
        host.ask(message::HISTOGRAM_REQUEST, &u16::to_le_bytes(pixel));
        host.exchange(&mut device, now_ms);
        host.read(usize::MAX);
        assert_eq!(host.answers.len(), before);
        // Others of it do not wait.
        host.ask(message::SYNCHRONISE, &[]);
        host.exchange(&mut device, now_ms);
        // Two frames, and the second has the one that is asked for after it came.
        let calls = [
            Call::Frame(70_000),
            of((pixel + 1) % 3, 7),
            of(pixel, scale),
            Call::Frame(2),
            of(pixel, 9),
        ];
        let mut sensor = scripted([Some(calls.to_vec())].into_iter());
        host.run(&mut device, &mut sensor, now_ms..now_ms + 1, usize::MAX);
        assert_eq!(host.answers[before].0, message::SYNCHRONISED);
        let [Ok((head, counts))] = &histograms(&host.answers[before..])[..] else {
            panic!("{:?}", host.answers);
        };
        let cycle = LaserCycle::new(u64::from(now_ms) * 70_002 + 70_000);
        let expected = HistogramHead {
            pixel: PixelAddress::new(pixel),
            is_whole: true,
            cycle,
            exposure: 70_000,
        };
        assert_eq!(*head, expected);
        let Call::Histogram(_, expected) = of(pixel, scale) else {
            unreachable!();
        };
        assert_eq!(counts[..], expected[..]);
    }
    assert!(host.events.is_empty());
    host.ask(message::HISTOGRAM_REQUEST, &[2, 0]);
    host.exchange(&mut device, 9);
    let peak = std::array::from_fn(|bin| if bin == 70 { 1 << 20 } else { 3 });
    let mut sensor = scripted([Some(vec![Call::Histogram(2, Box::new(peak))])].into_iter());
    host.run(&mut device, &mut sensor, 9..10, usize::MAX);
    // The event first.
    let (kind, _, events) = host.answers.last().unwrap();
    assert_eq!((*kind, *events), (message::HISTOGRAM, 1));
    assert_eq!(host.events[0].peak_bin.raw(), 70);
    assert_eq!(refused(&mut device, &mut host, 3), NoHistogram::NoPixel);
}

#[test]
fn who_waits_for_a_sensor_hears_when_that_fails_or_another_comes_first() {
    let (mut device, mut host) = with_whole(&CONFIGURATION);
    let ask = |host: &mut Host, device: &mut Sidecar, pixel: u16| {
        host.ask(message::HISTOGRAM_REQUEST, &pixel.to_le_bytes());
        host.exchange(device, 0);
        host.read(usize::MAX);
    };
    for pixel in [1, 2, 0] {
        ask(&mut host, &mut device, pixel);
    }
    host.run(&mut device, &mut scripted([None].into_iter()), 0..1, 9);
    ask(&mut host, &mut device, 1);
    host.ask(message::CONFIGURE, &CONFIGURATION.to_le_bytes());
    host.exchange(&mut device, 0);
    host.read(usize::MAX);
    assert_eq!(host.answers.last().unwrap().0, message::CONFIGURED);
    let none = |pixel, reason| Err((PixelAddress::new(pixel), reason));
    let expected = [
        none(1, NoHistogram::GivenUp),
        none(2, NoHistogram::GivenUp),
        none(0, NoHistogram::Sensor),
        none(1, NoHistogram::GivenUp),
    ];
    assert_eq!(histograms(&host.answers), expected);
    // A new session knows nothing of it.
    ask(&mut host, &mut device, 1);
    let mut next = Host::new(2, 0);
    next.configure(&mut device, 0, &CONFIGURATION);
    assert_eq!(next.answers.len(), 1);
}

/// Photons from the link are counted by pixels, whatever the sensor is.
#[test]
fn photons_of_the_link_have_histograms_beside_any_sensor() {
    let (mut device, mut host) = with_whole(&Configuration {
        source: Source::Link,
        ..CONFIGURATION
    });
    let photon = script::messages(&[vec![Call::Photon(0, 5)]]);
    host.ask(message::PHOTONS, &photon[0]);
    let (kind, body) = (message::HISTOGRAM_REQUEST, 0u16.to_le_bytes());
    host.answer(&mut device, 0, kind, &body);
    let [Ok((head, counts))] = &histograms(&host.answers)[..] else {
        panic!("{:?}", host.answers);
    };
    assert!(!head.is_whole && head.exposure == 0 && counts[5] == 1);
}

/// Bins that a sensor does not measure are no part of a decision: they would be taken for bins without
/// background. Whatever is in them is counted as lost.
#[test]
fn the_gate_ends_where_the_bins_of_the_sensor_do() {
    let narrow = SensorInfo { bins: 54, ..WHOLE };
    let mut device = device::<8>(Some(narrow));
    let mut host = Host::new(1, 0);
    let requested = Configuration {
        gate: (0, 127),
        ..CONFIGURATION
    };
    host.configure(&mut device, 0, &requested);
    let counts = std::array::from_fn(|bin| match bin {
        20 => 1000,
        70 => 5000,
        ..54 => 10,
        _ => 0,
    });
    let mut sensor = scripted([Some(vec![Call::Histogram(1, Box::new(counts))])].into_iter());
    host.run(&mut device, &mut sensor, 0..1, usize::MAX);
    let report = host.report(&mut device, 1);
    assert_eq!(report.statistics.gated_out, 5000);
    assert_eq!(host.events.len(), 1);
    assert_eq!(host.events[0].peak_bin.raw(), 20);
    assert_eq!(host.events[0].background.raw(), 10);

    // A gate behind all of them leaves nothing.
    let behind = Configuration {
        gate: (60, 127),
        ..CONFIGURATION
    };
    let answer = host.answer(&mut device, 2, message::CONFIGURE, &behind.to_le_bytes());
    assert_eq!(answer, [Refusal::GateTooNarrow as u8]);
}
