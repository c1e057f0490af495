//! Seam patches: the region around a tile border, made Delaunay and re-fitted across it.
//!
//! The border of a patch is frozen. What changed beside it is reported, so that the caller can tell
//! whether the change would have gone on in a larger patch.
//!
//! Along a rim, triangles end on vertices chosen for the line alone: the mesh is sound but neither
//! Delaunay nor economical there. When both sides of a seam are done, the triangles near it are put into
//! a fresh local mesh in canonical order; it is made Delaunay, samples beyond the tolerance are inserted,
//! and redundant rim vertices are dropped.

use super::field::Field;
use super::greedy::{Judge, insert_adaptive};
use super::measure::{measure, owns_by_direction};
use super::mesh::{Mesh, NONE, State, Tri, next, prev};
use super::order::{by_rows, sort_by_position};
use super::tile::{Scratch, on_grid_border, smallest_first, vertices_in_use};
use super::{Local, PatchInput, PatchMesh, Spec, Triangle, drop, strict};
use terrane_base::bits::BitSet;

/// Makes the triangles of a patch Delaunay, inserts what is then beyond the tolerance, and drops
/// vertices of the seam that are no longer needed.
///
/// The result is a pure function of the set of triangles, the heights and `spec`. Expected time is
/// linear in the triangles but for sorting them.
pub fn mend_patch(input: &PatchInput<'_>, spec: &Spec, scratch: &mut Scratch) -> PatchMesh {
    let (width, height) = (input.heights.width, input.heights.height);
    scratch.field.load(&input.heights, [0, 0, width, height], 0, spec.single_precision);
    let mut sorted = input.triangles.to_vec();
    sort_by_position(&mut sorted);
    build(&mut scratch.mesh, &sorted);
    let Scratch { field, mesh, lists, drop, used, scan } = scratch;
    let judge = Judge { field, scan: *scan, tolerance: spec.tolerance };
    legalise(mesh);
    if spec.strict {
        strict::insert(&judge, mesh);
    } else {
        insert_adaptive(&judge, mesh, lists);
    }
    if spec.drop {
        drop.limit_circles(input.spacing);
        drop_seam(&judge, mesh, input, drop);
    }
    finish(mesh, &Border { field, input }, &sorted, spec, used)
}

impl PatchInput<'_> {
    /// True when a vertex may have been chosen for a rim alone.
    fn is_on_seam(&self, p: Local) -> bool {
        Some(p.col()) == self.seam_col || Some(p.row()) == self.seam_row
    }
}

/// Rebuilds a mesh from loose sorted triangles. All count as within the tolerance.
fn build(mesh: &mut Mesh, sorted: &[Triangle]) {
    mesh.clear();
    mesh.border_is_fixed = true;
    let mut edges = Vec::with_capacity(3 * sorted.len());
    for (id, triangle) in (0_u32..).zip(sorted) {
        let corners = triangle.corners;
        mesh.add(Tri { state: State::Passed(0), source: id, ..Tri::new(corners, [NONE; 3]) });
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

/// What lies beyond the edges that have no twin.
struct Border<'a> {
    field: &'a Field,
    input: &'a PatchInput<'a>,
}

impl Border<'_> {
    /// The triangle, once for each frozen edge beyond which the mesh may not agree with it, turned so
    /// that this edge comes first: all edges of a changed triangle, and those on the seam of any.
    fn beside<'b>(&'b self, tri: &'b Tri) -> impl Iterator<Item = [Local; 3]> + 'b {
        let is_asked = move |edge| tri.source == NONE || self.is_on_seam(tri, edge);
        let is_open = move |&edge: &u32| {
            tri.twins[edge as usize] == NONE && is_asked(edge) && self.is_frozen(tri, edge)
        };
        let turned =
            move |edge| [edge, next(edge), prev(edge)].map(|i: u32| tri.corners[i as usize]);
        (0..3).filter(is_open).map(turned)
    }

    fn is_on_seam(&self, tri: &Tri, edge: u32) -> bool {
        [edge, next(edge)].iter().all(|&i| self.input.is_on_seam(tri.corners[i as usize]))
    }

    /// True when a triangle counts the samples on its edge: always where nothing lies beyond.
    fn is_owned(&self, tri: &Tri, edge: u32) -> bool {
        let [from, to] = [edge, next(edge)].map(|i| tri.corners[i as usize]);
        let nothing_beyond = tri.twins[edge as usize] == NONE && !self.is_frozen(tri, edge);
        nothing_beyond || owns_by_direction(from, to)
    }

    /// True when the surface goes on beyond an edge without a twin: it is neither on the grid's border
    /// nor on the outline of a void.
    fn is_frozen(&self, tri: &Tri, edge: u32) -> bool {
        let [from, to] = [edge, next(edge)].map(|i| tri.corners[i as usize]);
        !on_grid_border(from, to, self.field, self.input.grid_ends)
            && !self.has_void_beyond(from, to)
    }

    /// True when the cell to the right of the directed unit edge is inside the patch and void.
    fn has_void_beyond(&self, from: Local, to: Local) -> bool {
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
            .any(|&(c, r)| self.field.sample(Local::new(col + c, row + r)).is_nan())
    }
}

/// Flips until every edge of the patch is Delaunay (Lawson 1977).
fn legalise(mesh: &mut Mesh) {
    let mut stack: Vec<u32> =
        (0..mesh.tris.len() as u32).rev().flat_map(|id| [4 * id + 2, 4 * id + 1, 4 * id]).collect();
    while let Some(half_edge) = stack.pop() {
        if let Some([t, u]) = mesh.flip_if_illegal(half_edge) {
            stack.extend([4 * t, 4 * t + 1, 4 * u + 1, 4 * u + 2]);
        }
    }
}

/// Tries to drop the vertices on the seam lines, in the order of their positions.
fn drop_seam(
    judge: &Judge<'_>,
    mesh: &mut Mesh,
    input: &PatchInput<'_>,
    scratch: &mut drop::Scratch,
) {
    let mut seam: Vec<(Local, u32)> = Vec::new();
    for id in mesh.ids() {
        let half_edges = (4 * id..4 * id + 3).map(|half_edge| (mesh.origin(half_edge), half_edge));
        seam.extend(half_edges.filter(|&(p, _)| input.is_on_seam(p)));
    }
    seam.sort_unstable();
    seam.dedup_by_key(|&mut (p, _)| p);
    for i in 0..seam.len() {
        let Some(changed) = scratch.try_drop(judge, mesh, seam[i].1) else { continue };
        for half_edge in changed.iter().flat_map(|id| 4 * id..4 * id + 3) {
            if let Ok(at) = seam.binary_search_by_key(&mesh.origin(half_edge), |&(p, _)| p) {
                seam[at].1 = half_edge;
            }
        }
    }
}

/// The patch's triangles; those that were never touched keep their measures.
fn finish(
    mesh: &Mesh,
    border: &Border<'_>,
    sorted: &[Triangle],
    spec: &Spec,
    used: &mut BitSet,
) -> PatchMesh {
    let field = border.field;
    let mut patch = PatchMesh::default();
    for id in mesh.ids() {
        let tri = &mesh.tris[id as usize];
        patch.border.extend(border.beside(tri));
        if let Some(&kept) = sorted.get(tri.source as usize) {
            patch.triangles.push(kept);
            continue;
        }
        let owned = [0, 1, 2].map(|edge| border.is_owned(tri, edge));
        let (max_error, square_sum) = if spec.measure {
            measure(field, tri.corners, owned, spec.tolerance)
        } else {
            (0.0, 0.0)
        };
        let corners = smallest_first(tri.corners);
        patch.triangles.push(Triangle { corners, max_error, square_sum });
    }
    (patch.vertices, patch.heights) = vertices_in_use(&patch.triangles, field, used);
    patch
}
