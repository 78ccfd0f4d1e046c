//! Photons of one laser cycle in one bin count once on a sidecar, however they come.

use crate::common::host::{
    CONFIGURATION, Call, Host, configured, configured_with, device_with_blocks, scripted,
};
use dtof_core::fixed::types::U4F12;
use dtof_core::{
    AsyncPixel, BlockLevel, Count, DepthEvent, LaserCycle, OncePerBin, PixelAddress, PixelConfig,
    Statistics, WindowRule,
};
use dtof_link::{AdaptiveBinning, Configuration, Refusal, Source, Token, message};
use dtof_sensors::SensorInfo;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The window rule, for two pixels.
fn requested() -> Configuration {
    let rule = WindowRule::new(3, U4F12::lit("4.5"), Count::saturating(5)).unwrap();
    Configuration {
        rule: rule.into(),
        l2: 400,
        once_per_bin: true,
        pixels: 2,
        columns: 2,
        ..CONFIGURATION
    }
}

/// The pixels and codes of the photons of each laser cycle, pixel by pixel: an even background with two
/// past the last bin, a target in bin 70, and now and then 30 photons of a drop in two bins.
fn photons(cycles: usize) -> Vec<Vec<(u16, u16)>> {
    let mut random = Pcg32::seed_from_u64(1);
    let mut below = |limit: u32| {
        let scaled = u64::from(random.next_u32()) * u64::from(limit);
        u16::try_from(scaled >> 32).unwrap()
    };
    let mut cycle = || {
        let mut photons: Vec<(u16, u16)> = (0..6).map(|_| (below(2), below(130))).collect();
        if below(3) == 0 {
            photons.push((below(2), 70));
        }
        if below(100) == 0 {
            let (pixel, place) = (below(2), below(60));
            photons.extend((0..30).map(|_| (pixel, place + below(2))));
        }
        photons.sort_by_key(|photon| photon.0);
        photons
    };
    (0..cycles).map(|_| cycle()).collect()
}

/// What the pixels of the core report.
fn of_core(photons: &[Vec<(u16, u16)>]) -> (Vec<DepthEvent>, Statistics) {
    let requested = requested();
    let config = PixelConfig::<128, _>::with_rule(requested.rule)
        .x(requested.x)
        .l1(requested.l1)
        .l2(requested.l2)
        .estimator(requested.estimator);
    let config = config.build().unwrap();
    let (mut events, mut statistics) = (Vec::new(), Statistics::new());
    let mut pixels = [0, 1].map(|address| AsyncPixel::<128>::new(PixelAddress::new(address)));
    for (cycle, photons) in (0..).zip(photons) {
        for (number, pixel) in (0..).zip(&mut pixels) {
            let codes: Vec<u16> = photons
                .iter()
                .filter(|photon| photon.0 == number)
                .map(|photon| photon.1)
                .collect();
            let mut bins = OncePerBin::<4>::new();
            pixel.count_once_per_bin(&config, &mut statistics, &mut bins, &codes);
            pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
            events.extend(pixel.take_event());
        }
    }
    for pixel in &pixels {
        pixel.add_photons_to(&mut statistics);
    }
    (events, statistics)
}

/// Of a sensor that gives the photons of a laser cycle in up to three polls, pixel by pixel.
#[test]
fn a_sidecar_reports_what_pixels_of_the_core_report() {
    compare(&photons(4_000));
}

/// In the order of time, as pixels have them that share a TDC and its queue.
#[test]
fn the_order_of_a_shared_queue_changes_nothing() {
    let mut photons = photons(4_000);
    for photons in &mut photons {
        photons.sort_by_key(|&(_, code)| code);
    }
    let mixed = |photons: &&Vec<(u16, u16)>| !photons.is_sorted_by_key(|photon| photon.0);
    assert!(photons.iter().filter(mixed).count() > 2_000);
    compare(&photons);
}

fn compare(photons: &[Vec<(u16, u16)>]) {
    let expected = of_core(photons);
    assert!(expected.0.len() > 20 && expected.1.repeated > 500);
    assert!(expected.1.rejected > 100);
    let calls = photons.iter().flat_map(|photons| {
        let mut polls: Vec<Vec<Call>> = photons
            .chunks(photons.len().div_ceil(3).max(1))
            .map(|part| {
                part.iter()
                    .map(|&(pixel, code)| Call::Photon(pixel, code))
                    .collect()
            })
            .collect();
        polls.push(vec![Call::End(1)]);
        polls.into_iter().map(Some)
    });
    let mut sensor = scripted(calls);
    let (mut device, mut host) = configured::<2>(&requested());
    host.run(&mut device, &mut sensor, 0..20_000, usize::MAX);
    let report = host.report(&mut device, 20_000);
    assert_eq!((host.events, report.statistics), expected);
}

/// Of the link: a message may end within a laser cycle.
#[test]
fn photons_of_the_link_count_once_over_messages() {
    let requested = Configuration {
        source: Source::Link,
        ..requested()
    };
    let (mut device, mut host) = configured::<2>(&requested);
    let mut photons = |pixel: u16, codes: &[u16], ends: bool| {
        let mut body = Vec::new();
        let mut push = |token: Token| body.extend_from_slice(&token.to_bytes());
        if pixel > 0 {
            push(Token::Advance { pixels: 1 });
        }
        codes.iter().for_each(|&code| push(Token::Photon { code }));
        if ends {
            push(Token::EndOfCycles { cycles: 1 });
        }
        host.ask(message::PHOTONS, &body);
        host.exchange(&mut device, 0);
    };
    photons(0, &[5, 6, 5], false);
    photons(0, &[6, 7], false);
    photons(1, &[5], true);
    photons(0, &[5], true);
    let of = host.report(&mut device, 0).statistics;
    assert_eq!((of.counted, of.repeated), (5, 2));
}

/// A photon that does not count in its pixel does not count in its blocks.
#[test]
fn blocks_count_what_their_pixels_count() {
    let requested = Configuration {
        binning: Some(AdaptiveBinning {
            levels: BlockLevel::saturating(1),
            patience: 4,
        }),
        pixels: 4,
        ..requested()
    };
    let mut device = device_with_blocks::<4, 1>(Some(SensorInfo::new(4)));
    let mut host = Host::new(1, 0);
    host.configure(&mut device, 0, &requested);
    let calls = (0..40).map(|_| {
        let photons = [(0, 9), (0, 9), (1, 9), (3, 9), (3, 9)];
        let photons = photons.map(|(pixel, code)| Call::Photon(pixel, code));
        Some(photons.into_iter().chain([Call::End(1)]).collect())
    });
    let mut sensor = scripted(calls);
    host.run(&mut device, &mut sensor, 0..41, usize::MAX);
    let report = host.report(&mut device, 41);
    assert_eq!(
        (report.statistics.repeated, report.statistics.counted),
        (80, 120)
    );
    // The block begins to count after the patience.
    assert_eq!(report.blocks.counted % 3, 0);
    assert!(
        (90..120).contains(&report.blocks.counted),
        "{:?}",
        report.blocks
    );
}

#[test]
fn a_sensor_that_gives_histograms_refuses_it() {
    let info = SensorInfo {
        gives_histograms: true,
        ..SensorInfo::new(2)
    };
    let plain = Configuration {
        once_per_bin: false,
        ..requested()
    };
    let (mut device, mut host) = configured_with::<2>(info, &plain);
    let mut answer = |requested: &Configuration| {
        host.answer(&mut device, 0, message::CONFIGURE, &requested.to_le_bytes())
    };
    assert_eq!(answer(&requested()), [Refusal::OncePerBin as u8]);
    // Photons of the link are another matter.
    let of_link = Configuration {
        source: Source::Link,
        ..requested()
    };
    assert!(answer(&of_link).is_empty());
}

/// Photons of a pixel that is left out count nowhere but as those of no pixel.
#[test]
fn a_pixel_can_be_left_out() {
    let requested = Configuration {
        source: Source::Link,
        ..requested()
    };
    let (mut device, mut host) = configured::<2>(&requested);
    device.leave_out(PixelAddress::new(1));
    for _ in 0..60 {
        let tokens = [
            Token::Photon { code: 70 },
            Token::Advance { pixels: 1 },
            Token::Photon { code: 70 },
            Token::EndOfCycles { cycles: 1 },
        ];
        let mut body = Vec::new();
        tokens
            .iter()
            .for_each(|token| body.extend_from_slice(&token.to_bytes()));
        host.ask(message::PHOTONS, &body);
        host.exchange(&mut device, 0);
    }
    let report = host.report(&mut device, 0);
    assert_eq!(report.unaddressed, 60);
    assert_eq!(report.statistics.photons(), 60);
    assert!(!host.events.is_empty());
    assert!(host.events.iter().all(|event| event.pixel.raw() == 0));
}
