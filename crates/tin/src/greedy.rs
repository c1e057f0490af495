//! Greedy insertion: adaptive-stride scans by default, one global maximum at a time on demand.
//!
//! Three things make it fast. The tile is copied into a contiguous array together with
//! coarser copies of itself; a triangle is scanned first at the stride that gives a few dozen samples,
//! and only triangles that pass are scanned more finely, down to every sample. A scan finds the largest
//! distance from the plane in vector registers. And all of it stays in the L2 cache, because a tile is
//! small. Every triangle that survives has been scanned in full.
//!
//! Measured: a first scan of about 64 samples instead of 32 leaves 1.2 % fewer vertices at 5 % kept (876
//! against 887 thousand, rough 4097 x 4097), as fast within 2 %. Insertion in spatial order within a
//! batch is slower: sorting costs more than the cache gives back (37 against 26.6 ns).

use super::facet::level_for;
use super::heights::LEVELS;
use super::lattice_position::TilePosition;
use super::mesh::{LatticeMesh, TriangleScanState};
use super::tolerance::{InsertionCandidate, InsertionCriteria};
use super::{adjust, exact_greedy};

/// Approximate number of samples in the first scan of a triangle.
const SAMPLES_PER_SCAN: i64 = 64;
/// Number of levels by which the next scan of a triangle is finer.
const REFINE_STEP: u8 = 2;

/// Inserts samples until every sample of the dirty triangles is within the tolerance.
pub(super) fn fit(
    judge: &InsertionCriteria<'_>,
    mesh: &mut LatticeMesh,
    lists: &mut WorkLists,
    strict: bool,
) {
    if strict {
        exact_greedy::insert(judge, mesh);
    } else {
        insert_adaptive(judge, mesh, lists);
    }
}

/// Number of candidate buckets; the last one takes all larger errors, and all triangles at the start.
const BUCKETS: usize = 64;

/// Work lists, reused between tiles.
#[derive(Debug, Default)]
pub(super) struct WorkLists {
    /// Triangles by the magnitude of their error; see [`bucket_of`].
    buckets: Vec<Vec<u32>>,
    /// All buckets above this one are empty.
    top: usize,
    /// The bucket being emptied.
    batch: Vec<u32>,
    /// The last candidate found for a triangle.
    candidates: Vec<InsertionCandidate>,
    passed: Vec<(u32, u8)>,
    star: Vec<u32>,
}

/// Errors within a factor of about 1.4 share a bucket; larger errors have higher buckets. The bits of a float
/// approximate its logarithm (Mitchell 1962).
fn bucket_of(error: f32, tolerance: f64) -> usize {
    const BITS: u32 = 22;
    let [error, tolerance] =
        [error, tolerance as f32].map(|value| (value.to_bits() >> BITS) as usize);
    error.saturating_sub(tolerance).min(BUCKETS - 1)
}

/// Inserts samples until every sample of every triangle is within the tolerance. `dirty` triangles
/// of the mesh are scanned; the others are taken to be within.
///
/// Candidates with larger errors are inserted first, up to the width of a bucket. A new triangle
/// waits, unscanned, a quarter of the way further down to the tolerance: often it is gone before its turn.
///
/// A triangle is first scanned at the stride that gives about [`SAMPLES_PER_SCAN`] samples. When no
/// candidate is left, those that passed at a coarse stride are scanned finer, and so on until all
/// have passed at stride 1.
fn insert_adaptive(judge: &InsertionCriteria<'_>, mesh: &mut LatticeMesh, lists: &mut WorkLists) {
    lists.begin(mesh);
    // Over all batches, as most are small.
    let mut rounds = 0_usize;
    loop {
        while let Some(bucket) = lists.next_batch() {
            for i in 0..lists.batch.len() {
                rounds += 1;
                if judge.field.is_stopped_in(rounds) {
                    return;
                }
                let id = lists.batch[i];
                if let Some(at) = lists.due(judge, mesh, id, bucket) {
                    lists.insert(judge, mesh, id, at, bucket);
                }
            }
        }
        if judge.field.is_stopped() || !lists.refine(judge, mesh) {
            return;
        }
    }
}

impl WorkLists {
    fn begin(&mut self, mesh: &LatticeMesh) {
        self.passed.clear();
        self.buckets.resize_with(BUCKETS, Vec::new);
        self.buckets.iter_mut().for_each(Vec::clear);
        let dirty =
            mesh.ids().filter(|&id| mesh.tris[id as usize].state == TriangleScanState::Dirty);
        self.buckets[BUCKETS - 1].extend(dirty);
        self.top = BUCKETS - 1;
    }

    /// Takes the non-empty bucket with the largest errors.
    fn next_batch(&mut self) -> Option<usize> {
        let bucket = self.buckets[..=self.top].iter().rposition(|bucket| !bucket.is_empty())?;
        self.top = bucket;
        self.batch.clear();
        // The bucket may be added to while the batch is worked on.
        std::mem::swap(&mut self.batch, &mut self.buckets[bucket]);
        Some(bucket)
    }

    /// The sample of a triangle to insert now, if its error belongs to this bucket or a higher one.
    fn due(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &mut LatticeMesh,
        id: u32,
        bucket: usize,
    ) -> Option<TilePosition> {
        let tri = mesh.tris[id as usize];
        match tri.state {
            TriangleScanState::Dirty => {
                let level = level_for(tri.corners, SAMPLES_PER_SCAN, LEVELS);
                self.scan(judge, mesh, id, level, bucket)
            }
            TriangleScanState::Waiting => {
                let candidate = self.candidates[id as usize];
                // Lists are not cleaned when a triangle goes, and its slot may hold another by now. What is not
                // of this bucket has an entry elsewhere.
                (bucket_of(candidate.error, judge.tolerance) == bucket).then_some(candidate.at)
            }
            _ => None,
        }
    }

    /// Scans a triangle; a candidate below `bucket` is put into its own.
    fn scan(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &mut LatticeMesh,
        id: u32,
        level: u8,
        bucket: usize,
    ) -> Option<TilePosition> {
        let tri = &mut mesh.tris[id as usize];
        let Some(candidate) = judge.candidate(tri.corners, level) else {
            tri.state = TriangleScanState::Passed(level);
            if level > 0 {
                self.passed.push((id, level));
            }
            return None;
        };
        let candidate_bucket = bucket_of(candidate.error, judge.tolerance);
        if candidate_bucket >= bucket {
            return Some(candidate.at);
        }
        tri.state = TriangleScanState::Waiting;
        self.put(id, candidate, candidate_bucket);
        None
    }

    fn put(&mut self, id: u32, candidate: InsertionCandidate, bucket: usize) {
        if self.candidates.len() <= id as usize {
            self.candidates.resize(id as usize + 1, candidate);
        }
        self.candidates[id as usize] = candidate;
        self.buckets[bucket].push(id);
        self.top = self.top.max(bucket);
    }

    /// Inserts a sample of `bucket`; the new triangles wait below it.
    fn insert(
        &mut self,
        judge: &InsertionCriteria<'_>,
        mesh: &mut LatticeMesh,
        id: u32,
        at: TilePosition,
        bucket: usize,
    ) {
        self.star.clear();
        let corners = mesh.tris[id as usize].corners;
        if mesh.insert(id, at, &mut self.star) {
            if judge.field.is_free() {
                adjust::put_in(judge, corners, at);
            }
            // Scanned at once, most new triangles would be scanned in vain: the next samples of this bucket
            // replace them.
            self.buckets[bucket * 3 / 4].extend_from_slice(&self.star);
        } else {
            mesh.tris[id as usize].state = TriangleScanState::Passed(0);
        }
    }

    /// Rescans triangles that passed at a coarse stride more finely; false if none is left.
    fn refine(&mut self, judge: &InsertionCriteria<'_>, mesh: &mut LatticeMesh) -> bool {
        let passed = std::mem::take(&mut self.passed);
        for (round, &(id, level)) in passed.iter().enumerate() {
            if judge.field.is_stopped_in(round) {
                return false;
            }
            if mesh.tris[id as usize].state == TriangleScanState::Passed(level) {
                let finer = level.saturating_sub(REFINE_STEP);
                self.scan(judge, mesh, id, finer, usize::MAX);
            }
        }
        !passed.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_grow_with_the_logarithm_of_errors() {
        let buckets = [0.5, 1.0, 1.5, 2.0, 4.0, 1e30].map(|error| bucket_of(error, 1.0));
        assert_eq!(buckets, [0, 0, 1, 2, 4, BUCKETS - 1]);
        assert_eq!(bucket_of(6.0, 3.0), 2);
    }
}
