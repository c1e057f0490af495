//! Meshes to write and read back. Not every test needs all of it.

#![allow(dead_code)]

use std::collections::HashMap;
use std::path::Path;

use terrane_base::geom::{Crs, Point3};
use terrane_base::{Error, Result};
use terrane_mesh::{MeshBatch, MeshFormat, MeshHeader, MeshSource, Promises, SinkOptions};

/// A mesh held in memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) vertices: Vec<Point3>,
    pub(crate) triangles: Vec<[u64; 3]>,
}

pub(crate) const ORIGIN: Point3 = [412_345.5, 4_100_000.25, 0.0];

/// A surface of `side` x `side` cells of 30 by 30 around [`ORIGIN`], with heights from 10 to 90 and
/// every `hole`-th cell left out.
pub(crate) fn surface(side: u64, hole: u64) -> Mesh {
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for row in 0..=side {
        for col in 0..=side {
            let height = 50.0 + 40.0 * (0.7 * col as f64).sin() * (0.3 * row as f64).cos();
            let (x, y) = (30.0 * col as f64, 30.0 * row as f64);
            mesh.vertices.push([ORIGIN[0] + x, ORIGIN[1] + y, height]);
        }
    }
    for cell in (0..side * side).filter(|cell| cell % hole != hole - 1) {
        let a = cell / side * (side + 1) + cell % side;
        let (b, c, d) = (a + 1, a + side + 1, a + side + 2);
        mesh.triangles.extend([[a, b, d], [a, d, c]]);
    }
    mesh
}

pub(crate) fn header() -> MeshHeader {
    let crs = Crs { epsg: Some(32611), citation: Some("UTM zone 11N".into()), ..Crs::default() };
    let bounds = [[0.0, 0.0, f64::NAN], [0.0, 0.0, f64::NAN]];
    let scale = [1.0; 3];
    MeshHeader {
        crs,
        origin: ORIGIN,
        scale,
        unit: None,
        bounds,
        promises: Promises::parse(["max error 1.5 metre"]).unwrap(),
        channels: Vec::new(),
    }
}

/// Writes `mesh` in batches: first all vertices and then all triangles, or both mixed when the
/// batches are small.
pub(crate) fn write(
    format: &MeshFormat,
    path: &Path,
    mesh: &Mesh,
    options: &SinkOptions,
    batch: usize,
) -> Result<u64> {
    let mut sink = (format.create)(path, &header(), options)?;
    let (mut vertices, mut triangles) = (mesh.vertices.chunks(batch), mesh.triangles.chunks(batch));
    let mut known = 0;
    let mut waiting: Vec<[u64; 3]> = Vec::new();
    loop {
        let (some, more) = (vertices.next(), triangles.next());
        if some.is_none() && more.is_none() && waiting.is_empty() {
            return sink.finish();
        }
        known += some.map_or(0, <[Point3]>::len) as u64;
        waiting.extend(more.unwrap_or_default());
        let ready = waiting.iter().take_while(|ids| ids.iter().all(|&id| id < known)).count();
        let triangles: Vec<_> = waiting.drain(..ready).collect();
        let corner = |id: u64| mesh.vertices[id as usize];
        let corners: Vec<_> = triangles.iter().map(|ids| ids.map(corner)).collect();
        let corners = if sink.wants_corners() { corners.as_slice() } else { &[] };
        let vertices = some.unwrap_or_default();
        sink.push(MeshBatch { vertices, values: &[], triangles: &triangles, corners })?;
    }
}

/// Reads a whole mesh, in pieces of `batch`.
pub(crate) fn read(source: &dyn MeshSource, batch: u64) -> Result<Mesh> {
    let info = source.info();
    let too_many = |_| Error::bad_input("a mesh too large for a test");
    let vertices: usize = info.vertices.try_into().map_err(too_many)?;
    let triangles: usize = info.triangles.try_into().map_err(too_many)?;
    let mut mesh = Mesh { vertices: vec![[0.0; 3]; vertices], triangles: vec![[0; 3]; triangles] };
    for (i, part) in (0..).zip(mesh.vertices.chunks_mut(batch as usize)) {
        source.read_vertices(i * batch, part)?;
    }
    for (i, part) in (0..).zip(mesh.triangles.chunks_mut(batch as usize)) {
        source.read_triangles(i * batch, part)?;
    }
    Ok(mesh)
}

/// The same mesh, every triangle begun with the smallest of its ids.
pub(crate) fn turned(mesh: &Mesh) -> Mesh {
    let turn = |&[a, b, c]: &[u64; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    Mesh { triangles: mesh.triangles.iter().map(turn).collect(), vertices: mesh.vertices.clone() }
}

/// The positions of the triangles' corners, which every format keeps.
pub(crate) fn corners(mesh: &Mesh) -> Vec<[Point3; 3]> {
    let position = |id: u64| mesh.vertices[id as usize];
    mesh.triangles.iter().map(|ids| ids.map(position)).collect()
}

pub(crate) type Edge = [[u64; 3]; 2];

/// How many triangles have each directed edge.
pub(crate) fn edges(triangles: &[[Point3; 3]]) -> HashMap<Edge, u64> {
    let mut edges = HashMap::new();
    for corners in triangles {
        let [a, b, c] = corners.map(|p| p.map(f64::to_bits));
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges
}

/// Six times the volume that the triangles enclose, seen from the first corner.
pub(crate) fn six_volumes(triangles: &[[Point3; 3]]) -> f64 {
    let o = triangles[0][0];
    let from = |p: &Point3| [p[0] - o[0], p[1] - o[1], p[2] - o[2]];
    let volume = |corners: &[Point3; 3]| {
        let [a, b, c] = corners.each_ref().map(from);
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    triangles.iter().map(volume).sum()
}
