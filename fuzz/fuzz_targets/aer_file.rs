//! The target `aer_file`: see `dtof_fuzz::aer_file`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::aer_file(data));
