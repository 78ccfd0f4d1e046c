//! The functions as C calls them: every refusal, and the same results as `dtof-core` and
//! `dtof-link`.

#![allow(unsafe_code, reason = "they are called as C calls them")]

mod link;
mod memory;
mod pixels;
mod refusals;
mod words;

use core::mem::MaybeUninit;

use dtof_c::*;

/// Memory as a C program has it: all zero.
fn zeroed<T>() -> T {
    // SAFETY: only for types of the header, which any bytes are a value of.
    unsafe { MaybeUninit::zeroed().assume_init() }
}

/// The paper's settings.
fn paper() -> dtof_config_t {
    let mut config = dtof_config_t::default();
    // SAFETY: the pointer leads to a configuration.
    assert_eq!(unsafe { dtof_config_paper(&mut config) }, OK);
    config
}

const OK: dtof_status_t = dtof_status_t::DTOF_OK;

/// The configuration of settings.
fn checked(settings: &dtof_config_t) -> Result<dtof_checked_config_t, dtof_status_t> {
    let mut checked = zeroed();
    // SAFETY: both pointers lead to what they should.
    match unsafe { dtof_config_check(settings, &mut checked) } {
        OK => Ok(checked),
        error => Err(error),
    }
}
