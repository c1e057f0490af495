//! Raw floats with an ESRI header.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_pair("f.flt", "f.hdr", data));
