//! Tiles by themselves and beside others: each is read once for itself, and its sides again for its neighbours.

use std::sync::{Arc, Mutex};

use serde::Deserialize;

use super::availability::TileDescendants;
use super::cache::TileCache;
use super::context::{TilesProofContext, decoded};
use super::folder;
use super::layer::TileRange;
use terrane_base::error::{Error, Result};
use terrane_engine::workers;
use terrane_files::lock;
use terrane_proof::tiles::{
    DecodedTile, MaskPixels, ProofTileId, ProofTileSide, StatedTileMetadata, TileFacets,
    TileSideChain, TilesetFault, TilesetFaults, between, contain, gap, lattice, lowest, structure,
    tight,
};

/// Tiles that a thread takes at a time, along a row.
const RUN: u64 = 64;

/// Record of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileRecord {
    /// The error that it records.
    pub(super) error: Option<f64>,
    /// Its lowest and highest vertex.
    pub(super) heights: [f64; 2],
    /// The radius that a sphere around it has to have.
    pub(super) radius: f64,
}

/// Borders of one kind on a level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LevelBorders {
    /// Compared sides.
    pub(super) compared: u64,
    /// Sides without a tile beyond.
    pub(super) alone: u64,
    /// Sides that differ, or have too large a gap.
    pub(super) broken: u64,
    /// The largest gap in metres, and the tile that has it, the first of several.
    pub(super) gap: Option<(f64, ProofTileId)>,
}

impl LevelBorders {
    fn add(&mut self, apart: f64, is_broken: bool, at: ProofTileId) {
        self.compared += 1;
        self.broken += u64::from(is_broken);
        self.widen((apart, at));
    }

    fn widen(&mut self, found: (f64, ProofTileId)) {
        let is_less = |known: &(f64, ProofTileId)| {
            found.0.total_cmp(&known.0).then(known.1.cmp(&found.1)).is_lt()
        };
        self.gap = Some(self.gap.filter(|known| is_less(known)).unwrap_or(found));
    }

    fn merge(&mut self, other: &Self) {
        self.compared += other.compared;
        self.alone += other.alone;
        self.broken += other.broken;
        if let Some(found) = other.gap {
            self.widen(found);
        }
    }
}

/// Findings on tiles alone and next to others.
#[derive(Clone, Debug, Default)]
pub(super) struct SingleTileFindings {
    pub(super) faults: TilesetFaults,
    /// By level: within it, and to the next coarser one.
    pub(super) borders: Vec<[LevelBorders; 2]>,
    /// By level: vertices and triangles.
    pub(super) sizes: Vec<[u64; 2]>,
    /// Of masks of water.
    pub(super) pixels: MaskPixels,
    /// Tiles that are not packed, and that are.
    pub(super) packed: [TileTally; 2],
    /// The first tile that cannot be read, and why.
    pub(super) unreadable: Option<(ProofTileId, String)>,
}

/// How many tiles there are of a kind, and the first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileTally {
    pub(super) count: u64,
    pub(super) first: Option<ProofTileId>,
}

impl TileTally {
    fn add(&mut self, id: ProofTileId) {
        self.merge(&Self { count: 1, first: Some(id) });
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.first = self.first.into_iter().chain(other.first).min();
    }
}

impl SingleTileFindings {
    fn new(levels: usize) -> Self {
        let (borders, sizes) = (vec![Default::default(); levels], vec![[0; 2]; levels]);
        Self { borders, sizes, ..Self::default() }
    }

    fn merge(&mut self, other: &Self) {
        self.faults.merge(&other.faults);
        self.pixels.merge(&other.pixels);
        self.unreadable = self.unreadable.take().into_iter().chain(other.unreadable.clone()).min();
        for (mine, theirs) in self.packed.iter_mut().zip(&other.packed) {
            mine.merge(theirs);
        }
        for (mine, theirs) in self.borders.iter_mut().zip(&other.borders) {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| mine.merge(theirs));
        }
        for (mine, theirs) in self.sizes.iter_mut().zip(&other.sizes) {
            mine.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        }
    }
}

/// Looks at all tiles. Records are by the number of the tile; there is none of one that cannot be read.
pub(super) fn check(
    context: &TilesProofContext<'_>,
) -> Result<(SingleTileFindings, Vec<Option<TileRecord>>)> {
    let all = &context.tiles.all;
    let levels = usize::from(context.layer.finest) + 1;
    let records = Mutex::new(vec![None; all.len()]);
    let found = Mutex::new(SingleTileFindings::new(levels));
    let below = TileDescendants::of(context.layer, context.tiles);
    let looker = TileInspector { context, sides: TileCache::new(context.room.memory / 4), below };
    context.progress.begin("tiles", all.len() as u64);
    let work = |found: &mut SingleTileFindings, run: u64| {
        let first = (run * RUN) as usize;
        for (number, &id) in all.iter().enumerate().skip(first).take(RUN as usize) {
            context.cancel.check()?;
            let record = looker.check(id, found)?;
            lock(&records)[number] = record;
            context.progress.advance(1);
        }
        Ok(())
    };
    let finish = |mine: SingleTileFindings| {
        lock(&found).merge(&mine);
        Ok(())
    };
    let runs = (all.len() as u64).div_ceil(RUN);
    let start = || SingleTileFindings::new(levels);
    workers::run(context.room.threads, runs, context.cancel, start, work, finish)?;
    context.progress.end();
    let found = lock(&found).clone();
    Ok((found, std::mem::take(&mut *lock(&records))))
}

/// The metadata of a tile, as far as it is known.
#[derive(Default, Deserialize)]
struct CheckedTileMetadata {
    error: Option<f64>,
    available: Option<Vec<Vec<TileRange>>>,
}

type Sides = [TileSideChain; 4];

struct TileInspector<'a> {
    context: &'a TilesProofContext<'a>,
    sides: TileCache<Sides>,
    below: Option<TileDescendants>,
}

impl TileInspector<'_> {
    /// A tile, whether its file is packed, and its metadata.
    fn read(&self, id: ProofTileId) -> Result<(DecodedTile, bool, CheckedTileMetadata)> {
        let (tile, is_packed) = self.context.read(id)?;
        let metadata = self.metadata(id, &tile)?;
        Ok((tile, is_packed, metadata))
    }

    fn check(&self, id: ProofTileId, found: &mut SingleTileFindings) -> Result<Option<TileRecord>> {
        let (context, layer) = (self.context, &self.context.layer);
        let (tile, is_packed, CheckedTileMetadata { error, available }) =
            match decoded(self.read(id))? {
                Ok(read) => read,
                Err(e) => {
                    found.faults.add(TilesetFault::Unreadable, 1, id);
                    let why = Some((id, e.to_string()));
                    found.unreadable = found.unreadable.take().into_iter().chain(why).min();
                    return Ok(None);
                }
            };
        found.packed[usize::from(is_packed)].add(id);
        let faults = &mut found.faults;
        structure(id, &tile, faults);
        let positions = TileFacets::positions(id, &tile);
        let (about, radius) = self.contained(id, &tile, &positions, faults);
        tile.faults.iter().for_each(|(fault, count)| faults.add(*fault, *count, id));
        if let Some(own) = layer.own(id.level) {
            lattice(id, &tile, own.step, faults);
        }
        let lacks = layer.has_normals && tile.normals.is_none();
        faults.add(TilesetFault::NoNormals, u64::from(lacks), id);
        let has_more = [
            (tile.normals.is_some(), layer.has_normals),
            (tile.metadata.is_some(), layer.has_metadata),
            (tile.water.is_some(), layer.has_water),
        ];
        let has_more = has_more.iter().any(|(has, is_named)| *has && !is_named);
        faults.add(TilesetFault::Unannounced, u64::from(has_more), id);
        let lacks = layer.has_metadata && tile.metadata.is_none();
        faults.add(TilesetFault::NoMetadata, u64::from(lacks), id);
        faults.add(TilesetFault::NoMask, u64::from(layer.has_water && tile.water.is_none()), id);
        if let (Some(shore), Some(mask)) = (&context.shore, &tile.water) {
            let seen = shore.check(id, mask);
            faults.add(TilesetFault::WrongMask, seen.wrong, id);
            found.pixels.merge(&seen);
        }
        let is_wrong = match &self.below {
            Some(below) => !below.is_right(id, available.as_deref(), context.tiles),
            None => available.is_some() && layer.levels.is_some(),
        };
        faults.add(TilesetFault::Below, u64::from(is_wrong), id);
        let sizes = &mut found.sizes[usize::from(id.level)];
        sizes[0] += tile.vertices.len() as u64;
        sizes[1] += tile.triangles.len() as u64;
        self.compare(id, &sides(id, &tile), found)?;
        let heights = tile.vertices.iter().map(|&vertex| tile.height(vertex));
        let heights = heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], height| {
            [low.min(height), high.max(height)]
        });
        let error = error.or(about.map(|about| about.error));
        Ok(Some(TileRecord { error, heights, radius }))
    }

    /// Checks a tile against its metadata, including that of subtrees where present. Returns the required radius
    /// of its bounding sphere.
    fn contained(
        &self,
        id: ProofTileId,
        tile: &DecodedTile,
        positions: &[[f64; 3]],
        faults: &mut TilesetFaults,
    ) -> (Option<StatedTileMetadata>, f64) {
        let layer = &self.context.layer;
        let Some(three) = layer.three() else {
            let about = tile.about();
            contain(id, &about, Some(tile.centre), positions, faults);
            if layer.levels.is_none() {
                return (None, f64::INFINITY);
            }
            lowest(id, tile, faults);
            return (None, tight(id, &about, Some(tile.centre), positions, faults));
        };
        let Some(about) = three.about(id).copied() else { return (None, f64::INFINITY) };
        let hanging = tile.skirt.triangles.as_flattened();
        let all = [positions, hanging].concat();
        contain(id, &about, None, &all, faults);
        let lattice = layer.own(id.level).and_then(|own| own.lattice).unwrap_or_default();
        between(id, (&about, lattice), tile, positions, faults);
        (Some(about), tight(id, &about, None, &all, faults))
    }

    /// Checks the recorded error of a tile, and its availability metadata.
    fn metadata(&self, id: ProofTileId, tile: &DecodedTile) -> Result<CheckedTileMetadata> {
        let Some(text) = &tile.metadata else { return Ok(CheckedTileMetadata::default()) };
        let bad = |what: String| {
            let path = folder::path_of(&self.context.layer.folder, id);
            Error::bad_input(what).in_file(&path).at("metadata")
        };
        let metadata: CheckedTileMetadata =
            serde_json::from_slice(text).map_err(|e| bad(format!("is not understood: {e}")))?;
        match metadata.error {
            Some(error) if !(0.0..f64::INFINITY).contains(&error) => {
                Err(bad(format!("records {error}, which is no error")))
            }
            _ => Ok(metadata),
        }
    }

    /// Compares sides with those of the tiles to the east and north, and of coarser ones all around.
    fn compare(&self, id: ProofTileId, own: &Sides, found: &mut SingleTileFindings) -> Result<()> {
        let level = usize::from(id.level);
        for side in [ProofTileSide::East, ProofTileSide::North] {
            let Some(beside) = id.neighbour(side) else { continue };
            let borders = &mut found.borders[level][0];
            let Some(other) = self.sides_of(beside)? else {
                borders.alone += 1;
                continue;
            };
            let (mine, other) = (&own[side as usize], &other[side.opposite() as usize]);
            let is_same = mine.is_same(other);
            borders.add(if is_same { 0.0 } else { gap(mine, other) }, !is_same, id);
            found.faults.add(TilesetFault::Differing, u64::from(!is_same), id);
        }
        for side in [ProofTileSide::West, ProofTileSide::South] {
            let is_alone =
                id.neighbour(side).is_some_and(|at| self.context.tiles.find_one(at).is_none());
            found.borders[level][0].alone += u64::from(is_alone);
        }
        for side in ProofTileSide::ALL {
            let Some(coarser) = id.coarser_beside(side) else { continue };
            let borders = &mut found.borders[level][1];
            let Some(other) = self.sides_of(coarser)? else {
                borders.alone += 1;
                continue;
            };
            let apart = gap(&own[side as usize], &other[side.opposite() as usize]);
            let is_wide = apart > self.context.allowed_gap(id.level);
            borders.add(apart, is_wide, id);
            found.faults.add(TilesetFault::Gaps, u64::from(is_wide), id);
        }
        Ok(())
    }

    /// The sides of a tile, if it is there.
    fn sides_of(&self, id: ProofTileId) -> Result<Option<Arc<Sides>>> {
        if self.context.tiles.find_one(id).is_none() {
            return Ok(None);
        }
        let make = || {
            let sides = sides(id, &self.context.read(id)?.0);
            let bytes = sides.iter().map(TileSideChain::bytes).sum();
            Ok((sides, bytes))
        };
        Ok(decoded(self.sides.get(id, make))?.ok())
    }
}

fn sides(id: ProofTileId, tile: &DecodedTile) -> Sides {
    ProofTileSide::ALL.map(|side| TileSideChain::of(id, tile, side))
}
