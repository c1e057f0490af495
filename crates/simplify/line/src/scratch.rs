//! Reused memory of methods, and lines too short to simplify.

/// Memory that methods reuse between calls, so that short lines need no allocation.
#[derive(Clone, Debug, Default)]
pub struct SimplifyScratch {
    /// Ends of pending ranges.
    pub(super) ends: Vec<usize>,
    /// Vertices at which three segments may end.
    pub(super) candidates: [Vec<u32>; 3],
    /// State of the shortest path per vertex.
    pub(super) nodes: Vec<PathNode>,
    /// Vertices of the current and the next layer of the search.
    pub(super) layer: Vec<u32>,
    pub(super) next_layer: Vec<u32>,
}

/// State of a vertex in the shortest path search.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathNode {
    /// Predecessor.
    pub(super) parent: u32,
    /// A vertex that was beyond the tolerance from the last segment tried.
    pub(super) spoiler: u32,
    /// Start of the search for the next unvisited vertex: itself while unvisited.
    pub(super) next: u32,
}

/// Appends all indices of a line too short to simplify; `true` if it was.
pub(super) fn keep_short(count: usize, kept: &mut Vec<u32>) -> bool {
    if count <= 2 {
        kept.extend(0..count as u32);
    }
    count <= 2
}
