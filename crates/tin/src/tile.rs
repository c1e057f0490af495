//! One tile: rim and outline vertices, greedy insertion, the drop pass, and the finished mesh.
//!
//! **Anchor vertices.** A patch extends half a tile on each side of its seam, so triangles must be small enough for
//! changes at the seam to stay within it. A tile therefore begins with vertices on a lattice of a quarter of its side,
//! including its rims. The circumcircle of any triangle is then at most as wide as the diagonal of a lattice cell (a
//! larger one would contain an anchor vertex), a triangle is at most a third of a tile, and the triangles that change
//! where two tiles meet lie within a third of a tile of the seam. Anchor vertices are dropped like other vertices,
//! except where a larger circle would result: on land, where triangles are small, none remain; a flat sea keeps sixteen
//! per tile. Outlines of voids need no such care, because a circle through a unit edge from the other side contains no
//! cell of the surface.
//!
//! The reach of insertions beyond that is not bounded, but decays within a few triangles: no edge of 3,000 random
//! meshes with tiles of 16 to 64 cells is non-Delaunay (`TERRANE_MESHES=3000 cargo test --test jobs every_edge`).

use super::breaklines::{self, PathStretch};
use super::crossing::CrossingJudge;
use super::greedy::{WorkLists, fit};
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::measure::owns_by_direction;
use super::mesh::{FixedBorder, LatticeMesh, NONE, TriangleScanState, next};
use super::scan::{self, Scan, measure};
use super::spec::{TileInput, TileMesh, TileTriangle, TinSpec};
use super::surface_bound::{self, BetweenBuffers};
use super::tile_border::{RimRun, SurfaceCells, SurfaceRole, anchors};
use super::tolerance::InsertionCriteria;
use super::{adjust, angles, drop};
use terrane_base::bits::BitSet;
use terrane_base::bound::ErrorBound;
use terrane_base::cancel::Cancel;

/// Buffers of a worker, reused from tile to tile.
#[derive(Debug)]
pub struct TileScratch {
    pub(super) field: HeightField,
    pub(super) mesh: LatticeMesh,
    pub(super) lists: WorkLists,
    pub(super) rounds: BetweenBuffers,
    pub(super) drop: drop::DropScratch,
    pub(super) adjust: adjust::AdjustScratch,
    pub(super) edges: breaklines::PathEdges,
    pub(super) used: BitSet,
    pub(super) scan: Scan,
}

impl Default for TileScratch {
    fn default() -> Self {
        Self {
            field: HeightField::default(),
            mesh: LatticeMesh::default(),
            lists: WorkLists::default(),
            rounds: BetweenBuffers::default(),
            drop: drop::DropScratch::default(),
            adjust: adjust::AdjustScratch::default(),
            edges: breaklines::PathEdges::default(),
            used: BitSet::default(),
            scan: scan::fastest(),
        }
    }
}

impl TileScratch {
    /// Sets a cancellation. The result of a cancelled call is invalid.
    pub fn stop_by(&mut self, cancel: &Cancel) {
        self.field.stop_by(cancel);
    }

    /// Maximum bytes of a worker for a tile of `cells` x `cells` with every sample kept: heights (free or not), 2
    /// triangles of 32 bytes per sample, work lists, and the result.
    pub fn bytes(cells: u32, is_free: bool) -> u64 {
        let samples = u64::from(cells + 1).pow(2);
        HeightField::bytes(cells, is_free) + samples * (2 * 32 + 48 + 2 * 20 + 12)
    }

    /// Additional bytes with breaklines, whatever their number.
    pub fn line_bytes(cells: u32) -> u64 {
        breaklines::PathEdges::bytes(u64::from(cells + 1).pow(2))
    }
}

/// Triangulates a tile so that every sample of its surface is within the tolerance.
///
/// The result is a pure function of the input and `spec`. Expected time is linear in the samples
/// plus the kept vertices times the samples of a scan.
pub fn triangulate_tile(
    input: &TileInput<'_>,
    spec: &TinSpec,
    scratch: &mut TileScratch,
) -> TileMesh {
    let input = &TileInput { spacing: spec.spacing(input.spacing), ..*input };
    let (cols, rows) = (input.cols(), input.rows());
    let window = [input.apron_left, input.apron_above, cols, rows];
    let aprons = [input.apron_left, input.apron_right, input.apron_above, input.apron_below];
    let ends = aprons.map(|apron| apron == 0);
    // Samples on a rim shared with a neighbour are left out of the scan.
    scratch.field.load(&input.heights, window, aprons, spec.single_precision);
    scratch.mesh.reset_to_rectangle(cols - 1, rows - 1);
    let surface = SurfaceCells::new(input);
    let fixed = fixed_vertices(&surface, &scratch.field, spec.tolerance, input);
    insert_all(&mut scratch.mesh, &fixed);
    insert_all(&mut scratch.mesh, &inner_anchors(&surface, &scratch.field, input.spacing));
    scratch.mesh.fixed = FixedBorder::Inside { ends, cells: [cols - 1, rows - 1] };
    if surface.has_voids() {
        mark_outside(&mut scratch.mesh, &surface);
    }
    scratch.drop.limit_circles(input.spacing);
    // Small angles are mended at the end, so drops before need not avoid them. The buffers may come
    // from a patch that set a bound.
    scratch.drop.limit_angles(None);
    scratch.drop.settle(&scratch.field, &fixed);
    if spec.fit_heights {
        loosen(scratch, spec, input.kept);
    }
    refine(scratch, spec);
    if spec.fit_heights {
        even_out(scratch, spec);
    }
    if let Some(bound) = &spec.min_angle {
        let TileScratch { field, mesh, lists, rounds, scan, .. } = scratch;
        let judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
        angles::insert(
            bound,
            mesh,
            |_, _, _| !field.is_stopped(),
            |mesh| bring_within(&judge, mesh, lists, rounds, spec),
        );
    }
    if !input.lines.is_empty() {
        follow(scratch, spec, fixed, input.lines);
    }
    if scratch.field.is_stopped() {
        return TileMesh::default();
    }
    finish(scratch, spec, &surface, ends)
}

/// Inserts the vertices required by breaklines, and drops redundant ones.
fn follow(
    scratch: &mut TileScratch,
    spec: &TinSpec,
    mut fixed: Vec<TilePosition>,
    lines: &[PathStretch],
) {
    let TileScratch { field, mesh, lists, rounds, drop, edges, scan, .. } = scratch;
    let mut judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
    breaklines::follow(
        lines,
        field,
        mesh,
        edges,
        |_, _, _| !field.is_stopped(),
        |mesh| bring_within(&judge, mesh, lists, rounds, spec),
    );
    if !spec.drop {
        return;
    }
    if spec.bound == ErrorBound::Surface {
        judge = judge.and_between(CrossingJudge::new(field, spec.tolerance));
    }
    breaklines::vertices(lines, field, mesh, edges, &mut fixed);
    drop.settle(field, &fixed);
    drop::drop_redundant(&judge, mesh, drop);
}

/// Reduces the tolerance in stages, and moves vertices to minimize errors.
fn loosen(scratch: &mut TileScratch, spec: &TinSpec, kept: &[TilePosition]) {
    scratch.field.free_heights();
    let TileScratch { field, mesh, lists, drop, adjust, scan, .. } = scratch;
    adjust.reset(field, kept);
    for looser in adjust::STAGES {
        let judge = InsertionCriteria::of_samples(field, *scan, looser * spec.tolerance);
        mesh.forget_changes();
        fit(&judge, mesh, lists, false);
        // A star that could not be filled within a larger tolerance cannot be filled unless it changes.
        drop.unsettle_changed(field, mesh);
        drop::drop_redundant(&judge, mesh, drop);
        adjust.mark_changed(field, mesh);
        adjust.sweep(&judge, mesh, spec.tolerance);
        drop.unsettle_moved(field, mesh, adjust);
        mesh.judge_again();
    }
    mesh.forget_changes();
}

/// Moves and drops vertices, within the tolerance, until nothing changes.
fn even_out(scratch: &mut TileScratch, spec: &TinSpec) {
    let TileScratch { field, mesh, drop, adjust, scan, .. } = scratch;
    let mut judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
    if spec.bound == ErrorBound::Surface {
        judge = judge.and_between(CrossingJudge::new(field, spec.tolerance));
    }
    for _ in 0..adjust::ROUNDS {
        adjust.mark_changed(field, mesh);
        mesh.forget_changes();
        if !adjust.sweep(&judge, mesh, spec.tolerance) {
            return;
        }
        drop.unsettle_moved(field, mesh, adjust);
        drop::drop_redundant(&judge, mesh, drop);
    }
}

/// Inserts and drops vertices until the mesh is within the tolerance and has no redundant vertex. The error between
/// samples is mended last: dropping vertices first leaves fewer of them.
fn refine(scratch: &mut TileScratch, spec: &TinSpec) {
    let TileScratch { field, mesh, lists, rounds, drop, scan, .. } = scratch;
    let judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
    fit(&judge, mesh, lists, spec.strict);
    if spec.drop {
        if spec.fit_heights {
            drop.unsettle_changed(field, mesh);
        }
        drop::drop_redundant(&judge, mesh, drop);
    }
    if spec.bound == ErrorBound::Samples {
        return;
    }
    mesh.forget_changes();
    let crossings = CrossingJudge::new(field, spec.tolerance);
    surface_bound::insert(&crossings, mesh, rounds, |mesh| fit(&judge, mesh, lists, spec.strict));
    if spec.drop {
        drop.unsettle_changed(field, mesh);
        drop::drop_redundant(&judge.and_between(crossings), mesh, drop);
    }
}

/// Inserts samples until the mesh is within the tolerance again.
pub(super) fn bring_within(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    lists: &mut WorkLists,
    rounds: &mut BetweenBuffers,
    spec: &TinSpec,
) {
    fit(judge, mesh, lists, spec.strict);
    if spec.bound == ErrorBound::Surface {
        let crossings = CrossingJudge::new(judge.field, spec.tolerance);
        surface_bound::insert(&crossings, mesh, rounds, |mesh| {
            fit(judge, mesh, lists, spec.strict)
        });
    }
}

impl TileInput<'_> {
    /// Columns of the tile's samples, without the apron.
    fn cols(&self) -> u32 {
        self.heights.width - self.apron_left - self.apron_right
    }

    /// Rows of the tile's samples, without the apron.
    fn rows(&self) -> u32 {
        self.heights.height - self.apron_above - self.apron_below
    }
}

/// Rim vertices, outline samples and required samples, sorted.
fn fixed_vertices(
    surface: &SurfaceCells<'_>,
    field: &HeightField,
    tolerance: f64,
    &TileInput { spacing, kept, .. }: &TileInput<'_>,
) -> Vec<TilePosition> {
    let (cols, rows) = (field.width(), field.height());
    let mut fixed = Vec::new();
    for rim in RimRun::sides(cols, rows, spacing) {
        rim.vertices(
            |p| surface.role(p),
            |p| kept.binary_search(&p).is_ok(),
            |p| field.sample(p),
            |p| field.vertex(p),
            tolerance,
            &mut fixed,
        );
    }
    fixed.extend(
        kept.iter()
            .filter(|&&p| matches!(surface.role(p), SurfaceRole::Interior | SurfaceRole::Outline)),
    );
    if surface.has_voids() {
        let inner =
            (1..rows - 1).flat_map(|row| (1..cols - 1).map(move |col| TilePosition::new(col, row)));
        fixed.extend(inner.filter(|&p| surface.role(p) == SurfaceRole::Outline));
    }
    fixed.sort_unstable();
    fixed.dedup();
    fixed
}

/// The anchor vertices that are not on the rim.
fn inner_anchors(
    surface: &SurfaceCells<'_>,
    field: &HeightField,
    spacing: u32,
) -> Vec<TilePosition> {
    let (last_col, last_row) = (field.width() - 1, field.height() - 1);
    let rows = anchors(last_row, spacing).filter(|&row| row > 0 && row < last_row);
    let all = rows.flat_map(|row| {
        let cols = anchors(last_col, spacing).filter(move |&col| col > 0 && col < last_col);
        cols.map(move |col| TilePosition::new(col, row))
    });
    all.filter(|&p| surface.role(p) == SurfaceRole::Interior).collect()
}

fn insert_all(mesh: &mut LatticeMesh, points: &[TilePosition]) {
    let (mut near, mut star) = (0, Vec::new());
    for &p in points {
        let t = mesh.locate(p, near);
        star.clear();
        mesh.insert(t, p, &mut star);
        // Points come sorted, so the next one is near, and the walk is short.
        near = star.first().copied().unwrap_or(t);
    }
}

/// Marks triangles outside the surface. Triangles lie wholly inside or wholly outside, because every unit edge of the
/// outline is an edge of the mesh; testing the cell under a triangle's centre suffices.
fn mark_outside(mesh: &mut LatticeMesh, surface: &SurfaceCells<'_>) {
    for tri in mesh.tris.iter_mut().filter(|tri| tri.state != TriangleScanState::Free) {
        let [a, b, c] = tri.corners;
        let col = (a.col() + b.col() + c.col()) / 3;
        let row = (a.row() + b.row() + c.row()) / 3;
        if !surface.holds_cell(col, row) {
            tri.state = TriangleScanState::Outside;
        }
    }
}

fn finish(
    scratch: &mut TileScratch,
    spec: &TinSpec,
    surface: &SurfaceCells<'_>,
    grid_ends: [bool; 4],
) -> TileMesh {
    let TileScratch { field, mesh, used, .. } = scratch;
    let triangles = Vec::with_capacity(mesh.tris.len());
    let mut result = TileMesh { triangles, ..TileMesh::default() };
    for (round, id) in mesh.ids().enumerate() {
        if field.is_stopped_in(round) {
            return TileMesh::default();
        }
        let tri = &mesh.tris[id as usize];
        if tri.state == TriangleScanState::Outside {
            continue;
        }
        let (max_error, square_sum) = if spec.measure {
            let owned = [0, 1, 2].map(|edge| owns_edge(mesh, id, edge, field, grid_ends));
            measure(field, tri.corners, owned, spec.tolerance)
        } else {
            (0.0, 0.0)
        };
        let corners = smallest_first(tri.corners);
        result.triangles.push(TileTriangle { corners, max_error, square_sum });
    }
    (result.vertices, result.heights) = vertices_in_use(&result.triangles, field, used);
    count_samples(surface, field, grid_ends, &mut result);
    result
}

/// True if triangle `id` owns the samples on its edge: always if there is no triangle beyond.
fn owns_edge(
    mesh: &LatticeMesh,
    id: u32,
    edge: u32,
    field: &HeightField,
    grid_ends: [bool; 4],
) -> bool {
    let tri = &mesh.tris[id as usize];
    let [from, to] = [edge, next(edge)].map(|i| tri.corners[i as usize]);
    let twin = tri.twins[edge as usize];
    let nothing_beyond = if twin == NONE {
        on_grid_border(from, to, field, grid_ends)
    } else {
        mesh.tris[(twin >> 2) as usize].state == TriangleScanState::Outside
    };
    nothing_beyond || owns_by_direction(from, to)
}

/// True if an edge lies on a side of the field (left, right, above, below) where the grid ends.
pub(super) fn on_grid_border(
    from: TilePosition,
    to: TilePosition,
    field: &HeightField,
    grid_ends: [bool; 4],
) -> bool {
    let [left, right, above, below] = grid_ends;
    let (cols, rows) = ([from.col(), to.col()], [from.row(), to.row()]);
    (left && cols == [0; 2])
        || (right && cols == [field.width() - 1; 2])
        || (above && rows == [0; 2])
        || (below && rows == [field.height() - 1; 2])
}

/// The vertices in use, sorted, and their heights.
pub(super) fn vertices_in_use(
    triangles: &[TileTriangle],
    field: &HeightField,
    used: &mut BitSet,
) -> (Vec<TilePosition>, Vec<f64>) {
    let width = field.width();
    used.reset(width as usize * field.height() as usize);
    for corner in triangles.iter().flat_map(|triangle| triangle.corners) {
        used.insert((corner.row() * width + corner.col()) as usize);
    }
    let indices = used.iter().map(|index| index as u32);
    let vertices: Vec<TilePosition> =
        indices.map(|index| TilePosition::new(index % width, index / width)).collect();
    let heights = vertices.iter().map(|&p| field.vertex(p)).collect();
    (vertices, heights)
}

/// The same triangle starting with its smallest corner.
pub(super) fn smallest_first([a, b, c]: [TilePosition; 3]) -> [TilePosition; 3] {
    if b < a && b < c {
        [b, c, a]
    } else if c < a && c < b {
        [c, a, b]
    } else {
        [a, b, c]
    }
}

fn count_samples(
    surface: &SurfaceCells<'_>,
    field: &HeightField,
    [_, ends_right, _, ends_below]: [bool; 4],
    result: &mut TileMesh,
) {
    let cols = field.width() - u32::from(!ends_right);
    let rows = field.height() - u32::from(!ends_below);
    if !surface.has_voids() {
        result.valid = u64::from(cols) * u64::from(rows);
        return;
    }
    for p in (0..rows).flat_map(|row| (0..cols).map(move |col| TilePosition::new(col, row))) {
        match surface.role(p) {
            SurfaceRole::Interior | SurfaceRole::Outline => result.valid += 1,
            SurfaceRole::Isolated => {
                (result.valid, result.isolated) = (result.valid + 1, result.isolated + 1)
            }
            SurfaceRole::Void => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;

    const SIDE: u32 = 129;

    /// Told to stop before each stage, that goes on for no more than a thousand rounds.
    #[test]
    fn each_stage_asks_whether_to_stop() {
        let noise = |i: u32| (i.wrapping_mul(0x9e37_79b9) >> 16) as f32;
        let z: Vec<f32> = (0..SIDE * SIDE).map(noise).collect();
        let heights = HeightWindow { width: SIDE, height: SIDE, f32: &z, f64: None };
        let input = TileInput::alone(heights);
        let spec = TinSpec {
            tolerance: 1.0,
            bound: ErrorBound::Samples,
            strict: false,
            drop: false,
            data_dependent: false,
            fit_heights: false,
            single_precision: None,
            min_angle: None,
            measure: true,
        };
        let stopped = Cancel::default();
        stopped.cancel();
        // Triangles after inserting, and after what is made of them; each told to stop or not.
        let made = |stops: [bool; 2]| {
            let [inserting, finishing] =
                stops.map(|is| if is { stopped.clone() } else { Cancel::default() });
            let mut scratch = TileScratch::default();
            scratch.field.load(&heights, [0, 0, SIDE, SIDE], [0; 4], None);
            scratch.mesh.reset_to_rectangle(SIDE - 1, SIDE - 1);
            scratch.stop_by(&inserting);
            refine(&mut scratch, &spec);
            let inserted = scratch.mesh.ids().count();
            scratch.stop_by(&finishing);
            [
                inserted,
                finish(&mut scratch, &spec, &SurfaceCells::new(&input), [true; 4]).triangles.len(),
            ]
        };
        let [inserted, finished] = made([false, false]);
        assert!(inserted > 20_000 && finished == inserted, "{inserted} {finished}");
        let [inserted, finished] = made([true, true]);
        assert!(inserted < 2500 && finished == 0, "{inserted} {finished}");
        assert_eq!(made([false, true])[1], 0);
    }
}
