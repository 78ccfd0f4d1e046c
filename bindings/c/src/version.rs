//! The version of the library, its number of bins and the width of its counters.

use core::ffi::c_char;

use dtof_core::{Count8, Count10, CounterWidth};

/// Bins of every histogram: 128, or the environment variable `DTOF_BINS` at build time. A power
/// of two from 8 to 256: messages with histograms have no room for more.
pub const DTOF_BINS: usize = match option_env!("DTOF_BINS") {
    Some(text) => number(text.as_bytes()),
    None => 128,
};

/// Bits of a pixel's counters: 10, or the environment variable `DTOF_COUNTER_BITS` at build time, which
/// may be 8.
pub const DTOF_COUNTER_BITS: usize = match option_env!("DTOF_COUNTER_BITS") {
    None => 10,
    Some(text) => match number(text.as_bytes()) {
        8 => 8,
        10 => 10,
        _ => panic!("DTOF_COUNTER_BITS must be 8 or 10"),
    },
};

/// The counters of so many bits.
pub(crate) trait Counters {
    type Width: CounterWidth;
}

/// So many bits.
pub(crate) struct Bits<const BITS: usize>;

impl Counters for Bits<8> {
    type Width = Count8;
}

impl Counters for Bits<10> {
    type Width = Count10;
}

/// Those of a pixel.
pub(crate) type PixelCounters = <Bits<DTOF_COUNTER_BITS> as Counters>::Width;

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

/// The bits of a pixel's counters that the library was built for. They must equal the
/// DTOF_COUNTER_BITS of this header.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn dtof_counter_bits() -> u8 {
    #[allow(clippy::cast_possible_truncation, reason = "8 or 10")]
    {
        DTOF_COUNTER_BITS as u8
    }
}
