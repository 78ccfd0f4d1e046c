//! The target `sensors`: see `dtof_fuzz::sensors`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::sensors(data));
