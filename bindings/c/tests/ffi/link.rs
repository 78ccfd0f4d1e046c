//! A device with the C functions and a host of `dtof-link`.

use core::ptr::{null, null_mut};

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use dtof_core::fixed::types::{I24F8, U4F12, U8F8, U16F16};
use dtof_core::{
    AnyRule, BlockLevel, CentredWindow, Count, DepthEstimator, EchoNumber, Neighbours, PaperRule,
    PixelAddress, WindowRule,
};
use dtof_link::endpoint::Endpoint;
use dtof_link::frame::{Deframer, WIRE_BYTES};
use dtof_link::message::{self, greeting};
use dtof_link::{
    AdaptiveBinning, Configuration, DynamicDepth, HistogramPart, NoHistogram, Report, SensorRecord,
    Source, StopReason,
};

use crate::array::Driven;
use crate::{OK, checked, config, link, paper, pixel, statistics, zeroed};

/// A host, a device, and the wire between them.
struct Pair {
    host: Endpoint,
    deframer: Deframer,
    device: dtof_link_t,
    /// Each `DTOF_SESSION_...` that was reported.
    sessions: Vec<u8>,
    now_ms: u32,
}

impl Pair {
    fn new() -> Self {
        let mut pair = Self {
            host: Endpoint::host(7, greeting(0, 0), 0),
            deframer: Deframer::new(),
            device: link(),
            sessions: Vec::new(),
            now_ms: 0,
        };
        pair.carry();
        assert!(pair.host.is_open());
        assert_eq!(pair.sessions, [DTOF_SESSION_BEGAN]);
        assert_eq!(pair.host.peer_greeting(), &greeting(128, 64));
        pair
    }

    /// Lets half a second pass.
    fn carry(&mut self) {
        for _ in 0..50 {
            self.now_ms += 10;
            let (mut wire, mut session) = ([0; WIRE_BYTES], 9);
            let length = self.host.transmit(self.now_ms, &mut wire);
            // SAFETY: each pointer leads to an object of its type.
            unsafe {
                let (device, bytes) = (&mut self.device, wire.as_ptr());
                let status = dtof_link_receive(device, bytes, length, self.now_ms, &mut session);
                assert_eq!(status, OK);
                self.sessions
                    .extend(Some(session).filter(|&session| session != DTOF_SESSION_UNCHANGED));
                let mut length = 0;
                let (device, room) = (&mut self.device, wire.as_mut_ptr());
                assert_eq!(
                    dtof_link_transmit(device, self.now_ms, room, &mut length),
                    OK
                );
                for &byte in &wire[..length] {
                    if let Some(frame) = self.deframer.push(byte) {
                        self.host.receive(frame, self.now_ms);
                    }
                }
            }
        }
    }

    /// The next message of the host.
    fn take(&mut self) -> Option<(u8, Vec<u8>)> {
        let (mut message, mut kind) = (zeroed::<dtof_message_t>(), 0);
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            let peeked = dtof_link_peek(&self.device, &mut kind);
            let status = dtof_link_take(&mut self.device, &mut message);
            assert_eq!(peeked, status);
            if status == DTOF_ERROR_NO_MESSAGE {
                return None;
            }
            assert_eq!((status, kind), (OK, message.kind));
        }
        Some((kind, message.body[..message.length.into()].to_vec()))
    }

    fn offer(&mut self, kind: u8, body: &[u8]) -> dtof_status_t {
        // SAFETY: both pointers lead to objects of their types.
        unsafe { dtof_link_offer(&mut self.device, kind, body.as_ptr(), body.len()) }
    }

    fn state(&self) -> dtof_link_state_t {
        let mut state = dtof_link_state_t::default();
        // SAFETY: both pointers lead to objects of their types.
        assert_eq!(unsafe { dtof_link_state(&self.device, &mut state) }, OK);
        state
    }
}

fn configuration() -> Configuration {
    let rule = WindowRule::new(3, U4F12::lit("4.47"), Count::saturating(5)).unwrap();
    let window = CentredWindow::with_sides(U8F8::lit("1.75"), U8F8::lit("4")).unwrap();
    Configuration {
        rule: AnyRule::Window(rule),
        estimator: DepthEstimator::CentredWindow(window),
        x: 5,
        l1: 41,
        l2: 1999,
        gate: (3, 120),
        dead_time: Some(20),
        once_per_bin: true,
        dither_bins: 128,
        dither_seed: u64::MAX - 5,
        pixels: 9,
        columns: 3,
        binning: None,
        neighbours: None,
        tracking: true,
        echoes: EchoNumber::LAST,
        echo_guard_bins: 6,
        echo_wait: 4,
        bin_width_ps: U16F16::lit("97.5"),
        offset_mm: I24F8::lit("-12.5"),
        source: Source::Sensor,
        dynamic_depth: None,
        host_timeout_ms: 700,
    }
}

fn read(body: &[u8]) -> Result<dtof_device_config_t, dtof_status_t> {
    read_with(body, 0)
}

fn read_with(body: &[u8], sensor_dead_time: u16) -> Result<dtof_device_config_t, dtof_status_t> {
    let mut config = dtof_device_config_t::default();
    let (bytes, length) = (body.as_ptr(), body.len());
    // SAFETY: both pointers lead to objects of their types.
    match unsafe { dtof_device_config_read(bytes, length, sensor_dead_time, &mut config) } {
        OK => Ok(config),
        error => Err(error),
    }
}

#[test]
fn messages_go_both_ways_whole_once_and_in_order() {
    let mut pair = Pair::new();
    for number in 0..4 {
        assert_eq!(pair.offer(DTOF_MESSAGE_EVENTS, &[number; 240]), OK);
    }
    assert_eq!(pair.offer(DTOF_MESSAGE_EVENTS, &[4]), DTOF_ERROR_FULL);
    assert_eq!((pair.state().has_room, pair.state().is_settled), (0, 0));
    let record = configuration().to_le_bytes();
    pair.host.offer(message::CONFIGURE, &record).unwrap();
    pair.host.offer(message::SYNCHRONISE, &[1, 2, 3]).unwrap();
    pair.carry();
    for number in 0..4 {
        let message = pair.host.take().unwrap();
        assert_eq!(
            (message.kind, &message.body[..]),
            (message::EVENTS, &[number; 240][..])
        );
    }
    assert_eq!(
        pair.take().unwrap(),
        (DTOF_MESSAGE_CONFIGURE, record.to_vec())
    );
    assert_eq!(
        pair.take().unwrap(),
        (DTOF_MESSAGE_SYNCHRONISE, vec![1, 2, 3])
    );
    assert_eq!(pair.take(), None);
    pair.carry();
    let state = pair.state();
    assert_eq!((state.is_open, state.has_room, state.is_settled), (1, 1, 1));
    assert!(state.frames > 2 && state.corrupt == 0);
}

#[test]
fn the_hosts_configuration_becomes_settings() {
    let config = read(&configuration().to_le_bytes()).unwrap();
    let expected = dtof_device_config_t {
        pixel: dtof_config_t {
            minimum_count: 5,
            alpha_q8: 0,
            z_q12: U4F12::lit("4.47").to_bits(),
            x: 5,
            l1: 41,
            l2: 1999,
            gate_first: 3,
            gate_last: 120,
            before_q8: 448,
            after_q8: 1024,
            dead_time: 20,
            rule: DTOF_RULE_WINDOW,
            window: 3,
            estimator: DTOF_ESTIMATOR_CENTRED_WINDOW,
            tracking: 1,
            echoes: 4,
            peel_reach: 6,
            echo_wait: 4,
        },
        bin_width_ps_q16: 97 * 65536 + 32768,
        offset_mm_q8: -3200,
        layout: dtof_layout_t {
            pixels: 9,
            columns: 3,
            once_per_bin: 1,
            ..dtof_layout_t::default()
        },
        host_timeout_ms: 700,
        source: DTOF_SOURCE_SENSOR,
        dither_bins: 128,
        dither_seed: u64::MAX - 5,
    };
    assert_eq!(config, expected);
    assert!(checked(&config.pixel).is_ok());
}

#[test]
fn the_dead_time_is_the_hosts_or_else_the_sensors() {
    let alpha = U8F8::lit("4");
    let paper = Configuration {
        rule: PaperRule::new(alpha, Count::saturating(5)).into(),
        tracking: false,
        ..configuration()
    };
    let window = configuration();
    let refused = Err(DTOF_ERROR_DEAD_TIME);
    for (base, dead_time, of_sensor, expected) in [
        (window, Some(20), 7, Ok(20)),
        (window, Some(0), 7, Ok(0)),
        (window, None, 7, Ok(7)),
        (window, None, 0, Ok(0)),
        (paper, Some(20), 7, refused),
        (paper, Some(128), 7, Ok(128)),
        (paper, Some(0), u16::MAX, Ok(0)),
        (paper, None, 7, Ok(0)),
        (paper, None, u16::MAX, Ok(u16::MAX)),
    ] {
        let requested = Configuration { dead_time, ..base };
        let read = read_with(&requested.to_le_bytes(), of_sensor);
        assert_eq!(read.map(|config| config.pixel.dead_time), expected);
        // It is one that the check takes.
        assert!(read.is_err() || checked(&read.unwrap().pixel).is_ok());
    }
}

#[test]
fn a_dither_that_cannot_be_is_refused() {
    let refused = Err(DTOF_ERROR_DITHER);
    for (dither_bins, source, expected) in [
        (0, Source::Sensor, Ok(0)),
        (2, Source::Sensor, Ok(2)),
        (254, Source::Sensor, Ok(254)),
        (1, Source::Sensor, refused),
        (253, Source::Sensor, refused),
        (255, Source::Sensor, refused),
        (256, Source::Sensor, refused),
        (u16::MAX - 1, Source::Sensor, refused),
        (0, Source::Link, Ok(0)),
        (2, Source::Link, refused),
    ] {
        let requested = Configuration {
            dither_bins,
            source,
            ..configuration()
        };
        let read = read(&requested.to_le_bytes());
        assert_eq!(
            read.map(|config| config.dither_bins),
            expected,
            "{dither_bins}"
        );
    }
}

#[test]
fn the_host_says_whether_photons_count_once_per_bin() {
    let mut record = configuration().to_le_bytes();
    for (byte, expected) in [
        (0, Ok(0)),
        (1, Ok(1)),
        (2, Err(DTOF_ERROR_CONFIGURATION)),
        (255, Err(DTOF_ERROR_CONFIGURATION)),
    ] {
        record[54] = byte;
        let read = read(&record).map(|config| config.layout.once_per_bin);
        assert_eq!(read, expected);
    }
}

#[test]
fn the_host_says_how_pixels_work_together() {
    let alone = Configuration {
        once_per_bin: false,
        dead_time: None,
        ..configuration()
    };
    let layout = |configuration: Configuration| read(&configuration.to_le_bytes()).unwrap().layout;
    let expected = dtof_layout_t {
        pixels: 9,
        columns: 3,
        ..dtof_layout_t::default()
    };
    assert_eq!(layout(alone), expected);
    let binning = Some(AdaptiveBinning {
        levels: BlockLevel::saturating(2),
        patience: 64,
    });
    let blocks = layout(Configuration { binning, ..alone });
    assert_eq!((blocks.block_levels, blocks.patience), (2, 64));
    let neighbours = Some(Neighbours::Eight);
    let around = layout(Configuration {
        neighbours,
        ..alone
    });
    assert_eq!(
        around,
        dtof_layout_t {
            neighbours: 8,
            ..expected
        }
    );
}

#[test]
fn unsupported_configurations_are_refused() {
    let good = configuration();
    let dynamic_depth = Some(DynamicDepth::default());
    let changes = Configuration {
        dynamic_depth,
        ..good
    };
    assert_eq!(read(&changes.to_le_bytes()), Err(DTOF_ERROR_CONFIGURATION));
    assert_eq!(
        read(&good.to_le_bytes()[1..]),
        Err(DTOF_ERROR_CONFIGURATION)
    );
    for (host_timeout_ms, refused) in [(0, false), (199, true), (200, false), (60_001, true)] {
        let changed = Configuration {
            host_timeout_ms,
            ..good
        };
        let error = read(&changed.to_le_bytes()).err();
        assert_eq!(error, refused.then_some(DTOF_ERROR_HOST_TIMEOUT));
    }
    let mut reserved = good.to_le_bytes();
    *reserved.last_mut().unwrap() = 1;
    assert_eq!(read(&reserved), Err(DTOF_ERROR_RESERVED_FIELD));
}

#[test]
fn records_are_those_of_the_link() {
    let mut pair = Pair::new();
    pair.carry();
    let (mut sensor, mut body) = ([9; DTOF_SENSOR_BYTES], [9; DTOF_REPORT_BYTES]);
    let report = dtof_report_t {
        cycles: 1 << 40,
        unaddressed: 2,
        overrun: 3,
        unknown: 4,
        sensor_errors: 5,
        sensor_starts: 7,
        sensor_stops: 8,
        last_sensor_error: 6,
        stop_reason: DTOF_STOP_WATCHDOG,
    };
    let (mut done, codes) = (statistics(), [60u16; 8]);
    // SAFETY: each pointer leads to an object of its type.
    unsafe {
        let mut driven = Driven::new();
        let layout = dtof_layout_t {
            pixels: 1,
            once_per_bin: 1,
            ..dtof_layout_t::default()
        };
        assert_eq!(driven.configure(&paper(), &layout), OK);
        let (array, blocks, losses) = (&mut driven.array, null_mut(), null_mut());
        assert_eq!(dtof_array_photons(array, 0, codes.as_ptr(), 8), OK);
        assert_eq!(dtof_array_statistics(array, &mut done, blocks, losses), OK);
        let room = sensor.as_mut_ptr();
        let written = dtof_sensor_write(9, 100, 20, 40, 250 << 16, 1_000_000, -256, room);
        assert_eq!(written, OK);
        let room = body.as_mut_ptr();
        assert_eq!(
            dtof_report_write(&report, &done, null(), &pair.device, room),
            OK
        );
    }
    let expected = SensorRecord {
        pixels: 9,
        bin_width: Some(U16F16::lit("250")),
        offset: I24F8::lit("-1"),
        laser_millihertz: 1_000_000,
        bins: 100,
        dead_time: 20,
        most_dither: 40,
    };
    let expected = Some((Some(expected), dtof_counter_bits()));
    assert_eq!(SensorRecord::from_le_bytes(&sensor), expected);
    let read = Report::from_le_bytes(&body).unwrap();
    assert_eq!(
        (read.cycles, read.unaddressed, read.overrun),
        (1 << 40, 2, 3)
    );
    assert_eq!(
        (read.unknown, read.sensor_errors, read.last_sensor_error),
        (4, 5, 6)
    );
    assert_eq!((read.sensor_starts, read.sensor_stops), (7, 8));
    assert_eq!(read.statistics.repeated, 7);
    let reason = StopReason::from_number(read.stop_reason);
    assert_eq!(reason, Some(StopReason::Watchdog));
    assert_eq!(read.link.frames, pair.state().frames);
}

#[test]
fn a_device_knows_how_long_its_host_has_been_silent() {
    let mut pair = Pair::new();
    let silent = |pair: &Pair, now_ms| {
        let mut silent_ms = 9;
        // SAFETY: both pointers lead to objects of their types.
        let status = unsafe { dtof_link_silent_ms(&pair.device, now_ms, &mut silent_ms) };
        assert_eq!(status, OK);
        silent_ms
    };
    // An idle host sends a frame every 50 ms.
    for _ in 0..10 {
        pair.carry();
        assert!(silent(&pair, pair.now_ms) <= 50);
    }
    let first = silent(&pair, pair.now_ms);
    assert_eq!(silent(&pair, pair.now_ms + 3000), first + 3000);

    // Its own frames, which a line may echo, do not count as the host's.
    for _ in 0..100 {
        pair.now_ms += 10;
        let (mut wire, mut length, mut session) = ([0; WIRE_BYTES], 0, 9);
        let room = wire.as_mut_ptr();
        // SAFETY: each pointer leads to an object of its type.
        unsafe {
            let sent = dtof_link_transmit(&mut pair.device, pair.now_ms, room, &mut length);
            assert_eq!(sent, OK);
            let (device, bytes) = (&mut pair.device, wire.as_ptr());
            let heard = dtof_link_receive(device, bytes, length, pair.now_ms, &mut session);
            assert_eq!((heard, session), (OK, DTOF_SESSION_UNCHANGED));
        }
    }
    assert!(silent(&pair, pair.now_ms) >= 1000);
    assert_eq!(pair.state().is_open, 1);
}

#[test]
fn a_host_that_ends_its_session_hears_why_the_sensor_stopped() {
    let mut pair = Pair::new();
    assert_eq!(pair.host.stop_reason(), None);
    // SAFETY: the pointer leads to a link.
    let status = unsafe { dtof_link_set_stop_reason(&mut pair.device, DTOF_STOP_END_OF_SESSION) };
    assert_eq!(status, OK);
    pair.host.end(pair.now_ms);
    pair.carry();
    assert_eq!(pair.sessions, [DTOF_SESSION_BEGAN, DTOF_SESSION_ENDED]);
    assert!(pair.host.is_lost());
    assert_eq!(pair.host.stop_reason(), Some(StopReason::EndOfSession));
    assert_eq!(pair.state().is_open, 0);
    let mut silent_ms = 0;
    // SAFETY: both pointers lead to objects of their types.
    let status = unsafe { dtof_link_silent_ms(&pair.device, pair.now_ms, &mut silent_ms) };
    assert_eq!((status, silent_ms), (OK, u32::MAX));

    // The next host.
    pair.host = Endpoint::host(8, greeting(0, 0), pair.now_ms);
    pair.carry();
    assert_eq!(pair.sessions[2..], [DTOF_SESSION_BEGAN]);
    // Another host, while the session of the one before is open.
    pair.host = Endpoint::host(9, greeting(0, 0), pair.now_ms);
    pair.carry();
    assert_eq!(pair.sessions[3..], [DTOF_SESSION_BEGAN]);
}

/// The counts of all parts. Each part continues the one before.
fn counts_of(mut part: impl FnMut(usize, &mut [u8; DTOF_BODY_BYTES]) -> usize) -> Vec<u32> {
    let mut counts = Vec::new();
    for number in 0.. {
        let mut body = [9; DTOF_BODY_BYTES];
        let length = part(number, &mut body);
        if length == 0 {
            break;
        }
        let read = HistogramPart::from_le_bytes(&body[..length])
            .unwrap()
            .unwrap();
        assert_eq!(usize::from(read.first_bin()), counts.len());
        assert_eq!(
            (read.head().pixel.raw(), read.head().cycle.raw()),
            (5, 1 << 40)
        );
        counts.extend(read.counts());
    }
    counts
}

#[test]
fn histograms_go_out_as_the_host_reads_them() {
    let (config, mut pixel) = (config(), pixel(5));
    let codes = [3, 60, 60, 127];
    let mut expected = [0; 128];
    for code in codes {
        expected[usize::from(code)] += 1;
    }
    // SAFETY: each pointer leads to an object of its type.
    unsafe {
        assert_eq!(
            dtof_pixel_count_batch(&mut pixel, &config, codes.as_ptr(), 4),
            OK
        );
    }
    let of_pixel = counts_of(|part, body| {
        let mut length = 9;
        let room = body.as_mut_ptr();
        // SAFETY: each pointer leads to an object of its type.
        let status =
            unsafe { dtof_pixel_histogram_write(&pixel, part, 1 << 40, room, &mut length) };
        assert_eq!(status, OK);
        length
    });
    assert_eq!(of_pixel, expected);

    // With counts of 24 bits there are two parts.
    expected[60] = 16_777_215;
    let whole = counts_of(|part, body| {
        let (counts, room, mut length) = (expected.as_ptr(), body.as_mut_ptr(), 9);
        // SAFETY: each pointer leads to an object of its type.
        let status =
            unsafe { dtof_counts_write(counts, part, 1 << 40, 549_888, 5, room, &mut length) };
        assert_eq!(status, OK);
        length
    });
    assert_eq!(whole, expected);

    let (mut body, mut length) = ([0; DTOF_BODY_BYTES], 0);
    // SAFETY: each pointer leads to an object of its type.
    let mut none =
        |reason| unsafe { dtof_no_histogram_write(5, reason, body.as_mut_ptr(), &mut length) };
    assert_eq!(none(0), DTOF_ERROR_REASON);
    assert_eq!(none(DTOF_NO_HISTOGRAM_PIXEL), OK);
    let read = HistogramPart::from_le_bytes(&body[..length]).unwrap();
    assert_eq!(read, Err((PixelAddress::new(5), NoHistogram::NoPixel)));
}
