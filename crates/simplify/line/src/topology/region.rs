//! The region between a chain and the segment that replaces it, and point-in-region tests.

use std::cmp::Ordering;

use super::tree::ClosedBox;
use terrane_base::geom::plane::{Xy, orient};

/// Whether `v` lies between `chain` and the segment from its last vertex to its first: their closed curve winds
/// around it, or it lies on the segment. False for a position on the chain, which had no side. O(n), exact.
#[inline]
pub(super) fn holds(chain: &[Xy], v: Xy) -> bool {
    let mut turns = 0;
    for pair in chain.windows(2) {
        match turn(pair[0], pair[1], v) {
            Some(turn) => turns += turn,
            None => return false,
        }
    }
    // On the closing segment only: it was beside the chain, and is not beside the segment.
    turn(chain[chain.len() - 1], chain[0], v).is_none_or(|turn| turns + turn != 0)
}

/// Contribution of edge (p, q) to the winding number of a curve around `v`, from crossings of the ray to the
/// right; `None` if `v` lies on the edge.
#[inline(always)]
fn turn(p: Xy, q: Xy, v: Xy) -> Option<i32> {
    // Half-open in y: a vertex at the height of `v` counts with one of its two edges, not with both.
    let (below_p, below_q) = (p[1] <= v[1], q[1] <= v[1]);
    if below_p == below_q {
        // Only an edge that ends at the height of `v`, or is horizontal at that height, can contain it.
        let on = (p == v) | (q == v) | (p[1] == v[1] && q[1] == v[1] && between(p[0], q[0], v[0]));
        return if on { None } else { Some(0) };
    }
    if p[0] < v[0] && q[0] < v[0] {
        return Some(0);
    }
    match (orient(p, q, v), below_p) {
        (Ordering::Equal, _) => None,
        (Ordering::Greater, true) => Some(1),
        (Ordering::Less, false) => Some(-1),
        _ => Some(0),
    }
}

fn between(a: f64, b: f64, v: f64) -> bool {
    (a <= v && v <= b) || (b <= v && v <= a)
}

/// The same test for many positions: edges in bands of y.
///
/// O(n) construction; a test costs the number of edges in its band.
#[derive(Debug, Default)]
pub(super) struct EdgeBands {
    low: f64,
    /// Bands by unit of y.
    scale: f64,
    starts: Vec<u32>,
    /// First vertices of edges, band by band; the closing segment has the last vertex.
    edges: Vec<u32>,
}

impl EdgeBands {
    /// Of a chain with box `bounds`.
    pub(super) fn new(chain: &[Xy], bounds: &ClosedBox) -> Self {
        let height = bounds.high[1] - bounds.low[1];
        let edges = chain.iter().zip(chain[1..].iter().chain(&chain[..1]));
        let climb: f64 = edges.clone().map(|(p, q)| (p[1] - q[1]).abs()).sum();
        // Bands such that an edge touches 4 of them on average.
        let wished = (3.0 * chain.len() as f64 * height / climb).min(chain.len() as f64);
        let count = if wished >= 1.0 { wished as usize } else { 1 };
        let scale = count as f64 / height;
        let mut bands =
            Self { low: bounds.low[1], scale, starts: vec![0; count + 1], edges: vec![] };
        for (p, q) in edges.clone() {
            for band in bands.reach(p, q) {
                bands.starts[band] += 1;
            }
        }
        let mut sum = 0;
        for start in &mut bands.starts {
            sum += *start;
            *start = sum;
        }
        bands.edges = vec![0; sum as usize];
        for (i, (p, q)) in (0..).zip(edges) {
            for band in bands.reach(p, q) {
                bands.starts[band] -= 1;
                let at = bands.starts[band] as usize;
                bands.edges[at] = i;
            }
        }
        bands
    }

    /// [`holds`], for a position within the chain's box.
    pub(super) fn holds(&self, chain: &[Xy], v: Xy) -> bool {
        let band = self.band(v[1]);
        let (mut turns, mut on_segment) = (0, false);
        for &i in &self.edges[self.starts[band] as usize..self.starts[band + 1] as usize] {
            let i = i as usize;
            let last = i + 1 == chain.len();
            match turn(chain[i], chain[if last { 0 } else { i + 1 }], v) {
                Some(turn) => turns += turn,
                None if last => on_segment = true,
                None => return false,
            }
        }
        turns != 0 || on_segment
    }

    fn reach(&self, p: &Xy, q: &Xy) -> std::ops::RangeInclusive<usize> {
        self.band(p[1].min(q[1]))..=self.band(p[1].max(q[1]))
    }

    fn band(&self, y: f64) -> usize {
        // A flat chain has an infinite scale. Zero times that is NaN, which becomes band 0.
        (((y - self.low) * self.scale) as usize).min(self.starts.len() - 2)
    }
}

/// Vertex of `chain` between its ends farthest from the segment of its ends, the first among equals; the middle
/// one if all lie on it. For chains of three or more vertices.
pub(super) fn farthest(chain: &[Xy]) -> usize {
    let last = chain.len() - 1;
    let (a, b) = (chain[0], chain[last]);
    let along = [b[0] - a[0], b[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let (mut most, mut at) = (0.0, last / 2);
    for (i, p) in chain.iter().enumerate().take(last).skip(1) {
        let out = [p[0] - a[0], p[1] - a[1]];
        let part = ((out[0] * along[0] + out[1] * along[1]) / square).clamp(0.0, 1.0);
        // A closed piece has a segment without length, hence 0 / 0.
        let part = if part.is_nan() { 0.0 } else { part };
        let off = [out[0] - part * along[0], out[1] - part * along[1]];
        let distance = off[0] * off[0] + off[1] * off[1];
        if distance > most {
            (most, at) = (distance, i);
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn inside_outside_and_on_it() {
        let bump = [[0.0, 0.0], [1.0, 2.0], [2.0, 2.0], [3.0, 0.0]];
        assert!(holds(&bump, [1.5, 1.0]));
        assert!(holds(&bump, [1.5, 0.0]), "on the segment");
        assert!(!holds(&bump, [1.5, 2.0]), "on the chain");
        assert!(!holds(&bump, [1.0, 2.0]), "a vertex");
        assert!(!holds(&bump, [1.5, -1.0]));
        assert!(!holds(&bump, [0.2, 1.0]));
    }

    #[test]
    fn farthest_vertex() {
        assert_eq!(farthest(&[[0.0, 0.0], [1.0, 1.0], [2.0, 3.0], [3.0, 3.0], [4.0, 0.0]]), 2);
        assert_eq!(farthest(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0]]), 2);
        assert_eq!(farthest(&[[0.0, 0.0], [1.0, 0.0], [9.0, 0.0], [0.0, 0.0]]), 2);
    }

    /// Distance of a vertex from the segment of a chain's ends.
    fn off(chain: &[Xy], i: usize) -> f64 {
        let (a, b, p) = (chain[0], chain[chain.len() - 1], chain[i]);
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        let along = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / length;
        let across = ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / length;
        match length > 0.0 {
            true => across.hypot(along - along.clamp(0.0, length)),
            false => (p[0] - a[0]).hypot(p[1] - a[1]),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Neither the direction of a chain nor which axis is which makes a difference, and no vertex of
        /// a chain had a side.
        #[test]
        fn a_region_is_the_same_however_it_is_turned(
            chain in proptest::collection::vec((0i32..5, 0i32..5), 2..9),
            v in (0i32..5, 0i32..5),
        ) {
            let at = |p: (i32, i32)| [f64::from(p.0), f64::from(p.1)];
            let chain: Vec<Xy> = chain.into_iter().map(at).collect();
            let back: Vec<Xy> = chain.iter().rev().copied().collect();
            let turned: Vec<Xy> = chain.iter().map(|p| [p[1], -p[0]]).collect();
            let mirrored: Vec<Xy> = chain.iter().map(|p| [-p[0], p[1]]).collect();
            let [x, y] = at(v);
            let held = holds(&chain, [x, y]);
            prop_assert_eq!(holds(&back, [x, y]), held);
            prop_assert_eq!(holds(&turned, [y, -x]), held);
            prop_assert_eq!(holds(&mirrored, [-x, y]), held);
            prop_assert!(!chain.iter().any(|p| holds(&chain, *p)));
        }

        #[test]
        fn no_vertex_is_farther_than_the_farthest(
            chain in proptest::collection::vec((0i32..9, 0i32..9), 3..12),
        ) {
            let chain: Vec<Xy> =
                chain.into_iter().map(|p| [f64::from(p.0), f64::from(p.1)]).collect();
            let last = chain.len() - 1;
            let found = farthest(&chain);
            prop_assert!(0 < found && found < last);
            let most = (1..last).map(|i| off(&chain, i)).fold(0.0, f64::max);
            prop_assert!((off(&chain, found) - most).abs() < 1e-9);
            prop_assert!(most > 1e-9 || found == last / 2);
        }
    }

    proptest! {
        #[test]
        fn bands_say_the_same(
            chain in proptest::collection::vec((0i32..9, 0i32..9), 2..60),
            v in (0i32..9, 0i32..9),
        ) {
            let at = |p: (i32, i32)| [f64::from(p.0), f64::from(p.1 - 4) / 16.0];
            let chain: Vec<Xy> = chain.into_iter().map(at).collect();
            let bounds = ClosedBox::of(&chain);
            prop_assume!(bounds.holds(at(v)));
            let bands = EdgeBands::new(&chain, &bounds);
            prop_assert_eq!(bands.holds(&chain, at(v)), holds(&chain, at(v)));
        }
    }
}
