//! The shape of one triangle, in plan or in space.

use crate::{ProofPosition, ProofTriangle};

/// The shape of a triangle with an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleShape {
    /// The smallest angle, in degrees: at most 60.
    pub smallest_angle: f64,
    /// The largest angle, in degrees: at least 60.
    pub largest_angle: f64,
    /// The aspect ratio of the Verdict library: longest edge by the radius of the inscribed circle, by
    /// 2 sqrt(3), so that it is 1 for an equilateral triangle and larger for every other. P. P. Pebay and
    /// T. J. Baker, "Analysis of triangle quality measures" (2003).
    pub aspect_ratio: f64,
}

impl TriangleShape {
    /// In plan; `None` without an area. The area is exact, so angles of needles are accurate.
    pub fn in_plan(triangle: &ProofTriangle) -> Option<Self> {
        let area = triangle.double_area();
        let p = triangle.positions();
        let sides = [0, 1, 2].map(|i| {
            let [x, y] = p[(i + 2) % 3].minus(p[(i + 1) % 3]);
            [x, y, 0.0]
        });
        let cell = ProofPosition::CELL as f64;
        (area != 0).then(|| Self::of(sides, area.unsigned_abs() as f64 / cell / cell))
    }

    /// With heights, where a cell is `cell` units of height wide; `None` without an area.
    pub fn in_space(triangle: &ProofTriangle, cell: f64) -> Option<Self> {
        let sides = [[1, 2], [2, 0], [0, 1]].map(|ends| {
            let [from, to] = ends.map(|i: usize| triangle.corners[i]);
            let [x, y] = to.at.minus(from.at);
            [x * cell, y * cell, to.z - from.z]
        });
        let [u, v, _] = sides;
        let normal = [0, 1, 2].map(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            u[j] * v[k] - u[k] * v[j]
        });
        let area = dot(normal, normal).sqrt();
        (area > 0.0 && area.is_finite()).then(|| Self::of(sides, area))
    }

    /// From the sides, each opposite its corner and all in one direction, and twice the area.
    fn of(sides: [[f64; 3]; 3], double_area: f64) -> Self {
        let lengths = sides.map(|side| dot(side, side).sqrt());
        // The side before and the side after a corner run into it and out of it.
        let angles = [0, 1, 2].map(|i| {
            let cosine = -dot(sides[(i + 1) % 3], sides[(i + 2) % 3]);
            double_area.atan2(cosine).to_degrees()
        });
        let (mut shortest, mut longest) = (0, 0);
        for i in 1..3 {
            shortest = if lengths[i] < lengths[shortest] { i } else { shortest };
            longest = if lengths[i] > lengths[longest] { i } else { longest };
        }
        let perimeter: f64 = lengths.iter().sum();
        Self {
            smallest_angle: angles[shortest],
            largest_angle: angles[longest],
            aspect_ratio: lengths[longest] * perimeter / (2.0 * 3f64.sqrt() * double_area),
        }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProofVertex;
    use proptest::prelude::*;

    fn triangle(points: [[f64; 3]; 3]) -> ProofTriangle {
        ProofTriangle {
            corners: points.map(|[c, r, z]| ProofVertex { at: ProofPosition::nearest(c, r), z }),
        }
    }

    fn flat(points: [[f64; 2]; 3]) -> ProofTriangle {
        triangle(points.map(|[c, r]| [c, r, 0.0]))
    }

    fn is_near(shape: TriangleShape, smallest: f64, largest: f64, aspect: f64) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * b;
        near(shape.smallest_angle, smallest)
            && near(shape.largest_angle, largest)
            && near(shape.aspect_ratio, aspect)
    }

    #[test]
    fn known_triangles() {
        let plan = |points| TriangleShape::in_plan(&flat(points)).unwrap();
        let high = 3f64.sqrt() / 2.0;
        assert!(is_near(plan([[0.0, 0.0], [1.0, 0.0], [0.5, high]]), 60.0, 60.0, 1.0));
        // Right and isosceles: Verdict has (1 + sqrt(2)) sqrt(2) / sqrt(3) / sqrt(2).
        let half = plan([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        let aspect = 2f64.sqrt() * (2.0 + 2f64.sqrt()) / (2.0 * 3f64.sqrt());
        assert!(is_near(half, 45.0, 90.0, aspect), "{half:?}");
        assert_eq!(TriangleShape::in_plan(&flat([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])), None);
    }

    #[test]
    fn the_area_of_a_needle_is_exact() {
        // Twice the area is one step of a position wide: floats of the sides would make it 0.
        let far = (1 << 28) * ProofPosition::CELL + 1;
        let at = |col, row| ProofVertex { at: ProofPosition { row, col }, z: 0.0 };
        let needle = ProofTriangle { corners: [at(0, 0), at(far, far), at(far - 1, far)] };
        let shape = TriangleShape::in_plan(&needle).unwrap();
        let expected = (1.0 / 2f64.sqrt() / far as f64 / 2f64.sqrt()).to_degrees();
        assert!((shape.smallest_angle / expected - 1.0).abs() < 1e-9, "{shape:?}");
    }

    #[test]
    fn in_space_a_wall_is_a_triangle() {
        let wall = triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 10.0]]);
        assert_eq!(TriangleShape::in_plan(&wall), None);
        let shape = TriangleShape::in_space(&wall, 10.0).unwrap();
        assert!(
            (shape.smallest_angle - 45.0).abs() < 1e-9 && (shape.largest_angle - 90.0).abs() < 1e-9
        );
    }

    /// Angles by the law of cosines, the inscribed circle by Heron's formula.
    fn slow(p: [[f64; 3]; 3]) -> TriangleShape {
        let length = |a: [f64; 3], b: [f64; 3]| {
            (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
        };
        let [a, b, c] = [length(p[1], p[2]), length(p[2], p[0]), length(p[0], p[1])];
        let angle =
            |a: f64, b: f64, c: f64| ((b * b + c * c - a * a) / (2.0 * b * c)).acos().to_degrees();
        let angles = [angle(a, b, c), angle(b, c, a), angle(c, a, b)];
        let s = (a + b + c) / 2.0;
        let radius = ((s - a) * (s - b) * (s - c) / s).sqrt();
        TriangleShape {
            smallest_angle: angles.into_iter().fold(180.0, f64::min),
            largest_angle: angles.into_iter().fold(0.0, f64::max),
            aspect_ratio: a.max(b).max(c) / radius / (2.0 * 3f64.sqrt()),
        }
    }

    proptest! {
        #[test]
        fn like_the_law_of_cosines(points in prop::array::uniform3([-50i32..50, -50i32..50, -50i32..50])) {
            let points = points.map(|p| p.map(f64::from));
            let triangle = triangle(points);
            let plan = points.map(|[x, y, _]| [x, y, 0.0]);
            if let Some(shape) = TriangleShape::in_plan(&triangle) {
                let slow = slow(plan);
                prop_assert!((shape.smallest_angle - slow.smallest_angle).abs() < 1e-4);
                prop_assert!((shape.largest_angle - slow.largest_angle).abs() < 1e-4);
                prop_assert!((shape.aspect_ratio / slow.aspect_ratio - 1.0).abs() < 1e-6);
            }
            let space = points.map(|[x, y, z]| [2.0 * x, 2.0 * y, z]);
            if let Some(shape) = TriangleShape::in_space(&triangle, 2.0) {
                let slow = slow(space);
                prop_assert!((shape.smallest_angle - slow.smallest_angle).abs() < 1e-4);
                prop_assert!((shape.largest_angle - slow.largest_angle).abs() < 1e-4);
            }
        }

        #[test]
        fn whichever_corner_is_first(points in prop::array::uniform3([-50i32..50, -50i32..50, -9i32..9])) {
            let [a, b, c] = points.map(|p| p.map(f64::from));
            let shape = |p| TriangleShape::in_space(&triangle(p), 1.0);
            if let Some(one) = shape([a, b, c]) {
                for other in [[b, c, a], [c, b, a]] {
                    let other = shape(other).unwrap();
                    prop_assert!(is_near(other, one.smallest_angle, one.largest_angle, one.aspect_ratio));
                }
            }
        }
    }
}
