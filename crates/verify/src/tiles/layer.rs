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

/// Supported address of tiles.
const ADDRESS: &str = "{z}/{x}/{y}.terrain";

/// The members of `layer.json`.
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
    metadata_interval: Option<u8>,
    #[serde(default)]
    extensions: Vec<String>,
    terrane: Option<TerraneLayerExtras>,
}

/// A rectangle of available tiles.
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
    pub(super) metadata_interval: Option<u8>,
    /// terrane's own metadata, by level.
    pub(super) levels: Option<Vec<StatedLevel>>,
    /// Error of level 0 that clients assume, in metres.
    pub(super) assumed: f64,
    /// The ground beyond the raster falls to the ellipsoid.
    pub(super) tapers: bool,
    /// The geoid was added to heights; `None` if the set does not state it.
    pub(super) has_geoid: Option<bool>,
    /// Unknown extensions.
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
        self.stated(level).map_or(self.assumed(level), |stated| stated.tolerance)
    }

    /// Metres that borders of a level may differ by: the assumption of clients, or a step of heights where that is
    /// larger.
    pub(super) fn border_error(&self, level: u8) -> f64 {
        self.assumed(level).max(self.stated(level).map_or(0.0, |stated| stated.step))
    }

    /// Error of a level that clients assume, in metres.
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
    pub(super) fn three_tiles(&self) -> Option<&ThreeTilesCheck> {
        match &self.kind {
            TilesetKind::QuantizedMesh => None,
            TilesetKind::ThreeTiles(three) => Some(three),
        }
    }

    /// terrane's own metadata of a level.
    pub(super) fn stated(&self, level: u8) -> Option<StatedLevel> {
        self.levels.as_ref()?.get(usize::from(level)).copied()
    }

    /// Available tiles of a level, by rectangles; some may come twice.
    pub(super) fn available(&self, level: u8) -> impl Iterator<Item = ProofTileId> {
        let ranges = self.available.get(usize::from(level)).into_iter().flatten();
        tiles_of(level, ranges)
    }
}

impl TileRange {
    /// A rectangle of one tile.
    pub(super) fn of_tile(id: ProofTileId) -> Self {
        Self { start_x: id.x, start_y: id.y, end_x: id.x, end_y: id.y }
    }

    /// Number of tiles.
    pub(super) fn count(&self) -> u64 {
        length(self.start_x, self.end_x).saturating_mul(length(self.start_y, self.end_y))
    }

    /// Whether all its tiles exist in the tiling.
    fn is_valid(&self, level: u8) -> bool {
        let end = ProofTileId::new(level, self.end_x, self.end_y);
        end.is_some() && self.start_x <= self.end_x && self.start_y <= self.end_y
    }
}

/// Length of an inclusive range; 0 if it ends before it begins.
fn length(start: u32, end: u32) -> u64 {
    (u64::from(end) + 1).saturating_sub(u64::from(start))
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
    let max = limits::MAX_HEADER_BYTES;
    file.take(max + 1).read_to_end(&mut text).map_err(|e| Error::read(path, e))?;
    limits::check("length of the file", text.len() as u64, max).map_err(|e| e.in_file(path))?;
    Ok(text)
}

/// Reads `layer.json`.
///
/// # Errors
/// As [`TilesetPromises::read`], but without the file.
pub(super) fn read(path: &Path) -> Result<TilesetPromises> {
    let text = text_of(path)?;
    let stored: StoredLayerJson = serde_json::from_slice(&text).map_err(|e| {
        Error::bad_input(format!("not a description of terrain tiles: {e}"))
            .remedy("pass the folder of a tileset, or its layer.json")
    })?;
    stored.layer(path)
}

impl StoredLayerJson {
    fn layer(self, path: &Path) -> Result<TilesetPromises> {
        self.check_kind()?;
        let Some(available) = self.available else {
            return Err(Error::bad_input("list of available tiles is missing"));
        };
        let listed = u8::try_from(available.len()).unwrap_or(u8::MAX).saturating_sub(1);
        let finest = self.maxzoom.unwrap_or(listed);
        limits::check("maxzoom", u64::from(finest), u64::from(MAX_LEVEL))?;
        if self.minzoom != 0 || usize::from(finest) + 1 != available.len() {
            let message = format!(
                "levels {} to {finest} with available tiles of {} levels; expected all levels from 0",
                self.minzoom,
                available.len()
            );
            return Err(Error::bad_input(message));
        }
        (0..).zip(&available).try_for_each(|(level, ranges)| check_ranges(level, ranges))?;
        let beyond = self.terrane.as_ref().and_then(|extras| extras.beyond.as_deref());
        let tapers = check_beyond(beyond)?;
        let heights = self.terrane.as_ref().and_then(|extras| extras.heights.as_deref());
        let has_geoid = check_heights(heights)?;
        let levels = self.terrane.map(|extras| check_levels(extras.levels, finest)).transpose()?;
        if self.metadata_interval == Some(0) {
            return Err(Error::bad_input("metadataAvailability is 0, expected at least 1"));
        }
        const KNOWN: [&str; 3] = ["octvertexnormals", "metadata", "watermask"];
        let [has_normals, has_metadata, has_water] =
            KNOWN.map(|name| self.extensions.iter().any(|extension| extension == name));
        let unknown = self.extensions.iter().filter(|name| !KNOWN.contains(&name.as_str()));
        Ok(TilesetPromises {
            folder: path.parent().unwrap_or(Path::new("")).to_path_buf(),
            bounds: self.bounds,
            finest,
            available,
            unknown: unknown.cloned().collect(),
            has_normals,
            has_metadata,
            has_water,
            metadata_interval: self.metadata_interval,
            levels,
            assumed: ERROR_OF_ROOT,
            tapers,
            has_geoid,
            kind: TilesetKind::QuantizedMesh,
        })
    }

    fn check_kind(&self) -> Result<()> {
        check_value("format", &self.format, "quantized-mesh-1.0")?;
        check_value("scheme", self.scheme.as_deref().unwrap_or("tms"), "tms")?;
        let projection = self.projection.as_deref().unwrap_or("EPSG:4326");
        check_value("projection", projection, "EPSG:4326")?;
        let Some(address) = self.tiles.first() else {
            return Err(Error::bad_input("address of tiles is missing"));
        };
        let address = address.split('?').next().unwrap_or_default();
        check_value("address of tiles", address.trim_start_matches("./"), ADDRESS)
    }
}

/// Fails for a value that is not supported.
fn check_value(name: &str, value: &str, supported: &str) -> Result<()> {
    match value == supported {
        true => Ok(()),
        false => Err(Error::unsupported(format!(
            "unsupported {name} \"{value}\"; supported: \"{supported}\""
        ))),
    }
}

fn check_ranges(level: u8, ranges: &[TileRange]) -> Result<()> {
    match ranges.iter().find(|range| !range.is_valid(level)) {
        None => Ok(()),
        Some(range) => Err(Error::bad_input(format!(
            "available columns {} to {} and rows {} to {} exceed those of level {level}",
            range.start_x, range.end_x, range.start_y, range.end_y
        ))),
    }
}

/// Whether the ground beyond the raster falls to the ellipsoid, by terrane's own metadata.
///
/// # Errors
/// An unknown value.
pub(super) fn check_beyond(beyond: Option<&str>) -> Result<bool> {
    match beyond {
        None | Some("level") => Ok(false),
        Some("taper") => Ok(true),
        Some(other) => {
            let message = format!("unsupported ground beyond the raster {other:?}");
            Err(Error::unsupported(message).remedy("supported: taper, level"))
        }
    }
}

/// Whether a geoid was added to the heights, by the stated vertical reference of the set.
///
/// # Errors
/// An unknown value.
pub(super) fn check_heights(heights: Option<&str>) -> Result<Option<bool>> {
    let known = [WITH_GEOID, ON_ELLIPSOID, AS_GIVEN];
    match heights {
        Some(other) if !known.contains(&other) => {
            let message = format!("unsupported vertical reference {other:?}");
            Err(Error::unsupported(message).remedy(format!("supported: {}", known.join("; "))))
        }
        _ => Ok(heights.map(|heights| heights == WITH_GEOID)),
    }
}
