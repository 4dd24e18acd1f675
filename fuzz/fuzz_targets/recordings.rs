#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| roomsight_fuzz::recordings(bytes));
