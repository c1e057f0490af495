//! A report on overviews of grids with voids.

use super::{GDAL_NODATA, placed};
use crate::cli_support::Place;
use crate::raster_support::tiff_builder::{Spec, Value};

/// OSGeo/gdal#11555: overviews of masked grids are not shifted, and odd sizes round up.
#[test]
fn a6_overviews_keep_voids_where_they_are() {
    const SIZE: [usize; 2] = [1027, 515];
    let is_void = |col: usize, row: usize| {
        row == SIZE[1] / 2 || [0, SIZE[0] - 1].contains(&col) || [0, SIZE[1] - 1].contains(&row)
    };
    let place = Place::new();
    let mut spec = Spec::new(SIZE[0], SIZE[1], 3, 32);
    spec.extra = placed([10.0, 10.0], [5e5, 5e6]);
    spec.extra.push((GDAL_NODATA, Value::Text("-9999".to_owned())));
    place.write(
        "a.tif",
        spec.build(|col, row, _| if is_void(col, row) { -9999.0 } else { (col + row) as f64 }),
    );
    place.ok(&[
        "convert",
        "a.tif",
        "o.tif",
        "-f",
        "COG",
        "--co",
        "COMPRESS=NONE",
        "--co",
        "BLOCKSIZE=256",
    ]);
    let bytes = place.bytes("o.tif");
    let mut level = Level::first(&bytes);
    let mut above: Vec<bool> =
        (0..SIZE[0] * SIZE[1]).map(|k| !is_void(k % SIZE[0], k / SIZE[0])).collect();
    let mut size = SIZE;
    for step in 0.. {
        assert_eq!(level.size(), size, "level {step}");
        assert_eq!(level.valid(-9999.0), above, "level {step}");
        let Some(next) = level.below() else {
            assert!(step >= 2, "{step} overviews");
            break;
        };
        let half = size.map(|side| side.div_ceil(2));
        let valid = |k: usize| {
            let (col, row) = (k % half[0] * 2, k / half[0] * 2);
            let of = |col: usize, row: usize| {
                col < size[0] && row < size[1] && above[row * size[0] + col]
            };
            of(col, row) || of(col + 1, row) || of(col, row + 1) || of(col + 1, row + 1)
        };
        above = (0..half[0] * half[1]).map(valid).collect();
        (level, size) = (next, half);
    }
}

/// A directory of a little-endian classic TIFF of tiles of uncompressed 32-bit floats.
struct Level<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Level<'a> {
    fn first(bytes: &'a [u8]) -> Self {
        Self { bytes, at: Self::number(bytes, 4, 4) }
    }

    fn number(bytes: &[u8], at: usize, size: usize) -> usize {
        bytes[at..at + size].iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte))
    }

    fn below(&self) -> Option<Self> {
        let count = Self::number(self.bytes, self.at, 2);
        let at = Self::number(self.bytes, self.at + 2 + 12 * count, 4);
        (at > 0).then_some(Self { bytes: self.bytes, at })
    }

    fn tag(&self, tag: usize) -> Vec<usize> {
        let entries = (0..Self::number(self.bytes, self.at, 2)).map(|i| self.at + 2 + 12 * i);
        let number = |at, size| Self::number(self.bytes, at, size);
        let entry = entries.into_iter().find(|at| number(*at, 2) == tag).unwrap();
        let (size, count) = (if number(entry + 2, 2) == 3 { 2 } else { 4 }, number(entry + 4, 4));
        let at = if size * count <= 4 { entry + 8 } else { number(entry + 8, 4) };
        (0..count).map(|i| number(at + i * size, size)).collect()
    }

    fn size(&self) -> [usize; 2] {
        [self.tag(256)[0], self.tag(257)[0]]
    }

    fn valid(&self, nodata: f32) -> Vec<bool> {
        let ([width, height], side) = (self.size(), self.tag(322)[0]);
        let tiles = self.tag(324);
        let sample = |k: usize| {
            let (col, row) = (k % width, k / width);
            let tile = tiles[row / side * width.div_ceil(side) + col / side];
            let at = tile + (row % side * side + col % side) * 4;
            f32::from_le_bytes(self.bytes[at..at + 4].try_into().unwrap())
        };
        (0..width * height).map(|k| sample(k) != nodata).collect()
    }
}
