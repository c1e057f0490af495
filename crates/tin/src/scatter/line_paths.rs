//! Lines over a point cloud: lattice paths along which mesh edges run.
//!
//! A line between two positions is represented by a [`SampleSegment`]'s path on the point cloud's lattice, as over the
//! samples of a grid: from each vertex on the path an edge has to lead to a later one. Where none does, an *anchor
//! vertex* is inserted between two neighbouring vertices of the path; no edge is forced, so the mesh stays the Delaunay
//! triangulation of its vertices. The insertion terminates because a step of a path is an edge of every triangulation
//! that has both of its ends: its diametral circle contains no other position.
//!
//! Placement follows the shells of Ruppert (1995) and Si (2015). Of the vertices along the missing edge, the one with
//! the widest angle to it encroaches; the anchor vertex is as far from the nearer end as that vertex. A point close to
//! a line therefore costs one anchor vertex and not a cascade down to single steps, and two lines that meet at a small
//! angle get anchor vertices at equal distances, which do not encroach on each other.

use std::ops::RangeInclusive;

use super::mesh::{GHOST, NONE, ScatterMesh};
use crate::breaklines::turn;
use terrane_base::geom::SampleSegment;
use terrane_delaunay::orient;

type Site = [i32; 2];

/// A part of a line: the steps of its path within a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClippedSegment {
    /// The segment.
    pub segment: SampleSegment,
    /// First step in the rectangle.
    pub from: u64,
    /// Last step in the rectangle.
    pub to: u64,
    /// The step at which the next rectangle begins with a vertex; `None` at the end of the line.
    pub next: Option<u64>,
    /// The last step of the whole line.
    pub last: u64,
}

impl ClippedSegment {
    /// The step at which this part of the path reaches a position, if it does.
    fn step_of(&self, at: Site) -> Option<u64> {
        let step = self.segment.step_of(at.map(i64::from))?;
        (self.from..=self.to).contains(&step).then_some(step)
    }

    fn site(&self, step: u64) -> Site {
        self.segment.at(step).map(|steps| steps as i32)
    }

    /// The first and the last position in the rectangle.
    fn ends(&self) -> [[i64; 2]; 2] {
        [self.from, self.to].map(|step| self.segment.at(step))
    }

    /// The ends of the whole segment.
    fn segment_ends(&self) -> [[i64; 2]; 2] {
        [0, self.segment.steps()].map(|step| self.segment.at(step))
    }
}

/// The path parts of a rectangle, with a spatial index.
#[derive(Debug)]
pub struct ClippedSegments {
    all: Vec<ClippedSegment>,
    low: [i64; 2],
    /// Side of a bin, bins across and down.
    side: i64,
    counts: [i64; 2],
    /// Per bin: start of its parts in `listed`.
    starts: Vec<u32>,
    listed: Vec<u32>,
}

/// Missing constraints of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingConstraints {
    /// Positions that should become vertices, sorted, without duplicates.
    pub posts: Vec<Site>,
    /// Vertices after which an edge is missing and no anchor vertex is possible.
    pub apart: Vec<Site>,
}

/// A vertex on a path part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct CourseVertex {
    course: u32,
    step: u64,
    vertex: u32,
}

impl ClippedSegments {
    /// Maximum number of bins along a side.
    const MOST: usize = 64;
    /// Approximate bytes per path part, including its index entries.
    pub const BYTES: u64 = size_of::<ClippedSegment>() as u64 + 4 * 2 * Self::MOST as u64;

    /// Indexes a list of parts. Bins divide their common bounding box, so that few parts share one however close they
    /// are.
    pub fn new(all: Vec<ClippedSegment>) -> Self {
        let first = all.first().map_or([0; 2], |course| course.ends()[0]);
        let (mut low, mut high) = (first, first);
        for end in all.iter().flat_map(ClippedSegment::ends) {
            for axis in 0..2 {
                low[axis] = low[axis].min(end[axis]);
                high[axis] = high[axis].max(end[axis]);
            }
        }
        let spans = [0, 1].map(|axis| high[axis] - low[axis] + 1);
        let along = all.len().isqrt().clamp(1, Self::MOST) as i64;
        let side = (spans[0].max(spans[1]) + along - 1) / along;
        let counts = spans.map(|span| (span + side - 1) / side);
        let mut courses = Self { all, low, side, counts, starts: Vec::new(), listed: Vec::new() };
        let mut places: Vec<(u32, u32)> = Vec::new();
        for (number, course) in (0..).zip(&courses.all) {
            courses.each_bin(course, |bin| places.push((bin, number)));
        }
        places.sort_unstable();
        let bins = (counts[0] * counts[1]) as u32;
        let starts = (0..=bins).map(|bin| places.partition_point(|&(other, _)| other < bin) as u32);
        courses.starts = starts.collect();
        courses.listed = places.into_iter().map(|(_, number)| number).collect();
        courses
    }

    /// True if there are no parts.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    fn bin_of(&self, at: [i64; 2]) -> [i64; 2] {
        [0, 1].map(|axis| (at[axis] - self.low[axis]).div_euclid(self.side))
    }

    /// The bins that a part passes, row by row.
    fn each_bin(&self, course: &ClippedSegment, mut each: impl FnMut(u32)) {
        let [first, last] = course.ends().map(|end| self.bin_of(end));
        let (west, east) = (first[0].min(last[0]), first[0].max(last[0]));
        for row in first[1].min(last[1])..=first[1].max(last[1]) {
            let south = self.low[1] + row * self.side;
            let low = [self.low[0] + west * self.side, south];
            let high = [self.low[0] + (east + 1) * self.side - 1, south + self.side - 1];
            // In a row of bins steps are one run: from its ends follow its columns, and no bin is named twice.
            let Some(steps) = course.segment.within(low, high) else { continue };
            let [a, b] = [*steps.start().max(&course.from), *steps.end().min(&course.to)];
            let [a, b] = [a, b].map(|step| self.bin_of(course.segment.at(step))[0]);
            (a.min(b)..=a.max(b)).for_each(|col| each((row * self.counts[0] + col) as u32));
        }
    }

    fn listed_in(&self, bin: usize) -> &[u32] {
        &self.listed[self.starts[bin] as usize..self.starts[bin + 1] as usize]
    }

    /// The parts whose path reaches a position, by number, with the step.
    pub fn at(&self, site: Site) -> impl Iterator<Item = (u32, u64)> + '_ {
        let [col, row] = self.bin_of(site.map(i64::from));
        let inside = (0..self.counts[0]).contains(&col) && (0..self.counts[1]).contains(&row);
        let bin = inside.then_some((row * self.counts[0] + col) as usize);
        let near = bin.map_or(&[][..], |bin| self.listed_in(bin));
        near.iter().filter_map(move |&number| {
            self.all[number as usize].step_of(site).map(|step| (number, step))
        })
    }

    /// Positions near the intersections of straight lines, on the paths of both; `None` if there are more than `max_count`.
    pub fn crossings(&self, max_count: usize) -> Option<Vec<Site>> {
        let mut found = Vec::new();
        for bin in 0..self.starts.len() - 1 {
            let near = self.listed_in(bin);
            for (i, &a) in near.iter().enumerate() {
                let pairs = near[..i].iter().map(|&b| [a, b].map(|n| &self.all[n as usize]));
                found.extend(pairs.filter_map(|[a, b]| crossing(a, b)));
                // Two lines that share several bins are found in each: repeats do not count.
                if found.len() > max_count {
                    found.sort_unstable();
                    found.dedup();
                    if found.len() > max_count {
                        return None;
                    }
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        Some(found)
    }

    /// Finds vertices on paths after which an edge is missing. Anchor vertices are placed where `may` is true.
    pub fn gaps(&self, mesh: &ScatterMesh, may: impl Fn(Site) -> bool) -> MissingConstraints {
        let stops = self.stops(mesh);
        let triangles = triangles(mesh);
        let mut gaps = MissingConstraints::default();
        for (i, stop) in stops.iter().enumerate() {
            let course = &self.all[stop.course as usize];
            if stop.step == course.last || goes_on(mesh, &triangles, stop, course) {
                continue;
            }
            let next = stops.get(i + 1).filter(|next| next.course == stop.course);
            let next = next.map(|next| next.step).or(course.next);
            let post = next.and_then(|next| {
                let aim = aim(mesh, &triangles, stop, course, next);
                nearest(aim, stop.step + 1..=next - 1, |step| may(course.site(step)))
            });
            match post {
                Some(step) => gaps.posts.push(course.site(step)),
                None => gaps.apart.push(course.site(stop.step)),
            }
        }
        gaps.posts.sort_unstable();
        gaps.posts.dedup();
        gaps
    }

    /// The vertices on paths, part by part and in order along each.
    fn stops(&self, mesh: &ScatterMesh) -> Vec<CourseVertex> {
        let mut stops = Vec::new();
        for (vertex, point) in (0..).zip(mesh.points()) {
            let on = self.at([point.x, point.y]);
            stops.extend(on.map(|(course, step)| CourseVertex { course, step, vertex }));
        }
        stops.sort_unstable();
        stops
    }
}

/// The step nearest to `aim` that satisfies a test; the lower one of two.
fn nearest(aim: u64, steps: RangeInclusive<u64>, holds: impl Fn(u64) -> bool) -> Option<u64> {
    let (first, last) = (*steps.start(), *steps.end());
    let reach = (aim - first.min(aim)).max(last.max(aim) - aim);
    // Steps below 0 wrap beyond the range, which leaves them out.
    let around = (0..=reach).flat_map(|off| [aim.wrapping_sub(off), aim + off]);
    around.filter(|step| steps.contains(step)).find(|&step| holds(step))
}

/// Per vertex: one of its triangles.
fn triangles(mesh: &ScatterMesh) -> Vec<u32> {
    let mut triangles = vec![NONE; mesh.points().len()];
    for (number, triangle) in (0..).zip(mesh.triangles()) {
        for corner in triangle.corners.into_iter().filter(|&corner| corner != GHOST) {
            triangles[corner as usize] = number;
        }
    }
    triangles
}

/// The triangles around a vertex, each with the index of the vertex in it.
fn around(mesh: &ScatterMesh, first: u32, vertex: u32) -> impl Iterator<Item = (u32, usize)> + '_ {
    let start = (first, corner_index(mesh, first, vertex));
    std::iter::successors(Some(start), move |&(triangle, k)| {
        let next = mesh.triangles()[triangle as usize].twins[(k + 1) % 3];
        (next != first).then(|| (next, corner_index(mesh, next, vertex)))
    })
}

/// The index of a vertex in a triangle.
fn corner_index(mesh: &ScatterMesh, triangle: u32, vertex: u32) -> usize {
    let corners = mesh.triangles()[triangle as usize].corners;
    corners.iter().position(|&corner| corner == vertex).unwrap_or(0)
}

/// Position of a vertex; `None` for that of ghosts.
fn site(mesh: &ScatterMesh, vertex: u32) -> Option<Site> {
    mesh.points().get(vertex as usize).map(|p| [p.x, p.y])
}

fn goes_on(
    mesh: &ScatterMesh,
    triangles: &[u32],
    stop: &CourseVertex,
    course: &ClippedSegment,
) -> bool {
    let mut all = around(mesh, triangles[stop.vertex as usize], stop.vertex);
    all.any(|(triangle, k)| {
        let neighbour = mesh.triangles()[triangle as usize].corners[(k + 1) % 3];
        let at = site(mesh, neighbour).map(|at| at.map(i64::from));
        let step = at.and_then(|at| course.segment.step_of(at));
        step.is_some_and(|step| step > stop.step && step <= course.last)
    })
}

/// The preferred step for an anchor vertex between a vertex and the next.
fn aim(
    mesh: &ScatterMesh,
    triangles: &[u32],
    stop: &CourseVertex,
    course: &ClippedSegment,
    next: u64,
) -> u64 {
    let (a, b) = (course.site(stop.step), course.site(next));
    let [first, last] = course.segment_ends();
    let [dx, dy] = [0, 1].map(|axis| (last[axis] - first[axis]) as f64);
    let steps_by_length = course.segment.steps() as f64 / (dx * dx + dy * dy).sqrt();
    let steps = |distance: f64| (distance * steps_by_length).round() as u64;
    let step = match in_the_way(mesh, triangles[stop.vertex as usize], stop.vertex, [a, b]) {
        Some([from_a, from_b]) if from_a <= from_b => stop.step.saturating_add(steps(from_a)),
        Some([_, from_b]) => next.saturating_sub(steps(from_b)),
        None => stop.step.midpoint(next),
    };
    step.clamp(stop.step + 1, (next - 1).max(stop.step + 1))
}

/// Distances, from both ends of a missing edge, of the vertex with the widest angle to the edge, among all triangles
/// that the edge would cross; `None` if the angle is at most a right angle.
fn in_the_way(mesh: &ScatterMesh, first: u32, vertex: u32, [a, b]: [Site; 2]) -> Option<[f64; 2]> {
    let mut widest = WidestAngleVertex { ends: [a, b], cosine: 0.0, far: None };
    let begin = around(mesh, first, vertex).find_map(|(triangle, k)| {
        let corners = mesh.triangles()[triangle as usize].corners;
        let [p, q] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
        let (at_p, at_q) = (site(mesh, p)?, site(mesh, q)?);
        let is_between = orient(a, at_p, b) >= 0 && orient(a, at_q, b) < 0;
        is_between.then_some((triangle, p, q))
    });
    let (mut triangle, mut right, mut left) = begin?;
    widest.add(site(mesh, right)?);
    widest.add(site(mesh, left)?);
    // No way through a triangulation passes more triangles than there are.
    for _ in 0..mesh.triangles().len() {
        let corners = mesh.triangles()[triangle as usize].corners;
        let apex = (0..3).find(|&k| corners[k] != right && corners[k] != left)?;
        triangle = mesh.triangles()[triangle as usize].twins[apex];
        let corners = mesh.triangles()[triangle as usize].corners;
        let across = corners.into_iter().find(|&v| v != right && v != left)?;
        let Some(at) = site(mesh, across).filter(|&at| at != b) else { break };
        widest.add(at);
        match orient(a, b, at) {
            0 => break,
            side if side > 0 => left = across,
            _ => right = across,
        }
    }
    widest.far
}

/// The vertex with the widest angle to an edge.
struct WidestAngleVertex {
    ends: [Site; 2],
    cosine: f64,
    far: Option<[f64; 2]>,
}

impl WidestAngleVertex {
    fn add(&mut self, at: Site) {
        let [a, b] = self.ends.map(|end| [0, 1].map(|i| f64::from(end[i]) - f64::from(at[i])));
        let far = [a, b].map(|[x, y]| (x * x + y * y).sqrt());
        let cosine = (a[0] * b[0] + a[1] * b[1]) / (far[0] * far[1]);
        if cosine < self.cosine {
            (self.cosine, self.far) = (cosine, Some(far));
        }
    }
}

/// A position on both paths near the intersection of their straight lines.
fn crossing(a: &ClippedSegment, b: &ClippedSegment) -> Option<Site> {
    let ([p, q], [r, s]) = (a.segment_ends(), b.segment_ends());
    let turns = [turn(r, s, p), turn(r, s, q), turn(p, q, r), turn(p, q, s)];
    let sides = turns.map(i128::signum);
    if sides[0] * sides[1] >= 0 || sides[2] * sides[3] >= 0 {
        return None;
    }
    let (from, to) = (turns[0] as f64, turns[1] as f64);
    let share = from / (from - to);
    let at = [0, 1].map(|i| (p[i] as f64 + share * (q[i] - p[i]) as f64).round() as i64);
    let near = (0..25).map(|i| [at[0] + i % 5 - 2, at[1] + i / 5 - 2]);
    let on_both = near.filter_map(|site| {
        let site = [i32::try_from(site[0]).ok()?, i32::try_from(site[1]).ok()?];
        (a.step_of(site).is_some() && b.step_of(site).is_some()).then_some(site)
    });
    on_both.min_by_key(|site| {
        let off = [0, 1].map(|i| i64::from(site[i]) - at[i]);
        (off[0] * off[0] + off[1] * off[1], *site)
    })
}
