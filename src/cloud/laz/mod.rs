//! Compressed points (LAZ): how they are laid out in a file, checked against its length before any
//! decoder sees them, and decoding chunk by chunk.

mod decode;
mod layers;
mod layout;
mod quiet;
mod table;

pub(super) use decode::{Damage, decode, stream};
pub(super) use layout::{Compressor, Layout};
pub(super) use table::{Chunk, Table, read as table};

/// Fields that are decompressed beside x, y and the return numbers, where a format lets one choose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) z: bool,
    pub(super) class: bool,
    pub(super) flags: bool,
}
