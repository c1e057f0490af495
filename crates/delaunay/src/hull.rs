//! Convex hulls of points: exact, with every point of the boundary, and mergeable.

use super::position::FixedPosition;
use super::predicates::{orient, site};
use terrane_base::geom::Point;

/// The boundary of the convex hull of points: *all* points on it, those between corners too, of each
/// position the lowest. Hulls of parts merge into that of the whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConvexHull {
    /// From the lowest point (x, then y) to the highest along the south.
    lower: Vec<Point>,
    /// From the lowest to the highest along the north; both ends are in `lower` as well.
    upper: Vec<Point>,
    /// Once around, counter-clockwise.
    ring: Vec<Point>,
}

/// Minimum number of points for thinning out.
const FEW: usize = 64;

/// Position relative to a hull.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HullLocation {
    /// Strictly inside.
    Inside,
    /// On the boundary.
    Boundary,
    /// Beyond it.
    Outside,
}

impl ConvexHull {
    /// The hull of any points: Andrew's monotone chain on those that are not well inside. Linear where
    /// most are, n log n at worst.
    pub fn of(mut points: Vec<Point>) -> Self {
        if points.len() > FEW {
            let inner = Self::chains(extremes(&points));
            points.retain(|p| !inner.surrounds(p));
        }
        Self::chains(points)
    }

    fn chains(mut points: Vec<Point>) -> Self {
        points.sort_unstable();
        points.dedup_by_key(|p| [p.x, p.y]);
        let lower = chain(&points, 1);
        let upper = chain(&points, -1);
        let inner = upper.get(1..upper.len().saturating_sub(1)).unwrap_or(&[]);
        let ring = lower.iter().chain(inner.iter().rev()).copied().collect();
        Self { lower, upper, ring }
    }

    /// True when the point lies strictly inside; linear in the corners.
    fn surrounds(&self, p: &Point) -> bool {
        let Some(&last) = self.ring.last() else { return false };
        let mut before = last;
        self.ring.iter().all(|&corner| {
            let side = orient(site(&before), site(&corner), site(p));
            before = corner;
            side > 0
        })
    }

    /// The hull of the points of both.
    #[must_use]
    pub fn merge(&self, other: &Self) -> Self {
        Self::of(self.points().chain(other.points()).copied().collect())
    }

    /// Every point of the boundary (those of a degenerate hull may come twice).
    fn points(&self) -> impl Iterator<Item = &Point> {
        self.lower.iter().chain(&self.upper)
    }

    /// The boundary once around, counter-clockwise from the lowest point. Where all points are
    /// collinear: there and back, without the ends a second time.
    pub fn ring(&self) -> &[Point] {
        &self.ring
    }

    /// The corners of the boundary, counter-clockwise from the lowest point, without the points that
    /// lie on its edges; none where all points are collinear.
    pub fn corners(&self) -> Vec<Point> {
        let (ring, count) = (&self.ring, self.ring.len());
        let corners = (0..count).filter(|&i| {
            let [a, b, c] = [i + count - 1, i, i + 1].map(|i| site(&ring[i % count]));
            orient(a, b, c) > 0
        });
        corners.map(|i| ring[i]).collect()
    }

    /// The points of the boundary, in order, once each.
    pub fn sorted(&self) -> Vec<Point> {
        let mut all: Vec<_> = self.points().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// True when it has no area: fewer than three points, or all collinear.
    pub fn is_flat(&self) -> bool {
        self.lower == self.upper
    }

    /// Locates a position; logarithmic. Nothing lies inside a flat hull.
    pub fn locate(&self, q: FixedPosition) -> HullLocation {
        let below = side(&self.lower, q);
        let above = side(&self.upper, q);
        match (below, above) {
            (Some(below), Some(above)) if below > 0 && above < 0 => HullLocation::Inside,
            (Some(below), Some(above)) if below >= 0 && above <= 0 => HullLocation::Boundary,
            _ => HullLocation::Outside,
        }
    }

    /// Corners of a triangle of boundary points that contains a position of the hull, moved by an
    /// infinitesimal (see [`FixedPosition`]'s arms); `None` when the moved position is outside.
    pub(super) fn start(&self, q: FixedPosition, back: bool) -> Option<[Point; 3]> {
        let (apex, others) = self.ring.split_first()?;
        let to_apex = q.to(site(apex));
        let left = others.partition_point(|p| to_apex.sees_left(q.to(site(p)), back));
        let [u, v] = [others.get(left.checked_sub(1)?)?, others.get(left)?];
        q.to(site(u)).sees_left(q.to(site(v)), back).then_some([*apex, *u, *v])
    }
}

/// The extreme points in eight directions: points strictly within them are not on the hull.
fn extremes(points: &[Point]) -> Vec<Point> {
    let axes: [fn(&Point) -> i32; 4] = [|p| p.x, |p| p.y, |p| p.x + p.y, |p| p.x - p.y];
    let ends = axes.iter().flat_map(|axis| {
        [points.iter().min_by_key(|p| axis(p)), points.iter().max_by_key(|p| axis(p))]
    });
    ends.flatten().copied().collect()
}

/// The chain of sorted points along which all others lie to the left (`turn` 1) or right (-1).
fn chain(points: &[Point], turn: i64) -> Vec<Point> {
    let mut chain: Vec<Point> = Vec::new();
    for &p in points {
        while let [.., a, b] = chain[..] {
            // Collinear points stay: a position on the boundary is found between any two neighbours of it.
            if orient(site(&a), site(&b), site(&p)) * turn >= 0 {
                break;
            }
            chain.pop();
        }
        chain.push(p);
    }
    chain
}

/// On which side of a chain a position lies: positive for left; `None` before its begin or after its
/// end (in order of x, then y). Comparing by y where x is equal makes vertical edges like others.
fn side(chain: &[Point], q: FixedPosition) -> Option<i128> {
    let after = chain.partition_point(|p| FixedPosition::of(site(p)) <= q);
    let before = site(&chain[after.checked_sub(1)?]);
    let Some(after) = chain.get(after) else {
        return (FixedPosition::of(before) == q).then_some(0);
    };
    Some(q.to(before).cross(q.to(site(after))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(most: i32) -> impl Strategy<Value = Vec<Point>> {
        let point = (-most..=most, -most..=most, 0..3);
        prop::collection::vec(point.prop_map(|(x, y, z)| Point::new(x, y, z)), 0..30)
    }

    /// A point is on the boundary when some line through it has all others on one side.
    fn brute(points: &[Point]) -> Vec<Point> {
        let mut sorted = points.to_vec();
        sorted.sort();
        sorted.dedup_by_key(|p| [p.x, p.y]);
        let on = |p: &&Point| {
            let edge = |q: &Point| {
                let bounds = |r: &Point| orient(site(p), site(q), site(r)) >= 0;
                q != *p && sorted.iter().all(bounds)
            };
            sorted.len() == 1 || sorted.iter().any(edge) || {
                let edge =
                    |q: &Point| sorted.iter().all(|r| orient(site(q), site(p), site(r)) >= 0);
                sorted.iter().any(|q| q != *p && edge(q))
            }
        };
        sorted.iter().filter(on).copied().collect()
    }

    fn brute_place(sorted: &[Point], hull: &ConvexHull, q: FixedPosition) -> HullLocation {
        if hull.is_flat() {
            return hull.locate(q);
        }
        let ring = hull.ring();
        let sides = (0..ring.len()).map(|i| {
            let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
            q.to([a.x, a.y]).cross(q.to([b.x, b.y]))
        });
        let worst = sides.min().unwrap();
        assert!(sorted.len() >= 3);
        match worst.signum() {
            1 => HullLocation::Inside,
            0 => HullLocation::Boundary,
            _ => HullLocation::Outside,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]
        #[test]
        fn holds_every_point_of_the_boundary(points in points(6)) {
            let hull = ConvexHull::of(points.clone());
            prop_assert_eq!(hull.sorted(), brute(&points));
        }

        #[test]
        fn points_well_inside_make_no_difference(points in prop::collection::vec(
            (-40i32..40, -40i32..40, 0..3).prop_map(|(x, y, z)| Point::new(x + y, x - y / 2, z)),
            65..300,
        )) {
            prop_assert_eq!(ConvexHull::of(points.clone()), ConvexHull::chains(points));
        }

        #[test]
        fn hulls_of_parts_merge(points in points(8), cut in 0usize..30) {
            let (a, b) = points.split_at(cut.min(points.len()));
            let merged = ConvexHull::of(a.to_vec()).merge(&ConvexHull::of(b.to_vec()));
            prop_assert_eq!(merged, ConvexHull::of(points));
        }

        #[test]
        fn places_positions(points in points(6), x in -2_000i64..2_000, y in -2_000i64..2_000) {
            let hull = ConvexHull::of(points);
            if let [first, .., last] = &hull.sorted()[..] {
                let side = |p: &Point| orient([first.x, first.y], [last.x, last.y], [p.x, p.y]);
                prop_assert_eq!(hull.is_flat(), hull.ring().iter().all(|p| side(p) == 0));
            }
            for q in [FixedPosition { x, y }, FixedPosition { x: x & !127, y: y & !127 }] {
                prop_assert_eq!(hull.locate(q), brute_place(&hull.sorted(), &hull, q));
                let start = hull.start(q, false);
                prop_assert!(start.is_some() || hull.locate(q) != HullLocation::Inside);
                for corners in start.into_iter() {
                    let [a, b, c] = corners.map(|p| q.to([p.x, p.y]));
                    prop_assert!(a.cross(b) >= 0 && b.cross(c) >= 0 && c.cross(a) >= 0);
                    prop_assert!(hull.locate(q) != HullLocation::Outside);
                }
            }
        }
    }

    #[test]
    fn corners_are_the_points_that_do_not_lie_between_two_others() {
        // Three by three, of which the middle and the middles of the sides are no corners.
        let lattice = (0..9).map(|i| Point::new(i % 3 * 2, i / 3 * 5, i)).collect();
        let corners = ConvexHull::of(lattice).corners();
        assert_eq!(corners.iter().map(|p| p.z).collect::<Vec<_>>(), [0, 2, 8, 6]);
        let triangle = [[0, 0, 7], [9, 1, 8], [3, 6, 9]].map(|[x, y, z]| Point::new(x, y, z));
        assert_eq!(ConvexHull::of(triangle.to_vec()).corners(), triangle);
        let line = ConvexHull::of((0..5).map(|i| Point::new(i, 2 * i, 0)).collect());
        assert_eq!(line.corners(), []);
    }

    #[test]
    fn flat_hulls_have_no_inside() {
        let line = ConvexHull::of((0..5).map(|i| Point::new(i, 2 * i, 0)).collect());
        assert!(line.is_flat() && line.sorted().len() == 5 && line.ring().len() == 8);
        assert_eq!(line.locate(FixedPosition::of([1, 2])), HullLocation::Boundary);
        assert_eq!(line.locate(FixedPosition::of([1, 3])), HullLocation::Outside);
        assert_eq!(ConvexHull::of(vec![]).locate(FixedPosition::of([0, 0])), HullLocation::Outside);
        let vertical = ConvexHull::of((0..5).map(|i| Point::new(0, i, 0)).collect());
        assert_eq!(vertical.locate(FixedPosition::of([0, 3])), HullLocation::Boundary);
        assert_eq!(vertical.locate(FixedPosition::of([0, 5])), HullLocation::Outside);
    }
}
