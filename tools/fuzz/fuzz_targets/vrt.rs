//! Virtual rasters of one GeoTIFF beside them.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| terrane_fuzz::read_mosaic("m.vrt", "v.tif", data));
