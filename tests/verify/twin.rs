//! The verifier against a slow and obvious twin, on random meshes of every kind of badness, and
//! against itself under other threads and budgets.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::{Grid, Mesh, check_with, delaunay, findings, noise, split_cells};
use proptest::prelude::*;
use terrane_base::geom::Affine;
use terrane_verify::{MeshRequirements, VerifyReport};

/// Positions are in quarters of a cell (column, row), heights and tolerances in eighths.
type At = [i64; 2];
const QUARTERS: i64 = 4;

/// What the twin knows of a mesh.
struct Twin<'a> {
    grid: &'a Grid,
    vertices: Vec<(At, i64)>,
    triangles: Vec<[usize; 3]>,
}

fn cross(a: At, b: At, c: At) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Strictly inside the circle through the corners of a triangle of any orientation.
fn in_circle([a, b, c]: [At; 3], d: At) -> bool {
    let lift = |p: At| {
        let (x, y) = (i128::from(p[0] - d[0]), i128::from(p[1] - d[1]));
        (x, y, x * x + y * y)
    };
    let ((ax, ay, aa), (bx, by, bb), (cx, cy, cc)) = (lift(a), lift(b), lift(c));
    let det = aa * (bx * cy - by * cx) - bb * (ax * cy - ay * cx) + cc * (ax * by - ay * bx);
    det * i128::from(cross(a, b, c).signum()) > 0
}

/// The ends of the part of a line on which all weights are 0 or more, as fractions; they are `a` at its
/// beginning and `b` at its end.
fn covered(a: [i64; 3], b: [i64; 3]) -> Option<[(i128, i128); 2]> {
    let less = |p: (i128, i128), q: (i128, i128)| p.0 * q.1 < q.0 * p.1;
    let [mut low, mut high] = [(0, 1), (1, 1)];
    for (a, b) in a.into_iter().zip(b).map(|(a, b)| (i128::from(a), i128::from(b))) {
        match (a < 0, b < 0) {
            (true, true) => return None,
            (true, false) if less(low, (-a, b - a)) => low = (-a, b - a),
            (false, true) if less((a, a - b), high) => high = (a, a - b),
            _ => {}
        }
    }
    (!less(high, low)).then_some([low, high])
}

#[derive(Debug, Default, PartialEq)]
struct Counts {
    surface: u64,
    isolated: u64,
    cells: u64,
    covered: u64,
    over: u64,
    breaks: u64,
    over_between: u64,
    uncovered_cells: u64,
    void_cells: u64,
    outside: u64,
    overlaps: u64,
    inverted: u64,
    empty: u64,
    cracks: u64,
    t_junctions: u64,
    non_manifold: u64,
    split_heights: u64,
    duplicates: u64,
    unused: u64,
    interior: u64,
    open: u64,
    non_delaunay: u64,
    free: u64,
    off_samples: u64,
}

impl Counts {
    fn of(r: &VerifyReport) -> Self {
        assert_eq!(r.of.surface_samples, r.of.covered_samples + r.of.uncovered_samples.count);
        Self {
            surface: r.of.surface_samples,
            isolated: r.of.isolated_samples,
            cells: r.of.surface_cells,
            covered: r.of.covered_samples,
            over: r.over_tolerance.count,
            breaks: r.of.breaks,
            over_between: r.of.over_between_samples.count,
            uncovered_cells: r.of.uncovered_cells.count,
            void_cells: r.of.void_cells.count,
            outside: r.of.outside_triangles.count,
            overlaps: r.overlaps.count,
            inverted: r.inverted_triangles.count,
            empty: r.empty_triangles.count,
            cracks: r.cracks.count,
            t_junctions: r.t_junctions.count,
            non_manifold: r.non_manifold_edges.count,
            split_heights: r.split_heights.count,
            duplicates: r.duplicate_vertices.count,
            unused: r.unused_vertices.count,
            interior: r.interior_edges,
            open: r.open_edges,
            non_delaunay: r.non_delaunay_edges.count,
            free: r.free_vertices,
            off_samples: r.of.off_sample_vertices.count,
        }
    }
}

impl Twin<'_> {
    fn corners(&self, t: usize) -> [At; 3] {
        self.triangles[t].map(|v| self.vertices[v].0)
    }

    fn area(&self, t: usize) -> i64 {
        let [a, b, c] = self.corners(t);
        cross(a, b, c)
    }

    fn size(&self) -> [i64; 2] {
        [i64::from(self.grid.info.width), i64::from(self.grid.info.height)]
    }

    fn solid(&self) -> impl Iterator<Item = usize> {
        (0..self.triangles.len()).filter(|&t| self.area(t) != 0)
    }

    /// Weights of `at` in triangle `t`, positive inside.
    fn weights(&self, t: usize, at: At) -> [i64; 3] {
        let ([a, b, c], sign) = (self.corners(t), self.area(t).signum());
        [cross(at, b, c), cross(a, at, c), cross(a, b, at)].map(|w| w * sign)
    }

    /// Error of the sample over each triangle covering it, as (numerator, denominator) in eighths.
    fn errors(&self, col: i64, row: i64) -> Vec<(i64, i64)> {
        let at = [col * QUARTERS, row * QUARTERS];
        let height = (self.grid.at(col as u32, row as u32) * 8.0) as i64;
        let covering = self.solid().filter(|&t| self.weights(t, at).iter().all(|&w| w >= 0));
        covering
            .map(|t| {
                let weights = self.weights(t, at);
                let plane: i64 =
                    (0..3).map(|k| weights[k] * self.vertices[self.triangles[t][k]].1).sum();
                let area = self.area(t).abs();
                ((area * height - plane).abs(), area)
            })
            .collect()
    }

    /// Lines between neighbouring samples of the surface.
    fn lines(&self) -> Vec<[[i64; 2]; 2]> {
        let [width, height] = self.size();
        let samples = (0..height).flat_map(|r| (0..width).map(move |c| [c, r]));
        let both = samples.flat_map(|[c, r]| [[[c, r], [c + 1, r]], [[c, r], [c, r + 1]]]);
        let borders = |&[[c, r], [_, below]]: &[[i64; 2]; 2]| {
            let other = if below > r { [c - 1, r] } else { [c, r - 1] };
            [[c, r], other].iter().any(|&[c, r]| self.grid.is_surface(c, r))
        };
        both.filter(borders).collect()
    }

    fn height(&self, [col, row]: [i64; 2]) -> i128 {
        (self.grid.at(col as u32, row as u32) * 8.0) as i128
    }

    /// Counts where sides and corners of triangles meet lines strictly between samples, each once for each
    /// height.
    fn count_breaks(&self, tolerance: i64, counts: &mut Counts) {
        let corners = || self.triangles.iter().map(|t| t.map(|v| self.vertices[v]));
        let pairs = |[a, b, c]: [(At, i64); 3]| [(a, b), (b, c), (c, a), (a, a), (b, b), (c, c)];
        let sides = corners().flat_map(pairs).map(|(a, b)| (a.min(b), a.max(b)));
        // A side whose ends are one position is no more than its corners.
        let sides: BTreeSet<_> = sides.filter(|(a, b)| a == b || a.0 != b.0).collect();
        for (line, &(a, b)) in self.lines().iter().flat_map(|l| sides.iter().map(move |s| (l, s))) {
            if let Some((off, whole)) = self.error_between(*line, a, b) {
                counts.breaks += 1;
                counts.over_between += u64::from(off > whole * i128::from(tolerance));
            }
        }
    }

    /// The error where the segment from `p` to `q` (or the point both are) meets a line strictly between its
    /// samples, as (numerator, denominator) in eighths.
    fn error_between(
        &self,
        [from, to]: [[i64; 2]; 2],
        (p, zp): (At, i64),
        (q, zq): (At, i64),
    ) -> Option<(i128, i128)> {
        let (along, across) = if from[1] == to[1] { (0, 1) } else { (1, 0) };
        let line = from[across] * QUARTERS;
        let before = |at: At| i128::from(at[across] - line);
        // How far along the segment they meet: `part` of `length`.
        let (part, length) = match (before(p), before(q)) {
            (0, 0) if p == q => (0, 1),
            (a, b) if a * b < 0 => (a.abs(), (a - b).abs()),
            _ => return None,
        };
        let start = i128::from(p[along] - from[along] * QUARTERS);
        let rest = start * length + i128::from(q[along] - p[along]) * part;
        let whole = length * i128::from(QUARTERS);
        let mesh =
            (i128::from(zp) * (length - part) + i128::from(zq) * part) * i128::from(QUARTERS);
        let inside = 0 < rest && rest < whole;
        let ground = || self.height(from) * (whole - rest) + self.height(to) * rest;
        inside.then(|| ((mesh - ground()).abs(), whole))
    }

    /// The largest error of any triangle with area over any line, from the ends of the part it covers;
    /// and whether it is over the tolerance.
    fn surface_error(&self, tolerance: i64) -> (f64, bool) {
        let (mut worst, mut over) = (0.0f64, false);
        for [from, to] in self.lines() {
            for t in self.solid() {
                let [a, b] = [from, to].map(|at| self.weights(t, at.map(|v| v * QUARTERS)));
                for (n, d) in covered(a, b).into_iter().flatten() {
                    let z = self.triangles[t].map(|v| i128::from(self.vertices[v].1));
                    let weight = |k: usize| i128::from(a[k]) * (d - n) + i128::from(b[k]) * n;
                    let mesh: i128 = (0..3).map(|k| weight(k) * z[k]).sum();
                    let area = i128::from(self.area(t).abs());
                    let ground = self.height(from) * (d - n) + self.height(to) * n;
                    let (off, whole) = ((mesh - area * ground).abs(), area * d);
                    worst = worst.max(off as f64 / whole as f64 / 8.0);
                    over |= off > whole * i128::from(tolerance);
                }
            }
        }
        (worst, over)
    }

    /// True when triangle and cell share more than a border: clipped in `f64`.
    fn overlaps_cell(&self, t: usize, col: i64, row: i64) -> bool {
        let mut polygon: Vec<[f64; 2]> =
            self.corners(t).iter().map(|p| p.map(|v| v as f64 / QUARTERS as f64)).collect();
        for (axis, bound, sign) in
            [(0, col, 1.0), (0, col + 1, -1.0), (1, row, 1.0), (1, row + 1, -1.0)]
        {
            let depth = |p: [f64; 2]| sign * (p[axis] - bound as f64);
            let n = polygon.len();
            polygon = (0..n)
                .flat_map(|i| {
                    let (p, q) = (polygon[i], polygon[(i + 1) % n]);
                    let (a, b) = (depth(p), depth(q));
                    let cut = |k: usize| p[k] + a / (a - b) * (q[k] - p[k]);
                    let kept = (a >= 0.0).then_some(p);
                    let crossing = (a * b < 0.0).then(|| [cut(0), cut(1)]);
                    kept.into_iter().chain(crossing)
                })
                .collect();
        }
        let n = polygon.len();
        let area = |i: usize| {
            let (p, q) = (polygon[i], polygon[(i + 1) % n]);
            p[0] * q[1] - p[1] * q[0]
        };
        (0..n).map(area).sum::<f64>().abs() > 1e-9
    }

    fn on_outline(&self, [p, q]: [At; 2]) -> bool {
        let Some(axis) = (0..2).find(|&k| p[1 - k] == q[1 - k] && p[1 - k] % QUARTERS == 0) else {
            return false;
        };
        let line = p[1 - axis] / QUARTERS;
        let (from, to) = (p[axis].min(q[axis]), p[axis].max(q[axis]));
        (from.div_euclid(QUARTERS)..-(-to).div_euclid(QUARTERS)).all(|unit| {
            let sides = [line - 1, line].map(|side| {
                if axis == 0 {
                    self.grid.is_surface(unit, side)
                } else {
                    self.grid.is_surface(side, unit)
                }
            });
            sides[0] != sides[1]
        })
    }

    fn count_samples(&self, tolerance: i64, counts: &mut Counts) {
        let [width, height] = self.size();
        for (row, col) in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
            let around = [(0, 0), (1, 0), (0, 1), (1, 1)];
            let on_surface = around.iter().any(|(c, r)| self.grid.is_surface(col - c, row - r));
            let at = [col * QUARTERS, row * QUARTERS];
            let strictly = |&t: &usize| self.weights(t, at).iter().all(|&w| w > 0);
            counts.overlaps += u64::from(self.solid().filter(strictly).count() > 1);
            let cell = self.solid().any(|t| self.overlaps_cell(t, col, row));
            let inside = col < width - 1 && row < height - 1;
            counts.cells += u64::from(self.grid.is_surface(col, row));
            counts.uncovered_cells += u64::from(self.grid.is_surface(col, row) && !cell);
            counts.void_cells += u64::from(inside && !self.grid.is_surface(col, row) && cell);
            if !on_surface {
                counts.isolated += u64::from(!self.grid.at(col as u32, row as u32).is_nan());
                continue;
            }
            counts.surface += 1;
            let errors = self.errors(col, row);
            counts.covered += u64::from(!errors.is_empty());
            counts.over += u64::from(errors.iter().any(|(n, d)| *n > d * tolerance));
        }
    }

    fn count_triangles(&self, orientation: i64, counts: &mut Counts) {
        let last = self.size().map(|side| (side - 1) * QUARTERS);
        for t in 0..self.triangles.len() {
            let area = self.area(t) * orientation;
            counts.empty += u64::from(area == 0);
            counts.inverted += u64::from(area < 0);
            let beyond = |p: &At| (0..2).any(|k| p[k] < 0 || p[k] > last[k]);
            counts.outside += u64::from(area != 0 && self.corners(t).iter().any(beyond));
        }
    }

    fn count_edges(&self, counts: &mut Counts) {
        // Ends in row order, with direction and opposite corner of each use.
        let mut edges: BTreeMap<[At; 2], Vec<(bool, At)>> = BTreeMap::new();
        let flip = |p: At| [p[1], p[0]];
        for t in 0..self.triangles.len() {
            let corners = self.corners(t);
            for k in 0..3 {
                let (p, q, apex) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                if p != q {
                    let key = [flip(p).min(flip(q)), flip(p).max(flip(q))].map(flip);
                    edges.entry(key).or_default().push((key[0] == p, apex));
                }
            }
        }
        let used: BTreeSet<At> = (0..self.triangles.len()).flat_map(|t| self.corners(t)).collect();
        let mut junctions = BTreeSet::new();
        for (&[p, q], uses) in &edges {
            match uses[..] {
                [_] => {
                    counts.open += 1;
                    counts.cracks += u64::from(!self.on_outline([p, q]));
                    let within = |v: &At| {
                        let dot = (v[0] - p[0]) * (q[0] - v[0]) + (v[1] - p[1]) * (q[1] - v[1]);
                        cross(p, q, *v) == 0 && dot > 0
                    };
                    junctions.extend(used.iter().copied().filter(within));
                }
                [(a, left), (b, right)] if a != b => {
                    counts.interior += 1;
                    let proper = cross(p, q, left).signum() * cross(p, q, right).signum() < 0;
                    counts.non_delaunay += u64::from(proper && in_circle([p, q, left], right));
                }
                _ => counts.non_manifold += 1,
            }
        }
        counts.t_junctions = junctions.len() as u64;
    }

    fn count_vertices(&self, counts: &mut Counts) {
        let mut at: BTreeMap<At, Vec<usize>> = BTreeMap::new();
        self.vertices.iter().enumerate().for_each(|(v, (p, _))| at.entry(*p).or_default().push(v));
        for ids in at.values() {
            counts.duplicates += ids.len() as u64 - 1;
            let used: Vec<usize> = ids
                .iter()
                .copied()
                .filter(|v| self.triangles.iter().any(|t| t.contains(v)))
                .collect();
            let heights: BTreeSet<i64> = used.iter().map(|&v| self.vertices[v].1).collect();
            counts.split_heights += u64::from(heights.len() > 1);
            counts.unused += if used.is_empty() { ids.len() as u64 } else { 0 };
        }
        let is_free = |p: &At| p.iter().any(|v| v % QUARTERS != 0);
        counts.free = self.vertices.iter().filter(|(p, _)| is_free(p)).count() as u64;
    }

    fn is_sample(&self, &([c, r], z): &(At, i64)) -> bool {
        let [width, height] = self.size().map(|side| side * QUARTERS);
        let inside = (0..width).contains(&c) && (0..height).contains(&r);
        inside
            && c % QUARTERS == 0
            && r % QUARTERS == 0
            && self.grid.at((c / QUARTERS) as u32, (r / QUARTERS) as u32) * 8.0 == z as f64
    }

    /// Positions of corners at which any corner is off its sample.
    fn count_off_samples(&self, counts: &mut Counts) {
        let corners = self.triangles.iter().flatten().map(|&v| &self.vertices[v]);
        let off = corners.filter(|vertex| !self.is_sample(vertex)).map(|vertex| vertex.0);
        counts.off_samples = off.collect::<std::collections::HashSet<At>>().len() as u64;
    }

    fn counts(&self, tolerance: i64, orientation: i64) -> Counts {
        let mut counts = Counts::default();
        self.count_samples(tolerance, &mut counts);
        self.count_triangles(orientation, &mut counts);
        self.count_edges(&mut counts);
        self.count_vertices(&mut counts);
        self.count_off_samples(&mut counts);
        self.count_breaks(tolerance, &mut counts);
        counts
    }

    /// Largest error and sums of errors and squares over the surface.
    fn errors_of_all(&self) -> (f64, f64, f64) {
        let [width, height] = self.size();
        let mut all = (0.0f64, 0.0, 0.0);
        for (row, col) in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
            let around = [(0, 0), (1, 0), (0, 1), (1, 1)];
            if around.iter().any(|(c, r)| self.grid.is_surface(col - c, row - r)) {
                let errors = self.errors(col, row).into_iter();
                let worst = errors.map(|(n, d)| n as f64 / d as f64 / 8.0).fold(0.0, f64::max);
                all = (all.0.max(worst), all.1 + worst, all.2 + worst * worst);
            }
        }
        all
    }

    fn mesh(&self) -> Mesh {
        let cells = |v: i64| v as f64 / QUARTERS as f64;
        let vertex = |&([c, r], z): &(At, i64)| {
            let [x, y] = self.grid.info.transform.apply(cells(c), cells(r));
            [x, y, z as f64 / 8.0]
        };
        let triangles = self.triangles.iter().map(|t| t.map(|v| v as u64)).collect();
        Mesh::new(self.vertices.iter().map(vertex).collect(), triangles)
    }
}

/// Unit, rotated and mirrored maps, exact on quarters of cells.
fn maps() -> impl Strategy<Value = Affine> {
    let rotated = Affine { x0: 100.0, a: 2.0, b: -1.0, y0: -50.5, d: 1.0, e: 2.0 };
    let south_up = Affine { e: 1.0, ..Affine::LATTICE };
    prop::sample::select(vec![Affine::LATTICE, rotated, south_up])
}

fn agree(twin: &Twin<'_>, tolerance: i64) -> std::result::Result<(), TestCaseError> {
    let mesh = twin.mesh();
    let orientation = if twin.grid.info.transform.determinant() < 0.0 { -1 } else { 1 };
    let report = check_with(&mesh, twin.grid, Some(tolerance as f64 / 8.0), 2, 1 << 20);
    prop_assert_eq!(Counts::of(&report), twin.counts(tolerance, orientation));
    let (worst, sum, squares) = twin.errors_of_all();
    let covered = report.of.covered_samples as f64;
    prop_assert!((report.max_error.unwrap_or(0.0) - worst).abs() <= 1e-9 * (1.0 + worst));
    prop_assert!((report.mean_error.unwrap_or(0.0) * covered - sum).abs() <= 1e-9 * (1.0 + sum));
    let got = report.rmse.unwrap_or(0.0).powi(2) * covered;
    prop_assert!((got - squares).abs() <= 1e-9 * (1.0 + squares));
    let (surface, over) = twin.surface_error(tolerance);
    let found = report.of.surface_error.unwrap_or(0.0);
    let is_over = report.over_tolerance.count + report.of.over_between_samples.count > 0;
    // Triangles without area cover no line; that they are a fault is counted above.
    if report.empty_triangles.count == 0 {
        prop_assert!((found - surface).abs() <= 1e-9 * (1.0 + surface));
        prop_assert_eq!(is_over, over);
    }
    prop_assert_eq!(report.error_histogram.iter().sum::<u64>(), report.of.covered_samples);
    Ok(())
}

fn random_grid(width: u32, height: u32, seed: u32, voids: f64, transform: Affine) -> Grid {
    let mut grid = Grid::new(width, height, |c, r| {
        if noise(c, r, seed ^ 1) < voids {
            f64::NAN
        } else {
            (noise(c, r, seed) * 32.0).round() / 8.0
        }
    });
    grid.info.transform = transform;
    grid
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_triangles_on_small_grids(
        size in [1u32..8, 1u32..8], seed in any::<u32>(), voids in prop::sample::select(vec![0.0, 0.1, 0.4]),
        vertices in prop::collection::vec(([-6i64..36, -6i64..36], 0i64..40, any::<bool>()), 3..14),
        triangles in prop::collection::vec([0usize..14, 0usize..14, 0usize..14], 0..16),
        tolerance in 0i64..12, map in maps(),
    ) {
        let grid = random_grid(size[0], size[1], seed, voids, map);
        // Most vertices on the lattice, some off it.
        let place = |(at, z, lattice): ([i64; 2], i64, bool)| {
            (if lattice { at.map(|v| v / 4 * 4) } else { at }, z)
        };
        let vertices: Vec<_> = vertices.into_iter().map(place).collect();
        let count = vertices.len();
        let triangles = triangles.into_iter().map(|t| t.map(|v| v % count)).collect();
        agree(&Twin { grid: &grid, vertices, triangles }, tolerance)?;
    }

    #[test]
    fn spoiled_meshes_across_domains(
        size in [2u32..80, 2u32..80], seed in any::<u32>(), keep in 0.0..0.02f64, tolerance in 0i64..40,
        moves in prop::collection::vec((any::<prop::sample::Index>(), [-9i64..9, -9i64..9], any::<bool>()), 0..3),
        drops in prop::collection::vec(any::<prop::sample::Index>(), 0..3), map in maps(),
    ) {
        let grid = random_grid(size[0], size[1], seed, 0.0, map);
        let mesh = delaunay(&grid, |c, r| noise(c, r, seed ^ 2) < keep);
        let mut twin = Twin { grid: &grid, vertices: Vec::new(), triangles: Vec::new() };
        twin.vertices.extend(mesh.vertices.iter().map(|&[x, y, z]| {
            let [c, r] = map.invert(x, y);
            ([c.round() as i64 * QUARTERS, r.round() as i64 * QUARTERS], (z * 8.0) as i64)
        }));
        twin.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v as usize)));
        for (index, [dx, dy], free) in moves {
            let vertex = index.get(&twin.vertices).0;
            let scale = if free { 1 } else { QUARTERS };
            let index = index.index(twin.vertices.len());
            twin.vertices[index].0 = [vertex[0] + dx * scale, vertex[1] + dy * scale];
        }
        for index in drops {
            twin.triangles.remove(index.index(twin.triangles.len()));
            if twin.triangles.is_empty() { break; }
        }
        agree(&twin, tolerance)?;
    }
}

#[test]
fn threads_and_memory_change_nothing() {
    let mut grid =
        Grid::new(700, 500, |c, r| (f64::from(c) / 40.0).sin() * 50.0 + noise(c, r, 3) * 4.0);
    let mut meshes = vec![delaunay(&grid, |c, r| noise(c, r, 5) < 0.02)];
    for (col, row) in (0..300).map(|i| (i * 37 % 700, i * 91 % 500)) {
        grid.set(col, row, f64::NAN);
    }
    meshes.push(split_cells(&grid));
    for mut mesh in meshes {
        // A few faults of many kinds.
        mesh.triangles.swap_remove(1234);
        mesh.triangles[99].swap(0, 1);
        mesh.vertices[777][2] += 100.0;
        mesh.vertices[888][0] += 0.4;
        mesh.add([44.0, -55.0, 1.0]);
        mesh.recount();
        let expected = findings(check_with(&mesh, &grid, Some(3.0), 1, 1 << 30));
        assert!(!expected.verdict.passed && expected.max_error.is_some());
        assert!(expected.of.breaks > 0 && expected.of.surface_error.is_some());
        for (threads, memory) in [(1, 1), (1, 4), (2, 4), (4, 4), (3, 100)] {
            let got = findings(check_with(&mesh, &grid, Some(3.0), threads, memory << 20));
            assert_eq!(got, expected, "{threads} threads, {memory} MiB");
        }
        let mut tiled = grid.clone();
        tiled.info.block = (64, 64);
        assert_eq!(findings(check_with(&mesh, &tiled, Some(3.0), 2, 8 << 20)), expected);
        mesh.triangles.reverse();
        assert_eq!(findings(check_with(&mesh, &grid, Some(3.0), 1, 16 << 20)), expected);
    }
}

#[test]
fn a_crowd_of_triangles_in_one_place_is_refused_by_name() {
    let grid = Grid::new(40, 40, |_, _| 0.0);
    let mut mesh = split_cells(&grid);
    let one = mesh.triangles[0];
    mesh.triangles.extend(std::iter::repeat_n(one, 20_000));
    mesh.recount();
    let (progress, cancel) = (terrane_engine::Silent, terrane_engine::Cancel::default());
    let verify = |memory| {
        let resources = terrane_engine::Resources { threads: 1, memory, temp_dir: None };
        let asked = MeshRequirements {
            bound: terrane::ErrorBound::Surface,
            ..MeshRequirements::of_samples(None)
        };
        terrane_verify::verify(&mesh, &grid, asked, &resources, &progress, &cancel)
    };
    let error = verify(1 << 20).unwrap_err();
    assert_eq!(error.kind(), terrane::ErrorKind::Resource);
    // What is advised is enough, and not much less is.
    let remedy = error.remedy_text().unwrap();
    let advised =
        terrane_engine::operation::Memory::from(remedy.split_whitespace().nth(2).unwrap());
    let advised = advised.bytes().unwrap();
    assert_eq!(verify(advised).unwrap().non_manifold_edges.count, 3, "{remedy}");
    assert!(verify(advised / 2).is_err(), "{remedy}");
}
