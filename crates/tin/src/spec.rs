//! The specification of a tile or patch, its input and its result.

use super::angles::MinimumAngle;
use super::breaklines::PathStretch;
use super::heights::HeightWindow;
use super::lattice_position::TilePosition;
use terrane_base::bound::ErrorBound;
use terrane_base::geom::HeightQuantization;

/// A triangle of a finished tile or patch: corners counter-clockwise in (column, row) axes, i.e.
/// `predicates::orient > 0`, starting with the smallest corner.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct TileTriangle {
    /// Corners.
    pub corners: [TilePosition; 3],
    /// Largest error of any sample in it (0 where not measured).
    pub max_error: f32,
    /// Sum of squared errors of the samples it owns (0 where not measured). A sample on an edge is
    /// owned by one of the triangles beside it.
    pub square_sum: f32,
}

/// What a tile or patch has to reach.
#[derive(Clone, Copy, Debug)]
pub struct TinSpec {
    /// Largest allowed vertical distance of a valid sample, in the unit of the heights.
    pub tolerance: f64,
    /// Of what that is promised: of the samples, or of the lines between them too.
    pub bound: ErrorBound,
    /// One global maximum at a time with exact full scans (the reference), instead of
    /// adaptive-stride scans.
    pub strict: bool,
    /// Run the drop pass.
    pub drop: bool,
    /// Triangles need not be Delaunay inside a tile, where that takes fewer vertices: see [`reduce_patch`](crate::reduce_patch).
    pub data_dependent: bool,
    /// Vertices may lie up to the tolerance above or below their samples, where that takes fewer of them.
    pub fit: bool,
    /// Vertex heights are rounded like this, because the output stores no more than f32; `None` where
    /// it stores f64.
    pub single_precision: Option<HeightQuantization>,
    /// What angles triangles may have; `None` for any.
    pub min_angle: Option<MinimumAngle>,
    /// Fill `max_error` and `square_sum` of the triangles.
    pub measure: bool,
}

impl TinSpec {
    /// How far posts are apart. Samples that are inserted for angles go on from a seam for some triangles: there
    /// are twice as many within a patch where posts are half as far apart. And a square whose side is a power of
    /// two has a sample in its middle, and so have its quarters, down to the cell: where posts are 3 apart, one
    /// triangle in 100 was left, and one in 5,000 where they are 6.
    pub(super) fn spacing(&self, most: u32) -> u32 {
        if self.min_angle.is_some() { 1 << (most / 2).max(1).ilog2() } else { most }
    }
}

/// A tile to triangulate. The heights reach one sample beyond the tile on each side where the grid
/// goes on, because voids next to a rim decide which rim samples must be vertices.
#[derive(Clone, Copy, Debug)]
pub struct TileInput<'a> {
    /// Heights of the tile and its apron.
    pub heights: HeightWindow<'a>,
    /// Columns (0 or 1) of apron on the left.
    pub apron_left: u32,
    /// Columns (0 or 1) of apron on the right.
    pub apron_right: u32,
    /// Rows (0 or 1) of apron above (smaller row numbers).
    pub apron_above: u32,
    /// Rows (0 or 1) of apron below.
    pub apron_below: u32,
    /// Farthest that neighbouring posts are apart; see [`PatchInput::spacing`].
    pub spacing: u32,
    /// Samples of the tile that stay vertices wherever there is surface, at the heights they have, sorted. Both
    /// tiles at a border have to be told of those on it.
    pub kept: &'a [TilePosition],
    /// Paths that edges have to follow wherever there is surface; what [`PathStretch::ends`] tells of each has to be
    /// kept.
    pub lines: &'a [PathStretch],
}

impl<'a> TileInput<'a> {
    /// A grid that is one tile: no apron, posts at its corners alone, nothing to keep.
    pub fn alone(heights: HeightWindow<'a>) -> Self {
        let [apron_left, apron_right, apron_above, apron_below] = [0; 4];
        let (spacing, kept, lines) = (u32::MAX, &[], &[]);
        Self { heights, apron_left, apron_right, apron_above, apron_below, spacing, kept, lines }
    }
}

/// A finished tile: positions are relative to the tile's first sample (apron not counted).
#[derive(Clone, Debug, Default)]
pub struct TileMesh {
    /// Triangles of the surface (cells with a void corner are not part of it), in an
    /// order that depends on the input alone.
    pub triangles: Vec<TileTriangle>,
    /// Vertices in use, sorted.
    pub vertices: Vec<TilePosition>,
    /// Heights of the vertices.
    pub heights: Vec<f64>,
    /// Valid samples that touch no valid cell: they have no surface. Counted on the tile's samples
    /// except its last column and row, unless the grid ends there.
    pub isolated: u64,
    /// Valid samples, counted likewise.
    pub valid: u64,
}

impl TileMesh {
    /// Bytes of the mesh of so many samples that keeps all of them.
    pub fn max_bytes(samples: u64) -> u64 {
        let each = 2 * size_of::<TileTriangle>() + size_of::<TilePosition>() + size_of::<f64>();
        samples * each as u64
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let triangles = self.triangles.capacity() * size_of::<TileTriangle>();
        let vertices = self.vertices.capacity() * size_of::<TilePosition>();
        (triangles + vertices + self.heights.capacity() * size_of::<f64>()) as u64
    }
}

/// A seam patch to mend. Positions are relative to the first sample of a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct PatchInput<'a> {
    /// Heights of the rectangle: all triangles lie in it, and one more sample on each side where
    /// the grid goes on (a void there ends the surface).
    pub heights: HeightWindow<'a>,
    /// Heights of vertices of the triangles where they are free; the others have those of their samples.
    pub vertices: &'a [(TilePosition, f64)],
    /// The triangles to mend, in any order; they should hold every triangle with a corner on the
    /// seam.
    pub triangles: &'a [TileTriangle],
    /// Column of the vertical rim line; its vertices may be dropped.
    pub seam_col: Option<u32>,
    /// Row of the horizontal rim line.
    pub seam_row: Option<u32>,
    /// Where the grid ends with the rectangle: left, right, above, below.
    pub grid_ends: [bool; 4],
    /// Circles of triangles are no wider than the diagonal of a square of this side: each tile begins
    /// with a lattice of vertices (*posts*) so far apart, and none is dropped that keeps circles small.
    /// So what happens at a seam ends near it, and a patch can hold all of it.
    pub spacing: u32,
    /// Samples that stay vertices if they are, at the heights they have, sorted.
    pub kept: &'a [TilePosition],
    /// Paths that edges have to follow.
    pub lines: &'a [PathStretch],
}

/// A mended patch.
#[derive(Clone, Debug, Default)]
pub struct PatchMesh {
    /// The triangles that replace those of the input.
    pub triangles: Vec<TileTriangle>,
    /// Every vertex of the triangles, sorted.
    pub vertices: Vec<TilePosition>,
    /// Heights of the vertices.
    pub heights: Vec<f64>,
    /// The changed triangles on the border of the patch, each turned so that the edge beyond which
    /// the surface goes on comes first: `[from, to, third corner]`. Where the triangle beyond is not
    /// Delaunay with it, a larger patch would have changed more.
    pub border: Vec<[TilePosition; 3]>,
    /// Samples between which an edge is beyond the tolerance, and which the frozen border keeps from being
    /// vertices: a neighbouring or larger patch has to mend that. Empty where samples alone are judged.
    pub left: Vec<TilePosition>,
    /// Triangles that have too small an angle still, which a neighbouring or larger patch may mend.
    pub thin: u64,
    /// Pairs of neighbouring vertices on paths that no edge joins still, which a larger patch may mend.
    pub apart: u64,
}
