//! Pixels that confirm each other on a sidecar.

use crate::common::host::{CONFIGURATION, Call, configured, configured_with, scripted};
use dtof_core::fixed::types::{U4F12, U8F8};
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    AnyRule, Array, ArrayConfig, AverageRule, BlockLevel, Count, DepthEvent, EchoNumber, Flags,
    Neighbours, PixelArray, PixelConfig, PixelPlace, Statistics, WindowRule,
};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source, message};
use dtof_sensors::SensorInfo;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

fn rule() -> WindowRule {
    WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap()
}

/// 19 pixels in rows of 5: the last row is not full.
fn requested(neighbours: Neighbours) -> Configuration {
    Configuration {
        rule: rule().into(),
        l2: 400,
        pixels: 19,
        columns: 5,
        neighbours: Some(neighbours),
        echoes: EchoNumber::new(2).unwrap(),
        echo_guard_bins: 3,
        ..CONFIGURATION
    }
}

/// The pixels and codes of the photons of each laser cycle: little background, and a dim target.
fn photons(cycles: usize) -> Vec<Vec<(u16, u16)>> {
    let mut random = Pcg32::seed_from_u64(4);
    let mut below = |limit: u32| {
        let scaled = u64::from(random.next_u32()) * u64::from(limit);
        u16::try_from(scaled >> 32).unwrap()
    };
    let mut cycle = || {
        let background = (0..3).map(|_| (below(19), below(130)));
        let mut photons: Vec<(u16, u16)> = background.collect();
        photons.extend((0..below(4)).map(|_| (below(19), 70 + below(2))));
        photons
    };
    (0..cycles).map(|_| cycle()).collect()
}

/// What an array of the core reports.
fn of_core(photons: &[Vec<(u16, u16)>], neighbours: Neighbours) -> (Vec<DepthEvent>, Statistics) {
    let requested = requested(neighbours);
    let rule = NeighbourConfig::new(Array::new(5, 4).unwrap(), neighbours, &rule());
    let config = PixelConfig::<128, WindowRule>::with_rule(*rule.rule().own())
        .x(requested.x)
        .l1(requested.l1)
        .l2(requested.l2)
        .estimator(requested.estimator)
        .echoes(requested.echoes, requested.echo_guard_bins)
        .echo_wait(requested.echo_wait);
    let config = config.build().unwrap();
    let config = ArrayConfig::new(*rule.array(), config).neighbours(rule);
    let mut places: Vec<PixelPlace<128>> = (0..19).map(|_| PixelPlace::new()).collect();
    let mut array = PixelArray::new(&mut places, &mut []);
    array
        .configure(&config.unwrap().first(19).unwrap())
        .unwrap();
    let mut events = Vec::new();
    for photons in photons {
        for &(pixel, code) in photons {
            array.photon(pixel.into(), code);
        }
        array.end_laser_cycle();
        events.extend(std::iter::from_fn(|| array.next_event()));
    }
    (events, array.statistics()[0])
}

#[test]
fn a_sidecar_reports_what_an_array_of_the_core_reports() {
    let photons = photons(4_000);
    for neighbours in [Neighbours::Four, Neighbours::Eight] {
        let expected = of_core(&photons, neighbours);
        let confirmed = |event: &&DepthEvent| event.flags.contains(Flags::CONFIRMED);
        assert!(expected.0.iter().filter(confirmed).count() > 50);
        let calls = photons.iter().map(|photons| {
            let photons = photons
                .iter()
                .map(|&(pixel, code)| Call::Photon(pixel, code));
            Some(photons.chain([Call::End(1)]).collect())
        });
        let mut sensor = scripted(calls);
        let (mut device, mut host) = configured::<19>(&requested(neighbours));
        host.run(&mut device, &mut sensor, 0..8_000, usize::MAX);
        let report = host.report(&mut device, 8_000);
        let mut events = host.events;
        // A sidecar empties the slots in turn.
        events.sort_by_key(|event| (event.cycle, event.pixel));
        assert_eq!((events, report.statistics), expected);
    }
}

#[test]
fn what_neighbours_cannot_be_used_with_is_refused() {
    let good = requested(Neighbours::Eight);
    let average = AverageRule::new(U8F8::lit("4"), Count::saturating(5));
    let blocks = AdaptiveBinning {
        levels: BlockLevel::saturating(1),
        patience: 64,
    };
    let whole = SensorInfo {
        gives_histograms: true,
        ..SensorInfo::new(19)
    };
    let dead = SensorInfo {
        dead_time: 20,
        ..SensorInfo::new(19)
    };
    let with = |change: &dyn Fn(&mut Configuration)| {
        let mut requested = good;
        change(&mut requested);
        requested
    };
    let from_link = |of: &mut Configuration| of.source = Source::Link;
    let cases = [
        (SensorInfo::new(19), good, None),
        (SensorInfo::new(19), with(&|of| of.tracking = true), None),
        (
            SensorInfo::new(19),
            with(&|of| of.rule = AnyRule::from(average)),
            Some(Refusal::Neighbours),
        ),
        (
            SensorInfo::new(19),
            with(&|of| of.binning = Some(blocks)),
            Some(Refusal::Neighbours),
        ),
        (
            SensorInfo::new(19),
            with(&|of| of.columns = 0),
            Some(Refusal::Neighbours),
        ),
        (
            SensorInfo::new(19),
            with(&|of| of.dead_time = Some(128)),
            Some(Refusal::Neighbours),
        ),
        (dead, good, Some(Refusal::Neighbours)),
        (dead, with(&|of| of.dead_time = Some(0)), None),
        (dead, with(&from_link), None),
        (whole, good, Some(Refusal::Neighbours)),
        (whole, with(&from_link), None),
    ];
    for (sensor, requested, expected) in cases {
        let (mut device, mut host) = configured_with::<19>(sensor, &CONFIGURATION);
        let body = requested.to_le_bytes();
        let answer = host.answer(&mut device, 0, message::CONFIGURE, &body);
        let expected: Vec<u8> = expected.map(|refusal| refusal as u8).into_iter().collect();
        assert_eq!(answer, expected, "{sensor:?} {requested:?}");
    }
}
