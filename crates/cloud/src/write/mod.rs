//! Writing of LAS, LAZ and COPC: streamed in chunks of points, and atomic.
//!
//! A writer provides a [`PointLayout`]; any thread encodes points into a [`PointChunk`] with it, and the chunks are
//! appended in order. The header, which comes first and has the counts, is written last. The bytes depend on the
//! points only: the header has no date.

mod chunk;
mod crs;
mod header;
mod header_statistics;
mod octree;
mod options;
mod record;
mod value;
mod vlr;

pub use chunk::{CHUNK, PointChunk, PointLayout};
pub use octree::{Key, OctreeCube};
pub use options::{CloudWriteOptions, CopiedMetadata};
pub use record::PointRecord;
pub use vlr::Vlr;

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

pub use crate::column::{PointColumn, PointLineFormatter};
pub use crate::format::PointFormat;
pub use crate::version::{LasVersion, PointPacking};
use header::LasHeaderDraft;
use header_statistics::PointTally;
use octree::OctreeNodes;
use terrane_base::error::{Error, Result};
use terrane_files::RawFile;
use terrane_files::atomic::AtomicFile;

/// A LAS or LAZ file being written; if dropped before [`finish`](Self::finish), no file remains.
pub struct CloudWriter {
    file: AtomicFile,
    header: LasHeaderDraft,
    layout: PointLayout,
    tally: PointTally,
    /// The chunks of a LAZ file so far.
    entries: Vec<chunk::Entry>,
    /// The octree so far.
    octree: Option<(OctreeCube, OctreeNodes)>,
    /// True after an incomplete chunk, which is the last.
    is_ended: bool,
}

/// End of the generating software in the header.
const SOFTWARE_END: u64 = 90;

/// Packing by file name; `None` for unknown extensions.
pub fn packing_by_name(path: &Path) -> Option<PointPacking> {
    let name = path.to_string_lossy().to_lowercase();
    let known = [
        (".copc.laz", PointPacking::Nodes),
        (".laz", PointPacking::Chunks),
        (".las", PointPacking::Plain),
        (".csv", PointPacking::Text),
        (".txt", PointPacking::Text),
        (".xyz", PointPacking::Text),
    ];
    known.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, packing)| packing)
}

/// Whether any version of terrane wrote the file, by its header.
pub fn is_written_here(path: &Path) -> bool {
    let (name, _) = header::SOFTWARE.split_once(' ').unwrap_or_default();
    let head = RawFile::open(path).and_then(|file| file.head(SOFTWARE_END));
    head.is_ok_and(|head| {
        head.get(header::SOFTWARE_AT..).is_some_and(|rest| rest.starts_with(name.as_bytes()))
    })
}

impl CloudWriter {
    /// Creates a file.
    ///
    /// # Errors
    /// An existing output, or one that cannot be created; VLRs too long for the version.
    pub fn create(path: &Path, options: &CloudWriteOptions) -> Result<Self> {
        let layout =
            PointLayout::new(options.format, options.carried.extra_bytes, options.packing)?;
        let header = LasHeaderDraft::new(options, &layout).map_err(|e| e.in_file(path))?;
        let file = AtomicFile::create(path, options.overwrite)?;
        let (tally, entries) = (PointTally::default(), Vec::new());
        let octree = options.cube.map(|cube| (cube, OctreeNodes::default()));
        let mut writer = Self { file, header, layout, tally, entries, octree, is_ended: false };
        writer.write(&writer.header.bytes(&PointTally::default()))?;
        if options.packing != PointPacking::Plain {
            // The offset of the chunk table is known only at the end.
            writer.write(&(-1_i64).to_le_bytes())?;
        }
        Ok(writer)
    }

    /// The encoding of points; cheap to clone for other threads.
    pub fn layout(&self) -> PointLayout {
        self.layout.clone()
    }

    /// Number of points so far.
    pub fn points(&self) -> u64 {
        self.tally.count()
    }

    /// Appends a chunk. All but the last must hold [`CHUNK`] points, unless chunks are octree nodes.
    ///
    /// # Errors
    /// More points than the format supports; a full disk.
    ///
    /// # Panics
    /// If a chunk follows an incomplete one.
    pub fn append(&mut self, chunk: &PointChunk) -> Result<()> {
        if chunk.points() == 0 {
            return Ok(());
        }
        assert!(!self.is_ended, "a chunk that is not full must be the last");
        self.is_ended = self.layout.packing() != PointPacking::Nodes && chunk.points() < CHUNK;
        self.tally.add(&chunk.tally);
        self.header.check(&self.tally).map_err(|e| e.in_file(self.file.path()))?;
        if self.layout.packing() != PointPacking::Plain {
            self.entries.push([chunk.points() as u32, chunk.bytes.len() as u32]);
        }
        self.write(&chunk.bytes)
    }

    /// Appends the points of an octree node.
    ///
    /// # Errors
    /// As [`append`](Self::append).
    pub fn append_node(&mut self, key: Key, chunk: &PointChunk) -> Result<()> {
        let at = self.seek(SeekFrom::End(0))?;
        if let Some((_, nodes)) = &mut self.octree {
            nodes.push(key, [at, chunk.bytes.len() as u64, chunk.points() as u64]);
        }
        self.append(chunk)
    }

    /// Completes the file and renames it to its final name; returns its size in bytes.
    ///
    /// # Errors
    /// A full disk.
    pub fn finish(mut self) -> Result<u64> {
        if self.layout.packing() != PointPacking::Plain {
            self.end_chunks()?;
        }
        if let Some((_, nodes)) = &self.octree {
            self.header.behind.insert(0, nodes.hierarchy());
        }
        self.put_behind()?;
        if let Some((cube, _)) = &self.octree {
            let bytes = self.header.behind.first().map_or(0, |vlr| vlr.data.len() as u64);
            let info = octree::info(cube, &self.tally, self.header.behind_at, bytes);
            self.header.set_info(&info);
        }
        self.seek(SeekFrom::Start(0))?;
        self.write(&self.header.bytes(&self.tally))?;
        self.file.commit()
    }

    /// Writes the chunk table and its offset.
    fn end_chunks(&mut self) -> Result<()> {
        let at = self.seek(SeekFrom::End(0))?;
        let table = chunk::table(&self.entries, self.layout.packing());
        self.write(&table.map_err(|e| Error::write(self.file.path(), e))?)?;
        self.seek(SeekFrom::Start(self.header.length()))?;
        self.write(&at.to_le_bytes())
    }

    /// Writes the EVLRs.
    fn put_behind(&mut self) -> Result<()> {
        if self.header.behind.is_empty() {
            return Ok(());
        }
        self.header.behind_at = self.seek(SeekFrom::End(0))?;
        let mut bytes = Vec::new();
        self.header.behind.iter().for_each(|vlr| vlr.append(true, &mut bytes));
        self.write(&bytes)
    }

    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to).map_err(|e| Error::write(self.file.path(), e))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::write(self.file.path(), e))
    }
}
