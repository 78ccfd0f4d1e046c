//! The target `sidecar`: see `dtof_fuzz::sidecar`.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::sidecar(data));
