//! The folder of a tileset: one file per tile, and `layer.json` or `tileset.json`; a subfolder for each of
//! several formats.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use libdeflater::{CompressionLvl, Compressor};
use serde_json::{Value, json};

use super::available::KnownTiles;
use super::format::TilesFormat;
use super::grid_levels::ScannedGrid;
use super::input::OpenedTilesGrid;
use super::job::TilesJob;
use super::report::{TileLevelReport, TilesReport};
use super::tiles_3d;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::Cancel;
use terrane_engine::outputs::refuse_file_name;
use terrane_files::atomic::{AtomicFile, AtomicFolder};
use terrane_files::lock;
use terrane_globe::{
    GlbTileOptions, GlobeTileId, TerrainTile, TileExtensions, TileLevel, TileMetadata, glb,
    level_error, quantized_mesh,
};
use terrane_options::Choice;

/// Name of the metadata file.
const LAYER: &str = "layer.json";
/// Name of a tile file.
const ENDING: &str = "terrain";
/// Interval of levels whose tiles list the tiles below them, for clients with that extension.
const AVAILABILITY_LEVELS: u8 = 10;
/// Compression level, 0 to 12.
const EFFORT: i32 = 9;

/// Statistics of a level in a format.
#[derive(Clone, Copy, Debug, Default)]
struct TileLevelTotals {
    largest: f64,
    vertices: u64,
    triangles: u64,
    bytes: u64,
}

/// Data of a tile beside its surface.
#[derive(Clone, Copy)]
pub(super) struct TileContext<'a> {
    /// Tiles for its metadata.
    pub(super) known: &'a KnownTiles,
    /// Its water mask.
    pub(super) water: Option<&'a [u8]>,
}

/// The file of a tile.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TileFile {
    /// Index of its format; `None` for a tile without a file.
    pub(super) set: Option<usize>,
    pub(super) id: GlobeTileId,
    /// Largest error of a sample in metres.
    pub(super) largest: f64,
    pub(super) vertices: u32,
    pub(super) triangles: u32,
    /// Metadata for 3D Tiles.
    pub(super) facts: Option<TileMetadata>,
    pub(super) bytes: Vec<u8>,
}

impl TileFile {
    /// A tile below the deepest level that contains samples.
    pub(super) fn nothing(id: GlobeTileId) -> Self {
        let (largest, vertices, triangles, facts, bytes) = (0.0, 0, 0, None, Vec::new());
        Self { set: None, id, largest, vertices, triangles, facts, bytes }
    }

    /// A tile of a set.
    pub(super) fn new(
        set: usize,
        tile: &TerrainTile,
        opened: &OpenedTilesGrid,
        level: &TileLevel,
        ground: &impl terrane_globe::TerrainSampler,
        TileContext { known, water }: TileContext<'_>,
    ) -> Result<Self> {
        let job = &opened.job;
        let normals = job.tiles.normals.then_some((level, ground));
        let (bytes, facts) = match job.tiles.format[set] {
            TilesFormat::QuantizedMesh => {
                let below = below(tile.id, opened.division.last, known);
                let extras = TileExtensions { available: below.as_deref(), water };
                (quantized_mesh(tile, normals, extras)?, None)
            }
            TilesFormat::ThreeTiles => {
                let (edges, meshopt, skirt) =
                    (job.tiles.tile_edges, job.tiles.meshopt, level.skirt);
                let (bytes, facts) = glb(tile, normals, GlbTileOptions { edges, meshopt, skirt })?;
                (bytes, Some(facts))
            }
        };
        Ok(Self {
            set: Some(set),
            id: tile.id,
            largest: tile.measure.largest,
            vertices: tile.vertices.len() as u32,
            triangles: tile.triangles.len() as u32,
            facts,
            bytes: if job.tiles.gzip { packed(&bytes)? } else { bytes },
        })
    }
}

/// Tiles below `tile` as JSON, for the next levels.
fn below(id: GlobeTileId, last: u8, known: &KnownTiles) -> Option<String> {
    if !id.level.is_multiple_of(AVAILABILITY_LEVELS) || id.level >= last {
        return None;
    }
    let levels = 1..=AVAILABILITY_LEVELS.min(last - id.level);
    Some(Value::Array(levels.map(|by| known.below(id, by).rectangles()).collect()).to_string())
}

/// An unfinished folder.
pub(super) struct TilesetFolder {
    folder: AtomicFolder,
    formats: Vec<TilesFormat>,
    compress: bool,
    state: Mutex<TilesetFolderState>,
}

/// Statistics of its files.
#[derive(Default)]
struct TilesetFolderState {
    known: KnownTiles,
    /// By set and level.
    rows: BTreeMap<(usize, u8), TileLevelTotals>,
    /// Metadata of each tile for 3D Tiles.
    facts: BTreeMap<GlobeTileId, TileMetadata>,
}

impl TilesetFolder {
    /// An empty folder.
    pub(super) fn create(job: &TilesJob) -> Result<Self> {
        refuse_file_name(&job.output)?;
        let folder = AtomicFolder::create(&job.output, job.overwrite, is_tiles)?;
        let (formats, compress) = (job.tiles.format.clone(), job.tiles.gzip);
        Ok(Self { folder, formats, compress, state: Mutex::default() })
    }

    /// Folder of the files of a set: the folder itself for a single set.
    fn inside(&self, set: usize) -> PathBuf {
        match self.formats.len() {
            1 => self.folder.inside().to_path_buf(),
            _ => self.folder.inside().join(self.formats[set].name()),
        }
    }

    /// Writes a tile.
    pub(super) fn put(&self, made: &TileFile) -> Result<()> {
        let GlobeTileId { level, x, y } = made.id;
        let Some(set) = made.set else {
            lock(&self.state).known.insert(made.id);
            return Ok(());
        };
        let name = match self.formats[set] {
            TilesFormat::QuantizedMesh => format!("{level}/{x}/{y}.{ENDING}"),
            TilesFormat::ThreeTiles => tiles_3d::name_of(made.id, tiles_3d::ENDING),
        };
        // Before the lock: threads write at the same time.
        self.write(set, &name, &made.bytes)?;
        let mut state = lock(&self.state);
        state.known.insert(made.id);
        state.facts.extend(made.facts.map(|facts| (made.id, facts)));
        let row = state.rows.entry((set, level)).or_default();
        row.largest = row.largest.max(made.largest);
        row.vertices += u64::from(made.vertices);
        row.triangles += u64::from(made.triangles);
        row.bytes += made.bytes.len() as u64;
        Ok(())
    }

    /// Writes a file of a set.
    fn write(&self, set: usize, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.inside(set).join(name);
        // A folder is made when a write misses it: nearly all tiles find theirs, and looking first costs a call for each.
        let mut written = std::fs::write(&path, bytes);
        if written.as_ref().is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound) {
            let folder = path.parent().unwrap_or(&path);
            std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
            written = std::fs::write(&path, bytes);
        }
        written.map_err(|e| Error::write(&path, e))
    }

    /// The written tiles.
    pub(super) fn known(&self) -> KnownTiles {
        lock(&self.state).known.clone()
    }

    /// Writes the metadata files, and renames the folder to its final name.
    pub(super) fn finish(self, ground: &ScannedGrid<'_>, cancel: &Cancel) -> Result<TilesReport> {
        let mut state = std::mem::take(&mut *lock(&self.state));
        tiles_3d::nest(&mut state.facts);
        let (mut levels, mut bytes) = (Vec::new(), 0);
        for (set, format) in self.formats.iter().enumerate() {
            let reports = level_reports(ground, set, &state);
            let (name, text) = match format {
                TilesFormat::QuantizedMesh => (LAYER, layer(ground, &state.known, &reports)),
                TilesFormat::ThreeTiles => {
                    bytes += self.subtrees(set, &state.facts, cancel)?;
                    (tiles_3d::TILESET, tiles_3d::tileset(ground, &reports, &state.facts))
                }
            };
            let path = self.inside(set).join(name);
            let mut file = AtomicFile::create(&path, false)?;
            let text = serde_json::to_vec_pretty(&text).unwrap_or_default();
            file.write_all(&text).map_err(|e| Error::write(&path, e))?;
            bytes += file.commit()?;
            levels.extend(reports);
        }
        cancel.check()?;
        // On the disk before the folder has its name, so that a crash leaves all of it or nothing.
        sync(self.folder.inside());
        self.folder.commit()?;
        let OpenedTilesGrid { job, division, grid, .. } = ground.opened;
        let [width, height] = division.place.size.map(u64::from);
        Ok(TilesReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            crs: grid.info().crs.label(),
            tiles: levels.iter().map(|level| level.tiles).sum(),
            samples: width * height,
            output_bytes: bytes + levels.iter().map(|level| level.bytes).sum::<u64>(),
            levels,
            notes: ground.notes(),
            ..TilesReport::default()
        })
    }

    /// Writes the subtrees of a set; returns their size.
    fn subtrees(
        &self,
        set: usize,
        facts: &BTreeMap<GlobeTileId, TileMetadata>,
        cancel: &Cancel,
    ) -> Result<u64> {
        let mut written = 0;
        for (top, subtree) in tiles_3d::subtrees(facts) {
            cancel.check()?;
            let bytes = if self.compress { packed(&subtree)? } else { subtree };
            self.write(set, &tiles_3d::name_of(top, tiles_3d::SUBTREE), &bytes)?;
            written += bytes.len() as u64;
        }
        Ok(written)
    }
}

/// Statistics of each level of a set.
fn level_reports(
    ground: &ScannedGrid<'_>,
    set: usize,
    state: &TilesetFolderState,
) -> Vec<TileLevelReport> {
    let rows = state.rows.iter().filter(|((of, _), _)| *of == set);
    let reports = rows.map(|((_, level), row)| {
        let of_level = &ground.levels[set][usize::from(*level)];
        TileLevelReport {
            format: ground.opened.job.tiles.format[set].name().to_owned(),
            level: *level,
            tolerance: level_error(*level).max(row.largest),
            step: of_level.step,
            lattice: of_level.lattice,
            skirt: (of_level.skirt > 0).then(|| of_level.skirt_depth()),
            error: row.largest,
            tiles: state.known.level(*level).count(),
            vertices: row.vertices,
            triangles: row.triangles,
            bytes: row.bytes,
        }
    });
    reports.collect()
}

/// Flushes the file system once; a flush per file would take minutes.
#[cfg(target_os = "linux")]
fn sync(folder: &Path) {
    if let Ok(file) = std::fs::File::open(folder) {
        let _best_effort = rustix::fs::syncfs(file);
    }
}

#[cfg(not(target_os = "linux"))]
fn sync(_: &Path) {}

thread_local! {
    /// Compressor of a thread, reused because it is large and files are small.
    static PACKER: RefCell<Compressor> =
        RefCell::new(Compressor::new(CompressionLvl::new(EFFORT).unwrap_or_default()));
}

fn packed(bytes: &[u8]) -> Result<Vec<u8>> {
    PACKER.with_borrow_mut(|packer| {
        let mut out = vec![0; packer.gzip_compress_bound(bytes.len())];
        let size = packer
            .gzip_compress(bytes, &mut out)
            .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot compress a tile: {e}")))?;
        out.truncate(size);
        Ok(out)
    })
}

/// Metadata for clients: format, available tiles, and proven errors.
fn layer(ground: &ScannedGrid<'_>, known: &KnownTiles, reports: &[TileLevelReport]) -> Value {
    let OpenedTilesGrid { job, division, .. } = ground.opened;
    let (bounds, last) = (&division.place.bounds(), division.last);
    let available: Vec<Value> = (0..=last).map(|level| known.level(level).rectangles()).collect();
    let levels = reports.iter().map(|TileLevelReport { level, tolerance, step, error, tiles, .. }| {
        json!({"level": level, "tolerance": tolerance, "step": step, "error": error, "tiles": tiles})
    });
    let levels: Vec<Value> = levels.collect();
    let extensions = [
        (job.tiles.normals, "octvertexnormals"),
        (ground.opened.mask.is_some(), "watermask"),
        (true, "metadata"),
    ];
    let extensions: Vec<&str> =
        extensions.into_iter().filter(|(is, _)| *is).map(|(_, name)| name).collect();
    json!({
        "tilejson": "2.1.0",
        "name": "terrain",
        "description": "",
        "version": "1.0.0",
        "format": "quantized-mesh-1.0",
        "attribution": "",
        "scheme": "tms",
        "extensions": extensions,
        "tiles": ["{z}/{x}/{y}.terrain?v={version}"],
        "projection": "EPSG:4326",
        "bounds": [bounds.west, bounds.south, bounds.east, bounds.north],
        "minzoom": 0,
        "maxzoom": last,
        "metadataAvailability": AVAILABILITY_LEVELS,
        "available": available,
        "terrane": {
            "version": env!("CARGO_PKG_VERSION"),
            "source": terrane_engine::feature_files::source(&job.input),
            "voids": "filled",
            "beyond": job.tiles.beyond.name(),
            "heights": ground.opened.heights.from,
            "levels": levels,
        },
    })
}

/// True for a folder of tiles, or of folders of tiles by format, that contains nothing else.
fn is_tiles(path: &Path) -> bool {
    let entries = std::fs::read_dir(path).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let Ok(entries) = entries else { return false };
    match !entries.is_empty() && entries.iter().all(|entry| is_format_name(&entry.file_name())) {
        true => entries.iter().all(|entry| is_one_set(&entry.path())),
        false => is_one_set(path),
    }
}

fn is_format_name(name: &OsStr) -> bool {
    TilesFormat::names().iter().any(|known| name == known.name)
}

/// True for a folder of tiles of one format, damaged or not, that contains nothing else.
fn is_one_set(path: &Path) -> bool {
    let layer = TilesetLayout { metadata: LAYER, top: &[], endings: &[ENDING] };
    let tileset = TilesetLayout {
        metadata: tiles_3d::TILESET,
        top: &tiles_3d::HALVES,
        endings: &[tiles_3d::ENDING, tiles_3d::SUBTREE],
    };
    layer.matches(path, 1) || tileset.matches(path, 0)
}

/// Contents of a set's folder in a format: metadata file, top folders, and tile files.
struct TilesetLayout<'a> {
    metadata: &'a str,
    top: &'a [&'a str],
    endings: &'a [&'a str],
}

impl TilesetLayout<'_> {
    fn matches(&self, path: &Path, depth: u32) -> bool {
        path.join(self.metadata).is_file() && self.holds_all(path, depth)
    }

    /// Whether all names in a folder belong to a set: at depth 0 the top folders; below them two levels of
    /// numbered folders with tiles.
    fn holds_all(&self, path: &Path, depth: u32) -> bool {
        let Ok(mut entries) = std::fs::read_dir(path) else { return false };
        let first = u32::from(self.top.is_empty());
        entries.all(|entry| {
            let Ok(entry) = entry else { return false };
            let name = PathBuf::from(entry.file_name());
            match entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                true if depth == 0 => {
                    self.top.iter().any(|top| name == Path::new(top))
                        && self.holds_all(&entry.path(), 1)
                }
                true => depth < 3 && is_number(&name) && self.holds_all(&entry.path(), depth + 1),
                false if depth == first => name == Path::new(self.metadata),
                false => {
                    depth == 3
                        && name
                            .extension()
                            .is_some_and(|found| self.endings.iter().any(|ending| found == *ending))
                }
            }
        })
    }
}

fn is_number(name: &Path) -> bool {
    name.to_str().is_some_and(|name| name.parse::<u32>().is_ok())
}
