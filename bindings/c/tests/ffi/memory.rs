//! Memory as C has it: never written to, full of anything, of another kind, or not where it should
//! be. Miri runs these, and finds what reads or keeps what it must not.

use core::mem::MaybeUninit;
use core::ptr;
use std::ffi::CStr;

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use proptest::prelude::*;

use crate::{OK, checked, paper, zeroed};

/// Memory that nobody has written to.
struct Room<T>(MaybeUninit<T>);

impl<T> Room<T> {
    const fn new() -> Self {
        Self(MaybeUninit::uninit())
    }

    const fn at(&mut self) -> *mut T {
        self.0.as_mut_ptr()
    }

    /// The value, once there is one.
    const fn read(self) -> T {
        // SAFETY: the tests ask once a function has written it.
        unsafe { self.0.assume_init() }
    }
}

#[test]
fn what_a_function_writes_may_be_written_by_nobody_before() {
    let config = checked(&paper()).unwrap();
    let (mut settings, mut pixel, mut histogram) = (Room::new(), Room::new(), Room::new());
    let (mut scale, mut range, mut link) = (Room::new(), Room::new(), Room::new());
    let (mut encoder, mut decoder, mut record) = (Room::new(), Room::new(), Room::new());
    let (mut length, mut state, mut counts) = (Room::new(), Room::new(), Room::new());
    let mut silent = Room::new();
    let mut wire = Room::<[u8; DTOF_WIRE_BYTES]>::new();
    let mut body = Room::<[u8; DTOF_BODY_BYTES]>::new();
    let mut events = Room::<[dtof_event_t; DTOF_ECHOES]>::new();
    let (mut look, mut fired, mut session) = (Room::new(), Room::new(), Room::new());
    let mut sensor = Room::<[u8; DTOF_SENSOR_BYTES]>::new();
    let mut report = Room::<[u8; DTOF_REPORT_BYTES]>::new();
    let mut done = zeroed();
    let photons = [60u16; 20];
    let wide = [7u32; DTOF_BINS];
    // SAFETY: each pointer leads to room for its type, or to what it should.
    unsafe {
        assert_eq!(dtof_config_paper(settings.at()), OK);
        assert_eq!(dtof_config_check(settings.at(), &mut zeroed()), OK);
        assert_eq!(dtof_scale_init(scale.at(), 250 << 16, 0), OK);
        assert_eq!(dtof_range(scale.at(), 256, range.at()), OK);
        assert_eq!(range.read(), 9593);

        assert_eq!(dtof_pixel_init(pixel.at(), DTOF_PIXEL_SIZE, 5), OK);
        let (first, number) = (photons.as_ptr(), photons.len());
        assert_eq!(
            dtof_pixel_count_batch(pixel.at(), &config, first, number),
            OK
        );
        let (one, last) = (pixel.at(), 44);
        let ended = dtof_pixel_end_laser_cycles(one, &config, 40, &mut done, 40, look.at());
        assert_eq!((ended, look.read()), (OK, dtof_look_t::DTOF_LOOK_TOO_EARLY));
        let ended = dtof_pixels_end_laser_cycles(one, 1, last, &config, &mut done, 4, fired.at());
        assert_eq!((ended, fired.read()), (OK, 1));
        let mut event = Room::new();
        assert_eq!(dtof_pixel_take_event(one, event.at()), OK);
        assert_eq!(dtof_pixel_add_photons(one, &mut done), OK);
        assert_eq!(dtof_statistics_read(&done, counts.at()), OK);
        assert_eq!(counts.read().events, 1);

        let size = DTOF_HISTOGRAM_SIZE;
        let filled = dtof_histogram_fill(histogram.at(), size, &config, &mut done, wide.as_ptr());
        assert_eq!(filled, OK);
        let room = events.at().cast::<dtof_event_t>();
        let found = length.at();
        let at = histogram.at();
        let decided = dtof_histogram_detect(at, &config, 0, &mut done, 0, 1, room, found);
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
        assert_eq!(dtof_sensor_write(1, 0, 0, 0, 0, room), OK);
        assert_eq!(sensor.read()[..2], [1, 0]);
        let room = report.at();
        let of = dtof_report_t::default();
        assert_eq!(dtof_report_write(&of, &done, at, room.cast()), OK);
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

/// Memory that is long enough for every object, and aligned for each. An object has padding, which
/// nobody may read.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct Memory([MaybeUninit<u8>; DTOF_LINK_SIZE]);

impl Memory {
    const fn of(byte: u8) -> Self {
        Self([MaybeUninit::new(byte); DTOF_LINK_SIZE])
    }

    const fn at<T>(&mut self) -> *mut T {
        assert!(size_of::<T>() <= DTOF_LINK_SIZE);
        ptr::from_mut(self).cast()
    }
}

#[test]
fn no_object_is_taken_for_another() {
    let mut objects = [Memory::of(0); 6];
    let [config, link, encoder, decoder, _, erased] = &mut objects;
    *erased = Memory::of(0xff);
    // SAFETY: all memory is long enough and aligned for each type.
    unsafe {
        assert_eq!(dtof_config_check(&paper(), config.at()), OK);
        assert_eq!(dtof_link_init(link.at(), DTOF_LINK_SIZE, 1), OK);
        assert_eq!(dtof_aer_encoder_init(encoder.at()), OK);
        assert_eq!(dtof_aer_decoder_init(decoder.at()), OK);
    }
    let mut accepted = [0; 6];
    for (object, accepted) in objects.iter_mut().zip(&mut accepted) {
        let (mut pixel, event, mut done) = (zeroed(), dtof_event_t::default(), zeroed());
        let (mut wire, mut length) = ([0u8; DTOF_WIRE_BYTES], 0);
        let (room, mut record, mut message) = (wire.as_mut_ptr(), zeroed(), zeroed());
        // SAFETY: all memory is long enough and aligned for each type.
        let statuses = unsafe {
            let codes = [0u16; DTOF_BINS];
            let counts = [0u32; DTOF_BINS];
            let mut histogram = zeroed();
            let size = DTOF_HISTOGRAM_SIZE;
            let mut events = [event; DTOF_ECHOES];
            [
                dtof_pixel_count(&mut pixel, object.at(), 0),
                dtof_pixel_count_batch(&mut pixel, object.at(), codes.as_ptr(), 1),
                dtof_pixel_count_frame(&mut pixel, object.at(), codes.as_ptr()),
                dtof_pixel_end_laser_cycles(
                    &mut pixel,
                    object.at(),
                    0,
                    &mut done,
                    1,
                    ptr::null_mut(),
                ),
                dtof_pixels_end_laser_cycles(
                    &mut pixel,
                    1,
                    0,
                    object.at(),
                    &mut done,
                    1,
                    ptr::null_mut(),
                ),
                dtof_histogram_fill(
                    &mut histogram,
                    size,
                    object.at(),
                    &mut done,
                    counts.as_ptr(),
                ),
                dtof_histogram_detect(
                    &mut histogram,
                    object.at(),
                    0,
                    &mut done,
                    0,
                    1,
                    events.as_mut_ptr(),
                    &mut length,
                ),
                dtof_aer_encode(object.at(), &event, room, &mut length),
                dtof_aer_decode(object.at(), room, &mut record),
                dtof_link_receive(object.at(), room, 0, 0, &mut 0),
                dtof_link_transmit(object.at(), 0, room, &mut length),
                dtof_link_peek(object.at(), &mut 0),
                dtof_link_take(object.at(), &mut message),
                dtof_link_offer(object.at(), DTOF_MESSAGE_EVENTS, room, 0),
                dtof_link_state(object.at(), &mut zeroed()),
                dtof_link_silent_ms(object.at(), 0, &mut 0),
                dtof_link_set_stop_reason(object.at(), DTOF_STOP_RESET),
                dtof_report_write(&zeroed(), &done, object.at(), room),
            ]
        };
        *accepted = statuses
            .iter()
            .filter(|&&status| status != DTOF_ERROR_NOT_INITIALISED)
            .count();
    }
    // Those of its own.
    assert_eq!(accepted, [7, 9, 1, 1, 0, 0]);
}

/// A link in this memory.
fn link_at(memory: &mut dtof_link_t) -> *const dtof_link_t {
    // SAFETY: the pointer leads to a link.
    assert_eq!(unsafe { dtof_link_init(memory, DTOF_LINK_SIZE, 1) }, OK);
    memory
}

/// A function is handed a pointer to what it should have.
type Call = fn(*mut u8) -> dtof_status_t;

/// Each pointer of each function, with the alignment of what lies there.
#[rustfmt::skip]
const POINTERS: [(usize, Call); 31] = {
    // SAFETY: the tests hand over null, what is misaligned, and nothing else.
    unsafe {[
        (4, |p| dtof_config_paper(p.cast())),
        (4, |p| dtof_config_for_pulse(p.cast(), 256)),
        (4, |p| dtof_config_false_alarms(p.cast(), 100)),
        (4, |p| dtof_config_check(p.cast(), &mut zeroed())),
        (4, |p| dtof_config_check(&paper(), p.cast())),
        (4, |p| dtof_scale_init(p.cast(), 250 << 16, 0)),
        (4, |p| dtof_range(p.cast(), 0, &mut 0)),
        (4, |p| dtof_range(&zeroed(), 0, p.cast())),
        (8, |p| dtof_pixel_init(p.cast(), DTOF_PIXEL_SIZE, 0)),
        (8, |p| dtof_pixel_take_event(p.cast(), &mut zeroed())),
        (8, |p| dtof_pixel_take_event(&mut zeroed(), p.cast())),
        (8, |p| dtof_pixel_add_photons(p.cast(), &mut zeroed())),
        (8, |p| dtof_pixel_add_photons(&zeroed(), p.cast())),
        (8, |p| dtof_statistics_read(p.cast(), &mut zeroed())),
        (8, |p| dtof_statistics_read(&zeroed(), p.cast())),
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
        (4, |p| dtof_link_silent_ms(link_at(&mut zeroed()), 0, p.cast())),
        (8, |p| dtof_link_set_stop_reason(p.cast(), DTOF_STOP_RESET)),
        (8, |p| dtof_pixel_histogram_write(p.cast(), 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
        (4, |p| dtof_counts_write(p.cast(), 0, 0, 0, 0, [0; 244].as_mut_ptr(), &mut 0)),
        (8, |p| dtof_report_write(p.cast(), &zeroed(), &zeroed(), [0; 256].as_mut_ptr())),
    ]}
};

#[test]
fn each_pointer_is_refused_where_its_type_cannot_lie() {
    let mut memory = Memory::of(0);
    for (number, (alignment, call)) in POINTERS.into_iter().enumerate() {
        assert_eq!(call(ptr::null_mut()), DTOF_ERROR_NULL, "{number}");
        for off in (1..8).filter(|off| off % alignment != 0) {
            let pointer = memory.at::<u8>().wrapping_add(off);
            assert_eq!(call(pointer), DTOF_ERROR_ALIGNMENT, "{number} at {off}");
        }
    }
    // SAFETY: they were written when it was made.
    let bytes = memory.0.map(|byte| unsafe { byte.assume_init() });
    assert_eq!(bytes, [0; DTOF_LINK_SIZE]);
}

#[test]
fn bytes_that_do_not_lie_anywhere_are_refused() {
    let mut bytes = [0u8; 256];
    let room = bytes.as_mut_ptr();
    let none = ptr::null_mut();
    let mut length = 0;
    let (mut encoder, mut decoder, mut link) = (zeroed(), zeroed(), zeroed());
    // SAFETY: each pointer leads to what it should, or is null.
    unsafe {
        assert_eq!(dtof_aer_encoder_init(&mut encoder), OK);
        assert_eq!(dtof_aer_decoder_init(&mut decoder), OK);
        assert_eq!(dtof_link_init(&mut link, DTOF_LINK_SIZE, 1), OK);
        let event = dtof_event_t {
            echo: 1,
            ..dtof_event_t::default()
        };
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
            dtof_sensor_write(1, 0, 0, 0, 0, none),
            dtof_report_write(&zeroed(), &zeroed(), &link, none),
            dtof_device_config_read(none, 1, &mut zeroed()),
            dtof_no_histogram_write(0, 1, none, &mut length),
            dtof_no_histogram_write(0, 1, room, ptr::null_mut()),
            dtof_counts_write([0; DTOF_BINS].as_ptr(), 0, 0, 0, 0, room, ptr::null_mut()),
        ];
        assert_eq!(refused, [DTOF_ERROR_NULL; 17]);
        // The encoder has sent no time.
        assert_eq!(dtof_aer_encode(&mut encoder, &event, room, &mut length), OK);
        assert_eq!(length, 32);
        // Longer than memory.
        assert_eq!(
            dtof_link_receive(&mut link, room, usize::MAX, 0, &mut 0),
            DTOF_ERROR_LENGTH
        );
        assert_eq!(dtof_crc32(&mut 0, room, usize::MAX), DTOF_ERROR_LENGTH);
        assert_eq!(
            dtof_device_config_read(room, usize::MAX, &mut zeroed()),
            DTOF_ERROR_LENGTH
        );
    }
}

#[test]
fn the_library_says_what_it_is() {
    // SAFETY: a text of the library.
    let version = unsafe { CStr::from_ptr(dtof_version()) };
    assert_eq!(version.to_str(), Ok(env!("CARGO_PKG_VERSION")));
    assert_eq!(usize::from(dtof_bins()), DTOF_BINS);
}

proptest! {
    /// They have no tag: a program may have forgotten to make them, or written over them.
    #[test]
    fn any_bytes_are_a_pixel_a_histogram_a_scale_and_statistics(
        bytes in prop::collection::vec(any::<u8>(), DTOF_HISTOGRAM_SIZE),
        ones in any::<bool>(),
        code in any::<u16>(),
        cycles in any::<u16>(),
        last in any::<u64>(),
    ) {
        let config = checked(&paper()).unwrap();
        let mut memory = Memory::of(0xff);
        if !ones {
            memory.0[..bytes.len()].write_copy_of_slice(&bytes);
        }
        let [mut pixel, mut histogram, mut scale] = [memory; 3];
        // Of counts that no program reaches.
        let mut done = zeroed();
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
            let _ = dtof_histogram_detect(
                histogram.at(), &config, last, &mut done, 0, cycles, first, &mut 0,
            );
            let _ = dtof_range(scale.at(), 0, &mut 0);
            let _ = dtof_statistics_read(memory.at(), &mut zeroed());
        }
    }
}
