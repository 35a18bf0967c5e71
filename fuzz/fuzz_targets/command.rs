#![no_main]

// The environment variable `ABVH_PROGRAM` contains the path of the program to test.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| integration::fuzz::COMMAND.load_bytes(bytes));
