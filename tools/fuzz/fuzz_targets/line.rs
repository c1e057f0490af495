//! Lines on a small lattice, through every method of simplification.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::line::simplify(data));
