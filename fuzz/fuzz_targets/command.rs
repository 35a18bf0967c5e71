#![no_main]

// The bytes are the program's arguments, one per line.
// The environment variable `ABVH_PROGRAM` contains the path of the program to test.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| integration::fuzz::COMMAND.load_bytes(bytes));
