//! Adapter that clips a grid to polygons: samples outside are void.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Clip;
use super::scan::{Labelled, PolygonScan};
use crate::cache::too_large_for_cache;
use crate::window::{GridHeight, SampleWindow};
use crate::{GridInfo, GridOpenOptions, GridSource};
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;

/// A clipped grid.
struct Clipped {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    clip: Arc<Clip>,
}

/// The grid of `open`, clipped to `clip`, whose memory counts towards the cache.
///
/// # Errors
/// Errors of `open`; polygons that exceed the memory, have another CRS, or contain no sample.
pub fn clipped(
    clip: &Arc<Clip>,
    options: &GridOpenOptions,
    open: impl FnOnce(&GridOpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    let cache_bytes =
        remaining_cache(options, clip.memory_use(options.threads), "polygons", &clip.path)?;
    let inner = open(&GridOpenOptions { cache_bytes, clip: None, ..options.clone() })?;
    let mut info = inner.info().clone();
    info.crs.check_same(&clip.crs, "polygons").map_err(|e| e.in_file(&clip.path))?;
    info.details.push(("clip".to_owned(), clip.path.display().to_string()));
    let grid = Clipped { info, inner, clip: clip.clone() };
    match grid.holds_any(grid.info.bounds()) {
        true => Ok(Box::new(grid)),
        false => Err(Error::bad_input("polygons contain no sample of the grid")
            .in_file(&clip.path)
            .remedy(
                "choose polygons that overlap the grid (terrane info prints the bounds of both)",
            )),
    }
}

/// Bytes left for the block cache if `what`, from the file `path`, takes `bytes`.
pub(crate) fn remaining_cache(
    options: &GridOpenOptions,
    bytes: u64,
    what: &str,
    path: &Path,
) -> Result<usize> {
    let Some(remaining) = (options.cache_bytes as u64).checked_sub(bytes) else {
        let mib = bytes.div_ceil(1 << 20);
        let message = format!("{what} take {mib} MiB, more than the memory available");
        let error = too_large_for_cache(message, bytes).or("simplify them with ‹terrane simplify›");
        return Err(error.in_file(path));
    };
    Ok(usize::try_from(remaining).unwrap_or(usize::MAX))
}

impl Clipped {
    fn scan(&self, rect: Rect) -> PolygonScan<'_> {
        PolygonScan::new(&self.clip.areas, self.info.transform, rect)
    }

    /// True if a sample of `rect` is inside.
    fn holds_any(&self, rect: Rect) -> bool {
        let scan = self.scan(rect).rows(|_, inside: &[Labelled]| match inside {
            [] => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        });
        scan.is_break()
    }

    fn read<H: GridHeight>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        if !self.holds_any(rect) {
            (0..rect.height).for_each(|row| window.row(rect, row).fill(H::VOID));
            return Ok(());
        }
        H::read(&*self.inner, rect, out)?;
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        let _ = self.scan(rect).rows(|row, inside| {
            let row = window.row(rect, row);
            let starts = std::iter::once(0).chain(inside.iter().map(|(_, range)| range.end));
            let ends = inside.iter().map(|(_, range)| range.start).chain([rect.width]);
            for (start, end) in starts.zip(ends) {
                row[start as usize..end as usize].fill(H::VOID);
            }
            ControlFlow::<()>::Continue(())
        });
        Ok(())
    }
}

impl GridSource for Clipped {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes() + self.clip.memory_use(1)
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    hints_go_to!(inner);
}
