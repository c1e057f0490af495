//! SRTM HGT, filled up to the length of the smallest tile when it is shorter.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_tile("S02W010.hgt", data));
