//! Grids of equally spaced raw samples in a file, read by window with `pread`: row-major or column-major,
//! with other bands, padding or gaps in between.

use crate::grid::{GridInfo, GridSource};
use crate::sample::{HeightSample, ToHeight};
use crate::window::SampleWindow;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_files::{RawFile, RowRun};

/// Approximate maximum number of bytes gathered at once.
const PART_BYTES: u64 = 1 << 20;

/// Layout of samples: sample (column, row) is at `offset + column * col_pitch + row * row_pitch`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StridedLayout {
    /// Offset of sample (0, 0).
    pub(super) offset: u64,
    /// Bytes from one column to the next.
    pub(super) col_pitch: u64,
    /// Bytes from one row to the next.
    pub(super) row_pitch: u64,
    /// True for big-endian samples.
    pub(super) big_endian: bool,
}

impl StridedLayout {
    /// Contiguous rows of `width` samples of `bytes` bytes, in native byte order.
    pub(super) fn rows(width: u32, bytes: usize) -> Self {
        let col_pitch = bytes as u64;
        let big_endian = cfg!(target_endian = "big");
        Self { offset: 0, col_pitch, row_pitch: u64::from(width) * col_pitch, big_endian }
    }

    /// Contiguous columns of `height` samples of `bytes` bytes, otherwise as [`rows`](Self::rows).
    pub(super) fn columns(height: u32, bytes: usize) -> Self {
        let rows = Self::rows(height, bytes);
        Self { col_pitch: rows.row_pitch, row_pitch: rows.col_pitch, ..rows }
    }

    /// End offset of a grid of `width` x `height` samples; `None` beyond `u64`.
    pub(super) fn end(&self, width: u32, height: u32, bytes: usize) -> Option<u64> {
        let across = self.col_pitch.checked_mul(u64::from(width.checked_sub(1)?))?;
        let down = self.row_pitch.checked_mul(u64::from(height.checked_sub(1)?))?;
        self.offset.checked_add(across)?.checked_add(down)?.checked_add(bytes as u64)
    }
}

/// Fails unless the file has one of the valid `lengths`, the first of which ends with the last sample
/// (`None`: overflow).
pub(super) fn check_exact(file: &RawFile, lengths: Option<&[u64]>) -> Result<()> {
    let end = lengths.and_then(|lengths| lengths.first().copied());
    check_length(file, end)?;
    match end.filter(|_| lengths.is_none_or(|lengths| !lengths.contains(&file.size()))) {
        None => Ok(()),
        Some(end) => Err(Error::bad_input(format!(
            "{} extra bytes after the last sample: the header does not match the file",
            file.size() - end
        ))
        .in_file(file.path())
        .remedy(format!("correct the header, or truncate the file to {end} bytes"))),
    }
}

/// Fails unless the file has at least `expected` bytes (`None`: overflow).
fn check_length(file: &RawFile, expected: Option<u64>) -> Result<()> {
    let found = file.size();
    match expected {
        Some(expected) if expected <= found => Ok(()),
        _ => {
            let expected = expected.map_or("more than 2^64".to_owned(), |bytes| bytes.to_string());
            Err(Error::bad_input(format!(
                "file is truncated or its header is wrong: {found} bytes, expected {expected}"
            ))
            .in_file(file.path()))
        }
    }
}

/// An open grid.
pub(super) struct StridedGrid {
    file: RawFile,
    info: GridInfo,
    layout: StridedLayout,
    to_height: ToHeight,
}

/// One axis of a rectangle.
#[derive(Clone, Copy)]
struct StridedAxis {
    count: usize,
    pitch: u64,
}

/// Buffers reused between parts.
#[derive(Default)]
struct StridedBuffers {
    file: Vec<u8>,
    samples: Vec<u8>,
}

impl StridedGrid {
    /// Fails if the file is too short for `info` and `layout`.
    pub(super) fn new(file: RawFile, info: GridInfo, layout: StridedLayout) -> Result<Self> {
        check_length(&file, layout.end(info.width, info.height, info.sample_type.bytes()))?;
        Ok(Self { to_height: ToHeight::of(&info), file, info, layout })
    }

    fn read<H: HeightSample>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window =
            SampleWindow::new(&self.info, rect, out).map_err(|e| e.in_file(self.file.path()))?;
        let mut scratch = StridedBuffers::default();
        let (width, height) = self.part_size(rect);
        for row in (rect.row..rect.end_row()).step_by(height as usize) {
            for col in (rect.col..rect.end_col()).step_by(width as usize) {
                let part = Rect::new(col, row, width, height).intersect(&rect);
                self.gather(part, &mut scratch)?;
                let row_bytes = part.width as usize * self.info.sample_type.bytes();
                for (row, bytes) in scratch.samples.chunks_exact(row_bytes).enumerate() {
                    self.to_height.convert(bytes, window.row(part, row as u32));
                }
            }
        }
        Ok(())
    }

    fn is_by_row(&self) -> bool {
        self.layout.col_pitch <= self.layout.row_pitch
    }

    /// Columns and rows of the parts in which `rect` is read.
    fn part_size(&self, rect: Rect) -> (u32, u32) {
        let size = self.info.sample_type.bytes() as u64;
        if self.is_by_row() {
            let width = count_in_part(self.layout.col_pitch, rect.width);
            (width, count_in_part(u64::from(width) * size, rect.height))
        } else {
            let height = count_in_part(self.layout.row_pitch, rect.height);
            (count_in_part(u64::from(height) * size, rect.width), height)
        }
    }

    /// Reads `part` into `scratch.samples`, row by row, in native byte order.
    fn gather(&self, part: Rect, scratch: &mut StridedBuffers) -> Result<()> {
        let layout = &self.layout;
        let size = self.info.sample_type.bytes();
        scratch.samples.resize(part.len() * size, 0);
        let across = StridedAxis { count: part.width as usize, pitch: layout.col_pitch };
        let down = StridedAxis { count: part.height as usize, pitch: layout.row_pitch };
        let (inner, outer) = if self.is_by_row() { (across, down) } else { (down, across) };
        // Within the file: its length was checked against the whole grid.
        let run = RowRun {
            offset: layout.offset
                + u64::from(part.col) * layout.col_pitch
                + u64::from(part.row) * layout.row_pitch,
            pitch: outer.pitch,
            // Not a whole number of pitches: behind the last sample of the file there may be nothing.
            bytes: (inner.count - 1) * inner.pitch as usize + size,
            rows: outer.count,
        };
        let samples = &mut scratch.samples;
        let (step, stride) =
            if self.is_by_row() { (1, part.width as usize) } else { (part.width as usize, 1) };
        self.file.each_row(run, &mut scratch.file, |line, bytes| {
            let pitch = inner.pitch as usize;
            if step == 1 && pitch == size {
                samples[line * stride * size..][..bytes.len()].copy_from_slice(bytes);
            } else {
                for i in 0..inner.count {
                    let to = (line * stride + i * step) * size;
                    samples[to..to + size].copy_from_slice(&bytes[i * pitch..][..size]);
                }
            }
        })?;
        if layout.big_endian != cfg!(target_endian = "big") {
            samples.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        Ok(())
    }
}

impl GridSource for StridedGrid {
    reads_alike!();
}

/// How many columns or rows, `pitch` bytes apart, fit into a part; at least 1 and at most `side`.
fn count_in_part(pitch: u64, side: u32) -> u32 {
    (PART_BYTES / pitch.max(1)).clamp(1, u64::from(side.max(1))) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SampleType, spool::SampleSpool};
    use proptest::prelude::*;
    use std::path::Path;

    fn grid(bytes: &[u8], width: u32, height: u32, layout: StridedLayout) -> Result<StridedGrid> {
        let mut spool = SampleSpool::new(Path::new("t.raw"), None).unwrap();
        spool.write(bytes).unwrap();
        let info = GridInfo::plain("test", width, height, SampleType::U16);
        StridedGrid::new(spool.finish().unwrap(), info, layout)
    }

    proptest! {
        #[test]
        fn any_layout_like_its_naive_twin(
            (width, height) in (1_u32..9, 1_u32..9), by_row in any::<bool>(), gap in 0_u64..3,
            pad in 0_u64..5, offset in 0_u64..4, big_endian in any::<bool>(),
            seed in any::<u64>(), corner in (0_u32..9, 0_u32..9), size in (0_u32..9, 0_u32..9),
        ) {
            let inner = 2 + gap;
            let lines = |count: u32| u64::from(count) * inner + pad;
            let (col_pitch, row_pitch) =
                if by_row { (inner, lines(width)) } else { (lines(height), inner) };
            let layout = StridedLayout { offset, col_pitch, row_pitch, big_endian };
            let end = layout.end(width, height, 2).unwrap();
            let bytes: Vec<u8> =
                (0..end).map(|i| (seed.wrapping_mul(2 * i + 1) >> 40) as u8).collect();
            let rect = Rect::new(corner.0.min(width), corner.1.min(height), size.0, size.1)
                .intersect(&Rect::new(0, 0, width, height));
            let mut out = vec![0.0_f64; rect.len()];
            grid(&bytes, width, height, layout).unwrap().read_f64(rect, &mut out).unwrap();
            let naive = |i: usize| {
                let (col, row) = (rect.col as usize + i % rect.width as usize,
                    rect.row as usize + i / rect.width as usize);
                let at = offset as usize + col * col_pitch as usize + row * row_pitch as usize;
                let pair = [bytes[at], bytes[at + 1]];
                f64::from(if big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) })
            };
            prop_assert!((0..rect.len()).all(|i| out[i] == naive(i)));
            let short = grid(&bytes[..bytes.len() - 1], width, height, layout).err().map(|e| e.to_string());
            prop_assert!(short.is_none_or(|e| e.contains("bytes, expected") || e.contains("empty")));
        }
    }

    #[test]
    fn layouts_beyond_counting_are_refused() {
        let layout = StridedLayout {
            offset: u64::MAX,
            col_pitch: 2,
            row_pitch: u64::MAX / 2,
            big_endian: false,
        };
        let error = grid(&[0; 8], 9, 9, layout).err().unwrap().to_string();
        assert!(error.contains("8 bytes, expected more than 2^64"), "{error}");
    }

    #[test]
    fn parts_stay_small_however_far_samples_lie_apart() {
        let layout = StridedLayout {
            offset: 0,
            col_pitch: 600_000,
            row_pitch: 1_800_000,
            big_endian: false,
        };
        let mut bytes = vec![0; layout.end(3, 2, 2).unwrap() as usize];
        (0..6).for_each(|i| bytes[i * 600_000] = i as u8);
        let grid = grid(&bytes, 3, 2, layout).unwrap();
        assert_eq!(grid.part_size(Rect::new(0, 0, 3, 2)), (1, 2));
        let mut out = [0.0; 6];
        grid.read_f32(Rect::new(0, 0, 3, 2), &mut out).unwrap();
        assert_eq!(out, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
