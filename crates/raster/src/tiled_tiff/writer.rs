//! Writer of stores: tiles in any order, from any thread, with deterministic output.

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use super::header::TiledTiffHeader;
use super::layout::TiledTiffLayout;
use super::map;
use super::out_of_range::SampleMisfit;
use super::sample::{SampleCodec, SampleRounding, TiledTiffHeight};
use super::tags::TiledTiffPreamble;
use crate::grid::GridInfo;
use crate::{pam, sidecars};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Rect;
use terrane_files::atomic::AtomicFile;
use terrane_files::write_all_at;

/// Heights handed to a [`TiledTiffWriter`]; voids are NaN.
#[derive(Clone, Copy, Debug)]
pub enum HeightSlice<'a> {
    /// Exact for the types of [`GridInfo::exact_in_f32`].
    F32(&'a [f32]),
    /// Exact for every type.
    F64(&'a [f64]),
}

/// A store under construction. It appears in [`finish`](Self::finish); dropping the writer before leaves no
/// file.
#[derive(Debug)]
pub struct TiledTiffWriter {
    file: AtomicFile,
    layout: TiledTiffLayout,
    front: TiledTiffPreamble,
    codec: SampleCodec,
    /// Number of samples written so far.
    written: AtomicU64,
}

impl TiledTiffWriter {
    /// Starts a store of the grid described by `info` at `path`, with tiles of `side` samples (one of
    /// [`TILE_SIDES`](super::TILE_SIDES)), after a check of the disk space. Size, transform, CRS, sample
    /// type, nodata, scale and offset are taken from `info`. Fails if `path` has a mask or an .aux.xml of an
    /// earlier file, which would apply to the store.
    pub fn create(path: &Path, info: &GridInfo, side: u32, overwrite: bool) -> Result<Self> {
        refuse_old_sidecars(path)?;
        let header = TiledTiffHeader::new(info, side).map_err(|e| e.in_file(path))?;
        let file = AtomicFile::create(path, overwrite)?;
        let (layout, front) = (header.layout, header.front());
        let length = layout.tile_bytes().checked_mul(layout.tiles());
        let length = length.and_then(|tiles| tiles.checked_add(front.data));
        let length = length.ok_or_else(|| Error::usage("the store is too large").in_file(path))?;
        set_length(path, file.file(), length)?;
        Ok(Self { file, layout, front, codec: SampleCodec::new(info), written: AtomicU64::new(0) })
    }

    /// The writer with heights rounded by `rounding`.
    pub(crate) fn rounding(self, rounding: SampleRounding) -> Self {
        Self { codec: self.codec.rounding(rounding), ..self }
    }

    /// Columns and rows of a tile.
    pub fn tile(&self) -> (u32, u32) {
        (self.layout.tile_width, self.layout.tile_height)
    }

    /// Writes the heights of `rect`: rows of one tile, in its full width inside the grid. May be called from
    /// several threads and in any order, once per sample. `scratch` is a reusable buffer.
    pub fn write(&self, rect: Rect, heights: HeightSlice<'_>, scratch: &mut Vec<u8>) -> Result<()> {
        match heights {
            HeightSlice::F32(heights) => self.write_heights(rect, heights, scratch),
            HeightSlice::F64(heights) => self.write_heights(rect, heights, scratch),
        }
    }

    fn write_heights<H: TiledTiffHeight>(
        &self,
        rect: Rect,
        heights: &[H],
        scratch: &mut Vec<u8>,
    ) -> Result<()> {
        let place = self.place(rect, heights.len())?;
        let row_bytes = self.layout.row_bytes() as usize;
        scratch.clear();
        scratch.resize(place.rows as usize * row_bytes, 0);
        // Rows beyond the last row of the grid are padding.
        let lines = heights.chunks_exact(rect.width as usize).chain(std::iter::repeat(&[][..]));
        for ((row, line), bytes) in (rect.row..).zip(lines).zip(scratch.chunks_exact_mut(row_bytes))
        {
            let encoded = self.codec.encode(line, bytes);
            encoded.map_err(|misfit| self.refuse(misfit, rect.col, row))?;
        }
        write_all_at(self.file.file(), scratch, place.byte)
            .map_err(|e| Error::write(self.file.path(), e))?;
        self.written.fetch_add(rect.len() as u64, Ordering::Relaxed);
        Ok(())
    }

    /// Offset and number of rows of `rect` in the file.
    fn place(&self, rect: Rect, values: usize) -> Result<TiledTiffTileOffset> {
        let TiledTiffLayout { tile_width, tile_height, .. } = self.layout;
        let (across, down) = (rect.col / tile_width, rect.row / tile_height);
        let inside = across < self.layout.across() && down < self.layout.down();
        let tile = if inside { self.layout.tile_rect(across, down) } else { Rect::new(0, 0, 0, 0) };
        let whole_rows = (tile.col, tile.width) == (rect.col, rect.width);
        if rect.is_empty() || !whole_rows || tile.intersect(&rect) != rect || values != rect.len() {
            return Err(Error::usage(format!(
                "{rect:?} with {values} values is not part of a tile"
            )));
        }
        let from = rect.row - tile.row;
        let last = rect.end_row() == self.layout.height;
        let rows = if last { tile_height - from } else { rect.height };
        let tile = self.front.data + self.layout.tile(across, down) * self.layout.tile_bytes();
        Ok(TiledTiffTileOffset { byte: tile + u64::from(from) * self.layout.row_bytes(), rows })
    }

    fn refuse(&self, misfit: SampleMisfit, col: u32, row: u32) -> Error {
        self.codec.refusal(misfit, col, row).in_file(self.file.path())
    }

    /// Completes the store, commits it, and returns its size in bytes. Fails if samples are missing.
    pub fn finish(self) -> Result<u64> {
        let TiledTiffLayout { width, height, .. } = self.layout;
        let (all, written) = (u64::from(width) * u64::from(height), self.written.into_inner());
        if written != all {
            let message = format!("{written} of {all} samples were written to the store");
            return Err(Error::usage(message).in_file(self.file.path()));
        }
        let mut place = 0;
        for piece in self.front.pieces() {
            write_all_at(self.file.file(), &piece, place)
                .map_err(|e| Error::write(self.file.path(), e))?;
            place += piece.len() as u64;
        }
        self.file.commit()
    }
}

/// Fails if a sidecar of an earlier file would apply to a new file at `path`.
pub(crate) fn refuse_old_sidecars(path: &Path) -> Result<()> {
    pam::refuse_old(path)?;
    let Some(mask) = sidecars::mask(path) else { return Ok(()) };
    let message = "mask of an earlier file exists and would apply to the new one";
    Err(Error::new(ErrorKind::CannotWrite, message)
        .in_file(&mask)
        .remedy("remove it, or choose another output name"))
}

/// Offset in the file, and number of rows of a tile to write there.
struct TiledTiffTileOffset {
    byte: u64,
    rows: u32,
}

/// Sets the length of `file` after a check of the disk space; errors name `path`.
pub(crate) fn set_length(path: &Path, file: &File, length: u64) -> Result<()> {
    map::set_length(file, length).map_err(|e| disk_full(path, length, e))
}

/// Fails if the disk of `file` has no space for `bytes` more; errors name `path`.
pub(crate) fn check_free_space(path: &Path, file: &File, bytes: u64) -> Result<()> {
    map::check_free_space(file, bytes).map_err(|e| disk_full(path, bytes, e))
}

fn disk_full(path: &Path, length: u64, error: io::Error) -> Error {
    let full = matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::FileTooLarge);
    let error = Error::write(path, error).at(format!("allocating {length} bytes"));
    if full { error.remedy("free some space, or write to another disk") } else { error }
}
