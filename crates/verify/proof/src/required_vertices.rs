//! Samples that have to be vertices, at the heights they have.

use super::part::GridProofPart;
use super::surface::ProofSurface;
use super::totals::ProofTally;
use super::triangle::ProofPosition;

/// Required samples of a part, and whether they are vertices.
pub(crate) struct RequiredVertexCheck<'a> {
    part: &'a GridProofPart<'a>,
    is_vertex: Vec<bool>,
}

impl<'a> RequiredVertexCheck<'a> {
    pub(crate) fn new(part: &'a GridProofPart<'a>) -> Self {
        Self { part, is_vertex: vec![false; part.kept.len()] }
    }

    /// Takes note of a position where triangles have corners at these heights. They have to be those of the sample,
    /// even in a mesh with fitted heights.
    pub(crate) fn corner(&mut self, at: ProofPosition, heights: &[f64]) {
        let Ok(place) = self.part.kept.binary_search(&at) else { return };
        let Some(sample) = self.part.sample(at) else { return };
        self.is_vertex[place] = heights.iter().all(|&z| self.part.precision.is(z, sample));
    }

    /// Counts required samples of the surface, and the missing ones.
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
