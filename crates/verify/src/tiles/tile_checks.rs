//! Checks of single tiles and of their borders: each tile is read once for itself, and its sides again for its neighbours.

use std::sync::{Arc, Mutex};

use serde::Deserialize;

use super::availability::TileDescendants;
use super::cache::TileCache;
use super::context::{TilesProofContext, decoded};
use super::folder;
use super::layer::TileRange;
use terrane_base::error::{Error, Result};
use terrane_engine::workers;
use terrane_files::{lock, unlocked};
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
    /// Radius of the smallest bounding sphere around its middle.
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
        // The first tile of the largest gap, whatever the order of work.
        let all = self.gap.into_iter().chain([found]);
        self.gap = all.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
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
    /// By level: borders within it, and to the next coarser one.
    pub(super) borders: Vec<[LevelBorders; 2]>,
    /// By level: numbers of vertices and triangles.
    pub(super) sizes: Vec<[u64; 2]>,
    /// Pixels of water masks.
    pub(super) pixels: MaskPixels,
    /// Tiles that are not packed, and that are.
    pub(super) packed: [TileTally; 2],
    /// The first tile that cannot be read, and why.
    pub(super) unreadable: Option<(ProofTileId, String)>,
}

/// Number of tiles of a kind, and the first.
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

/// Checks all tiles. Records are indexed by the number of the tile; unreadable tiles have none.
pub(super) fn check(
    context: &TilesProofContext<'_>,
) -> Result<(SingleTileFindings, Vec<Option<TileRecord>>)> {
    let all = &context.tiles.all;
    let levels = usize::from(context.layer.finest) + 1;
    let records = Mutex::new(vec![None; all.len()]);
    let findings = Mutex::new(SingleTileFindings::new(levels));
    let inspector = TileInspector {
        context,
        sides: TileCache::new(context.memory.bytes / 4),
        descendants: TileDescendants::of(context.layer, context.tiles),
    };
    context.progress.begin("tiles", all.len() as u64);
    workers::run(
        context.memory.threads,
        (all.len() as u64).div_ceil(RUN),
        context.cancel,
        || SingleTileFindings::new(levels),
        |findings, run| {
            let first = (run * RUN) as usize;
            for (number, &id) in all.iter().enumerate().skip(first).take(RUN as usize) {
                context.cancel.check()?;
                let record = inspector.check(id, findings)?;
                lock(&records)[number] = record;
                context.progress.advance(1);
            }
            Ok(())
        },
        |of_thread| {
            lock(&findings).merge(&of_thread);
            Ok(())
        },
    )?;
    context.progress.end();
    Ok((unlocked(findings), unlocked(records)))
}

/// The supported members of the metadata of a tile.
#[derive(Default, Deserialize)]
struct CheckedTileMetadata {
    error: Option<f64>,
    available: Option<Vec<Vec<TileRange>>>,
}

type Sides = [TileSideChain; 4];

struct TileInspector<'a> {
    context: &'a TilesProofContext<'a>,
    sides: TileCache<Sides>,
    descendants: Option<TileDescendants>,
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
                Ok(tile) => tile,
                Err(e) => {
                    found.faults.add(TilesetFault::Unreadable, 1, id);
                    let reason = Some((id, e.to_string()));
                    found.unreadable = found.unreadable.take().into_iter().chain(reason).min();
                    return Ok(None);
                }
            };
        found.packed[usize::from(is_packed)].add(id);
        let faults = &mut found.faults;
        structure(id, &tile, faults);
        let positions = TileFacets::positions(id, &tile);
        let (stated, radius) = self.check_extent(id, &tile, &positions, faults);
        tile.faults.iter().for_each(|(fault, count)| faults.add(*fault, *count, id));
        if let Some(level) = layer.stated(id.level) {
            lattice(id, &tile, level.step, faults);
        }
        let extensions = [
            (tile.normals.is_some(), layer.has_normals, TilesetFault::NoNormals),
            (tile.metadata.is_some(), layer.has_metadata, TilesetFault::NoMetadata),
            (tile.water.is_some(), layer.has_water, TilesetFault::NoMask),
        ];
        for (is_there, is_announced, fault) in extensions {
            faults.add(fault, u64::from(is_announced && !is_there), id);
        }
        let is_unannounced =
            extensions.iter().any(|(is_there, is_announced, _)| *is_there && !is_announced);
        faults.add(TilesetFault::Unannounced, u64::from(is_unannounced), id);
        if let (Some(shore), Some(mask)) = (&context.shore, &tile.water) {
            let pixels = shore.check(id, mask);
            faults.add(TilesetFault::WrongMask, pixels.wrong, id);
            found.pixels.merge(&pixels);
        }
        let is_wrong = match &self.descendants {
            Some(expected) => !expected.is_right(id, available.as_deref(), context.tiles),
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
        let error = error.or(stated.map(|stated| stated.error));
        Ok(Some(TileRecord { error, heights, radius }))
    }

    /// Checks the bounding volumes of a tile: those of its header, or of its subtree in 3D Tiles. Returns the metadata of
    /// the subtree, and the required radius of the bounding sphere.
    fn check_extent(
        &self,
        id: ProofTileId,
        tile: &DecodedTile,
        positions: &[[f64; 3]],
        faults: &mut TilesetFaults,
    ) -> (Option<StatedTileMetadata>, f64) {
        let layer = &self.context.layer;
        let Some(three) = layer.three_tiles() else {
            let stated = tile.stated();
            contain(id, &stated, Some(tile.centre), positions, faults);
            if layer.levels.is_none() {
                return (None, f64::INFINITY);
            }
            lowest(id, tile, faults);
            return (None, tight(id, &stated, Some(tile.centre), positions, faults));
        };
        let Some(stated) = three.stated(id).copied() else { return (None, f64::INFINITY) };
        let hanging = tile.skirt.triangles.as_flattened();
        let all = [positions, hanging].concat();
        contain(id, &stated, None, &all, faults);
        let lattice = layer.stated(id.level).and_then(|level| level.lattice).unwrap_or_default();
        between(id, &stated, lattice, tile, positions, faults);
        (Some(stated), tight(id, &stated, None, &all, faults))
    }

    /// Checks the recorded error of a tile, and its availability metadata.
    fn metadata(&self, id: ProofTileId, tile: &DecodedTile) -> Result<CheckedTileMetadata> {
        let Some(text) = &tile.metadata else { return Ok(CheckedTileMetadata::default()) };
        let metadata = serde_json::from_slice(text).map_err(|e| format!("invalid JSON: {e}"));
        let checked = metadata.and_then(|metadata: CheckedTileMetadata| match metadata.error {
            Some(error) if !(0.0..f64::INFINITY).contains(&error) => {
                Err(format!("invalid error {error}"))
            }
            _ => Ok(metadata),
        });
        checked.map_err(|message| {
            let path = folder::path_of(&self.context.layer.folder, id);
            Error::bad_input(message).in_file(&path).at("metadata")
        })
    }

    /// Compares the sides of a tile with those of its eastern and northern neighbours, and of all coarser neighbours.
    fn compare(
        &self,
        id: ProofTileId,
        sides: &Sides,
        found: &mut SingleTileFindings,
    ) -> Result<()> {
        let level = usize::from(id.level);
        for side in [ProofTileSide::East, ProofTileSide::North] {
            let Some(neighbour) = id.neighbour(side) else { continue };
            let borders = &mut found.borders[level][0];
            let Some(other) = self.sides_of(neighbour)? else {
                borders.alone += 1;
                continue;
            };
            let (this, other) = (&sides[side as usize], &other[side.opposite() as usize]);
            let is_same = this.is_same(other);
            borders.add(if is_same { 0.0 } else { gap(this, other) }, !is_same, id);
            found.faults.add(TilesetFault::Differing, u64::from(!is_same), id);
        }
        for side in [ProofTileSide::West, ProofTileSide::South] {
            let is_alone =
                id.neighbour(side).is_some_and(|at| self.context.tiles.number_of(at).is_none());
            found.borders[level][0].alone += u64::from(is_alone);
        }
        for side in ProofTileSide::ALL {
            let Some(coarser) = id.coarser_beside(side) else { continue };
            let borders = &mut found.borders[level][1];
            let Some(other) = self.sides_of(coarser)? else {
                borders.alone += 1;
                continue;
            };
            let apart = gap(&sides[side as usize], &other[side.opposite() as usize]);
            let is_wide = apart > self.context.allowed_gap(id.level);
            borders.add(apart, is_wide, id);
            found.faults.add(TilesetFault::Gaps, u64::from(is_wide), id);
        }
        Ok(())
    }

    /// The sides of a tile, if it is there.
    fn sides_of(&self, id: ProofTileId) -> Result<Option<Arc<Sides>>> {
        if self.context.tiles.number_of(id).is_none() {
            return Ok(None);
        }
        let sides = self.sides.get(id, || {
            let sides = sides(id, &self.context.read(id)?.0);
            let bytes = sides.iter().map(TileSideChain::bytes).sum();
            Ok((sides, bytes))
        });
        Ok(decoded(sides)?.ok())
    }
}

fn sides(id: ProofTileId, tile: &DecodedTile) -> Sides {
    ProofTileSide::ALL.map(|side| TileSideChain::of(id, tile, side))
}
