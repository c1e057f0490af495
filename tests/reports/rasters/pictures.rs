//! Reports on grids in pictures.

use super::{facts, heights};
use crate::cli_support::Place;
use crate::raster_support::open_band;

/// GDAL 3.10.1: 16-bit interlaced pictures.
#[test]
fn a7_interlaced_pictures_of_16_bits() {
    const SIZE: [usize; 2] = [33, 17];
    let sample = |col: usize, row: usize| (col * 1987 + row * 301 + 5) as u16;
    let mut seen = Vec::new();
    for interlaced in [false, true] {
        for chunks in [&[][..], &[("gAMA", vec![0, 0, 177, 143]), ("sBIT", vec![16])]] {
            for key in [None, Some(sample(4, 3))] {
                let place = Place::new();
                place.write("a.png", adam7(SIZE, interlaced, chunks, key, sample));
                place.write("a.pgw", "10\n0\n0\n-10\n500005\n4999995\n");
                let found = heights(&place, "a.png");
                for (k, z) in found.iter().enumerate() {
                    let stored = sample(k % SIZE[0], k / SIZE[0]);
                    match key == Some(stored) {
                        true => assert!(z.is_nan()),
                        false => assert_eq!(*z, f64::from(stored), "{interlaced} {chunks:?} {k}"),
                    }
                }
                let grid = open_band(&place.path("a.png"), 1).unwrap();
                assert_eq!(grid.info().transform.to_gdal()[..2], [500_000.0, 10.0]);
                seen.push(found.len());
            }
        }
    }
    assert_eq!(seen, [SIZE[0] * SIZE[1]; 8]);
}

/// A picture of 16-bit gray, with chunks before its samples, in seven passes or in one.
fn adam7(
    [width, height]: [usize; 2],
    interlaced: bool,
    chunks: &[(&str, Vec<u8>)],
    key: Option<u16>,
    sample: impl Fn(usize, usize) -> u16,
) -> Vec<u8> {
    // First column and row, and steps between columns and rows.
    let seven = [
        [0, 0, 8, 8],
        [4, 0, 8, 8],
        [0, 4, 4, 8],
        [2, 0, 4, 4],
        [0, 2, 2, 4],
        [1, 0, 2, 2],
        [0, 1, 1, 2],
    ];
    let passes = if interlaced { seven.to_vec() } else { vec![[0, 0, 1, 1]] };
    let mut raw = Vec::new();
    for [x, y, across, down] in passes {
        if x >= width {
            continue;
        }
        for row in (y..height).step_by(down) {
            raw.push(0);
            raw.extend((x..width).step_by(across).flat_map(|col| sample(col, row).to_be_bytes()));
        }
    }
    let mut deflate = libdeflater::Compressor::new(libdeflater::CompressionLvl::default());
    let mut packed = vec![0; deflate.zlib_compress_bound(raw.len())];
    let bytes = deflate.zlib_compress(&raw, &mut packed).unwrap();
    packed.truncate(bytes);
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &str, data: &[u8]| {
        out.extend((data.len() as u32).to_be_bytes());
        let start = out.len();
        out.extend(name.as_bytes());
        out.extend(data);
        let mut crc = libdeflater::Crc::new();
        crc.update(&out[start..]);
        out.extend(crc.sum().to_be_bytes());
    };
    let size = [width as u32, height as u32].map(u32::to_be_bytes).concat();
    chunk("IHDR", &[&size[..], &[16, 0, 0, 0, u8::from(interlaced)]].concat());
    chunks.iter().for_each(|(name, data)| chunk(name, data));
    if let Some(key) = key {
        chunk("tRNS", &key.to_be_bytes());
    }
    chunk("IDAT", &packed);
    chunk("IEND", &[]);
    out
}

/// kylebarron/pydelatin#33: a picture that is unpacked in the wrong way.
#[test]
fn d7_heights_that_no_terrain_has_are_told() {
    let pixels = |encode: &dyn Fn(usize) -> [u8; 3]| {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, 16, 16);
        encoder.set_color(::png::ColorType::Rgb);
        let data: Vec<u8> = (0..256).flat_map(encode).collect();
        encoder.write_header().unwrap().write_image_data(&data).unwrap();
        bytes
    };
    let packed = |value: f64| {
        let [_, red, green, blue] = (value.round() as u32).to_be_bytes();
        [red, green, blue]
    };
    let height = |k: usize| 500.0 + (k % 16 * 3 + k / 16) as f64;
    let terrarium = pixels(&|k| packed((height(k) + 32_768.0) * 256.0));
    let terrain = pixels(&|k| packed((height(k) + 10_000.0) * 10.0));
    let noisy = pixels(&|k| {
        let [red, green, blue] = packed((height(k) + 32_768.0) * 256.0);
        [red, green, blue ^ (k * 37 % 256) as u8]
    });
    let photo = pixels(&|k| [(200 - k % 90) as u8, (90 + k % 50) as u8, (k % 256) as u8]);
    let place = Place::new();
    for folder in ["terrain-rgb", "terrarium"] {
        std::fs::create_dir(place.path(folder)).unwrap();
    }
    place.write("terrain-rgb/t.png", &terrarium).write("terrarium/r.png", &terrain);
    place.write("terrarium/t.png", &terrarium).write("terrain-rgb/r.png", &terrain);
    place.write("terrarium/noise.png", &noisy).write("photo.png", &photo);
    for (name, words) in [
        ("terrain-rgb/t.png", Some("terrarium:FILE")),
        ("terrarium/r.png", Some("terrain-rgb:FILE")),
        ("terrain-rgb:photo.png", Some("terrarium:FILE")),
        ("terrarium/t.png", None),
        ("terrain-rgb/r.png", None),
        ("terrarium/noise.png", None),
    ] {
        let info = facts(&place, &["info", name, "--stats"]);
        let kinds: Vec<&str> = info["notes"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|note| note["kind"].as_str())
            .collect();
        assert_eq!(kinds.contains(&"no terrain"), words.is_some(), "{name}: {info}");
        let info = info["notes"].to_string();
        // A picture of other packing is flat, or steep.
        let interval = if name.ends_with("r.png") { "1" } else { "10" };
        for make in [
            &["tin", name, "o.ply", "--max-error", "1"][..],
            &["contour", name, "o.geojson", "--interval", interval],
        ] {
            let told = facts(&place, &[make, &["--overwrite"]].concat())["notes"].to_string();
            let is_told = told.contains("outside terrain on Earth");
            assert_eq!(is_told, words.is_some(), "{name}: {told}");
            assert!(
                words.is_none_or(|words| told.contains(words) && info.contains(words)),
                "{told}"
            );
        }
    }
}
