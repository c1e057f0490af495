//! The proof against a twin that tries every triangle on every point, and against planted faults.

use std::collections::BTreeMap;

use super::*;
use crate::{DomainLayout, ErrorSpot, ExactSum, ProofVertex};
use proptest::prelude::*;

/// A cloud and a mesh on a lattice of 200 x 150 steps.
#[derive(Clone, Debug)]
struct Case {
    points: Vec<Point>,
    triangles: Vec<ProofTriangle>,
    vertices: Vec<ProofPosition>,
    halves: u32,
}

const GRID: [u32; 2] = [200, 150];

fn at(point: &Point) -> ProofPosition {
    ProofPosition::sample(i64::from(point.x), i64::from(point.y))
}

fn vertex(point: &Point) -> ProofVertex {
    ProofVertex { at: at(point), z: f64::from(point.z) }
}

/// Twice the area of (a, b, c), in steps.
fn turn(a: ProofPosition, b: ProofPosition, c: ProofPosition) -> i128 {
    let d = |p: i64, q: i64| i128::from((p >> 30) - (q >> 30));
    d(b.col, a.col) * d(c.row, a.row) - d(b.row, a.row) * d(c.col, a.col)
}

impl Case {
    fn hull(&self) -> Option<ProofHull> {
        let mut wrap = HullGatherer::default();
        self.points.iter().for_each(|p| wrap.add([p.x, p.y]));
        wrap.finish()
    }

    /// Domain by domain.
    fn check(&self, size: [u32; 2]) -> ProofTally {
        let layout = DomainLayout { grid: GRID, size };
        let hull = self.hull().unwrap();
        let mut all = ProofTally::default();
        for index in 0..layout.len() {
            let domain = layout.domain(index);
            let mut points = self.points.clone();
            points.retain(|p| domain.owns(at(p)));
            points.sort_unstable_by_key(order);
            let mut vertices = self.vertices.clone();
            vertices.retain(|&at| domain.owns(at));
            vertices.sort_unstable();
            let touch = |t: &&ProofTriangle| domain.may_touch(t);
            let triangles: Vec<ProofTriangle> =
                self.triangles.iter().filter(touch).copied().collect();
            let part = CloudProofPart {
                domain,
                points: &points,
                triangles: &triangles,
                vertices: Some(&vertices),
                hull: &hull,
                bound: Some(self.bound()),
                kept: &[],
                lines: &[],
            };
            let mut tally = ProofTally::default();
            check(&part, &mut tally);
            all.merge(&tally);
        }
        all
    }

    fn bound(&self) -> VerticalBound {
        VerticalBound::new(f64::from(self.halves), 2.0)
    }

    /// Lines with all points on their left or on them, through two points of the hull.
    fn supports(&self) -> Vec<[ProofPosition; 2]> {
        let places: Vec<ProofPosition> = self.points.iter().map(at).collect();
        let pairs = places.iter().flat_map(|&p| places.iter().map(move |&q| [p, q]));
        let is_support = |&[p, q]: &[ProofPosition; 2]| {
            p != q && places.iter().all(|&other| turn(p, q, other) >= 0)
        };
        pairs.filter(is_support).collect()
    }

    fn naive(&self) -> ProofTally {
        let mut tally = ProofTally::default();
        self.naive_points(&mut tally);
        self.triangles.iter().for_each(|triangle| tally.shape(triangle, 1));
        let supports = self.supports();
        self.naive_edges(&supports, &mut tally);
        self.naive_vertices(&mut tally);
        tally
    }

    fn naive_points(&self, tally: &mut ProofTally) {
        for point in &self.points {
            tally.valid += 1;
            let mut rest = self.points.iter().filter(|p| at(p) == at(point));
            let lowest = rest.clone().map(|p| p.z).min() == Some(point.z);
            if !lowest || !std::ptr::eq(rest.find(|p| p.z == point.z).unwrap(), point) {
                continue;
            }
            tally.surface_samples += 1;
            let hits: Vec<_> = self.triangles.iter().filter_map(|t| naive_hit(t, point)).collect();
            let Some(error) = hits.iter().map(|h| h.0 as f64 / h.1 as f64).reduce(f64::max) else {
                tally.uncovered.add(at(point));
                continue;
            };
            tally.covered += 1;
            tally.errors.add(error);
            tally.squares.add(error * error);
            tally.spot(ErrorSpot { error, at: at(point) });
            let over = hits.iter().any(|h| 2 * h.0 > i128::from(self.halves) * h.1);
            let bin = (error * 20.0 / (f64::from(self.halves) / 2.0)) as usize;
            tally.histogram[if over { 20 } else { bin.min(19) }] += 1;
            if over {
                tally.over.add(at(point));
            }
            if hits.iter().filter(|h| h.2).count() > 1 {
                tally.overlaps.add(at(point));
            }
        }
    }

    fn naive_edges(&self, supports: &[[ProofPosition; 2]], tally: &mut ProofTally) {
        let mut edges: BTreeMap<[ProofPosition; 2], Vec<(bool, ProofPosition)>> = BTreeMap::new();
        for t in &self.triangles {
            let p = t.positions();
            for (a, b, apex) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                if p[a] != p[b] {
                    let ends = [p[a].min(p[b]), p[a].max(p[b])];
                    edges.entry(ends).or_default().push((p[a] < p[b], p[apex]));
                }
            }
        }
        let used: std::collections::BTreeSet<ProofPosition> =
            self.triangles.iter().flat_map(ProofTriangle::positions).collect();
        let mut hit = std::collections::BTreeSet::new();
        for ([p, q], uses) in edges {
            match uses[..] {
                [(_, apex)] => {
                    tally.open_edges += 1;
                    if !is_side(supports, p, q, apex) {
                        tally.cracks.add(p);
                    }
                    hit.extend(used.iter().filter(|&&v| p < v && v < q && turn(p, q, v) == 0));
                }
                [(one, a), (other, b)] if one != other => {
                    tally.interior_edges += 1;
                    if is_bad(p, q, a, b) {
                        tally.non_delaunay.add(p);
                    }
                }
                _ => tally.non_manifold.add(p),
            }
        }
        hit.into_iter().for_each(|v| tally.t_junctions.add(v));
        for &v in &used {
            if supports.iter().any(|&[a, b]| turn(a, b, v) < 0) {
                tally.outside.add(v);
            }
        }
        let all = self.vertices.iter().collect::<Vec<_>>();
        for v in &all {
            if !used.contains(v) {
                tally.unused.add(**v);
            }
        }
    }

    fn naive_vertices(&self, tally: &mut ProofTally) {
        let mut heights: BTreeMap<ProofPosition, Vec<f64>> = BTreeMap::new();
        for corner in self.triangles.iter().flat_map(|t| t.corners) {
            heights.entry(corner.at).or_default().push(corner.z);
        }
        for (here, heights) in heights {
            if heights.iter().any(|&z| z != heights[0]) {
                tally.split_heights.add(here);
            }
            let is_point =
                |z: f64| self.points.iter().any(|p| at(p) == here && f64::from(p.z) == z);
            if !heights.iter().all(|&z| is_point(z)) {
                tally.off_samples.add(here);
            }
        }
        let mut seen = std::collections::BTreeSet::new();
        for &v in &self.vertices {
            if !seen.insert(v) {
                tally.duplicates.add(v);
            }
        }
    }
}

/// How far the point is off times the area, the area, and whether it is on no edge.
fn naive_hit(t: &ProofTriangle, point: &Point) -> Option<(i128, i128, bool)> {
    let [a, b, c] = t.positions();
    let (area, p) = (turn(a, b, c), at(point));
    if area == 0 {
        return None;
    }
    let weights = [turn(p, b, c), turn(a, p, c), turn(a, b, p)].map(|w| w * area.signum());
    let mut off = area.abs() * i128::from(point.z);
    for (weight, corner) in weights.iter().zip(t.corners) {
        off -= weight * corner.z as i128;
    }
    let covers = weights.iter().all(|&w| w >= 0);
    covers.then_some((off.abs(), area.abs(), weights.iter().all(|&w| w > 0)))
}

/// True for an edge on a line that supports the hull, between points of the cloud on that line.
fn is_side(
    supports: &[[ProofPosition; 2]],
    p: ProofPosition,
    q: ProofPosition,
    apex: ProofPosition,
) -> bool {
    let inner = turn(p, q, apex);
    let (p, q) = if inner > 0 { (p, q) } else { (q, p) };
    let along = |a: ProofPosition, b: ProofPosition| {
        let d = |x: i64, y: i64| i128::from((x >> 30) - (y >> 30));
        d(q.col, p.col) * d(b.col, a.col) + d(q.row, p.row) * d(b.row, a.row)
    };
    inner != 0
        && supports.iter().any(|&[a, b]| {
            turn(a, b, p) == 0
                && turn(a, b, q) == 0
                && along(a, b) > 0
                && along(a, p) >= 0
                && along(q, b) >= 0
        })
}

fn is_bad(p: ProofPosition, q: ProofPosition, a: ProofPosition, b: ProofPosition) -> bool {
    let sides = turn(p, q, a).signum() * turn(p, q, b).signum();
    let [p, q, a] = [p, q, a].map(|v| {
        let (x, y) = (i128::from((v.col - b.col) >> 30), i128::from((v.row - b.row) >> 30));
        [x, y, x * x + y * y]
    });
    let minor = |u: [i128; 3], v: [i128; 3]| u[0] * v[1] - u[1] * v[0];
    let lift = p[2] * minor(q, a) + q[2] * minor(a, p) + a[2] * minor(p, q);
    let turn = minor(p, q) + minor(q, a) + minor(a, p);
    sides < 0 && lift * turn.signum() > 0
}

/// Leaves sums in one form.
fn settled(mut tally: ProofTally) -> (ProofTally, f64, f64) {
    let (errors, squares) = (tally.errors.value(), tally.squares.value());
    (tally.errors, tally.squares) = (ExactSum::default(), ExactSum::default());
    (tally, errors, squares)
}

fn assert_same(case: &Case) {
    let slow = settled(case.naive());
    for size in [[224, 160], [64, 64], [32, 160], [96, 32]] {
        assert_eq!(settled(case.check(size)), slow, "domains of {size:?}");
    }
}

fn point() -> impl Strategy<Value = Point> {
    let near = (0..12i32, 0..12i32).prop_map(|(x, y)| (x + 60, y + 60));
    let far = (0..200i32, 0..150i32);
    (prop_oneof![near, far], -3..3i32).prop_map(|((x, y), z)| Point::new(x, y, z))
}

/// Triangles between any points, and some beyond.
fn soup() -> impl Strategy<Value = Case> {
    let corner = (0..60usize, -40..260i64, -30..190i64, 0..12u8);
    let corners = prop::collection::vec([corner.clone(), corner.clone(), corner], 0..40);
    let points = prop::collection::vec(point(), 3..60);
    (points, corners, prop::collection::vec(0..60usize, 0..30), 0..6u32).prop_map(
        |(points, corners, extra, halves)| {
            let triangles = corners.into_iter().map(|corners| ProofTriangle {
                corners: corners.map(|(i, x, y, odds)| match odds {
                    0 => ProofVertex { at: ProofPosition::sample(x, y), z: 0.0 },
                    _ => vertex(&points[i % points.len()]),
                }),
            });
            let triangles: Vec<ProofTriangle> = triangles.collect();
            let used = triangles.iter().flat_map(|t| t.positions()).step_by(2);
            let extra = extra.into_iter().map(|i| at(&points[i % points.len()]));
            let vertices = used.chain(extra).collect();
            Case { points, triangles, vertices, halves }
        },
    )
}

proptest! {
    #[test]
    fn any_mesh_is_judged_as_by_the_twin(case in soup()) {
        if case.hull().is_some() {
            assert_same(&case);
        }
    }
}

/// A sound mesh: a sheet of squares of 10 steps, each cut in two, with points between.
fn sheet() -> Case {
    let height = |x: i32, y: i32| (x * 7 + y * 3) % 11;
    let corner = |c: i32, r: i32| Point::new(c * 10, r * 10, height(c, r));
    let all = || (0..14).flat_map(|r| (0..18).map(move |c| (c, r)));
    let mut points: Vec<Point> = all().map(|(c, r)| corner(c, r)).collect();
    let vertices = points.iter().map(at).collect();
    let squares = all().filter(|&(c, r)| c < 17 && r < 13);
    let triangles = squares.flat_map(|(c, r)| {
        let [a, b, d, e] =
            [(c, r), (c + 1, r), (c, r + 1), (c + 1, r + 1)].map(|(c, r)| vertex(&corner(c, r)));
        [ProofTriangle { corners: [a, b, e] }, ProofTriangle { corners: [a, e, d] }]
    });
    let triangles: Vec<ProofTriangle> = triangles.collect();
    for (i, t) in triangles.iter().enumerate() {
        // The middle of a side, a step or two from its plane.
        let [a, b, _] = t.corners;
        let mid = |p: i64, q: i64| ((p + q) >> 31) as i32;
        let z = f64::midpoint(a.z, b.z).floor() as i32 + (i % 3) as i32;
        points.push(Point::new(mid(a.at.col, b.at.col), mid(a.at.row, b.at.row), z));
    }
    points.sort_unstable();
    Case { points, triangles, vertices, halves: 4 }
}

/// Everything that a sound mesh has none of.
fn faults(tally: &ProofTally) -> Vec<(&'static str, u64)> {
    let all = [
        ("uncovered", tally.uncovered.count),
        ("over", tally.over.count),
        ("inverted", tally.inverted.count),
        ("empty", tally.empty.count),
        ("outside", tally.outside.count),
        ("overlaps", tally.overlaps.count),
        ("cracks", tally.cracks.count),
        ("t-junctions", tally.t_junctions.count),
        ("non-manifold", tally.non_manifold.count),
        ("split", tally.split_heights.count),
        ("duplicates", tally.duplicates.count),
        ("unused", tally.unused.count),
        ("off", tally.off_samples.count),
    ];
    all.into_iter().filter(|(_, count)| *count > 0).collect()
}

/// What is found after `spoil`, the same in every division; "area" when that does not match.
fn found(spoil: impl FnOnce(&mut Case)) -> Vec<(&'static str, u64)> {
    let mut case = sheet();
    spoil(&mut case);
    assert_same(&case);
    let tally = case.check([64, 64]);
    let mut faults = faults(&tally);
    if tally.double_area != case.hull().unwrap().double_area() {
        faults.push(("area", 1));
    }
    faults
}

/// The number of a triangle in the middle of the sheet.
fn middle(case: &Case) -> usize {
    case.triangles.iter().position(|t| t.corners[0].at == ProofPosition::sample(70, 60)).unwrap()
}

/// Moves the vertex at a position, wherever it is used.
fn shift(case: &mut Case, from: ProofPosition, to: ProofVertex) {
    let corners = case.triangles.iter_mut().flat_map(|t| &mut t.corners);
    corners.filter(|c| c.at == from).for_each(|c| *c = to);
    case.vertices.iter_mut().filter(|v| **v == from).for_each(|v| *v = to.at);
}

#[test]
fn a_sound_mesh_has_no_fault() {
    assert_eq!(found(|_| {}), []);
    let tally = sheet().check([64, 64]);
    assert_eq!((tally.covered, tally.valid), (694, 694));
    assert!(tally.worst.unwrap().error <= 2.0);
}

#[test]
fn a_point_a_step_beyond_the_tolerance_is_found_and_one_above_another_is_not() {
    let raise = |by: i32| {
        move |case: &mut Case| {
            let i = case.points.iter().position(|p| (p.x, p.y) == (75, 60)).unwrap();
            case.points[i].z += by;
        }
    };
    let beyond = |by| found(raise(by)).contains(&("over", 1));
    let limit = (0..9).find(|&by| beyond(by)).unwrap();
    assert!(limit > 0 && beyond(limit + 1));
    let stacked = |case: &mut Case| case.points.push(Point::new(75, 60, 500));
    assert_eq!(found(stacked), []);
}

#[test]
fn vertices_that_were_moved_are_found() {
    let lift = |case: &mut Case| {
        let z = vertex(&case.points[0]).z + 1.0;
        shift(
            case,
            ProofPosition::sample(0, 0),
            ProofVertex { at: ProofPosition::sample(0, 0), z },
        );
    };
    assert_eq!(found(lift), [("off", 1)]);
    let aside = |case: &mut Case| {
        shift(
            case,
            ProofPosition::sample(70, 60),
            ProofVertex { at: ProofPosition::sample(71, 60), z: 0.0 },
        );
    };
    assert_eq!(found(aside).last().unwrap(), &("off", 1));
    let beyond = |case: &mut Case| {
        shift(
            case,
            ProofPosition::sample(170, 60),
            ProofVertex { at: ProofPosition::sample(171, 60), z: 0.0 },
        );
    };
    let names: Vec<&str> = found(beyond).iter().map(|f| f.0).collect();
    assert!(["outside", "cracks", "off", "area"].iter().all(|n| names.contains(n)), "{names:?}");
}

#[test]
fn triangles_removed_flipped_or_doubled_are_found() {
    let hole = |case: &mut Case| {
        case.triangles.remove(middle(case));
    };
    assert_eq!(found(hole), [("cracks", 3), ("area", 1)]);
    let rim = |case: &mut Case| {
        case.triangles.remove(0);
    };
    let names: Vec<&str> = found(rim).iter().map(|f| f.0).collect();
    assert!(names.contains(&"cracks") && names.contains(&"area"));
    let flip = |case: &mut Case| {
        let i = middle(case);
        case.triangles[i].corners.swap(0, 1);
    };
    assert_eq!(found(flip), [("inverted", 1), ("non-manifold", 3), ("area", 1)]);
    let double = |case: &mut Case| case.triangles.push(case.triangles[middle(case)]);
    assert_eq!(found(double), [("non-manifold", 3), ("area", 1)]);
    let inside = |case: &mut Case| {
        double(case);
        case.points.push(Point::new(76, 62, 3));
    };
    assert!(found(inside).contains(&("overlaps", 1)));
}

#[test]
fn cracks_of_a_step_and_vertices_inside_edges_are_found() {
    // One triangle lets go of a corner, sideways or in height.
    let gap = |case: &mut Case| {
        let i = middle(case);
        case.triangles[i].corners[0].at = ProofPosition::sample(71, 60);
    };
    let names: Vec<&str> = found(gap).iter().map(|f| f.0).collect();
    assert!(
        ["cracks", "t-junctions", "off", "area"].iter().all(|n| names.contains(n)),
        "{names:?}"
    );
    let step = |case: &mut Case| {
        let i = middle(case);
        case.triangles[i].corners[0].z += 1.0;
    };
    assert_eq!(found(step), [("split", 1), ("off", 1)]);
    // A triangle is cut in two at a point of a side that its neighbour does not know.
    let junction = |case: &mut Case| {
        let i = middle(case);
        let [a, b, c] = case.triangles[i].corners;
        let mid = *case.points.iter().find(|p| (p.x, p.y) == (75, 60)).unwrap();
        case.triangles[i] = ProofTriangle { corners: [a, vertex(&mid), c] };
        case.triangles.push(ProofTriangle { corners: [vertex(&mid), b, c] });
        case.vertices.push(at(&mid));
    };
    assert_eq!(found(junction), [("cracks", 3), ("t-junctions", 1)]);
}

#[test]
fn vertices_stored_twice_or_for_nothing_are_found() {
    let twice = |case: &mut Case| case.vertices.push(case.vertices[20]);
    assert_eq!(found(twice), [("duplicates", 1)]);
    let idle = |case: &mut Case| case.vertices.push(ProofPosition::sample(75, 60));
    assert_eq!(found(idle), [("unused", 1)]);
    let empty = |case: &mut Case| {
        let i = middle(case);
        let [a, b, _] = case.triangles[i].corners;
        case.triangles.push(ProofTriangle { corners: [a, b, b] });
    };
    assert!(found(empty).contains(&("empty", 1)));
}

#[test]
fn a_point_beyond_the_mesh_is_uncovered() {
    let beyond = |case: &mut Case| case.points.push(Point::new(199, 60, 0));
    let names: Vec<&str> = found(beyond).iter().map(|f| f.0).collect();
    assert_eq!(names, ["uncovered", "cracks", "area"]);
}
