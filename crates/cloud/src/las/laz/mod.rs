//! Compressed points (LAZ): their layout in a file, checked against its length before decoding, and decoding chunk by
//! chunk.

mod decode;
mod layers;
mod layout;
mod table;

pub(super) use decode::ChunkDecoder;
pub(super) use layout::{LazCompressor, LazLayout};
pub(super) use table::{LazChunk, LazChunkTable, read as table};
