//! Every error has its own status.

use core::ptr::{null, null_mut};
use std::collections::BTreeSet;
use std::ffi::CStr;

use dtof_c::dtof_status_t::*;
use dtof_c::*;
use dtof_link::Refusal;

use crate::{OK, checked, config, link, paper, pixel, scale, statistics, zeroed};

#[test]
fn each_setting_that_cannot_be_has_its_own_error() {
    type Change = fn(&mut dtof_config_t);
    let window: Change = |config| config.rule = DTOF_RULE_WINDOW;
    let centred: Change = |config| config.estimator = DTOF_ESTIMATOR_CENTRED_WINDOW;
    let none: Change = |_| {};
    let wrong: [(Change, Change, dtof_status_t); 22] = [
        (none, |config| config.rule = 3, DTOF_ERROR_RULE),
        (none, |config| config.estimator = 2, DTOF_ERROR_ESTIMATOR),
        (none, |config| config.x = 0, DTOF_ERROR_ZERO_X),
        (none, |config| config.x = 41, DTOF_ERROR_X_ABOVE_L1),
        (none, |config| config.l2 = 40, DTOF_ERROR_L2_NOT_ABOVE_L1),
        (none, |config| config.l2 = 44, DTOF_ERROR_NO_LOOK),
        (
            none,
            |config| config.gate_last = 128,
            DTOF_ERROR_GATE_PAST_LAST_BIN,
        ),
        (
            none,
            |config| config.gate_first = 121,
            DTOF_ERROR_GATE_TOO_NARROW,
        ),
        (
            none,
            |config| config.minimum_count = 0,
            DTOF_ERROR_MINIMUM_COUNT,
        ),
        (
            none,
            |config| config.minimum_count = 1 << 24,
            DTOF_ERROR_MINIMUM_COUNT,
        ),
        (window, |config| config.window = 0, DTOF_ERROR_WINDOW_WIDTH),
        (window, |config| config.window = 8, DTOF_ERROR_WINDOW_WIDTH),
        (
            centred,
            |config| config.before_q8 = 255,
            DTOF_ERROR_HALF_WIDTH,
        ),
        (
            centred,
            |config| config.before_q8 = 1025,
            DTOF_ERROR_HALF_WIDTH,
        ),
        (
            centred,
            |config| config.after_q8 = 255,
            DTOF_ERROR_HALF_WIDTH,
        ),
        (
            centred,
            |config| config.after_q8 = 1025,
            DTOF_ERROR_HALF_WIDTH,
        ),
        (none, |config| config.tracking = 1, DTOF_ERROR_TRACKING),
        (none, |config| config.echoes = 0, DTOF_ERROR_ECHOES),
        (none, |config| config.echoes = 5, DTOF_ERROR_ECHOES),
        (none, |config| config.dead_time = 1, DTOF_ERROR_DEAD_TIME),
        (none, |config| config.dead_time = 127, DTOF_ERROR_DEAD_TIME),
        (
            |config| config.rule = DTOF_RULE_AVERAGE,
            |config| config.dead_time = 20,
            DTOF_ERROR_DEAD_TIME,
        ),
    ];
    for (before, change, error) in wrong {
        let mut config = paper();
        before(&mut config);
        assert!(checked(&config).is_ok());
        change(&mut config);
        assert_eq!(checked(&config).err(), Some(error));
    }
    // These have an effect.
    for dead_time in [128, u16::MAX] {
        let config = dtof_config_t {
            dead_time,
            ..paper()
        };
        assert!(checked(&config).is_ok());
    }
    for dead_time in [1, 127, 128, u16::MAX] {
        let rule = DTOF_RULE_WINDOW;
        let config = dtof_config_t {
            rule,
            dead_time,
            ..paper()
        };
        assert!(checked(&config).is_ok());
    }
}

#[test]
fn pointers_and_numbers_are_checked() {
    let (config, mut pixel, mut statistics) = (config(), pixel(0), statistics());
    let mut link = link();
    let mut event = dtof_event_t::default();
    let (counts, wide, bytes) = ([0u16; 128], [0u32; 128], [0u8; 256]);
    let mut length = 0usize;
    let size = DTOF_PIXEL_SIZE;
    /// One byte further.
    fn off<T>(pointer: *mut T) -> *mut T {
        pointer.wrapping_byte_add(1)
    }
    // SAFETY: each pointer leads to an object of its type, is null, or is misaligned.
    unsafe {
        assert_eq!(dtof_pixel_init(null_mut(), size, 0), DTOF_ERROR_NULL);
        assert_eq!(
            dtof_pixel_init(off(&mut pixel), size, 0),
            DTOF_ERROR_ALIGNMENT
        );
        assert_eq!(dtof_pixel_init(&mut pixel, size - 8, 0), DTOF_ERROR_SIZE);
        assert_eq!(dtof_pixel_init(&mut pixel, size, 0), OK);
        assert_eq!(dtof_pixel_count(null_mut(), &config, 1), DTOF_ERROR_NULL);
        assert_eq!(dtof_pixel_count(&mut pixel, null(), 1), DTOF_ERROR_NULL);
        assert_eq!(
            dtof_pixel_count(off(&mut pixel), &config, 1),
            DTOF_ERROR_ALIGNMENT
        );
        let codes = counts.as_ptr();
        let batch =
            |codes, number| dtof_pixel_count_batch(&mut crate::pixel(0), &config, codes, number);
        assert_eq!(batch(null(), 1), DTOF_ERROR_NULL);
        assert_eq!(batch(null(), 0), OK);
        assert_eq!(batch(codes.wrapping_byte_add(1), 1), DTOF_ERROR_ALIGNMENT);
        assert_eq!(batch(codes, usize::MAX / 2), DTOF_ERROR_LENGTH);
        assert_eq!(
            dtof_pixel_count_frame(&mut pixel, &config, null()),
            DTOF_ERROR_NULL
        );
        let end = |statistics, look| {
            dtof_pixel_end_laser_cycles(&mut crate::pixel(0), &config, 0, statistics, 1, look)
        };
        assert_eq!(end(null_mut(), null_mut()), DTOF_ERROR_NULL);
        assert_eq!(end(&mut statistics, null_mut()), OK);
        assert_eq!(
            dtof_pixel_take_event(&mut pixel, null_mut()),
            DTOF_ERROR_NULL
        );
        assert_eq!(
            dtof_pixel_take_event(&mut pixel, &mut event),
            DTOF_ERROR_NO_EVENT
        );
        assert_eq!(dtof_pixel_add_photons(&pixel, null_mut()), DTOF_ERROR_NULL);
        assert_eq!(
            dtof_statistics_read(&statistics, null_mut()),
            DTOF_ERROR_NULL
        );

        let mut events = [dtof_event_t::default(); DTOF_ECHOES];
        let decide = |counts, events, found| {
            let statistics = &mut crate::statistics();
            dtof_histogram_decide(&config, counts, 0, 0, 1, statistics, events, found)
        };
        let (first, mut found) = (events.as_mut_ptr(), 0);
        assert_eq!(decide(null(), first, &mut found), DTOF_ERROR_NULL);
        assert_eq!(
            decide(wide.as_ptr().wrapping_byte_add(1), first, &mut found),
            DTOF_ERROR_ALIGNMENT
        );
        assert_eq!(
            decide(wide.as_ptr(), null_mut(), &mut found),
            DTOF_ERROR_NULL
        );
        assert_eq!(decide(wide.as_ptr(), first, null_mut()), DTOF_ERROR_NULL);
        assert_eq!(decide(wide.as_ptr(), first, &mut found), OK);

        let scale = scale();
        assert_eq!(dtof_range(&scale, 262_400, &mut 0), DTOF_ERROR_POSITION);
        assert_eq!(dtof_range(&scale, 0, null_mut()), DTOF_ERROR_NULL);

        let word = bytes.as_ptr();
        assert_eq!(dtof_link_init(&mut link, 8, 1), DTOF_ERROR_SIZE);
        assert_eq!(dtof_link_init(&mut link, DTOF_LINK_SIZE, 1), OK);
        let sent = dtof_link_transmit(&mut link, 0, null_mut(), &mut length);
        assert_eq!(sent, DTOF_ERROR_NULL);
        // Kinds from a host, and unused kinds.
        for kind in [0, DTOF_MESSAGE_CONFIGURE, 0x7f, 0xf0, 0xff] {
            let offer = dtof_link_offer(&mut link, kind, null(), 0);
            assert_eq!(offer, DTOF_ERROR_MESSAGE_KIND);
        }
        for reason in [DTOF_STOP_NONE, DTOF_STOP_PORT_FAILED + 1, u8::MAX] {
            let status = dtof_link_set_stop_reason(&mut link, reason);
            assert_eq!(status, DTOF_ERROR_REASON);
        }
        let offer = dtof_link_offer(&mut link, DTOF_MESSAGE_EVENTS, word, 245);
        assert_eq!(offer, DTOF_ERROR_MESSAGE_LENGTH);
        assert_eq!(dtof_aer_end(0, 0, null_mut()), DTOF_ERROR_NULL);
        assert_eq!(dtof_crc32(null_mut(), word, 1), DTOF_ERROR_NULL);
    }
}

#[test]
fn a_scale_that_cannot_be_is_refused() {
    let mut scale = zeroed();
    // SAFETY: the pointer leads to a scale.
    let mut init = |width, offset| unsafe { dtof_scale_init(&mut scale, width, offset) };
    assert_eq!(init(0, 0), DTOF_ERROR_ZERO_BIN_WIDTH);
    assert_eq!(init(u32::MAX, 0), DTOF_ERROR_RANGE);
    assert_eq!(init(250 << 16, i32::MIN), DTOF_ERROR_RANGE);
    assert_eq!(init(250 << 16, 0), OK);
}

#[test]
fn every_status_has_a_text_of_its_own() {
    let header = include_str!("../../include/dtof.h");
    let (_, of_enum) = header.split_once("enum dtof_status_t").unwrap();
    let (of_enum, _) = of_enum.split_once("};").unwrap();
    let numbers = of_enum.lines().filter_map(|line| line.split_once(" = "));
    let numbers = numbers.map(|(_, number)| number.trim_end_matches(',').parse::<u8>().unwrap());
    let numbers: BTreeSet<u8> = numbers.collect();
    assert_eq!(numbers.len(), 47);
    let mut texts = BTreeSet::new();
    for number in 0..=u8::MAX {
        // SAFETY: each pointer leads to a text of the library.
        let text = unsafe { CStr::from_ptr(dtof_status_text(number)) };
        assert_eq!(
            text == c"unknown status",
            !numbers.contains(&number),
            "{number}"
        );
        texts.insert(text);
    }
    assert_eq!(texts.len(), numbers.len() + 1);
}

#[test]
fn every_reason_of_the_link_has_a_status_and_comes_back() {
    for number in 1..=u8::MAX {
        let Some(refusal) = Refusal::from_number(number) else {
            assert!(number > 23);
            break;
        };
        let status = dtof_status_t::from(refusal);
        assert_eq!(dtof_refusal_of(status as u8), number);
    }
    assert_eq!(dtof_refusal_of(DTOF_ERROR_ZERO_BIN_WIDTH as u8), 8);
    assert_eq!(dtof_refusal_of(DTOF_ERROR_RULE as u8), 1);
}
