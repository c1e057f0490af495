//! Compressed points (LAZ): how they are laid out in a file, checked against its length before any
//! decoder sees them, and decoding chunk by chunk.

mod decode;
mod layers;
mod layout;
mod table;

pub(super) use decode::ChunkDecoder;
pub(super) use layout::{LazCompressor, LazLayout};
pub(super) use table::{LazChunk, LazChunkTable, read as table};
