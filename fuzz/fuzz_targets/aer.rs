//! The target `aer`: see `dtof_fuzz::aer`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::aer(data));
