//! ESRI ASCII with the .prj beside it.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_pair("f.asc", "f.prj", data));
