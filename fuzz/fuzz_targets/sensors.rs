#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| dtof_fuzz::sensors(data));
