//! Threshold of each vertex of a line or ring: the vertex is kept at all smaller thresholds.
//!
//! Computes for all thresholds at once the result of [`Tool::choose`](super::tool::Tool::choose) at one
//! threshold: closed lines are split into halves, and rings keep three vertices. (For a collapsing ring the
//! method also keeps the vertices required by its tolerance between these three; a filter by thresholds cannot
//! express this.)

use super::tool::{DistanceKind, MetricVertex, SimplifyRule, check, vertices};
use terrane_base::error::Result;
use terrane_line::metric::largest_distance2;
use terrane_line::topology::RingCollapse;
use terrane_line::visvalingam::{AreaWeight, EffectiveAreas};
use terrane_line::{
    DistanceMetric, GeographicMetric, Hierarchy, PlaneMetric, SimplifyMethod, SpaceMetric,
};
use terrane_vector::GeometryPart;

/// Thresholds of the vertices of a part, infinite for fixed vertices: distances for Ramer-Douglas-Peucker,
/// areas for Visvalingam-Whyatt. The closing vertex of a ring has none.
///
/// # Errors
/// A part that cannot be measured.
pub fn thresholds(part: &GeometryPart<'_>, measure: DistanceKind) -> Result<[Vec<f64>; 2]> {
    // All thresholds are needed.
    let rule = SimplifyRule {
        method: &SimplifyMethod::RDP,
        measure,
        threshold: f64::MAX,
        collapse: RingCollapse::Keep,
    };
    check(part, &rule)?;
    Ok(match measure {
        DistanceKind::Plane => of_part(&PlaneMetric, part),
        DistanceKind::Space => of_part(&SpaceMetric, part),
        DistanceKind::Geographic => of_part(&GeographicMetric, part),
    })
}

fn of_part<V: MetricVertex, M: DistanceMetric<V>>(
    metric: &M,
    part: &GeometryPart<'_>,
) -> [Vec<f64>; 2] {
    let mut points: Vec<V> = Vec::new();
    vertices(part, &mut points);
    if !part.is_ring() {
        let far = middle(metric, &points);
        return [
            in_halves(&points, far, |line| distances(metric, line)),
            in_halves(&points, far, |line| {
                EffectiveAreas::of_line(metric, line, AreaWeight::Plain).areas().to_vec()
            }),
        ];
    }
    points.pop();
    let areas = EffectiveAreas::of_ring(metric, &points, AreaWeight::Plain).areas().to_vec();
    [of_ring(metric, &points), areas]
}

/// Vertex at which a closed line is split: the vertex farthest from its start.
fn middle<V: Copy, M: DistanceMetric<V>>(metric: &M, points: &[V]) -> Option<usize> {
    let ends = [points.first(), points.last()].map(|end| end.map(M::coordinates));
    let is_closed = points.len() > 3 && ends[0] == ends[1];
    let ends = [0, points.len().saturating_sub(1) as u32];
    let far = is_closed.then(|| largest_distance2(metric, points, &ends)).flatten();
    far.filter(|(_, square)| *square > 0.0).map(|(vertex, _)| vertex as usize)
}

fn in_halves<V>(points: &[V], far: Option<usize>, of: impl Fn(&[V]) -> Vec<f64>) -> Vec<f64> {
    let Some(far) = far else { return of(points) };
    let mut all = of(&points[..=far]);
    all.pop();
    all.extend(of(&points[far..]));
    all
}

/// Distances at which vertices of an open line are dropped; the ends are kept.
fn distances<V: Copy, M: DistanceMetric<V>>(metric: &M, line: &[V]) -> Vec<f64> {
    let mut all = vec![f64::INFINITY; line.len()];
    let tree = Hierarchy::new(metric, line);
    all.iter_mut().skip(1).zip(tree.squares()).for_each(|(own, square)| *own = square.sqrt());
    all
}

/// Distances of a ring without its closing vertex, starting at the vertex with the lowest coordinates.
fn of_ring<V: Copy, M: DistanceMetric<V>>(metric: &M, ring: &[V]) -> Vec<f64> {
    let lowest = (0..ring.len()).min_by(|a, b| {
        let [a, b] = [a, b].map(|i| M::coordinates(&ring[*i]));
        a.partial_cmp(&b).unwrap_or(std::cmp::Ordering::Equal)
    });
    let Some(start) = lowest else { return Vec::new() };
    let around: Vec<V> = (0..=ring.len()).map(|i| ring[(start + i) % ring.len()]).collect();
    let mut all = distances(metric, &around);
    all.pop();
    keep_three(&mut all);
    all.rotate_right(start);
    all
}

/// Keeps the three vertices of a ring with the largest thresholds.
fn keep_three(thresholds: &mut [f64]) {
    let mut order: Vec<usize> = (0..thresholds.len()).collect();
    // A stable order: of equal ones the first vertices stay.
    order.sort_by(|a, b| thresholds[*b].total_cmp(&thresholds[*a]));
    order.iter().take(3).for_each(|i| thresholds[*i] = f64::INFINITY);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::simplify;
    use proptest::prelude::*;
    use terrane_vector::{CoordinateSequence, Geometry, GeometryType};

    fn geometry(kind: GeometryType, xy: Vec<[f64; 2]>) -> Geometry {
        let mut coordinates = CoordinateSequence::of(xy);
        coordinates.end_part();
        Geometry::new(kind, coordinates).unwrap()
    }

    /// Vertices left by a filter by thresholds, including the closing vertex.
    fn filtered(part: &GeometryPart<'_>, thresholds: &[f64], threshold: f64) -> Vec<[f64; 2]> {
        let kept = part.xy.iter().zip(thresholds).filter(|(_, own)| **own > threshold);
        let mut kept: Vec<[f64; 2]> = kept.map(|(xy, _)| *xy).collect();
        if part.is_ring() {
            kept.extend(kept.first().copied());
        }
        kept
    }

    proptest! {
        #[test]
        fn a_filter_is_what_the_method_keeps(
            xy in prop::collection::vec((0i32..40, 0i32..40), 4..40),
            closes in any::<bool>(),
            is_ring in any::<bool>(),
            tolerance in 0u32..60,
        ) {
            let mut xy: Vec<[f64; 2]> = xy.iter().map(|(x, y)| [f64::from(*x), f64::from(*y)]).collect();
            xy.dedup();
            if closes {
                xy.push(xy[0]);
            }
            let corners: std::collections::BTreeSet<_> = xy.iter().map(|p| p.map(|c| c as i32)).collect();
            prop_assume!(corners.len() > 3);
            let kind = if is_ring { GeometryType::Polygon } else { GeometryType::LineString };
            let geometry = geometry(kind, xy);
            // Not a distance or an area that can be met: ties are for the exact to decide.
            let threshold = f64::from(tolerance) * 0.5 + 0.0123;
            for (method, which) in [(&SimplifyMethod::RDP, 0), (&SimplifyMethod::VISVALINGAM, 1)] {
                let rule = SimplifyRule { method, measure: DistanceKind::Plane, threshold, collapse: RingCollapse::Minimal };
                let (other, _) = simplify(&geometry, None, &rule).unwrap();
                let part = geometry.parts().next().unwrap();
                let own = thresholds(&part, DistanceKind::Plane).unwrap();
                let own = filtered(&part, &own[which], threshold);
                let kept = other.parts().next().unwrap().xy.to_vec();
                // A ring that collapses keeps three here; the method adds what its tolerance asks for then.
                if is_ring && own.len() <= 4 {
                    prop_assert!(own.len() == 4 && kept.len() >= 4);
                } else {
                    prop_assert_eq!(own, kept, "{}", method.name);
                }
            }
        }
    }
}
