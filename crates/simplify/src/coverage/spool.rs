//! Runs of parts, and the segments between them, sorted by tile: in memory or in unnamed files.

use std::cmp::Ordering;
use std::path::Path;

use super::tile::TileContent;
use terrane_base::error::Result;
use terrane_files::Buckets;
use terrane_line::Xy;
use terrane_line::tiles::{LastTile, TileRun, VertexQuadtree, cross_overs};
use terrane_vector::GeometryPart;

/// Flags of a run's word beside its number of vertices.
const RING: u32 = 1;
const CUT: u32 = 2;
const WHOLE: u32 = 4;
const FLAGS: u32 = 3;

/// Largest number of vertices of a tile, so that each of its runs fits in a word.
pub(super) const MOST: u64 = (1 << (u32::BITS - FLAGS)) - 1;

/// Contents of the tiles.
pub(super) struct TileSpool<'a> {
    quadtree: &'a VertexQuadtree,
    runs: Buckets<u32>,
    points: Buckets<Xy>,
    /// Heights; empty if distances do not use them.
    heights: Option<Buckets<f64>>,
    /// Segments that cross tile borders, for each tile that they pass.
    obstacles: Buckets<[Xy; 2]>,
    /// Counts by tile.
    counts: Vec<u64>,
    near: Vec<u32>,
}

impl<'a> TileSpool<'a> {
    /// Uses about `memory` bytes, and a file in `folder` for the rest.
    pub(super) fn new(
        quadtree: &'a VertexQuadtree,
        has_z: bool,
        folder: &Path,
        memory: u64,
    ) -> Self {
        let (count, share) = (quadtree.count(), memory / 8);
        Self {
            quadtree,
            runs: Buckets::new(folder, count, share),
            points: Buckets::new(folder, count, 4 * share),
            heights: has_z.then(|| Buckets::new(folder, count, 2 * share)),
            obstacles: Buckets::new(folder, count, share),
            counts: vec![0; count],
            near: Vec::new(),
        }
    }

    /// Adds a part with its runs; a part that stays whole keeps all vertices.
    pub(super) fn push(
        &mut self,
        part: &GeometryPart<'_>,
        runs: &[TileRun],
        stays_whole: bool,
    ) -> Result<()> {
        let is_cut = runs.len() > 1;
        let flags = [(part.is_ring(), RING), (is_cut, CUT), (stays_whole, WHOLE)];
        let flags = flags.iter().map(|(is_so, flag)| u32::from(*is_so) * flag).sum::<u32>();
        let count = part.xy.len() - usize::from(is_cut && part.is_ring());
        for run in runs {
            let tile = run.tile as usize;
            self.runs.push(tile, &[(run.count as u32) << FLAGS | flags])?;
            // A run of a ring may wrap around to its start.
            let end = (run.first + run.count).min(count.max(run.first));
            let again = run.first + run.count - end;
            for range in [run.first..end, 0..again].into_iter().filter(|range| !range.is_empty()) {
                self.points.push(tile, &part.xy[range.clone()])?;
                if let Some(heights) = &self.heights {
                    heights.push(tile, &part.z[range])?;
                }
            }
        }
        for segment in cross_overs(part.xy, part.is_ring(), runs) {
            self.quadtree.meeting(segment, &mut self.near);
            for &tile in &self.near {
                self.obstacles.push(tile as usize, &[segment])?;
                self.counts[tile as usize] += 1;
            }
        }
        Ok(())
    }

    /// Memory in bytes.
    pub(super) fn memory_use(&self) -> u64 {
        let heights = self.heights.as_ref().map_or(0, Buckets::memory_use);
        self.runs.memory_use() + self.points.memory_use() + self.obstacles.memory_use() + heights
    }

    /// Segments that pass a tile, some of them twice.
    pub(super) fn obstacles(&self, tile: usize) -> u64 {
        self.counts[tile]
    }

    /// Takes the contents of a tile.
    pub(super) fn take(&self, tile: usize) -> Result<TileContent> {
        let mut content = TileContent::default();
        let flat = &mut content.flat;
        flat.points.reserve_exact(self.quadtree.vertices(tile) as usize);
        self.points.read(tile, |run| flat.points.extend_from_slice(run))?;
        self.points.forget(tile);
        if let Some(heights) = &self.heights {
            heights.read(tile, |run| flat.z.extend_from_slice(run))?;
            heights.forget(tile);
        }
        self.runs.read(tile, |words| {
            for word in words {
                let count = (word >> FLAGS) as usize;
                let [is_ring, is_cut, is_whole] = [RING, CUT, WHOLE].map(|flag| word & flag != 0);
                flat.end_part(count, is_ring && !is_cut);
                if is_cut {
                    content.cut.push(flat.closed.len() as u32 - 1);
                }
                if is_whole {
                    content.whole.push(flat.closed.len() as u32 - 1);
                }
            }
        })?;
        self.runs.forget(tile);
        self.obstacles.read(tile, |all| content.obstacles.extend(all.iter().map(in_order)))?;
        self.obstacles.forget(tile);
        content.obstacles.sort_unstable_by(by_place);
        content.obstacles.dedup();
        Ok(content)
    }
}

/// A segment from its lower end to its upper end.
fn in_order(segment: &[Xy; 2]) -> [Xy; 2] {
    // Normalizes -0 to 0.
    let [a, b] = segment.map(|p| p.map(|c| c + 0.0));
    if a <= b { [a, b] } else { [b, a] }
}

fn by_place(p: &[Xy; 2], q: &[Xy; 2]) -> Ordering {
    let pairs = p.as_flattened().iter().zip(q.as_flattened());
    pairs.fold(Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
}

/// Fixed points by tile, in the order of the tiles.
pub(super) fn by_tile(points: Vec<Xy>, quadtree: &VertexQuadtree) -> Vec<(u32, Xy)> {
    let mut place = LastTile::default();
    let known = points.into_iter().filter_map(|p| Some((quadtree.of(p, &mut place)?, p)));
    let mut all: Vec<_> = known.collect();
    all.sort_by_key(|(tile, _)| *tile);
    all
}
