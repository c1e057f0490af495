//! How the records of a compressed file are made up, as its LASzip record says.

use super::chunk::Layer;
use std::fmt;

/// A part of every record, as the LASzip record lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// Which fields it holds.
    pub kind: u16,
    /// Bytes.
    pub size: u16,
    /// How it is compressed.
    pub version: u16,
}

impl Item {
    /// Whether it is one of those of formats 0 to 5.
    fn is_of_old_formats(&self) -> bool {
        matches!(
            (self.kind, self.size, self.version),
            (7, 8, 1 | 2) | (8, 6, 1 | 2) | (9, 29, 1 | 2) | (0, 1.., 2)
        )
    }
}

impl fmt::Display for Item {
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

/// How records are made up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    pub(super) layout: Layout,
}

/// How chunks are arranged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    /// Fields are layers, one after another.
    Layered(Layers),
    /// Records follow each other.
    Pointwise(Records),
}

/// Records of one stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Records {
    /// How the part that they share is compressed.
    pub(super) version: u16,
    /// What follows it.
    pub(super) follow: Vec<Item>,
    /// Bytes of what follows.
    pub(super) bytes: usize,
}

/// What follows the part that all layered records share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layers {
    /// How all is compressed.
    pub(super) version: u16,
    /// Bytes of a record.
    pub(super) bytes: usize,
    /// Layers of a chunk, as their parts stand in a record.
    pub(super) layers: Vec<Layer>,
}

impl Schema {
    /// The schema of records of these items, in order.
    ///
    /// # Errors
    /// The first item that this decoder does not know, or that has no place where it is.
    pub fn new(items: &[Item]) -> Result<Self, Item> {
        let none = Item { kind: 0, size: 0, version: 0 };
        let (&first, rest) = items.split_first().ok_or(none)?;
        let layout = match (first.kind, first.size, first.version) {
            (10, 30, 3 | 4) => Layout::Layered(Layers::new(first.version, rest)?),
            (6, 20, 1 | 2) => Layout::Pointwise(Records::new(first.version, rest)?),
            _ => return Err(first),
        };
        Ok(Self { layout })
    }
}

impl Records {
    fn new(version: u16, items: &[Item]) -> Result<Self, Item> {
        match items.iter().find(|item| !item.is_of_old_formats()) {
            Some(item) => Err(*item),
            None => {
                let bytes = items.iter().map(|item| usize::from(item.size)).sum();
                Ok(Self { version, follow: items.to_vec(), bytes })
            }
        }
    }
}

impl Layers {
    fn new(version: u16, items: &[Item]) -> Result<Self, Item> {
        let mut all = Self { version, bytes: 0, layers: Vec::new() };
        for item in items {
            all.bytes += usize::from(item.size);
            match (item.kind, item.size) {
                _ if item.version != version => return Err(*item),
                (11, 6) => all.layers.push(Layer::Colours),
                (12, 8) => all.layers.extend([Layer::Colours, Layer::Infrared]),
                (13, 29) => all.layers.push(Layer::Packets),
                (14, size) => all.layers.extend(vec![Layer::ExtraBytes; size.into()]),
                _ => return Err(*item),
            }
        }
        Ok(all)
    }
}
