//! Every point against the triangles above and below it.

use std::mem::size_of;

use super::bound::VerticalBound;
use super::part::{CloudProofPart, position};
use super::plane::ProofFacet;
use super::strips::ProofStrips;
use crate::exact::{double_area, exceeds};
use crate::{ErrorSpot, ProofTally, ProofTriangle};
use terrane_base::geom::Point;

/// Findings on a point.
#[derive(Clone, Copy, Debug)]
struct VerticalFinding {
    /// The largest distance to a triangle that covers it; below 0 when none does.
    distance: f64,
    is_over: bool,
    /// Strictly inside a triangle.
    is_inside: bool,
    /// Strictly inside another one, too.
    is_overlapped: bool,
}

const NOTHING: VerticalFinding =
    VerticalFinding { distance: -1.0, is_over: false, is_inside: false, is_overlapped: false };

/// Bytes of the tables below for one point.
pub(super) const BYTES_PER_POINT: usize = size_of::<Point>() + size_of::<VerticalFinding>();

/// Judges the lowest points of the part at their positions, and counts the others.
pub(super) fn check(part: &CloudProofPart<'_>, tally: &mut ProofTally) {
    let mut lowest = part.points.to_vec();
    lowest.dedup_by_key(|point| (point.x, point.y));
    tally.valid += part.points.len() as u64;
    tally.surface_samples += lowest.len() as u64;
    let strips = ProofStrips::new(lowest);
    let mut distances = VerticalDistance {
        findings: vec![NOTHING; strips.things().len()],
        strips,
        bound: part.bound,
    };
    part.triangles.iter().for_each(|triangle| distances.add(triangle));
    distances.finish(tally);
}

struct VerticalDistance {
    strips: ProofStrips<Point>,
    findings: Vec<VerticalFinding>,
    bound: Option<VerticalBound>,
}

impl VerticalFinding {
    /// Takes note of a triangle that covers the point.
    fn meet(&mut self, distance: f64, is_strict: bool, is_over: bool) {
        self.distance = self.distance.max(distance);
        self.is_over |= is_over;
        self.is_overlapped |= is_strict && self.is_inside;
        self.is_inside |= is_strict;
    }
}

impl VerticalDistance {
    fn add(&mut self, triangle: &ProofTriangle) {
        match ProofFacet::new(triangle) {
            Some(plane) => self.add_plane(triangle, &plane),
            None if triangle.double_area() != 0 => self.add_free(triangle),
            None => {}
        }
    }

    fn add_plane(&mut self, triangle: &ProofTriangle, plane: &ProofFacet) {
        let Self { strips, findings, bound } = self;
        let points = strips.things();
        strips.visit(&triangle.positions(), |range| {
            for i in range {
                if let Some(hit) = plane.hit(points[i]) {
                    let is_over = bound.is_some_and(|bound| {
                        bound.is_exceeded(hit.distance, || bound.is_below(hit.off, plane.area))
                    });
                    findings[i].meet(hit.distance, hit.is_strict, is_over);
                }
            }
        });
    }

    /// The same for a triangle with a corner off the lattice.
    fn add_free(&mut self, triangle: &ProofTriangle) {
        let Self { strips, findings, bound } = self;
        let points = strips.things();
        let [a, b, c] = triangle.positions();
        let sign = double_area(a, b, c).signum();
        strips.visit(&[a, b, c], |range| {
            for i in range {
                let (at, z) = (position(points[i]), f64::from(points[i].z));
                let sides = [(b, c), (c, a), (a, b)].map(|(p, q)| sign * double_area(at, p, q));
                if sides.iter().any(|&side| side < 0) {
                    continue;
                }
                let distance = distance(triangle, sides, z);
                let is_over = bound.is_some_and(|bound| {
                    is_beyond(triangle, distance, z, bound, || {
                        exceeds(triangle, at, z, bound.steps())
                    })
                });
                findings[i].meet(distance, sides.iter().all(|&side| side > 0), is_over);
            }
        });
    }

    fn finish(&self, tally: &mut ProofTally) {
        for (&point, findings) in self.strips.things().iter().zip(&self.findings) {
            let at = position(point);
            if findings.distance < 0.0 {
                tally.uncovered.add(at);
                continue;
            }
            tally.covered += 1;
            tally.errors.add(findings.distance);
            tally.squares.add(findings.distance * findings.distance);
            tally.spot(ErrorSpot { error: findings.distance, at });
            if findings.is_over {
                tally.over.add(at);
            }
            if findings.is_overlapped {
                tally.overlaps.add(at);
            }
            if let Some(bound) = self.bound {
                tally.histogram[bin(findings, bound)] += 1;
            }
        }
    }
}

/// Which twentieth of the bound the distance is in, or the bin of those over.
fn bin(findings: &VerticalFinding, bound: VerticalBound) -> usize {
    let bins = ProofTally::BINS;
    // 0 / 0 is NaN, which casts to bin 0.
    let bin = (findings.distance * bins as f64 / bound.steps()) as usize;
    if findings.is_over { bins } else { bin.min(bins - 1) }
}

/// The distance of a height to the plane of a triangle where these are the weights of its corners.
fn distance(triangle: &ProofTriangle, weights: [i128; 3], z: f64) -> f64 {
    let [a, b, c] = [0, 1, 2].map(|i| weights[i] as f64 * (triangle.corners[i].z - z));
    ((a + b + c) / weights.iter().sum::<i128>() as f64).abs()
}

/// Whether a distance is beyond the bound, exactly; heights that differ much leave more doubt.
fn is_beyond(
    triangle: &ProofTriangle,
    distance: f64,
    z: f64,
    bound: VerticalBound,
    exactly: impl FnOnce() -> bool,
) -> bool {
    let max = triangle.corners.iter().map(|corner| (corner.z - z).abs()).fold(0.0, f64::max);
    let doubt = max * 2f64.powi(-44);
    if distance + doubt < bound.steps() {
        return false;
    }
    distance - doubt > bound.steps() || exactly()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ProofPosition, ProofVertex};
    use proptest::prelude::*;

    proptest! {
        /// Both ways of judging, on triangles that either can take.
        #[test]
        fn whole_numbers_and_fractions_agree(
            corners in prop::array::uniform3([0..40i64, 0..40, -9..9]),
            points in prop::collection::vec([0..40i32, 0..40, -9..9], 1..60),
            halves in 0..8u32,
        ) {
            let vertex = |[x, y, z]: [i64; 3]| ProofVertex { at: ProofPosition::sample(x, y), z: z as f64 };
            let triangle = ProofTriangle { corners: corners.map(vertex) };
            prop_assume!(triangle.double_area() != 0);
            let mut points: Vec<Point> = points.iter().map(|p| Point::new(p[0], p[1], p[2])).collect();
            points.sort_unstable_by_key(crate::cloud::order);
            let plumb = || {
                let findings = vec![NOTHING; points.len()];
                let bound = Some(VerticalBound::new(f64::from(halves), 2.0));
                VerticalDistance { strips: ProofStrips::new(points.clone()), findings, bound }
            };
            let (mut whole, mut free) = (plumb(), plumb());
            whole.add(&triangle);
            free.add_free(&triangle);
            for (a, b) in whole.findings.iter().zip(&free.findings) {
                prop_assert!((a.distance - b.distance).abs() < 1e-12);
                prop_assert_eq!((a.is_over, a.is_inside), (b.is_over, b.is_inside));
            }
        }
    }

    #[test]
    fn a_fraction_of_a_step_beyond_the_bound_is_found() {
        // The plane is level at half a step; the point is 2.5 steps above it.
        let vertex = |x, y| ProofVertex { at: ProofPosition::sample(x, y), z: 0.5 };
        let triangle = ProofTriangle { corners: [vertex(0, 0), vertex(9, 0), vertex(0, 9)] };
        let judge = |tolerance: f64| {
            let bound = Some(VerticalBound::new(tolerance, 1.0));
            let strips = ProofStrips::new(vec![Point::new(1, 1, 3)]);
            let mut plumb = VerticalDistance { strips, findings: vec![NOTHING], bound };
            plumb.add(&triangle);
            plumb.findings[0]
        };
        assert_eq!((judge(2.5).distance, judge(2.5).is_over), (2.5, false));
        assert!(judge(2.5f64.next_down()).is_over);
    }
}
