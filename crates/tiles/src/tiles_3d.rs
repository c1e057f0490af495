//! Tilesets of 3D Tiles: one file per tile, one per subtree, and `tileset.json`.
//!
//! The western and the eastern hemisphere are two implicit quadtrees, so columns and rows match quantized-mesh,
//! counted from the south.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI};

use serde_json::{Map, Value, json};
use terrane_options::Choice;

use super::grid_levels::ScannedGrid;
use super::input::OpenedTilesGrid;
use super::report::TileLevelReport;
use terrane_globe::{
    CLASS, GlobeTileId, SUBTREE_LEVELS, TileMetadata, level_error, subtree, subtree_of,
};

/// Name of the metadata file.
pub(super) const TILESET: &str = "tileset.json";
/// Name of a tile file.
pub(super) const ENDING: &str = "glb";
/// Name of a subtree file.
pub(super) const SUBTREE: &str = "subtree";
/// Folders of the two hemispheres.
pub(super) const HALVES: [&str; 2] = ["west", "east"];

/// Hemisphere of a tile, and its column there.
pub(super) fn half_of(id: GlobeTileId) -> (&'static str, u32) {
    (HALVES[(id.x >> id.level) as usize & 1], id.x & ((1 << id.level) - 1))
}

/// Path of a tile file within a set.
pub(super) fn name_of(id: GlobeTileId, ending: &str) -> String {
    let (half, x) = half_of(id);
    format!("{half}/{}/{x}/{}.{ending}", id.level, id.y)
}

/// Extends the bounding spheres and errors of all tiles to those of their children.
pub(super) fn nest(facts: &mut BTreeMap<GlobeTileId, TileMetadata>) {
    let finest_first: Vec<GlobeTileId> = facts.keys().rev().copied().collect();
    for id in finest_first {
        let tile = facts.get(&id).copied();
        if let (Some(tile), Some(parent)) = (tile, id.parent().and_then(|id| facts.get_mut(&id))) {
            parent.hold(&tile);
        }
    }
}

/// Subtrees of a set, by their root tile.
pub(super) fn subtrees(
    facts: &BTreeMap<GlobeTileId, TileMetadata>,
) -> impl Iterator<Item = (GlobeTileId, Vec<u8>)> + '_ {
    let mut parts: BTreeMap<GlobeTileId, (Vec<TileMetadata>, BTreeSet<GlobeTileId>)> =
        BTreeMap::new();
    for (id, of_tile) in facts {
        let top = subtree_of(*id);
        parts.entry(top).or_default().0.push(*of_tile);
        if let Some(above) = top.parent().map(subtree_of) {
            parts.entry(above).or_default().1.insert(top);
        }
    }
    parts.into_iter().map(|(top, (tiles, below))| {
        let below: Vec<GlobeTileId> = below.into_iter().collect();
        (top, subtree(top, &tiles, &below))
    })
}

/// Metadata for clients: available tiles, errors of levels, and the schema of tile metadata.
pub(super) fn tileset(
    ground: &ScannedGrid<'_>,
    levels: &[TileLevelReport],
    facts: &BTreeMap<GlobeTileId, TileMetadata>,
) -> Value {
    let ends = HALVES.map(|half| {
        let of_half = facts.values().filter(|facts| half_of(facts.id).0 == half);
        of_half.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], facts| {
            [low.min(facts.heights[0]), high.max(facts.heights[1])]
        })
    });
    // Upper bound of all errors; clients halve it per level.
    let errors = facts.values().map(|facts| facts.error);
    let error = errors.fold(level_error(0), f64::max);
    let halves = [0, 1].map(|x| hemisphere(x, ends[x], error, levels.len()));
    let both = [ends[0][0].min(ends[1][0]), ends[0][1].max(ends[1][1])];
    let OpenedTilesGrid { job, division, .. } = ground.opened;
    let bounds = &division.place.bounds();
    let levels: Vec<Value> = levels
        .iter()
        .map(|l| {
            let mut level = json!({"level": l.level, "tolerance": l.tolerance, "step": l.step,
                                   "lattice": l.lattice, "error": l.error, "tiles": l.tiles});
            if let Some(depth) = l.skirt {
                level["skirt"] = json!(depth);
            }
            level
        })
        .collect();
    json!({
        "asset": {"version": "1.1"},
        "schema": {"id": "terrane", "classes": {"tile": {"properties": properties()}}},
        "geometricError": 2.0 * error,
        "root": {
            "boundingVolume": region(-PI, PI, both),
            "geometricError": 2.0 * error,
            "refine": "REPLACE",
            "children": halves,
        },
        "extras": {"terrane": {
            "version": env!("CARGO_PKG_VERSION"),
            "source": terrane_engine::feature_files::source(&job.input),
            "voids": "filled",
            "beyond": job.tiles.beyond.name(),
            "heights": ground.opened.heights.from,
            "bounds": [bounds.west, bounds.south, bounds.east, bounds.north],
            "normals": job.tiles.normals,
            "edges": job.tiles.tile_edges,
            "levels": levels,
        }},
    })
}

/// Root tile of a hemisphere, west (0) or east (1), with a range of heights.
fn hemisphere(x: usize, heights: [f64; 2], error: f64, levels: usize) -> Value {
    let name = HALVES[x];
    let west = -PI * (1.0 - x as f64);
    json!({
        "boundingVolume": region(west, west + PI, heights),
        "geometricError": error,
        "refine": "REPLACE",
        "content": {"uri": format!("{name}/{{level}}/{{x}}/{{y}}.{ENDING}")},
        "implicitTiling": {
            "subdivisionScheme": "QUADTREE",
            "subtreeLevels": SUBTREE_LEVELS,
            "availableLevels": levels,
            "subtrees": {"uri": format!("{name}/{{level}}/{{x}}/{{y}}.{SUBTREE}")},
        },
    })
}

/// Bounding volume from pole to pole: radians, and heights in metres.
fn region(west: f64, east: f64, [low, high]: [f64; 2]) -> Value {
    json!({"region": [west, -FRAC_PI_2, east, FRAC_PI_2, low, high]})
}

fn properties() -> Value {
    let mut properties = Map::new();
    for (name, kind, semantic) in CLASS {
        let text = format!(
            r#"{{{kind},"componentType":"FLOAT64","required":true,"semantic":"{semantic}"}}"#
        );
        properties.insert(name.to_owned(), serde_json::from_str(&text).unwrap_or_default());
    }
    Value::Object(properties)
}
