#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| wheeleg_fuzz_targets::tables::run(data));
