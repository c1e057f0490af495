//! Adapter that flattens the water of a grid.

use std::path::PathBuf;
use std::sync::Arc;

use super::Water;
use super::levels::WaterLevels;
use crate::clip::remaining_cache;
use crate::window::{GridHeight, SampleWindow};
use crate::{GridInfo, GridOpenOptions, GridSource};
use terrane_base::error::Result;
use terrane_base::geom::Rect;

/// A grid with flattened water.
struct LeveledGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    water: Arc<Water>,
}

/// The grid of `open` with the water of `water`, whose memory counts towards the cache.
///
/// # Errors
/// Errors of `open`; water that exceeds the memory, has another CRS, or does not overlap the grid.
pub(crate) fn levelled(
    water: &Arc<Water>,
    options: &GridOpenOptions,
    open: impl FnOnce(&GridOpenOptions) -> Result<Box<dyn GridSource>>,
) -> Result<Box<dyn GridSource>> {
    let cache_bytes = remaining_cache(options, water.memory_use(), "water", water.path())?;
    let inner = open(&GridOpenOptions { cache_bytes, water: None, ..options.clone() })?;
    let mut info = inner.info().clone();
    super::mask::WaterMask::new(water, &info)?;
    info.details.push(("water".to_owned(), water.path().display().to_string()));
    Ok(Box::new(LeveledGrid { info, inner, water: water.clone() }))
}

impl LeveledGrid {
    /// The levels, computed on first use.
    fn levels(&self) -> Result<Arc<WaterLevels>> {
        let mut known = self.water.lock();
        if let Some(levels) = &*known {
            return Ok(levels.clone());
        }
        let levels = Arc::new(WaterLevels::new(&self.water, &*self.inner)?);
        *known = Some(levels.clone());
        Ok(levels)
    }

    fn read<H: GridHeight>(&self, rect: Rect, out: &mut [H]) -> Result<()> {
        let levels = self.levels()?;
        H::read(&*self.inner, rect, out)?;
        let mut window = SampleWindow::new(&self.info, rect, out)?;
        let mut of_row = Vec::new();
        for (row, runs) in (0..rect.height).zip(levels.mask.rows(rect)) {
            if runs.is_empty() {
                continue;
            }
            of_row.clear();
            of_row.resize(rect.width as usize, f64::INFINITY);
            for (body, cols) in runs {
                let mut last = 0;
                let step = if levels.is_level(body) { cols.len() } else { 1 };
                for col in cols.clone().step_by(step) {
                    let level = levels.at(body, self.position(rect, col, row), &mut last);
                    let same = col as usize..col as usize + step;
                    of_row[same].iter_mut().for_each(|other: &mut f64| *other = other.min(level));
                }
            }
            let wet = window.row(rect, row).iter_mut().zip(&of_row);
            for (height, level) in wet.filter(|(_, level)| level.is_finite()) {
                *height = H::of_f64(*level);
            }
        }
        Ok(())
    }

    fn position(&self, rect: Rect, col: u32, row: u32) -> [f64; 2] {
        self.info.transform.apply(f64::from(rect.col + col), f64::from(rect.row + row))
    }
}

impl GridSource for LeveledGrid {
    reads_alike!();

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes() + self.water.memory_use()
    }

    fn members(&self) -> Vec<PathBuf> {
        self.inner.members()
    }

    hints_go_to!(inner);
}
