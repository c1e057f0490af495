//! The folder of a tile set: a file for each tile, and `layer.json`, which says what there is.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use libdeflater::{CompressionLvl, Compressor};
use serde_json::{Value, json};

use super::report::{LevelReport, TilesReport};
use super::spans::Known;
use super::{Ground, Opened, TilesJob};
use crate::Cancel;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_files::atomic::{AtomicFile, AtomicFolder};
use terrane_files::lock;
use terrane_tiles::{Level, Tile, TileId, level_error, quantized_mesh};

/// The name of what says what there is.
const LAYER: &str = "layer.json";
/// Of a tile's file.
const ENDING: &str = "terrain";
/// Every so many levels tiles tell what there is below them: clients that know the extension ask for it.
const TOLD_LEVELS: u8 = 10;
/// How hard files are compressed, of 12.
const EFFORT: i32 = 9;

/// What is known of the tiles of a level beside which there are.
#[derive(Clone, Debug, Default)]
struct Row {
    largest: f64,
    vertices: u64,
    triangles: u64,
    bytes: u64,
}

/// The file of a tile.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Made {
    pub(super) id: TileId,
    /// Metres that no sample is further from it.
    pub(super) largest: f64,
    pub(super) vertices: u32,
    pub(super) triangles: u32,
    pub(super) bytes: Vec<u8>,
}

impl Made {
    /// Of a tile; `known` has all tiles that it has to tell of.
    pub(super) fn new(
        tile: &Tile,
        opened: &Opened,
        level: &Level,
        ground: &impl terrane_tiles::Ground,
        known: &Known,
    ) -> Result<Self> {
        let job = &opened.job;
        let bytes = quantized_mesh(
            tile,
            job.normals.then_some((level, ground)),
            below(tile.id, opened.division.last, known).as_deref(),
        )?;
        Ok(Self {
            id: tile.id,
            largest: tile.measure.largest,
            vertices: tile.vertices.len() as u32,
            triangles: tile.triangles.len() as u32,
            bytes: if job.compress { packed(&bytes)? } else { bytes },
        })
    }
}

/// What tiles there are in one that has to tell of them, as JSON: places of so many levels below.
fn below(id: TileId, last: u8, known: &Known) -> Option<String> {
    if !id.level.is_multiple_of(TOLD_LEVELS) || id.level >= last {
        return None;
    }
    let levels = 1..=TOLD_LEVELS.min(last - id.level);
    Some(Value::Array(levels.map(|by| known.below(id, by).rectangles()).collect()).to_string())
}

/// A folder in the making.
pub(super) struct Folder {
    folder: AtomicFolder,
    held: Mutex<(Known, BTreeMap<u8, Row>)>,
}

impl Folder {
    /// With nothing in it.
    pub(super) fn create(job: &TilesJob) -> Result<Self> {
        let folder = AtomicFolder::create(&job.output, job.overwrite, is_tiles)?;
        Ok(Self { folder, held: Mutex::default() })
    }

    /// Writes a tile.
    pub(super) fn put(&self, made: &Made) -> Result<()> {
        let TileId { level, x, y } = made.id;
        let path = self.folder.inside().join(level.to_string()).join(x.to_string());
        std::fs::create_dir_all(&path).map_err(|e| Error::write(&path, e))?;
        let path = path.join(format!("{y}.{ENDING}"));
        std::fs::write(&path, &made.bytes).map_err(|e| Error::write(&path, e))?;
        let mut held = lock(&self.held);
        held.0.insert(made.id);
        let row = held.1.entry(level).or_default();
        row.largest = row.largest.max(made.largest);
        row.vertices += u64::from(made.vertices);
        row.triangles += u64::from(made.triangles);
        row.bytes += made.bytes.len() as u64;
        Ok(())
    }

    /// The tiles that are written.
    pub(super) fn known(&self) -> Known {
        lock(&self.held).0.clone()
    }

    /// Writes what says what there is, and gives the folder its name.
    pub(super) fn finish(self, ground: &Ground<'_>, cancel: &Cancel) -> Result<TilesReport> {
        let (known, rows) = self.held.into_inner().unwrap_or_else(PoisonError::into_inner);
        let told: Vec<LevelReport> =
            rows.iter().map(|(level, row)| told(ground, *level, row, &known)).collect();
        let path = self.folder.inside().join(LAYER);
        let mut file = AtomicFile::create(&path, false)?;
        let text = serde_json::to_vec_pretty(&layer(ground, &known, &told)).unwrap_or_default();
        file.write_all(&text).map_err(|e| Error::write(&path, e))?;
        let bytes = file.commit()?;
        cancel.check()?;
        sync(self.folder.inside());
        self.folder.commit()?;
        let Opened { job, division, grid, heights, .. } = ground.opened;
        let [width, height] = division.place.whole.map(u64::from);
        Ok(TilesReport {
            input: job.input.to_string(),
            output: job.output.display().to_string(),
            crs: grid.info().crs.label(),
            tiles: told.iter().map(|level| level.tiles).sum(),
            samples: width * height,
            output_bytes: bytes + told.iter().map(|level| level.bytes).sum::<u64>(),
            levels: told,
            notes: heights.notes.clone(),
            ..TilesReport::default()
        })
    }
}

fn told(ground: &Ground<'_>, level: u8, row: &Row, known: &Known) -> LevelReport {
    LevelReport {
        level,
        tolerance: level_error(level),
        step: ground.levels[usize::from(level)].step,
        error: row.largest,
        tiles: known.level(level).count(),
        vertices: row.vertices,
        triangles: row.triangles,
        bytes: row.bytes,
    }
}

/// Asks the system to put all files on disk: one by one they would take minutes.
#[cfg(target_os = "linux")]
fn sync(folder: &Path) {
    if let Ok(file) = std::fs::File::open(folder) {
        let _best_effort = rustix::fs::syncfs(file);
    }
}

#[cfg(not(target_os = "linux"))]
fn sync(_: &Path) {}

fn packed(bytes: &[u8]) -> Result<Vec<u8>> {
    let effort = CompressionLvl::new(EFFORT).unwrap_or_default();
    let mut packer = Compressor::new(effort);
    let mut out = vec![0; packer.gzip_compress_bound(bytes.len())];
    let size = packer
        .gzip_compress(bytes, &mut out)
        .map_err(|e| Error::new(ErrorKind::Internal, format!("cannot compress a tile: {e}")))?;
    out.truncate(size);
    Ok(out)
}

/// What clients are told: the format, where there are tiles, and what is proven of them.
fn layer(ground: &Ground<'_>, known: &Known, told: &[LevelReport]) -> Value {
    let Opened { job, division, .. } = ground.opened;
    let (bounds, last) = (&division.place.bounds, division.last);
    let available: Vec<Value> = (0..=last).map(|level| known.level(level).rectangles()).collect();
    let levels = told.iter().map(|LevelReport { level, tolerance, step, error, tiles, .. }| {
        json!({"level": level, "tolerance": tolerance, "step": step, "error": error, "tiles": tiles})
    });
    let levels: Vec<Value> = levels.collect();
    let mut extensions = vec!["metadata"];
    if job.normals {
        extensions.insert(0, "octvertexnormals");
    }
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
        "metadataAvailability": TOLD_LEVELS,
        "available": available,
        "terrane": {
            "version": env!("CARGO_PKG_VERSION"),
            "source": job.input.to_string(),
            "voids": "filled",
            "levels": levels,
        },
    })
}

/// True for a folder of tiles that holds nothing else; damaged ones are such, too.
fn is_tiles(path: &Path) -> bool {
    path.join(LAYER).is_file() && holds_tiles_alone(path, 0)
}

/// Whether all in a folder are tiles, by their names: folders of numbers, two deep, with tiles in them.
fn holds_tiles_alone(path: &Path, depth: u32) -> bool {
    let Ok(mut entries) = std::fs::read_dir(path) else { return false };
    entries.all(|entry| {
        let Ok(entry) = entry else { return false };
        let name = PathBuf::from(entry.file_name());
        let is_number = |name: &Path| name.to_str().is_some_and(|name| name.parse::<u32>().is_ok());
        match entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            true => depth < 2 && is_number(&name) && holds_tiles_alone(&entry.path(), depth + 1),
            false if depth == 0 => name == Path::new(LAYER),
            false => depth == 2 && name.extension().is_some_and(|ending| ending == ENDING),
        }
    })
}
