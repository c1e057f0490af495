//! Noise classification: methods by name, from the neighbours of each point.
//!
//! A method ([`METHODS`], [`Request`]) assigns a score to each point of a part of the point cloud, from the
//! points of the part and those around it ([`NeighborParts`]); a score does not depend on the division into
//! parts. The threshold ([`ScoreLimit`]) may depend on the scores of all points, by integer sums
//! ([`ScoreSums`]) that are independent of the order.

mod finder;
mod score_statistics;
mod statistical;
mod voxel;

use terrane_base::error::Result;
use terrane_base::geom::Point;

use crate::method_call::FinderRegistry;
use crate::neighbors::{MetricSpace, NeighborParts};
use finder::CLASS;

pub use finder::{Method, NoiseFinder, Request, ScoreLimit};
pub use score_statistics::ScoreSums;

/// All methods. A new one is a file in this folder and a line here.
pub const METHODS: &[Method] = &[voxel::METHOD, statistical::METHOD];

impl FinderRegistry for NoiseFinder {
    const KIND: &'static str = "noise method";
    const METHODS: &'static [Method] = METHODS;
}

impl Request {
    /// The default method.
    pub const DEFAULT: Self = Self::plain(&voxel::METHOD);

    /// The class assigned to noise.
    pub fn class(&self) -> u8 {
        self.value(CLASS.key) as u8
    }

    /// Whether noise depends on nearby points only.
    pub fn is_local(&self) -> bool {
        self.finder().reach.is_some()
    }

    /// Distance in steps along each axis beyond which points do not matter; zeros if the method is not local.
    ///
    /// # Errors
    /// Point clouds that are unsuitable for the method.
    pub fn reach(&self, space: &MetricSpace) -> Result<[i64; 3]> {
        self.finder().reach.map_or(Ok([0; 3]), |reach| reach(self, space))
    }

    /// The score of each point of a part.
    ///
    /// # Errors
    /// Errors of reading the neighbours.
    pub fn scores(
        &self,
        space: &MetricSpace,
        own: &[Point],
        around: &mut dyn NeighborParts,
    ) -> Result<Vec<u64>> {
        (self.finder().scores)(self, space, own, around)
    }

    /// The threshold of scores, from their sums; a local method ignores them.
    pub fn limit(&self, sums: &ScoreSums) -> ScoreLimit {
        (self.finder().limit)(self, sums)
    }

    /// Bytes of memory for the scores of a part of `points`, with another part of that size beside it.
    pub fn bytes(&self, points: u64) -> u64 {
        points * (self.finder().bytes)(self)
    }
}

#[cfg(test)]
mod tests;
