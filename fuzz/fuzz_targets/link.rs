//! The target `link`: see `dtof_fuzz::link`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::link(data));
