//! Damage to sound files, and reading that must not panic.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use terrane::Result;
use terrane::geom::Rect;
use terrane::raster::{OpenOptions, open};

use super::read_all;

/// Most samples a test reads at once.
const MOST_SAMPLES: u64 = 1 << 19;

/// Opens and reads all of a small grid, or three windows of a large one.
pub(crate) fn attempt(path: &Path) -> Result<Vec<f64>> {
    let options = OpenOptions { cache_bytes: 16 << 20, ..OpenOptions::default() };
    let source = open(path.to_str().unwrap(), &options)?;
    let (width, height) = (source.info().width, source.info().height);
    if u64::from(width) * u64::from(height) <= MOST_SAMPLES {
        return read_all(source.as_ref());
    }
    let (w, h) = (width.min(64), height.min(64));
    let mut out = vec![0.0; (w * h) as usize];
    for (col, row) in [(0, 0), (width / 2 - w / 2, height / 2 - h / 2), (width - w, height - h)] {
        source.read_f64(Rect::new(col, row, w, h), &mut out)?;
    }
    Ok(out)
}

/// As [`attempt`], with a panic as text.
pub(crate) fn guarded(path: &Path) -> std::result::Result<Result<Vec<f64>>, String> {
    catch_unwind(AssertUnwindSafe(|| attempt(path))).map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        text.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default()
    })
}

/// A small generator of repeatable numbers (xorshift).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, most: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % most as u64) as usize
    }
}

/// Changes a few bytes, to anything or to values that tend to hurt; sometimes cuts the end.
pub(crate) fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len());
        bytes[at] = match random.below(4) {
            0 => 0,
            1 => 0xff,
            2 => bytes[at] ^ (1 << random.below(8)),
            _ => random.below(256) as u8,
        };
    }
    if random.below(8) == 0 {
        bytes.truncate(1 + random.below(bytes.len()));
    }
}
