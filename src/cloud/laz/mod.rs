//! Compressed points (LAZ): how they are laid out in a file, checked against its length before any
//! decoder sees them, and decoding chunk by chunk.

mod decode;
mod layers;
mod layout;
mod quiet;
mod stream;
mod table;

pub(super) use decode::{Damage, Unpacker};
pub(super) use layout::{Compressor, Layout};
pub(super) use stream::stream;
pub(super) use table::{Chunk, Table, read as table};
