//! Subtrees of 3D Tiles 1.1: availability of tiles, and their metadata.

use std::collections::{BTreeMap, HashSet};

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::contain::StatedTileMetadata;
use super::tiling::ProofTileId;
use terrane_base::error::{Error, Result};

/// Limit of the levels of a subtree: the bits of more exceed any file.
pub const MAX_SUBTREE_LEVELS: u8 = 12;

/// Required metadata of a tile by semantic, with the count of numbers.
const PROPERTIES: [(&str, usize); 5] = [
    ("TILE_MINIMUM_HEIGHT", 1),
    ("TILE_MAXIMUM_HEIGHT", 1),
    ("TILE_BOUNDING_SPHERE", 4),
    ("TILE_HORIZON_OCCLUSION_POINT", 3),
    ("TILE_GEOMETRIC_ERROR", 1),
];

/// Classes of metadata: names of properties, and their semantics. Members that modify stored values (offset, scale, noData)
/// are refused.
#[derive(Clone, Debug, Deserialize)]
pub struct MetadataSchema {
    classes: BTreeMap<String, MetadataClass>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MetadataClass {
    properties: BTreeMap<String, MetadataProperty>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct MetadataProperty {
    #[serde(rename = "type")]
    kind: String,
    component_type: Option<String>,
    #[serde(default)]
    array: bool,
    count: Option<usize>,
    semantic: Option<String>,
    #[serde(rename = "required")]
    _required: Option<IgnoredAny>,
    #[serde(rename = "name")]
    _name: Option<IgnoredAny>,
    #[serde(rename = "description")]
    _about: Option<IgnoredAny>,
}

impl MetadataProperty {
    /// Numbers of a value, all of them doubles.
    fn numbers(&self) -> Option<usize> {
        let each = match &*self.kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => return None,
        };
        let count = if self.array { self.count? } else { 1 };
        (self.component_type.as_deref() == Some("FLOAT64")).then_some(each * count)
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct StoredSubtree {
    #[serde(default)]
    buffers: Vec<SubtreeBufferLength>,
    #[serde(default)]
    buffer_views: Vec<SubtreeBufferView>,
    property_tables: Option<Vec<SubtreePropertyTable>>,
    tile_metadata: Option<usize>,
    tile_availability: SubtreeAvailability,
    content_availability: Option<Vec<SubtreeAvailability>>,
    child_subtree_availability: SubtreeAvailability,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct SubtreeBufferLength {
    byte_length: usize,
    uri: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct SubtreeBufferView {
    buffer: usize,
    byte_offset: usize,
    byte_length: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct SubtreeAvailability {
    bitstream: Option<usize>,
    constant: Option<u8>,
    available_count: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SubtreePropertyTable {
    class: String,
    count: usize,
    #[serde(default)]
    properties: BTreeMap<String, SubtreePropertyColumn>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SubtreePropertyColumn {
    values: usize,
}

/// A subtree as it is stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Subtree {
    /// Available tiles, with their metadata.
    pub tiles: Vec<(ProofTileId, StatedTileMetadata)>,
    /// Root tiles of the available child subtrees.
    pub below: Vec<ProofTileId>,
}

impl Subtree {
    /// Reads a subtree of `levels` levels from the tile `top` on.
    ///
    /// # Errors
    /// Bad input: bytes of another format, counts that differ from the bits, a table without the required metadata, or of
    /// another length.
    pub fn read(
        bytes: &[u8],
        top: ProofTileId,
        levels: u8,
        schema: &MetadataSchema,
    ) -> Result<Self> {
        let file = SubtreeFile::of(bytes)?;
        let count = first(levels);
        let available = file.bits(&file.stored.tile_availability, count)?;
        let contents = file.stored.content_availability.as_deref().unwrap_or_default();
        let [content] = contents else {
            return Err(bad(format!("{} contents of a tile, expected 1", contents.len())));
        };
        if file.bits(content, count)? != available {
            return Err(bad("tiles without content".to_owned()));
        }
        if !available[0] {
            return Err(bad("root tile is missing".to_owned()));
        }
        let mut ids = Vec::new();
        for level in 0..levels {
            let bits = &available[first(level)..first(level + 1)];
            ids.extend(set(bits).map(|number| below(top, level, number)));
        }
        let known: HashSet<ProofTileId> = ids.iter().copied().collect();
        for id in ids.iter().filter(|id| id.level > top.level) {
            if id.parent().is_none_or(|parent| !known.contains(&parent)) {
                return Err(bad(format!("tile {id} without its parent")));
            }
        }
        let children = file.bits(&file.stored.child_subtree_availability, 1 << (2 * levels))?;
        let children = set(&children).map(|number| below(top, levels, number)).collect();
        let tiles = ids.iter().copied().zip(file.table(schema, ids.len())?).collect();
        Ok(Self { tiles, below: children })
    }
}

/// Numbers of the bits that are set.
fn set(bits: &[bool]) -> impl Iterator<Item = usize> {
    (0..).zip(bits).filter(|(_, is_set)| **is_set).map(|(number, _)| number)
}

/// The first bit of a level.
fn first(level: u8) -> usize {
    ((1 << (2 * level)) - 1) / 3
}

/// The tile with a Morton index on a level below another tile.
fn below(top: ProofTileId, level: u8, number: usize) -> ProofTileId {
    let [mut x, mut y] = [top.x << level, top.y << level];
    for bit in 0..level {
        let pair = (number >> (2 * bit)) as u32;
        x += (pair & 1) << bit;
        y += (pair >> 1 & 1) << bit;
    }
    ProofTileId { level: top.level + level, x, y }
}

struct SubtreeFile<'a> {
    stored: StoredSubtree,
    bytes: &'a [u8],
}

impl<'a> SubtreeFile<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self> {
        if bytes.get(..8) != Some(b"subt\x01\0\0\0") {
            return Err(bad("not a subtree of version 1".to_owned()));
        }
        let (text, bytes) = chunks(bytes)
            .ok_or_else(|| bad("lengths of JSON and buffer differ from the header".to_owned()))?;
        let stored: StoredSubtree =
            serde_json::from_slice(text).map_err(|e| bad(format!("invalid JSON: {e}")))?;
        match &stored.buffers[..] {
            [SubtreeBufferLength { byte_length, uri: None }]
                if byte_length.next_multiple_of(8) == bytes.len() =>
            {
                Ok(Self { stored, bytes })
            }
            _ => Err(bad("buffer is not the internal buffer".to_owned())),
        }
    }

    /// Bytes of a buffer view that must have this length.
    fn view(&self, number: usize, length: usize) -> Result<&[u8]> {
        let view = self.stored.buffer_views.get(number);
        // Clients read doubles in place, so views are aligned.
        let view = view.filter(|view| {
            view.buffer == 0 && view.byte_length == length && view.byte_offset.is_multiple_of(8)
        });
        view.and_then(|view| self.bytes.get(view.byte_offset..)?.get(..length))
            .ok_or_else(|| bad(format!("buffer view {number} of {length} bytes is missing")))
    }

    fn bits(&self, bits: &SubtreeAvailability, count: usize) -> Result<Vec<bool>> {
        let found = match (bits.bitstream, bits.constant) {
            (Some(view), None) => {
                let bytes = self.view(view, count.div_ceil(8))?;
                (0..count).map(|bit| bytes[bit / 8] >> (bit % 8) & 1 == 1).collect()
            }
            (None, Some(constant @ 0..=1)) => vec![constant == 1; count],
            _ => return Err(bad("availability without bitstream or constant".to_owned())),
        };
        let count = set(&found).count();
        match bits.available_count {
            Some(stated) if stated != count => {
                Err(bad(format!("availableCount is {stated}, but {count} bits are set")))
            }
            _ => Ok(found),
        }
    }

    fn table(&self, schema: &MetadataSchema, count: usize) -> Result<Vec<StatedTileMetadata>> {
        let tables = self.stored.property_tables.as_deref().unwrap_or_default();
        let table = self.stored.tile_metadata.and_then(|number| tables.get(number));
        let table = table.ok_or_else(|| bad("property table is missing".to_owned()))?;
        if table.count != count {
            let found = table.count;
            return Err(bad(format!("property table has {found} rows, expected {count}")));
        }
        let columns =
            PROPERTIES.map(|(semantic, numbers)| self.column(schema, table, semantic, numbers));
        let [low, high, sphere, horizon, error] = columns;
        let (low, high, sphere, horizon, error) = (low?, high?, sphere?, horizon?, error?);
        Ok((0..count)
            .map(|i| StatedTileMetadata {
                heights: [low[i], high[i]],
                sphere: (std::array::from_fn(|k| sphere[4 * i + k]), sphere[4 * i + 3]),
                horizon: std::array::from_fn(|k| horizon[3 * i + k]),
                error: error[i],
            })
            .collect())
    }

    fn column(
        &self,
        schema: &MetadataSchema,
        table: &SubtreePropertyTable,
        semantic: &str,
        numbers: usize,
    ) -> Result<Vec<f64>> {
        let class = schema.classes.get(&table.class);
        let mut properties = class.into_iter().flat_map(|class| &class.properties);
        let property = properties.find(|(_, property)| {
            property.semantic.as_deref() == Some(semantic) && property.numbers() == Some(numbers)
        });
        let column = property.and_then(|(name, _)| table.properties.get(name));
        let column = column.ok_or_else(|| bad(format!("{semantic} of tiles is missing")))?;
        let bytes = self.view(column.values, 8 * numbers * table.count)?;
        let (all, _) = bytes.as_chunks::<8>();
        let all: Vec<f64> = all.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        match all.iter().all(|value| value.is_finite()) {
            true => Ok(all),
            false => Err(bad(format!("{semantic} is not finite"))),
        }
    }
}

/// JSON and buffer of a subtree file.
fn chunks(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let [text, buffer] = [length(bytes, 8)?, length(bytes, 16)?];
    let middle = text.checked_add(24)?;
    let is_complete = middle.checked_add(buffer)? == bytes.len();
    let is_aligned = text.is_multiple_of(8) && buffer.is_multiple_of(8);
    (is_complete && is_aligned).then(|| (&bytes[24..middle], &bytes[middle..]))
}

/// The length stored at a byte.
fn length(bytes: &[u8], at: usize) -> Option<usize> {
    let length = u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?);
    usize::try_from(length).ok()
}

fn bad(message: String) -> Error {
    Error::bad_input(message)
}
