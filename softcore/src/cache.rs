//! Filling and emptying a processor's caches, if it has any.

use core::arch::{asm, global_asm};

/// Bytes of a line, or a fraction of one: so far apart words are read.
const LINE: usize = 32;
/// Lines that are read and run through: twice the largest cache of these processors.
const LINES: usize = 256;

// One jump a line.
global_asm!(
    ".section .text.cache_sled, \"ax\"",
    ".option push",
    ".option norelax",
    ".balign {line}",
    "cache_sled:",
    ".rept {lines}",
    "    j 1f",
    "    .balign {line}",
    "1:",
    ".endr",
    "    ret",
    ".option pop",
    line = const LINE,
    lines = const LINES,
);

unsafe extern "C" {
    safe fn cache_sled();
}

/// Puts other code and other data into every line.
#[inline(never)]
pub fn evict() {
    let sled = (cache_sled as extern "C" fn()) as *const u32;
    read_lines(sled, LINES);
    cache_sled();
}

/// Puts a value into the data cache, as far as it has room.
#[inline(never)]
pub fn read<T>(value: &T) {
    read_lines((&raw const *value).cast(), size_of::<T>().div_ceil(LINE));
}

fn read_lines(mut from: *const u32, lines: usize) {
    for _ in 0..lines {
        // SAFETY: reads a word of memory of the image's, whatever it holds.
        unsafe {
            asm!("lw {word}, 0({from})", word = out(reg) _, from = in(reg) from,
                options(nostack, readonly));
        }
        from = from.wrapping_byte_add(LINE);
    }
}
