#![no_main]

libfuzzer_sys::fuzz_target!(init: roomsight_fuzz::start_service(), |bytes: &[u8]| roomsight_fuzz::service(bytes));
