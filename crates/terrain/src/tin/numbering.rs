//! Vertices in use, their ids, and triangles by id.
//!
//! A vertex belongs to the tile that owns its sample. Ids count tile by tile in row-by-row order,
//! and by position (row, column) within a tile, so an id is the tile's first id plus the vertex's
//! rank: the number of marked samples before it.

use super::boxes::PositionShift;
use super::container::TileContainer;
use super::layout::{TileId, TileLayout};
use super::writer::TileFaces;
use terrane_base::bits::BitSet;
use terrane_base::geom::{Affine, Point3, Rect};
use terrane_tin::{TilePosition, TileTriangle, sort_by_position};

/// The samples of one tile that are vertices in use: one bit each.
#[derive(Default)]
pub(super) struct VertexFlags {
    bits: BitSet,
    owned: Option<Rect>,
    count: u64,
}

impl VertexFlags {
    /// Clears all marks; from now on they are for the samples of `owned`.
    pub(super) fn reset(&mut self, owned: Rect) {
        self.bits.reset(owned.len());
        (self.owned, self.count) = (Some(owned), 0);
    }

    /// Marks the corners of `triangles`, which are relative to `origin` (column, row).
    pub(super) fn mark(&mut self, triangles: &[TileTriangle], origin: (u32, u32)) {
        let Some(owned) = self.owned else { return };
        // Corners left of the tile or above it wrap to numbers beyond any width, so one comparison a side
        // is enough.
        let (left, above) = (owned.col.wrapping_sub(origin.0), owned.row.wrapping_sub(origin.1));
        for at in triangles.iter().flat_map(|triangle| triangle.corners) {
            let (col, row) = (at.col().wrapping_sub(left), at.row().wrapping_sub(above));
            if col < owned.width && row < owned.height {
                let at = row as usize * owned.width as usize + col as usize;
                self.count += u64::from(self.bits.insert(at));
            }
        }
    }

    /// True when the tile's sample `at` is marked.
    pub(super) fn contains(&self, at: TilePosition) -> bool {
        let width = self.owned.map_or(0, |owned| owned.width as usize);
        self.bits.contains(at.row() as usize * width + at.col() as usize)
    }

    /// Number of marked samples.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Bytes held at most for a tile of `cells` x `cells`.
    pub(super) fn bytes(cells: u32) -> u64 {
        u64::from(cells + 1).pow(2) / 8 + 8
    }
}

/// World positions of a tile's vertices.
pub(super) fn positions(
    container: &TileContainer,
    origin: (u32, u32),
    to_world: &Affine,
) -> Vec<Point3> {
    let all = container.vertices.iter().zip(&container.heights);
    all.map(|(&at, &height)| position(at, height, origin, to_world)).collect()
}

fn position(at: TilePosition, height: f64, origin: (u32, u32), to_world: &Affine) -> Point3 {
    let (col, row) = (origin.0 + at.col(), origin.1 + at.row());
    let [x, y] = to_world.apply(f64::from(col), f64::from(row));
    [x, y, height]
}

/// The numbered vertices of one tile, ready to be looked up.
#[derive(Default)]
pub(super) struct VertexRanks {
    first_id: u64,
    /// Samples from one row to the next.
    pitch: usize,
    /// One bit a sample, set where it is a vertex.
    bits: BitSet,
    /// Vertices before each word of `bits`.
    before: Vec<u32>,
    /// Copies for [`VertexLookup::faces`] with corners; else empty.
    vertices: Vec<TilePosition>,
    heights: Vec<f64>,
}

impl VertexRanks {
    /// Takes over a settled container of the tile that owns `owned`, whose first vertex has id
    /// `first_id`.
    pub(super) fn fill(
        &mut self,
        container: &TileContainer,
        owned: Rect,
        first_id: u64,
        with_corners: bool,
    ) {
        (self.first_id, self.pitch) = (first_id, owned.width as usize);
        self.bits.reset(owned.len());
        for &at in &container.vertices {
            self.bits.insert(at.row() as usize * self.pitch + at.col() as usize);
        }
        let mut count = 0;
        self.before.extend(self.bits.words().iter().map(|word| {
            count += word.count_ones();
            count - word.count_ones()
        }));
        if with_corners {
            self.vertices.clone_from(&container.vertices);
            self.heights.clone_from(&container.heights);
        }
    }

    /// Forgets all vertices.
    fn clear(&mut self) {
        self.bits.reset(0);
        self.before.clear();
        self.vertices.clear();
        self.heights.clear();
    }

    /// Rank of the vertex at `at`.
    fn rank(&self, at: TilePosition) -> Option<usize> {
        let bit = at.row() as usize * self.pitch + at.col() as usize;
        // The mask has all bits up to this one. For bit 63 the shift leaves 0, and 0 - 1 is all ones.
        let below = self.bits.words().get(bit / 64)? & (2_u64 << (bit % 64)).wrapping_sub(1);
        let is_vertex = below >> (bit % 64) == 1;
        is_vertex.then(|| (self.before[bit / 64] + below.count_ones()) as usize - 1)
    }

    /// Bytes held at most for a tile of `cells` x `cells`, copies of vertices not counted.
    pub(super) fn bytes(cells: u32) -> u64 {
        u64::from(cells + 1).pow(2) / 64 * 12 + 12
    }
}

/// A vertex by the tile among the four of a lookup, and its rank there.
#[derive(Clone, Copy)]
struct RankedVertex {
    near: usize,
    rank: usize,
}

/// The vertices that the triangles kept with one tile can use: its own, and those of the tiles on
/// the right, below, and below right.
#[derive(Default)]
pub(super) struct VertexLookup {
    near: [VertexRanks; 4],
    origins: [(u32, u32); 4],
    /// Columns and rows the first tile owns.
    owned: (u32, u32),
}

impl VertexLookup {
    /// Starts a lookup for the triangles of `tile`; returns where to fill in the vertices of each
    /// tile concerned.
    pub(super) fn begin<'a>(
        &'a mut self,
        layout: &'a TileLayout,
        tile: TileId,
    ) -> impl Iterator<Item = (TileId, &'a mut VertexRanks)> {
        let owned = layout.owned(tile);
        self.owned = (owned.width, owned.height);
        let steps = [(0, 0), (0, 1), (1, 0), (1, 1)];
        self.near.iter_mut().zip(&mut self.origins).zip(steps).filter_map(
            move |((ranks, origin), (rows, cols))| {
                ranks.clear();
                let near = layout.step(tile, rows, cols)?;
                *origin = layout.origin(near);
                Some((near, ranks))
            },
        )
    }

    /// Bytes that [`faces`](Self::faces) takes for `triangles`: the input, a sorted copy, and the result.
    pub(super) fn bytes(triangles: usize, with_corners: bool) -> u64 {
        let corners = if with_corners { size_of::<[Point3; 3]>() } else { 0 };
        (triangles * (2 * size_of::<TileTriangle>() + size_of::<[u64; 3]>() + corners)) as u64
    }

    /// The vertex at `at`, relative to the first tile.
    fn find(&self, at: TilePosition) -> Option<RankedVertex> {
        let right = usize::from(at.col() >= self.owned.0);
        let below = usize::from(at.row() >= self.owned.1);
        let near = 2 * below + right;
        let there = if near == 0 { at } else { self.shift(near).apply(at) };
        Some(RankedVertex { near, rank: self.near[near].rank(there)? })
    }

    fn shift(&self, near: usize) -> PositionShift {
        PositionShift::new(self.origins[0], self.origins[near])
    }

    fn id(&self, vertex: RankedVertex) -> u64 {
        self.near[vertex.near].first_id + vertex.rank as u64
    }

    fn position(&self, RankedVertex { near, rank }: RankedVertex, to_world: &Affine) -> Point3 {
        let ranks = &self.near[near];
        position(ranks.vertices[rank], ranks.heights[rank], self.origins[near], to_world)
    }

    /// Sorts the triangles of the tile and gives them ids, counter-clockwise seen from above.
    /// `None` when a corner is not a vertex, which cannot be.
    pub(super) fn faces(
        &self,
        mut triangles: Vec<TileTriangle>,
        to_world: &Affine,
        with_corners: bool,
    ) -> Option<TileFaces> {
        sort_by_position(&mut triangles);
        // Rows of a north-up grid run south: its transform mirrors, which turns corners clockwise.
        let flip = to_world.determinant() < 0.0;
        let mut faces = TileFaces::default();
        faces.ids.reserve_exact(triangles.len());
        for triangle in &triangles {
            let [a, b, c] = triangle.corners;
            let corners = if flip { [a, c, b] } else { [a, b, c] };
            let vertices = [self.find(corners[0])?, self.find(corners[1])?, self.find(corners[2])?];
            faces.ids.push(vertices.map(|vertex| self.id(vertex)));
            if with_corners {
                faces.corners.push(vertices.map(|vertex| self.position(vertex, to_world)));
            }
            faces.max_error = faces.max_error.max(triangle.max_error);
            // Added in the sorted order: a sum of floats depends on it, and the report must not depend on
            // which patch came first.
            faces.square_sum += f64::from(triangle.square_sum);
        }
        Some(faces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranks(positions: &[(u32, u32)], first_id: u64) -> VertexRanks {
        let mut container = TileContainer::default();
        container.vertices =
            positions.iter().map(|&(col, row)| TilePosition::new(col, row)).collect();
        container.heights = vec![0.0; positions.len()];
        let mut ranks = VertexRanks::default();
        ranks.fill(&container, Rect::new(0, 0, 10, 7), first_id, false);
        ranks
    }

    #[test]
    fn ranks_follow_rows_and_columns() {
        let ranks = ranks(&[(3, 0), (9, 0), (1, 4), (7, 4), (8, 4)], 10);
        let found = |col, row| ranks.rank(TilePosition::new(col, row));
        assert_eq!(found(3, 0), Some(0));
        assert_eq!(found(9, 0), Some(1));
        assert_eq!(found(1, 4), Some(2));
        assert_eq!(found(8, 4), Some(4));
        for (col, row) in [(2, 0), (3, 1), (9, 4), (1, 5), (9, 6), (0, 9)] {
            assert_eq!(found(col, row), None);
        }
    }

    #[test]
    fn marks_count_each_owned_sample_once() {
        let mut marks = VertexFlags::default();
        marks.reset(Rect::new(16, 16, 16, 16));
        let corners = [(15, 15), (16, 17), (31, 31)].map(|(col, row)| TilePosition::new(col, row));
        let triangle = TileTriangle { corners, max_error: 0.0, square_sum: 0.0 };
        marks.mark(&[triangle, triangle], (0, 0));
        assert_eq!(marks.count(), 2);
        assert!(
            marks.contains(TilePosition::new(0, 1)) && marks.contains(TilePosition::new(15, 15))
        );
        assert!(!marks.contains(TilePosition::new(1, 0)));
    }
}
