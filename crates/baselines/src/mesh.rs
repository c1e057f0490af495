//! The mesh of all methods: triangles in a flat array, linked by twins of half-edges.
//!
//! A half-edge is `4 * triangle + edge`; edge `i` of a triangle runs from `corners[i]` to
//! `corners[i + 1]`. A half-edge without a twin lies on the border. Every change replaces some triangles by
//! others within the same ring of edges ([`BaselineMesh::replace`]).

use crate::grid::{HeightGrid, PackedSample};
use crate::surface::SampleRole;
use crate::triangulation::TriangulationRule;
use terrane_base::error::{Error, Result};
use terrane_base::geom::predicates::orient;

/// "No half-edge": the border of the mesh.
pub(crate) const NONE: u32 = u32::MAX;

/// State of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TriangleState {
    /// Part of the surface.
    Surface,
    /// Beyond the outline: keeps the mesh convex, never written.
    Outside,
    /// An unused slot.
    Free,
}

/// One triangle; corners are counter-clockwise in (column, row) axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BaselineTriangle {
    pub(crate) corners: [PackedSample; 3],
    pub(crate) twins: [u32; 3],
    pub(crate) state: TriangleState,
}

/// An edge of the ring around a hole: its start, and the half-edge beyond it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RingEdge {
    pub(crate) from: PackedSample,
    pub(crate) beyond: u32,
}

/// The triangles to replace and the ring around them, counter-clockwise.
struct Cavity {
    triangles: Vec<u32>,
    ring: Vec<RingEdge>,
    /// Where the ring ends, if it is open: at an edge on the border.
    end: Option<PackedSample>,
}

/// A triangulation of samples.
#[derive(Clone, Debug, Default)]
pub(crate) struct BaselineMesh {
    pub(crate) tris: Vec<BaselineTriangle>,
    free: Vec<u32>,
}

/// The next edge or corner of a triangle.
#[inline(always)]
pub(crate) fn next(i: u32) -> u32 {
    if i == 2 { 0 } else { i + 1 }
}

/// The previous edge or corner.
#[inline(always)]
pub(crate) fn prev(i: u32) -> u32 {
    if i == 0 { 2 } else { i - 1 }
}

/// Location of a sample within its triangle.
enum SampleLocation {
    Inside,
    Edge(u32),
    Corner,
}

impl BaselineMesh {
    /// The two triangles of the rectangle between two samples.
    pub(crate) fn of_rectangle(low: PackedSample, high: PackedSample) -> Self {
        let [a, b] = [low, PackedSample::new(high.col(), low.row())];
        let [c, d] = [high, PackedSample::new(low.col(), high.row())];
        Self::of_triangles(&[[a, b, c], [a, c, d]])
    }

    /// A mesh of counter-clockwise triangles that share whole edges.
    pub(crate) fn of_triangles(triangles: &[[PackedSample; 3]]) -> Self {
        let mut mesh = Self::default();
        let mut edges = std::collections::HashMap::with_capacity(3 * triangles.len());
        for &corners in triangles {
            let id = mesh.add(BaselineTriangle {
                corners,
                twins: [NONE; 3],
                state: TriangleState::Surface,
            });
            for half_edge in 4 * id..4 * id + 3 {
                let ends = (mesh.origin(half_edge), mesh.end(half_edge));
                match edges.remove(&(ends.1, ends.0)) {
                    Some(twin) => mesh.link(half_edge, twin),
                    None => drop(edges.insert(ends, half_edge)),
                }
            }
        }
        mesh
    }

    /// The start of insertion methods: the corners of the grid and the outline of the voids.
    ///
    /// # Errors
    /// `BadInput`: the grid has no surface.
    pub(crate) fn of_outline(grid: &HeightGrid<'_>) -> Result<Self> {
        check_surface(grid)?;
        let high = PackedSample::new(grid.width() - 1, grid.height() - 1);
        let mut mesh = Self::of_rectangle(PackedSample::new(0, 0), high);
        let outline = grid.samples().filter(|&at| grid.role(at) == SampleRole::Outline);
        mesh.insert_all(grid, outline);
        mesh.mark_outside(grid);
        Ok(mesh)
    }

    /// Inserts samples into a Delaunay triangulation; fast if consecutive samples are near each other.
    pub(crate) fn insert_all(
        &mut self,
        grid: &HeightGrid<'_>,
        samples: impl Iterator<Item = PackedSample>,
    ) {
        let mut near = 0;
        for at in samples {
            let t = self.locate(at, near);
            let star = self.insert(grid, TriangulationRule::Delaunay, t, at);
            near = star.first().copied().unwrap_or(t);
        }
    }

    /// Marks triangles beyond the surface. Each triangle is on one side of the outline, whose edges are edges of
    /// the mesh, so the cell under its centroid decides.
    fn mark_outside(&mut self, grid: &HeightGrid<'_>) {
        for tri in &mut self.tris {
            let cols: u32 = tri.corners.iter().map(|corner| corner.col()).sum();
            let rows: u32 = tri.corners.iter().map(|corner| corner.row()).sum();
            if !grid.holds_cell(cols / 3, rows / 3) {
                tri.state = TriangleState::Outside;
            }
        }
    }

    /// The corner from which a half-edge starts.
    #[inline(always)]
    pub(crate) fn origin(&self, half_edge: u32) -> PackedSample {
        self.tris[(half_edge >> 2) as usize].corners[(half_edge & 3) as usize]
    }

    /// The corner at which a half-edge ends.
    #[inline(always)]
    pub(crate) fn end(&self, half_edge: u32) -> PackedSample {
        self.tris[(half_edge >> 2) as usize].corners[next(half_edge & 3) as usize]
    }

    /// The corner opposite to a half-edge.
    #[inline(always)]
    pub(crate) fn across(&self, half_edge: u32) -> PackedSample {
        self.tris[(half_edge >> 2) as usize].corners[prev(half_edge & 3) as usize]
    }

    /// The same edge of the triangle beyond, or [`NONE`].
    #[inline(always)]
    pub(crate) fn twin(&self, half_edge: u32) -> u32 {
        self.tris[(half_edge >> 2) as usize].twins[(half_edge & 3) as usize]
    }

    /// Triangles of the surface.
    pub(crate) fn surface(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.tris.len() as u32)
            .filter(|id| self.tris[*id as usize].state == TriangleState::Surface)
    }

    fn add(&mut self, tri: BaselineTriangle) -> u32 {
        if let Some(id) = self.free.pop() {
            self.tris[id as usize] = tri;
            return id;
        }
        self.tris.push(tri);
        (self.tris.len() - 1) as u32
    }

    /// Makes two half-edges (either may be [`NONE`]) twins.
    fn link(&mut self, a: u32, b: u32) {
        for (from, to) in [(a, b), (b, a)] {
            if from != NONE {
                self.tris[(from >> 2) as usize].twins[(from & 3) as usize] = to;
            }
        }
    }

    /// Replaces the triangles `removed` by `filling`; `ring` are the edges around both, in any order.
    /// Returns the new triangles in the order of `filling`. Time quadratic in the triangles, which are few.
    pub(crate) fn replace(
        &mut self,
        removed: &[u32],
        filling: &[[PackedSample; 3]],
        ring: &[RingEdge],
    ) -> Vec<u32> {
        let state = self.tris[removed[0] as usize].state;
        for &id in removed {
            self.tris[id as usize].state = TriangleState::Free;
            self.free.push(id);
        }
        let added = filling
            .iter()
            .map(|&corners| self.add(BaselineTriangle { corners, twins: [NONE; 3], state }));
        let added: Vec<u32> = added.collect();
        let mut open: Vec<u32> = Vec::new();
        for half_edge in added.iter().flat_map(|&id| 4 * id..4 * id + 3) {
            let (from, to) = (self.origin(half_edge), self.end(half_edge));
            let twin =
                open.iter().position(|other| self.origin(*other) == to && self.end(*other) == from);
            match twin {
                Some(at) => self.link(half_edge, open.swap_remove(at)),
                None => open.push(half_edge),
            }
        }
        for half_edge in open {
            let from = self.origin(half_edge);
            // Each vertex of a ring starts one edge of it.
            let link = ring.iter().find(|link| link.from == from);
            self.link(half_edge, link.map_or(NONE, |link| link.beyond));
        }
        added
    }

    /// The triangle that contains `at`, by a walk from `start`; the mesh must be convex. The edge tested
    /// first changes from step to step, as in Devillers, Pion & Teillaud, "Walking in a triangulation"
    /// (2002): otherwise the walk may cycle in a mesh that is not Delaunay.
    pub(crate) fn locate(&self, at: PackedSample, start: u32) -> u32 {
        let target = at.lattice();
        let (mut t, mut turn) = (start, 0x9e37_79b9_u32);
        loop {
            turn = turn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let first = (turn >> 16) % 3;
            let edges = [first, next(first), prev(first)].map(|edge| 4 * t + edge);
            let crossed = edges.into_iter().find(|edge| {
                orient(self.origin(*edge).lattice(), self.end(*edge).lattice(), target) < 0
            });
            match crossed {
                Some(edge) => t = self.twin(edge) >> 2,
                None => return t,
            }
        }
    }

    fn locate_in(&self, t: u32, at: PackedSample) -> SampleLocation {
        let edges = (0..3).filter(|edge| {
            let half_edge = 4 * t + edge;
            let ends = [self.origin(half_edge), self.end(half_edge)].map(PackedSample::lattice);
            orient(ends[0], ends[1], at.lattice()) == 0
        });
        match edges.collect::<Vec<u32>>()[..] {
            [] => SampleLocation::Inside,
            [edge] => SampleLocation::Edge(edge),
            _ => SampleLocation::Corner,
        }
    }

    /// Number of additional triangles when `at`, which is in triangle `t`, is inserted.
    pub(crate) fn growth(&self, t: u32, at: PackedSample) -> u64 {
        match self.locate_in(t, at) {
            SampleLocation::Inside => 2,
            SampleLocation::Edge(edge) if self.twin(4 * t + edge) == NONE => 1,
            SampleLocation::Edge(_) => 2,
            SampleLocation::Corner => 0,
        }
    }

    /// Inserts `at`, which is in triangle `t`, and flips edges opposite to it by `triangulation`.
    /// Returns the triangles around it, which are all new ones; none if it is a vertex already. The result
    /// depends on the mesh and the sample only, not on `t` or on the numbers of triangles.
    pub(crate) fn insert(
        &mut self,
        grid: &HeightGrid<'_>,
        triangulation: TriangulationRule,
        t: u32,
        at: PackedSample,
    ) -> Vec<u32> {
        let Cavity { triangles, mut ring, end } = match self.locate_in(t, at) {
            SampleLocation::Corner => return Vec::new(),
            SampleLocation::Inside => {
                let ring = self.around(&[4 * t, 4 * t + 1, 4 * t + 2]);
                Cavity { triangles: vec![t], ring, end: None }
            }
            SampleLocation::Edge(edge) => self.star_of_edge(4 * t + edge),
        };
        if end.is_none() {
            // A fixed start: the result must not depend on the numbers of triangles.
            let lowest = (0..ring.len()).min_by_key(|&i| ring[i].from).unwrap_or(0);
            ring.rotate_left(lowest);
        }
        let ends = ring.iter().map(|link| link.from).skip(1).chain(end.or(Some(ring[0].from)));
        let fan: Vec<_> = ring.iter().zip(ends).map(|(link, to)| [at, link.from, to]).collect();
        let fresh = self.replace(&triangles, &fan, &ring);
        self.legalise(grid, triangulation, fresh)
    }

    fn around(&self, half_edges: &[u32]) -> Vec<RingEdge> {
        let ring = half_edges.iter();
        ring.map(|edge| RingEdge { from: self.origin(*edge), beyond: self.twin(*edge) }).collect()
    }

    /// The triangles beside an edge and the ring around them.
    fn star_of_edge(&self, half_edge: u32) -> Cavity {
        let (t, twin) = (half_edge >> 2, self.twin(half_edge));
        let mut edges = other_edges(half_edge).to_vec();
        if twin == NONE {
            let end = Some(self.origin(half_edge));
            return Cavity { triangles: vec![t], ring: self.around(&edges), end };
        }
        edges.extend(other_edges(twin));
        Cavity { triangles: vec![t, twin >> 2], ring: self.around(&edges), end: None }
    }

    /// Tests the edges opposite to the new corner 0 of `waiting`, and edges created by flips.
    fn legalise(
        &mut self,
        grid: &HeightGrid<'_>,
        triangulation: TriangulationRule,
        mut waiting: Vec<u32>,
    ) -> Vec<u32> {
        let mut star = Vec::new();
        while let Some(t) = waiting.pop() {
            let (half_edge, twin) = (4 * t + 1, self.twin(4 * t + 1));
            let may_flip = twin != NONE
                && self.tris[(twin >> 2) as usize].state == self.tris[t as usize].state;
            if !may_flip || !triangulation.flips(grid, self.quad(half_edge)) {
                star.push(t);
                continue;
            }
            waiting.extend(self.flip(half_edge));
        }
        star
    }

    /// The corner before an edge, the ends of the edge, and the corner beyond.
    fn quad(&self, half_edge: u32) -> [PackedSample; 4] {
        let ends = [self.origin(half_edge), self.end(half_edge)];
        [self.across(half_edge), ends[0], ends[1], self.across(self.twin(half_edge))]
    }

    /// Turns the edge within the quadrilateral of its two triangles.
    ///
    /// ```text
    ///          b                         b
    ///        / | \                     /   \
    ///       p  |  d    -- flip -->    p --- d
    ///        \ | /                     \   /
    ///          a                         a
    /// ```
    fn flip(&mut self, half_edge: u32) -> Vec<u32> {
        let [p, a, b, d] = self.quad(half_edge);
        let Cavity { triangles, ring, .. } = self.star_of_edge(half_edge);
        self.replace(&triangles, &[[p, a, d], [p, d, b]], &ring)
    }
}

/// The other edges of a half-edge's triangle, counter-clockwise from it.
fn other_edges(half_edge: u32) -> [u32; 2] {
    let (t, edge) = (half_edge >> 2, half_edge & 3);
    [4 * t + next(edge), 4 * t + prev(edge)]
}

/// Fails if no cell of the grid has four valid samples.
pub(crate) fn check_surface(grid: &HeightGrid<'_>) -> Result<()> {
    let mut samples = grid.samples();
    if samples.any(|at| grid.holds_cell(at.col(), at.row())) {
        return Ok(());
    }
    Err(Error::bad_input("the grid has no cell with four valid samples")
        .remedy("fill its voids, or check its nodata value"))
}

#[cfg(test)]
impl BaselineMesh {
    /// Panics unless twins share their edge and every triangle has positive area.
    pub(crate) fn validate(&self) {
        for id in (0..self.tris.len() as u32)
            .filter(|&id| self.tris[id as usize].state != TriangleState::Free)
        {
            let [a, b, c] = self.tris[id as usize].corners.map(PackedSample::lattice);
            assert!(orient(a, b, c) > 0, "triangle {id} is not counter-clockwise");
            for half_edge in (4 * id..4 * id + 3).filter(|&edge| self.twin(edge) != NONE) {
                let twin = self.twin(half_edge);
                assert_ne!(self.tris[(twin >> 2) as usize].state, TriangleState::Free);
                assert_eq!(self.twin(twin), half_edge);
                assert_eq!(self.origin(twin), self.end(half_edge));
                assert_eq!(self.end(twin), self.origin(half_edge));
            }
        }
    }
}
