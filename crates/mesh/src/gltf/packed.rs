//! Accessors into compressed buffer views.

use serde::Deserialize;

use super::meshopt::stream::{MeshoptStream, MeshoptWindow};
use super::meshopt::{attributes, triangles};
use crate::input::MeshFile;
use terrane_base::error::{Error, Result};

/// Compression of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MeshoptExtension {
    buffer: u64,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: String,
    filter: Option<String>,
}

/// Location of the elements of an accessor.
pub(super) enum MeshoptAccessor {
    /// Elements of a stream from `first`, at offset `inner` within each.
    Attributes {
        stream: MeshoptStream<attributes::MeshoptAttributeReader>,
        first: u64,
        inner: usize,
    },
    /// All elements of a stream.
    Triangles(MeshoptStream<triangles::MeshoptTriangleReader>),
}

/// Elements of an accessor.
#[derive(Clone, Copy)]
pub(super) struct AccessorElements {
    /// Byte offset in the buffer view.
    pub(super) offset: u64,
    pub(super) count: u64,
    /// Bytes of a component.
    pub(super) width: usize,
    /// Components of an element.
    pub(super) parts: u64,
}

impl MeshoptExtension {
    /// Index of the buffer with the compressed bytes.
    pub(super) fn buffer(&self) -> u64 {
        self.buffer
    }

    /// Opens an accessor to a buffer, which has `bytes` bytes from `start` in the file.
    pub(super) fn open(
        &self,
        input: &MeshFile,
        start: u64,
        bytes: u64,
        elements: AccessorElements,
    ) -> Result<MeshoptAccessor> {
        let end = self.byte_offset.checked_add(self.byte_length);
        if end.is_none_or(|end| end > bytes) {
            return Err(input.bad("has a compressed buffer view outside its buffer"));
        }
        if let Some(filter) = self.filter.as_ref().filter(|filter| *filter != "NONE") {
            let filter: String = filter.chars().take(20).collect();
            return Err(
                input.unsupported(format!("the buffer view filter {filter:?} is not supported"))
            );
        }
        let start = start + self.byte_offset;
        let place = match self.mode.as_str() {
            "ATTRIBUTES" => self.attributes(input, start, elements),
            "TRIANGLES" => self.triangles(input, start, elements),
            mode => {
                let mode: String = mode.chars().take(20).collect();
                Err(Error::unsupported(format!("the buffer view mode {mode:?} is not supported")))
            }
        };
        place.map_err(|e| e.in_file(input.path()))
    }

    fn attributes(
        &self,
        input: &MeshFile,
        start: u64,
        AccessorElements { offset, count, width, parts }: AccessorElements,
    ) -> Result<MeshoptAccessor> {
        let reader = attributes::MeshoptAttributeReader::new(
            &mut MeshoptWindow::new(input),
            start,
            self.byte_length,
            usize::try_from(self.byte_stride).unwrap_or(0),
            self.count,
        )?;
        let (first, inner) = (offset / self.byte_stride, offset % self.byte_stride);
        let is_within = inner + width as u64 * parts <= self.byte_stride
            && first.checked_add(count).is_some_and(|end| end <= self.count);
        if !is_within {
            return Err(input.bad("has an accessor outside its compressed buffer view"));
        }
        Ok(MeshoptAccessor::Attributes {
            stream: MeshoptStream::new(reader),
            first,
            inner: inner as usize,
        })
    }

    fn triangles(
        &self,
        input: &MeshFile,
        start: u64,
        AccessorElements { offset, count, width, parts }: AccessorElements,
    ) -> Result<MeshoptAccessor> {
        if self.byte_stride != width as u64 || width < 2 || parts != 1 {
            return Err(input.bad("the index type does not match the compressed triangles"));
        }
        if offset != 0 || count != self.count || !count.is_multiple_of(3) {
            return Err(
                input.unsupported("accessors to a part of compressed triangles are not supported")
            );
        }
        let reader = triangles::MeshoptTriangleReader::new(
            &mut MeshoptWindow::new(input),
            start,
            self.byte_length,
            count / 3,
        )?;
        Ok(MeshoptAccessor::Triangles(MeshoptStream::new(reader)))
    }
}

impl MeshoptAccessor {
    /// Passes the bytes of attribute elements, from `inner` to their ends, to `each`.
    pub(super) fn elements(
        &self,
        input: &MeshFile,
        first: u64,
        count: usize,
        mut each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let Self::Attributes { stream, first: start, inner } = self else {
            return Err(input.bad("expected vertex attributes, found triangles"));
        };
        stream.read(input, start + first, count, |place, element| each(place, &element[*inner..]))
    }

    /// Reads triangles from `first`.
    pub(super) fn triangles(
        &self,
        input: &MeshFile,
        first: u64,
        out: &mut [[u64; 3]],
    ) -> Result<()> {
        let Self::Triangles(stream) = self else {
            return Err(input.bad("expected triangles, found vertex attributes"));
        };
        stream.read(input, first, out.len(), |place, corners| {
            let (ids, _) = corners.as_chunks::<4>();
            for (id, bytes) in out[place].iter_mut().zip(ids) {
                *id = u32::from_le_bytes(*bytes).into();
            }
            Ok(())
        })
    }
}
