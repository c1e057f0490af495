//! Seam patches: the region around a tile border, made Delaunay and re-fitted across it.
//!
//! The border of a patch is frozen. Changes beside it are reported, so that the caller can detect whether a larger
//! patch would have changed more.
//!
//! Along a rim, triangles end on vertices chosen for the line alone: the mesh is sound but neither
//! Delaunay nor economical there. When both sides of a seam are done, the triangles near it are put into
//! a fresh local mesh in canonical order; it is made Delaunay, samples beyond the tolerance are inserted,
//! and redundant rim vertices are dropped.

use super::crossing::CrossingJudge;
use super::heights::HeightField;
use super::lattice_position::TilePosition;
use super::measure::owns_by_direction;
use super::mesh::{FixedBorder, LatticeMesh, LatticeTriangle, NONE, TriangleScanState, next, prev};
use super::order::{by_rows, sort_by_position};
use super::scan::measure;
use super::spec::{PatchInput, PatchMesh, TileTriangle, TinSpec};
use super::tile::{TileScratch, bring_within, on_grid_border, smallest_first, vertices_in_use};
use super::tolerance::InsertionCriteria;
use super::{adjust, angles, breaklines, drop};
use terrane_base::bits::BitSet;
use terrane_base::bound::ErrorBound;
use terrane_base::geom::predicates::in_circle;

/// Makes the triangles of a patch Delaunay, inserts samples beyond the tolerance, and drops redundant vertices of the
/// seam.
///
/// The result is a pure function of the set of triangles, the heights and `spec`. Expected time is
/// linear in the triangles but for sorting them.
pub fn mend_patch(input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch) -> PatchMesh {
    let sorted = begin(input, spec, scratch);
    let TileScratch { field, mesh, lists, rounds, drop, adjust, edges, used, scan } = scratch;
    let [width, height] = [input.heights.width, input.heights.height];
    mesh.fixed = FixedBorder::Inside { ends: input.grid_ends, cells: [width - 1, height - 1] };
    legalise(mesh);
    let mut judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
    bring_within(&judge, mesh, lists, rounds, spec);
    if spec.bound == ErrorBound::Surface {
        judge = judge.and_between(CrossingJudge::new(field, spec.tolerance));
    }
    let border = PatchBorder { field, input };
    let may = |mesh: &LatticeMesh, holder, at| {
        !field.is_stopped()
            && !changes_beside(mesh, holder, at, |tri, edge| border.is_frozen(tri, edge))
    };
    let mut settle = |mesh: &mut LatticeMesh| {
        let judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
        bring_within(&judge, mesh, lists, rounds, spec);
    };
    let mut thin = 0;
    if let Some(bound) = &spec.min_angle {
        angles::insert(bound, mesh, may, &mut settle);
        thin = angles::thin(bound, mesh).len() as u64;
    }
    let apart = breaklines::follow(input.lines, field, mesh, edges, may, settle);
    let mut fixed = input.kept.to_vec();
    breaklines::vertices(input.lines, field, mesh, edges, &mut fixed);
    fixed.sort_unstable();
    drop.limit_angles(spec.min_angle);
    if spec.drop {
        drop.limit_circles(spec.spacing(input.spacing));
        drop_seam(&judge, mesh, input, &fixed, drop);
    }
    adjust.reset(field, input.kept);
    if spec.fit_heights {
        even_out(&judge, mesh, &border, &fixed, adjust, drop);
    }
    let left = judge.crossings.map(|crossings| rounds.left(&crossings, mesh)).unwrap_or_default();
    PatchMesh { left, thin, apart, ..finish(mesh, &border, &sorted, spec, adjust, used) }
}

/// Drops vertices whose stars can be refilled within the tolerance by any triangles, Delaunay or not. If heights are
/// free, moves other vertices and tries again. Leaves the border of the patch unchanged.
///
/// The result is a pure function of the set of triangles, the heights and `spec`. Expected time is linear in the
/// triangles but for sorting them, and of a star in the cube of its corners.
pub fn reduce_patch(
    input: &PatchInput<'_>,
    spec: &TinSpec,
    scratch: &mut TileScratch,
) -> PatchMesh {
    let sorted = begin(input, spec, scratch);
    let TileScratch { field, mesh, drop, adjust, edges, used, scan, .. } = scratch;
    let mut judge = InsertionCriteria::of_samples(field, *scan, spec.tolerance);
    if spec.bound == ErrorBound::Surface {
        judge = judge.and_between(CrossingJudge::new(field, spec.tolerance));
    }
    let mut fixed = input.kept.to_vec();
    breaklines::vertices(input.lines, field, mesh, edges, &mut fixed);
    drop.limit_angles(spec.min_angle);
    drop.allow_any(true);
    drop.settle(field, &fixed);
    drop::drop_redundant(&judge, mesh, drop);
    adjust.reset(field, input.kept);
    if spec.fit_heights {
        adjust.mark_due(field, mesh, |_| true);
        for _ in 0..adjust::ROUNDS {
            if !adjust.sweep(&judge, mesh, spec.tolerance) {
                break;
            }
            drop.settle(field, &fixed);
            drop::drop_redundant(&judge, mesh, drop);
            adjust.mark_changed(field, mesh);
        }
    }
    drop.allow_any(false);
    finish(mesh, &PatchBorder { field, input }, &sorted, spec, adjust, used)
}

/// Loads the heights and the triangles of a patch; returns the triangles sorted.
fn begin(input: &PatchInput<'_>, spec: &TinSpec, scratch: &mut TileScratch) -> Vec<TileTriangle> {
    let [width, height] = [input.heights.width, input.heights.height];
    scratch.field.load(&input.heights, [0, 0, width, height], [0; 4], spec.single_precision);
    if spec.fit_heights {
        scratch.field.free_heights();
        input.vertices.iter().for_each(|&(at, height)| scratch.field.move_vertex(at, height));
    }
    let mut sorted = input.triangles.to_vec();
    sort_by_position(&mut sorted);
    build(&mut scratch.mesh, &sorted);
    sorted
}

impl PatchInput<'_> {
    /// True when a vertex is on a seam line.
    fn is_on_seam(&self, p: TilePosition) -> bool {
        Some(p.col()) == self.seam_col || Some(p.row()) == self.seam_row
    }
}

/// Rebuilds a mesh from unconnected sorted triangles. All count as within the tolerance.
fn build(mesh: &mut LatticeMesh, sorted: &[TileTriangle]) {
    mesh.clear();
    let mut edges = Vec::with_capacity(3 * sorted.len());
    for (id, triangle) in (0_u32..).zip(sorted) {
        let corners = triangle.corners;
        mesh.add(LatticeTriangle {
            state: TriangleScanState::Passed(0),
            source: id,
            ..LatticeTriangle::new(corners, [NONE; 3])
        });
        edges.extend((0..3).map(|edge| {
            let ends = [edge, next(edge)].map(|i| corners[i as usize]);
            (ends[0].min(ends[1]), ends[0].max(ends[1]), 4 * id + edge)
        }));
    }
    by_rows(&mut edges, |edge| edge.0, |&edge| edge);
    for pair in edges.windows(2).filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1)) {
        mesh.link(pair[0].2, pair[1].2);
    }
}

/// The surroundings of edges without a twin.
struct PatchBorder<'a> {
    field: &'a HeightField,
    input: &'a PatchInput<'a>,
}

impl PatchBorder<'_> {
    /// Returns the triangle once for each frozen edge beyond which the mesh may disagree with it, rotated so that this
    /// edge comes first: all frozen edges of a changed triangle, and edges on the seam of any triangle.
    fn neighbours<'b>(
        &'b self,
        tri: &'b LatticeTriangle,
    ) -> impl Iterator<Item = [TilePosition; 3]> + 'b {
        let open = (0..3).filter(move |&edge| {
            tri.twins[edge as usize] == NONE
                && (tri.source == NONE || self.is_on_seam(tri, edge))
                && self.is_frozen(tri, edge)
        });
        open.map(|edge| [edge, next(edge), prev(edge)].map(|i| tri.corners[i as usize]))
    }

    fn is_on_seam(&self, tri: &LatticeTriangle, edge: u32) -> bool {
        [edge, next(edge)].iter().all(|&i| self.input.is_on_seam(tri.corners[i as usize]))
    }

    /// True if a triangle owns the samples on its edge: always if there is no triangle beyond.
    fn is_owned(&self, tri: &LatticeTriangle, edge: u32) -> bool {
        let [from, to] = [edge, next(edge)].map(|i| tri.corners[i as usize]);
        let nothing_beyond = tri.twins[edge as usize] == NONE && !self.is_frozen(tri, edge);
        nothing_beyond || owns_by_direction(from, to)
    }

    /// The corners of the triangles beside frozen edges.
    fn frozen(&self, mesh: &LatticeMesh) -> Vec<TilePosition> {
        let tris = mesh.ids().map(|id| &mesh.tris[id as usize]);
        let frozen = tris.filter(|tri| {
            (0..3).any(|edge| tri.twins[edge as usize] == NONE && self.is_frozen(tri, edge))
        });
        frozen.flat_map(|tri| tri.corners).collect()
    }

    /// True if the surface continues beyond an edge without a twin: it is neither on the grid's border nor on the
    /// outline of a void.
    fn is_frozen(&self, tri: &LatticeTriangle, edge: u32) -> bool {
        let [from, to] = [edge, next(edge)].map(|i| tri.corners[i as usize]);
        !on_grid_border(from, to, self.field, self.input.grid_ends)
            && !self.has_void_beyond(from, to)
    }

    /// True when the cell to the right of the directed unit edge is inside the patch and void.
    fn has_void_beyond(&self, from: TilePosition, to: TilePosition) -> bool {
        let ([x, y], [to_x, to_y]) = (from.lattice(), to.lattice());
        let (dx, dy) = (to_x - x, to_y - y);
        if dx.abs() + dy.abs() != 1 {
            return false;
        }
        let (col, row) = match (dx, dy) {
            (0, 1) => (x, y),
            (0, _) => (x - 1, to_y),
            (1, _) => (x, y - 1),
            _ => (to_x, y),
        };
        let inside = (0..self.field.width() as i32 - 1).contains(&col)
            && (0..self.field.height() as i32 - 1).contains(&row);
        inside && self.is_void(col as u32, row as u32)
    }

    fn is_void(&self, col: u32, row: u32) -> bool {
        [(0, 0), (1, 0), (0, 1), (1, 1)]
            .iter()
            .any(|&(c, r)| self.field.sample(TilePosition::new(col + c, row + r)).is_nan())
    }
}

/// Flips until every edge of the patch is Delaunay (Lawson 1977).
fn legalise(mesh: &mut LatticeMesh) {
    let mut stack: Vec<u32> =
        // Reversed, so that edges are popped in the order of the sorted triangles. Where vertices lie on
        // one circle, the order of flips decides, and it must not tell where triangles came from.
        (0..mesh.tris.len() as u32).rev().flat_map(|id| [4 * id + 2, 4 * id + 1, 4 * id]).collect();
    while let Some(half_edge) = stack.pop() {
        if let Some([t, u]) = mesh.flip_if_illegal(half_edge) {
            stack.extend([4 * t, 4 * t + 1, 4 * u + 1, 4 * u + 2]);
        }
    }
}

/// True if inserting a sample into a triangle would change a triangle at a frozen border edge: the triangle beyond
/// might disagree.
fn changes_beside(
    mesh: &LatticeMesh,
    holder: u32,
    at: TilePosition,
    is_frozen: impl Fn(&LatticeTriangle, u32) -> bool,
) -> bool {
    // The triangles whose circles hold the sample are those that an insertion would replace. They are
    // collected without inserting, as an insertion cannot be taken back.
    let (mut open, mut visited) = (vec![holder], vec![holder]);
    while let Some(id) = open.pop() {
        let tri = &mesh.tris[id as usize];
        if (0..3).any(|edge| tri.twins[edge as usize] == NONE && is_frozen(tri, edge)) {
            return true;
        }
        for other in tri.twins.into_iter().filter(|&twin| twin != NONE).map(|twin| twin >> 2) {
            let [a, b, c] = mesh.tris[other as usize].corners.map(TilePosition::lattice);
            if in_circle(a, b, c, at.lattice()) > 0 && !visited.contains(&other) {
                visited.push(other);
                open.push(other);
            }
        }
    }
    false
}

/// Tries to drop the vertices on the seam lines that may serve a rim only, in the order of their positions.
fn drop_seam(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    input: &PatchInput<'_>,
    fixed: &[TilePosition],
    scratch: &mut drop::DropScratch,
) {
    let mut seam: Vec<(TilePosition, u32)> = Vec::new();
    for id in mesh.ids() {
        let half_edges = (4 * id..4 * id + 3).map(|half_edge| (mesh.origin(half_edge), half_edge));
        seam.extend(
            half_edges.filter(|(p, _)| input.is_on_seam(*p) && fixed.binary_search(p).is_err()),
        );
    }
    seam.sort_unstable();
    seam.dedup_by_key(|&mut (p, _)| p);
    for i in 0..seam.len() {
        let Some(changed) = scratch.try_drop(judge, mesh, seam[i].1) else { continue };
        for half_edge in changed.iter().flat_map(|id| 4 * id..4 * id + 3) {
            // A drop uses the slots of the star again, so the half-edges noted for its ring are stale.
            if let Ok(at) = seam.binary_search_by_key(&mesh.origin(half_edge), |&(p, _)| p) {
                seam[at].1 = half_edge;
            }
        }
    }
}

/// Moves and drops vertices on the seam and near it, and leaves the border of the patch unchanged.
fn even_out(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    border: &PatchBorder<'_>,
    fixed: &[TilePosition],
    adjust: &mut adjust::AdjustScratch,
    drop: &mut drop::DropScratch,
) {
    adjust
        .mark_due(judge.field, mesh, |tri| tri.corners.iter().any(|&p| border.input.is_on_seam(p)));
    adjust.mark_changed(judge.field, mesh);
    for _ in 0..adjust::ROUNDS {
        if !adjust.sweep(judge, mesh, judge.tolerance) {
            return;
        }
        let all_fixed = [border.frozen(mesh), fixed.to_vec()].concat();
        drop.settle(judge.field, &all_fixed);
        drop::drop_redundant(judge, mesh, drop);
        adjust.mark_changed(judge.field, mesh);
    }
}

/// The patch's triangles; unchanged ones keep their measures.
fn finish(
    mesh: &LatticeMesh,
    border: &PatchBorder<'_>,
    sorted: &[TileTriangle],
    spec: &TinSpec,
    adjust: &adjust::AdjustScratch,
    used: &mut BitSet,
) -> PatchMesh {
    let field = border.field;
    let mut patch = PatchMesh::default();
    for (round, id) in mesh.ids().enumerate() {
        if field.is_stopped_in(round) {
            return PatchMesh::default();
        }
        let tri = &mesh.tris[id as usize];
        patch.border.extend(border.neighbours(tri));
        // NONE as an index is beyond any list: triangles made here have no original.
        let original = sorted.get(tri.source as usize);
        if let Some(&original) =
            original.filter(|_| !spec.fit_heights || !adjust.has_moved(field, tri))
        {
            patch.triangles.push(original);
            continue;
        }
        let owned = [0, 1, 2].map(|edge| border.is_owned(tri, edge));
        let (max_error, square_sum) = if spec.measure {
            measure(field, tri.corners, owned, spec.tolerance)
        } else {
            (0.0, 0.0)
        };
        let corners = smallest_first(tri.corners);
        patch.triangles.push(TileTriangle { corners, max_error, square_sum });
    }
    (patch.vertices, patch.heights) = vertices_in_use(&patch.triangles, field, used);
    patch
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heights::HeightWindow;

    /// Six by five samples, of which (3, 2) is void.
    fn field() -> HeightField {
        let heights: Vec<f32> =
            (0..30).map(|i| if i == 2 * 6 + 3 { f32::NAN } else { i as f32 }).collect();
        let heights = HeightWindow { width: 6, height: 5, f32: &heights, f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, 6, 5], [0; 4], None);
        field
    }

    fn input(grid_ends: [bool; 4]) -> PatchInput<'static> {
        let heights = HeightWindow { width: 6, height: 5, f32: &[], f64: None };
        let (seam_col, seam_row) = (Some(4), None);
        PatchInput {
            heights,
            vertices: &[],
            triangles: &[],
            seam_col,
            seam_row,
            grid_ends,
            spacing: u32::MAX,
            kept: &[],
            lines: &[],
        }
    }

    /// A rectangle of 6 by 4 cells with a vertex in its middle is four triangles, each beside one side.
    #[test]
    fn a_sample_that_changes_a_triangle_beside_a_frozen_edge_is_known() {
        let mut mesh = LatticeMesh::default();
        mesh.reset_to_rectangle(6, 4);
        assert!(mesh.insert(0, TilePosition::new(3, 2), &mut Vec::new()));
        // Above the middle, and outside the circle of the triangle below it alone.
        let at = TilePosition::new(3, 1);
        let holder = mesh.locate(at, 0);
        for (row, expected) in [(0, true), (4, false)] {
            let is_frozen = |tri: &LatticeTriangle, edge: u32| {
                [edge, next(edge)].iter().all(|&i| tri.corners[i as usize].row() == row)
            };
            assert_eq!(changes_beside(&mesh, holder, at, is_frozen), expected, "row {row}");
        }
    }

    /// The cell half a unit to the right of the midpoint of an edge, if it is in the patch.
    fn cell_beyond(from: TilePosition, to: TilePosition) -> Option<[i32; 2]> {
        let ([x, y], [to_x, to_y]) = (from.lattice(), to.lattice());
        let (dx, dy) = (to_x - x, to_y - y);
        let [col, row] = [(x + to_x + dy).div_euclid(2), (y + to_y - dx).div_euclid(2)];
        ((0..5).contains(&col) && (0..4).contains(&row)).then_some([col, row])
    }

    fn all() -> impl Iterator<Item = TilePosition> + Clone {
        (0..5).flat_map(|row| (0..6).map(move |col| TilePosition::new(col, row)))
    }

    #[test]
    fn a_void_lies_beyond_the_unit_edges_around_its_cells_alone() {
        let (field, input) = (field(), input([false; 4]));
        let border = PatchBorder { field: &field, input: &input };
        let mut found = 0;
        for (from, to) in all().flat_map(|from| all().map(move |to| (from, to))) {
            let apart = from.col().abs_diff(to.col()) + from.row().abs_diff(to.row());
            let is_void = |[col, row]: [i32; 2]| (2..=3).contains(&col) && (1..=2).contains(&row);
            let expected = apart == 1 && cell_beyond(from, to).is_some_and(is_void);
            assert_eq!(border.has_void_beyond(from, to), expected, "{from:?} {to:?}");
            found += usize::from(expected);
        }
        // Four for each of the four cells.
        assert_eq!(found, 16);
    }

    /// Behind the last row of a field lie its copies, void as well.
    #[test]
    fn no_void_is_beyond_the_rectangle() {
        let heights = HeightWindow { width: 6, height: 5, f32: &[f32::NAN; 30], f64: None };
        let mut field = HeightField::default();
        field.load(&heights, [0, 0, 6, 5], [0; 4], None);
        let border = PatchBorder { field: &field, input: &input([false; 4]) };
        for (from, to) in all().flat_map(|from| all().map(move |to| (from, to))) {
            let apart = from.col().abs_diff(to.col()) + from.row().abs_diff(to.row());
            let expected = apart == 1 && cell_beyond(from, to).is_some();
            assert_eq!(border.has_void_beyond(from, to), expected, "{from:?} {to:?}");
        }
    }

    #[test]
    fn an_edge_is_frozen_where_the_surface_goes_on() {
        let field = field();
        let tri = |corners: [(u32, u32); 3]| {
            LatticeTriangle::new(corners.map(|(col, row)| TilePosition::new(col, row)), [NONE; 3])
        };
        for ends in [[false; 4], [true; 4], [true, false, false, true]] {
            let input = input(ends);
            let border = PatchBorder { field: &field, input: &input };
            // Two sides of the rectangle, and a diagonal.
            let corner = tri([(0, 0), (5, 0), (0, 4)]);
            assert_eq!([0, 1, 2].map(|e| border.is_frozen(&corner, e)), [!ends[2], true, !ends[0]]);
            let other = tri([(5, 4), (0, 4), (5, 0)]);
            assert_eq!([0, 1, 2].map(|e| border.is_frozen(&other, e)), [!ends[3], true, !ends[1]]);
            // Below the edge from (3, 1) to (2, 1) lies the void.
            let above = tri([(3, 1), (2, 1), (2, 0)]);
            assert_eq!([0, 1, 2].map(|e| border.is_frozen(&above, e)), [false, true, true]);
        }
    }

    /// Two triangles of a square in the corner on the right below.
    #[test]
    fn what_is_beside_a_frozen_edge_stays_and_shares_its_samples() {
        let at = |(col, row): (u32, u32)| TilePosition::new(col, row);
        let triangle = |corners: [(u32, u32); 3]| TileTriangle {
            corners: corners.map(at),
            max_error: 0.0,
            square_sum: 0.0,
        };
        let mut mesh = LatticeMesh::default();
        build(&mut mesh, &[[(5, 4), (4, 4), (5, 3)], [(4, 4), (4, 3), (5, 3)]].map(triangle));
        let field = field();
        for (is_end, expected, frozen) in [
            (true, [[true; 3], [true, true, false]], 3),
            (false, [[false, true, false], [true, true, false]], 4),
        ] {
            let input = input([false, is_end, false, is_end]);
            let border = PatchBorder { field: &field, input: &input };
            let owned = |id: usize| [0, 1, 2].map(|edge| border.is_owned(&mesh.tris[id], edge));
            assert_eq!([owned(0), owned(1)], expected);
            let mut found = border.frozen(&mesh);
            found.sort_unstable();
            found.dedup();
            assert_eq!(found.len(), frozen);
            assert!([(4, 3), (4, 4), (5, 3)].map(at).iter().all(|p| found.contains(p)));
        }
    }

    #[test]
    fn an_edge_on_the_seam_has_both_ends_there() {
        let (field, input) = (field(), input([false; 4]));
        let border = PatchBorder { field: &field, input: &input };
        let tri = |corners: [(u32, u32); 3]| {
            let corners = corners.map(|(col, row)| TilePosition::new(col, row));
            LatticeTriangle { source: 7, ..LatticeTriangle::new(corners, [NONE; 3]) }
        };
        let on = tri([(4, 0), (4, 3), (1, 1)]);
        assert_eq!([0, 1, 2].map(|edge| border.is_on_seam(&on, edge)), [true, false, false]);
        let turned = [[4, 0], [4, 3], [1, 1]].map(|[col, row]| TilePosition::new(col, row));
        assert_eq!(border.neighbours(&on).collect::<Vec<_>>(), [turned]);
        // Of a triangle that changed every open edge is asked about.
        let changed = LatticeTriangle { source: NONE, twins: [NONE, 3, NONE], ..on };
        let [a, b, c] = turned;
        assert_eq!(border.neighbours(&changed).collect::<Vec<_>>(), [[a, b, c], [c, a, b]]);
    }
}
