//! Snapping of almost identical vertices, before all other steps.
//!
//! Features are snapped as they are read, before tiles and arcs. Snapping is greedy and runs tile after tile:
//! fixed vertices near a border are anchors for later tiles, and snapped positions are spooled in input order.
//! Damage by snapping cannot be repaired by keeping more vertices; it is counted by comparing the segments that
//! meet before and after, and reported.

use std::cmp::Ordering;
use std::path::Path;

use super::kept_bits::TileCursors;
use terrane_base::error::Result;
use terrane_base::geom::plane::{area_sign, key};
use terrane_engine::Cancel;
use terrane_files::Buckets;
use terrane_line::tiles::{LastTile, VertexQuadtree};
use terrane_line::{Xy, arcs};
use terrane_vector::Geometry;

/// Snapped positions.
#[derive(Default)]
pub(super) struct VertexMoves {
    pub(super) snapped: Option<SnappedPositions>,
}

impl VertexMoves {
    /// Restarts at the first feature.
    pub(super) fn restart(&mut self) {
        if let Some(snapped) = &mut self.snapped {
            snapped.cursors = TileCursors::new(snapped.quadtree.count());
        }
    }

    /// Whether snapping is off.
    pub(super) fn is_none(&self) -> bool {
        self.snapped.is_none()
    }

    /// Next geometry after snapping; `None` if no vertex moves.
    pub(super) fn apply(&mut self, geometry: &Geometry) -> Result<Option<Geometry>> {
        let Some(snapped) = &mut self.snapped else { return Ok(None) };
        let mut places = Vec::with_capacity(geometry.vertices());
        geometry.parts().for_each(|part| places.extend_from_slice(part.xy));
        places.iter_mut().try_for_each(|at| snapped.next(at))?;
        let mut moved = geometry.clone();
        moved.place_parts(&mut places.into_iter());
        Ok(Some(moved))
    }

    /// Memory in bytes.
    pub(super) fn memory_use(&self) -> u64 {
        self.snapped.as_ref().map_or(0, |snapped| snapped.places.memory_use())
    }
}

/// Largest share of memory for snapped positions.
pub(super) fn max_held(memory: u64) -> u64 {
    memory / 16
}

/// Snapped positions of each tile in input order.
pub(super) struct SnappedPositions {
    quadtree: VertexQuadtree,
    places: Buckets<Xy>,
    cursors: TileCursors<Xy>,
    place: LastTile,
}

impl SnappedPositions {
    /// Snaps all vertices tile after tile: vertices fixed in one tile are not moved by later ones, so no two
    /// positions closer than `distance` are left, and no vertex moves farther. Within a tile the rule is
    /// [`arcs::snap`].
    pub(super) fn new(
        old: Buckets<Xy>,
        quadtree: VertexQuadtree,
        distance: f64,
        folder: &Path,
        memory: u64,
        cancel: &Cancel,
    ) -> Result<Self> {
        let count = quadtree.count();
        let places = Buckets::new(folder, count, max_held(memory));
        let stayed = Buckets::new(folder, count, memory / 16);
        let (mut before, mut near) = (Vec::new(), Vec::new());
        for tile in 0..count {
            cancel.check()?;
            before.clear();
            old.read(tile, |run| before.extend_from_slice(run))?;
            old.forget(tile);
            let mut anchors: Vec<Xy> = Vec::new();
            stayed.read(tile, |run| anchors.extend_from_slice(run))?;
            stayed.forget(tile);
            let mut after = before.clone();
            arcs::snap(&mut after, &anchors, distance)?;
            places.push(tile, &after)?;
            for (p, _) in before.iter().zip(&after).filter(|(p, q)| p == q) {
                if quadtree.count() > 1 {
                    quadtree.around(*p, distance, &mut near);
                }
                let mut later = near.iter().filter(|other| **other as usize > tile);
                later.try_for_each(|other| stayed.push(*other as usize, &[*p]))?;
            }
        }
        Ok(Self { cursors: TileCursors::new(count), quadtree, places, place: LastTile::default() })
    }

    /// Moves the next vertex.
    fn next(&mut self, at: &mut Xy) -> Result<()> {
        let tile = self.quadtree.of(*at, &mut self.place).unwrap_or_default();
        if let Some(place) = self.cursors.next(&self.places, tile as usize)? {
            *at = place;
        }
        Ok(())
    }
}

/// Effects of snapping on rings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RingDamage {
    /// Rings that changed orientation or lost their area.
    pub(super) rings: u64,
    /// Features whose rings touch themselves or each other only after snapping.
    pub(super) touching: u64,
}

impl RingDamage {
    /// Adds the changes of a geometry.
    pub(super) fn add(&mut self, before: &Geometry, after: &Geometry) {
        let pairs = before.parts().zip(after.parts()).filter(|(part, _)| part.is_ring());
        let changed = pairs.filter(|(old, new)| {
            let sign = area_sign(old.xy.iter().copied());
            sign != Ordering::Equal && sign != area_sign(new.xy.iter().copied())
        });
        self.rings += changed.count() as u64;
        self.touching += u64::from(touches_anew(before, after));
    }
}

/// Whether rings now pass a position several times at vertices that were distinct.
fn touches_anew(before: &Geometry, after: &Geometry) -> bool {
    // Position of each vertex, number of its run of equal positions, and original position.
    let mut all: Vec<([u64; 2], usize, [u64; 2])> = Vec::new();
    let mut passage = 0_usize;
    for (old, new) in before.parts().zip(after.parts()).filter(|(part, _)| part.is_ring()) {
        let open = new.xy.len().saturating_sub(1);
        let own = all.len();
        for (old, new) in old.xy.iter().zip(&new.xy[..open]) {
            passage += usize::from(all.last().is_some_and(|(at, ..)| *at != key(*new)));
            all.push((key(*new), passage, key(*old)));
        }
        // The start may be in the middle of a passage.
        let first = all.get(own).map(|(at, passage, _)| (*at, *passage));
        if let Some((at, first)) = first {
            let last = all[own..].iter_mut().rev();
            last.take_while(|one| one.0 == at).for_each(|one| one.1 = first);
        }
        passage += 1;
    }
    all.sort_unstable();
    all.dedup();
    all.chunk_by(|a, b| a.0 == b.0).any(|place| {
        let passages = place.chunk_by(|a, b| a.1 == b.1).count();
        let mut old: Vec<_> = place.iter().map(|(.., old)| *old).collect();
        old.sort_unstable();
        passages > 1 && old.chunk_by(|a, b| a == b).all(|same| same.len() < passages)
    })
}
