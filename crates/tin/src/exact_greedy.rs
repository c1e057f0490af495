//! Reference implementation: inserts the one sample with the largest error, exactly, until none is left.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use super::exact::{self, ExactWorst};
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, TriangleScanState};
use super::tolerance::InsertionCriteria;

/// The worst sample of a triangle as it was when its `stamp` was current.
#[derive(Clone, Copy, Debug)]
struct QueuedSample {
    error: f64,
    at: TilePosition,
    id: u32,
    stamp: u32,
}

impl QueuedSample {
    /// Larger error first; among equals the lowest (row, column), then the lowest triangle.
    fn key(&self) -> (f64, Reverse<(TilePosition, u32)>) {
        (self.error, Reverse((self.at, self.id)))
    }
}

impl Ord for QueuedSample {
    fn cmp(&self, other: &Self) -> Ordering {
        let (a, b) = (self.key(), other.key());
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    }
}

impl PartialOrd for QueuedSample {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for QueuedSample {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for QueuedSample {}

/// Garland & Heckbert's algorithm III: a heap of candidates, full scans in `f64`, one insertion at
/// a time. Dirty triangles of the mesh are scanned first. Time O((m + n) log m) expected for m vertices
/// and n samples, with a large constant.
pub(super) fn insert(judge: &InsertionCriteria<'_>, mesh: &mut LatticeMesh) {
    let mut heap = BinaryHeap::new();
    let mut stamps = vec![0; mesh.tris.len()];
    let mut star: Vec<u32> =
        mesh.ids().filter(|&id| mesh.tris[id as usize].state == TriangleScanState::Dirty).collect();
    loop {
        stamps.resize(mesh.tris.len(), 0);
        for &id in &star {
            stamps[id as usize] += 1;
            heap.extend(candidate(judge, mesh, id, stamps[id as usize]));
        }
        star.clear();
        let entry = heap.pop().filter(|_| !judge.field.is_stopped());
        let Some(entry) = entry else { return };
        if stamps[entry.id as usize] == entry.stamp {
            mesh.insert(entry.id, entry.at, &mut star);
        }
    }
}

fn candidate(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    id: u32,
    stamp: u32,
) -> Option<QueuedSample> {
    let tri = &mut mesh.tris[id as usize];
    tri.state = TriangleScanState::Passed(0);
    let ExactWorst { error, at, within } = exact::scan(judge.field, tri.corners, judge.tolerance);
    (!within).then_some(QueuedSample { error, at, id, stamp })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::{distance, for_each_sample, within};
    use crate::heights::HeightField;
    use crate::heights::HeightWindow;
    use crate::mesh::FixedBorder;
    use crate::scan;
    use proptest::prelude::*;

    /// O(m n): looks at every sample of every triangle again before each insertion.
    fn insert_naively(judge: &InsertionCriteria<'_>, mesh: &mut LatticeMesh) {
        loop {
            let mut worst: Option<QueuedSample> = None;
            for id in mesh.ids() {
                let corners = mesh.tris[id as usize].corners;
                let z = judge.field.vertices(corners);
                for_each_sample(corners, judge.field.scan_bounds(), |at, weights| {
                    let height = judge.field.sample(at);
                    let error = distance(weights, z, height);
                    let entry = QueuedSample { error, at, id, stamp: 0 };
                    let fails = !within(weights, z, height, judge.tolerance);
                    if fails && worst.is_none_or(|worst| entry > worst) {
                        worst = Some(entry);
                    }
                });
            }
            let Some(worst) = worst else { return };
            mesh.insert(worst.id, worst.at, &mut Vec::new());
        }
    }

    proptest! {
        #[test]
        fn inserts_what_the_naive_twin_inserts(
            heights in proptest::collection::vec(-30_i16..30, 12 * 9), tolerance in 0_u8..25
        ) {
            let heights: Vec<f32> = heights.into_iter().map(f32::from).collect();
            let heights = HeightWindow { width: 12, height: 9, f32: &heights, f64: None };
            let mut field = HeightField::default();
            field.load(&heights, [0, 0, 12, 9], [1; 4], None);
            let judge = InsertionCriteria::of_samples(&field, scan::fastest(), tolerance.into());
            let (mut mesh, mut twin) = (LatticeMesh::default(), LatticeMesh::default());
            for mesh in [&mut mesh, &mut twin] {
                mesh.reset_to_rectangle(11, 8);
                mesh.fixed = FixedBorder::Inside { ends: [false; 4], cells: [11, 8] };
            }
            insert(&judge, &mut mesh);
            insert_naively(&judge, &mut twin);
            mesh.validate();
            let corners = |mesh: &LatticeMesh| mesh.tris.iter().map(|tri| tri.corners).collect::<Vec<_>>();
            prop_assert_eq!(corners(&mesh), corners(&twin));
        }
    }
}
