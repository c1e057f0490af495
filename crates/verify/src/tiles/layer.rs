//! `layer.json`: the metadata of a tileset.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::folder::NAME;
use super::level::{StatedLevel, check_levels};
use super::tiles_3d::{self, ThreeTilesCheck};
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_proof::tiles::{ERROR_OF_ROOT, MAX_LEVEL, ProofTileId};
use terrane_tiles::{AS_GIVEN, ON_ELLIPSOID, WITH_GEOID};

/// A file as it is written.
#[derive(Debug, Deserialize)]
struct StoredLayerJson {
    format: String,
    scheme: Option<String>,
    projection: Option<String>,
    tiles: Vec<String>,
    bounds: Option<[f64; 4]>,
    #[serde(default)]
    minzoom: u8,
    maxzoom: Option<u8>,
    available: Option<Vec<Vec<TileRange>>>,
    #[serde(rename = "metadataAvailability")]
    told_every: Option<u8>,
    #[serde(default)]
    extensions: Vec<String>,
    terrane: Option<TerraneLayerExtras>,
}

/// A rectangle of tiles that are there.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord)]
#[serde(rename_all = "camelCase")]
pub(super) struct TileRange {
    start_x: u32,
    start_y: u32,
    end_x: u32,
    end_y: u32,
}

/// terrane's own metadata in a tileset.
#[derive(Debug, Deserialize)]
struct TerraneLayerExtras {
    levels: Vec<StatedLevel>,
    beyond: Option<String>,
    heights: Option<String>,
}

/// Promises of a tileset.
#[derive(Debug)]
pub(super) struct TilesetPromises {
    /// The folder of the tiles.
    pub(super) folder: PathBuf,
    /// West, south, east and north in degrees.
    pub(super) bounds: Option<[f64; 4]>,
    pub(super) finest: u8,
    /// By level.
    pub(super) available: Vec<Vec<TileRange>>,
    pub(super) has_normals: bool,
    pub(super) has_metadata: bool,
    /// Tiles have masks of water.
    pub(super) has_water: bool,
    /// Levels between tiles with availability metadata, if the set has any.
    pub(super) told_every: Option<u8>,
    /// By level, where terrane made it.
    pub(super) levels: Option<Vec<StatedLevel>>,
    /// Metres that clients take level 0 to be off by.
    pub(super) assumed: f64,
    /// The ground beyond the raster falls to the ellipsoid.
    pub(super) tapers: bool,
    /// The geoid was added to heights; where it is said.
    pub(super) has_geoid: Option<bool>,
    /// Extensions that are named and not known here.
    pub(super) unknown: Vec<String>,
    pub(super) kind: TilesetKind,
}

/// The format of a set.
#[derive(Debug)]
pub(super) enum TilesetKind {
    QuantizedMesh,
    ThreeTiles(ThreeTilesCheck),
}

impl TilesetPromises {
    /// The tolerance of a level in metres: the stated one, or else the assumption of clients.
    pub(super) fn tolerance(&self, level: u8) -> f64 {
        self.own(level).map_or(self.assumed(level), |own| own.tolerance)
    }

    /// Metres that borders of a level may differ by: the assumption of clients, or a step of heights where that is
    /// larger.
    pub(super) fn apart(&self, level: u8) -> f64 {
        self.assumed(level).max(self.own(level).map_or(0.0, |own| own.step))
    }

    /// Metres that clients take a level to be off by.
    pub(super) fn assumed(&self, level: u8) -> f64 {
        self.assumed / 2_f64.powi(i32::from(level))
    }

    /// The name of its file.
    pub(super) fn name(&self) -> &'static str {
        match self.kind {
            TilesetKind::QuantizedMesh => NAME,
            TilesetKind::ThreeTiles(_) => tiles_3d::NAME,
        }
    }

    /// Metadata of 3D Tiles only.
    pub(super) fn three(&self) -> Option<&ThreeTilesCheck> {
        match &self.kind {
            TilesetKind::QuantizedMesh => None,
            TilesetKind::ThreeTiles(three) => Some(three),
        }
    }

    /// terrane's own metadata of a level.
    pub(super) fn own(&self, level: u8) -> Option<StatedLevel> {
        self.levels.as_ref()?.get(usize::from(level)).copied()
    }

    /// Tiles of a level that are said to be there, by rectangles; some may come twice.
    pub(super) fn available(&self, level: u8) -> impl Iterator<Item = ProofTileId> {
        let ranges = self.available.get(usize::from(level)).into_iter().flatten();
        tiles_of(level, ranges)
    }
}

impl TileRange {
    /// One tile.
    pub(super) fn one(id: ProofTileId) -> Self {
        Self { start_x: id.x, start_y: id.y, end_x: id.x, end_y: id.y }
    }

    /// How many tiles it has; none where it ends before it begins.
    pub(super) fn count(&self) -> u64 {
        let along = |start: u32, end: u32| (u64::from(end) + 1).saturating_sub(u64::from(start));
        along(self.start_x, self.end_x).saturating_mul(along(self.start_y, self.end_y))
    }
}

/// The tiles of rectangles, in their order.
pub(super) fn tiles_of<'a>(
    level: u8,
    ranges: impl IntoIterator<Item = &'a TileRange>,
) -> impl Iterator<Item = ProofTileId> {
    ranges.into_iter().flat_map(move |range| {
        let rows = range.start_y..=range.end_y;
        rows.flat_map(move |y| {
            (range.start_x..=range.end_x).map(move |x| ProofTileId { level, y, x })
        })
    })
}

/// The text of the file of a set.
pub(super) fn text_of(path: &Path) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::read(path, e))?;
    let mut text = Vec::new();
    let most = limits::MAX_HEADER_BYTES;
    file.take(most + 1).read_to_end(&mut text).map_err(|e| Error::read(path, e))?;
    limits::check("length of the file", text.len() as u64, most).map_err(|e| e.in_file(path))?;
    Ok(text)
}

/// Reads `layer.json`.
///
/// # Errors
/// As [`TilesetPromises::read`], but without the file.
pub(super) fn read(path: &Path) -> Result<TilesetPromises> {
    let text = text_of(path)?;
    let stored: StoredLayerJson = serde_json::from_slice(&text).map_err(|e| {
        Error::bad_input(format!("does not describe a set of terrain tiles: {e}"))
            .remedy("name the folder of a set, or its layer.json")
    })?;
    stored.layer(path)
}

impl StoredLayerJson {
    fn layer(self, path: &Path) -> Result<TilesetPromises> {
        self.check_kind()?;
        let Some(available) = self.available else {
            return Err(Error::bad_input("does not say which tiles are available"));
        };
        let listed = u8::try_from(available.len()).unwrap_or(u8::MAX).saturating_sub(1);
        let finest = self.maxzoom.unwrap_or(listed);
        limits::check("maxzoom", u64::from(finest), u64::from(MAX_LEVEL))?;
        if self.minzoom != 0 || usize::from(finest) + 1 != available.len() {
            let message = format!(
                "has levels {} to {finest}, and tiles available of {} levels",
                self.minzoom,
                available.len()
            );
            return Err(Error::bad_input(message).remedy("levels begin with 0 and are all there"));
        }
        (0..).zip(&available).try_for_each(|(level, ranges)| check_ranges(level, ranges))?;
        let beyond = self.terrane.as_ref().and_then(|own| own.beyond.as_deref());
        let tapers = check_beyond(beyond)?;
        let heights = self.terrane.as_ref().and_then(|own| own.heights.as_deref());
        let has_geoid = check_heights(heights)?;
        let levels = self.terrane.map(|own| check_levels(own.levels, finest)).transpose()?;
        if self.told_every == Some(0) {
            return Err(Error::bad_input("has tiles tell of what is below them every 0 levels"));
        }
        const KNOWN: [&str; 3] = ["octvertexnormals", "metadata", "watermask"];
        let announces = |name: &str| self.extensions.iter().any(|own| own == name);
        let unknown = self.extensions.iter().filter(|name| !KNOWN.contains(&name.as_str()));
        Ok(TilesetPromises {
            folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
            bounds: self.bounds,
            finest,
            available,
            unknown: unknown.cloned().collect(),
            has_normals: announces(KNOWN[0]),
            has_metadata: announces(KNOWN[1]),
            has_water: announces(KNOWN[2]),
            told_every: self.told_every,
            levels,
            assumed: ERROR_OF_ROOT,
            tapers,
            has_geoid,
            kind: TilesetKind::QuantizedMesh,
        })
    }

    fn check_kind(&self) -> Result<()> {
        let refuse = |what: &str, found: &str, known: &str| {
            let message = format!("has the {what} \"{found}\", and only \"{known}\" can be proved");
            Err(Error::unsupported(message))
        };
        let is = |found: &Option<String>, known| found.as_deref().unwrap_or(known) == known;
        if self.format != "quantized-mesh-1.0" {
            return refuse("format", &self.format, "quantized-mesh-1.0");
        }
        if !is(&self.scheme, "tms") {
            return refuse("scheme", self.scheme.as_deref().unwrap_or_default(), "tms");
        }
        if !is(&self.projection, "EPSG:4326") {
            let found = self.projection.as_deref().unwrap_or_default();
            return refuse("projection", found, "EPSG:4326");
        }
        let known = "{z}/{x}/{y}.terrain";
        match self.tiles.first().map(|all| all.split('?').next().unwrap_or_default()) {
            Some(found) if found.trim_start_matches("./") == known => Ok(()),
            Some(found) => refuse("address of tiles", found, known),
            None => Err(Error::bad_input("does not say where tiles are")),
        }
    }
}

fn check_ranges(level: u8, ranges: &[TileRange]) -> Result<()> {
    let is_right = |range: &&TileRange| {
        let end = ProofTileId::new(level, range.end_x, range.end_y);
        end.is_some() && range.start_x <= range.end_x && range.start_y <= range.end_y
    };
    match ranges.iter().find(|range| !is_right(range)) {
        None => Ok(()),
        Some(range) => Err(Error::bad_input(format!(
            "has columns {} to {} and rows {} to {} available, which level {level} does not have",
            range.start_x, range.end_x, range.start_y, range.end_y
        ))),
    }
}

/// Whether the ground beyond the raster falls, as terrane says it.
///
/// # Errors
/// Another word than terrane has for it.
pub(super) fn check_beyond(beyond: Option<&str>) -> Result<bool> {
    match beyond {
        None | Some("level") => Ok(false),
        Some("taper") => Ok(true),
        Some(other) => {
            let message = format!("states {other:?} of the ground beyond the raster");
            Err(Error::unsupported(message).remedy("taper and level are known"))
        }
    }
}

/// Whether a geoid was added to the heights, by the stated vertical reference of the set.
///
/// # Errors
/// Another word than terrane has for it.
pub(super) fn check_heights(heights: Option<&str>) -> Result<Option<bool>> {
    let known = [WITH_GEOID, ON_ELLIPSOID, AS_GIVEN];
    match heights {
        Some(other) if !known.contains(&other) => {
            let message = format!("states {other:?} of what heights are counted from");
            Err(Error::unsupported(message).remedy(format!("known are: {}", known.join("; "))))
        }
        _ => Ok(heights.map(|heights| heights == WITH_GEOID)),
    }
}
