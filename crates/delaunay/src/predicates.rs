//! Exact predicates on whole coordinates, made canonical: no two triangulations of one set differ.
//!
//! A Delaunay triangulation is the lower hull of the sites lifted to heights x^2 + y^2. Four
//! cocircular sites have coplanar lifts, and either diagonal would do. So each height is lowered by
//! an infinitesimal, and that of a lower site (x, then y) by infinitely more than that of a higher
//! one. The perturbation depends on coordinates alone, hence the triangulation of a *set* is unique,
//! whatever order its sites come in and whatever part of it is looked at. A cocircular polygon
//! becomes the fan of its lowest site.

use terrane_base::geom::Point;

/// A position in the plane, in steps; |coordinate| <= [`terrane_base::geom::REACH`]. Arrays compare as
/// points do: by x, then y.
pub type Site = [i32; 2];

/// The position of a point.
pub(super) fn site(p: &Point) -> Site {
    [p.x, p.y]
}

/// `b - a`, exactly: below 2^30 in magnitude.
#[inline(always)]
fn minus(b: Site, a: Site) -> [i64; 2] {
    [i64::from(b[0]) - i64::from(a[0]), i64::from(b[1]) - i64::from(a[1])]
}

#[inline(always)]
fn cross(u: [i64; 2], v: [i64; 2]) -> i64 {
    u[0] * v[1] - u[1] * v[0]
}

#[inline(always)]
fn square(u: [i64; 2]) -> i64 {
    u[0] * u[0] + u[1] * u[1]
}

/// Twice the signed area of (a, b, c): positive when counter-clockwise. Exact, below 2^61.
#[inline(always)]
pub fn orient(a: Site, b: Site, c: Site) -> i64 {
    cross(minus(b, a), minus(c, a))
}

#[inline(always)]
fn float(u: [i64; 2]) -> [f64; 2] {
    u.map(|v| v as f64)
}

#[inline(always)]
fn lift(u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

/// True when `d` lies strictly inside the circle through the counter-clockwise (a, b, c), after
/// perturbation. The four sites must be distinct.
#[inline(always)]
pub fn in_circle(a: Site, b: Site, c: Site, d: Site) -> bool {
    let (a_, b_, c_) = (float(minus(a, d)), float(minus(b, d)), float(minus(c, d)));
    let (bc, cb) = (b_[0] * c_[1], b_[1] * c_[0]);
    let (ca, ac) = (c_[0] * a_[1], c_[1] * a_[0]);
    let (ab, ba) = (a_[0] * b_[1], a_[1] * b_[0]);
    let (al, bl, cl) = (lift(a_), lift(b_), lift(c_));
    let determinant = al * (bc - cb) + bl * (ca - ac) + cl * (ab - ba);
    let permanent =
        al * (bc.abs() + cb.abs()) + bl * (ca.abs() + ac.abs()) + cl * (ab.abs() + ba.abs());
    if determinant.abs() > ERROR * permanent {
        return determinant > 0.0;
    }
    in_circle_exact(a, b, c, d)
}

/// Bound of the relative error of the determinant in [`in_circle`], in units of its permanent. With
/// u = 2^-53: differences are exact (30 bits); a lift is off by 2u of itself (a product, a sum of
/// positive terms); a minor by 2u of the magnitudes of its two products; their product by u more,
/// and the sums of three such by 2u. That is 7u, and below 8u with all terms of higher order; the
/// permanent is off by as much of itself. There is no underflow, because everything is whole.
const ERROR: f64 = 10.0 / (1u64 << 53) as f64;

/// [`in_circle`] without rounding. Lifts and minors are below 2^61, so the determinant is below 2^124.
#[cold]
#[inline(never)]
fn in_circle_exact(a: Site, b: Site, c: Site, d: Site) -> bool {
    match determinant(a, b, c, d) {
        0 => in_perturbed_circle(a, b, c, d),
        determinant => determinant > 0,
    }
}

/// Positive when `d` lies strictly inside the circle through the counter-clockwise (a, b, c), 0 on it.
pub(super) fn determinant(a: Site, b: Site, c: Site, d: Site) -> i128 {
    let (a, b, c) = (minus(a, d), minus(b, d), minus(c, d));
    let terms = [[a, b, c], [b, c, a], [c, a, b]];
    terms.iter().map(|&[u, v, w]| i128::from(square(u)) * i128::from(cross(v, w))).sum()
}

/// [`in_circle`] for four cocircular sites: the lowest one is joined to all others. No three of them
/// are collinear, so its infinitesimal alone decides.
fn in_perturbed_circle(a: Site, b: Site, c: Site, d: Site) -> bool {
    let lowest = a.min(b).min(c);
    if d < lowest {
        return true;
    }
    // (a, b, c) belongs to the fan of its lowest corner unless d splits the side opposite to it.
    let (from, to) = match lowest {
        _ if lowest == a => (b, c),
        _ if lowest == b => (c, a),
        _ => (a, b),
    };
    orient(from, to, d) < 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_base::geom::REACH;

    fn site(most: i32) -> impl Strategy<Value = Site> {
        [-most..=most, -most..=most]
    }

    /// Any scale up to the whole reach, and its very corners.
    fn sites() -> impl Strategy<Value = [Site; 4]> {
        let scaled = (2u32..30).prop_flat_map(|bits| {
            let most = ((1i64 << bits) - 1).min(i64::from(REACH)) as i32;
            [site(most), site(most), site(most), site(most)]
        });
        let end = || prop_oneof![Just(-REACH), Just(REACH), Just(0), Just(REACH - 1)];
        let extreme = prop::array::uniform4([end(), end()]);
        prop_oneof![4 => scaled, 1 => extreme]
    }

    /// The first three turned counter-clockwise, unless they are collinear or hold the fourth.
    fn turned([a, b, c, d]: [Site; 4]) -> Option<[Site; 4]> {
        let area = orient(a, b, c);
        let [b, c] = if area > 0 { [b, c] } else { [c, b] };
        (area != 0 && ![a, b, c].contains(&d)).then_some([a, b, c, d])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn the_filter_agrees_with_exact_arithmetic(
            [a, b, c, d] in sites().prop_filter_map("no triangle", turned)
        ) {
            prop_assert_eq!(in_circle(a, b, c, d), in_circle_exact(a, b, c, d));
            prop_assert_eq!(in_circle(a, b, c, d), in_circle(b, c, a, d));
            prop_assert_eq!(in_circle(a, b, c, d), in_circle(c, a, b, d));
        }
    }

    /// Of the two diagonals of a convex quadrilateral exactly one is Delaunay, ties included.
    #[test]
    fn one_diagonal_wins() {
        let at = |i: u32| [(i % 5) as i32, (i / 5) as i32];
        let mut ties = 0;
        for code in 0..25u32.pow(4) {
            let [a, b, c, d] = [1, 25, 625, 15_625].map(|unit| at(code / unit % 25));
            let convex = [(a, b, c), (b, c, d), (c, d, a), (d, a, b)];
            if convex.iter().all(|&(p, q, r)| orient(p, q, r) > 0) {
                ties += usize::from(determinant(a, b, c, d) == 0);
                assert_eq!(in_circle(a, b, c, d), in_circle(c, d, a, b));
                assert_ne!(in_circle(a, b, c, d), in_circle(b, c, d, a));
            }
        }
        assert!(ties > 100);
    }

    #[test]
    fn a_square_is_split_from_its_lowest_corner() {
        let (a, b, c, d) = ([0, 0], [1, 0], [1, 1], [0, 1]);
        assert!(!in_circle(a, b, c, d) && !in_circle(c, d, a, b));
        assert!(in_circle(b, c, d, a) && in_circle(d, a, b, c));
    }

    #[test]
    fn the_corners_of_the_reach_are_exact() {
        let r = REACH;
        let (a, b, c, d) = ([-r, -r], [r, -r], [r, r], [-r, r]);
        assert_eq!(orient(a, b, c), 4 * i64::from(r) * i64::from(r));
        assert_eq!(determinant(a, b, c, d), 0);
        assert!(determinant(a, b, c, [-r + 1, r]) > 0 && determinant(a, [r - 1, -r], c, d) > 0);
    }
}
