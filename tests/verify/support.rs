//! Grids and meshes in memory for the tests of verification, sound ones and the means to spoil them.
#![allow(dead_code)] // each test binary uses its own part

use spade::{DelaunayTriangulation, Point2, Triangulation};
use terrane::{ErrorBound, Result};
use terrane_base::geom::{Point3, Rect};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_mesh::{MeshInfo, MeshSource};
use terrane_raster::{GridInfo, GridSource, SampleType};
use terrane_verify::{MeshRequirements, VerifyReport, verify};

/// A grid in memory.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(crate) info: GridInfo,
    pub(crate) heights: Vec<f64>,
}

impl Grid {
    pub(crate) fn new(width: u32, height: u32, f: impl Fn(u32, u32) -> f64) -> Self {
        let samples = (0..height).flat_map(|r| (0..width).map(move |c| (c, r)));
        let info = GridInfo::plain("memory", width, height, SampleType::F64);
        Self { info, heights: samples.map(|(c, r)| f(c, r)).collect() }
    }

    pub(crate) fn at(&self, col: u32, row: u32) -> f64 {
        self.heights[(row * self.info.width + col) as usize]
    }

    pub(crate) fn set(&mut self, col: u32, row: u32, z: f64) {
        self.heights[(row * self.info.width + col) as usize] = z;
    }

    pub(crate) fn is_surface(&self, col: i64, row: i64) -> bool {
        let inside = |v: i64, side: u32| (0..i64::from(side) - 1).contains(&v);
        inside(col, self.info.width)
            && inside(row, self.info.height)
            && [(0, 0), (1, 0), (0, 1), (1, 1)]
                .iter()
                .all(|(c, r)| !self.at(col as u32 + c, row as u32 + r).is_nan())
    }

    /// World position of a sample.
    pub(crate) fn vertex(&self, col: u32, row: u32) -> Point3 {
        let [x, y] = self.info.transform.apply(f64::from(col), f64::from(row));
        [x, y, self.at(col, row)]
    }
}

impl GridSource for Grid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        let mut wide = vec![0.0; rect.len()];
        self.read_f64(rect, &mut wide)?;
        out.iter_mut().zip(wide).for_each(|(o, v)| *o = v as f32);
        Ok(())
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        for (row, out) in (rect.row..).zip(out.chunks_exact_mut(rect.width as usize)) {
            let from = (row * self.info.width + rect.col) as usize;
            out.copy_from_slice(&self.heights[from..from + rect.width as usize]);
        }
        Ok(())
    }
}

/// A mesh in memory.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub(crate) info: MeshInfo,
    pub(crate) vertices: Vec<Point3>,
    pub(crate) triangles: Vec<[u64; 3]>,
}

impl Mesh {
    pub(crate) fn new(vertices: Vec<Point3>, triangles: Vec<[u64; 3]>) -> Self {
        let info = MeshInfo::plain("memory", 0, 0);
        let mut mesh = Self { info, vertices, triangles };
        mesh.recount();
        mesh
    }

    pub(crate) fn recount(&mut self) {
        self.info.vertices = self.vertices.len() as u64;
        self.info.triangles = self.triangles.len() as u64;
    }

    /// Appends a vertex and returns its id.
    pub(crate) fn add(&mut self, vertex: Point3) -> u64 {
        self.vertices.push(vertex);
        self.vertices.len() as u64 - 1
    }

    /// Id of the vertex at (x, y).
    pub(crate) fn find(&self, x: f64, y: f64) -> u64 {
        self.vertices.iter().position(|v| [v[0], v[1]] == [x, y]).unwrap() as u64
    }

    /// Each triangle with three vertices of its own, as in STL.
    pub(crate) fn soup(&self) -> Self {
        let corners = self.triangles.iter().flatten().map(|&id| self.vertices[id as usize]);
        let vertices: Vec<Point3> = corners.collect();
        let ids = (0..self.triangles.len() as u64).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        let mut mesh = Self::new(vertices, ids.collect());
        mesh.info.indexed = false;
        mesh
    }
}

impl MeshSource for Mesh {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
        out.copy_from_slice(&self.vertices[first as usize..first as usize + out.len()]);
        Ok(())
    }

    fn read_triangles(&self, first: u64, out: &mut [[u64; 3]]) -> Result<()> {
        out.copy_from_slice(&self.triangles[first as usize..first as usize + out.len()]);
        Ok(())
    }
}

/// All cells of the surface, each split in two; every used sample is a vertex.
pub(crate) fn split_cells(grid: &Grid) -> Mesh {
    let mut mesh = Mesh::new(Vec::new(), Vec::new());
    let mut ids = vec![u64::MAX; grid.heights.len()];
    let flip = grid.info.transform.determinant() < 0.0;
    for (row, col) in (0..grid.info.height).flat_map(|r| (0..grid.info.width).map(move |c| (r, c)))
    {
        if !grid.is_surface(col.into(), row.into()) {
            continue;
        }
        let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dc, dr)| {
            let (col, row) = (col + dc, row + dr);
            let id = &mut ids[(row * grid.info.width + col) as usize];
            if *id == u64::MAX {
                *id = mesh.add(grid.vertex(col, row));
            }
            *id
        });
        mesh.triangles.extend(if flip { [[a, c, b], [b, c, d]] } else { [[a, b, c], [b, d, c]] });
    }
    mesh.recount();
    mesh
}

/// The Delaunay mesh of the corners and the samples `keep` picks, of a grid without voids.
pub(crate) fn delaunay(grid: &Grid, keep: impl Fn(u32, u32) -> bool) -> Mesh {
    let (right, below) = (grid.info.width - 1, grid.info.height - 1);
    let is_corner = |c, r| (c == 0 || c == right) && (r == 0 || r == below);
    let kept: Vec<(u32, u32)> = (0..=below)
        .flat_map(|r| (0..=right).map(move |c| (c, r)))
        .filter(|&(c, r)| is_corner(c, r) || keep(c, r))
        .collect();
    let points = kept.iter().map(|&(c, r)| Point2::new(f64::from(c), f64::from(r))).collect();
    let triangulation = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points).unwrap();
    let flip = grid.info.transform.determinant() < 0.0;
    let triangles = triangulation.inner_faces().map(|face| {
        let [a, b, c] = face.vertices().map(|v| v.fix().index() as u64);
        if flip { [a, c, b] } else { [a, b, c] }
    });
    let triangles = triangles.collect();
    Mesh::new(kept.iter().map(|&(c, r)| grid.vertex(c, r)).collect(), triangles)
}

/// A hash of a lattice position, from 0 to 1.
pub(crate) fn noise(col: u32, row: u32, seed: u32) -> f64 {
    let mut h = col.wrapping_mul(0x9e37_79b1) ^ row.wrapping_mul(0x85eb_ca77) ^ seed;
    for _ in 0..3 {
        h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
        h ^= h >> 12;
    }
    f64::from(h) / f64::from(u32::MAX)
}

/// Verifies at samples in the given memory.
pub(crate) fn check_with(
    mesh: &Mesh,
    grid: &Grid,
    tolerance: Option<f64>,
    threads: usize,
    memory: u64,
) -> VerifyReport {
    let resources = Resources { threads, memory, temp_dir: None };
    let asked = MeshRequirements::of_samples(tolerance);
    verify(mesh, grid, asked, &resources, &Silent, &Cancel::default()).unwrap()
}

/// Verifies the surface in plenty of memory.
pub(crate) fn check_surface(mesh: &Mesh, grid: &Grid, tolerance: Option<f64>) -> VerifyReport {
    let resources = Resources { threads: 1, memory: 64 << 20, temp_dir: None };
    let asked =
        MeshRequirements { bound: ErrorBound::Surface, ..MeshRequirements::of_samples(tolerance) };
    verify(mesh, grid, asked, &resources, &Silent, &Cancel::default()).unwrap()
}

/// Verifies in plenty of memory.
pub(crate) fn check(mesh: &Mesh, grid: &Grid, tolerance: Option<f64>) -> VerifyReport {
    check_with(mesh, grid, tolerance, 1, 64 << 20)
}

/// The findings alone, without the figures of the run.
pub(crate) fn findings(mut report: VerifyReport) -> VerifyReport {
    report.of.samples_per_second = 0.0;
    report.run = RunStatistics::default();
    report
}
