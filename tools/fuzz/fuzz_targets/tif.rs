//! GeoTIFF and BigTIFF.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read("f.tif", data));
