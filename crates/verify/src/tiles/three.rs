//! `tileset.json` of 3D Tiles, the subtrees it leads to, and the files of such a set.

use std::collections::{HashMap, HashSet};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::folder::{self, Tiles, entries, number};
use super::layer::{Kind, Layer, Level, Range, check_beyond, check_heights, check_levels, text_of};
use super::room::Room;
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_engine::Cancel;
use terrane_proof::tiles::{
    About, Content, ERROR_OF_ROOT, Fault, Faults, MOST_LEVEL, MOST_SUBTREE_LEVELS, Said, Schema,
    Subtree, Tile, TileId,
};

/// The name of the file.
pub(super) const NAME: &str = "tileset.json";

/// Folders of the western and the eastern half of the globe.
const HALVES: [&str; 2] = ["west", "east"];
const TILE: &str = ".glb";
const SUBTREE: &str = ".subtree";

/// Radians that the sides of a region may be off by.
const RADIANS: f64 = 1e-12;

/// Metres that heights of regions may be off by, and parts that errors may: rounding.
const METRES: f64 = 1e-6;
const SHARE: f64 = 1e-6;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Stored {
    asset: Asset,
    schema: Option<Schema>,
    geometric_error: f64,
    root: Root,
    #[serde(default)]
    extras: Extras,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

#[derive(Default, Deserialize)]
struct Extras {
    terrane: Option<Own>,
}

/// What terrane says of its own sets.
#[derive(Deserialize)]
struct Own {
    bounds: [f64; 4],
    normals: bool,
    edges: bool,
    levels: Vec<Level>,
    beyond: Option<String>,
    heights: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Root {
    bounding_volume: Volume,
    geometric_error: f64,
    refine: String,
    children: Vec<Half>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Volume {
    region: [f64; 6],
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Half {
    bounding_volume: Volume,
    geometric_error: f64,
    refine: Option<String>,
    content: Address,
    implicit_tiling: Implicit,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Address {
    uri: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Implicit {
    subdivision_scheme: String,
    subtree_levels: u8,
    available_levels: u8,
    subtrees: Address,
}

/// What only sets of 3D Tiles have.
#[derive(Debug)]
pub(super) struct Three {
    /// What the subtrees tell of tiles.
    about: HashMap<TileId, About>,
    /// The tiles at the tops of subtrees.
    subtrees: HashSet<TileId>,
    /// Lowest and highest of the regions of the whole and of its halves.
    regions: [[f64; 2]; 3],
    /// Errors of the whole, its root and the halves.
    errors: [f64; 3],
    has_edges: bool,
}

/// Reads the file of a set and all of its subtrees, for whose tiles there has to be room.
///
/// # Errors
/// Files that cannot be read or are too long; another kind of tileset; what does not fit together in one.
pub(super) fn read(path: &Path, room: &Room, cancel: &Cancel) -> Result<Layer> {
    let text = text_of(path)?;
    let stored: Stored = serde_json::from_slice(&text).map_err(|e| {
        Error::bad_input(format!("does not describe a set of tiles as terrane makes it: {e}"))
            .in_file(path)
    })?;
    stored.layer(path, room, cancel)
}

impl Stored {
    fn layer(self, path: &Path, room: &Room, cancel: &Cancel) -> Result<Layer> {
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
        let mut three = Three {
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
            of_level.push(Range::one(*id));
        }
        available.iter_mut().for_each(|ranges| ranges.sort_unstable());
        Ok(Layer {
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
            kind: Kind::ThreeTiles(three),
        })
    }

    /// Holds the file to what clients of terrain take.
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
        let is_off = |(volume, [from, to]): &(&Volume, [f64; 2])| {
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
        let of = |half: &Half| {
            (half.implicit_tiling.subtree_levels, half.implicit_tiling.available_levels)
        };
        match of(west) == of(east) {
            true => Ok(()),
            false => Err(Error::bad_input("has halves of different levels")),
        }
    }
}

impl Half {
    fn check(&self, name: &str) -> Result<()> {
        let tiling = &self.implicit_tiling;
        let of = |ending: &str| format!("{name}/{{level}}/{{x}}/{{y}}{ending}");
        let is_known = self.content.uri == of(TILE) && tiling.subtrees.uri == of(SUBTREE);
        if !is_known || tiling.subdivision_scheme != "QUADTREE" {
            let message = format!("has other addresses than {} or is no quadtree", of(TILE));
            return Err(Error::unsupported(message));
        }
        let most = u64::from(MOST_SUBTREE_LEVELS);
        limits::check("subtreeLevels", tiling.subtree_levels.into(), most)?;
        limits::check(
            "availableLevels",
            tiling.available_levels.into(),
            u64::from(MOST_LEVEL) + 1,
        )?;
        match tiling.subtree_levels > 0 && tiling.available_levels > 0 {
            true => Ok(()),
            false => Err(Error::bad_input("has no levels")),
        }
    }
}

impl Three {
    /// Follows the subtrees from the roots on.
    fn collect(
        &mut self,
        folder: &Path,
        (levels, schema): (u8, &Schema),
        most: usize,
        cancel: &Cancel,
    ) -> Result<()> {
        let mut open: Vec<TileId> = [0, 1].map(|x| TileId { level: 0, y: 0, x }).into();
        let mut count = 0;
        while let Some(top) = open.pop() {
            cancel.check()?;
            let path = path_of(folder, top, SUBTREE);
            let (bytes, _) = folder::bytes(&path)?;
            let found = Subtree::read(&bytes, top, levels, schema).map_err(|e| e.in_file(&path))?;
            if top.level + levels > MOST_LEVEL && !found.below.is_empty() {
                return Err(Error::bad_input("leads to levels beyond the last").in_file(&path));
            }
            open.extend(found.below);
            // Of what does not fit all is counted.
            count += found.tiles.len();
            if count <= most {
                self.subtrees.insert(top);
                self.about.extend(found.tiles);
            }
        }
        Room::check(count, most).map_err(|e| e.in_file(folder))
    }

    /// What is told of a tile.
    pub(super) fn about(&self, id: TileId) -> Option<&About> {
        self.about.get(&id)
    }

    /// Reads a tile.
    pub(super) fn read(
        &self,
        folder: &Path,
        id: TileId,
        level: Level,
        fit: impl FnOnce(usize) -> Result<()>,
    ) -> Result<(Tile, bool)> {
        let path = path_of(folder, id, TILE);
        let said = Said {
            step: level.step,
            lattice: level.lattice.unwrap_or_default(),
            has_edges: self.has_edges,
            skirt: level.skirt,
        };
        let (bytes, is_packed) = folder::bytes(&path)?;
        let read = || Content::read(&bytes, fit)?.tile(id, said);
        read().map(|tile| (tile, is_packed)).map_err(|e| e.in_file(&path))
    }

    /// Holds what is told of tiles to what is told of those below, and regions to all of them.
    pub(super) fn check(&self, faults: &mut Faults) {
        for (id, about) in &self.about {
            let whole = id.parent().and_then(|parent| Some((parent, self.about(parent)?)));
            if let Some((parent, _)) = whole.filter(|(_, whole)| !whole.holds(about)) {
                faults.add(Fault::Nested, 1, parent);
            }
        }
        let [whole, west, east] = self.regions;
        let both = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let of_half = |x: u32| {
            let tiles = self.about.iter().filter(|(id, _)| id.x >> id.level == x);
            tiles.map(|(_, about)| about.heights).reduce(both)
        };
        let halves = [of_half(0), of_half(1)];
        let needed = halves.into_iter().flatten().reduce(both);
        let is_other = |(told, needed): ([f64; 2], Option<[f64; 2]>)| {
            needed.is_some_and(|needed| (0..2).any(|end| (told[end] - needed[end]).abs() > METRES))
        };
        let is_off =
            [(whole, needed), (west, halves[0]), (east, halves[1])].into_iter().any(is_other);
        faults.add(Fault::Regions, u64::from(is_off), None);
        let worst = self.about.values().map(|about| about.error).fold(ERROR_OF_ROOT, f64::max);
        let needed = [2.0 * worst, 2.0 * worst, worst];
        let is_other = |(told, needed): (&f64, &f64)| (told / needed - 1.0).abs() > SHARE;
        let is_off = self.errors.iter().zip(&needed).any(is_other);
        faults.add(Fault::RootErrors, u64::from(is_off), None);
    }

    /// Looks through the folder of a set for its files.
    pub(super) fn find(&self, top: &Path, room: &Room, cancel: &Cancel) -> Result<Tiles> {
        let mut found = Tiles::within(room);
        for half in entries(top)? {
            let path = half.path();
            let name = half.file_name();
            match HALVES.iter().position(|known| name == *known).filter(|_| path.is_dir()) {
                Some(x) => self.find_half(&mut found, &path, x as u32, cancel)?,
                None if name == NAME => (),
                None => found.stray(path),
            }
        }
        found.sorted(top)
    }

    fn find_half(
        &self,
        found: &mut Tiles,
        folder: &Path,
        half: u32,
        cancel: &Cancel,
    ) -> Result<()> {
        for level in entries(folder)? {
            let known = number(&level, "").filter(|&level| level <= u32::from(MOST_LEVEL));
            let Some(z) = known.filter(|_| level.path().is_dir()) else {
                found.stray(level.path());
                continue;
            };
            for column in entries(&level.path())? {
                cancel.check()?;
                let known = number(&column, "").filter(|x| *x < 1 << z);
                let Some(x) = known.filter(|_| column.path().is_dir()) else {
                    found.stray(column.path());
                    continue;
                };
                self.column(found, &column.path(), (z as u8, x + (half << z)))?;
            }
        }
        Ok(())
    }

    fn column(&self, found: &mut Tiles, folder: &Path, (level, x): (u8, u32)) -> Result<()> {
        for row in entries(folder)? {
            let id = |ending: &str| number(&row, ending).and_then(|y| TileId::new(level, x, y));
            let path = row.path();
            let is_subtree = id(SUBTREE).is_some_and(|top| self.subtrees.contains(&top));
            match id(TILE) {
                Some(id) if path.is_file() => found.add(id),
                _ if is_subtree && path.is_file() => (),
                _ => found.stray(path),
            }
        }
        Ok(())
    }
}

/// Where a file of a tile is.
fn path_of(folder: &Path, id: TileId, ending: &str) -> PathBuf {
    let TileId { level, x, y } = id;
    let half = HALVES[(x >> level) as usize & 1];
    folder.join(format!("{half}/{level}/{}/{y}{ending}", x & ((1 << level) - 1)))
}
