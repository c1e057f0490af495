//! Progressive densification of a triangulation of ground points, in rounds.

use std::cmp::Ordering;

use crate::ghost_vertices::GroundExtrapolation;
use crate::lowest_in_cells::{LowestCells, MILLI};
use crate::tin::{GroundTin, gradient, height_of};
use terrane_base::geom::Point;

/// Largest number of rounds.
const ROUNDS: usize = 64;

/// Limits for accepting a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DensifyLimits {
    /// Largest sine of the angle from a corner of the triangle to the point above its plane.
    pub(crate) sine: f64,
    /// Largest distance from the plane, in metres.
    pub(crate) distance: f64,
    /// Triangles without a longer side in plan are not densified, in metres.
    pub(crate) spacing: f64,
}

/// A pending point, with its last known triangle.
struct PendingPoint {
    at: u32,
    triangle: u32,
}

/// A point that is near enough to its triangle.
struct AcceptedPoint {
    triangle: u32,
    distance: f64,
    at: u32,
}

/// Heights in metres of the densified triangulation at the centres of cells and of those beside the window; NaN
/// if there are no seeds.
pub(crate) fn densified(cells: &LowestCells, seeds: &[usize], limits: &DensifyLimits) -> Vec<f64> {
    let Some(mut densifier) = GroundDensifier::new(cells, seeds, limits) else {
        return vec![f64::NAN; (cells.width + 2) * (cells.rows() + 2)];
    };
    densifier.run();
    densifier.surface()
}

struct GroundDensifier<'a> {
    cells: &'a LowestCells,
    limits: &'a DensifyLimits,
    frame: GroundExtrapolation,
    tin: GroundTin,
    ground: usize,
    waiting: Vec<PendingPoint>,
    /// Whether the points of each triangle have to be checked again.
    stale: Vec<bool>,
    /// Whether each triangle reaches the frame.
    outer: Vec<bool>,
}

impl<'a> GroundDensifier<'a> {
    fn new(cells: &'a LowestCells, seeds: &[usize], limits: &'a DensifyLimits) -> Option<Self> {
        let mut frame = GroundExtrapolation::new(cells);
        let known: Vec<Point> = seeds.iter().filter_map(|&at| cells.points[at]).collect();
        known.iter().for_each(|point| frame.add(point));
        let ground = known.len();
        let vertices = frame.vertices().into_iter().chain(known).collect();
        let all = cells.points.iter().flatten().count();
        let tin = GroundTin::new(vertices, all - ground).filter(|_| ground > 0)?;
        let waiting = waiting(cells, seeds, &tin);
        let stale = vec![true; tin.numbers()];
        let mut densifier =
            Self { cells, limits, frame, tin, ground, waiting, stale, outer: Vec::new() };
        densifier.outer =
            (0..densifier.tin.numbers() as u32).map(|t| densifier.is_outer(t)).collect();
        Some(densifier)
    }

    fn run(&mut self) {
        for _ in 0..ROUNDS {
            let accepted = self.accepted();
            let is_last = accepted.len() * 500 < self.ground;
            self.insert(&accepted);
            if is_last {
                break;
            }
        }
        self.settle();
    }

    /// Moves the frame to the height of the ground; returns whether that changed anything.
    fn settle(&mut self) -> bool {
        let vertices = self.frame.vertices();
        let before = &mut self.tin.points()[..vertices.len()];
        let is_new = *before != vertices;
        before.copy_from_slice(&vertices);
        is_new
    }

    /// The nearest acceptable point of each triangle.
    fn accepted(&mut self) -> Vec<AcceptedPoint> {
        let moved = self.settle();
        let mut accepted = Vec::new();
        for PendingPoint { at, triangle } in &mut self.waiting {
            let number = *triangle as usize;
            if !(self.stale[number] || moved && self.outer[number]) {
                continue;
            }
            let Some(point) = self.cells.points[*at as usize] else { continue };
            let Some(now) = self.tin.find([point.x, point.y], *triangle) else { continue };
            *triangle = now;
            let Some(corners) = self.tin.corners(now) else { continue };
            if let Some(distance) = near(&point, &corners, self.limits) {
                accepted.push(AcceptedPoint { triangle: now, distance, at: *at });
            }
        }
        // The cell breaks ties of distance, so the point taken in does not depend on the order of waiting.
        accepted.sort_unstable_by(|a, b| {
            let by_distance = a.distance.partial_cmp(&b.distance).unwrap_or(Ordering::Equal);
            a.triangle.cmp(&b.triangle).then(by_distance).then(a.at.cmp(&b.at))
        });
        accepted.dedup_by_key(|point| point.triangle);
        accepted
    }

    /// Inserts points into the triangulation.
    fn insert(&mut self, accepted: &[AcceptedPoint]) {
        self.stale.fill(false);
        let mut changed = Vec::new();
        for AcceptedPoint { triangle, at, .. } in accepted {
            let Some(point) = self.cells.points[*at as usize] else { continue };
            self.frame.add(&point);
            self.tin.add(point, *triangle, &mut |t| changed.push(t));
        }
        self.ground += accepted.len();
        self.stale.resize(self.tin.numbers(), false);
        self.outer.resize(self.tin.numbers(), false);
        for triangle in changed {
            self.stale[triangle as usize] = true;
            self.outer[triangle as usize] = self.is_outer(triangle);
        }
        let mut taken: Vec<u32> = accepted.iter().map(|point| point.at).collect();
        taken.sort_unstable();
        // Points wait in the order of their cells, so one pass beside the sorted list removes those taken.
        let mut taken = taken.into_iter().peekable();
        self.waiting.retain(|w| taken.next_if_eq(&w.at).is_none());
    }

    /// Whether a triangle reaches the frame.
    fn is_outer(&self, triangle: u32) -> bool {
        let ids = self.tin.ids(triangle);
        ids.is_some_and(|ids| ids.iter().any(|id| (*id as usize) < self.frame.len()))
    }

    fn surface(&self) -> Vec<f64> {
        let (wide, rows) = (self.cells.width + 2, self.cells.rows() + 2);
        let (mut heights, mut last) = (Vec::with_capacity(wide * rows), 0);
        for at in 0..wide * rows {
            let centre = [at % wide, at / wide]
                .map(|k| ((k as f64 - 0.5) * self.cells.cell * MILLI).round() as i32);
            let triangle = self.tin.find(centre, last);
            last = triangle.unwrap_or(last);
            let corners = triangle.and_then(|triangle| self.tin.corners(triangle));
            let height = corners.map(|corners| height_of(&corners, centre.map(f64::from)) / MILLI);
            heights.push(height.unwrap_or(f64::NAN));
        }
        heights
    }
}

/// The points that are not seeds.
fn waiting(cells: &LowestCells, seeds: &[usize], tin: &GroundTin) -> Vec<PendingPoint> {
    let mut is_seed = vec![false; cells.points.len()];
    seeds.iter().for_each(|&at| is_seed[at] = true);
    let (mut waiting, mut last) = (Vec::new(), 0);
    for (at, point) in cells.points.iter().enumerate() {
        let Some(point) = point.filter(|_| !is_seed[at]) else { continue };
        if let Some(triangle) = tin.find([point.x, point.y], last) {
            waiting.push(PendingPoint { at: at as u32, triangle });
            last = triangle;
        }
    }
    waiting
}

/// Distance of a point from its triangle, if it is accepted.
fn near(point: &Point, corners: &[Point; 3], limits: &DensifyLimits) -> Option<f64> {
    let [p, a, b, c] =
        [point, &corners[0], &corners[1], &corners[2]].map(|p| [p.x, p.y, p.z].map(f64::from));
    let arms = [a, b, c].map(|corner| minus(p, corner));
    let sides = [minus(b, a), minus(c, b), minus(a, c)].map(|u| u[0] * u[0] + u[1] * u[1]);
    let longest = sides.into_iter().fold(0.0, f64::max);
    if longest < (limits.spacing * MILLI) * (limits.spacing * MILLI) {
        return None;
    }
    let [gx, gy] = gradient(minus(b, a), minus(c, a));
    let above = height_of(corners, [p[0], p[1]]);
    let distance = (p[2] - above).abs() / (1.0 + gx * gx + gy * gy).sqrt();
    let lengths = arms.map(|u| (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt());
    let nearest = lengths.into_iter().fold(f64::INFINITY, f64::min);
    (distance <= limits.distance * MILLI && distance <= limits.sine * nearest).then_some(distance)
}

#[inline]
fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_delaunay::{Triangulation, orient};

    /// Whether a triangle holds a position that is moved by an infinitesimal.
    fn holds(corners: &[Point; 3], at: [i32; 2]) -> bool {
        let sites = corners.map(|p| [p.x, p.y]);
        (0..3).all(|i| match (sites[i], sites[(i + 1) % 3]) {
            (a, b) if orient(a, b, at) == 0 => a < b,
            (a, b) => orient(a, b, at) > 0,
        })
    }

    /// All triangles of the frame and the ground.
    fn triangles(cells: &LowestCells, ground: &[usize]) -> Vec<[Point; 3]> {
        let known: Vec<Point> = ground.iter().filter_map(|&at| cells.points[at]).collect();
        let mut frame = GroundExtrapolation::new(cells);
        known.iter().for_each(|point| frame.add(point));
        let vertices = [frame.vertices(), known].concat();
        let triangulation = Triangulation::new(&vertices).unwrap();
        let corners = |t: [u32; 3]| t.map(|id| vertices[id as usize]);
        let from_lowest = |[a, b, c]: [Point; 3]| {
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min_by_key(|[first, ..]| *first).unwrap()
        };
        triangulation.triangles().map(corners).map(from_lowest).collect()
    }

    /// Everything anew in each round, and looked for everywhere.
    fn slow(cells: &LowestCells, seeds: &[usize], limits: &DensifyLimits) -> Vec<f64> {
        let mut ground = seeds.to_vec();
        for _ in 0..ROUNDS {
            let triangles = triangles(cells, &ground);
            let mut nearest: Vec<Option<(f64, usize)>> = vec![None; triangles.len()];
            for (at, point) in cells.points.iter().enumerate() {
                let Some(point) = point.filter(|_| !ground.contains(&at)) else { continue };
                let t = triangles.iter().position(|t| holds(t, [point.x, point.y])).unwrap();
                let distance = near(&point, &triangles[t], limits);
                let is_nearer = |d: &f64| nearest[t].is_none_or(|best| (*d, at) < best);
                if let Some(distance) = distance.filter(is_nearer) {
                    nearest[t] = Some((distance, at));
                }
            }
            let before = ground.len();
            ground.extend(nearest.into_iter().flatten().map(|(_, at)| at));
            if (ground.len() - before) * 500 < before {
                break;
            }
        }
        let triangles = triangles(cells, &ground);
        let centre = |k: usize| ((k as f64 - 0.5) * cells.cell * MILLI).round() as i32;
        let heights = (0..cells.rows() + 2)
            .flat_map(|row| (0..cells.width + 2).map(move |col| [centre(col), centre(row)]));
        let height = |at: [i32; 2]| {
            let triangle = triangles.iter().find(|t| holds(t, at)).unwrap();
            height_of(triangle, at.map(f64::from)) / MILLI
        };
        heights.map(height).collect()
    }

    /// Rough slopes with voids; positions anywhere in their cells, or where there are many ties: on a lattice.
    fn rough() -> impl Strategy<Value = LowestCells> {
        let point = (any::<bool>(), 0..1000, 0..1000, 0..600);
        let points = prop::collection::vec(prop::option::weighted(0.8, point), 26 * 19);
        (points, -600..600, -600..600, any::<bool>()).prop_map(|(points, by_x, by_y, lattice)| {
            let points = points.into_iter().enumerate().map(|(at, point)| {
                let [col, row] = [(at % 26) as i32, (at / 26) as i32];
                point.map(|(is_plant, x, y, z)| {
                    let [x, y] = if lattice { [500, 500] } else { [x, y] };
                    let plant = if is_plant { z * 3 } else { z / 5 };
                    Point::new(col * 1000 + x, row * 1000 + y, col * by_x + row * by_y + plant)
                })
            });
            LowestCells { points: points.collect(), width: 26, cell: 1.0 }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn what_grows_is_what_would_be_made_anew(cells in rough(), sine in 0.1..0.6f64) {
            let limits = DensifyLimits { sine, distance: 1.0, spacing: 1.2 };
            let seeds = cells.lowest(7);
            prop_assert_eq!(densified(&cells, &seeds, &limits), slow(&cells, &seeds, &limits));
        }
    }
}
