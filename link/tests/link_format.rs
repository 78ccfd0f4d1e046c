//! The golden frames of `docs/link-format.md`, and what a receiver makes of
//! bytes that are no frames.

use dtof_core::events::Reference;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16, U24F8};
use dtof_core::{
    AnyRule, AverageRule, BlockLevel, CentredWindow, Count, DepthEstimator, EchoNumber, Neighbours,
    PaperRule, WindowRule,
};
use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, FrameError, PAYLOAD_BYTES, WIRE_BYTES, encode};
use dtof_link::message::greeting;
use dtof_link::message::{CONFIGURE, PHOTONS};
use dtof_link::{
    AdaptiveBinning, Configuration, DynamicDepth, Refusal, Report, SensorRecord, Source,
    StopReason, Token,
};
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;

use crate::common::{give, golden};

fn next(end: &mut Endpoint, now: u32) -> Vec<u8> {
    let mut wire = [0; WIRE_BYTES];
    let length = end.transmit(now, &mut wire);
    wire[..length].to_vec()
}

#[test]
fn both_ends_send_the_golden_frames() {
    let mut host = Endpoint::host(0x1234, greeting(0, 0), 0);
    let mut device = Endpoint::device(greeting(128, 64));
    let hello = next(&mut host, 0);
    assert_eq!(hello, golden("hello"));
    give(&mut device, &hello);
    let welcome = next(&mut device, 0);
    assert_eq!(welcome, golden("welcome"));
    give(&mut host, &welcome);
    assert!(host.is_open() && device.is_open());
    assert_eq!(host.peer_greeting(), &greeting(128, 64));

    let mut body = Vec::new();
    for token in [
        Token::Advance { pixels: 3 },
        Token::Photon { code: 60 },
        Token::Photon { code: 300 },
        Token::EndOfCycles { cycles: 1 },
    ] {
        body.extend(token.to_bytes());
    }
    host.offer(PHOTONS, &body).unwrap();
    let photons = next(&mut host, 0);
    assert_eq!(photons, golden("photons 0"));
    give(&mut device, &photons);
    assert_eq!(device.take().unwrap().body, body[..]);
    let alive = next(&mut device, 0);
    assert_eq!(alive, golden("keep-alive of a device"));
    give(&mut host, &alive);
    assert_eq!(next(&mut host, 50), golden("keep-alive of a host"));

    host.end(51);
    let end = next(&mut host, 51);
    assert_eq!(end, golden("end of session 0x1234"));
    device.set_stop_reason(StopReason::Silence);
    give(&mut device, &end);
    let forgotten = next(&mut device, 0);
    assert_eq!(forgotten, golden("no session"));
    give(&mut host, &forgotten);
    assert!(!device.is_open() && host.is_lost());
    assert_eq!(host.stop_reason(), Some(StopReason::Silence));
}

#[test]
fn a_host_configures_with_the_golden_frame() {
    let mut host = Endpoint::host(0x1234, greeting(0, 0), 0);
    next(&mut host, 0);
    give(&mut host, &golden("welcome"));
    let z = U4F12::lit("4.5");
    let configuration = Configuration {
        rule: WindowRule::new(3, z, Count::saturating(5)).unwrap().into(),
        estimator: CentredWindow::with_sides(U8F8::lit("2.5"), U8F8::lit("3"))
            .map(DepthEstimator::CentredWindow)
            .unwrap(),
        x: 4,
        l1: 40,
        l2: 2000,
        gate: (10, 119),
        dead_time: Some(128),
        once_per_bin: true,
        dither_bins: 64,
        dither_seed: 0x0102_0304_0506_0708,
        pixels: 64,
        columns: 8,
        binning: Some(AdaptiveBinning {
            levels: BlockLevel::saturating(2),
            patience: 100,
        }),
        neighbours: Some(Neighbours::Eight),
        tracking: true,
        echoes: EchoNumber::new(2).unwrap(),
        echo_guard_bins: 4,
        echo_wait: 8,
        bin_width_ps: U16F16::lit("250"),
        offset_mm: I24F8::lit("-179.5"),
        source: Source::Link,
        dynamic_depth: Some(DynamicDepth {
            threshold_mm: U24F8::lit("100"),
            reference: Reference::Reported,
        }),
        host_timeout_ms: 3000,
    };
    host.offer(CONFIGURE, &configuration.to_le_bytes()).unwrap();
    assert_eq!(next(&mut host, 0), golden("configure 0"));
}

#[test]
fn a_receiver_is_in_step_again_after_the_next_zero_byte() {
    let good = golden("photons 0");
    for damaged in [
        good[3..].to_vec(),                      // its head is missing
        [&good[..5], &[0], &good[5..]].concat(), // cut in two
        [&[7; 300][..], &[0]].concat(),          // too long
        good.iter()
            .map(|&byte| if byte == 0x3c { 0x3d } else { byte })
            .collect(),
    ] {
        let mut deframer = Deframer::new();
        let errors = damaged
            .iter()
            .filter_map(|&byte| deframer.push(byte)?.err())
            .count();
        assert!(errors > 0, "{damaged:x?}");
        let mut found = good
            .iter()
            .filter_map(|&byte| deframer.push(byte).map(|frame| frame.map(<[u8]>::len)));
        assert_eq!(found.next(), Some(Ok(6 + 8)));
    }
}

#[test]
fn what_is_too_long_is_named_so() {
    let mut deframer = Deframer::new();
    let found = [1; 300]
        .iter()
        .chain(&[0])
        .filter_map(|&byte| deframer.push(byte).map(|frame| frame.err()))
        .last();
    assert_eq!(found, Some(Some(FrameError::Oversized)));
}

/// One byte more than the longest frame is too long, and that many are only corrupt.
#[test]
fn the_longest_frame_has_two_bytes_for_its_code() {
    for (bytes, error) in [
        (WIRE_BYTES - 1, FrameError::Corrupt),
        (WIRE_BYTES, FrameError::Oversized),
    ] {
        let mut deframer = Deframer::new();
        assert!((0..bytes).all(|_| deframer.push(1).is_none()));
        assert_eq!(deframer.push(0), Some(Err(error)), "{bytes}");
    }
}

/// Its first byte is the distance to its end.
#[test]
fn the_longest_frame_without_a_zero_comes_back() {
    let payload = [7; PAYLOAD_BYTES];
    let mut wire = [0; WIRE_BYTES];
    assert_eq!(encode([&payload, &[]], &mut wire), WIRE_BYTES);
    let (first, frame) = wire.split_first().unwrap();
    assert_eq!((*first, &frame[..PAYLOAD_BYTES]), (255, &payload[..]));
    let mut deframer = Deframer::new();
    let found = wire.map(|byte| deframer.push(byte).map(|frame| frame == Ok(&payload)));
    assert_eq!(found[WIRE_BYTES - 1], Some(true));
}

/// The checksum of nothing is 0: a frame of four zeros.
#[test]
fn a_last_distance_past_the_end_is_corrupt() {
    let mut wire = [0xff; WIRE_BYTES];
    let length = encode([&[], &[]], &mut wire);
    assert_eq!(wire[..length], [1, 1, 1, 1, 1, 0]);
    for (last, frame) in [(1, Ok(&[][..])), (2, Err(FrameError::Corrupt))] {
        let mut deframer = Deframer::new();
        assert!(
            [1, 1, 1, 1, last]
                .iter()
                .all(|&byte| deframer.push(byte).is_none())
        );
        assert_eq!(deframer.push(0), Some(frame));
    }
}

#[test]
fn blocks_need_a_patience() {
    let binning = |patience| AdaptiveBinning {
        levels: BlockLevel::saturating(1),
        patience,
    };
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let mut any = configuration().new_tree(&mut runner).unwrap().current();
    any.binning = Some(binning(1));
    assert_eq!(Configuration::from_le_bytes(&any.to_le_bytes()), Ok(any));
    any.binning = Some(binning(0));
    let refused = Configuration::from_le_bytes(&any.to_le_bytes());
    assert_eq!(refused, Err(Refusal::Patience));
}

#[test]
fn every_token_comes_back() {
    let photons = (0..=u16::MAX).map(|code| Token::Photon { code });
    let advances = (1..=64).map(|pixels| Token::Advance { pixels });
    let ends = (0..=u16::MAX).map(|cycles| Token::EndOfCycles { cycles });
    for token in photons.chain(advances).chain(ends) {
        let mut bytes = token.to_bytes().to_vec();
        bytes.push(7);
        assert_eq!(Token::split_first(&bytes), Some((token, &[7][..])));
    }
}

#[test]
fn a_sensor_without_a_bin_width_has_none() {
    let mut bytes = [0; SensorRecord::BYTES];
    bytes[0] = 9;
    let (sensor, _) = SensorRecord::from_le_bytes(&bytes).unwrap();
    let sensor = sensor.unwrap();
    assert_eq!((sensor.pixels, sensor.bin_width), (9, None));
    assert_eq!(SensorRecord::to_le_bytes(Some(&sensor), 10), bytes);
}

/// Any rule, estimator and source with any numbers. Only a device checks numbers such as X and the gate.
fn configuration() -> impl Strategy<Value = Configuration> {
    let count = || (1u32..=1023).prop_map(Count::saturating);
    let paper = (any::<u16>(), count())
        .prop_map(|(alpha, count)| PaperRule::new(U8F8::from_bits(alpha), count).into());
    let average = (any::<u16>(), count())
        .prop_map(|(alpha, count)| AverageRule::new(U8F8::from_bits(alpha), count).into());
    let window = (1u8..=7, any::<u16>(), count()).prop_map(|(width, z, count)| {
        let window = WindowRule::new(width, U4F12::from_bits(z), count);
        AnyRule::Window(window.unwrap())
    });
    let half_width = || (256u16..=1024).prop_map(U8F8::from_bits);
    let centred = (half_width(), half_width()).prop_map(|(before, after)| {
        DepthEstimator::CentredWindow(CentredWindow::with_sides(before, after).unwrap())
    });
    let reference = prop_oneof![Just(Reference::Previous), Just(Reference::Reported)];
    let changes = (any::<u32>(), reference).prop_map(|(threshold, reference)| DynamicDepth {
        threshold_mm: U24F8::from_bits(threshold),
        reference,
    });
    let source = prop_oneof![Just(Source::Link), Just(Source::Sensor)];
    let levels = (1u8..=3).prop_map(BlockLevel::saturating);
    let binning =
        (levels, 1..=u16::MAX).prop_map(|(levels, patience)| AdaptiveBinning { levels, patience });
    let echoes = (1u8..=4).prop_map(|echo| EchoNumber::new(echo).unwrap());
    (
        prop_oneof![paper, average, window],
        prop_oneof![Just(DepthEstimator::Centroid3), centred],
        prop::option::of(changes),
        source,
        prop::option::of(binning),
        echoes,
        any::<(Option<u16>, [bool; 2], [u8; 2], u8)>(),
        any::<[u16; 7]>(),
        (
            any::<u32>(),
            any::<i32>(),
            prop_oneof![Just(0), Configuration::HOST_TIMEOUTS_MS],
            any::<(u16, u64)>(),
        ),
    )
        .prop_map(
            |(
                rule,
                estimator,
                dynamic_depth,
                source,
                binning,
                echoes,
                more,
                numbers,
                wide_numbers,
            )| {
                let [x, l1, l2, first, last, pixels, columns] = numbers;
                let (dead_time, [once_per_bin, tracking], [echo_guard_bins, echo_wait], neighbours) = more;
                let neighbours = Neighbours::new(4 * (neighbours % 3));
                let (width, offset, host_timeout_ms, (dither_bins, dither_seed)) = wide_numbers;
                Configuration {
                    rule,
                    estimator,
                    x,
                    l1,
                    l2,
                    gate: (first, last),
                    dead_time,
                    once_per_bin,
                    dither_bins,
                    dither_seed,
                    pixels,
                    columns,
                    binning,
                    neighbours,
                    tracking,
                    echoes,
                    echo_guard_bins,
                    echo_wait,
                    bin_width_ps: U16F16::from_bits(width),
                    offset_mm: I24F8::from_bits(offset),
                    source,
                    dynamic_depth,
                    host_timeout_ms,
                }
            },
        )
}

proptest! {
    #[test]
    fn any_payload_comes_back(payload in prop::collection::vec(any::<u8>(), 0..=PAYLOAD_BYTES)) {
        let mut wire = [0; WIRE_BYTES];
        let (head, tail) = payload.split_at(payload.len() / 3);
        let length = encode([head, tail], &mut wire);
        prop_assert!(wire[..length - 1].iter().all(|&byte| byte != 0) && wire[length - 1] == 0);
        let mut deframer = Deframer::new();
        for &byte in &wire[..length - 1] {
            prop_assert!(deframer.push(byte).is_none());
        }
        prop_assert_eq!(deframer.push(0), Some(Ok(&payload[..])));
    }

    #[test]
    fn any_bytes_leave_an_endpoint_alive(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let mut device = Endpoint::device(greeting(128, 64));
        give(&mut device, &bytes);
        prop_assert!(!device.is_open());
        give(&mut device, &[0]);
        give(&mut device, &golden("hello"));
        prop_assert!(device.is_open());
    }

    #[test]
    fn configurations_come_back(configuration in configuration()) {
        let bytes = configuration.to_le_bytes();
        prop_assert_eq!(Configuration::from_le_bytes(&bytes), Ok(configuration));
        prop_assert_eq!(Configuration::from_le_bytes(&bytes[1..]), Err(Refusal::Unknown));
    }

    #[test]
    fn what_any_bytes_configure_comes_back(
        numbers in any::<[u8; Configuration::BYTES]>(), minimum_count in 1u16..=1023,
        choices in prop::array::uniform7(0u8..3), rule in 0u8..4, width in 0u8..9,
        before in 200u16..1100, after in 200u16..1100, levels in 0u8..5, patience in 0u16..9, echoes in 0u8..6,
        host_timeout in prop_oneof![Just(0u16), 190u16..210, 59_990u16..60_010, any::<u16>()],
        neighbours in 0u8..12,
        reserved in prop::option::of(1u8..),
    ) {
        let mut bytes = numbers;
        bytes[2..4].copy_from_slice(&minimum_count.to_le_bytes());
        let [source, estimator, dynamic_depth, reference, dead_time, tracking, once_per_bin] = choices;
        for (at, value) in [
            (24, source), (25, rule), (26, width), (29, estimator), (34, dynamic_depth),
            (35, reference), (40, dead_time), (43, levels), (46, tracking), (47, echoes),
            (54, once_per_bin),
        ] {
            bytes[at] = value;
        }
        bytes[30..32].copy_from_slice(&before.to_le_bytes());
        bytes[32..34].copy_from_slice(&after.to_le_bytes());
        bytes[44..46].copy_from_slice(&patience.to_le_bytes());
        bytes[50..52].copy_from_slice(&host_timeout.to_le_bytes());
        bytes[65] = neighbours;
        bytes[66] = reserved.unwrap_or(0);
        let found = Configuration::from_le_bytes(&bytes);
        let is_off_limits = host_timeout != 0 && !(200..=60_000).contains(&host_timeout);
        let unknown = source == 2 || rule == 3 || estimator == 2 || dynamic_depth == 2 || dead_time == 2
            || once_per_bin == 2 || (dynamic_depth == 1 && reference == 2)
            || ![0, 4, 8].contains(&neighbours) || levels == 4 || tracking == 2 || !(1..=4).contains(&echoes);
        prop_assert_eq!(
            found.is_err(),
            unknown || (rule == 1 && !(1..=7).contains(&width))
                || (estimator == 1 && ![before, after].iter().all(|half| (256..=1024).contains(half)))
                || (levels > 0 && patience == 0)
                || is_off_limits || reserved.is_some()
        );
        if let Ok(configuration) = found {
            let given = u16::from_le_bytes([bytes[52], bytes[53]]);
            prop_assert_eq!(configuration.once_per_bin, once_per_bin == 1);
            prop_assert_eq!(configuration.dead_time, (dead_time == 1).then_some(given));
            prop_assert_eq!(configuration.dither_bins, u16::from_le_bytes([bytes[55], bytes[56]]));
            prop_assert_eq!(&configuration.dither_seed.to_le_bytes()[..], &bytes[57..65]);
            let again = Configuration::from_le_bytes(&configuration.to_le_bytes());
            prop_assert_eq!(again, Ok(configuration));
        }
    }

    #[test]
    fn reports_come_back(bytes in prop::collection::vec(any::<u8>(), Report::BYTES)) {
        let report = Report::from_le_bytes(&bytes).unwrap();
        prop_assert_eq!(&report.to_le_bytes()[..], &bytes[..]);
        prop_assert_eq!(Report::from_le_bytes(&bytes[1..]), None);
    }

    #[test]
    fn sensors_come_back(
        pixels: u16, width: u32, offset: i32, laser_millihertz: u64, bins: u16, dead_time: u16,
        most_dither: u8, counter_bits in prop_oneof![Just(8u8), Just(10)], unknown: u8,
    ) {
        let sensor = SensorRecord {
            pixels,
            bin_width: (width > 0).then_some(U16F16::from_bits(width)),
            offset: I24F8::from_bits(offset),
            laser_millihertz,
            bins,
            dead_time,
            most_dither,
        };
        let bytes = SensorRecord::to_le_bytes(Some(&sensor), counter_bits);
        let expected = (pixels > 0).then_some(sensor);
        prop_assert_eq!(SensorRecord::from_le_bytes(&bytes), Some((expected, counter_bits)));
        prop_assert_eq!(SensorRecord::from_le_bytes(&bytes[1..]), None);
        prop_assert_eq!(bytes[22], if counter_bits == 10 { 0 } else { counter_bits });
        let mut other = bytes;
        other[22] = unknown;
        let is_known = [0, 8, 10].contains(&unknown);
        prop_assert_eq!(SensorRecord::from_le_bytes(&other).is_some(), is_known);
        let bytes = SensorRecord::to_le_bytes(None, counter_bits);
        prop_assert_eq!(SensorRecord::from_le_bytes(&bytes), Some((None, counter_bits)));
    }

    #[test]
    fn tokens_come_back(code: u16, pixels in 1u8..=64, cycles: u16) {
        let tokens =
            [Token::Photon { code }, Token::Advance { pixels }, Token::EndOfCycles { cycles }];
        let bytes: Vec<u8> = tokens.iter().flat_map(|token| token.to_bytes()).collect();
        let mut left = &bytes[..];
        for token in tokens {
            let (first, rest) = Token::split_first(left).unwrap();
            prop_assert_eq!(first, token);
            left = rest;
        }
        prop_assert_eq!(Token::split_first(left), None);
    }
}
