//! PNG with a world file; its name tells how colours hold heights.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_pair(
    "terrarium.png",
    "terrarium.pgw",
    data
));
