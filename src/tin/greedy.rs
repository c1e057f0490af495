//! Greedy insertion: adaptive-stride scans by default, one global maximum at a time on demand.

use super::Local;
use super::exact;
use super::field::{Field, LEVELS};
use super::mesh::{Mesh, State};
use super::scan::{Facet, Scan, double_area, level_for};

/// Samples a first scan of a triangle looks at, about.
const SAMPLES_PER_SCAN: i64 = 32;
/// How many levels finer a triangle that passed is scanned next.
const REFINE_STEP: u8 = 2;

/// What every step of the insertion needs to know.
#[derive(Clone, Copy)]
pub(super) struct Judge<'a> {
    pub(super) field: &'a Field,
    pub(super) scan: Scan,
    pub(super) tolerance: f64,
}

impl Judge<'_> {
    /// The sample of triangle `p` to insert, or `None` when every sample of the decimated copy
    /// `level` is within the tolerance. At level 0 the answer is exact: scans in `f32` decide only
    /// where their rounding cannot matter.
    #[inline]
    pub(super) fn candidate(&self, p: [Local; 3], level: u8) -> Option<Local> {
        if double_area(p) == 1 {
            return None; // Half a cell: its corners are its only samples (Pick's theorem).
        }
        let z = self.field.vertices(p);
        let worst = (self.scan)(&self.field.level(level), &Facet::new(p, z));
        let error = f64::from(worst.error);
        let hair = self.hair(z);
        if error > self.tolerance + hair {
            Some(worst.at)
        } else if level > 0 || error < self.tolerance - hair {
            None
        } else {
            let worst = exact::scan(self.field, p, self.tolerance);
            (!worst.within).then_some(worst.at)
        }
    }

    /// More than the rounding error of an `f32` scan: some ten roundings of 2^-24 relative to the
    /// largest height involved.
    #[inline]
    fn hair(&self, z: [f64; 3]) -> f64 {
        const ROUNDING: f64 = 1.0 / (1 << 20) as f64;
        let largest = z.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
        (largest + self.tolerance) * ROUNDING
    }
}

/// Work lists, kept between tiles.
#[derive(Debug, Default)]
pub(super) struct WorkLists {
    dirty: Vec<u32>,
    passed: Vec<u32>,
    star: Vec<u32>,
}

/// Inserts samples until every sample of every triangle is within the tolerance. `dirty` triangles
/// of the mesh are scanned; the others are taken to be within. `visit` is told of every insertion
/// with the triangles around the new vertex and may stop the run by returning false.
///
/// A triangle is first scanned at the stride that gives about [`SAMPLES_PER_SCAN`] samples. When no
/// dirty triangle is left, those that passed at a coarse stride are scanned finer, and so on until
/// all have passed at stride 1.
pub(super) fn insert_adaptive(
    judge: &Judge<'_>,
    mesh: &mut Mesh,
    lists: &mut WorkLists,
    visit: impl Fn(&Mesh, &[u32]) -> bool,
) -> bool {
    let WorkLists { dirty, passed, star } = lists;
    dirty.clear();
    passed.clear();
    dirty.extend(mesh.ids().filter(|&id| mesh.tris[id as usize].state == State::Dirty));
    loop {
        let mut next = 0;
        while next < dirty.len() {
            let id = dirty[next];
            next += 1;
            let tri = mesh.tris[id as usize];
            let level = match tri.state {
                State::Dirty => level_for(tri.corners, SAMPLES_PER_SCAN, LEVELS),
                State::Passed(level) if level > 0 => level.saturating_sub(REFINE_STEP),
                _ => continue,
            };
            let Some(at) = judge.candidate(tri.corners, level) else {
                mesh.tris[id as usize].state = State::Passed(level);
                if level > 0 {
                    passed.push(id);
                }
                continue;
            };
            star.clear();
            if !mesh.insert(id, at, star) {
                mesh.tris[id as usize].state = State::Passed(0);
                continue;
            }
            if !visit(mesh, star) {
                return false;
            }
            dirty.extend_from_slice(star);
        }
        dirty.clear();
        if passed.is_empty() {
            return true;
        }
        std::mem::swap(dirty, passed);
    }
}
