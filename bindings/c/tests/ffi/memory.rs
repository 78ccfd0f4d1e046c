//! Memory as C passes it: uninitialised, with any contents, of another type, null or misaligned. Under
//! Miri these tests find invalid reads and references.

use core::mem::MaybeUninit;
use core::ptr;
use std::collections::BTreeSet;
use std::ffi::CStr;

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use proptest::prelude::*;

use crate::{
    OK, array, checked, config, decoder, encoder, link, paper, pixel, scale, statistics, zeroed,
};

/// Uninitialised memory.
struct Room<T>(MaybeUninit<T>);

impl<T> Room<T> {
    const fn new() -> Self {
        Self(MaybeUninit::uninit())
    }

    const fn at(&mut self) -> *mut T {
        self.0.as_mut_ptr()
    }

    /// The value, after a function has written it.
    const fn read(self) -> T {
        // SAFETY: the tests call it after a function has written the value.
        unsafe { self.0.assume_init() }
    }
}

#[test]
fn functions_write_to_uninitialised_memory() {
    let config = config();
    let (mut settings, mut pixel) = (Room::new(), Room::new());
    let (mut scale, mut range, mut link) = (Room::new(), Room::new(), Room::new());
    let (mut encoder, mut decoder, mut record) = (Room::new(), Room::new(), Room::new());
    let (mut length, mut state, mut counts) = (Room::new(), Room::new(), Room::new());
    let mut silent = Room::new();
    let mut wire = Room::<[u8; DTOF_WIRE_BYTES]>::new();
    let mut body = Room::<[u8; DTOF_BODY_BYTES]>::new();
    let mut events = Room::<[dtof_event_t; DTOF_ECHOES]>::new();
    let (mut look, mut session) = (Room::new(), Room::new());
    let (mut array, mut left) = (Room::new(), Room::new());
    let (mut places, mut block) = (Room::<[dtof_place_t; 2]>::new(), Room::new());
    let mut sensor = Room::<[u8; DTOF_SENSOR_BYTES]>::new();
    let mut report = Room::<[u8; DTOF_REPORT_BYTES]>::new();
    let mut done = Room::new();
    let photons = [60u16; 20];
    let wide = [7u32; DTOF_BINS];
    // SAFETY: each pointer leads to room for its type, or to what it should.
    unsafe {
        assert_eq!(dtof_config_paper(settings.at()), OK);
        assert_eq!(dtof_config_check(settings.at(), &mut zeroed()), OK);
        assert_eq!(dtof_scale_init(scale.at(), 250 << 16, 0), OK);
        assert_eq!(dtof_range(scale.at(), 256, range.at()), OK);
        assert_eq!(range.read(), 9593);

        assert_eq!(dtof_statistics_init(done.at()), OK);
        let done = done.at();
        assert_eq!(dtof_pixel_init(pixel.at(), DTOF_PIXEL_SIZE, 5), OK);
        let (first, number) = (photons.as_ptr(), photons.len());
        assert_eq!(
            dtof_pixel_count_batch(pixel.at(), &config, first, number),
            OK
        );
        let one = pixel.at();
        let ended = dtof_pixel_end_laser_cycles(one, &config, 44, done, 44, look.at());
        assert_eq!((ended, look.read()), (OK, dtof_look_t::DTOF_LOOK_EVENT));
        let mut event = Room::new();
        assert_eq!(dtof_pixel_take_event(one, event.at()), OK);
        assert_eq!(dtof_pixel_add_photons(one, done), OK);
        assert_eq!(dtof_statistics_read(done, counts.at()), OK);
        let counts = counts.read();
        assert_eq!((counts.events, counts.counted), (1, 20));

        let (at, room) = (array.at(), places.at().cast());
        assert_eq!(
            dtof_array_init(at, DTOF_PLACE_SIZE, room, 2, block.at(), 1),
            OK
        );
        let layout = dtof_layout_t {
            pixels: 2,
            columns: 2,
            patience: 8,
            block_levels: 1,
            ..dtof_layout_t::default()
        };
        assert_eq!(dtof_array_configure_layout(at, settings.at(), &layout), OK);
        assert_eq!(dtof_array_photons(at, 1, first, number), OK);
        for _ in 0..11 {
            assert_eq!(dtof_array_end_laser_cycles(at, 4, left.at()), OK);
        }
        assert_eq!(left.read(), 0);
        assert_eq!(dtof_array_next_event(at, event.at()), OK);
        let (mut cycles, mut losses) = (Room::new(), Room::new());
        assert_eq!(dtof_array_cycles(at, cycles.at()), OK);
        assert_eq!(cycles.read(), 44);
        let mut of_blocks = Room::new();
        let read = dtof_array_statistics(at, done, of_blocks.at(), losses.at());
        assert_eq!((read, losses.read()), (OK, dtof_losses_t::default()));
        let (mut written, room) = (Room::new(), body.at().cast::<u8>());
        let status = dtof_array_histogram_write(at, 1, 0, room, written.at());
        assert_eq!(status, OK);
        assert!(written.read() > 0);

        let room = events.at().cast::<dtof_event_t>();
        let (counts, found) = (wide.as_ptr(), length.at());
        let decided = dtof_histogram_decide(&config, counts, 0, 0, 1, done, room, found);
        assert_eq!((decided, length.read()), (OK, 0));

        let mut length = Room::new();
        let mut word = Room::<[u8; DTOF_EVENT_BYTES]>::new();
        let bytes = word.at().cast::<u8>();
        assert_eq!(dtof_aer_encoder_init(encoder.at()), OK);
        assert_eq!(dtof_aer_decoder_init(decoder.at()), OK);
        assert_eq!(
            dtof_aer_encode(encoder.at(), event.at(), bytes, length.at()),
            OK
        );
        assert_eq!(length.read(), 32);
        assert_eq!(dtof_aer_decode(decoder.at(), bytes, record.at()), OK);
        let next = bytes.wrapping_add(16);
        assert_eq!(dtof_aer_decode(decoder.at(), next, record.at()), OK);
        assert_eq!(record.read().event, event.read());
        assert_eq!(dtof_aer_end(1, 2, bytes), OK);

        let at = link.at();
        assert_eq!(dtof_link_init(at, DTOF_LINK_SIZE, 1), OK);
        assert_eq!(dtof_link_receive(at, ptr::null(), 0, 0, session.at()), OK);
        assert_eq!(dtof_link_state(at, state.at()), OK);
        assert_eq!((session.read(), state.read().is_open), (0, 0));
        assert_eq!(dtof_link_silent_ms(at, 0, silent.at()), OK);
        assert_eq!(silent.read(), u32::MAX);
        let room = wire.at().cast::<u8>();
        let mut length = Room::new();
        assert_eq!(dtof_link_transmit(at, 0, room, length.at()), OK);
        assert_eq!(length.read(), 0);
        let (mut kind, mut message) = (Room::new(), Room::new());
        assert_eq!(dtof_link_peek(at, kind.at()), DTOF_ERROR_NO_MESSAGE);
        assert_eq!(dtof_link_take(at, message.at()), DTOF_ERROR_NO_MESSAGE);

        let room = sensor.at().cast::<u8>();
        assert_eq!(dtof_sensor_write(1, 0, 0, 0, 0, 0, 0, room), OK);
        assert_eq!(sensor.read()[..2], [1, 0]);
        let room = report.at();
        let of = dtof_report_t::default();
        assert_eq!(dtof_report_write(&of, done, done, at, room.cast()), OK);
        assert_eq!(report.read()[..8], [0; 8]);
        let room = body.at().cast::<u8>();
        let mut length = Room::new();
        let written = dtof_pixel_histogram_write(pixel.at(), 0, 0, room, length.at());
        assert_eq!(written, OK);
        assert!(length.read() > 0);
        let mut length = Room::new();
        let written = dtof_counts_write(wide.as_ptr(), 9, 0, 0, 0, room, length.at());
        assert_eq!((written, length.read()), (OK, 0));
        let mut length = Room::new();
        let written = dtof_no_histogram_write(0, DTOF_NO_HISTOGRAM_PIXEL, room, length.at());
        assert_eq!(written, OK);
        assert!(length.read() > 0);
    }
}

/// Memory that is long enough and aligned for every object. Objects may contain padding, which must
/// not be read.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct Memory([MaybeUninit<u8>; DTOF_LINK_SIZE]);

impl Memory {
    const fn of(byte: u8) -> Self {
        Self([MaybeUninit::new(byte); DTOF_LINK_SIZE])
    }

    /// An object at the beginning, then zeros.
    const fn with<T>(object: T) -> Self {
        let mut memory = Self::of(0);
        // SAFETY: the memory is long enough and aligned.
        unsafe { memory.at::<T>().write(object) };
        memory
    }

    const fn at<T>(&mut self) -> *mut T {
        assert!(size_of::<T>() <= DTOF_LINK_SIZE);
        ptr::from_mut(self).cast()
    }
}

/// A call that is right but for the pointer it gets.
type Call = fn(*mut u8) -> dtof_status_t;

/// Each function that takes an initialised object: its name, the type, and a call.
#[rustfmt::skip]
const TAKES: [(&str, &str, Call); 42] = {
    const CODES: *const u16 = [0u16; DTOF_BINS].as_ptr();
    const COUNTS: *const u32 = [0u32; DTOF_BINS].as_ptr();
    const NO_LOOK: *mut dtof_look_t = ptr::null_mut();
    const NO_LEFT: *mut u16 = ptr::null_mut();
    const NO_BLOCKS: *const dtof_statistics_t = ptr::null();
    // SAFETY: all memory is long enough and aligned for each type.
    unsafe {[
        ("dtof_statistics_read", "dtof_statistics_t", |p| dtof_statistics_read(p.cast(), &mut zeroed())),
        ("dtof_range", "dtof_scale_t", |p| dtof_range(p.cast(), 0, &mut 0)),
        ("dtof_pixel_count", "dtof_pixel_t", |p| dtof_pixel_count(p.cast(), &config(), 0)),
        ("dtof_pixel_count", "dtof_checked_config_t", |p| dtof_pixel_count(&mut pixel(0), p.cast(), 0)),
        ("dtof_pixel_count_batch", "dtof_pixel_t", |p| dtof_pixel_count_batch(p.cast(), &config(), CODES, 1)),
        ("dtof_pixel_count_batch", "dtof_checked_config_t", |p| dtof_pixel_count_batch(&mut pixel(0), p.cast(), CODES, 1)),
        ("dtof_pixel_count_frame", "dtof_pixel_t", |p| dtof_pixel_count_frame(p.cast(), &config(), CODES)),
        ("dtof_pixel_count_frame", "dtof_checked_config_t", |p| dtof_pixel_count_frame(&mut pixel(0), p.cast(), CODES)),
        ("dtof_pixel_end_laser_cycles", "dtof_pixel_t", |p| dtof_pixel_end_laser_cycles(p.cast(), &config(), 0, &mut statistics(), 1, NO_LOOK)),
        ("dtof_pixel_end_laser_cycles", "dtof_checked_config_t", |p| dtof_pixel_end_laser_cycles(&mut pixel(0), p.cast(), 0, &mut statistics(), 1, NO_LOOK)),
        ("dtof_pixel_end_laser_cycles", "dtof_statistics_t", |p| dtof_pixel_end_laser_cycles(&mut pixel(0), &config(), 0, p.cast(), 1, NO_LOOK)),
        ("dtof_pixel_take_event", "dtof_pixel_t", |p| dtof_pixel_take_event(p.cast(), &mut zeroed())),
        ("dtof_pixel_add_photons", "dtof_pixel_t", |p| dtof_pixel_add_photons(p.cast(), &mut statistics())),
        ("dtof_pixel_add_photons", "dtof_statistics_t", |p| dtof_pixel_add_photons(&pixel(0), p.cast())),
        ("dtof_array_configure", "dtof_array_t", |p| dtof_array_configure(p.cast(), &paper(), 0)),
        ("dtof_array_configure_layout", "dtof_array_t", |p| dtof_array_configure_layout(p.cast(), &paper(), &zeroed())),
        ("dtof_array_clear", "dtof_array_t", |p| dtof_array_clear(p.cast())),
        ("dtof_array_leave_out", "dtof_array_t", |p| dtof_array_leave_out(p.cast(), 0)),
        ("dtof_array_photon", "dtof_array_t", |p| dtof_array_photon(p.cast(), 0, 0)),
        ("dtof_array_photons", "dtof_array_t", |p| dtof_array_photons(p.cast(), 0, CODES, 1)),
        ("dtof_array_end_laser_cycles", "dtof_array_t", |p| dtof_array_end_laser_cycles(p.cast(), 1, NO_LEFT)),
        ("dtof_array_next_event", "dtof_array_t", |p| dtof_array_next_event(p.cast(), &mut zeroed())),
        ("dtof_array_lost", "dtof_array_t", |p| dtof_array_lost(p.cast(), 1, 1)),
        ("dtof_array_cycles", "dtof_array_t", |p| dtof_array_cycles(p.cast(), &mut 0)),
        ("dtof_array_statistics", "dtof_array_t", |p| dtof_array_statistics(p.cast(), &mut zeroed(), &mut zeroed(), &mut zeroed())),
        ("dtof_array_histogram_write", "dtof_array_t", |p| dtof_array_histogram_write(p.cast(), 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
        ("dtof_histogram_decide", "dtof_checked_config_t", |p| dtof_histogram_decide(p.cast(), COUNTS, 0, 0, 1, &mut statistics(), echoes().as_mut_ptr(), &mut 0)),
        ("dtof_histogram_decide", "dtof_statistics_t", |p| dtof_histogram_decide(&config(), COUNTS, 0, 0, 1, p.cast(), echoes().as_mut_ptr(), &mut 0)),
        ("dtof_aer_encode", "dtof_aer_encoder_t", |p| dtof_aer_encode(p.cast(), &event(), [0; 32].as_mut_ptr(), &mut 0)),
        ("dtof_aer_decode", "dtof_aer_decoder_t", |p| dtof_aer_decode(p.cast(), [0; 16].as_ptr(), &mut zeroed())),
        ("dtof_link_receive", "dtof_link_t", |p| dtof_link_receive(p.cast(), [0].as_ptr(), 1, 0, &mut 0)),
        ("dtof_link_transmit", "dtof_link_t", |p| dtof_link_transmit(p.cast(), 0, [0; 256].as_mut_ptr(), &mut 0)),
        ("dtof_link_peek", "dtof_link_t", |p| dtof_link_peek(p.cast(), &mut 0)),
        ("dtof_link_take", "dtof_link_t", |p| dtof_link_take(p.cast(), &mut zeroed())),
        ("dtof_link_offer", "dtof_link_t", |p| dtof_link_offer(p.cast(), DTOF_MESSAGE_EVENTS, [0].as_ptr(), 1)),
        ("dtof_link_state", "dtof_link_t", |p| dtof_link_state(p.cast(), &mut zeroed())),
        ("dtof_link_silent_ms", "dtof_link_t", |p| dtof_link_silent_ms(p.cast(), 0, &mut 0)),
        ("dtof_link_set_stop_reason", "dtof_link_t", |p| dtof_link_set_stop_reason(p.cast(), DTOF_STOP_RESET)),
        ("dtof_report_write", "dtof_statistics_t", |p| dtof_report_write(&zeroed(), p.cast(), NO_BLOCKS, &link(), [0; 256].as_mut_ptr())),
        ("dtof_report_write", "dtof_statistics_t", |p| dtof_report_write(&zeroed(), &statistics(), p.cast(), &link(), [0; 256].as_mut_ptr())),
        ("dtof_report_write", "dtof_link_t", |p| dtof_report_write(&zeroed(), &statistics(), NO_BLOCKS, p.cast(), [0; 256].as_mut_ptr())),
        ("dtof_pixel_histogram_write", "dtof_pixel_t", |p| dtof_pixel_histogram_write(p.cast(), 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
    ]}
};

/// Parameters that a function initialises, besides the functions named `..._init`.
const INITIALISES: [(&str, &str); 2] = [
    ("dtof_config_check", "dtof_checked_config_t"),
    ("dtof_array_statistics", "dtof_statistics_t"),
];

/// An event whose fields are in range.
const fn event() -> dtof_event_t {
    dtof_event_t {
        cycle: 0,
        peak_count: 0,
        background: 0,
        position_q8: 0,
        pixel: 0,
        exposure: 0,
        peak_bin: 0,
        offset_q8: 0,
        level: 0,
        echo: 1,
        flags: 0,
    }
}

const fn echoes() -> [dtof_event_t; DTOF_ECHOES] {
    [event(); DTOF_ECHOES]
}

#[test]
fn an_object_without_the_tag_of_its_type_is_refused() {
    let mut objects = [
        ("zeroed", Memory::of(0)),
        ("0xaa", Memory::of(0xaa)),
        ("erased", Memory::of(0xff)),
        ("dtof_statistics_t", Memory::with(statistics())),
        ("dtof_scale_t", Memory::with(scale())),
        ("dtof_checked_config_t", Memory::with(config())),
        ("dtof_pixel_t", Memory::with(pixel(0))),
        ("dtof_array_t", Memory::with(array())),
        ("dtof_aer_encoder_t", Memory::with(encoder())),
        ("dtof_aer_decoder_t", Memory::with(decoder())),
        ("dtof_link_t", Memory::with(link())),
    ];
    for (function, takes, call) in TAKES {
        for (object, memory) in &mut objects {
            let is_refused = call(memory.at()) == DTOF_ERROR_NOT_INITIALISED;
            assert_eq!(
                is_refused,
                *object != takes,
                "{function}, {takes}: {object}"
            );
        }
    }
}

#[test]
fn every_object_of_the_header_is_checked() {
    let header = include_str!("../../include/dtof.h");
    let code: String = header
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .flat_map(|line| [line, " "])
        .collect();
    let opaque: BTreeSet<&str> = TAKES.iter().map(|(_, of, _)| *of).collect();
    assert_eq!(opaque.len(), code.matches(" opaque[").count());
    let mut found = BTreeSet::new();
    for statement in code.split(';') {
        let Some((name, parameters)) = statement.split_once('(') else {
            continue;
        };
        let name = name.split_whitespace().last().unwrap_or_default();
        if !name.starts_with("dtof_") || name.ends_with("_init") {
            continue;
        }
        for parameter in parameters.split(',') {
            let mut words = parameter.split_whitespace();
            let of = words.find(|word| opaque.contains(word));
            found.extend(of.map(|of| (name, of)));
        }
    }
    let checked = TAKES.iter().map(|(name, of, _)| (*name, *of));
    assert_eq!(found, checked.chain(INITIALISES).collect());
}

/// Pointers of the functions, each with the alignment of its type.
#[rustfmt::skip]
const POINTERS: [(usize, Call); 45] = {
    // SAFETY: the tests pass null and misaligned pointers only.
    unsafe {[
        (4, |p| dtof_config_paper(p.cast())),
        (4, |p| dtof_config_for_pulse(p.cast(), 256)),
        (4, |p| dtof_config_false_alarms(p.cast(), 100)),
        (4, |p| dtof_config_check(p.cast(), &mut zeroed())),
        (4, |p| dtof_config_check(&paper(), p.cast())),
        (4, |p| dtof_scale_init(p.cast(), 250 << 16, 0)),
        (4, |p| dtof_range(p.cast(), 0, &mut 0)),
        (4, |p| dtof_range(&scale(), 0, p.cast())),
        (4, |p| dtof_pixel_init(p.cast(), DTOF_PIXEL_SIZE, 0)),
        (8, |p| dtof_array_init(p.cast(), DTOF_PLACE_SIZE, ptr::null_mut(), 0, ptr::null_mut(), 0)),
        (4, |p| dtof_array_init(&mut zeroed(), DTOF_PLACE_SIZE, p.cast(), 1, ptr::null_mut(), 0)),
        (4, |p| dtof_array_init(&mut zeroed(), DTOF_PLACE_SIZE, ptr::null_mut(), 0, p.cast(), 1)),
        (8, |p| dtof_array_configure(p.cast(), &paper(), 0)),
        (4, |p| dtof_array_configure(&mut array(), p.cast(), 0)),
        (8, |p| dtof_array_configure_layout(p.cast(), &paper(), &zeroed())),
        (4, |p| dtof_array_configure_layout(&mut array(), p.cast(), &zeroed())),
        (2, |p| dtof_array_configure_layout(&mut array(), &paper(), p.cast())),
        (2, |p| dtof_array_photons(&mut array(), 0, p.cast(), 1)),
        (2, |p| dtof_array_end_laser_cycles(&mut array(), 2, p.cast())),
        (8, |p| dtof_array_next_event(&mut array(), p.cast())),
        (8, |p| dtof_array_cycles(&array(), p.cast())),
        (8, |p| dtof_array_statistics(&array(), p.cast(), &mut zeroed(), &mut zeroed())),
        (4, |p| dtof_pixel_take_event(p.cast(), &mut zeroed())),
        (8, |p| dtof_pixel_take_event(&mut pixel(0), p.cast())),
        (4, |p| dtof_pixel_add_photons(p.cast(), &mut zeroed())),
        (8, |p| dtof_pixel_add_photons(&pixel(0), p.cast())),
        (8, |p| dtof_statistics_init(p.cast())),
        (8, |p| dtof_statistics_read(p.cast(), &mut zeroed())),
        (8, |p| dtof_statistics_read(&statistics(), p.cast())),
        (8, |p| dtof_aer_encoder_init(p.cast())),
        (8, |p| dtof_aer_decoder_init(p.cast())),
        (8, |p| dtof_aer_encode(p.cast(), &zeroed(), [0; 32].as_mut_ptr(), &mut 0)),
        (8, |p| dtof_aer_decode(p.cast(), [0; 16].as_ptr(), &mut zeroed())),
        (4, |p| dtof_crc32(p.cast(), [0].as_ptr(), 1)),
        (8, |p| dtof_link_init(p.cast(), DTOF_LINK_SIZE, 1)),
        (8, |p| dtof_link_receive(p.cast(), [0].as_ptr(), 1, 0, &mut 0)),
        (8, |p| dtof_link_transmit(p.cast(), 0, [0; 256].as_mut_ptr(), &mut 0)),
        (8, |p| dtof_link_peek(p.cast(), &mut 0)),
        (8, |p| dtof_link_state(p.cast(), &mut zeroed())),
        (8, |p| dtof_link_silent_ms(p.cast(), 0, &mut 0)),
        (4, |p| dtof_link_silent_ms(&link(), 0, p.cast())),
        (8, |p| dtof_link_set_stop_reason(p.cast(), DTOF_STOP_RESET)),
        (4, |p| dtof_pixel_histogram_write(p.cast(), 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
        (4, |p| dtof_counts_write(p.cast(), 0, 0, 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
        (8, |p| dtof_report_write(p.cast(), &zeroed(), &zeroed(), &zeroed(), [0; 256].as_mut_ptr())),
    ]}
};

#[test]
fn null_and_misaligned_pointers_are_refused() {
    let mut memory = Memory::of(0);
    for (number, (alignment, call)) in POINTERS.into_iter().enumerate() {
        assert_eq!(call(ptr::null_mut()), DTOF_ERROR_NULL, "{number}");
        for off in (1..8).filter(|off| off % alignment != 0) {
            let pointer = memory.at::<u8>().wrapping_add(off);
            assert_eq!(call(pointer), DTOF_ERROR_ALIGNMENT, "{number} at {off}");
        }
    }
    // SAFETY: `Memory::of` has written them.
    let bytes = memory.0.map(|byte| unsafe { byte.assume_init() });
    assert_eq!(bytes, [0; DTOF_LINK_SIZE]);
}

#[test]
fn null_pointers_to_bytes_are_refused() {
    let mut bytes = [0u8; 256];
    let room = bytes.as_mut_ptr();
    let none = ptr::null_mut();
    let mut length = 0;
    let (mut encoder, mut decoder, mut link, event) = (encoder(), decoder(), link(), event());
    // SAFETY: each pointer leads to an object of its type, or is null.
    unsafe {
        let refused = [
            dtof_aer_encode(&mut encoder, &event, none, &mut length),
            dtof_aer_encode(&mut encoder, &event, room, ptr::null_mut()),
            dtof_aer_encode(&mut encoder, ptr::null(), room, &mut length),
            dtof_aer_decode(&mut decoder, none, &mut zeroed()),
            dtof_aer_decode(&mut decoder, room, ptr::null_mut()),
            dtof_link_receive(&mut link, none, 1, 0, &mut 0),
            dtof_link_receive(&mut link, room, 1, 0, none),
            dtof_link_transmit(&mut link, 0, room, ptr::null_mut()),
            dtof_link_offer(&mut link, DTOF_MESSAGE_EVENTS, none, 1),
            dtof_link_state(&link, ptr::null_mut()),
            dtof_link_silent_ms(&link, 0, ptr::null_mut()),
            dtof_sensor_write(1, 0, 0, 0, 0, 0, 0, none),
            dtof_report_write(&zeroed(), &statistics(), &statistics(), &link, none),
            dtof_device_config_read(none, 1, 0, &mut zeroed()),
            dtof_no_histogram_write(0, 1, none, &mut length),
            dtof_no_histogram_write(0, 1, room, ptr::null_mut()),
            dtof_counts_write([0; DTOF_BINS].as_ptr(), 0, 0, 0, 0, room, ptr::null_mut()),
        ];
        assert_eq!(refused, [DTOF_ERROR_NULL; 17]);
        // The encoder has not yet counted a time word as sent.
        assert_eq!(dtof_aer_encode(&mut encoder, &event, room, &mut length), OK);
        assert_eq!(length, 32);
        // Longer than memory.
        assert_eq!(
            dtof_link_receive(&mut link, room, usize::MAX, 0, &mut 0),
            DTOF_ERROR_LENGTH
        );
        assert_eq!(dtof_crc32(&mut 0, room, usize::MAX), DTOF_ERROR_LENGTH);
        assert_eq!(
            dtof_device_config_read(room, usize::MAX, 0, &mut zeroed()),
            DTOF_ERROR_LENGTH
        );
    }
}

#[test]
fn version_and_bins_are_those_of_the_build() {
    // SAFETY: the pointer leads to a text of the library.
    let version = unsafe { CStr::from_ptr(dtof_version()) };
    assert_eq!(version.to_str(), Ok(env!("CARGO_PKG_VERSION")));
    assert_eq!(usize::from(dtof_bins()), DTOF_BINS);
}

proptest! {
    /// A program may have overwritten all but the tags, or all bytes from one on.
    #[test]
    fn any_bytes_are_a_pixel_a_scale_and_statistics(
        mut bytes in prop::collection::vec(any::<u8>(), DTOF_PIXEL_SIZE - 4),
        ones in any::<bool>(),
        dead_time in prop_oneof![Just(0u16), Just(20), Just(u16::MAX)],
        code in any::<u16>(),
        cycles in any::<u16>(),
        exposure in prop_oneof![any::<u32>(), 1..4000_u32],
        last in any::<u64>(),
        from in prop_oneof![Just(4), 4..DTOF_PIXEL_SIZE],
        (rule, tracking) in prop::sample::select(vec![
            (DTOF_RULE_PAPER, 0), (DTOF_RULE_AVERAGE, 0), (DTOF_RULE_WINDOW, 0), (DTOF_RULE_WINDOW, 1),
        ]),
        echoes in 1..3_u8,
    ) {
        if ones {
            bytes.fill(0xff);
        }
        let mut memories = [
            Memory::with(pixel(0)),
            Memory::with(scale()),
            Memory::with(statistics()),
        ];
        for memory in &mut memories {
            memory.0[from..4 + bytes.len()].write_copy_of_slice(&bytes[from - 4..]);
        }
        let [mut pixel, mut scale, mut read] = memories;
        let dead_time = if rule == DTOF_RULE_WINDOW { dead_time } else { 0 };
        let settings = dtof_config_t { rule, dead_time, tracking, echoes, ..paper() };
        let (config, mut done) = (checked(&settings).unwrap(), statistics());
        let mut events = [dtof_event_t::default(); DTOF_ECHOES];
        let mut body = [0; DTOF_BODY_BYTES];
        // SAFETY: all memory is long enough and aligned for each type.
        unsafe {
            let _ = dtof_pixel_count(pixel.at(), &config, code);
            let _ = dtof_pixel_count_frame(pixel.at(), &config, [code; DTOF_BINS].as_ptr());
            let _ = dtof_pixel_end_laser_cycles(
                pixel.at(), &config, last, &mut done, cycles, ptr::null_mut(),
            );
            let _ = dtof_pixel_take_event(pixel.at(), &mut events[0]);
            let _ = dtof_pixel_add_photons(pixel.at(), &mut done);
            let room = body.as_mut_ptr();
            let _ = dtof_pixel_histogram_write(pixel.at(), 0, last, room, &mut 0);
            let first = events.as_mut_ptr();
            let counts = [u32::from(code); DTOF_BINS];
            let _ = dtof_histogram_decide(
                &config, counts.as_ptr(), 0, last, exposure, &mut done, first, &mut 0,
            );
            let _ = dtof_range(scale.at(), 0, &mut 0);
            let _ = dtof_statistics_read(read.at(), &mut zeroed());
        }
    }
}
