//! terrane's own grid store: an uncompressed tiled BigTIFF with page-aligned tiles, memory-mapped.
