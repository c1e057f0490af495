//! Writing LAS and LAZ: streamed in chunks of points, whole or not at all.
//!
//! A writer gives a [`Layout`]; any thread turns [`CHUNK`] points into a [`Chunk`] with it, and the
//! chunks are appended in order. The header, which comes first and counts everything, is written last.
//! The bytes depend on the points alone: the header bears no date.

mod chunk;
mod crs;
mod header;
mod record;
mod tally;

pub use chunk::{CHUNK, Chunk, Layout};
pub use record::{PointFormat, Record};

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use header::Header;
use tally::Tally;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Frame};
use terrane_files::atomic::AtomicFile;

/// What a file is to be.
#[derive(Clone, Debug)]
pub struct WriteOptions {
    /// Format of its points; the version of LAS follows from it.
    pub format: PointFormat,
    /// True for LAZ.
    pub compress: bool,
    /// Where the points lie: scale and offset of the header.
    pub frame: Frame,
    /// Named in the file as far as known: as well-known text from point format 6 on, as GeoKeys
    /// before it.
    pub crs: Crs,
    /// Replace an existing file.
    pub overwrite: bool,
}

/// A LAS or LAZ file in the making; dropped before [`finish`](Self::finish), it leaves nothing.
pub struct CloudWriter {
    file: AtomicFile,
    header: Header,
    layout: Layout,
    tally: Tally,
    /// Bytes of the chunks of a LAZ file so far.
    sizes: Vec<u32>,
    /// True once a chunk came that was not full: it was the last.
    is_ended: bool,
}

/// True when a file of this name is to be compressed; `None` for names of neither ending.
///
/// # Errors
/// COPC, which is read but not written.
pub fn compressed_by_name(path: &Path) -> Result<Option<bool>> {
    let name = path.to_string_lossy().to_lowercase();
    if name.ends_with(".copc.laz") {
        return Err(Error::unsupported("COPC is read but not written")
            .in_file(path)
            .remedy("choose a name that ends in .laz only"));
    }
    Ok([(".las", false), (".laz", true)].into_iter().find(|(e, _)| name.ends_with(e)).map(|e| e.1))
}

impl CloudWriter {
    /// Starts a file.
    ///
    /// # Errors
    /// An output that exists already or cannot be created; a CRS too long for the file.
    pub fn create(path: &Path, options: &WriteOptions) -> Result<Self> {
        let layout = Layout::new(options.format, options.compress)?;
        let header = Header::new(options, &layout).map_err(|e| e.in_file(path))?;
        let file = AtomicFile::create(path, options.overwrite)?;
        let tally = Tally::default();
        let mut writer = Self { file, header, layout, tally, sizes: Vec::new(), is_ended: false };
        writer.write(&writer.header.bytes(&Tally::default())?)?;
        if options.compress {
            // Where the table of chunks lies is known at the end.
            writer.write(&(-1_i64).to_le_bytes())?;
        }
        Ok(writer)
    }

    /// How points become chunks; cheap to copy for other threads.
    pub fn layout(&self) -> Layout {
        self.layout.clone()
    }

    /// Points so far.
    pub fn points(&self) -> u64 {
        self.tally.count()
    }

    /// Appends a chunk. Each but the last must hold [`CHUNK`] points.
    ///
    /// # Errors
    /// More points than the format counts; a disk that is full.
    ///
    /// # Panics
    /// When a chunk follows one that is not full.
    pub fn append(&mut self, chunk: &Chunk) -> Result<()> {
        if chunk.points() == 0 {
            return Ok(());
        }
        assert!(!self.is_ended, "a chunk that is not full must be the last");
        self.is_ended = chunk.points() < CHUNK;
        self.tally.add(&chunk.tally);
        self.header.check(&self.tally).map_err(|e| e.in_file(self.file.path()))?;
        if self.layout.is_compressed() {
            self.sizes.push(chunk.bytes.len() as u32);
        }
        self.write(&chunk.bytes)
    }

    /// Ends the file and lets it appear; returns its size in bytes.
    ///
    /// # Errors
    /// A disk that is full.
    pub fn finish(mut self) -> Result<u64> {
        if self.layout.is_compressed() {
            self.end_chunks()?;
        }
        self.seek(SeekFrom::Start(0))?;
        self.write(&self.header.bytes(&self.tally)?)?;
        self.file.commit()
    }

    /// The table of chunks, and where it lies.
    fn end_chunks(&mut self) -> Result<()> {
        let at = self.seek(SeekFrom::End(0))?;
        let table = chunk::table(&self.sizes).map_err(|e| Error::write(self.file.path(), e))?;
        self.write(&table)?;
        self.seek(SeekFrom::Start(self.header.length()))?;
        self.write(&at.to_le_bytes())
    }

    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to).map_err(|e| Error::write(self.file.path(), e))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::write(self.file.path(), e))
    }
}
