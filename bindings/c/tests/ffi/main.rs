//! Calls the functions as C does: every error, and the same results as `dtof-core` and `dtof-link`.

#![allow(unsafe_code, reason = "C functions")]

mod array;
mod link;
mod memory;
mod mistakes;
mod pixels;
mod refusals;
mod report;
mod words;

use core::mem::MaybeUninit;
use core::ptr;

use dtof_c::*;

/// A static of a C program before anything has initialised it.
fn zeroed<T>() -> T {
    // SAFETY: only for types of the header, for which any bytes are valid.
    unsafe { MaybeUninit::zeroed().assume_init() }
}

/// The paper's settings.
fn paper() -> dtof_config_t {
    let mut config = dtof_config_t::default();
    // SAFETY: the pointer leads to a configuration.
    assert_eq!(unsafe { dtof_config_paper(&mut config) }, OK);
    config
}

/// An object that its function has initialised.
fn initialised<T>(initialise: impl FnOnce(*mut T) -> dtof_status_t) -> T {
    let mut object = zeroed();
    assert_eq!(initialise(&mut object), OK);
    object
}

fn config() -> dtof_checked_config_t {
    checked(&paper()).unwrap()
}

fn pixel(address: u16) -> dtof_pixel_t {
    // SAFETY: the pointer leads to a pixel.
    initialised(|pixel| unsafe { dtof_pixel_init(pixel, size_of::<dtof_pixel_t>(), address) })
}

/// An array with room for no pixel.
fn array() -> dtof_array_t {
    let (none, no_block) = (ptr::null_mut(), ptr::null_mut());
    // SAFETY: the pointer leads to an array.
    initialised(|array| unsafe { dtof_array_init(array, DTOF_PLACE_SIZE, none, 0, no_block, 0) })
}

fn statistics() -> dtof_statistics_t {
    // SAFETY: the pointer leads to statistics.
    initialised(|statistics| unsafe { dtof_statistics_init(statistics) })
}

/// Bins of 250 ps.
fn scale() -> dtof_scale_t {
    // SAFETY: the pointer leads to a scale.
    initialised(|scale| unsafe { dtof_scale_init(scale, 250 << 16, 0) })
}

fn encoder() -> dtof_aer_encoder_t {
    // SAFETY: the pointer leads to an encoder.
    initialised(|encoder| unsafe { dtof_aer_encoder_init(encoder) })
}

fn decoder() -> dtof_aer_decoder_t {
    // SAFETY: the pointer leads to a decoder.
    initialised(|decoder| unsafe { dtof_aer_decoder_init(decoder) })
}

/// The link of a device with 64 pixels.
fn link() -> dtof_link_t {
    // SAFETY: the pointer leads to a link.
    initialised(|link| unsafe { dtof_link_init(link, size_of::<dtof_link_t>(), 64) })
}

const OK: dtof_status_t = dtof_status_t::DTOF_OK;

/// The configuration of settings.
fn checked(settings: &dtof_config_t) -> Result<dtof_checked_config_t, dtof_status_t> {
    let mut checked = zeroed();
    // SAFETY: both pointers lead to objects of their types.
    match unsafe { dtof_config_check(settings, &mut checked) } {
        OK => Ok(checked),
        error => Err(error),
    }
}
