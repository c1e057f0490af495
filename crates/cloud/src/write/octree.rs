//! VLRs of an octree (COPC 1.0): the root cube, and the offsets of the nodes.

use std::collections::BTreeMap;

use super::header_statistics::PointTally;
use super::vlr::Vlr;
use crate::las::OCTREE;

const INFO: u16 = 1;
const HIERARCHY: u16 = 1000;
/// Bytes of the header of an EVLR.
const HEAD: u64 = 60;
/// Reserved numbers in the info VLR.
const RESERVED: usize = 11;

/// Key of a node: level, and indices along x, y and z.
pub type Key = [i32; 4];

/// The root cube, and the number of cells along a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OctreeCube {
    /// Lowest corner, in world units.
    pub low: [f64; 3],
    /// Length of a side.
    pub side: f64,
    /// Cells along a side of each node.
    pub cells: u32,
}

/// Nodes with points, in the order they were written.
#[derive(Debug, Default)]
pub(super) struct OctreeNodes(Vec<(Key, [u64; 3])>);

impl OctreeNodes {
    /// Adds a node with its offset, size in bytes and number of points.
    pub(super) fn push(&mut self, key: Key, place: [u64; 3]) {
        self.0.push((key, place));
    }

    /// The hierarchy EVLR. Readers descend from the root, so all ancestors of a node are entries: ancestors without
    /// points have no offset.
    pub(super) fn hierarchy(&self) -> Vlr {
        let mut nodes: BTreeMap<Key, [u64; 3]> = BTreeMap::from([([0; 4], [0; 3])]);
        nodes.extend(self.0.iter().copied());
        for above in self.0.iter().flat_map(|(key, _)| above(*key)) {
            nodes.entry(above).or_default();
        }
        let mut data = Vec::new();
        for (key, [at, bytes, points]) in nodes {
            data.extend(key.map(i32::to_le_bytes).concat());
            data.extend(at.to_le_bytes());
            data.extend([bytes, points].iter().flat_map(|count| (*count as i32).to_le_bytes()));
        }
        Vlr { user: OCTREE.into(), number: HIERARCHY, about: "EPT hierarchy".into(), data }
    }
}

/// The ancestors of a node, up to the root.
fn above(key: Key) -> impl Iterator<Item = Key> {
    std::iter::successors(parent(&key), parent)
}

fn parent([level, x, y, z]: &Key) -> Option<Key> {
    (*level > 0).then(|| [level - 1, x / 2, y / 2, z / 2])
}

/// The info VLR of a file whose first EVLR, at byte `evlr_at`, is the hierarchy of `bytes` bytes.
pub(super) fn info(cube: &OctreeCube, tally: &PointTally, evlr_at: u64, bytes: u64) -> Vlr {
    let half = cube.side / 2.0;
    let middle = cube.low.map(|low| low + half);
    let spacing = cube.side / f64::from(cube.cells);
    let mut data: Vec<u8> =
        middle.into_iter().chain([half, spacing]).flat_map(f64::to_le_bytes).collect();
    data.extend([evlr_at + HEAD, bytes].iter().flat_map(|number| number.to_le_bytes()));
    data.extend(tally.times().iter().flat_map(|time| time.to_le_bytes()));
    data.resize(data.len() + RESERVED * 8, 0);
    Vlr { user: OCTREE.into(), number: INFO, about: "COPC info VLR".into(), data }
}
