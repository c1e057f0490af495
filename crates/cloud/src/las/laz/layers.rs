//! The header of a layered chunk: first point, number of points, and bytes of each layer.

use crate::las::bytes::LasHeaderBytes;

use super::LazLayout;

/// Bytes of the header.
pub(super) fn head_bytes(layout: &LazLayout) -> u64 {
    (layout.record + 4 + 4 * layout.layers) as u64
}

/// Stated number of points of a chunk, and its bytes with the header.
pub(super) fn claims(layout: &LazLayout, head: &[u8]) -> (u64, u64) {
    let b = LasHeaderBytes(head);
    let points = b.u32(layout.record);
    let layers = (0..layout.layers).map(|i| u64::from(b.u32(layout.record + 4 + 4 * i)));
    (points.into(), head_bytes(layout) + layers.sum::<u64>())
}
