//! Overviews: heights of a level at half the resolution, buffered in an unnamed file.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::packed::temporary_path;
use crate::grid::{GridInfo, GridSource, SampleType};
use crate::strided::{StridedGrid, StridedLayout};
use crate::tiled_tiff::sample::TiledTiffHeight;
use crate::tiled_tiff::writer::set_length;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::RawFile;
use terrane_files::{nameless, write_all_at};

/// Overview resampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OverviewResampling {
    /// Mean of the valid samples; void if none is valid.
    Average,
    /// The upper left sample.
    Nearest,
}

/// Sizes of the levels below a grid, halved (rounded up) until both sides fit into `block`.
pub(super) fn sizes(width: u32, height: u32, block: u32) -> Vec<(u32, u32)> {
    let halves = std::iter::successors(Some((width, height)), |&(width, height)| {
        (width.max(height) > block).then(|| (width.div_ceil(2), height.div_ceil(2)))
    });
    halves.skip(1).collect()
}

/// Heights of one level.
pub(super) struct OverviewLevel {
    file: File,
    info: GridInfo,
    path: PathBuf,
}

impl OverviewLevel {
    /// An empty level of `width` x `height` heights in `f32` or `f64`, in `folder` or else in the folder of
    /// the output at `path`, after a check of the disk space.
    pub(super) fn new(
        path: &Path,
        folder: Option<&Path>,
        width: u32,
        height: u32,
        single: bool,
    ) -> Result<Self> {
        let kind = if single { SampleType::F32 } else { SampleType::F64 };
        let info = GridInfo::plain("overview", width, height, kind);
        let bytes = u64::from(width) * u64::from(height) * kind.bytes() as u64;
        let folder = temporary_path(path, folder)?;
        let file = nameless(&folder)?;
        set_length(&folder, &file, bytes)?;
        Ok(Self { file, info, path: folder })
    }

    /// Stores the downsampled heights of `rect`, a block of the level above that begins at an even column and
    /// row. May be called from any thread and in any order.
    pub(super) fn put<H: TiledTiffHeight>(
        &self,
        rect: Rect,
        heights: &[H],
        how: OverviewResampling,
    ) -> Result<()> {
        let halved = halve(heights, rect.width as usize, how);
        let width = rect.width.div_ceil(2) as usize;
        let (col, first) = (rect.col / 2, rect.row / 2);
        let size = self.info.sample_type.bytes() as u64;
        for (row, line) in (first..).zip(halved.chunks_exact(width)) {
            let place = u64::from(row) * u64::from(self.info.width) + u64::from(col);
            write_all_at(&self.file, &self.bytes(line), place * size)
                .map_err(|e| Error::write(&self.path, e))?;
        }
        Ok(())
    }

    fn bytes(&self, line: &[f64]) -> Vec<u8> {
        match self.info.sample_type {
            SampleType::F32 => line.iter().flat_map(|z| (*z as f32).to_ne_bytes()).collect(),
            _ => line.iter().flat_map(|z| z.to_ne_bytes()).collect(),
        }
    }

    /// The complete level as a grid.
    pub(super) fn into_source(self) -> Result<Box<dyn GridSource>> {
        let layout = StridedLayout::rows(self.info.width, self.info.sample_type.bytes());
        let file = RawFile::of(self.file, &self.path)?;
        Ok(Box::new(StridedGrid::new(file, self.info, layout)?))
    }
}

/// Rows of `width` heights downsampled by two; a last odd column or row is used alone.
fn halve<H: TiledTiffHeight>(heights: &[H], width: usize, how: OverviewResampling) -> Vec<f64> {
    let mut halved = Vec::with_capacity(heights.len() / 4 + width);
    for rows in heights.chunks(2 * width) {
        let (upper, lower) = rows.split_at(width);
        for (i, upper) in upper.chunks(2).enumerate() {
            let lower = lower.get(2 * i..(2 * i + 2).min(lower.len())).unwrap_or_default();
            halved.push(match how {
                OverviewResampling::Nearest => upper[0].to_f64(),
                OverviewResampling::Average => mean(upper, lower),
            });
        }
    }
    halved
}

#[inline(always)]
fn mean<H: TiledTiffHeight>(upper: &[H], lower: &[H]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for height in upper.iter().chain(lower).filter(|height| !height.is_void()) {
        sum += height.to_f64();
        count += 1.0;
    }
    // 0 / 0 without a valid sample, which is void.
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_until_they_fit() {
        assert_eq!(sizes(512, 512, 512), []);
        assert_eq!(sizes(513, 5, 512), [(257, 3)]);
        assert_eq!(sizes(1, 2049, 512), [(1, 1025), (1, 513), (1, 257)]);
    }

    #[test]
    fn means_are_of_the_valid_ones() {
        const V: f32 = f32::NAN;
        let rows = [1.0, 3.0, V, V, 7.0, 5.0, V, V, V, V, 2.0, 4.0, 6.0, V, 8.0];
        let halved = halve(&rows, 5, OverviewResampling::Average);
        assert_eq!(halved[0], 3.0);
        assert!(halved[1].is_nan());
        assert_eq!(halved[2..], [7.0, 3.0, 6.0, 8.0]);
        let nearest = halve(&rows, 5, OverviewResampling::Nearest);
        assert!(nearest[1].is_nan());
        assert_eq!((nearest[0], &nearest[2..]), (1.0, &[7.0, 2.0, 6.0, 8.0][..]));
    }

    #[test]
    fn blocks_come_together() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        for single in [true, false] {
            let level = OverviewLevel::new(&path, None, 3, 2, single).unwrap();
            level
                .put(
                    Rect::new(4, 0, 2, 3),
                    &[5.0, 7.0, 5.0, 7.0, 9.0, 9.0],
                    OverviewResampling::Average,
                )
                .unwrap();
            level.put(Rect::new(0, 0, 4, 3), &[1.0_f32; 12], OverviewResampling::Average).unwrap();
            let source = level.into_source().unwrap();
            let mut out = [0.0; 6];
            source.read_f64(Rect::new(0, 0, 3, 2), &mut out).unwrap();
            assert_eq!(out, [1.0, 1.0, 6.0, 1.0, 1.0, 9.0]);
        }
    }
}
