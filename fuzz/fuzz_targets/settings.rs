//! The target `settings`: see `dtof_fuzz::settings`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::settings(data));
