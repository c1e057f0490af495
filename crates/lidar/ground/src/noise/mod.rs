//! Which points of a cloud are noise: methods by name, from the points around each.
//!
//! A method ([`METHODS`], [`Asked`]) gives each point of a part of the cloud a score, from the points of the part and
//! those around it ([`NeighborParts`]); a score is a function of all points, however these are put into parts. Which scores are noise
//! ([`ScoreLimit`]) may depend on those of all points, of which whole-number sums are kept ([`ScoreSums`]): they are the same
//! whatever the order.

mod finder;
mod space;
mod statistical;
mod sums;
mod tree;
mod voxel;

use terrane_base::error::Result;
use terrane_base::geom::Point;

use crate::asked::FinderRegistry;
use finder::CLASS;

pub use finder::{Asked, Method, NeighborParts, NoiseFinder, ScoreLimit};
pub use space::{Bounds, NoiseSpace};
pub use sums::ScoreSums;

/// All methods. A new one is a file in this folder and a line here.
pub const METHODS: &[Method] = &[voxel::METHOD, statistical::METHOD];

impl FinderRegistry for NoiseFinder {
    const KIND: &'static str = "noise method";
    const METHODS: &'static [Method] = METHODS;
}

impl Asked {
    /// The method that is taken where none is named.
    pub const BEST: Self = Self::plain(&voxel::METHOD);

    /// The class that noise gets.
    pub fn class(&self) -> u8 {
        self.value(CLASS.key) as u8
    }

    /// Whether a point is noise is a matter of those near it alone.
    pub fn is_local(&self) -> bool {
        self.finder().reach.is_some()
    }

    /// Steps along each axis beyond which no other point matters; zeros where it is no matter of those near it.
    ///
    /// # Errors
    /// Points that lie so that the method cannot act.
    pub fn reach(&self, space: &NoiseSpace) -> Result<[i64; 3]> {
        self.finder().reach.map_or(Ok([0; 3]), |reach| reach(self, space))
    }

    /// The score of each point of a part.
    ///
    /// # Errors
    /// What is around it cannot be read.
    pub fn scores(
        &self,
        space: &NoiseSpace,
        own: &[Point],
        around: &mut dyn NeighborParts,
    ) -> Result<Vec<u64>> {
        (self.finder().scores)(self, space, own, around)
    }

    /// Which scores are noise, all of them having these sums; of a local method, whatever they are.
    pub fn limit(&self, sums: &ScoreSums) -> ScoreLimit {
        (self.finder().limit)(self, sums)
    }

    /// Bytes of memory for the scores of a part of so many points, with another of as many beside it.
    pub fn bytes(&self, points: u64) -> u64 {
        points * (self.finder().bytes)(self)
    }
}

#[cfg(test)]
mod tests;
