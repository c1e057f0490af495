//! Topology of triangles, outline of the mesh, and vertices that are not points.

use std::mem::size_of;

use super::lines::TrackVertices;
use super::part::{CloudProofPart, order, position};
use super::strips::ProofStrips;
use crate::edges::{EdgeMeeting, PartCorners, compare_vertices};
use crate::exact::double_area;
use crate::{ProofPosition, ProofTally, ProofTriangle, ProofVertex};
use terrane_base::geom::Point;

/// Bytes of the tables below for one triangle, beyond those of [`PartCorners`]: vertices in strips and
/// open edges.
pub(super) const MORE_BYTES_PER_TRIANGLE: usize = 4 * size_of::<ProofPosition>();

/// Judges the edges and vertices that `part` owns.
pub(super) fn check(part: &CloudProofPart<'_>, tally: &mut ProofTally) {
    let (mut off, mut is_kept) = (Vec::new(), vec![false; part.kept.len()]);
    let corners = PartCorners::new(part.triangles, |at, heights| {
        if part.domain.owns(at) {
            check_vertex(part, at, heights, tally);
            off.extend(off_points(part, at, heights));
            keep(part, at, heights, &mut is_kept);
        }
    });
    count_required(part, &is_kept, tally);
    let mut stops = TrackVertices::new(part.lines, &part.domain, &corners.positions);
    off.retain(|&(at, z)| z.is_none_or(|z| !stops.may_be_line_vertex(at, z)));
    off.into_iter().for_each(|(at, _)| tally.off_samples.add(at));
    compare_vertices(part.vertices.unwrap_or_default(), &corners.positions, tally);
    let mut open = Vec::new();
    corners.each_edge(|ends, meeting, _| {
        stops.edge(ends);
        let is_owned = part.domain.owns(ends[0]);
        if is_owned {
            tally.edge(ends, meeting);
        }
        if let EdgeMeeting::Open(apex) = meeting {
            if is_owned && !part.hull.has_edge(ends, apex) {
                tally.cracks.add(ends[0]);
            }
            open.push(ends);
        }
    });
    stops.finish(tally);
    t_junctions(part, corners.positions, &open, tally);
}

/// Counts a position with several heights, and one beyond the hull.
fn check_vertex(
    part: &CloudProofPart<'_>,
    at: ProofPosition,
    heights: &[f64],
    tally: &mut ProofTally,
) {
    if heights.iter().any(|&z| z != heights[0]) {
        tally.split_heights.add(at);
    }
    if !part.hull.contains(at) {
        tally.outside.add(at);
    }
}

/// A position where not all corners are at points, with the height of an anchor vertex there: `None` where there are
/// points or several heights.
fn off_points(
    part: &CloudProofPart<'_>,
    at: ProofPosition,
    heights: &[f64],
) -> Option<(ProofPosition, Option<f64>)> {
    if heights.iter().all(|&z| is_point(part.points, at, z)) {
        return None;
    }
    let may_be_anchor =
        heights.iter().all(|&z| z == heights[0]) && points_at(part.points, at).is_empty();
    Some((at, may_be_anchor.then_some(heights[0])))
}

/// Marks a required point that is a vertex here, at its height.
fn keep(part: &CloudProofPart<'_>, at: ProofPosition, heights: &[f64], is_kept: &mut [bool]) {
    let found = part.kept.binary_search_by_key(&at, |&point| position(point));
    if let Ok(place) = found {
        let z = f64::from(part.kept[place].z);
        is_kept[place] = heights.iter().all(|&height| height == z);
    }
}

fn count_required(part: &CloudProofPart<'_>, is_kept: &[bool], tally: &mut ProofTally) {
    debug_assert!(part.kept.is_sorted_by_key(order), "points to keep are in order");
    for (&point, is_kept) in part.kept.iter().zip(is_kept) {
        if part.domain.owns(position(point)) {
            tally.kept += 1;
            if !is_kept {
                tally.not_kept.add(position(point));
            }
        }
    }
}

/// True when one of `points` is exactly there.
fn is_point(points: &[Point], at: ProofPosition, z: f64) -> bool {
    points_at(points, at).iter().any(|point| f64::from(point.z) == z)
}

fn points_at(points: &[Point], at: ProofPosition) -> &[Point] {
    let here = &points[points.partition_point(|point| position(*point) < at)..];
    &here[..here.partition_point(|point| position(*point) == at)]
}

/// Counts the owned vertices strictly inside an edge of one triangle.
fn t_junctions(
    part: &CloudProofPart<'_>,
    mut vertices: Vec<ProofPosition>,
    open: &[[ProofPosition; 2]],
    tally: &mut ProofTally,
) {
    vertices.retain(|&at| part.domain.owns(at));
    let strips = ProofStrips::new(vertices);
    let mut hit = Vec::new();
    for ends in open.iter().filter(|ends| touches(part, ends)) {
        strips.visit(ends, |range| {
            let near = strips.things()[range].iter().copied();
            hit.extend(near.filter(|&at| is_between(ends, at)));
        });
    }
    hit.sort_unstable();
    hit.dedup();
    hit.into_iter().for_each(|at| tally.t_junctions.add(at));
}

/// False for edges outside the domain whose triangles reach into it.
fn touches(part: &CloudProofPart<'_>, &[p, q]: &[ProofPosition; 2]) -> bool {
    let corners = [p, q, q].map(|at| ProofVertex { at, z: 0.0 });
    part.domain.may_touch(&ProofTriangle { corners })
}

/// True strictly inside the edge; the lower of its ends comes first.
fn is_between(&[p, q]: &[ProofPosition; 2], at: ProofPosition) -> bool {
    p < at && at < q && double_area(p, q, at) == 0
}
