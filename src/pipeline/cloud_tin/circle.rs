//! Circles around triangles, in `f64` and never too small.

use crate::geom::Point;

/// A disc that holds the circumcircle of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circle {
    centre: [f64; 2],
    radius: f64,
}

impl Circle {
    /// Around a counter-clockwise triangle. The centre's numerator and denominator are exact; what
    /// rounding is left is added to the radius.
    pub(super) fn around([a, b, c]: [Point; 3]) -> Self {
        let from = |p: Point| [p.x - a.x, p.y - a.y].map(i128::from);
        let ([bx, by], [cx, cy]) = (from(b), from(c));
        let (bb, cc) = (bx * bx + by * by, cx * cx + cy * cy);
        let area = 2.0 * (bx * cy - by * cx) as f64;
        let at = [(cy * bb - by * cc) as f64 / area, (bx * cc - cx * bb) as f64 / area];
        let radius = at[0].hypot(at[1]);
        let centre = [f64::from(a.x) + at[0], f64::from(a.y) + at[1]];
        Self { centre, radius: radius * (1.0 + 1e-12) + 1.0 }
    }

    /// Lowest and highest corner of the box around it, whole.
    pub(super) fn corners(&self) -> [[i64; 2]; 2] {
        let low = self.centre.map(|c| (c - self.radius).floor() as i64);
        [low, self.centre.map(|c| (c + self.radius).ceil() as i64)]
    }

    /// Lowest and highest x of its part between two heights; `None` when there is none.
    pub(super) fn between(&self, low: f64, high: f64) -> Option<[f64; 2]> {
        let off = self.centre[1].clamp(low, high) - self.centre[1];
        let half = self.radius * self.radius - off * off;
        (half >= 0.0).then(|| [self.centre[0] - half.sqrt(), self.centre[0] + half.sqrt()])
    }

    /// True when the box has a point of the disc.
    pub(super) fn meets(&self, [low, high]: [[i32; 2]; 2]) -> bool {
        let off = [0, 1].map(|axis| {
            let nearest = self.centre[axis].clamp(f64::from(low[axis]), f64::from(high[axis]));
            nearest - self.centre[axis]
        });
        off[0] * off[0] + off[1] * off[1] <= self.radius * self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_disc_holds_the_corners_and_its_boxes(
            c in prop::array::uniform3((-(1 << 29)..1 << 29, -(1 << 29)..1 << 29)),
        ) {
            let points = c.map(|(x, y)| Point::new(x, y, 0));
            let [a, b, c] = points;
            let from = |p: Point| [i64::from(p.x) - i64::from(a.x), i64::from(p.y) - i64::from(a.y)];
            prop_assume!(from(b)[0] * from(c)[1] != from(b)[1] * from(c)[0]);
            let circle = Circle::around(points);
            for p in points {
                prop_assert!(circle.meets([[p.x, p.y]; 2]));
                let [low, high] = circle.corners();
                prop_assert!(low[0] <= i64::from(p.x) && i64::from(p.x) <= high[0]);
                let [west, east] = circle.between(f64::from(p.y), f64::from(p.y) + 9.0).unwrap();
                prop_assert!(west <= f64::from(p.x) + 1.0 && f64::from(p.x) - 1.0 <= east);
            }
        }
    }
}
