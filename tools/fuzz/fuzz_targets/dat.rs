//! Raw samples with an ENVI header.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_pair("f.dat", "f.dat.hdr", data));
