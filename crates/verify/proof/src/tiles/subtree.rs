//! Subtrees of 3D Tiles 1.1: which tiles there are, and what is told of each.

use std::collections::{BTreeMap, HashSet};

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::contain::StatedTileMetadata;
use super::tiling::ProofTileId;
use terrane_base::error::{Error, Result};

/// Most levels of a subtree: bits of more would be larger than any file.
pub const MAX_SUBTREE_LEVELS: u8 = 12;

/// What has to be told of a tile, by its meaning, and how many numbers that are.
const PROPERTIES: [(&str, usize); 5] = [
    ("TILE_MINIMUM_HEIGHT", 1),
    ("TILE_MAXIMUM_HEIGHT", 1),
    ("TILE_BOUNDING_SPHERE", 4),
    ("TILE_HORIZON_OCCLUSION_POINT", 3),
    ("TILE_GEOMETRIC_ERROR", 1),
];

/// The classes of what is told: names of properties, and what they mean. Values are what is stored: whatever would
/// make others of them is refused.
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
        let many = if self.array { self.count? } else { 1 };
        (self.component_type.as_deref() == Some("FLOAT64")).then_some(each * many)
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
    /// Tiles that there are, and what is told of each.
    pub tiles: Vec<(ProofTileId, StatedTileMetadata)>,
    /// The tiles at the tops of the subtrees below that there are.
    pub below: Vec<ProofTileId>,
}

impl Subtree {
    /// Reads a subtree of so many levels below `top`.
    ///
    /// # Errors
    /// Bad input: bytes that are no subtree, counts that are not those of the bits, a table without what clients of
    /// terrain need, or of another length.
    pub fn read(
        bytes: &[u8],
        top: ProofTileId,
        levels: u8,
        schema: &MetadataSchema,
    ) -> Result<Self> {
        let file = SubtreeFile::of(bytes)?;
        let whole = first(levels);
        let here = file.bits(&file.stored.tile_availability, whole)?;
        let contents = file.stored.content_availability.as_deref().unwrap_or_default();
        let [content] = contents else {
            return Err(bad(format!("has {} contents a tile, not one", contents.len())));
        };
        if file.bits(content, whole)? != here {
            return Err(bad("has tiles without content".to_owned()));
        }
        if !here[0] {
            return Err(bad("has no tile at its top".to_owned()));
        }
        let id = |level: u8, number: usize| below(top, level, number);
        let each = (0..levels).flat_map(|level| {
            (first(level)..first(level + 1)).map(move |bit| (level, bit - first(level), bit))
        });
        let ids = each.filter(|(.., bit)| here[*bit]).map(|(level, number, _)| id(level, number));
        let ids: Vec<ProofTileId> = ids.collect();
        let known: HashSet<ProofTileId> = ids.iter().copied().collect();
        let is_alone = |id: &&ProofTileId| {
            id.level > top.level && id.parent().is_none_or(|parent| !known.contains(&parent))
        };
        if let Some(id) = ids.iter().find(is_alone) {
            return Err(bad(format!("has tile {id} without the one above it")));
        }
        let under = file.bits(&file.stored.child_subtree_availability, 1 << (2 * levels))?;
        let under = (0..).zip(under).filter(|(_, is_there)| *is_there);
        let under: Vec<ProofTileId> = under.map(|(number, _)| id(levels, number)).collect();
        let tiles = ids.iter().copied().zip(file.table(schema, ids.len())?).collect();
        Ok(Self { tiles, below: under })
    }
}

/// The first bit of a level.
fn first(level: u8) -> usize {
    ((1 << (2 * level)) - 1) / 3
}

/// The tile of a number along the curve of a level below another: its bits are those of column and row in turn.
fn below(top: ProofTileId, level: u8, number: usize) -> ProofTileId {
    let every_second = |from: usize| {
        (0..level)
            .fold(0, |at, bit| at | ((number >> (2 * usize::from(bit) + from) & 1) as u32) << bit)
    };
    ProofTileId {
        level: top.level + level,
        x: (top.x << level) + every_second(0),
        y: (top.y << level) + every_second(1),
    }
}

struct SubtreeFile<'a> {
    stored: StoredSubtree,
    bytes: &'a [u8],
}

impl<'a> SubtreeFile<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self> {
        let number = |at: usize| {
            let found = bytes.get(at..at + 8).and_then(|bytes| bytes.try_into().ok());
            found.and_then(|bytes| usize::try_from(u64::from_le_bytes(bytes)).ok())
        };
        if bytes.get(..8) != Some(b"subt\x01\0\0\0") {
            return Err(bad("is no subtree of version 1".to_owned()));
        }
        let parts = || {
            let [text, buffer] = [number(8)?, number(16)?];
            let middle = text.checked_add(24)?;
            let is_whole = middle.checked_add(buffer)? == bytes.len();
            let is_even = text.is_multiple_of(8) && buffer.is_multiple_of(8);
            (is_whole && is_even).then(|| (&bytes[24..middle], &bytes[middle..]))
        };
        let (text, bytes) =
            parts().ok_or_else(|| bad("has not the two parts that it says".to_owned()))?;
        let stored: StoredSubtree = serde_json::from_slice(text)
            .map_err(|e| bad(format!("has a text that is not understood: {e}")))?;
        match &stored.buffers[..] {
            [SubtreeBufferLength { byte_length, uri: None }]
                if byte_length.next_multiple_of(8) == bytes.len() =>
            {
                Ok(Self { stored, bytes })
            }
            _ => Err(bad("has another buffer than its second part".to_owned())),
        }
    }

    fn view(&self, number: usize, length: usize) -> Result<&[u8]> {
        let found = || {
            let view = self.stored.buffer_views.get(number)?;
            let is_right = view.buffer == 0 && view.byte_length == length;
            let end = view.byte_offset.checked_add(view.byte_length)?;
            // Doubles are read in place.
            let is_even = view.byte_offset.is_multiple_of(8);
            self.bytes.get(view.byte_offset..end).filter(|_| is_right && is_even)
        };
        found().ok_or_else(|| bad(format!("has no buffer view {number} of {length} bytes")))
    }

    fn bits(&self, bits: &SubtreeAvailability, count: usize) -> Result<Vec<bool>> {
        let found = match (bits.bitstream, bits.constant) {
            (Some(view), None) => {
                let bytes = self.view(view, count.div_ceil(8))?;
                (0..count).map(|bit| bytes[bit / 8] >> (bit % 8) & 1 == 1).collect()
            }
            (None, Some(constant @ 0..=1)) => vec![constant == 1; count],
            _ => return Err(bad("has neither bits nor a constant where one is needed".to_owned())),
        };
        let set = found.iter().filter(|bit| **bit).count();
        match bits.available_count {
            Some(said) if said != set => {
                Err(bad(format!("says that {said} bits are set, and {set} are")))
            }
            _ => Ok(found),
        }
    }

    fn table(&self, schema: &MetadataSchema, count: usize) -> Result<Vec<StatedTileMetadata>> {
        let tables = self.stored.property_tables.as_deref().unwrap_or_default();
        let table = self.stored.tile_metadata.and_then(|number| tables.get(number));
        let table = table.ok_or_else(|| bad("tells nothing of its tiles".to_owned()))?;
        if table.count != count {
            return Err(bad(format!("tells of {} tiles, and there are {count}", table.count)));
        }
        let columns =
            PROPERTIES.map(|(semantic, numbers)| self.column(schema, table, semantic, numbers));
        let [low, high, sphere, horizon, error] = columns;
        let (low, high, sphere, horizon, error) = (low?, high?, sphere?, horizon?, error?);
        let about = |i: usize| StatedTileMetadata {
            heights: [low[i], high[i]],
            sphere: (std::array::from_fn(|k| sphere[4 * i + k]), sphere[4 * i + 3]),
            horizon: std::array::from_fn(|k| horizon[3 * i + k]),
            error: error[i],
        };
        Ok((0..count).map(about).collect())
    }

    fn column(
        &self,
        schema: &MetadataSchema,
        table: &SubtreePropertyTable,
        semantic: &str,
        numbers: usize,
    ) -> Result<Vec<f64>> {
        let is_it = |(_, property): &(&String, &MetadataProperty)| {
            property.semantic.as_deref() == Some(semantic) && property.numbers() == Some(numbers)
        };
        let class = schema.classes.get(&table.class);
        let name =
            class.and_then(|class| class.properties.iter().find(is_it)).map(|(name, _)| name);
        let column = name.and_then(|name| table.properties.get(name));
        let column = column.ok_or_else(|| bad(format!("does not tell {semantic} of tiles")))?;
        let bytes = self.view(column.values, 8 * numbers * table.count)?;
        let (all, _) = bytes.as_chunks::<8>();
        let all: Vec<f64> = all.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        match all.iter().all(|value| value.is_finite()) {
            true => Ok(all),
            false => Err(bad(format!("tells a {semantic} that is not finite"))),
        }
    }
}

fn bad(message: String) -> Error {
    Error::bad_input(message)
}
