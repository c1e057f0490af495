//! Exact orientation and in-circle tests on integer lattice coordinates.
//!
//! Exact in `i64` while coordinate differences stay below 2^14: the in-circle determinant is a sum
//! of three products of four differences, below 6 * 2^56.

/// A lattice position (column, row), relative to some local origin.
pub type Lattice = [i32; 2];

/// Twice the signed area of (a, b, c): positive when counter-clockwise in (column, row) axes.
#[inline(always)]
pub fn orient(a: Lattice, b: Lattice, c: Lattice) -> i64 {
    let (abx, aby) = (i64::from(b[0] - a[0]), i64::from(b[1] - a[1]));
    let (acx, acy) = (i64::from(c[0] - a[0]), i64::from(c[1] - a[1]));
    abx * acy - aby * acx
}

/// Positive when `d` is strictly inside the circle through the counter-clockwise (a, b, c),
/// zero on it, negative outside.
#[inline(always)]
pub fn in_circle(a: Lattice, b: Lattice, c: Lattice, d: Lattice) -> i64 {
    let ([ax, ay, aa], [bx, by, bb], [cx, cy, cc]) = (lifted(a, d), lifted(b, d), lifted(c, d));
    aa * (bx * cy - by * cx) - bb * (ax * cy - ay * cx) + cc * (ax * by - ay * bx)
}

/// A position relative to an origin, lifted to a paraboloid.
#[inline(always)]
fn lifted(p: Lattice, origin: Lattice) -> [i64; 3] {
    let (x, y) = (i64::from(p[0] - origin[0]), i64::from(p[1] - origin[1]));
    [x, y, x * x + y * y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn unit_square_is_cocircular() {
        assert_eq!(orient([0, 0], [1, 0], [0, 1]), 1);
        assert_eq!(in_circle([0, 0], [1, 0], [1, 1], [0, 1]), 0);
        assert!(in_circle([0, 0], [4, 0], [0, 4], [1, 1]) > 0);
        assert!(in_circle([0, 0], [4, 0], [0, 4], [9, 9]) < 0);
    }

    fn in_circle_i128(a: Lattice, b: Lattice, c: Lattice, d: Lattice) -> i128 {
        let m = [a, b, c].map(|p| {
            let (x, y) = (i128::from(p[0] - d[0]), i128::from(p[1] - d[1]));
            [x, y, x * x + y * y]
        });
        m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
            - m[1][2] * (m[0][0] * m[2][1] - m[0][1] * m[2][0])
            + m[2][2] * (m[0][0] * m[1][1] - m[0][1] * m[1][0])
    }

    fn lattice() -> impl Strategy<Value = Lattice> {
        [0..=16_383, 0..=16_383]
    }

    proptest! {
        #[test]
        fn exact_over_the_whole_stated_range(
            a in lattice(), b in lattice(), c in lattice(), d in lattice()
        ) {
            prop_assert_eq!(i128::from(in_circle(a, b, c, d)), in_circle_i128(a, b, c, d));
        }
    }
}
