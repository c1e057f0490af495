//! Mesh sinks, and the common sink of all formats: it counts, checks, spools, and completes a file; a [`MeshEncoder`]
//! makes the bytes.

use std::fs::File;
use std::path::Path;

use crate::capacity::{self, MeshCapacity};
use crate::channels::{VertexChannel, check_values};
use crate::promises::Promises;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Crs, Point3};
use terrane_files::atomic::AtomicFile;
use terrane_files::{AppendWriter, folder_for};

/// Metadata known before the first batch.
#[derive(Clone, Debug)]
pub struct MeshHeader {
    /// Coordinate reference system of the source.
    pub crs: Crs,
    /// Origin for formats without f64 coordinates: they store `position - origin` in f32 and record the origin. f32
    /// heights stay exact if z of the origin is 0; otherwise it is close to the heights, so that they lose little.
    pub origin: Point3,
    /// Stored units per unit of x, y and z, for these formats: they store `(position - origin) * scale`, and record
    /// the scale if it is not 1.
    pub scale: Point3,
    /// The stored unit, "metre" or "millimetre", if it differs from the unit of the coordinates.
    pub unit: Option<String>,
    /// World bounds of all possible vertices: (min, max), x and y from the grid; z may be NaN if unknown.
    pub bounds: [Point3; 2],
    /// Statements of the comments.
    pub promises: Promises,
    /// Vertex channels.
    pub channels: Vec<VertexChannel>,
}

/// A batch of a mesh. Vertex ids count from 0 in the order of vertices; triangles may refer to vertices of this or
/// earlier batches only. Triangles are counter-clockwise seen from above in world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct MeshBatch<'a> {
    /// New vertices.
    pub vertices: &'a [Point3],
    /// Channel values, vertex by vertex.
    pub values: &'a [f64],
    /// Triangles, as vertex ids.
    pub triangles: &'a [[u64; 3]],
    /// World positions of the triangles' corners, aligned with `triangles`; empty unless
    /// [`MeshSink::wants_corners`].
    pub corners: &'a [[Point3; 3]],
}

/// Writes a mesh in batches, without holding it in memory, and atomically: the file gets its final name in
/// [`finish`](MeshSink::finish); a dropped sink leaves no file.
pub trait MeshSink: Send {
    /// True for formats that store triangles by position (STL, DXF), and for solids.
    fn wants_corners(&self) -> bool {
        false
    }

    /// Appends a batch.
    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()>;

    /// Completes the file, renames it to its final name, and returns its size in bytes.
    fn finish(self: Box<Self>) -> Result<u64>;
}

/// Options of a sink, from the command line (`--co KEY=VAL`) and the job.
#[derive(Clone, Debug, Default)]
pub struct SinkOptions {
    /// Replace an existing file.
    pub overwrite: bool,
    /// For [solid formats](crate::MeshFormat::can_be_solid): closes the surface with walls and a flat bottom at this
    /// height.
    pub solid_base: Option<f64>,
    /// Directory for spools; the output's own directory when `None`.
    pub temp_dir: Option<std::path::PathBuf>,
}

/// Vertices and triangles written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MeshCounts {
    pub(super) vertices: u64,
    pub(super) triangles: u64,
}

/// Encoder of a format. A file is a header, the body in the order of the calls, and then the tail: a format that
/// requires all vertices before the first triangle puts triangles there.
pub(super) trait MeshEncoder: Send {
    /// Short format name of the registry.
    fn name(&self) -> &'static str;

    /// Capacity limits.
    fn capacity(&self) -> MeshCapacity;

    /// The header for `counts`; its length is constant, because it is written first with counts of 0 and again at the
    /// end.
    fn header(&self, counts: MeshCounts) -> Vec<u8>;

    /// True if batches need corners.
    fn wants_corners(&self) -> bool {
        false
    }

    /// Vertex channels.
    fn channels(&self) -> &[VertexChannel] {
        &[]
    }

    /// Encodes a checked batch.
    fn encode(
        &mut self,
        batch: MeshBatch<'_>,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()>;

    /// True for formats that [`pack`](Self::pack) the whole file at the end.
    fn is_packed(&self) -> bool {
        false
    }

    /// Writes the file from the encoded data.
    fn pack(&self, _whole: File, _to: &File) -> Result<()> {
        Ok(())
    }

    /// Appends to body and tail at the end.
    fn complete(&mut self, _body: &mut AppendWriter, _tail: &mut AppendWriter) -> Result<()> {
        Ok(())
    }
}

/// Writes one file with an encoder.
pub(super) struct FileSink<E> {
    encoder: E,
    capacity: MeshCapacity,
    header_bytes: u64,
    counts: MeshCounts,
    target: AtomicFile,
    body: AppendWriter,
    tail: AppendWriter,
    /// True during a write, and after a failed one.
    broken: bool,
}

impl<E: MeshEncoder + 'static> FileSink<E> {
    /// Creates the file at `path`.
    pub(super) fn create(
        path: &Path,
        options: &SinkOptions,
        encoder: E,
    ) -> Result<Box<dyn MeshSink>> {
        Ok(Box::new(Self::new(path, options, encoder)?))
    }

    fn new(path: &Path, options: &SinkOptions, encoder: E) -> Result<Self> {
        let target = AtomicFile::create(path, options.overwrite)?;
        let folder = folder_for(path, options.temp_dir.as_deref());
        let tail = AppendWriter::spool(folder)?;
        let mut body = if encoder.is_packed() {
            AppendWriter::spool(folder)?
        } else {
            AppendWriter::of(&target, 0)?
        };
        let header = encoder.header(MeshCounts::default());
        body.write(&header)?;
        let header_bytes = header.len() as u64;
        let (capacity, counts) = (encoder.capacity(), MeshCounts::default());
        Ok(Self { encoder, capacity, header_bytes, counts, target, body, tail, broken: false })
    }

    /// Checks a batch and returns the counts with it.
    fn admit(&self, batch: &MeshBatch<'_>) -> Result<MeshCounts> {
        let counts = MeshCounts {
            vertices: self.counts.vertices + batch.vertices.len() as u64,
            triangles: self.counts.triangles + batch.triangles.len() as u64,
        };
        let name = self.encoder.name();
        let MeshCounts { vertices, triangles } = counts;
        capacity::check(name, &self.capacity, self.header_bytes, vertices, triangles)?;
        check_ids(batch.triangles, counts.vertices)?;
        check_finite(batch, self.counts.vertices)?;
        check_values(self.encoder.channels(), batch.vertices.len(), batch.values)?;
        if self.encoder.wants_corners() && batch.corners.len() != batch.triangles.len() {
            return Err(Error::usage(format!("{name} requires the corners of every triangle")));
        }
        Ok(counts)
    }

    fn check_whole(&self) -> Result<()> {
        if self.broken {
            let message = "an earlier write of this mesh failed; nothing is written";
            return Err(Error::new(ErrorKind::CannotWrite, message));
        }
        Ok(())
    }
}

impl<E: MeshEncoder + 'static> MeshSink for FileSink<E> {
    fn wants_corners(&self) -> bool {
        self.encoder.wants_corners()
    }

    fn push(&mut self, batch: MeshBatch<'_>) -> Result<()> {
        self.check_whole()?;
        // Set before the work and taken back after it: an error on the way leaves it set, and a body that is
        // half written never becomes a file.
        self.broken = true;
        let counts = self.admit(&batch).map_err(|e| e.in_file(self.target.path()))?;
        self.encoder
            .encode(batch, &mut self.body, &mut self.tail)
            .map_err(|e| e.in_file(self.target.path()))?;
        self.counts = counts;
        self.broken = false;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64> {
        self.check_whole()?;
        let Self { mut encoder, header_bytes, counts, target, mut body, mut tail, .. } = *self;
        encoder.complete(&mut body, &mut tail).map_err(|e| e.in_file(target.path()))?;
        body.append(tail)?;
        let header = encoder.header(counts);
        debug_assert_eq!(header.len() as u64, header_bytes);
        body.replace(0, &header)?;
        if encoder.is_packed() {
            encoder.pack(body.into_file()?, target.file()).map_err(|e| e.in_file(target.path()))?;
        }
        target.commit()
    }
}

fn check_ids(triangles: &[[u64; 3]], vertices: u64) -> Result<()> {
    let largest = triangles.iter().flatten().fold(0, |largest, &id| largest.max(id));
    if largest >= vertices && !triangles.is_empty() {
        let message = format!("a triangle refers to vertex {largest}, which is not written yet");
        return Err(Error::usage(message));
    }
    Ok(())
}

fn check_finite(batch: &MeshBatch<'_>, first: u64) -> Result<()> {
    let bad = batch.vertices.iter().position(|v| !is_finite(v));
    if let Some(bad) = bad {
        let vertex = first + bad as u64;
        return Err(Error::bad_input(format!("vertex {vertex} of the mesh is not finite")));
    }
    if batch.corners.iter().flatten().all(is_finite) {
        return Ok(());
    }
    Err(Error::bad_input("a corner of the mesh is not finite"))
}

fn is_finite(point: &[f64; 3]) -> bool {
    point.iter().all(|c| c.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A format whose limits are small enough to meet in a test.
    struct Tiny;

    impl MeshEncoder for Tiny {
        fn name(&self) -> &'static str {
            "Tiny"
        }

        fn capacity(&self) -> MeshCapacity {
            let [vertices, triangles, bytes] = [4, 3, 100];
            MeshCapacity { vertices, triangles, bytes, vertex_bytes: 10, triangle_bytes: 20 }
        }

        fn header(&self, _counts: MeshCounts) -> Vec<u8> {
            vec![b'h'; 20]
        }

        fn encode(
            &mut self,
            batch: MeshBatch<'_>,
            body: &mut AppendWriter,
            tail: &mut AppendWriter,
        ) -> Result<()> {
            body.records(batch.vertices, |_| [b'v'; 10])?;
            tail.records(batch.triangles, |_| [b't'; 20])
        }
    }

    fn batch<'a>(vertices: &'a [[f64; 3]], triangles: &'a [[u64; 3]]) -> MeshBatch<'a> {
        MeshBatch { vertices, values: &[], triangles, corners: &[] }
    }

    fn refused(vertices: &[[f64; 3]], triangles: &[[u64; 3]]) -> Error {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tiny");
        let mut sink = FileSink::create(&path, &SinkOptions::default(), Tiny).unwrap();
        let error = sink.push(batch(vertices, triangles)).unwrap_err();
        assert!(sink.push(batch(&[], &[])).is_err(), "a failed sink goes on");
        assert!(sink.finish().is_err(), "a failed sink completes its file");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert_eq!(error.path(), Some(path.as_path()));
        error
    }

    #[test]
    fn each_limit_is_named_when_it_is_passed() {
        let over = |vertices: usize, triangles: usize| {
            let error = refused(&vec![[0.0; 3]; vertices], &vec![[0; 3]; triangles]);
            assert_eq!(error.kind(), ErrorKind::CannotWrite);
            error.to_string()
        };
        assert!(over(5, 0).contains("Tiny holds at most 4 vertices"));
        assert!(over(1, 4).contains("Tiny holds at most 3 triangles"));
        assert!(over(3, 3).contains("Tiny holds at most 100 bytes"), "20 + 30 + 60 are too many");
        assert!(over(3, 3).contains("write PLY or OBJ or STL or 3MF"));
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(refused(&[[0.0; 3]], &[[0, 0, 1]]).to_string().contains("vertex 1"));
        assert!(refused(&[], &[[0, 0, 0]]).to_string().contains("vertex 0"));
        let bad = [[0.0; 3], [0.0, f64::NAN, 0.0]];
        assert!(refused(&bad, &[]).to_string().contains("vertex 1 of the mesh is not finite"));
    }

    #[test]
    fn exactly_full_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tiny");
        let mut sink = FileSink::create(&path, &SinkOptions::default(), Tiny).unwrap();
        sink.push(batch(&[[0.0; 3]; 4], &[[0, 1, 2]])).unwrap();
        sink.push(batch(&[], &[[1, 2, 3]])).unwrap();
        assert_eq!(sink.finish().unwrap(), 100);
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, ["h".repeat(20), "v".repeat(40), "t".repeat(40)].concat());
    }
}
