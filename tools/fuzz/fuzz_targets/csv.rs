//! XYZ text separated by commas.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read("f.csv", data));
