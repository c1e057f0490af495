//! Divide and conquer: triangulate two halves, then knit them together along the gap.
//!
//! Guibas & Stolfi's merge (1985) on triangles instead of edges, with Dwyer's alternating cuts. The
//! outside is covered by *ghosts*, triangles of an edge of the hull and a corner at infinity, so a
//! triangulation of n sites always has 2n - 2 triangles, collinear sites included. Two halves need
//! two triangles more than they have: each part of the site array owns a fixed part of the triangle
//! array, nothing is allocated or freed, and two halves can be done at the same time.

use super::parallel::ForkJoin;
use super::predicates::{Site, in_circle, orient};

/// The corner at infinity.
pub(super) const GHOST: u32 = u32::MAX;

/// A directed side of a triangle, with the triangle to its left. Sides 3t, 3t + 1 and 3t + 2 go
/// counter-clockwise around triangle t.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct HalfEdge {
    /// The site it begins at.
    pub(super) from: u32,
    /// The same side, seen from the triangle beyond.
    pub(super) twin: u32,
}

/// The side after `s` around its triangle.
#[inline(always)]
pub(super) fn next(s: u32) -> u32 {
    if s % 3 == 2 { s - 2 } else { s + 1 }
}

/// The side before `s` around its triangle.
#[inline(always)]
pub(super) fn prev(s: u32) -> u32 {
    if s.is_multiple_of(3) { s + 2 } else { s - 1 }
}

/// Sides of a triangulation of n >= 2 sites.
pub(super) const fn sides_of(n: usize) -> usize {
    6 * (n - 1)
}

/// Halves with fewer sites than this are done on one thread.
const FORK_LEAST: usize = 1 << 13;

/// A run of sites in Morton order, their ids, and the sides that belong to them. Sites and sides are
/// numbered within the whole; the first of each here is `first` and 6 * `first`.
pub(super) struct MortonRun<'a> {
    pub(super) first: u32,
    pub(super) sites: &'a mut [Site],
    pub(super) ids: &'a mut [u32],
    pub(super) sides: &'a mut [HalfEdge],
}

/// Triangulates a part of at least two sites; the result is the side of a ghost that lies on the hull.
pub(super) fn triangulate(part: &mut MortonRun<'_>, fork: &impl ForkJoin) -> u32 {
    let count = part.sites.len();
    if count <= 3 {
        return part.leaf();
    }
    let (axis, middle) = part.cut();
    // Each cut uses up one bit of x or y, so recursion is no deeper than both have bits.
    let [mut low, mut high] = part.halves(middle);
    let (left, right) = match count < 2 * FORK_LEAST {
        true => (triangulate(&mut low, fork), triangulate(&mut high, fork)),
        false => fork.join(|| triangulate(&mut low, fork), || triangulate(&mut high, fork)),
    };
    part.merge(axis, middle, left, right)
}

impl MortonRun<'_> {
    /// Where the part divides: the axis, and how many sites are below the cut (2 at least, and 2 above).
    fn cut(&mut self) -> (usize, usize) {
        let (first, last) = (self.sites[0], self.sites[self.sites.len() - 1]);
        let [x, y] = [first[0] ^ last[0], first[1] ^ last[1]];
        // y has the higher bit; of equal bits that of x comes first.
        let axis = usize::from(x < y && x < (x ^ y));
        let bit = 1 << [x, y][axis].ilog2();
        let middle = self.sites.partition_point(|site| site[axis] & bit == 0);
        (axis, self.even(axis, middle))
    }

    /// Moves a site across the cut where there is only one on a side. The halves still lie on either
    /// side of each other in the order of the axis, and each is in Morton order.
    fn even(&mut self, axis: usize, middle: usize) -> usize {
        let all = 0..self.sites.len();
        if middle == 1 {
            let lowest = all.skip(1).min_by_key(|&i| along(self.sites[i], axis)).unwrap_or(1);
            self.sites[1..=lowest].rotate_right(1);
            self.ids[1..=lowest].rotate_right(1);
            return 2;
        }
        if middle + 1 == self.sites.len() {
            let highest = (0..middle).max_by_key(|&i| along(self.sites[i], axis)).unwrap_or(0);
            self.sites[highest..middle].rotate_left(1);
            self.ids[highest..middle].rotate_left(1);
            return middle - 1;
        }
        middle
    }

    fn halves(&mut self, middle: usize) -> [MortonRun<'_>; 2] {
        let (low, high) = self.sites.split_at_mut(middle);
        let (low_ids, high_ids) = self.ids.split_at_mut(middle);
        let (low_sides, high_sides) = self.sides.split_at_mut(6 * middle);
        // The six sides left out between the halves are the two triangles that knitting adds.
        let low_sides = &mut low_sides[..6 * middle - 6];
        let first = self.first + middle as u32;
        [
            MortonRun { first: self.first, sites: low, ids: low_ids, sides: low_sides },
            MortonRun { first, sites: high, ids: high_ids, sides: high_sides },
        ]
    }

    #[inline(always)]
    fn side(&mut self, s: u32) -> &mut HalfEdge {
        &mut self.sides[(s - 6 * self.first) as usize]
    }

    #[inline(always)]
    fn from(&self, s: u32) -> u32 {
        self.sides[(s - 6 * self.first) as usize].from
    }

    #[inline(always)]
    fn twin(&self, s: u32) -> u32 {
        self.sides[(s - 6 * self.first) as usize].twin
    }

    #[inline(always)]
    fn site(&self, v: u32) -> Site {
        self.sites[(v - self.first) as usize]
    }

    #[inline(always)]
    fn link(&mut self, s: u32, t: u32) {
        self.side(s).twin = t;
        self.side(t).twin = s;
    }

    /// Triangulates two or three sites.
    fn leaf(&mut self) -> u32 {
        let (a, s) = (self.first, 6 * self.first);
        if self.sites.len() == 2 {
            self.ring(s, [a, a + 1]);
            self.link(s, s + 3);
            return s;
        }
        let mut corners = [a, a + 1, a + 2];
        let area = {
            let [a, b, c] = corners.map(|v| self.site(v));
            orient(a, b, c)
        };
        if area == 0 {
            corners.sort_by_key(|&v| self.site(v));
            let [a, b, c] = corners;
            self.ring(s, [a, b, c, b]);
            self.link(s, s + 9);
            self.link(s + 3, s + 6);
            return s;
        }
        let [a, b, c] = if area > 0 { corners } else { [a, a + 2, a + 1] };
        self.ring(s + 3, [a, c, b]);
        for (i, v) in [a, b, c].into_iter().enumerate() {
            self.side(s + i as u32).from = v;
        }
        self.link(s, s + 9);
        self.link(s + 1, s + 6);
        self.link(s + 2, s + 3);
        s + 3
    }

    /// Ghosts from side `s` on, along a hull whose sites are given clockwise: ghost i has the sides
    /// v(i) to v(i + 1), on to infinity, and back.
    fn ring<const N: usize>(&mut self, s: u32, hull: [u32; N]) {
        for i in 0..N {
            let (ghost, after) = (s + 3 * i as u32, s + 3 * ((i + 1) % N) as u32);
            self.side(ghost).from = hull[i];
            self.side(ghost + 1).from = hull[(i + 1) % N];
            self.side(ghost + 2).from = GHOST;
            self.link(ghost + 1, after + 2);
        }
    }

    /// The hull's side after that of ghost `g`, clockwise: where `g` leads to.
    #[inline(always)]
    fn clockwise(&self, g: u32) -> u32 {
        next(self.twin(next(g)))
    }

    /// The hull's side before that of ghost `g`, clockwise: it leads to where `g` begins.
    #[inline(always)]
    fn counter(&self, g: u32) -> u32 {
        prev(self.twin(prev(g)))
    }

    /// The hull's side that begins at the site furthest along an axis (`sign` 1) or back (-1).
    fn furthest(&self, mut g: u32, axis: usize, sign: i64) -> u32 {
        let value = |g: u32| sign * along(self.site(self.from(g)), axis);
        loop {
            let after = self.counter(g);
            if value(after) <= value(g) {
                break;
            }
            g = after;
        }
        loop {
            let before = self.clockwise(g);
            if value(before) <= value(g) {
                return g;
            }
            g = before;
        }
    }

    /// The lower common tangent of two hulls, the first of which lies left of the second: the ghost
    /// that begins at its left end, and the one that leads to its right end.
    fn tangent(&self, mut left: u32, mut right: u32) -> (u32, u32) {
        loop {
            let (l, r) = (self.site(self.from(left)), self.site(self.from(next(right))));
            if orient(l, r, self.site(self.from(next(left)))) < 0 {
                left = self.clockwise(left);
            } else if orient(l, r, self.site(self.from(right))) < 0 {
                right = self.counter(right);
            } else {
                return (left, right);
            }
        }
    }

    /// Joins the triangulations of the first `middle` sites and of the others, given a ghost's side of
    /// each. A base goes up the gap from the lower common tangent: the next site of the left or right
    /// hull makes a triangle with it, after the triangles are gone whose circle that breaks.
    fn merge(&mut self, axis: usize, middle: usize, left: u32, right: u32) -> u32 {
        let left = self.furthest(left, axis, 1);
        let right = self.counter(self.furthest(right, axis, -1));
        let (left, right) = self.tangent(left, right);
        let (mut l, mut r) = (self.from(left), self.from(next(right)));
        // Sides of the ghosts above: to l from the left, from r to the right.
        let (mut to_l, mut from_r) = (self.counter(left), self.clockwise(right));
        let bottom = 6 * (self.first + middle as u32) - 6;
        self.ghost(bottom, r, l);
        self.link(next(bottom), prev(left));
        self.link(prev(bottom), next(right));
        let mut base = bottom;
        loop {
            let (at_l, at_r) = (self.site(l), self.site(r));
            let go_left = orient(at_l, at_r, self.site(self.from(to_l))) > 0;
            let go_right = orient(at_l, at_r, self.site(self.from(next(from_r)))) > 0;
            if go_left {
                self.clear_left(to_l, at_l, at_r);
            }
            if go_right {
                self.clear_right(from_r, at_l, at_r);
            }
            let (u, w) = (self.from(to_l), self.from(next(from_r)));
            // `in_circle` breaks ties of four sites on one circle by coordinates alone, so the mesh does not
            // depend on where the halves were cut.
            let take_right = match (go_left, go_right) {
                (false, false) => break,
                (true, true) => in_circle(at_l, at_r, self.site(u), self.site(w)),
                (_, right_only) => right_only,
            };
            // The ghost beside the base becomes the triangle above it.
            if take_right {
                let above = self.clockwise(from_r);
                self.side(prev(from_r)).from = l;
                self.link(prev(from_r), base);
                (base, from_r, r) = (next(from_r), above, w);
            } else {
                let above = self.counter(to_l);
                self.side(prev(to_l)).from = r;
                self.link(next(to_l), base);
                (base, to_l, l) = (prev(to_l), above, u);
            }
        }
        let top = bottom + 3;
        self.ghost(top, l, r);
        self.link(top, base);
        self.link(prev(top), next(to_l));
        self.link(next(top), prev(from_r));
        top
    }

    /// The corners of the ghost whose side on the hull is `s`.
    fn ghost(&mut self, s: u32, from: u32, to: u32) {
        self.side(s).from = from;
        self.side(next(s)).from = to;
        self.side(prev(s)).from = GHOST;
    }

    /// Opens the triangles behind `s`, the side of a ghost that leads to `l`, whose circles hold no
    /// longer once (l, r) is an edge: by flips with the ghost, which turn them into ghosts.
    #[inline(always)]
    fn clear_left(&mut self, s: u32, l: Site, r: Site) {
        loop {
            // The ghost is (u, l, infinity), the triangle (l, u, m).
            let inner = self.twin(s);
            let m = self.from(prev(inner));
            if m == GHOST || !in_circle(l, r, self.site(self.from(s)), self.site(m)) {
                return;
            }
            // Now (m, l, infinity) and (u, m, infinity).
            self.side(s).from = m;
            self.side(inner).from = GHOST;
            self.link(s, self.twin(prev(inner)));
            self.link(inner, self.twin(prev(s)));
            self.link(prev(inner), prev(s));
        }
    }

    /// [`clear_left`](Self::clear_left) in the mirror: `s` begins at `r`.
    #[inline(always)]
    fn clear_right(&mut self, s: u32, l: Site, r: Site) {
        loop {
            // The ghost is (r, w, infinity), the triangle (w, r, m).
            let inner = self.twin(s);
            let m = self.from(prev(inner));
            if m == GHOST || !in_circle(l, r, self.site(self.from(next(s))), self.site(m)) {
                return;
            }
            // Now (r, m, infinity) and (m, w, infinity).
            self.side(next(s)).from = m;
            self.side(next(inner)).from = GHOST;
            self.link(s, self.twin(next(inner)));
            self.link(inner, self.twin(next(s)));
            self.link(next(inner), next(s));
        }
    }
}

/// The order along an axis, ties by the other one: as if the plane were turned by a hair, so that
/// along y, too, the first site is left of the second.
#[inline(always)]
fn along(site: Site, axis: usize) -> i64 {
    let [x, y] = site.map(i64::from);
    [(x << 32) + y, (y << 32) - x][axis]
}
