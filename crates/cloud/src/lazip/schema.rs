//! The structure of the records of a compressed file, by the LASzip VLR.

use super::chunk::LazLayer;
use std::fmt;

/// An item of the LASzip VLR: a part of every record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LaszipItem {
    /// Item type: its fields.
    pub kind: u16,
    /// Bytes.
    pub size: u16,
    /// Version of its compression.
    pub version: u16,
}

impl LaszipItem {
    /// Whether it is an item of formats 0 to 5.
    fn is_of_old_formats(&self) -> bool {
        matches!(
            (self.kind, self.size, self.version),
            (7, 8, 1 | 2) | (8, 6, 1 | 2) | (9, 29, 1 | 2) | (0, 1.., 2)
        )
    }
}

impl fmt::Display for LaszipItem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, size, version } = self;
        let name = match kind {
            0 => "extra bytes",
            6 => "old point",
            7 => "time",
            8 => "colour",
            9 => "old wave packet",
            10 => "point",
            11 => "new colour",
            12 => "colour with infrared",
            13 => "wave packet",
            14 => "new extra bytes",
            _ => "unknown item",
        };
        write!(f, "{name} (type {kind}) of {size} bytes, version {version}")
    }
}

/// Structure of records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaszipSchema {
    pub(super) layout: ChunkLayout,
}

/// Structure of chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ChunkLayout {
    /// Fields are layers, one after another.
    Layered(LayeredSchema),
    /// Records follow each other.
    Pointwise(PointwiseSchema),
}

/// Records of one stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PointwiseSchema {
    /// Version of the compression of the common fields.
    pub(super) version: u16,
    /// Items after them.
    pub(super) follow: Vec<LaszipItem>,
    /// Bytes of these items.
    pub(super) bytes: usize,
}

/// Layers after the common fields of layered records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LayeredSchema {
    /// Version of the compression.
    pub(super) version: u16,
    /// Record length.
    pub(super) bytes: usize,
    /// Layers of a chunk, in the order of their fields in a record.
    pub(super) layers: Vec<LazLayer>,
}

impl LaszipSchema {
    /// The schema of records with these items, in order.
    ///
    /// # Errors
    /// The first item that is unknown or at a wrong position.
    pub fn new(items: &[LaszipItem]) -> Result<Self, LaszipItem> {
        let none = LaszipItem { kind: 0, size: 0, version: 0 };
        let (&first, rest) = items.split_first().ok_or(none)?;
        let layout = match (first.kind, first.size, first.version) {
            (10, 30, 3 | 4) => ChunkLayout::Layered(LayeredSchema::new(first.version, rest)?),
            (6, 20, 1 | 2) => ChunkLayout::Pointwise(PointwiseSchema::new(first.version, rest)?),
            _ => return Err(first),
        };
        Ok(Self { layout })
    }
}

impl PointwiseSchema {
    fn new(version: u16, items: &[LaszipItem]) -> Result<Self, LaszipItem> {
        match items.iter().find(|item| !item.is_of_old_formats()) {
            Some(item) => Err(*item),
            None => {
                let bytes = items.iter().map(|item| usize::from(item.size)).sum();
                Ok(Self { version, follow: items.to_vec(), bytes })
            }
        }
    }
}

impl LayeredSchema {
    fn new(version: u16, items: &[LaszipItem]) -> Result<Self, LaszipItem> {
        let mut all = Self { version, bytes: 0, layers: Vec::new() };
        for item in items {
            all.bytes += usize::from(item.size);
            match (item.kind, item.size) {
                _ if item.version != version => return Err(*item),
                (11, 6) => all.layers.push(LazLayer::Colours),
                (12, 8) => all.layers.extend([LazLayer::Colours, LazLayer::Infrared]),
                (13, 29) => all.layers.push(LazLayer::Packets),
                (14, size) => all.layers.extend(vec![LazLayer::ExtraBytes; size.into()]),
                _ => return Err(*item),
            }
        }
        Ok(all)
    }
}
