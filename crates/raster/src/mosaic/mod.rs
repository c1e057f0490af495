//! Mosaics: many files as one grid on one lattice, with later files on top where they are valid, read by
//! window. Files are opened on demand and closed again, so their number is not limited.
//!
//! `members` expands the inputs to files, `find` reads their metadata in parallel, `consistency` checks that they
//! are consistent, `layout` aligns them on the lattice of the first, `index` (a packed R-tree) finds the files of
//! a window, and the window is painted from bottom to top. A part that fills a window alone is read directly into
//! it. A VRT is a mosaic whose parts are placed by its XML. Mosaics can be nested.
//!
//! Memory is independent of the number of samples; only names and rectangles grow with the number of files. Open
//! files are in one pool of a mosaic and all nested mosaics, at most 256 (a quarter of the process limit if that is
//! less), and their decoded blocks are in one cache, which keeps those of closed files. A file whose size or type changed
//! before it is reopened is an error.

mod cache;
mod consistency;
mod find;
mod index;
mod layout;
mod members;
mod plain;
mod recode;
pub(super) mod vrt;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use crate::grid::{GridInfo, GridSource};
use crate::window::{GridHeight, SampleWindow};
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::path_of;

use find::{MosaicFamily, MosaicSource};
use index::MosaicRTree;
pub use members::{Inputs, files, files_below, is_collection};
pub(super) use plain::open;
pub use plain::{MosaicLayer, common_nodata, open_layers};
use recode::HeightRecoding;
pub use recode::wider as wider_type;

/// Maximum number of samples buffered for painting.
const SCRATCH_SAMPLES: u32 = 1 << 19;

/// A mosaic.
struct Mosaic {
    info: GridInfo,
    /// Parts from bottom to top.
    parts: Vec<MosaicPart>,
    index: MosaicRTree,
    family: Arc<MosaicFamily>,
    /// What will be read from the top.
    expected: OnceLock<Rect>,
}

/// A rectangle of a file and its position in the mosaic.
struct MosaicPart {
    source: MosaicSource,
    /// Rectangle in the mosaic; not empty.
    rect: Rect,
    /// Column and row of its first sample in the file.
    from: [u32; 2],
    /// True if voids are transparent.
    transparent: bool,
    recode: Option<HeightRecoding>,
}

impl Mosaic {
    fn new(info: GridInfo, parts: Vec<MosaicPart>, family: Arc<MosaicFamily>) -> Self {
        let index = MosaicRTree::new(&parts.iter().map(|part| part.rect).collect::<Vec<_>>());
        Self { info, parts, index, family, expected: OnceLock::new() }
    }

    /// Passes a hint about `rect` to all open grids.
    fn pass_hint(&self, rect: Rect, hint: impl Fn(&dyn GridSource, Rect)) {
        for i in self.index.find(&rect) {
            let part = &self.parts[i as usize];
            let there = part.in_source(part.rect.intersect(&rect));
            match &part.source {
                MosaicSource::Nested { grid, .. } => hint(&**grid, there),
                MosaicSource::File(file) => {
                    self.family.pool.peek(file.key).into_iter().for_each(|g| hint(&*g, there));
                }
            }
        }
    }

    fn read<H: GridHeight>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        SampleWindow::new(&self.info, rect, out)?;
        let found = self.index.find(&rect);
        let parts: Vec<&MosaicPart> = found.iter().map(|i| &self.parts[*i as usize]).collect();
        if let [only] = parts[..]
            && only.recode.is_none()
            && only.rect.intersect(&rect) == rect
        {
            return self.read_from(only, rect, out);
        }
        out.fill(H::VOID);
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        parts.into_iter().try_for_each(|part| self.paint(part, &mut window, rect))
    }

    /// Paints the samples of `part` in `rect` into the window.
    fn paint<H: GridHeight>(
        &self,
        part: &MosaicPart,
        window: &mut SampleWindow<'_, H>,
        rect: Rect,
    ) -> Result<()> {
        let whole = part.rect.intersect(&rect);
        let rows = (SCRATCH_SAMPLES / whole.width).max(1);
        for row in (whole.row..whole.end_row()).step_by(rows as usize) {
            let strip = Rect { row, height: rows, ..whole }.intersect(&whole);
            match &part.recode {
                // Scaling and rounding use the exact value.
                Some(recode) => self.paint_strip(part, window, strip, |height: f64| {
                    H::of_f64(recode.height(height))
                })?,
                None => self.paint_strip(part, window, strip, |height: H| height)?,
            }
        }
        Ok(())
    }

    fn paint_strip<R: GridHeight, H: GridHeight>(
        &self,
        part: &MosaicPart,
        window: &mut SampleWindow<'_, H>,
        strip: Rect,
        height: impl Fn(R) -> H,
    ) -> Result<()> {
        let mut heights = vec![R::VOID; strip.len()];
        self.read_from(part, strip, &mut heights)?;
        for (row, read) in heights.chunks_exact(strip.width as usize).enumerate() {
            for (out, read) in window.row(strip, row as u32).iter_mut().zip(read) {
                if !read.is_void() {
                    *out = height(*read);
                } else if !part.transparent {
                    *out = H::VOID;
                }
            }
        }
        Ok(())
    }

    /// Reads `rect` (of the mosaic, inside the part) from the file.
    fn read_from<H: GridHeight>(&self, part: &MosaicPart, rect: Rect, out: &mut [H]) -> Result<()> {
        let there = part.in_source(rect);
        match &part.source {
            MosaicSource::Nested { grid, .. } => H::read(grid.as_ref(), there, out),
            MosaicSource::File(file) => {
                let grid = self.family.grid(file)?;
                let expected = self.expected.get().copied().unwrap_or(rect);
                grid.advise_read(part.in_source(part.rect.intersect(&expected)));
                H::read(grid.as_ref(), there, out)
            }
        }
    }
}

impl MosaicPart {
    /// `rect` of the mosaic, inside the part, in columns and rows of the file.
    fn in_source(&self, rect: Rect) -> Rect {
        let col = self.from[0] + (rect.col - self.rect.col);
        let row = self.from[1] + (rect.row - self.rect.row);
        Rect { col, row, ..rect }
    }
}

impl GridSource for Mosaic {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        let bytes = self.parts.iter().map(|part| match &part.source {
            MosaicSource::Nested { grid, .. } => grid.block_bytes(),
            MosaicSource::File(file) => file.block_bytes,
        });
        bytes.max().unwrap_or(0)
    }

    fn members(&self) -> Vec<PathBuf> {
        let members = self.parts.iter().flat_map(|part| match &part.source {
            MosaicSource::Nested { grid, path } => [vec![path.clone()], grid.members()].concat(),
            MosaicSource::File(file) => vec![path_of(file.name()).into_owned()],
        });
        let mut members: Vec<PathBuf> = members.collect();
        members.sort();
        members.dedup();
        members
    }

    fn release(&self, rect: Rect) {
        self.pass_hint(rect, |grid, there| grid.release(there));
    }

    fn copied(&self, rect: Rect) {
        self.pass_hint(rect, |grid, there| grid.copied(there));
    }

    fn advise_read(&self, rect: Rect) {
        let _ = self.expected.set(rect);
        self.pass_hint(rect, |grid, there| grid.advise_read(there));
    }
}
