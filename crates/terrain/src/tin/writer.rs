//! Puts finished tiles into their order and hands them to the mesh sink.
//!
//! Vertices come tile by tile; the triangles of a tile come as soon as the vertices they can refer to are
//! there. So the sequence of batches does not depend on threads.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::artifact::{ArtifactWriter, ContainerRecord};
use super::layout::{TileId, TileLayout};
use super::task_scope::LayoutWork;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Point3;
use terrane_mesh::{MeshBatch, MeshSink};

/// The triangles of one tile.
#[derive(Debug, Default)]
pub(super) struct TileFaces {
    pub(super) ids: Vec<[u64; 3]>,
    /// World positions, if the sink requires them.
    pub(super) corners: Vec<[Point3; 3]>,
    pub(super) max_error: f32,
    pub(super) square_sum: f64,
}

/// One finished part of a tile.
#[derive(Debug)]
pub(super) enum TilePart {
    /// The vertices it owns.
    Vertices(Vec<Point3>),
    /// The triangles kept with it.
    Triangles(TileFaces),
    /// Its container, for another run.
    Saved(ContainerRecord),
}

impl TilePart {
    /// Bytes held.
    pub(super) fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Vertices(points) => size_of_val(&points[..]),
            Self::Triangles(faces) => size_of_val(&faces.ids[..]) + size_of_val(&faces.corners[..]),
            Self::Saved(record) => record.len() as usize,
        };
        bytes as u64
    }
}

/// Receives finished parts of tiles in any order.
pub(super) trait TilePartSink: Send {
    /// Takes a part and writes all that is now in order; returns the bytes that left.
    fn accept(&mut self, tile: TileId, part: TilePart) -> Result<u64>;
}

/// Writes the containers into an object, tile by tile.
pub(super) struct ContainerSaver {
    work: LayoutWork,
    object: ArtifactWriter,
    waiting: BTreeMap<u64, ContainerRecord>,
    next: u64,
}

impl ContainerSaver {
    pub(super) fn new(work: LayoutWork, object: ArtifactWriter) -> Self {
        Self { work, object, waiting: BTreeMap::new(), next: 0 }
    }

    /// The object, when all has come.
    pub(super) fn into_object(self) -> ArtifactWriter {
        self.object
    }
}

impl TilePartSink for ContainerSaver {
    fn accept(&mut self, tile: TileId, part: TilePart) -> Result<u64> {
        let TilePart::Saved(record) = part else { return Err(misplaced()) };
        self.waiting.insert(self.work.position(tile), record);
        let mut bytes = 0;
        while let Some(record) = self.waiting.remove(&self.next) {
            self.object.push(&record)?;
            self.next += 1;
            bytes += record.len();
        }
        Ok(bytes)
    }
}

fn misplaced() -> Error {
    Error::new(ErrorKind::Internal, "a part of a tile was stored at the wrong place")
}

/// Totals of the written mesh.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MeshTotals {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
    pub(super) max_error: f32,
    pub(super) square_sum: f64,
}

/// The ordered end of the pipeline.
pub(super) struct OrderedMeshWriter {
    layout: TileLayout,
    sink: Box<dyn MeshSink>,
    vertices: BTreeMap<u64, Vec<Point3>>,
    triangles: BTreeMap<u64, TileFaces>,
    /// Next tile to write the vertices of.
    next_vertices: u64,
    /// Next tile to write the triangles of.
    next_triangles: u64,
    totals: MeshTotals,
    spent: Duration,
}

impl OrderedMeshWriter {
    pub(super) fn new(layout: TileLayout, sink: Box<dyn MeshSink>) -> Self {
        Self {
            layout,
            sink,
            vertices: BTreeMap::new(),
            triangles: BTreeMap::new(),
            next_vertices: 0,
            next_triangles: 0,
            totals: MeshTotals::default(),
            spent: Duration::ZERO,
        }
    }

    /// Totals so far, and the time of writing.
    pub(super) fn totals(&self) -> (MeshTotals, Duration) {
        (self.totals, self.spent)
    }

    /// Completes the output; returns its size.
    pub(super) fn finish(self) -> Result<u64> {
        self.sink.finish()
    }

    /// The next part in order, if it has come.
    fn next_part(&mut self) -> Option<TilePart> {
        let due = self.next_triangles < self.layout.tiles() && {
            let last = self.layout.furthest_vertex(self.layout.tile_at(self.next_triangles));
            self.layout.index(last) < self.next_vertices
        };
        if due {
            // Nothing else is written while these are due, not even vertices that have come: the sequence must
            // not depend on what came first.
            let faces = self.triangles.remove(&self.next_triangles)?;
            self.next_triangles += 1;
            Some(TilePart::Triangles(faces))
        } else {
            let points = self.vertices.remove(&self.next_vertices)?;
            self.next_vertices += 1;
            Some(TilePart::Vertices(points))
        }
    }

    fn write(&mut self, part: TilePart) -> Result<()> {
        let totals = &mut self.totals;
        match part {
            TilePart::Vertices(vertices) => {
                totals.vertices += vertices.len() as u64;
                self.sink.push(MeshBatch {
                    vertices: &vertices,
                    values: &[],
                    triangles: &[],
                    corners: &[],
                })
            }
            TilePart::Triangles(TileFaces { ids, corners, max_error, square_sum }) => {
                totals.triangles += ids.len() as u64;
                totals.max_error = totals.max_error.max(max_error);
                totals.square_sum += square_sum;
                self.sink.push(MeshBatch {
                    vertices: &[],
                    values: &[],
                    triangles: &ids,
                    corners: &corners,
                })
            }
            TilePart::Saved(_) => Err(misplaced()),
        }
    }
}

impl TilePartSink for OrderedMeshWriter {
    fn accept(&mut self, tile: TileId, part: TilePart) -> Result<u64> {
        let started = Instant::now();
        let index = self.layout.index(tile);
        match part {
            TilePart::Vertices(points) => drop(self.vertices.insert(index, points)),
            TilePart::Triangles(faces) => drop(self.triangles.insert(index, faces)),
            TilePart::Saved(_) => return Err(misplaced()),
        }
        let mut bytes = 0;
        while let Some(part) = self.next_part() {
            bytes += part.bytes();
            self.write(part)?;
        }
        self.spent += started.elapsed();
        Ok(bytes)
    }
}
