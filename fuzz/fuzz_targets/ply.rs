#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| integration::fuzz::PLY.load_bytes(bytes));
