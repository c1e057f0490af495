//! Progressive densification of a triangulation: from the lowest points of large squares on, points
//! are taken in that lie near the triangle they are in.
//!
//! After Axelsson, "DEM generation from laser scanner data using adaptive TIN models" (2000).

use crate::lows::Lows;
use crate::method::{Asked, Lattice, Method, Parameter};
use crate::surface::Ground;
use crate::tin::{Tin, gradient, height_of};
use terrane_base::geom::Point;

pub(crate) const METHOD: Method = Method {
    name: "ptd",
    source: "Axelsson 2000",
    about: "a triangulation of the lowest points of large squares, made denser by points near it",
    parameters: &[
        Parameter::new(
            "seed",
            50.0,
            [2.0, 100.0],
            "side of the squares, larger than any building, metres",
        ),
        Parameter::new(
            "angle",
            15.0,
            [0.1, 89.0],
            "at which a corner may see a point above its triangle, degrees",
        ),
        Parameter::new(
            "distance",
            1.4,
            [0.01, 100.0],
            "furthest from its triangle that a point is taken in, metres",
        ),
        Parameter::new(
            "spacing",
            0.25,
            [0.0, 100.0],
            "triangles with no longer side are left as they are, metres",
        ),
        Parameter::new(
            "tolerance",
            0.3,
            [0.0, 100.0],
            "how far from the last triangles ground may lie, metres",
        ),
    ],
    lattice: |_, spacing| Lattice::fixed(spacing.max(1.0)),
    find,
};

fn find(asked: &Asked, lows: &Lows<'_>) -> Ground {
    let (width, cell, step) = (lows.width, lows.cell, lows.step[2]);
    let points = in_millimetres(lows);
    let [distance, spacing] = ["distance", "spacing"].map(|key| asked.value(key));
    let limits = Limits { sine: asked.value("angle").to_radians().sin(), distance, spacing };
    let seeds = seeds(&points, width, (asked.value("seed") / cell).ceil() as usize);
    let ground = densified(&points, seeds, width, cell, &limits);
    let heights =
        surface(&vertices(&points, &ground, width, cell), width, points.len() / width, cell);
    let heights = heights.into_iter().map(|z| z / step).collect();
    Ground::new(width, heights, |_| asked.value("tolerance") / step)
}

/// When a point is taken in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Most sine of the angle at which a corner of the triangle sees the point above its plane.
    pub(crate) sine: f64,
    /// Furthest that it may lie from the plane, in metres.
    pub(crate) distance: f64,
    /// Triangles with no longer side in plan are left as they are, in metres.
    pub(crate) spacing: f64,
}

/// Millimetres to a metre.
pub(crate) const MILLI: f64 = 1000.0;
/// Most times that the triangulation is made again.
const ROUNDS: usize = 64;

/// Each cell's lowest point in millimetres from the corner.
pub(crate) fn in_millimetres(lows: &Lows<'_>) -> Vec<Option<Point>> {
    let whole = |metres: f64| (metres * MILLI).round() as i32;
    let point =
        |at: usize| lows.metres(at).map(|[x, y, z]| Point::new(whole(x), whole(y), whole(z)));
    (0..lows.points.len()).map(point).collect()
}

/// The cells whose points are the lowest of squares of `side` cells.
pub(crate) fn seeds(points: &[Option<Point>], width: usize, side: usize) -> Vec<usize> {
    let across = width.div_ceil(side);
    let squares = across * (points.len() / width).div_ceil(side);
    let mut lowest: Vec<Option<(Point, usize)>> = vec![None; squares];
    for (at, point) in points.iter().enumerate() {
        let Some(point) = point else { continue };
        let square = at / width / side * across + at % width / side;
        let key = |p: &Point| (p.z, p.x, p.y);
        if lowest[square].is_none_or(|(low, _)| key(point) < key(&low)) {
            lowest[square] = Some((*point, at));
        }
    }
    let mut seeds: Vec<usize> = lowest.into_iter().flatten().map(|(_, at)| at).collect();
    seeds.sort_unstable();
    seeds
}

/// The cells whose points are ground, sorted: the seeds, and all that can be reached from them.
pub(crate) fn densified(
    points: &[Option<Point>],
    seeds: Vec<usize>,
    width: usize,
    cell: f64,
    limits: &Limits,
) -> Vec<usize> {
    let mut taken = vec![false; points.len()];
    seeds.iter().for_each(|&at| taken[at] = true);
    let mut ground = seeds;
    for _ in 0..ROUNDS {
        let vertices = vertices(points, &ground, width, cell);
        let Some(mut tin) = Tin::new(&vertices) else { break };
        let mut found: Vec<(u32, f64, usize)> = Vec::new();
        for (at, point) in points.iter().enumerate() {
            let Some(point) = point.filter(|_| !taken[at]) else { continue };
            let Some((triangle, corners)) = tin.around([point.x, point.y]) else { continue };
            if let Some(distance) = near(&point, &corners, limits) {
                found.push((triangle, distance, at));
            }
        }
        found.sort_unstable_by(|a, b| {
            (a.0, a.1, a.2).partial_cmp(&(b.0, b.1, b.2)).unwrap_or(std::cmp::Ordering::Equal)
        });
        found.dedup_by_key(|(triangle, ..)| *triangle);
        let few = found.len() * 500 < ground.len();
        for (_, _, at) in found {
            taken[at] = true;
            ground.push(at);
        }
        if few {
            break;
        }
    }
    ground.sort_unstable();
    ground
}

/// How far a point is from its triangle, if it is near enough to be taken in.
fn near(point: &Point, corners: &[Point; 3], limits: &Limits) -> Option<f64> {
    let [p, a, b, c] =
        [point, &corners[0], &corners[1], &corners[2]].map(|p| [p.x, p.y, p.z].map(f64::from));
    let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let arms = [a, b, c].map(|corner| minus(p, corner));
    let plan = |u: [f64; 3]| u[0] * u[0] + u[1] * u[1];
    let longest = [minus(b, a), minus(c, b), minus(a, c)].map(plan).into_iter().fold(0.0, f64::max);
    if longest < (limits.spacing * MILLI) * (limits.spacing * MILLI) {
        return None;
    }
    let [gx, gy] = gradient(minus(b, a), minus(c, a));
    let above = height_of(corners, [p[0], p[1]]);
    let distance = (p[2] - above).abs() / (1.0 + gx * gx + gy * gy).sqrt();
    let length = |u: [f64; 3]| (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]).sqrt();
    let nearest = arms.map(length).into_iter().fold(f64::INFINITY, f64::min);
    (distance <= limits.distance * MILLI && distance <= limits.sine * nearest).then_some(distance)
}

/// Ground points, and four around the window that are as high as the ground nearest to them.
pub(crate) fn vertices(
    points: &[Option<Point>],
    ground: &[usize],
    width: usize,
    cell: f64,
) -> Vec<Point> {
    let mut vertices: Vec<Point> = ground.iter().filter_map(|&at| points[at]).collect();
    let span = |cells: usize| (cells as f64 * cell * MILLI).ceil() as i32;
    let (east, north, out) = (span(width), span(points.len() / width), span(10));
    let inner = vertices.len();
    for (x, y) in [(-out, -out), (east + out, -out), (-out, north + out), (east + out, north + out)]
    {
        let away = |p: &&Point| (i64::from(p.x - x).pow(2) + i64::from(p.y - y).pow(2), p.z);
        if let Some(p) = vertices[..inner].iter().min_by_key(away) {
            vertices.push(Point::new(x, y, p.z));
        }
    }
    vertices
}

/// Heights in metres of the triangulation of ground points at the centres of cells, and of those beside
/// the window.
pub(crate) fn surface(vertices: &[Point], width: usize, rows: usize, cell: f64) -> Vec<f64> {
    let wide = width + 2;
    let centre = |k: usize| ((k as f64 - 0.5) * cell * MILLI).round() as i32;
    let Some(mut tin) = Tin::new(vertices) else { return vec![f64::NAN; wide * (rows + 2)] };
    let mut height = |at: usize| {
        let [x, y] = [centre(at % wide), centre(at / wide)];
        let corners = tin.around([x, y]).map(|(_, corners)| corners);
        corners.map_or(f64::NAN, |corners| height_of(&corners, [x, y].map(f64::from)) / MILLI)
    };
    (0..wide * (rows + 2)).map(&mut height).collect()
}
