//! The folder of a tile set: a file for each tile, and `layer.json`, which says what there is.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use libdeflater::{CompressionLvl, Compressor};
use serde_json::{Value, json};

use super::report::{LevelReport, TilesReport};
use super::{Ground, TilesJob};
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

/// What is known of the tiles of a level.
#[derive(Clone, Debug, Default)]
struct Row {
    tiles: BTreeSet<(u32, u32)>,
    largest: f64,
    samples: u64,
    vertices: u64,
    triangles: u64,
    bytes: u64,
}

/// A folder in the making.
pub(super) struct Folder {
    folder: AtomicFolder,
    normals: bool,
    compress: bool,
    /// The deepest level.
    last: u8,
    rows: Mutex<BTreeMap<u8, Row>>,
}

impl Folder {
    /// For tiles down to a level.
    pub(super) fn create(job: &TilesJob, last: u8) -> Result<Self> {
        let folder = AtomicFolder::create(&job.output, job.overwrite, is_tiles)?;
        let (normals, compress) = (job.normals, job.compress);
        Ok(Self { folder, normals, compress, last, rows: Mutex::default() })
    }

    /// Notes that there is a tile, which is put later: those it is in tell of it.
    pub(super) fn note(&self, TileId { level, x, y }: TileId) {
        lock(&self.rows).entry(level).or_default().tiles.insert((x, y));
    }

    /// What tiles there are in one that has to tell of them, as JSON: places of so many levels below.
    fn below(&self, id: TileId) -> Option<String> {
        if !id.level.is_multiple_of(TOLD_LEVELS) || id.level >= self.last {
            return None;
        }
        let rows = lock(&self.rows);
        let told = (id.level + 1..=(id.level + TOLD_LEVELS).min(self.last)).map(|level| {
            let by = level - id.level;
            let [x, y] = [id.x, id.y].map(|at| (at << by, (at + 1) << by));
            let column = |row: &Row| {
                let tiles = row.tiles.range((x.0, y.0)..(x.1, 0));
                tiles.filter(|(_, at)| (y.0..y.1).contains(at)).copied().collect()
            };
            rectangles(&rows.get(&level).map_or_else(BTreeSet::new, column))
        });
        Some(Value::Array(told.collect()).to_string())
    }

    /// Writes a tile that was noted, as all in it were.
    pub(super) fn put(
        &self,
        tile: &Tile,
        level: &Level,
        ground: &impl terrane_tiles::Ground,
    ) -> Result<()> {
        let bytes = quantized_mesh(
            tile,
            self.normals.then_some((level, ground)),
            self.below(tile.id).as_deref(),
        )?;
        let bytes = if self.compress { packed(&bytes)? } else { bytes };
        let TileId { level, x, y } = tile.id;
        let path = self.folder.inside().join(level.to_string()).join(x.to_string());
        std::fs::create_dir_all(&path).map_err(|e| Error::write(&path, e))?;
        let path = path.join(format!("{y}.{ENDING}"));
        std::fs::write(&path, &bytes).map_err(|e| Error::write(&path, e))?;
        let mut rows = lock(&self.rows);
        let row = rows.entry(level).or_default();
        row.largest = row.largest.max(tile.measure.largest);
        row.samples += tile.measure.samples;
        row.vertices += tile.vertices.len() as u64;
        row.triangles += tile.triangles.len() as u64;
        row.bytes += bytes.len() as u64;
        Ok(())
    }

    /// The tiles of levels before `near` that have one of that level in them, the coarsest first; and both of
    /// level 0, which every client asks for.
    pub(super) fn above(&self, near: u8) -> Vec<TileId> {
        let mut rows = lock(&self.rows);
        let mut found = BTreeSet::new();
        let places = rows.get(&near).into_iter().flat_map(|row| &row.tiles);
        let mut here: BTreeSet<TileId> =
            places.map(|(x, y)| TileId { level: near, x: *x, y: *y }).collect();
        for _ in 0..near {
            here = here.into_iter().filter_map(TileId::parent).collect();
            found.extend(here.iter().copied());
        }
        let roots = [0, 1].map(|x| TileId { level: 0, x, y: 0 });
        let is_there = |id: &TileId| {
            near == 0 && rows.get(&0).is_some_and(|row| row.tiles.contains(&(id.x, id.y)))
        };
        found.extend(roots.into_iter().filter(|id| !is_there(id)));
        found.retain(|id| id.level <= self.last);
        rows.retain(|level, _| *level <= self.last);
        found.iter().for_each(|id| {
            rows.entry(id.level).or_default().tiles.insert((id.x, id.y));
        });
        found.into_iter().collect()
    }

    /// Writes what says what there is, and gives the folder its name.
    pub(super) fn finish(self, ground: &Ground<'_>, cancel: &Cancel) -> Result<TilesReport> {
        let rows = lock(&self.rows).clone();
        let path = self.folder.inside().join(LAYER);
        let mut file = AtomicFile::create(&path, false)?;
        let text = serde_json::to_vec_pretty(&layer(ground, &rows)).unwrap_or_default();
        file.write_all(&text).map_err(|e| Error::write(&path, e))?;
        let bytes = file.commit()?;
        cancel.check()?;
        sync(self.folder.inside());
        self.folder.commit()?;
        let levels = rows.iter().map(|(level, row)| told(ground, *level, row)).collect();
        Ok(TilesReport {
            input: ground.job.input.to_string(),
            output: ground.job.output.display().to_string(),
            crs: ground.grid.info().crs.label(),
            tiles: rows.values().map(|row| row.tiles.len() as u64).sum(),
            samples: u64::from(ground.place.whole[0]) * u64::from(ground.place.whole[1]),
            levels,
            notes: ground.place.notes.clone(),
            output_bytes: bytes + rows.values().map(|row| row.bytes).sum::<u64>(),
            ..TilesReport::default()
        })
    }
}

fn told(ground: &Ground<'_>, level: u8, row: &Row) -> LevelReport {
    LevelReport {
        level,
        tolerance: level_error(level),
        step: ground.levels[usize::from(level)].step,
        error: row.largest,
        tiles: row.tiles.len() as u64,
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
fn layer(ground: &Ground<'_>, rows: &BTreeMap<u8, Row>) -> Value {
    let bounds = &ground.place.bounds;
    let none = BTreeSet::new();
    let last = ground.levels.len() as u8 - 1;
    let tiles = |level: u8| rows.get(&level).map_or(&none, |row| &row.tiles);
    let available: Vec<Value> = (0..=last).map(|level| rectangles(tiles(level))).collect();
    let levels: Vec<Value> = rows
        .iter()
        .map(|(level, row)| {
            let LevelReport { tolerance, step, error, tiles, .. } = told(ground, *level, row);
            json!({"level": level, "tolerance": tolerance, "step": step, "error": error, "tiles": tiles})
        })
        .collect();
    let mut extensions = vec!["metadata"];
    if ground.job.normals {
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
            "sources": ground.job.input.names(),
            "voids": "filled",
            "levels": levels,
        },
    })
}

/// Places of tiles as rectangles: runs of a row, joined with those below that begin and end alike.
fn rectangles(tiles: &BTreeSet<(u32, u32)>) -> Value {
    let mut by_row: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
    for (x, y) in tiles {
        let runs = by_row.entry(*y).or_default();
        match runs.last_mut() {
            Some(run) if run[1] + 1 == *x => run[1] = *x,
            _ => runs.push([*x, *x]),
        }
    }
    let mut found: Vec<[u32; 4]> = Vec::new();
    // By begin and end: the rectangle that reached the row before.
    let mut open: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for (y, runs) in by_row {
        let mut here = BTreeMap::new();
        for run in runs {
            let place = match open.get(&run).filter(|place| found[**place][3] + 1 == y) {
                Some(place) => *place,
                None => {
                    found.push([run[0], y, run[1], y]);
                    found.len() - 1
                }
            };
            found[place][3] = y;
            here.insert(run, place);
        }
        open = here;
    }
    let told = |[x, y, to_x, to_y]: &[u32; 4]| json!({"startX": x, "startY": y, "endX": to_x, "endY": to_y});
    found.iter().map(told).collect()
}

/// True for a folder of tiles that holds nothing else.
fn is_tiles(path: &Path) -> bool {
    let is_own = std::fs::read(path.join(LAYER))
        .ok()
        .and_then(|text| serde_json::from_slice::<Value>(&text).ok())
        .is_some_and(|layer| layer.get("terrane").is_some());
    is_own && holds_tiles_alone(path, 0)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_hold_each_tile_once() {
        let tiles: BTreeSet<(u32, u32)> = (0..400)
            .map(|i| (i % 20, i / 20))
            .filter(|(x, y)| (x * 7 + y * 3) % 11 > 1 || *y > 14)
            .collect();
        let mut seen = BTreeSet::new();
        let told = rectangles(&tiles);
        for rect in told.as_array().unwrap() {
            let end = |key: &str| rect[key].as_u64().unwrap() as u32;
            for y in end("startY")..=end("endY") {
                for x in end("startX")..=end("endX") {
                    assert!(seen.insert((x, y)));
                }
            }
        }
        assert_eq!(seen, tiles);
        assert!(told.as_array().unwrap().len() < tiles.len() / 2);
    }
}
