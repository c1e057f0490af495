//! Opening the files of a mosaic: once in parallel to read their metadata, and again when they are read after
//! having been closed.
//!
//! Metadata are read when the mosaic is opened, so that an invalid file is reported before the work: 10,000 small
//! GeoTIFFs take 1.3 s on two busy threads, 0.5 s of processor time.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::cache::SharedBlocks;
use crate::format::GridOpenOptions;
use crate::grid::{GridInfo, SampleType};
use crate::registry::{file_name, open};
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_files::{is_made, path_of};

use super::cache::{Grid, MosaicFilePool};
use super::vrt;

/// State shared by a mosaic and all nested mosaics.
pub(super) struct MosaicFamily {
    pub(super) pool: MosaicFilePool,
    /// Decoded blocks of all files.
    blocks: SharedBlocks,
    /// Number of files and sources so far.
    members: AtomicU64,
    /// Total size of the VRTs read so far in bytes.
    vrt_bytes: AtomicU64,
    /// Folder for decompressed files.
    temp_dir: Option<PathBuf>,
    /// See [`GridOpenOptions::colours`].
    colours: bool,
}

/// A file that can be reopened at any time.
pub(super) struct MosaicFile {
    pub(super) key: u64,
    name: String,
    band: u32,
    nodata: Option<f64>,
    facts: MosaicFileFacts,
    /// Size in bytes of its largest block that is decoded as a whole.
    pub(super) block_bytes: u64,
}

/// Metadata that must not change while the mosaic is open.
#[derive(Clone, Copy, PartialEq)]
struct MosaicFileFacts {
    width: u32,
    height: u32,
    sample_type: SampleType,
}

impl MosaicFileFacts {
    fn of(info: &GridInfo) -> Self {
        Self { width: info.width, height: info.height, sample_type: info.sample_type }
    }
}

/// Position in a hierarchy of mosaics.
#[derive(Clone)]
pub(super) struct MosaicNesting {
    pub(super) family: Arc<MosaicFamily>,
    /// Real paths of the enclosing VRTs, outermost first.
    pub(super) around: Vec<PathBuf>,
}

/// Source of samples.
pub(super) enum MosaicSource {
    /// A file, opened on demand.
    File(MosaicFile),
    /// A nested mosaic, which holds no file itself.
    Nested { grid: Grid, path: PathBuf },
}

/// A file and its metadata.
pub(super) struct MosaicEntry {
    pub(super) info: GridInfo,
    pub(super) source: MosaicSource,
}

impl MosaicFamily {
    pub(super) fn new(options: &GridOpenOptions) -> Arc<Self> {
        Arc::new(Self {
            pool: MosaicFilePool::new(),
            blocks: options.blocks(),
            members: AtomicU64::new(0),
            vrt_bytes: AtomicU64::new(0),
            temp_dir: options.temp_dir.clone(),
            colours: options.colours,
        })
    }

    /// Adds to the number of files of all mosaics.
    pub(super) fn count_members(&self, more: u64) -> Result<()> {
        let members = self.members.fetch_add(more, Ordering::Relaxed) + more;
        limits::check("number of files of a mosaic", members, limits::MAX_MEMBERS)
    }

    /// Adds to the size of VRTs of all mosaics.
    pub(super) fn count_vrt_bytes(&self, more: u64) -> Result<()> {
        let bytes = self.vrt_bytes.fetch_add(more, Ordering::Relaxed).saturating_add(more);
        limits::check("size of the VRT in bytes", bytes, limits::MAX_VRT_BYTES)
    }

    /// The open grid of a file.
    pub(super) fn grid(&self, file: &MosaicFile) -> Result<Grid> {
        self.pool.get(file.key, || {
            let (open, info) = open_file(self, file.key, &file.name, file.band, file.nodata)?;
            if MosaicFileFacts::of(&info) != file.facts {
                return Err(changed(&file.name));
            }
            Ok(open)
        })
    }
}

impl MosaicFile {
    /// Name under which the file is opened.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The file with the nodata value `nodata` instead of its own, to be reopened if it is open.
    pub(super) fn with_nodata(self, family: &MosaicFamily, nodata: Option<f64>) -> Self {
        Self { key: family.pool.new_key(), nodata, ..self }
    }
}

/// Opens the file or mosaic `name` to read its metadata. A file stays open if the pool has space for it.
pub(super) fn find(
    name: &str,
    band: u32,
    nodata: Option<f64>,
    nest: &MosaicNesting,
) -> Result<MosaicEntry> {
    if is_vrt(name)? {
        let path = &*path_of(name);
        let colours = nest.family.colours;
        let alone = GridOpenOptions { threads: 1, colours, ..GridOpenOptions::default() };
        let options = GridOpenOptions { band, nodata, ..alone };
        let grid: Grid = Arc::new(vrt::open_within(path, &options, nest)?);
        let info = grid.info().clone();
        return Ok(MosaicEntry {
            info,
            source: MosaicSource::Nested { grid, path: path.to_path_buf() },
        });
    }
    let pool = &nest.family.pool;
    let key = pool.new_key();
    let (open, info) = open_file(&nest.family, key, name, band, nodata)?;
    let (facts, block_bytes) = (MosaicFileFacts::of(&info), open.block_bytes());
    pool.offer(key, open);
    let file = MosaicFile { key, name: name.to_owned(), band, nodata, facts, block_bytes };
    Ok(MosaicEntry { info, source: MosaicSource::File(file) })
}

fn is_vrt(name: &str) -> Result<bool> {
    if is_made(name) || file_name(name) != name {
        return Ok(false);
    }
    vrt::is_at(&path_of(name))
}

/// Opens a file, with its blocks in the common cache.
fn open_file(
    family: &MosaicFamily,
    key: u64,
    name: &str,
    band: u32,
    nodata: Option<f64>,
) -> Result<(Grid, GridInfo)> {
    let options = GridOpenOptions {
        band,
        nodata,
        cache_bytes: family.blocks.max_bytes(),
        cache: Some(family.blocks.of_grid(key)),
        temp_dir: family.temp_dir.clone(),
        threads: 1,
        colours: family.colours,
        ..GridOpenOptions::default()
    };
    let grid = open(name, &options).map_err(|e| e.in_file(&path_of(file_name(name))))?;
    let info = grid.info().clone();
    Ok((grid.into(), info))
}

/// Error of a file that changed while the mosaic was open.
fn changed(name: &str) -> Error {
    Error::bad_input("file size or type changed while in use")
        .in_file(&path_of(name))
        .remedy("retry when no other program writes to the file")
}
