//! Files of features, of the format that the first byte picks.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::vector::read(data));
