//! Compression of vertices and triangles as they arrive.

use std::path::Path;

use super::meshopt::{attributes, triangles};
use terrane_base::error::Result;
use terrane_files::AppendWriter;

/// Alignment of streams.
const ALIGNED: u64 = 4;

/// Both streams of a file.
pub(super) struct MeshoptPacker {
    vertices: attributes::MeshoptAttributeWriter,
    triangles: triangles::MeshoptTriangleWriter,
    /// Data of the triangles, which follow all their codes.
    data: AppendWriter,
    has_triangles: bool,
    sizes: MeshoptSizes,
}

impl MeshoptPacker {
    /// For vertices of this size; buffered data go to an anonymous file in `folder`.
    pub(super) fn new(vertex_bytes: usize, folder: &Path) -> Result<Self> {
        let (vertices, triangles) = (
            attributes::MeshoptAttributeWriter::new(vertex_bytes),
            triangles::MeshoptTriangleWriter::new(),
        );
        Ok(Self {
            vertices,
            triangles,
            data: AppendWriter::spool(folder)?,
            has_triangles: false,
            sizes: MeshoptSizes::default(),
        })
    }

    pub(super) fn push_vertex(&mut self, element: &[u8], body: &mut AppendWriter) -> Result<()> {
        let before = body.bytes();
        self.vertices.push(element, &mut body.buffer);
        self.sizes.0[0] += body.bytes() - before;
        body.settle()
    }

    pub(super) fn push_triangles(
        &mut self,
        all: impl Iterator<Item = [u32; 3]>,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        for corners in all {
            if !self.has_triangles {
                tail.write(&triangles::MeshoptTriangleWriter::HEAD)?;
                self.has_triangles = true;
            }
            self.triangles.push(corners, &mut tail.buffer, &mut self.data.buffer);
            tail.settle()?;
            self.data.settle()?;
        }
        Ok(())
    }

    /// Completes both streams.
    pub(super) fn complete(
        &mut self,
        body: &mut AppendWriter,
        tail: &mut AppendWriter,
    ) -> Result<()> {
        let before = body.bytes();
        self.vertices.complete(&mut body.buffer);
        self.sizes.0[0] += body.bytes() - before;
        pad(self.sizes.0[0], body);
        if self.has_triangles {
            let empty = AppendWriter::spool(self.data.path())?;
            tail.append(std::mem::replace(&mut self.data, empty))?;
            tail.write(&triangles::MeshoptTriangleWriter::TAIL)?;
            self.sizes.0[1] = tail.bytes();
            pad(self.sizes.0[1], tail);
        }
        Ok(())
    }

    /// Sizes of both complete streams.
    pub(super) fn sizes(&self) -> MeshoptSizes {
        self.sizes
    }
}

/// Bytes of the vertex stream and of the triangle stream.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MeshoptSizes(pub(super) [u64; 2]);

impl MeshoptSizes {
    /// Offset and size of both streams in the data of the file.
    pub(super) fn spans(self) -> [(u64, u64); 2] {
        let [vertices, triangles] = self.0;
        [(0, vertices), (vertices.next_multiple_of(ALIGNED), triangles)]
    }

    /// Total bytes of both with padding.
    pub(super) fn bytes(self) -> u64 {
        self.0.iter().map(|bytes| bytes.next_multiple_of(ALIGNED)).sum()
    }
}

fn pad(bytes: u64, out: &mut AppendWriter) {
    let more = bytes.next_multiple_of(ALIGNED) - bytes;
    out.buffer.extend(std::iter::repeat_n(0, more as usize));
}
