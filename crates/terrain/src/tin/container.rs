//! The triangles and vertices kept with one tile.
//!
//! A triangle is kept with the tile that owns the first corner of its bounding box, a vertex with the tile that
//! owns its sample; positions are relative to that tile's first sample. Until the tile is final, its list of
//! vertices may have unused vertices and duplicates. Triangles well inside a tile are stored separately,
//! because seam patches rarely need them.

use bytemuck::{AnyBitPattern, NoUninit, Zeroable};

use super::boxes::{OffsetFrame, PositionShift, SampleBounds, all_bounds, inner_bounds};
use super::layout::{TileId, TileLayout};
use super::patch_region::PatchTriangles;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_files::{SpoolExtent, SpoolFile};
use terrane_tin::{MinimumAngle, TilePosition, TileTriangle, sort_by_position};

/// Part of a mesh, with positions relative to the sample (`col`, `row`) of the grid.
#[derive(Clone, Copy)]
pub(super) struct MeshPiece<'a> {
    pub(super) rect: Rect,
    pub(super) triangles: &'a [TileTriangle],
    pub(super) vertices: &'a [TilePosition],
    pub(super) heights: &'a [f64],
}

/// The triangles and vertices kept with a tile, in memory.
#[derive(Debug, Default)]
pub(super) struct TileContainer {
    /// Triangles near the sides of the tile, and all triangles of seam patches.
    pub(super) triangles: Vec<TileTriangle>,
    /// All other triangles; they share no corner with a triangle of a neighbour.
    pub(super) inner: Vec<TileTriangle>,
    pub(super) vertices: Vec<TilePosition>,
    pub(super) heights: Vec<f64>,
    /// This many vertices from the first are sorted and unique; later ones were added by
    /// neighbours and seam patches.
    sorted: usize,
}

impl TileContainer {
    /// Moves all triangles of `zone` to `out`, relative to its limits.
    pub(super) fn extract(
        &mut self,
        zone: &PatchTriangles,
        tile: TileId,
        layout: &TileLayout,
        out: &mut Vec<TileTriangle>,
    ) {
        let origin = layout.origin(tile);
        let members = zone.seen_from(origin);
        let shift = PositionShift::new(origin, (zone.limits().col, zone.limits().row));
        // Inner triangles are searched only by the few patches that reach so far. All of them move over,
        // because the rest of the container tells near from inner by the list alone.
        if members.touches(&inner_bounds(layout, tile)) {
            self.triangles.append(&mut self.inner);
        }
        self.triangles.retain(|triangle| {
            let is_member = members.contains(triangle);
            if is_member {
                out.push(shift.triangle(triangle));
            }
            !is_member
        });
    }

    /// True when a triangle of `zone` has too small an angle.
    pub(super) fn is_thin_in(
        &self,
        zone: &PatchTriangles,
        tile: TileId,
        layout: &TileLayout,
        bound: &MinimumAngle,
    ) -> bool {
        let members = zone.seen_from(layout.origin(tile));
        let touches_inner = members.touches(&inner_bounds(layout, tile));
        let inner = if touches_inner { &self.inner[..] } else { &[] };
        let mut all = self.triangles.iter().chain(inner);
        all.any(|triangle| !bound.holds(triangle.corners) && members.contains(triangle))
    }

    /// Takes what belongs to `tile` out of a piece of the mesh.
    pub(super) fn insert(&mut self, piece: MeshPiece<'_>, tile: TileId, layout: &TileLayout) {
        let at = (piece.rect.col, piece.rect.row);
        let shift = PositionShift::new(at, layout.origin(tile));
        let owned = OffsetFrame::new(layout.owned(tile), at);
        let members = piece.triangles.iter().filter(|t| owned.contains(first_corner(t)));
        // A piece of the whole tile already has the tile's positions, and its vertices are sorted: they
        // become the sorted part. Seam patches have neither.
        if piece.rect == layout.rect(tile) {
            let inner = inner_bounds(layout, tile);
            for &triangle in members {
                let is_inner = inner.holds(&SampleBounds::of(triangle.corners));
                if is_inner { &mut self.inner } else { &mut self.triangles }.push(triangle);
            }
            self.insert_sorted(piece, owned);
        } else {
            self.triangles.extend(members.map(|t| shift.triangle(t)));
            self.insert_loose(piece, owned, shift);
        }
    }

    /// The triangles that lie in the tile.
    pub(super) fn within(&self, tile: TileId, layout: &TileLayout) -> Vec<TileTriangle> {
        let inside = all_bounds(layout, tile);
        let near = self.triangles.iter().filter(|t| inside.holds(&SampleBounds::of(t.corners)));
        near.chain(&self.inner).copied().collect()
    }

    /// Puts a piece of the whole tile in the place of the triangles that lie in it.
    pub(super) fn replace_within(
        &mut self,
        piece: MeshPiece<'_>,
        tile: TileId,
        layout: &TileLayout,
    ) {
        let inside = all_bounds(layout, tile);
        self.triangles.retain(|t| !inside.holds(&SampleBounds::of(t.corners)));
        self.inner.clear();
        self.insert(piece, tile, layout);
    }

    /// Lists the vertices in `rect` and their heights, relative to it; of one that is listed twice the last is
    /// right.
    pub(super) fn heights_in(
        &self,
        rect: Rect,
        tile: TileId,
        layout: &TileLayout,
        out: &mut Vec<(TilePosition, f64)>,
    ) {
        let origin = layout.origin(tile);
        let (inside, shift) =
            (OffsetFrame::new(rect, origin), PositionShift::new(origin, (rect.col, rect.row)));
        let all = self.vertices.iter().zip(&self.heights);
        out.extend(
            all.filter(|&(&at, _)| inside.contains(at)).map(|(&at, &z)| (shift.apply(at), z)),
        );
    }

    /// Inserts the vertices of the tile before those added by its neighbours, without duplicates.
    fn insert_sorted(&mut self, piece: MeshPiece<'_>, owned: OffsetFrame) {
        let vertices = piece.vertices.iter().zip(piece.heights);
        let of_tile = vertices.filter(|&(&at, _)| owned.contains(at));
        let loose = self.vertices.drain(..).zip(self.heights.drain(..));
        // A neighbour may have been triangulated first and have listed vertices of the shared rim here.
        let loose: Vec<_> =
            loose.filter(|(at, _)| piece.vertices.binary_search(at).is_err()).collect();
        self.sorted = of_tile.clone().count();
        self.vertices
            .extend(of_tile.clone().map(|(&at, _)| at).chain(loose.iter().map(|&(at, _)| at)));
        self.heights.extend(of_tile.map(|(_, &z)| z).chain(loose.iter().map(|&(_, z)| z)));
    }

    /// Appends the vertices that are not among the tile's own, and updates those that are.
    fn insert_loose(&mut self, piece: MeshPiece<'_>, owned: OffsetFrame, shift: PositionShift) {
        for (&at, &height) in piece.vertices.iter().zip(piece.heights) {
            if !owned.contains(at) {
                continue;
            }
            let at = shift.apply(at);
            match self.vertices[..self.sorted].binary_search(&at) {
                // A patch moves free heights, so its height replaces the tile's. In the loose part the later one
                // wins in `settle`.
                Ok(place) => self.heights[place] = height,
                Err(_) => {
                    self.vertices.push(at);
                    self.heights.push(height);
                }
            }
        }
    }

    /// Sorts the vertices and leaves only those that `used` accepts, once each, at their last height.
    pub(super) fn settle(&mut self, used: impl Fn(TilePosition) -> bool) {
        let all = self.vertices.iter().copied().zip(self.heights.iter().copied());
        let mut vertices: Vec<(TilePosition, f64)> =
            all.rev().filter(|&(at, _)| used(at)).collect();
        // The list is reversed and the sort is stable, so of one position the vertex listed last comes first,
        // and `dedup` keeps that one.
        vertices.sort_by_key(|&(at, _)| at);
        vertices.dedup_by_key(|&mut (at, _)| at);
        self.vertices = vertices.iter().map(|&(at, _)| at).collect();
        self.heights = vertices.iter().map(|&(_, height)| height).collect();
        self.sorted = vertices.len();
    }

    /// Takes out all triangles.
    pub(super) fn take_triangles(&mut self) -> Vec<TileTriangle> {
        let mut triangles = std::mem::take(&mut self.triangles);
        triangles.append(&mut std::mem::take(&mut self.inner));
        triangles
    }

    /// Sorts everything into an order that does not depend on the order of insertion.
    pub(super) fn close(&mut self) {
        self.settle(|_| true);
        sort_by_position(&mut self.triangles);
        sort_by_position(&mut self.inner);
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        let triangles = self.triangles.capacity() + self.inner.capacity();
        let triangles = triangles * size_of::<TileTriangle>();
        let vertices = self.vertices.capacity() * size_of::<TilePosition>();
        (triangles + vertices + self.heights.capacity() * size_of::<f64>()) as u64
    }

    /// Writes all to the spool.
    pub(super) fn spill(&self, spool: &SpoolFile) -> Result<SpilledContainer> {
        let extent = spool.put(&self.parts())?;
        let (triangles, inner) = (self.triangles.len(), self.inner.len());
        Ok(SpilledContainer {
            extent,
            triangles,
            inner,
            vertices: self.vertices.len(),
            sorted: self.sorted,
        })
    }

    /// All of a closed container as bytes.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let counts = [self.triangles.len(), self.inner.len(), self.vertices.len()];
        let counts = counts.map(|count| count as u64);
        let mut bytes = bytemuck::cast_slice(&counts).to_vec();
        self.parts().into_iter().for_each(|part| bytes.extend_from_slice(part));
        bytes
    }

    /// The closed container that `bytes` encode; `None` if they are invalid.
    pub(super) fn of_bytes(bytes: &[u8]) -> Option<Self> {
        // Counts are those of a stored file. `take` holds each against the bytes that are left before it
        // allocates.
        let (counts, mut rest) = bytes.split_at_checked(size_of::<[u64; 3]>())?;
        let [triangles, inner, vertices]: [u64; 3] = bytemuck::pod_read_unaligned(counts);
        let container = Self {
            triangles: take(&mut rest, triangles)?,
            inner: take(&mut rest, inner)?,
            vertices: take(&mut rest, vertices)?,
            heights: take(&mut rest, vertices)?,
            sorted: vertices as usize,
        };
        rest.is_empty().then_some(container)
    }

    fn parts(&self) -> [&[u8]; 4] {
        [
            bytemuck::cast_slice(&self.triangles),
            bytemuck::cast_slice(&self.inner),
            bytemuck::cast_slice(&self.vertices),
            bytemuck::cast_slice(&self.heights),
        ]
    }
}

/// Takes `count` items off the front of `bytes`, if there are enough.
fn take<T: AnyBitPattern + NoUninit>(bytes: &mut &[u8], count: u64) -> Option<Vec<T>> {
    let len = usize::try_from(count).ok()?.checked_mul(size_of::<T>())?;
    let (items, rest) = bytes.split_at_checked(len)?;
    *bytes = rest;
    Some(bytemuck::allocation::pod_collect_to_vec(items))
}

/// A container in the spool.
#[derive(Debug)]
pub(super) struct SpilledContainer {
    pub(super) extent: SpoolExtent,
    triangles: usize,
    inner: usize,
    vertices: usize,
    sorted: usize,
}

impl SpilledContainer {
    /// Number of vertices.
    pub(super) fn vertices(&self) -> usize {
        self.vertices
    }

    /// Reads the container back and frees its space.
    pub(super) fn load(self, spool: &SpoolFile) -> Result<TileContainer> {
        let mut triangles = vec![TileTriangle::zeroed(); self.triangles];
        let mut inner = vec![TileTriangle::zeroed(); self.inner];
        let mut vertices = vec![TilePosition::zeroed(); self.vertices];
        let mut heights = vec![0.0; self.vertices];
        let mut parts: [&mut [u8]; 4] = [
            bytemuck::cast_slice_mut::<TileTriangle, u8>(&mut triangles),
            bytemuck::cast_slice_mut::<TileTriangle, u8>(&mut inner),
            bytemuck::cast_slice_mut::<TilePosition, u8>(&mut vertices),
            bytemuck::cast_slice_mut::<f64, u8>(&mut heights),
        ];
        spool.take(self.extent, &mut parts)?;
        Ok(TileContainer { triangles, inner, vertices, heights, sorted: self.sorted })
    }
}

/// The first corner of a triangle's bounding box.
fn first_corner(triangle: &TileTriangle) -> TilePosition {
    let [a, b, c] = triangle.corners;
    TilePosition::new(a.col().min(b.col()).min(c.col()), a.row().min(b.row()).min(c.row()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tin::layout::SeamKind;

    fn triangle(corners: [(u32, u32); 3]) -> TileTriangle {
        let corners = corners.map(|(col, row)| TilePosition::new(col, row));
        TileTriangle { corners, max_error: 1.0, square_sum: 2.0 }
    }

    #[test]
    fn a_piece_is_divided_among_owners_and_found_again() {
        let layout = TileLayout::new(257, 129, 128).unwrap();
        let (left, right) = (TileId::new(0, 0), TileId::new(0, 1));
        let zone = PatchTriangles::new(&layout, SeamKind::Vertical, left, 64, 0);
        let triangles = [
            triangle([(0, 0), (127, 0), (64, 9)]),
            triangle([(64, 1), (65, 1), (64, 90)]),
            triangle([(20, 50), (21, 50), (22, 60)]),
        ];
        let mut vertices: Vec<TilePosition> = triangles.iter().flat_map(|t| t.corners).collect();
        vertices.sort();
        let heights: Vec<f64> = vertices.iter().map(|at| f64::from(at.col())).collect();
        let rect = zone.limits();
        let piece =
            MeshPiece { rect, triangles: &triangles, vertices: &vertices, heights: &heights };
        let mut found = Vec::new();
        let mut counts = Vec::new();
        for tile in [left, right] {
            let mut container = TileContainer::default();
            container.insert(piece, tile, &layout);
            counts.push((container.triangles.len(), container.vertices.len()));
            container.extract(&zone, tile, &layout, &mut found);
            assert!(container.triangles.is_empty());
        }
        assert_eq!(counts, [(2, 4), (1, 5)]);
        found.sort_by_key(|t| t.corners);
        assert_eq!(found.len(), 3);
        assert!(triangles.iter().all(|t| found.contains(t)));
    }

    #[test]
    fn inner_triangles_are_found_when_a_zone_reaches_them() {
        let layout = TileLayout::new(257, 129, 128).unwrap();
        let tile = TileId::new(0, 0);
        let triangles =
            [triangle([(70, 50), (80, 50), (75, 60)]), triangle([(110, 50), (120, 50), (115, 60)])];
        let rect = layout.rect(tile);
        let piece = MeshPiece { rect, triangles: &triangles, vertices: &[], heights: &[] };
        let mut container = TileContainer::default();
        container.insert(piece, tile, &layout);
        assert_eq!((container.inner.len(), container.triangles.len()), (1, 1));
        for (reach, taken) in [(8, 1), (32, 1), (60, 2)] {
            let mut found = Vec::new();
            let zone = PatchTriangles::new(&layout, SeamKind::Vertical, tile, reach, 0);
            container.extract(&zone, tile, &layout, &mut found);
            assert_eq!(found.len(), if reach == 32 { 0 } else { taken.min(1) }, "reach {reach}");
        }
    }

    #[test]
    fn spilled_and_loaded_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let spool = SpoolFile::new(folder.path());
        let container = TileContainer {
            triangles: vec![triangle([(0, 0), (1, 0), (0, 1)])],
            inner: vec![triangle([(5, 5), (9, 5), (6, 7)])],
            vertices: vec![
                TilePosition::new(0, 0),
                TilePosition::new(1, 0),
                TilePosition::new(0, 1),
            ],
            heights: vec![1.5, 2.5, -3.5],
            sorted: 2,
        };
        let loaded = container.spill(&spool).unwrap().load(&spool).unwrap();
        assert_eq!(loaded.triangles, container.triangles);
        assert_eq!(loaded.inner, container.inner);
        assert_eq!(loaded.vertices, container.vertices);
        assert_eq!((loaded.heights, loaded.sorted), (container.heights, 2));
    }

    #[test]
    fn a_closed_container_comes_back_from_its_bytes_and_from_no_others() {
        let at = |col| TilePosition::new(col, 3);
        let mut container = TileContainer {
            triangles: [7, 2].map(|col| triangle([(col, 0), (col + 1, 0), (0, 9)])).to_vec(),
            inner: vec![triangle([(5, 5), (9, 5), (6, 7)])],
            vertices: vec![at(4), at(1), at(4)],
            heights: vec![0.5, 2.5, 0.5],
            sorted: 0,
        };
        container.close();
        assert_eq!(
            (&container.vertices[..], &container.heights[..]),
            (&[at(1), at(4)][..], &[2.5, 0.5][..])
        );
        assert!(container.triangles[0].corners < container.triangles[1].corners);
        let mut bytes = container.to_bytes();
        let back = TileContainer::of_bytes(&bytes).unwrap();
        assert_eq!((back.triangles, back.inner), (container.triangles, container.inner));
        assert_eq!(
            (back.vertices, back.heights, back.sorted),
            (container.vertices, container.heights, 2)
        );
        assert!((0..bytes.len()).all(|len| TileContainer::of_bytes(&bytes[..len]).is_none()));
        bytes[7] = 0xff;
        assert!(TileContainer::of_bytes(&bytes).is_none());
    }
}
