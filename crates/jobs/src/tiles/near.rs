//! Tiles that are made of samples read once.

use std::path::Path;

use super::folder::Folder;
use super::{APRON, Ground, REGION, glance};
use crate::Cancel;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_tiles::{Bounds, Patch, TileId, build};

/// Most samples of a region, with those around it.
const MOST_SAMPLES: u64 = {
    let side = REGION as u64 + 2 * APRON as u64 + 4;
    side * side
};
/// Bytes that a worker takes: the samples of a region, and the points of a tile with what is kept of each.
pub(super) const WORKER_BYTES: u64 = MOST_SAMPLES * 8 + (24 << 20);

impl Ground<'_> {
    /// Makes a region and all tiles that it is divided into.
    pub(super) fn region(&self, id: TileId, folder: &Folder, cancel: &Cancel) -> Result<()> {
        let rect = self.rect(&id.bounds());
        if rect.is_empty() {
            return Ok(());
        }
        if rect.len() as u64 > MOST_SAMPLES {
            return Err(Error::unsupported(
                "has samples that are too near to each other for tiles",
            )
            .in_file(Path::new(&self.place.name))
            .remedy("take a part of it, or a coarser grid"));
        }
        let mut heights = Vec::new();
        glance::read(self.grid, &self.place, rect, &mut heights)?;
        let fill = self.overview.voids();
        let patch = Patch::new(&heights, rect, self.place.whole, self.place.map, fill);
        match usize::from(id.level) < self.levels.len() {
            true => self.descend(id, &patch, folder, cancel)?,
            // All tiles are larger, and only have to know of it.
            false if patch.holds_any(&id.bounds()) => folder.note(id),
            false => (),
        }
        self.grid.copied(rect);
        Ok(())
    }

    /// The samples in a rectangle, and some around it.
    fn rect(&self, bounds: &Bounds) -> Rect {
        let corners = [[bounds.west, bounds.north], [bounds.east, bounds.south]];
        let [a, b] = corners.map(|[lon, lat]| self.place.map.invert(lon, lat));
        let [cols, rows] = [0, 1].map(|axis: usize| {
            let whole = f64::from(self.place.whole[axis]);
            let low = a[axis].min(b[axis]).floor() - f64::from(APRON);
            let high = a[axis].max(b[axis]).ceil() + f64::from(APRON) + 1.0;
            [low, high].map(|at| at.clamp(0.0, whole) as u32)
        });
        Rect::new(cols[0], rows[0], cols[1] - cols[0], rows[1] - rows[0])
    }

    fn descend(
        &self,
        id: TileId,
        patch: &Patch<'_>,
        folder: &Folder,
        cancel: &Cancel,
    ) -> Result<()> {
        cancel.check()?;
        if !patch.holds_any(&id.bounds()) {
            return Ok(());
        }
        folder.note(id);
        if usize::from(id.level) + 1 < self.levels.len() {
            let children = id.children();
            children
                .into_iter()
                .try_for_each(|child| self.descend(child, patch, folder, cancel))?;
        }
        let level = self.level(id);
        folder.put(&build(id, level, patch)?, level, patch)
    }
}
