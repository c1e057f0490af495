//! Positions of points in space, and distances between them and the boxes around them.

use terrane_base::geom::Point;

/// Scale and origin of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricSpace {
    /// Metres of a step along each axis.
    pub step: [f64; 3],
    /// Steps from coordinate zero to the origin.
    pub zero: [i64; 3],
}

/// The lowest and the highest coordinates of some points.
pub type Bounds = [Point; 2];

/// Fractions of the longest step that distances are counted in.
const PARTS: f64 = 1024.0;

impl MetricSpace {
    /// Metres of the unit that distances are counted in.
    pub fn unit(&self) -> f64 {
        self.step.into_iter().fold(0.0, f64::max) / PARTS
    }

    /// The squared distance of two points, in square metres.
    pub(crate) fn between(&self, a: Point, b: Point) -> f64 {
        self.square(apart(a, b).map(f64::abs))
    }

    /// The same of steps along the axes. No number of it gets less when steps get more: bounds hold for what is within
    /// them to the last bit.
    pub(crate) fn square(&self, steps: [f64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| steps[axis] * self.step[axis]);
        x * x + y * y + z * z
    }

    /// The squared distance of two boxes, in square metres.
    pub fn gap(&self, a: Bounds, b: Bounds) -> f64 {
        self.square(gaps(a, b))
    }
}

/// Steps from a point to another.
fn apart(a: Point, b: Point) -> [f64; 3] {
    [(a.x, b.x), (a.y, b.y), (a.z, b.z)].map(|(a, b)| f64::from(b) - f64::from(a))
}

/// Steps between two boxes along each axis.
pub(super) fn gaps(a: Bounds, b: Bounds) -> [f64; 3] {
    let (over, under) = (apart(a[1], b[0]), apart(b[1], a[0]));
    [0, 1, 2].map(|axis| over[axis].max(under[axis]).max(0.0))
}

/// The bounds of points; `None` for no points.
pub(crate) fn bounds(points: impl Iterator<Item = Point>) -> Option<Bounds> {
    points.map(|point| [point; 2]).reduce(|[low, high], [point, _]| {
        [
            Point { x: low.x.min(point.x), y: low.y.min(point.y), z: low.z.min(point.z) },
            Point { x: high.x.max(point.x), y: high.y.max(point.y), z: high.z.max(point.z) },
        ]
    })
}
