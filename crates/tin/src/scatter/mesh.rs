//! Incremental Delaunay triangulation of scattered points.
//!
//! Ghost triangles (a hull edge and a vertex at infinity) close the mesh, so a point beyond the hull
//! is inserted like any other. An insertion removes the triangles whose circle holds the point and
//! fills the hole with a fan around it (Bowyer 1981, Watson 1981); walks find the first of them.

use terrane_base::geom::Point;
use terrane_delaunay::{in_circle, orient};

/// The vertex at infinity.
pub const GHOST: u32 = u32::MAX;

/// No triangle, no point.
pub(super) const NONE: u32 = u32::MAX;

/// A triangle: corners counter-clockwise, and the neighbour across from each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScatterTriangle {
    /// Vertices, one of which may be [`GHOST`].
    pub corners: [u32; 3],
    /// Triangles across from each corner.
    pub twins: [u32; 3],
}

/// Location of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointLocation {
    /// In or on the border of a triangle, or beyond the hull edge of a ghost.
    Triangle(u32),
    /// At a vertex.
    Vertex(u32),
}

/// An edge of a hole, counter-clockwise around it, and the triangle beyond.
#[derive(Clone, Copy, Debug)]
struct HoleEdge {
    from: u32,
    to: u32,
    beyond: u32,
}

/// A triangulation of at least three points that are not all on a line.
#[derive(Debug)]
pub struct ScatterMesh {
    points: Vec<Point>,
    triangles: Vec<ScatterTriangle>,
    /// A triangle near the last insertion.
    last: u32,
    /// Triangles that the last insertion removed, and those that took their place, in the order of
    /// the fan.
    removed: Vec<u32>,
    fan: Vec<u32>,
    rim: Vec<HoleEdge>,
    /// By triangle: the insertion that last removed it.
    stamp: Vec<u32>,
    /// By vertex (that at infinity first): the triangle of the fan that begins there.
    spoke: Vec<u32>,
}

fn at(point: Point) -> [i32; 2] {
    [point.x, point.y]
}

impl ScatterMesh {
    /// The triangulation of three points; `None` when they are on a line.
    pub fn new(corners: [Point; 3]) -> Option<Self> {
        let turn = orient(at(corners[0]), at(corners[1]), at(corners[2]));
        let points = match turn {
            0 => return None,
            _ if turn > 0 => corners.to_vec(),
            _ => vec![corners[0], corners[2], corners[1]],
        };
        let inner = ScatterTriangle { corners: [0, 1, 2], twins: [1, 2, 3] };
        let ghosts = [
            ScatterTriangle { corners: [2, 1, GHOST], twins: [3, 2, 0] },
            ScatterTriangle { corners: [0, 2, GHOST], twins: [1, 3, 0] },
            ScatterTriangle { corners: [1, 0, GHOST], twins: [2, 1, 0] },
        ];
        Some(Self {
            points,
            triangles: [inner].into_iter().chain(ghosts).collect(),
            last: 0,
            removed: Vec::new(),
            fan: Vec::new(),
            rim: Vec::new(),
            stamp: vec![0; 4],
            spoke: vec![0; 4],
        })
    }

    /// The triangulation of the first three points of `points` that are not collinear (and of no others); `None` if all
    /// are. Positions must be distinct.
    pub fn of_first(points: &[Point]) -> Option<Self> {
        let (&a, rest) = points.split_first()?;
        let &b = rest.first()?;
        rest.iter().find_map(|&c| Self::new([a, b, c]))
    }

    /// The vertices, in the order of their insertion.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// All triangles, including ghosts.
    pub fn triangles(&self) -> &[ScatterTriangle] {
        &self.triangles
    }

    /// Triangles made by the last insertion, in order around the new vertex, which is the last corner
    /// of each.
    pub fn fan(&self) -> &[u32] {
        &self.fan
    }

    /// Triangles that the last insertion removed; most of their numbers are in use again.
    pub fn removed(&self) -> &[u32] {
        &self.removed
    }

    /// The corners of a triangle; `None` for a ghost.
    #[inline]
    pub fn corners(&self, triangle: u32) -> Option<[Point; 3]> {
        let ScatterTriangle { corners, .. } = self.triangles[triangle as usize];
        (!corners.contains(&GHOST)).then(|| corners.map(|v| self.points[v as usize]))
    }

    /// The ends of a ghost's hull edge; the outside is on its left.
    #[inline]
    pub fn hull_edge(&self, triangle: u32) -> Option<[Point; 2]> {
        let ScatterTriangle { corners, .. } = self.triangles[triangle as usize];
        let i = corners.iter().position(|&v| v == GHOST)?;
        Some([1, 2].map(|k| self.points[corners[(i + k) % 3] as usize]))
    }

    /// Locates a point by a walk from the last location. Expected time grows with the distance walked.
    pub fn locate(&mut self, point: Point) -> PointLocation {
        let mut now = self.inner(self.last);
        loop {
            let ScatterTriangle { corners, twins } = self.triangles[now as usize];
            let Some(points) = self.corners(now) else { break };
            if let Some(k) = points.iter().position(|&v| at(v) == at(point)) {
                return PointLocation::Vertex(corners[k]);
            }
            let beyond = (0..3)
                .find(|&k| orient(at(points[(k + 1) % 3]), at(points[(k + 2) % 3]), at(point)) < 0);
            match beyond {
                Some(k) => now = twins[k],
                None => break,
            }
        }
        self.last = now;
        PointLocation::Triangle(now)
    }

    /// The triangle itself, or the one behind a ghost.
    fn inner(&self, triangle: u32) -> u32 {
        let ScatterTriangle { corners, twins } = self.triangles[triangle as usize];
        corners.iter().position(|&v| v == GHOST).map_or(triangle, |i| twins[i])
    }

    /// Inserts a point; returns the vertex, or `None` if its position is occupied.
    pub fn insert(&mut self, point: Point) -> Option<u32> {
        match self.locate(point) {
            PointLocation::Vertex(_) => None,
            PointLocation::Triangle(triangle) => Some(self.insert_at(point, triangle)),
        }
    }

    /// Inserts a point located in `triangle` that is not at a vertex.
    pub fn insert_at(&mut self, point: Point, triangle: u32) -> u32 {
        let vertex = self.points.len() as u32;
        self.points.push(point);
        self.spoke.push(NONE);
        self.clear_hole(point, vertex, triangle);
        self.fill_hole(vertex);
        vertex
    }

    /// Collects the triangles whose circle contains the point, and the border of the hole.
    fn clear_hole(&mut self, point: Point, stamp: u32, first: u32) {
        self.removed.clear();
        self.rim.clear();
        self.removed.push(first);
        self.stamp[first as usize] = stamp;
        let mut done = 0;
        while let Some(&now) = self.removed.get(done) {
            done += 1;
            let ScatterTriangle { corners, twins } = self.triangles[now as usize];
            for k in 0..3 {
                let beyond = twins[k];
                if self.stamp[beyond as usize] == stamp {
                    continue;
                }
                if self.is_hit(beyond, point) {
                    self.stamp[beyond as usize] = stamp;
                    self.removed.push(beyond);
                } else {
                    let (from, to) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                    self.rim.push(HoleEdge { from, to, beyond });
                }
            }
        }
    }

    /// True if the circle of the triangle contains the point; the circle of a ghost is the half-plane beyond its edge,
    /// with the edge itself.
    fn is_hit(&self, triangle: u32, point: Point) -> bool {
        if let Some([a, b, c]) = self.corners(triangle) {
            return in_circle(at(a), at(b), at(c), at(point));
        }
        let Some([a, b]) = self.hull_edge(triangle) else { return false };
        let turn = orient(at(a), at(b), at(point));
        turn > 0 || (turn == 0 && (a.min(b)..b.max(a)).contains(&point))
    }

    /// Fills the hole with triangles from its rim to the vertex.
    fn fill_hole(&mut self, vertex: u32) {
        self.fan.clear();
        for i in 0..self.rim.len() {
            let HoleEdge { from, to, beyond } = self.rim[i];
            let slot = self.slot(i);
            self.triangles[slot as usize] =
                ScatterTriangle { corners: [from, to, vertex], twins: [NONE, NONE, beyond] };
            self.spoke[spoke(from)] = slot;
            self.turn_to(beyond, [to, from], slot);
        }
        let first = self.spoke[spoke(self.rim[0].from)];
        let mut now = first;
        loop {
            self.fan.push(now);
            let next = self.spoke[spoke(self.triangles[now as usize].corners[1])];
            self.triangles[now as usize].twins[0] = next;
            self.triangles[next as usize].twins[1] = now;
            now = next;
            if now == first {
                break;
            }
        }
        self.last = first;
    }

    /// A slot for the `i`-th triangle of the fan: a released or a new one.
    fn slot(&mut self, i: usize) -> u32 {
        if let Some(&old) = self.removed.get(i) {
            return old;
        }
        self.triangles.push(ScatterTriangle { corners: [NONE; 3], twins: [NONE; 3] });
        self.stamp.push(0);
        self.triangles.len() as u32 - 1
    }

    /// Makes `twin` the neighbour of a triangle across its directed edge.
    fn turn_to(&mut self, triangle: u32, edge: [u32; 2], twin: u32) {
        let ScatterTriangle { corners, twins } = &mut self.triangles[triangle as usize];
        for k in 0..3 {
            if [corners[(k + 1) % 3], corners[(k + 2) % 3]] == edge {
                twins[k] = twin;
            }
        }
    }
}

/// Index of a vertex in the list of spokes.
fn spoke(vertex: u32) -> usize {
    vertex.wrapping_add(1) as usize
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Fails unless the mesh is closed, counter-clockwise, and Delaunay at every edge.
    pub(in super::super) fn validate(mesh: &ScatterMesh) {
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let twin = mesh.triangles[triangle.twins[k] as usize];
                let back = twin.twins.iter().position(|&t| t as usize == i).unwrap();
                let edge = [triangle.corners[(k + 1) % 3], triangle.corners[(k + 2) % 3]];
                assert_eq!([twin.corners[(back + 2) % 3], twin.corners[(back + 1) % 3]], edge);
                let apex = twin.corners[back];
                if apex != GHOST {
                    assert!(!mesh.is_hit(i as u32, mesh.points[apex as usize]), "{triangle:?}");
                }
            }
            if let Some([a, b, c]) = mesh.corners(i as u32) {
                assert!(orient(at(a), at(b), at(c)) > 0);
            }
        }
        // Euler: with the vertex at infinity, V - E + F = 2 and 3 F = 2 E.
        assert_eq!(mesh.triangles.len(), 2 * (mesh.points.len() + 1) - 4);
    }

    /// The mesh of points in their order; none where all are on a line.
    fn mesh_of(points: &[Point]) -> Option<ScatterMesh> {
        let first = ScatterMesh::of_first(points);
        assert_eq!(first.is_none(), terrane_delaunay::ConvexHull::of(points.to_vec()).is_flat());
        let mut mesh = first?;
        points.iter().for_each(|&p| {
            mesh.insert(p);
        });
        Some(mesh)
    }

    fn sorted(mesh: &ScatterMesh) -> Vec<[Point; 3]> {
        let turned = |mut t: [Point; 3]| {
            let least = (0..3).min_by_key(|&k| t[k]).unwrap();
            t.rotate_left(least);
            t
        };
        let mut all: Vec<_> =
            (0..mesh.triangles.len() as u32).filter_map(|t| mesh.corners(t).map(turned)).collect();
        all.sort_unstable();
        all
    }

    proptest! {
        #[test]
        fn small_lattices_are_triangulated_alike_in_any_order(
            points in prop::collection::hash_set((0..7i32, 0..7i32), 3..30), seed in any::<u64>()
        ) {
            let mut points: Vec<Point> = points.iter().map(|&(x, y)| Point::new(x, y, 0)).collect();
            points.sort_unstable();
            let first = mesh_of(&points);
            let turn = points.len() as u64;
            for i in (1..points.len()).rev() {
                points.swap(i, (seed.rotate_left(i as u32) % turn) as usize % (i + 1));
            }
            // The first two may start a line of all the others.
            if let (Some(first), Some(second)) = (first, mesh_of(&points)) {
                validate(&first);
                validate(&second);
                prop_assert_eq!(sorted(&first), sorted(&second));
            }
        }

        #[test]
        fn wide_clouds_are_triangulated(
            points in prop::collection::vec((-(1<<29)+1..1<<29, -(1<<29)+1..1<<29), 3..60)
        ) {
            let points: Vec<Point> = points.iter().map(|&(x, y)| Point::new(x, y, 0)).collect();
            if let Some(mesh) = mesh_of(&points) {
                validate(&mesh);
            }
        }
    }
}
