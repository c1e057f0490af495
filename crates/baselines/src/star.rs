//! The triangles around a vertex, for decimation methods.

use crate::grid::{HeightGrid, PackedSample};
use crate::mesh::{BaselineMesh, NONE, RingEdge, next, prev};
use crate::surface::SampleRole;
use terrane_base::geom::predicates::{in_circle, orient};

/// The star of a vertex and the ring around it, counter-clockwise. On a side of the grid the ring is closed by
/// the edge that remains after the removal.
pub(crate) struct VertexStar {
    pub(crate) triangles: Vec<u32>,
    pub(crate) ring: Vec<RingEdge>,
}

impl VertexStar {
    /// The star of the origin of a half-edge.
    pub(crate) fn of(mesh: &BaselineMesh, half_edge: u32) -> Self {
        let mut first = half_edge;
        while mesh.twin(first) != NONE {
            let twin = mesh.twin(first);
            first = twin - (twin & 3) + next(twin & 3);
            if first == half_edge {
                break;
            }
        }
        let (mut star, mut at) = (Self { triangles: Vec::new(), ring: Vec::new() }, first);
        loop {
            let (t, edge) = (at >> 2, at & 3);
            let [outer, last] = [4 * t + next(edge), 4 * t + prev(edge)];
            star.triangles.push(t);
            star.ring.push(RingEdge { from: mesh.origin(outer), beyond: mesh.twin(outer) });
            at = mesh.twin(last);
            if at == NONE {
                star.ring.push(RingEdge { from: mesh.origin(last), beyond: NONE });
            }
            if at == NONE || at == first {
                return star;
            }
        }
    }

    /// Delaunay triangles of the ring, by repeated cutting of the first ear, from the lowest (row, column) on, whose
    /// circumcircle contains no other vertex of the ring. Time cubic in the ring at worst.
    pub(crate) fn ears(&self) -> Option<Vec<[PackedSample; 3]>> {
        let mut ring: Vec<PackedSample> = self.ring.iter().map(|link| link.from).collect();
        let lowest = (0..ring.len()).min_by_key(|&i| ring[i])?;
        ring.rotate_left(lowest);
        let mut filling = Vec::with_capacity(ring.len());
        while ring.len() > 3 {
            let ear = (0..ring.len()).find(|&i| is_ear(&ring, i))?;
            filling.push(corners(&ring, ear));
            ring.remove(ear);
        }
        let last = corners(&ring, 1);
        filling.push(last);
        is_counter_clockwise(last).then_some(filling)
    }

    /// A fan of triangles of the ring around one of its vertices; `None` if a triangle would be inverted.
    pub(crate) fn fan(&self, apex: PackedSample) -> Option<Vec<[PackedSample; 3]>> {
        let count = self.ring.len();
        let edges = (0..count).map(|i| [self.ring[i].from, self.ring[(i + 1) % count].from]);
        let others = edges.filter(|edge| !edge.contains(&apex));
        let filling: Vec<_> = others.map(|[from, to]| [apex, from, to]).collect();
        filling.iter().all(|corners| is_counter_clockwise(*corners)).then_some(filling)
    }
}

/// A vertex of a ring between its neighbours.
fn corners(ring: &[PackedSample], i: usize) -> [PackedSample; 3] {
    let count = ring.len();
    [ring[(i + count - 1) % count], ring[i], ring[(i + 1) % count]]
}

pub(crate) fn is_counter_clockwise([a, b, c]: [PackedSample; 3]) -> bool {
    orient(a.lattice(), b.lattice(), c.lattice()) > 0
}

fn is_ear(ring: &[PackedSample], i: usize) -> bool {
    let around = corners(ring, i);
    let [a, b, c] = around.map(PackedSample::lattice);
    is_counter_clockwise(around)
        && ring.iter().all(|d| around.contains(d) || in_circle(a, b, c, d.lattice()) <= 0)
}

/// A mesh of all samples of the surface, and the start of each star.
pub(crate) struct FullMesh {
    pub(crate) mesh: BaselineMesh,
    /// By sample, a half-edge with this origin, or [`NONE`].
    spokes: Vec<u32>,
}

impl FullMesh {
    /// Cuts each cell from its first sample to its last: Delaunay, as all four samples are cocircular.
    pub(crate) fn new(grid: &HeightGrid<'_>) -> Self {
        let cells = grid.samples().filter(|at| grid.holds_cell(at.col(), at.row()));
        let triangles: Vec<_> = cells.flat_map(cell_triangles).collect();
        let mut full =
            Self { mesh: BaselineMesh::of_triangles(&triangles), spokes: vec![NONE; grid.len()] };
        full.note(grid, &full.mesh.surface().collect::<Vec<_>>());
        full
    }

    /// The star of a vertex.
    pub(crate) fn star(&self, grid: &HeightGrid<'_>, vertex: PackedSample) -> VertexStar {
        VertexStar::of(&self.mesh, self.spokes[grid.index(vertex)])
    }

    /// Replaces a star by other triangles.
    pub(crate) fn refill(
        &mut self,
        grid: &HeightGrid<'_>,
        star: &VertexStar,
        filling: &[[PackedSample; 3]],
    ) {
        let added = self.mesh.replace(&star.triangles, filling, &star.ring);
        self.note(grid, &added);
    }

    fn note(&mut self, grid: &HeightGrid<'_>, triangles: &[u32]) {
        for half_edge in triangles.iter().flat_map(|&t| 4 * t..4 * t + 3) {
            self.spokes[grid.index(self.mesh.origin(half_edge))] = half_edge;
        }
    }
}

/// The triangles of the cell whose first sample is `at`.
fn cell_triangles(at: PackedSample) -> [[PackedSample; 3]; 2] {
    let [col, row] = [at.col(), at.row()];
    let [a, b] = [at, PackedSample::new(col + 1, row)];
    let [c, d] = [PackedSample::new(col + 1, row + 1), PackedSample::new(col, row + 1)];
    [[a, b, c], [a, c, d]]
}

/// True for vertices that may be removed: neither corners of the grid nor on the outline of a void.
pub(crate) fn is_free(grid: &HeightGrid<'_>, at: PackedSample) -> bool {
    grid.role(at) == SampleRole::Interior && !grid.is_corner(at)
}
