//! Memory that methods reuse between calls, and lines too short for any method.

/// Memory that methods keep between calls, so that many short lines cost no allocation.
#[derive(Clone, Debug, Default)]
pub struct SimplifyScratch {
    /// Ends of ranges still to be looked at.
    pub(super) ends: Vec<usize>,
    /// Vertices at which three segments may end.
    pub(super) candidates: [Vec<u32>; 3],
    /// What the shortest path knows of each vertex.
    pub(super) nodes: Vec<PathNode>,
    /// Vertices of one layer of the search, and of the next.
    pub(super) layer: Vec<u32>,
    pub(super) next_layer: Vec<u32>,
}

/// What a search for the shortest path knows of a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathNode {
    /// The vertex it was reached from.
    pub(super) parent: u32,
    /// A vertex that was beyond the tolerance from the last segment tried.
    pub(super) spoiler: u32,
    /// A vertex from which on to look for the next unvisited one: itself while it is unvisited.
    pub(super) next: u32,
}

/// Appends all indices of a line that is too short to lose any: `true` if it was.
pub(super) fn keep_short(count: usize, kept: &mut Vec<u32>) -> bool {
    if count <= 2 {
        kept.extend(0..count as u32);
    }
    count <= 2
}
