//! Vertices that are nearly one made one, before all else.
//!
//! Snapping is done to features as they are read, before squares and arcs. It is greedy, so it is done
//! square after square: what has stayed near a border is an anchor for squares to come, and where each
//! vertex went is spooled in the order in which the input comes by it. What the moves themselves spoil
//! cannot be mended by keeping more; it is counted, from the segments that meet and what they were
//! before, and told.

use std::cmp::Ordering;
use std::path::Path;

use super::kept::TileCursors;
use terrane_base::error::Result;
use terrane_base::geom::plane::{area_sign, key};
use terrane_engine::Cancel;
use terrane_files::Buckets;
use terrane_line::squares::{LastTile, VertexQuadtree};
use terrane_line::{Xy, arcs};
use terrane_vector::{Geometry, GeometryPart};

/// Where vertices go.
#[derive(Default)]
pub(super) struct VertexMoves {
    pub(super) snapped: Option<SnappedPositions>,
}

impl VertexMoves {
    /// Begins with the first feature again.
    pub(super) fn restart(&mut self) {
        if let Some(snapped) = &mut self.snapped {
            snapped.cursors = TileCursors::new(snapped.squares.count());
        }
    }

    /// Whether vertices stay where they are.
    pub(super) fn is_none(&self) -> bool {
        self.snapped.is_none()
    }

    /// The next geometry with its vertices where they go; `None` where none is moved.
    pub(super) fn apply(&mut self, geometry: &Geometry) -> Result<Option<Geometry>> {
        let Some(snapped) = &mut self.snapped else { return Ok(None) };
        let mut places = Vec::with_capacity(geometry.vertices());
        geometry.parts().for_each(|part| places.extend_from_slice(part.xy));
        places.iter_mut().try_for_each(|at| snapped.next(at))?;
        let mut moved = geometry.clone();
        moved.place_parts(&mut places.into_iter());
        Ok(Some(moved))
    }

    /// Bytes in memory.
    pub(super) fn held(&self) -> u64 {
        self.snapped.as_ref().map_or(0, |snapped| snapped.places.held())
    }
}

/// Most bytes of the positions after snapping that are held of so much memory.
pub(super) fn most_held(memory: u64) -> u64 {
    memory / 16
}

/// Positions after snapping: of each square in the order in which the input comes by them.
pub(super) struct SnappedPositions {
    squares: VertexQuadtree,
    places: Buckets<Xy>,
    cursors: TileCursors<Xy>,
    place: LastTile,
}

impl SnappedPositions {
    /// Snaps all vertices, sorted by square, square after square: what has stayed in one is not moved by those to come, so
    /// in all of them no two positions are left that are nearer than `distance`, and none has moved
    /// farther. In a square the rule is that of [`arcs::snap`].
    pub(super) fn new(
        old: Buckets<Xy>,
        squares: VertexQuadtree,
        distance: f64,
        (folder, memory): (&Path, u64),
        cancel: &Cancel,
    ) -> Result<Self> {
        let count = squares.count();
        let places = Buckets::new(folder, count, most_held(memory));
        let stayed = Buckets::new(folder, count, memory / 16);
        let (mut before, mut near) = (Vec::new(), Vec::new());
        for square in 0..count {
            cancel.check()?;
            before.clear();
            old.read(square, |run| before.extend_from_slice(run))?;
            old.forget(square);
            let mut anchors: Vec<Xy> = Vec::new();
            stayed.read(square, |run| anchors.extend_from_slice(run))?;
            stayed.forget(square);
            let mut after = before.clone();
            arcs::snap(&mut after, &anchors, distance)?;
            places.push(square, &after)?;
            for (p, _) in before.iter().zip(&after).filter(|(p, q)| p == q) {
                if squares.count() > 1 {
                    squares.around(*p, distance, &mut near);
                }
                let mut later = near.iter().filter(|other| **other as usize > square);
                later.try_for_each(|other| stayed.push(*other as usize, &[*p]))?;
            }
        }
        Ok(Self { cursors: TileCursors::new(count), squares, places, place: LastTile::default() })
    }

    /// Moves the next vertex.
    fn next(&mut self, at: &mut Xy) -> Result<()> {
        let square = self.squares.of(*at, &mut self.place).unwrap_or_default();
        if let Some(place) = self.cursors.next(&self.places, square as usize)? {
            *at = place;
        }
        Ok(())
    }
}

/// What moving vertices has done to rings.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RingDamage {
    /// Rings that have turned over, or lost their area.
    pub(super) rings: u64,
    /// Features whose rings touch themselves or each other where they did not.
    pub(super) touching: u64,
}

impl RingDamage {
    /// Adds what has happened to a geometry.
    pub(super) fn add(&mut self, before: &Geometry, after: &Geometry) {
        let pairs = before.parts().zip(after.parts()).filter(|(part, _)| part.is_ring());
        let sign = |part: &GeometryPart<'_>| area_sign(part.xy.iter().copied());
        let is_lost = |(old, new): &(GeometryPart<'_>, GeometryPart<'_>)| {
            let then = sign(old);
            then != Ordering::Equal && then != sign(new)
        };
        self.rings += pairs.filter(is_lost).count() as u64;
        self.touching += u64::from(touches_anew(before, after));
    }
}

/// Whether rings come by a position several times now that did not all come by one position before.
fn touches_anew(before: &Geometry, after: &Geometry) -> bool {
    // Where each vertex is, how often its rings have moved on since the first one, and where it was.
    let mut all: Vec<([u64; 2], usize, [u64; 2])> = Vec::new();
    let mut passage = 0_usize;
    for (old, new) in before.parts().zip(after.parts()).filter(|(part, _)| part.is_ring()) {
        let open = new.xy.len().saturating_sub(1);
        let own = all.len();
        for (old, new) in old.xy.iter().zip(&new.xy[..open]) {
            passage += usize::from(all.last().is_some_and(|(at, ..)| *at != key(*new)));
            all.push((key(*new), passage, key(*old)));
        }
        // Where it begins it may be in the middle of a passage.
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
