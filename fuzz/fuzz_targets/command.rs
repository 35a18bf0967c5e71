#![no_main]

// ABVH_PROGRAM names the program.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| integration::fuzz::COMMAND.load_bytes(bytes));
