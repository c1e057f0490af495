//! gzip, of a DTED cell by its name.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read("f.dt0.gz", data));
