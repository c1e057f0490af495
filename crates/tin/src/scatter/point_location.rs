//! Point location among the triangles of a fan.

use super::mesh::ScatterMesh;
use super::search::{ScatterSearch, from};
use terrane_base::geom::Point;
use terrane_delaunay::orient;

/// The sides of a triangle.
pub(super) struct TriangleSides([[i64; 3]; 3]);

impl TriangleSides {
    pub(super) fn new(corners: [Point; 3]) -> Self {
        Self([0, 1, 2].map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let ([x, y, _], [ax, ay]) = (from(a, b), [a.x, a.y].map(i64::from));
            [x, -y, y * ax - x * ay]
        }))
    }

    /// True for a point within, on no side.
    #[inline(always)]
    pub(super) fn hold(&self, point: Point) -> bool {
        let [x, y] = [point.x, point.y].map(i64::from);
        self.0.iter().all(|[by_y, by_x, add]| by_y * y + by_x * x + add > 0)
    }
}

/// The triangles around a new vertex, to find points in.
#[derive(Debug, Default)]
pub(super) struct TriangleFan {
    centre: [i32; 2],
    pub(super) spokes: Vec<FanEdge>,
    /// Bit mask of the first spokes whose triangles are not ghosts.
    inner: u64,
    /// Location of the last point.
    last: usize,
}

/// The side of a fan triangle at which it begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct FanEdge {
    end: [i32; 2],
    pub(super) triangle: u32,
    /// The search of a triangle that is not a ghost.
    pub(super) search: Option<ScatterSearch>,
}

impl FanEdge {
    fn new(mesh: &ScatterMesh, triangle: u32) -> Self {
        let corners = mesh.triangles()[triangle as usize].corners;
        let end = mesh.points().get(corners[0] as usize).map_or([0; 2], |p| [p.x, p.y]);
        let search = mesh.corners(triangle).map(|corners| ScatterSearch::new(triangle, corners));
        Self { end, triangle, search }
    }
}

impl TriangleFan {
    /// Loads the fan of the last inserted vertex.
    pub(super) fn turn_to(&mut self, mesh: &ScatterMesh, centre: Point) {
        self.centre = [centre.x, centre.y];
        self.spokes.clear();
        self.spokes.extend(mesh.fan().iter().map(|&triangle| FanEdge::new(mesh, triangle)));
        let bits = self.spokes.iter().take(64).enumerate();
        self.inner = bits.map(|(i, spoke)| u64::from(spoke.search.is_some()) << i).sum();
        self.last = 0;
    }

    /// The search of the triangle that contains an existing point; `None` for the centre itself.
    #[inline(always)]
    pub(super) fn search_of(&mut self, point: Point) -> Option<&mut ScatterSearch> {
        let point = [point.x, point.y];
        // Points that are near each other in the list are mostly in one triangle.
        if !self.is_in(self.last, point) {
            self.last = self.at_once(point).or_else(|| self.find(point))?;
        }
        self.spokes[self.last].search.as_mut()
    }

    #[inline(always)]
    fn side(&self, spoke: usize, point: [i32; 2]) -> i64 {
        let spoke = if spoke == self.spokes.len() { 0 } else { spoke };
        orient(self.centre, self.spokes[spoke].end, point)
    }

    /// True if a point is left of a triangle's spoke, or on it, and right of the next one. True for at most one
    /// triangle, as no angle reaches 180 degrees.
    #[inline(always)]
    fn is_in(&self, i: usize, point: [i32; 2]) -> bool {
        (self.side(i, point) >= 0) & (self.side(i + 1, point) < 0) & self.spokes[i].search.is_some()
    }

    /// The index of the triangle that contains a point, by a branchless test of all spokes; `None` if the test is
    /// inconclusive.
    fn at_once(&self, point: [i32; 2]) -> Option<usize> {
        let count = self.spokes.len();
        if count > 64 || point == self.centre {
            return None;
        }
        let left = (0..count).map(|i| u64::from(self.side(i, point) >= 0) << i).sum::<u64>();
        let is_left_of_next = left >> 1 | left << (count - 1);
        let found = left & !is_left_of_next & self.inner;
        (found != 0).then(|| found.trailing_zeros() as usize)
    }

    /// The same by a sequential test of the spokes.
    #[cold]
    fn find(&self, point: [i32; 2]) -> Option<usize> {
        if point == self.centre {
            return None;
        }
        let mut all = 0..self.spokes.len();
        // A point on the last spoke before a gap in the fan is on no left side of a later one.
        all.clone().find(|i| self.is_in(*i, point)).or_else(|| {
            all.find(|&i| {
                self.spokes[i].search.is_some()
                    && self.side(i, point) > 0
                    && self.side(i + 1, point) == 0
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::greedy::tests::{cloud, hull_of};
    use proptest::prelude::*;

    proptest! {
        /// A fan of any size, with ghosts and with points on its spokes: what looks at all of them at once finds what
        /// one after the other does, or nothing.
        #[test]
        fn spokes_at_once_are_spokes_one_by_one(points in cloud(), centre in (-1..61i32, -1..61i32)) {
            let Some(mut mesh) = hull_of(&points) else { return Ok(()) };
            for point in &points {
                mesh.insert(*point);
            }
            let centre = Point::new(centre.0, centre.1, 0);
            prop_assume!(mesh.insert(centre).is_some());
            let mut fan = TriangleFan::default();
            fan.turn_to(&mesh, centre);
            let mut found = 0;
            for point in (0..3600).map(|i| [i % 60, i / 60]) {
                let (at_once, one_by_one) = (fan.at_once(point), fan.find(point));
                prop_assert!(at_once.is_none() || at_once == one_by_one, "{point:?} {fan:?}");
                let found_by = fan.search_of(Point::new(point[0], point[1], 0)).map(|s| s.worst.triangle);
                prop_assert_eq!(found_by, one_by_one.map(|i| fan.spokes[i].triangle));
                found += usize::from(at_once.is_some());
                let triangles = fan.spokes.iter().filter_map(|spoke| Some(spoke.search?.corners));
                for corners in triangles {
                    let [a, b, c] = corners.map(|corner| [corner.x, corner.y]);
                    let is_in = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| orient(*a, *b, point) > 0);
                    prop_assert!(!is_in || at_once.is_some());
                    prop_assert_eq!(TriangleSides::new(corners).hold(Point::new(point[0], point[1], 9)), is_in);
                }
            }
            prop_assert!(found > 0 || fan.spokes.len() < 4);
        }
    }
}
