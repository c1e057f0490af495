//! The test of a ring that is gone: it could be dropped if a segment between two of its vertices has all others
//! within the tolerance.

use super::exact::Xy;
use super::measure::ProofDistance;

/// Maximum number of distances measured for one ring.
const MAX_DISTANCES: u64 = 1 << 25;

/// Directions for the outermost vertices of a large ring.
const DIRECTIONS: usize = 16;

/// Whether `ring` and `others` (holes that went with it) lie along a segment between two vertices of
/// `ring`; `None` for a ring too large to decide.
pub(super) fn lies_along_a_segment(
    distance: ProofDistance,
    ring: &[[f64; 3]],
    others: &[[f64; 3]],
    tolerance: f64,
) -> Option<bool> {
    let vertices = ring.iter().chain(others).copied().collect();
    let mut search = SegmentSearch { distance, tolerance, vertices, measured: 0 };
    let Some(&first) = ring.first() else { return Some(true) };
    let far = farthest(distance, ring, first);
    let farther = farthest(distance, ring, far);
    if search.fits(far, farther) || search.fits(first, far) {
        return Some(true);
    }
    if is_wide(distance, &search.vertices, tolerance) {
        return Some(false);
    }
    for (i, &a) in ring.iter().enumerate() {
        for &b in &ring[i..] {
            if search.fits(a, b) {
                return Some(true);
            }
            if search.measured > MAX_DISTANCES {
                return None;
            }
        }
    }
    Some(false)
}

/// Search for a segment with all vertices within the tolerance.
struct SegmentSearch {
    distance: ProofDistance,
    tolerance: f64,
    vertices: Vec<[f64; 3]>,
    /// Number of distances measured.
    measured: u64,
}

impl SegmentSearch {
    /// True when all vertices are near the segment from `a` to `b`.
    fn fits(&mut self, a: [f64; 3], b: [f64; 3]) -> bool {
        for at in 0..self.vertices.len() {
            self.measured += 1;
            if self.distance.of(self.vertices[at], a, b) > self.tolerance {
                // To the front: it is probably too far from the next segment as well.
                self.vertices[..=at].rotate_right(1);
                return false;
            }
        }
        true
    }
}

fn farthest(distance: ProofDistance, ring: &[[f64; 3]], from: [f64; 3]) -> [f64; 3] {
    let vertices = ring.iter().map(|&p| (distance.of(p, from, from), p));
    vertices.max_by(|p, q| p.0.total_cmp(&q.0)).map_or(from, |(_, p)| p)
}

/// True where no strip twice as wide as the tolerance has all vertices, so that no segment is near all of them.
/// With some margin, as the length of a degree varies.
fn is_wide(distance: ProofDistance, all: &[[f64; 3]], tolerance: f64) -> bool {
    let origin = all[0];
    let flat: Vec<Xy> = all.iter().map(|p| distance.flat(*p, origin)).collect();
    let outermost: Vec<Xy> = (0..DIRECTIONS).filter_map(|k| farthest_along(&flat, k)).collect();
    // The narrowest strip has two of the outermost vertices on its border.
    let pairs = outermost.iter().enumerate();
    let pairs = pairs.flat_map(|(i, a)| outermost[..i].iter().map(move |b| [*a, *b]));
    let widths = pairs.filter(|[a, b]| a != b).map(|side| strip_width(&outermost, side));
    widths.min_by(f64::total_cmp).is_some_and(|width| width > 2.1 * tolerance)
}

/// The position farthest along direction `k` of [`DIRECTIONS`].
fn farthest_along(positions: &[Xy], k: usize) -> Option<Xy> {
    let angle = k as f64 / DIRECTIONS as f64 * std::f64::consts::TAU;
    let (cos, sin) = (angle.cos(), angle.sin());
    let along = positions.iter().map(|&p| (p[0] * cos + p[1] * sin, p));
    along.max_by(|p, q| p.0.total_cmp(&q.0)).map(|(_, p)| p)
}

/// The width of the strip around all positions that is parallel to the line through `a` and `b`.
fn strip_width(positions: &[Xy], [a, b]: [Xy; 2]) -> f64 {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for p in positions {
        let offset = ((p[0] - a[0]) * y - (p[1] - a[1]) * x) / x.hypot(y);
        (low, high) = (low.min(offset), high.max(offset));
    }
    high - low
}
