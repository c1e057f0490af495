//! `tileset.json`, the metadata of a 3D Tiles set; and the metadata file of a set of either format.

use std::collections::{HashMap, HashSet};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::folder;
use super::layer::{
    self, TileRange, TilesetKind, TilesetPromises, check_beyond, check_heights, text_of,
};
use super::level::{StatedLevel, check_levels};
use super::memory_shares::TilesProofMemory;
use super::tiles_3d::{self, HALVES, SUBTREE, TILE, ThreeTilesCheck};
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_engine::Cancel;
use terrane_proof::tiles::{ERROR_OF_ROOT, MAX_LEVEL, MAX_SUBTREE_LEVELS, MetadataSchema};

/// Rounding of the sides of a region, in radians.
const RADIANS: f64 = 1e-12;

/// Path of the file that describes a tileset: the path itself, or the file in it if it is a folder.
pub(super) fn file_of(path: &Path) -> PathBuf {
    match path.is_dir() {
        true if path.join(tiles_3d::NAME).is_file() && !path.join(folder::NAME).exists() => {
            path.join(tiles_3d::NAME)
        }
        true => path.join(folder::NAME),
        false => path.to_path_buf(),
    }
}

impl TilesetPromises {
    /// Reads the file of a tileset, given its folder or the file itself; for 3D Tiles also the subtrees, within a
    /// limit of tiles by memory.
    ///
    /// # Errors
    /// A file that cannot be read, is too long, is not JSON or lacks a required member; another format,
    /// scheme or projection; levels beyond the finest supported one.
    pub(super) fn read(path: &Path, memory: &TilesProofMemory, cancel: &Cancel) -> Result<Self> {
        let path = file_of(path);
        if path.file_name().is_some_and(|name| name == tiles_3d::NAME) {
            return read_tileset(&path, memory, cancel);
        }
        layer::read(&path).map_err(|e| e.in_file(&path))
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct StoredTilesetJson {
    asset: TilesetAsset,
    schema: Option<MetadataSchema>,
    geometric_error: f64,
    root: TilesetRoot,
    #[serde(default)]
    extras: TilesetExtras,
}

#[derive(Deserialize)]
struct TilesetAsset {
    version: String,
}

#[derive(Default, Deserialize)]
struct TilesetExtras {
    terrane: Option<TerraneTilesetExtras>,
}

/// terrane's own metadata in a tileset.
#[derive(Deserialize)]
struct TerraneTilesetExtras {
    bounds: [f64; 4],
    normals: bool,
    edges: bool,
    levels: Vec<StatedLevel>,
    beyond: Option<String>,
    heights: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct TilesetRoot {
    bounding_volume: BoundingVolume,
    geometric_error: f64,
    refine: String,
    children: Vec<HalfAxis>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoundingVolume {
    region: [f64; 6],
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct HalfAxis {
    bounding_volume: BoundingVolume,
    geometric_error: f64,
    refine: Option<String>,
    content: TileAddress,
    implicit_tiling: ImplicitTiling,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TileAddress {
    uri: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct ImplicitTiling {
    subdivision_scheme: String,
    subtree_levels: u8,
    available_levels: u8,
    subtrees: TileAddress,
}

/// Reads the file of a tileset and all of its subtrees, within a limit of tiles by memory.
///
/// # Errors
/// Files that cannot be read or are too long; another kind of tileset; inconsistent metadata.
fn read_tileset(
    path: &Path,
    memory: &TilesProofMemory,
    cancel: &Cancel,
) -> Result<TilesetPromises> {
    let text = text_of(path)?;
    let stored: StoredTilesetJson = serde_json::from_slice(&text).map_err(|e| {
        Error::bad_input(format!("not a description of terrane's 3D Tiles: {e}")).in_file(path)
    })?;
    stored.layer(path, memory, cancel)
}

impl StoredTilesetJson {
    fn layer(
        self,
        path: &Path,
        memory: &TilesProofMemory,
        cancel: &Cancel,
    ) -> Result<TilesetPromises> {
        let in_file = |e: Error| e.in_file(path);
        self.check().map_err(in_file)?;
        let (Some(schema), Some(extras)) = (self.schema, self.extras.terrane) else {
            let message = "terrane's own metadata (schema and extras) is missing";
            return Err(in_file(Error::unsupported(message)));
        };
        let [west, east] = &self.root.children[..] else {
            return Err(in_file(Error::bad_input("halves of the globe are missing")));
        };
        let tiling = &west.implicit_tiling;
        let finest = tiling.available_levels - 1;
        let levels = check_levels(extras.levels, finest).map_err(in_file)?;
        let mut all = (0..).zip(&levels);
        if let Some((level, _)) = all.find(|(_, stated)| stated.lattice.is_none_or(|l| l <= 0.0)) {
            let message = format!("lattice of level {level} is missing or 0");
            return Err(in_file(Error::bad_input(message)));
        }
        let regions = [&self.root.bounding_volume, &west.bounding_volume, &east.bounding_volume];
        let mut three = ThreeTilesCheck {
            metadata: HashMap::new(),
            subtrees: HashSet::new(),
            regions: regions.map(|volume| [volume.region[4], volume.region[5]]),
            errors: [self.geometric_error, self.root.geometric_error, west.geometric_error],
            has_edges: extras.edges,
        };
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        three.collect(&folder, tiling.subtree_levels, &schema, memory.tiles(), cancel)?;
        let mut available = vec![Vec::new(); usize::from(finest) + 1];
        for id in three.metadata.keys() {
            let Some(of_level) = available.get_mut(usize::from(id.level)) else {
                return Err(in_file(Error::bad_input(format!(
                    "tile {id} is beyond level {finest}"
                ))));
            };
            of_level.push(TileRange::of_tile(*id));
        }
        // Hash maps have no order of their own.
        available.iter_mut().for_each(|ranges| ranges.sort_unstable());
        Ok(TilesetPromises {
            folder,
            bounds: Some(extras.bounds),
            finest,
            available,
            has_normals: extras.normals,
            has_metadata: false,
            has_water: false,
            metadata_interval: None,
            levels: Some(levels),
            assumed: ERROR_OF_ROOT,
            tapers: check_beyond(extras.beyond.as_deref()).map_err(in_file)?,
            has_geoid: check_heights(extras.heights.as_deref()).map_err(in_file)?,
            unknown: Vec::new(),
            kind: TilesetKind::ThreeTiles(three),
        })
    }

    /// Checks that clients of terrain can read the file.
    fn check(&self) -> Result<()> {
        let Self { asset, geometric_error, root, .. } = self;
        if asset.version != "1.1" {
            let message = format!("unsupported version {:?} of 3D Tiles, not 1.1", asset.version);
            return Err(Error::unsupported(message));
        }
        let [west, east] = &root.children[..] else {
            let count = root.children.len();
            return Err(Error::unsupported(format!("{count} roots, expected west and east")));
        };
        let is_right = root.bounding_volume.reaches(-PI, PI)
            && west.bounding_volume.reaches(-PI, 0.0)
            && east.bounding_volume.reaches(0.0, PI);
        if !is_right {
            return Err(Error::bad_input("bounding regions are not the globe and its halves"));
        }
        let halves = [west, east];
        let errors = halves.map(|half| half.geometric_error);
        let grows = errors.iter().any(|error| *error > root.geometric_error);
        if grows || root.geometric_error > *geometric_error || errors[0] != errors[1] {
            return Err(Error::bad_input("geometric errors grow from the root on"));
        }
        for (half, name) in halves.into_iter().zip(HALVES) {
            half.check(name)?;
        }
        let refines = halves.iter().filter_map(|half| half.refine.as_deref());
        if refines.chain([&*root.refine]).any(|refine| refine != "REPLACE") {
            return Err(Error::unsupported("refinement other than by replacing (REPLACE)"));
        }
        let [a, b] = halves.map(|half| &half.implicit_tiling);
        match a.subtree_levels == b.subtree_levels && a.available_levels == b.available_levels {
            true => Ok(()),
            false => Err(Error::bad_input("the halves of the globe differ in their levels")),
        }
    }
}

impl BoundingVolume {
    /// Whether the region reaches from pole to pole between two longitudes, in radians.
    fn reaches(&self, west: f64, east: f64) -> bool {
        let sides = [west, -FRAC_PI_2, east, FRAC_PI_2];
        sides.iter().zip(self.region).all(|(a, b)| (a - b).abs() <= RADIANS)
    }
}

impl HalfAxis {
    fn check(&self, name: &str) -> Result<()> {
        let tiling = &self.implicit_tiling;
        let [tile, subtree] =
            [TILE, SUBTREE].map(|ending| format!("{name}/{{level}}/{{x}}/{{y}}{ending}"));
        if self.content.uri != tile || tiling.subtrees.uri != subtree {
            let message = format!("addresses other than {tile} and {subtree}");
            return Err(Error::unsupported(message));
        }
        if tiling.subdivision_scheme != "QUADTREE" {
            return Err(Error::unsupported("subdivision scheme is not QUADTREE"));
        }
        let max = u64::from(MAX_SUBTREE_LEVELS);
        limits::check("subtreeLevels", tiling.subtree_levels.into(), max)?;
        limits::check("availableLevels", tiling.available_levels.into(), u64::from(MAX_LEVEL) + 1)?;
        match tiling.subtree_levels > 0 && tiling.available_levels > 0 {
            true => Ok(()),
            false => Err(Error::bad_input("subtreeLevels or availableLevels is 0")),
        }
    }
}
