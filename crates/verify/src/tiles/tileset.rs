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

/// Radians that the sides of a region may be off by.
const RADIANS: f64 = 1e-12;

/// Where the file of a set would be: the path itself, or in it where that is a folder.
pub(super) fn place(path: &Path) -> PathBuf {
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
    pub(super) fn read(path: &Path, room: &TilesProofMemory, cancel: &Cancel) -> Result<Self> {
        let path = place(path);
        if path.file_name().is_some_and(|name| name == tiles_3d::NAME) {
            return read_tileset(&path, room, cancel);
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
fn read_tileset(path: &Path, room: &TilesProofMemory, cancel: &Cancel) -> Result<TilesetPromises> {
    let text = text_of(path)?;
    let stored: StoredTilesetJson = serde_json::from_slice(&text).map_err(|e| {
        Error::bad_input(format!("does not describe a set of tiles as terrane makes it: {e}"))
            .in_file(path)
    })?;
    stored.layer(path, room, cancel)
}

impl StoredTilesetJson {
    fn layer(
        self,
        path: &Path,
        room: &TilesProofMemory,
        cancel: &Cancel,
    ) -> Result<TilesetPromises> {
        let of_file = |e: Error| e.in_file(path);
        self.check().map_err(of_file)?;
        let (Some(schema), Some(own)) = (self.schema, self.extras.terrane) else {
            let message = "does not say what terrane says of its own sets: schema and steps";
            return Err(of_file(Error::unsupported(message)));
        };
        let [west, east] = &self.root.children[..] else {
            return Err(of_file(Error::bad_input("has not two halves of the globe")));
        };
        let tiling = &west.implicit_tiling;
        let finest = tiling.available_levels - 1;
        let levels = check_levels(own.levels, finest).map_err(of_file)?;
        if levels.iter().any(|own| own.lattice.is_none_or(|lattice| lattice <= 0.0)) {
            return Err(of_file(Error::bad_input("states no lattice of a level")));
        }
        let regions = [&self.root.bounding_volume, &west.bounding_volume, &east.bounding_volume];
        let mut three = ThreeTilesCheck {
            about: HashMap::new(),
            subtrees: HashSet::new(),
            regions: regions.map(|volume| [volume.region[4], volume.region[5]]),
            errors: [self.geometric_error, self.root.geometric_error, west.geometric_error],
            has_edges: own.edges,
        };
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        three.collect(&folder, (tiling.subtree_levels, &schema), room.tiles(), cancel)?;
        let mut available = vec![Vec::new(); usize::from(finest) + 1];
        for id in three.about.keys() {
            let of_level = available.get_mut(usize::from(id.level)).ok_or_else(|| {
                of_file(Error::bad_input(format!("has tile {id}, beyond level {finest}")))
            })?;
            of_level.push(TileRange::one(*id));
        }
        available.iter_mut().for_each(|ranges| ranges.sort_unstable());
        Ok(TilesetPromises {
            folder,
            bounds: Some(own.bounds),
            finest,
            available,
            has_normals: own.normals,
            has_metadata: false,
            has_water: false,
            told_every: None,
            levels: Some(levels),
            assumed: ERROR_OF_ROOT,
            tapers: check_beyond(own.beyond.as_deref()).map_err(of_file)?,
            has_geoid: check_heights(own.heights.as_deref()).map_err(of_file)?,
            unknown: Vec::new(),
            kind: TilesetKind::ThreeTiles(three),
        })
    }

    /// Checks that clients of terrain can read the file.
    fn check(&self) -> Result<()> {
        let Self { asset, geometric_error, root, .. } = self;
        if asset.version != "1.1" {
            let found = &asset.version;
            return Err(Error::unsupported(format!("is of 3D Tiles {found:?}, not 1.1")));
        }
        let is_replaced = |refine: &str| refine == "REPLACE";
        let [west, east] = &root.children[..] else {
            let count = root.children.len();
            return Err(Error::unsupported(format!("has {count} roots, not west and east")));
        };
        let reaches = [
            (&root.bounding_volume, [-PI, PI]),
            (&west.bounding_volume, [-PI, 0.0]),
            (&east.bounding_volume, [0.0, PI]),
        ];
        let is_off = |(volume, [from, to]): &(&BoundingVolume, [f64; 2])| {
            let sides = [*from, -FRAC_PI_2, *to, FRAC_PI_2];
            sides.iter().zip(volume.region).any(|(a, b)| (a - b).abs() > RADIANS)
        };
        if reaches.iter().any(is_off) {
            return Err(Error::bad_input("has regions that are not the globe and its halves"));
        }
        let halves = [west, east];
        let errors = halves.map(|half| half.geometric_error);
        let grows = errors.iter().any(|error| *error > root.geometric_error);
        if grows || root.geometric_error > *geometric_error || errors[0] != errors[1] {
            return Err(Error::bad_input("has geometric errors that grow from the root on"));
        }
        for (half, name) in halves.into_iter().zip(HALVES) {
            half.check(name)?;
        }
        let refines = halves.iter().filter_map(|half| half.refine.as_deref());
        if !refines.chain([&*root.refine]).all(is_replaced) {
            return Err(Error::unsupported("refines tiles other than by replacing them"));
        }
        let of = |half: &HalfAxis| {
            (half.implicit_tiling.subtree_levels, half.implicit_tiling.available_levels)
        };
        match of(west) == of(east) {
            true => Ok(()),
            false => Err(Error::bad_input("has halves of different levels")),
        }
    }
}

impl HalfAxis {
    fn check(&self, name: &str) -> Result<()> {
        let tiling = &self.implicit_tiling;
        let of = |ending: &str| format!("{name}/{{level}}/{{x}}/{{y}}{ending}");
        let is_known = self.content.uri == of(TILE) && tiling.subtrees.uri == of(SUBTREE);
        if !is_known || tiling.subdivision_scheme != "QUADTREE" {
            let message = format!("has other addresses than {} or is no quadtree", of(TILE));
            return Err(Error::unsupported(message));
        }
        let most = u64::from(MAX_SUBTREE_LEVELS);
        limits::check("subtreeLevels", tiling.subtree_levels.into(), most)?;
        limits::check("availableLevels", tiling.available_levels.into(), u64::from(MAX_LEVEL) + 1)?;
        match tiling.subtree_levels > 0 && tiling.available_levels > 0 {
            true => Ok(()),
            false => Err(Error::bad_input("has no levels")),
        }
    }
}
