//! The interface of methods that find noise.

use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_base::parameters::Parameter;

use super::score_statistics::ScoreSums;
use crate::method_call;
use crate::neighbors::{MetricSpace, NeighborParts};

/// One method of the registry.
pub type Method = method_call::FinderMethod<NoiseFinder>;
/// A method with its parameters.
pub type Request = method_call::FinderRequest<NoiseFinder>;

type Reach = fn(&Request, &MetricSpace) -> Result<[i64; 3]>;
type Scores = fn(&Request, &MetricSpace, &[Point], &mut dyn NeighborParts) -> Result<Vec<u64>>;

/// How a method finds noise.
#[derive(Clone, Copy, Debug)]
pub struct NoiseFinder {
    /// Distance in steps along each axis beyond which points do not affect a score; fails if the point cloud is
    /// unsuitable. `None` if the limit depends on all points.
    pub(super) reach: Option<Reach>,
    pub(super) scores: Scores,
    pub(super) limit: fn(&Request, &ScoreSums) -> ScoreLimit,
    /// Bytes that scores take for each point of a part.
    pub(super) bytes: fn(&Request) -> u64,
}

/// The class assigned to noise.
pub(super) const CLASS: Parameter =
    Parameter::new("class", 7.0, [7.0, 18.0], "noise class: 7 (low) or 18 (high)").ends();

/// The threshold of scores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScoreLimit {
    /// Noise has at most this number of points.
    Few(u64),
    /// Noise is above this distance, in [`MetricSpace::unit`]s.
    Far(f64),
}

impl ScoreLimit {
    /// Whether a score is noise.
    pub fn is_noise(&self, score: u64) -> bool {
        match self {
            Self::Few(max_points) => score <= *max_points,
            Self::Far(distance) => score as f64 > *distance,
        }
    }
}
