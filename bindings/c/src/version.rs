//! The version of the library, and its number of bins.

use core::ffi::c_char;

/// Bins of every histogram: 128, or the environment variable `DTOF_BINS` at build time. A power
/// of two from 8 to 256: messages with histograms have no room for more.
pub const DTOF_BINS: usize = match option_env!("DTOF_BINS") {
    Some(text) => number(text.as_bytes()),
    None => 128,
};

/// Reads a decimal number. Other text gives 0, which the assertion below refuses.
const fn number(mut digits: &[u8]) -> usize {
    let mut number = 0usize;
    while let [digit, rest @ ..] = digits {
        if !digit.is_ascii_digit() {
            return 0;
        }
        number = number
            .saturating_mul(10)
            .saturating_add((*digit - b'0') as usize);
        digits = rest;
    }
    number
}

const _: () = assert!(
    DTOF_BINS.is_power_of_two() && 8 <= DTOF_BINS && DTOF_BINS <= 256,
    "DTOF_BINS must be a power of two from 8 to 256"
);

/// The version of the library as `major.minor.patch`.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn dtof_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// The number of bins the library was built for. It must equal the DTOF_BINS of this header.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn dtof_bins() -> u16 {
    #[allow(clippy::cast_possible_truncation, reason = "at most 256")]
    {
        DTOF_BINS as u16
    }
}
