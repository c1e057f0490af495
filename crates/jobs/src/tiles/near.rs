//! Tiles that are made of samples read once.

use super::division::REGION;
use super::folder::Made;
use super::spans::Known;
use super::{APRON, Ground};
use crate::Cancel;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_tiles::{Bounds, Patch, TileId, build};

/// Bytes that a worker takes: the samples of a region, and the points of a tile with what is kept of each.
pub(super) const WORKER_BYTES: u64 = {
    let side = REGION as u64 + 2 * APRON as u64;
    side * side * 8 + (24 << 20)
};

/// Where tiles go, and what was made of a region so far.
struct Descent<'a> {
    patch: &'a Patch<'a>,
    known: Known,
    put: &'a mut dyn FnMut(Made) -> Result<()>,
    cancel: &'a Cancel,
}

impl Ground<'_> {
    /// Makes a region and all tiles that it is divided into, each after those in it.
    pub(super) fn region(
        &self,
        id: TileId,
        put: &mut dyn FnMut(Made) -> Result<()>,
        cancel: &Cancel,
    ) -> Result<()> {
        let (opened, place) = (self.opened, &self.opened.division.place);
        let rect = self.rect(&id.bounds());
        if rect.is_empty() {
            return Ok(());
        }
        let mut heights = Vec::new();
        opened.read(rect, &mut heights)?;
        let fill = self.overview.voids();
        let patch = Patch::new(&heights, rect, place.whole, place.map, fill);
        self.descend(id, &mut Descent { patch: &patch, known: Known::default(), put, cancel })?;
        opened.grid.copied(rect);
        Ok(())
    }

    /// The samples in a rectangle, and some around it.
    fn rect(&self, bounds: &Bounds) -> Rect {
        let place = &self.opened.division.place;
        let corners = [[bounds.west, bounds.north], [bounds.east, bounds.south]];
        let [a, b] = corners.map(|[lon, lat]| place.map.invert(lon, lat));
        let [cols, rows] = [0, 1].map(|axis: usize| {
            let whole = f64::from(place.whole[axis]);
            let low = a[axis].min(b[axis]).floor() - f64::from(APRON);
            let high = a[axis].max(b[axis]).ceil() + f64::from(APRON) + 1.0;
            [low, high].map(|at| at.clamp(0.0, whole) as u32)
        });
        Rect::new(cols[0], rows[0], cols[1] - cols[0], rows[1] - rows[0])
    }

    fn descend(&self, id: TileId, to: &mut Descent<'_>) -> Result<()> {
        to.cancel.check()?;
        if !to.patch.holds_any(&id.bounds()) {
            return Ok(());
        }
        to.known.insert(id);
        if id.level < self.opened.division.last {
            id.children().into_iter().try_for_each(|child| self.descend(child, to))?;
        }
        self.of_level(id).try_for_each(|(format, level)| {
            let tile = build(id, level, to.patch)?;
            (to.put)(Made::new(&tile, self.opened, (format, level), to.patch, &to.known)?)
        })
    }
}
