//! Meshes in memory, written into files.

use std::path::Path;

use super::{Tin, height_origin_of};
use terrane_base::geom::HeightQuantization;
use terrane_base::{Error, Result};
use terrane_engine::local_frame::{LocalFrame, StorageScale};
use terrane_mesh::{self as mesh, MeshBatch, MeshFormat, MeshHeader, MeshSink, SinkOptions};

/// Vertices or triangles handed to a sink at once.
const BATCH: usize = 1 << 14;

/// How a file stores a mesh.
struct StoredHeights {
    scale: StorageScale,
    /// Height that stored heights are relative to.
    origin: f64,
    /// Error bound of the stored heights.
    tolerance: f64,
}

impl Tin {
    /// Writes it into a new file, whole or not at all, in the format of its extension, and returns the size of
    /// the file in bytes. GLB, STL and 3MF have 32 bits for a height: where rounding takes heights beyond the
    /// tolerance, the file states its [bound](Self::tolerance_in)
    /// ([`Job::write`](terrane_engine::operation::Job::write) rounds first, and keeps the tolerance).
    ///
    /// # Errors
    /// A file that exists or cannot be written; an unknown extension; a mesh beyond the limits of the format.
    ///
    /// ```
    /// # fn main() -> terrane_base::Result<()> {
    /// use terrane_terrain::tin::{BuildTin, TinTargetSetters};
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("mesh.glb");
    /// let heights: Vec<f64> = (0..64 * 64).map(|i| (f64::from(i % 64) / 5.0).sin()).collect();
    /// let tin = terrane_terrain::tin::Tin::from_array(&heights, 64, 64)?.max_error(0.05).build()?;
    /// tin.write(&path)?;
    /// assert!((0.05..0.050001).contains(&tin.tolerance_in(&path)?));
    /// # Ok(())
    /// # }
    /// ```
    pub fn write(&self, path: impl AsRef<Path>) -> Result<u64> {
        self.write_as(path.as_ref(), false)
    }

    /// As [`write`](Self::write), but replaces an existing file.
    ///
    /// # Errors
    /// As [`write`](Self::write), but for a file that exists.
    pub fn overwrite(&self, path: impl AsRef<Path>) -> Result<u64> {
        self.write_as(path.as_ref(), true)
    }

    fn write_as(&self, path: &Path, overwrite: bool) -> Result<u64> {
        let format = mesh::by_path(path, None)?;
        let header = self.header_in(path, format)?;
        let [vertices, triangles] = [self.vertices.len(), self.triangles.len()].map(|n| n as u64);
        format.check_capacity(vertices, triangles)?;
        mesh::check_prj(path, &self.header.crs, overwrite)?;
        let mut sink =
            (format.create)(path, &header, &SinkOptions { overwrite, ..SinkOptions::default() })?;
        self.push(&mut *sink)?;
        let bytes = sink.finish()?;
        mesh::write_prj(path, &self.header.crs, overwrite)?;
        Ok(bytes)
    }

    /// The error bound of a file at `path`: the [tolerance](Self::tolerance), or slightly more if the format
    /// rounds heights.
    ///
    /// # Errors
    /// An unknown extension; a mesh beyond the limits of the format.
    pub fn tolerance_in(&self, path: impl AsRef<Path>) -> Result<f64> {
        let format = mesh::by_path(path.as_ref(), None)?;
        self.placed_in(path.as_ref(), format).map(|stored| stored.tolerance)
    }

    /// Header of a file.
    fn header_in(&self, path: &Path, format: &MeshFormat) -> Result<MeshHeader> {
        let StoredHeights { scale: placed, origin, tolerance } = self.placed_in(path, format)?;
        let mut header = self.header.clone();
        let [x, y, _] = header.origin;
        header.origin = placed.origin([x, y, origin], header.bounds);
        (header.scale, header.unit) = (placed.scale, placed.unit);
        if let Some(stated) = &mut header.promises.max_error
            && tolerance > self.tolerance
        {
            stated.value = tolerance;
        }
        Ok(header)
    }

    /// How a file stores the mesh.
    fn placed_in(&self, path: &Path, format: &MeshFormat) -> Result<StoredHeights> {
        let MeshHeader { crs, bounds: [low, high], promises, .. } = &self.header;
        let steps = [0, 1, 2].map(|axis| if axis < 2 { high[axis] - low[axis] } else { 1.0 });
        let (scale, _) = LocalFrame::default()
            .place(crs, [*low, *high], steps, format)
            .map_err(|error| error.in_file(path))?;
        let heights = self.vertices.iter().map(|[.., z]| *z);
        if !format.single_precision
            || (scale.scale[2] == 1.0 && heights.clone().all(|z| f64::from(z as f32) == z))
        {
            return Ok(StoredHeights { scale, origin: 0.0, tolerance: self.tolerance });
        }
        let origin = height_origin_of(
            heights.clone().fold(f64::INFINITY, f64::min),
            heights.clone().fold(f64::NEG_INFINITY, f64::max),
        );
        let rounding = HeightQuantization { origin, scale: scale.scale[2] };
        let loss = heights.map(|z| (rounding.apply(z) - z).abs()).fold(0.0, f64::max);
        if !loss.is_finite() {
            let message = format!("the heights are out of range for {}", format.name);
            return Err(Error::unsupported(message).in_file(path).remedy("write PLY or OBJ"));
        }
        // The measured error holds at samples only; with another bound, the tolerance counts.
        let error = if promises.bound.is_none() { self.max_error } else { self.tolerance };
        let tolerance = self.tolerance.max((error + loss).next_up());
        Ok(StoredHeights { scale, origin, tolerance })
    }

    fn push(&self, sink: &mut dyn MeshSink) -> Result<()> {
        let wants_corners = sink.wants_corners();
        for vertices in self.vertices.chunks(BATCH) {
            sink.push(MeshBatch { vertices, values: &[], triangles: &[], corners: &[] })?;
        }
        for triangles in self.triangles.chunks(BATCH) {
            let by_position = triangles.iter().filter(|_| wants_corners);
            let corners: Vec<_> =
                by_position.map(|t| t.map(|id| self.vertices[id as usize])).collect();
            let triangles: Vec<_> = triangles.iter().map(|t| t.map(u64::from)).collect();
            sink.push(MeshBatch {
                vertices: &[],
                values: &[],
                triangles: &triangles,
                corners: &corners,
            })?;
        }
        Ok(())
    }
}
