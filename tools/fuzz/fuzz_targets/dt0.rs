//! DTED.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read("f.dt0", data));
