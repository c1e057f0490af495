//! Samples that have to be vertices, at the heights they have.

use super::lattice_position::HeightPrecision;
use super::part::GridProofPart;
use super::surface::ProofSurface;
use super::totals::ProofTally;
use super::triangle::ProofPosition;

/// Which of them a part has.
pub(crate) struct RequiredVertexCheck<'a> {
    part: &'a GridProofPart<'a>,
    is_vertex: Vec<bool>,
}

impl<'a> RequiredVertexCheck<'a> {
    pub(crate) fn new(part: &'a GridProofPart<'a>) -> Self {
        Self { part, is_vertex: vec![false; part.kept.len()] }
    }

    /// Takes note of a position where triangles have corners at these heights. Heights that are fitted have to
    /// be those of samples here all the same.
    pub(crate) fn corner(&mut self, at: ProofPosition, heights: &[f64]) {
        let Ok(place) = self.part.kept.binary_search(&at) else { return };
        let sample = self.part.sample(at);
        let is =
            |precision: HeightPrecision, z| sample.is_some_and(|sample| precision.is(z, sample));
        self.is_vertex[place] = heights.iter().all(|&z| is(self.part.precision, z));
    }

    /// Counts those of the surface, and the ones that are missing.
    pub(crate) fn finish(self, surface: &ProofSurface, tally: &mut ProofTally) {
        for (&at, is_vertex) in self.part.kept.iter().zip(self.is_vertex) {
            if surface.has_sample(at) {
                tally.kept += 1;
                if !is_vertex {
                    tally.not_kept.add(at);
                }
            }
        }
    }
}
