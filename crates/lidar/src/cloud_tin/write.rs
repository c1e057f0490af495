//! Writes the mesh region by region: vertices by tile, and each triangle with the last region that has one of
//! its corners.

use std::sync::Mutex;

use super::context::CloudTinContext;
use super::region_mesh::RegionMesh;
use crate::point_index::PointStore;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Point, Point3, PointFrame};
use terrane_files::lock;
use terrane_mesh::{MeshBatch, MeshSink};

/// Totals of the written mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct WrittenCloudTin {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
    pub(super) bytes: u64,
}

/// A region's part of the mesh.
struct RegionMeshPart {
    vertices: Vec<Point>,
    triangles: Vec<[u64; 3]>,
    /// Empty if the sink does not require them.
    corners: Vec<[Point; 3]>,
}

/// Vertices or triangles that are handed to the sink at a time.
const BATCH: usize = 1 << 12;

/// Writes the triangulation of `vertices`.
pub(super) fn write(
    work: &CloudTinContext<'_>,
    vertices: &PointStore,
    hull: &[Point],
    frame: &PointFrame,
    mut sink: Box<dyn MeshSink>,
) -> Result<WrittenCloudTin> {
    let firsts = firsts(work, vertices)?;
    let mut written = WrittenCloudTin::default();
    work.progress.begin("write", work.regions.all.len() as u64);
    let all = work.regions.all.len();
    let with_corners = sink.wants_corners();
    for from in (0..all).step_by(work.threads) {
        let count = work.threads.min(all - from);
        let parts: Vec<Mutex<Option<RegionMeshPart>>> =
            (0..count).map(|_| Mutex::new(None)).collect();
        work.on_all(count as u64, |_, i| {
            let mut part = part(work, vertices, hull, &firsts, from + i as usize)?;
            sort(&mut part, with_corners);
            *lock(&parts[i as usize]) = Some(part);
            Ok(())
        })?;
        for part in parts.iter().filter_map(|part| lock(part).take()) {
            push(&part, frame, &mut *sink)?;
            written.vertices += part.vertices.len() as u64;
            written.triangles += part.triangles.len() as u64;
        }
        work.progress.advance(count as u64);
    }
    work.progress.end();
    written.bytes = sink.finish()?;
    Ok(written)
}

/// Number of the first vertex of each tile.
fn firsts(work: &CloudTinContext<'_>, vertices: &PointStore) -> Result<Vec<u64>> {
    let tiling = vertices.tiling();
    let squares = work.regions.all.iter().flat_map(|region| region.squares(tiling));
    let mut firsts = vec![0; tiling.count()];
    let (mut next, mut points) = (0, Vec::new());
    for square in squares {
        firsts[square] = next;
        if vertices.summary(square).is_some() {
            vertices.load_distinct(square, &mut points)?;
            next += points.len() as u64;
        }
    }
    Ok(firsts)
}

fn part(
    work: &CloudTinContext<'_>,
    vertices: &PointStore,
    hull: &[Point],
    firsts: &[u64],
    number: usize,
) -> Result<RegionMeshPart> {
    let region = work.regions.all[number];
    let mut local = RegionMesh::new(vertices, region, hull)?;
    let (tiling, mut region_vertices) = (vertices.tiling(), Vec::new());
    for square in region.squares(tiling) {
        region_vertices.extend_from_slice(local.vertices_of(square)?);
    }
    let squares: Vec<usize> = local.mesh.points().iter().map(|&p| tiling.square_of(p)).collect();
    let regions: Vec<usize> = squares.iter().map(|&square| work.regions.of(square)).collect();
    let mut ids: Vec<Option<u64>> = vec![None; squares.len()];
    let mut part =
        RegionMeshPart { vertices: region_vertices, triangles: Vec::new(), corners: Vec::new() };
    for triangle in 0..local.mesh.triangles().len() as u32 {
        let Some(corners) = local.mesh.corners(triangle) else { continue };
        let at = local.mesh.triangles()[triangle as usize].corners.map(|v| v as usize);
        if at.into_iter().map(|v| regions[v]).max() != Some(number) {
            continue;
        }
        for (v, corner) in at.into_iter().zip(corners) {
            if ids[v].is_none() {
                ids[v] = Some(id(&mut local, firsts, corner, squares[v])?);
            }
        }
        part.triangles.push(at.map(|v| ids[v].unwrap_or_default()));
        part.corners.push(corners);
    }
    Ok(part)
}

/// The number of a vertex.
fn id(local: &mut RegionMesh<'_>, firsts: &[u64], vertex: Point, square: usize) -> Result<u64> {
    let rank = local.vertices_of(square)?.binary_search(&vertex);
    let rank = rank.map_err(|_| Error::new(ErrorKind::Internal, "a vertex is not in its tile"))?;
    Ok(firsts[square] + rank as u64)
}

/// Rotates each triangle to start with its lowest vertex, and sorts them.
fn sort(part: &mut RegionMeshPart, with_corners: bool) {
    for (ids, corners) in part.triangles.iter_mut().zip(&mut part.corners) {
        let lowest = (0..3).min_by_key(|&k| ids[k]).unwrap_or(0);
        ids.rotate_left(lowest);
        corners.rotate_left(lowest);
    }
    if !with_corners {
        part.corners = Vec::new();
        return part.triangles.sort_unstable();
    }
    let (triangles, corners) = (std::mem::take(&mut part.triangles), &mut part.corners);
    let mut all: Vec<_> = triangles.into_iter().zip(corners.drain(..)).collect();
    all.sort_unstable();
    (part.triangles, part.corners) = all.into_iter().unzip();
}

fn push(part: &RegionMeshPart, frame: &PointFrame, sink: &mut dyn MeshSink) -> Result<()> {
    for vertices in part.vertices.chunks(BATCH) {
        let vertices: Vec<Point3> = vertices.iter().map(|p| frame.world(*p)).collect();
        sink.push(MeshBatch { vertices: &vertices, values: &[], triangles: &[], corners: &[] })?;
    }
    let mut corners = part.corners.chunks(BATCH);
    for triangles in part.triangles.chunks(BATCH) {
        let corners = corners.next().unwrap_or_default().iter();
        let corners: Vec<[Point3; 3]> = corners.map(|c| c.map(|p| frame.world(p))).collect();
        sink.push(MeshBatch { vertices: &[], values: &[], triangles, corners: &corners })?;
    }
    Ok(())
}
