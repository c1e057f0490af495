//! What GDAL keeps beside a GeoTIFF.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_pair("f.tif", "f.tif.aux.xml", data));
