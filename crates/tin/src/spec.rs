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

/// Specification of a tile or patch.
#[derive(Clone, Copy, Debug)]
pub struct TinSpec {
    /// Maximum vertical distance of a valid sample, in height units.
    pub tolerance: f64,
    /// Where the tolerance holds: at samples, or along the grid lines between them as well.
    pub bound: ErrorBound,
    /// One global maximum at a time with exact full scans (the reference), instead of
    /// adaptive-stride scans.
    pub strict: bool,
    /// Run the drop pass.
    pub drop: bool,
    /// Allow triangles inside a tile that are not Delaunay, if that takes fewer vertices: see
    /// [`reduce_patch`](crate::reduce_patch).
    pub data_dependent: bool,
    /// Allow vertices up to the tolerance above or below their samples, if that takes fewer vertices.
    pub fit_heights: bool,
    /// Rounding of vertex heights for formats that store f32; `None` for f64.
    pub single_precision: Option<HeightQuantization>,
    /// Minimum angle of triangles; `None` for any.
    pub min_angle: Option<MinimumAngle>,
    /// Fill `max_error` and `square_sum` of the triangles.
    pub measure: bool,
}

impl TinSpec {
    /// Distance of anchor vertices. Samples inserted for angles propagate over some triangles from a seam; halving the
    /// distance doubles the number of triangles within a patch. The distance is a power of two: its squares have a
    /// sample at their centre, and so do their quarters, down to the cell. With a distance of 3 one triangle in 100
    /// stayed thin, with 6 one in 5,000.
    pub(super) fn spacing(&self, max: u32) -> u32 {
        if self.min_angle.is_some() { 1 << (max / 2).max(1).ilog2() } else { max }
    }
}

/// A tile to triangulate. The heights include an apron of one sample on each side where the grid continues, because
/// voids next to a rim determine which rim samples must be vertices.
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
    /// Maximum distance of neighbouring anchor vertices; see [`PatchInput::spacing`].
    pub spacing: u32,
    /// Required samples: vertices wherever there is surface, at their own heights, sorted. Both tiles at a border need
    /// the samples on it.
    pub kept: &'a [TilePosition],
    /// Paths that edges follow wherever there is surface; the samples of [`PathStretch::ends`] must be in `kept`.
    pub lines: &'a [PathStretch],
}

impl<'a> TileInput<'a> {
    /// A grid of one tile: no apron, anchor vertices at its corners only, no constraints.
    pub fn alone(heights: HeightWindow<'a>) -> Self {
        let [apron_left, apron_right, apron_above, apron_below] = [0; 4];
        let (spacing, kept, lines) = (u32::MAX, &[], &[]);
        Self { heights, apron_left, apron_right, apron_above, apron_below, spacing, kept, lines }
    }
}

/// A finished tile: positions are relative to the tile's first sample (apron not counted).
#[derive(Clone, Debug, Default)]
pub struct TileMesh {
    /// Triangles of the surface (without cells that have a void corner), in an order that depends on the input alone.
    pub triangles: Vec<TileTriangle>,
    /// Vertices in use, sorted.
    pub vertices: Vec<TilePosition>,
    /// Heights of the vertices.
    pub heights: Vec<f64>,
    /// Valid samples without a valid cell: they have no surface. Counted on the tile's samples except its last column
    /// and row, unless the grid ends there.
    pub isolated: u64,
    /// Valid samples, counted likewise.
    pub valid: u64,
}

impl TileMesh {
    /// Bytes of the mesh of `samples` samples if all are kept.
    pub fn max_bytes(samples: u64) -> u64 {
        let each = 2 * size_of::<TileTriangle>() + size_of::<TilePosition>() + size_of::<f64>();
        samples * each as u64
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        let triangles = self.triangles.capacity() * size_of::<TileTriangle>();
        let vertices = self.vertices.capacity() * size_of::<TilePosition>();
        (triangles + vertices + self.heights.capacity() * size_of::<f64>()) as u64
    }
}

/// A seam patch to mend. Positions are relative to the first sample of a rectangle.
#[derive(Clone, Copy, Debug)]
pub struct PatchInput<'a> {
    /// Heights of a rectangle that contains all triangles, plus one sample on each side where the grid continues (a
    /// void there ends the surface).
    pub heights: HeightWindow<'a>,
    /// Heights of vertices with free heights; the others have those of their samples.
    pub vertices: &'a [(TilePosition, f64)],
    /// The triangles to mend, in any order; should include every triangle with a corner on the seam.
    pub triangles: &'a [TileTriangle],
    /// Column of the vertical rim line; its vertices may be dropped.
    pub seam_col: Option<u32>,
    /// Row of the horizontal rim line.
    pub seam_row: Option<u32>,
    /// True where the grid ends with the rectangle: left, right, above, below.
    pub grid_ends: [bool; 4],
    /// Maximum diameter of circumcircles, as the side of a square with that diagonal. Each tile begins with a lattice
    /// of *anchor vertices* at this distance, and those that keep circles small are not dropped. Changes at a seam
    /// therefore end near it, and a patch can contain them.
    pub spacing: u32,
    /// Samples that stay vertices if they are vertices, at their own heights, sorted.
    pub kept: &'a [TilePosition],
    /// Paths that edges follow.
    pub lines: &'a [PathStretch],
}

/// A mended patch.
#[derive(Clone, Debug, Default)]
pub struct PatchMesh {
    /// The triangles that replace the input triangles.
    pub triangles: Vec<TileTriangle>,
    /// All vertices of the triangles, sorted.
    pub vertices: Vec<TilePosition>,
    /// Heights of the vertices.
    pub heights: Vec<f64>,
    /// The changed triangles on the border of the patch, each rotated so that the edge with surface beyond comes first:
    /// `[from, to, third corner]`. If the triangle beyond is not Delaunay with it, a larger patch would have changed
    /// more.
    pub border: Vec<[TilePosition; 3]>,
    /// Samples beside edges beyond the tolerance that cannot be inserted because of the frozen border: a neighbouring
    /// or larger patch has to mend them. Empty if the tolerance holds at samples only.
    pub left: Vec<TilePosition>,
    /// Number of triangles that still have too small an angle; a neighbouring or larger patch may mend them.
    pub thin: u64,
    /// Number of pairs of neighbouring path vertices without an edge; a larger patch may mend them.
    pub apart: u64,
}
