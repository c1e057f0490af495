//! World coordinates of stored vertices to steps of a cloud's frame.
//!
//! The rule: a coordinate that lies as close to a whole step as the rounding of its storage explains
//! *is* that step. Everything further away is kept as it is.

use crate::lattice_position::{SMALLEST_RADIUS, STEPS, farthest};
use crate::{ProofPosition, ProofVertex, Snap, SnapOutcome};
use terrane_base::geom::{Point, Point3, PointFrame};

/// Maximum distance in steps that rounding of storage can explain; coarser storage is not compensated.
const LARGEST_RADIUS: f64 = 0.5;

/// Maps stored vertices to the lattice of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeSnapper {
    frame: PointFrame,
    low: [i32; 2],
    radius: [f64; 3],
}

impl LatticeSnapper {
    /// For a cloud within `bounds`, and vertices stored relative to `origin`, in f32 when
    /// `single_precision`.
    pub fn new(
        frame: PointFrame,
        bounds: [Point; 2],
        origin: Point3,
        single_precision: bool,
    ) -> Self {
        let corners = bounds.map(|corner| frame.world(corner));
        let radius = std::array::from_fn(|axis| {
            let coordinates = corners.map(|corner| corner[axis]);
            let largest = farthest(&coordinates, 0.0) + frame.offset[axis].abs();
            let computed = f64::EPSILON / 2.0 * largest;
            let stored = f64::from(f32::EPSILON) / 2.0 * farthest(&coordinates, origin[axis]);
            let rounding = computed + if single_precision { stored } else { 0.0 };
            (STEPS * rounding / frame.scale[axis]).clamp(SMALLEST_RADIUS, LARGEST_RADIUS)
        });
        Self { frame, low: [bounds[0].x, bounds[0].y], radius }
    }

    /// Coordinates this close to a whole step are that step; in steps, on the coarsest axis.
    pub fn radius(&self) -> f64 {
        self.radius.into_iter().fold(0.0, f64::max)
    }

    /// World position of a place on the lattice.
    pub fn world(&self, at: ProofPosition) -> [f64; 2] {
        let steps = [at.cols() + f64::from(self.low[0]), at.rows() + f64::from(self.low[1])];
        [0, 1].map(|axis| steps[axis] * self.frame.scale[axis] + self.frame.offset[axis])
    }

    /// A coordinate in steps, and how far it was moved to be whole; `None` when too far for that.
    fn settle(&self, axis: usize, world: f64) -> (f64, Option<f64>) {
        let steps = self.frame.steps(axis, world);
        let whole = steps.round();
        let moved = (steps - whole).abs();
        if moved <= self.radius[axis] { (whole, Some(moved)) } else { (steps, None) }
    }
}

impl Snap for LatticeSnapper {
    fn snap(&self, stored: Point3) -> SnapOutcome {
        let [x, y, z] = std::array::from_fn(|axis| self.settle(axis, stored[axis]));
        let (col, row) = (x.0 - f64::from(self.low[0]), y.0 - f64::from(self.low[1]));
        if !(col.abs() < ProofPosition::LIMIT
            && row.abs() < ProofPosition::LIMIT
            && z.0.is_finite())
        {
            return SnapOutcome::Unusable;
        }
        let vertex = ProofVertex { at: ProofPosition::nearest(col, row), z: z.0 };
        let (Some(dx), Some(dy), Some(dz)) = (x.1, y.1, z.1) else {
            return SnapOutcome::Free(vertex);
        };
        let point = [x.0, y.0, z.0].map(|steps| steps as i32);
        match self.frame.world(Point::new(point[0], point[1], point[2])) == stored {
            true => SnapOutcome::Exact(vertex),
            false => SnapOutcome::Moved(vertex, dx.max(dy).max(dz)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::REACH;

    const FRAME: PointFrame = PointFrame { scale: [0.01, 0.01, 0.001], offset: [-3e6, 4e6, 17.3] };
    const BOUNDS: [Point; 2] =
        [Point::new(-REACH, -REACH, -REACH), Point::new(REACH, REACH, REACH)];

    fn points() -> impl Iterator<Item = Point> {
        let far = |i: i64| (i * 536_870_909 % i64::from(REACH)) as i32;
        (-2000..2000).map(move |i: i64| Point::new(far(i), far(i * 7 + 1), far(i * 31 + 5)))
    }

    fn is(snapped: SnapOutcome, point: Point) -> bool {
        let (col, row) = (i64::from(point.x + REACH), i64::from(point.y) + i64::from(REACH));
        let vertex = ProofVertex { at: ProofPosition::sample(col, row), z: f64::from(point.z) };
        snapped.vertex() == Some(vertex)
    }

    #[test]
    fn doubles_come_back_to_their_points() {
        let placer = LatticeSnapper::new(FRAME, BOUNDS, [0.0; 3], false);
        assert!(placer.radius() < 1e-4, "{}", placer.radius());
        for point in points() {
            let world = FRAME.world(point);
            assert!(is(placer.snap(world), point));
            assert!(matches!(placer.snap(world), SnapOutcome::Exact(_)));
            assert!(is(placer.snap(world.map(f64::next_up)), point));
            let half = [world[0] + 0.005, world[1], world[2]];
            assert!(matches!(placer.snap(half), SnapOutcome::Free(_)));
        }
    }

    #[test]
    fn floats_with_an_origin_come_back_too() {
        let bounds = [Point::new(-(1 << 23), 5, -9), Point::new(1 << 23, 1 << 24, 9)];
        let origin = FRAME.world(Point::new(0, 1 << 23, 0));
        let placer = LatticeSnapper::new(FRAME, bounds, origin, true);
        for i in 0..5000 {
            let point = Point::new((1 << 23) - i * 3301, 5 + i * 3301, i % 19 - 9);
            let world = FRAME.world(point);
            let stored =
                std::array::from_fn(|k| origin[k] + f64::from((world[k] - origin[k]) as f32));
            let vertex = placer.snap(stored).vertex().unwrap();
            let at = ProofPosition::sample(i64::from(point.x + (1 << 23)), i64::from(point.y - 5));
            assert_eq!(vertex, ProofVertex { at, z: f64::from(point.z) });
        }
    }

    #[test]
    fn a_height_between_steps_leaves_the_position_whole() {
        let placer =
            LatticeSnapper::new(FRAME, [Point::new(0, 0, 0), Point::new(9, 9, 9)], [0.0; 3], false);
        let [x, y, z] = FRAME.world(Point::new(3, 4, 5));
        let SnapOutcome::Free(vertex) = placer.snap([x, y, z + 0.0005]) else { panic!("not free") };
        assert_eq!(vertex.at, ProofPosition::sample(3, 4));
        assert!((vertex.z - 5.5).abs() < 1e-6);
        assert_eq!(placer.world(vertex.at), [x, y]);
        for bad in [[f64::NAN, y, z], [x, y, f64::INFINITY], [1e10, y, z]] {
            assert_eq!(placer.snap(bad), SnapOutcome::Unusable);
        }
    }
}
