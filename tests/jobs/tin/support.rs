//! Grids in memory, a sink that keeps what it is given, and a slow check of whole meshes.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use terrane_base::geom::predicates::in_circle;
use terrane_base::geom::{Affine, Point3, Rect, SampleSegment};
use terrane_base::{Error, Result};
use terrane_engine::constraints::GridConstraints;
use terrane_mesh::{MeshBatch, MeshSink};
use terrane_raster::{GridInfo, GridSource, SampleType};

/// A grid whose heights are a function of the position; NaN is void.
pub(crate) struct FunctionGrid {
    pub info: GridInfo,
    pub height_at: Box<dyn Fn(u32, u32) -> f64 + Send + Sync>,
}

impl FunctionGrid {
    pub(crate) fn new(
        width: u32,
        height: u32,
        height_at: impl Fn(u32, u32) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let info = GridInfo {
            transform: Affine { x0: 1000.0, a: 2.0, b: 0.0, y0: 5000.0, d: 0.0, e: -2.0 },
            georeferenced: true,
            block: (256, 256),
            ..GridInfo::plain("test", width, height, SampleType::F32)
        };
        Self { info, height_at: Box::new(height_at) }
    }

    fn each(rect: Rect) -> impl Iterator<Item = (u32, u32)> {
        (rect.row..rect.end_row())
            .flat_map(move |r| (rect.col..rect.end_col()).map(move |c| (c, r)))
    }
}

impl GridSource for FunctionGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        assert!(rect.end_col() <= self.info.width && rect.end_row() <= self.info.height);
        assert_eq!(out.len(), rect.len());
        let all = Self::each(rect).zip(out);
        all.for_each(|((col, row), out)| *out = (self.height_at)(col, row) as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        let all = Self::each(rect).zip(out);
        all.for_each(|((col, row), out)| *out = (self.height_at)(col, row));
        Ok(())
    }
}

/// A fixed pseudo-random number in 0..1 for a position.
pub(crate) fn noise(col: u32, row: u32) -> f64 {
    let x = (u64::from(row) << 32 | u64::from(col)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (x >> 40) as f64 / (1u64 << 24) as f64
}

/// Rolling hills with a little roughness.
pub(crate) fn hills(col: u32, row: u32) -> f64 {
    let (x, y) = (f64::from(col), f64::from(row));
    let large = (x / 37.0).sin() * (y / 29.0).cos() * 40.0;
    f64::from((large + (x / 7.0 + y / 11.0).sin() * 6.0 + noise(col, row)) as f32)
}

/// What a sink was given, and how.
#[derive(Default, Clone, PartialEq, Debug)]
pub(crate) struct Mesh {
    /// Vertices may lie above or below their samples.
    pub(crate) fitted: bool,
    pub vertices: Vec<Point3>,
    pub triangles: Vec<[u64; 3]>,
    pub corners: Vec<[Point3; 3]>,
    /// Numbers of vertices and triangles of each batch.
    pub batches: Vec<(usize, usize)>,
    pub finished: bool,
}

/// A sink that keeps everything.
#[derive(Default, Clone)]
pub(crate) struct Capture {
    pub mesh: Arc<Mutex<Mesh>>,
    pub with_corners: bool,
    /// Fail when this many vertices are exceeded.
    pub most: Option<usize>,
}

impl Capture {
    pub(crate) fn take(&self) -> Mesh {
        std::mem::take(&mut self.mesh.lock().unwrap())
    }
}

impl MeshSink for Capture {
    fn wants_corners(&self) -> bool {
        self.with_corners
    }

    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        let mut mesh = self.mesh.lock().unwrap();
        mesh.vertices.extend_from_slice(batch.vertices);
        for &triangle in batch.triangles {
            let known = mesh.vertices.len() as u64;
            assert!(triangle.iter().all(|&id| id < known), "a triangle came before its vertices");
            mesh.triangles.push(triangle);
        }
        mesh.corners.extend_from_slice(batch.corners);
        mesh.batches.push((batch.vertices.len(), batch.triangles.len()));
        match self.most {
            Some(most) if mesh.vertices.len() > most => Err(Error::usage("the sink is full")),
            _ => Ok(()),
        }
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        self.mesh.lock().unwrap().finished = true;
        Ok(1)
    }
}

fn doubled_area(mesh: &Mesh, ids: [u64; 3]) -> f64 {
    let [a, b, c] = ids.map(|id| mesh.vertices[id as usize]);
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Panics unless the mesh is a seamless surface over exactly the valid cells of the grid, its
/// vertices are samples, each used and written once, and every covered sample is within
/// `tolerance`.
pub(crate) fn validate(mesh: &Mesh, grid: &FunctionGrid, tolerance: f64) {
    let places = lattice_places(mesh, grid);
    assert_eq!(places.iter().collect::<HashSet<_>>().len(), places.len(), "a vertex comes twice");
    let used: HashSet<u64> = mesh.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), places.len(), "a vertex is not used");
    check_edges(mesh, grid, &places);
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|&ids| {
            let area = doubled_area(mesh, ids);
            assert!(area > 0.0, "a triangle is not counter-clockwise from above");
            area
        })
        .sum();
    let cell = 2.0 * grid.info.transform.determinant().abs();
    assert_eq!(area, cell * valid_cells(grid) as f64, "the areas do not add up");
    mesh.triangles.iter().for_each(|ids| {
        let corner = |id: u64| (places[id as usize], mesh.vertices[id as usize][2]);
        check_errors(ids.map(corner), grid, tolerance);
    });
}

/// Panics unless every sample of the surface that was to be kept is a vertex at its height, and as many as told.
pub(crate) fn check_kept(kept: &GridConstraints, mesh: &Mesh, grid: &FunctionGrid, told: u64) {
    let heights = mesh.vertices.iter().map(|v| v[2]);
    let vertices: HashMap<_, _> = lattice_places(mesh, grid).into_iter().zip(heights).collect();
    let all = Rect::new(0, 0, grid.info.width, grid.info.height);
    let is_on_surface = |&[col, row]: &[u32; 2]| {
        let (col, row) = (i64::from(col), i64::from(row));
        [(1, 1), (0, 1), (1, 0), (0, 0)].iter().any(|(c, r)| is_cell(grid, col - c, row - r))
    };
    let wanted: Vec<_> = kept.within(all).filter(is_on_surface).collect();
    for &[col, row] in &wanted {
        let found = vertices.get(&[col.into(), row.into()]).copied();
        assert_eq!(found, Some((grid.height_at)(col, row)), "column {col}, row {row}");
    }
    assert_eq!(told, wanted.len() as u64, "samples that were kept");
}

/// Panics where neighbouring vertices on the path of a segment are joined by no edge, though the surface goes on
/// between them.
pub(crate) fn check_followed(segments: &[[[u32; 2]; 2]], mesh: &Mesh, grid: &FunctionGrid) {
    let places = lattice_places(mesh, grid);
    let ends = |ids: &[u64; 3]| ids.map(|id| places[id as usize]);
    let sides = |[a, b, c]: [[i64; 2]; 3]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]];
    let edges: HashSet<[[i64; 2]; 2]> = mesh.triangles.iter().map(ends).flat_map(sides).collect();
    let vertices: HashSet<[i64; 2]> = edges.iter().map(|edge| edge[0]).collect();
    let borders = |a: [i64; 2], b: [i64; 2]| {
        let [col, row] = [0, 1].map(|axis| a[axis].min(b[axis]));
        let beside = if a[1] == b[1] { [col, row - 1] } else { [col - 1, row] };
        is_cell(grid, col, row) || is_cell(grid, beside[0], beside[1])
    };
    for &[a, b] in segments {
        let path = SampleSegment::new(a.map(i64::from), b.map(i64::from));
        let path: Vec<_> = (0..=path.steps()).map(|step| path.at(step)).collect();
        let mut last: Option<[i64; 2]> = None;
        for (i, &at) in path.iter().enumerate() {
            if i > 0 && !borders(path[i - 1], at) {
                last = None;
            }
            if vertices.contains(&at) {
                let is_joined = last.is_none_or(|from| edges.contains(&[from, at]));
                assert!(is_joined, "{last:?} is not joined to {at:?}");
                last = Some(at);
            }
        }
    }
}

fn lattice_places(mesh: &Mesh, grid: &FunctionGrid) -> Vec<[i64; 2]> {
    let place = |p: &Point3| {
        let [col, row] = grid.info.transform.invert(p[0], p[1]);
        assert_eq!((col.fract(), row.fract()), (0.0, 0.0));
        let is_sample = (grid.height_at)(col as u32, row as u32) == p[2];
        assert!(is_sample || mesh.fitted, "a vertex is no sample");
        [col as i64, row as i64]
    };
    mesh.vertices.iter().map(place).collect()
}

fn valid_cells(grid: &FunctionGrid) -> usize {
    let cells = Rect::new(0, 0, grid.info.width - 1, grid.info.height - 1);
    FunctionGrid::each(cells).filter(|&(c, r)| is_cell(grid, i64::from(c), i64::from(r))).count()
}

fn is_cell(grid: &FunctionGrid, col: i64, row: i64) -> bool {
    let (width, height) = (i64::from(grid.info.width), i64::from(grid.info.height));
    (0..width - 1).contains(&col)
        && (0..height - 1).contains(&row)
        && [(0, 0), (1, 0), (0, 1), (1, 1)]
            .iter()
            .all(|&(c, r)| !(grid.height_at)((col + c) as u32, (row + r) as u32).is_nan())
}

/// Each directed edge occurs once; one without an opposite lies on the outline of the surface.
fn check_edges(mesh: &Mesh, grid: &FunctionGrid, places: &[[i64; 2]]) {
    let mut edges: HashMap<(u64, u64), usize> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            assert!(edges.insert(edge, 0).is_none(), "an edge occurs twice");
        }
    }
    for &(a, b) in edges.keys().filter(|&&(a, b)| !edges.contains_key(&(b, a))) {
        let (from, to) = (places[a as usize], places[b as usize]);
        assert!(is_outline(grid, from, to), "a crack at {from:?} {to:?}");
    }
}

/// True when all cells on one side of an axis-parallel edge are no surface.
fn is_outline(grid: &FunctionGrid, a: [i64; 2], b: [i64; 2]) -> bool {
    let (first, last) = (a.min(b), a.max(b));
    if a[0] == b[0] {
        let empty = |col: i64| (first[1]..last[1]).all(|row| !is_cell(grid, col, row));
        return empty(a[0]) || empty(a[0] - 1);
    }
    let empty = |row: i64| (first[0]..last[0]).all(|col| !is_cell(grid, col, row));
    a[1] == b[1] && (empty(a[1]) || empty(a[1] - 1))
}

fn check_errors(corners: [([i64; 2], f64); 3], grid: &FunctionGrid, tolerance: f64) {
    let cross = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let (heights, corners) = (corners.map(|(_, z)| z), corners.map(|(at, _)| at));
    let [a, b, c] = corners;
    let area = cross(a, b, c);
    let range = |axis: usize| {
        let all = corners.map(|p| p[axis]);
        all.into_iter().min().unwrap()..=all.into_iter().max().unwrap()
    };
    for row in range(1) {
        for col in range(0) {
            let p = [col, row];
            let weights = [cross(b, c, p), cross(c, a, p), cross(a, b, p)];
            if weights.iter().any(|&w| w * area.signum() < 0) {
                continue;
            }
            let surface: f64 =
                (0..3).map(|i| weights[i] as f64 * heights[i]).sum::<f64>() / area as f64;
            let error = (surface - (grid.height_at)(col as u32, row as u32)).abs();
            assert!(error <= tolerance + 1e-9, "sample {p:?} is off by {error}");
        }
    }
}

/// The largest distance of an edge of the mesh from the lines between neighbouring samples that it crosses.
pub(crate) fn largest_crossing(mesh: &Mesh, grid: &FunctionGrid) -> f64 {
    let places = lattice_places(mesh, grid);
    let edges = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let corner = |id: u64| (places[id as usize], mesh.vertices[id as usize][2]);
    let ends = edges.map(|edge| edge.map(corner));
    ends.fold(0.0, |most, ends| most.max(largest_of_edge(ends, grid)))
}

fn largest_of_edge([(a, from), (b, to)]: [([i64; 2], f64); 2], grid: &FunctionGrid) -> f64 {
    let height = |at: [i64; 2]| (grid.height_at)(at[0] as u32, at[1] as u32);
    let mut most = 0.0_f64;
    for axis in [0, 1] {
        for line in a[axis].min(b[axis]) + 1..a[axis].max(b[axis]) {
            let part = (line - a[axis]) as f64 / (b[axis] - a[axis]) as f64;
            let along = a[1 - axis] as f64 + part * (b[1 - axis] - a[1 - axis]) as f64;
            if (along - along.round()).abs() < 1e-9 {
                continue;
            }
            let sample = |along: f64| height([[line, along as i64], [along as i64, line]][axis]);
            let rest = along - along.floor();
            let ground = sample(along.floor()) * (1.0 - rest) + sample(along.ceil()) * rest;
            most = most.max((from * (1.0 - part) + to * part - ground).abs());
        }
    }
    most
}

/// Number of inner edges whose opposite corner lies strictly inside the circle of a triangle.
pub(crate) fn non_delaunay_edges(mesh: &Mesh, grid: &FunctionGrid) -> usize {
    let places = lattice_places(mesh, grid);
    let place = |id: u64| places[id as usize].map(|v| v as i32);
    let mut apex: HashMap<(u64, u64), u64> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        apex.extend([((a, b), c), ((b, c), a), ((c, a), b)]);
    }
    let is_wrong = |(&(a, b), &c): (&(u64, u64), &u64)| {
        // Seen from above means clockwise in (column, row) axes on a north-up grid.
        let inside = |&d: &u64| in_circle(place(b), place(a), place(c), place(d)) > 0;
        a < b && apex.get(&(b, a)).is_some_and(inside)
    };
    apex.iter().filter(|&edge| is_wrong(edge)).count()
}

/// Number of triangles that have a smaller angle than so many degrees in plan, but for rounding.
pub(crate) fn thin(mesh: &Mesh, degrees: f64) -> u64 {
    let angle = |[from, a, b]: [Point3; 3]| {
        let [a, b] = [a, b].map(|to| [to[0] - from[0], to[1] - from[1]]);
        let [sine, cosine] = [a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]];
        sine.abs().atan2(cosine).to_degrees()
    };
    let is_thin = |triangle: &&[u64; 3]| {
        let [a, b, c] = triangle.map(|id| mesh.vertices[id as usize]);
        [[a, b, c], [b, c, a], [c, a, b]].iter().any(|&at| angle(at) < degrees - 1e-7)
    };
    mesh.triangles.iter().filter(is_thin).count() as u64
}
