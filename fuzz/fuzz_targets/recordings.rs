//! The target `recordings`: see `dtof_fuzz::recordings`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::recordings(data));
