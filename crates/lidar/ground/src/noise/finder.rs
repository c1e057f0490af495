//! The interface of methods that find noise.

use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_base::parameters::Parameter;

use super::space::{Bounds, NoiseSpace};
use super::sums::ScoreSums;
use crate::asked;

/// One method of the registry.
pub type Method = asked::FinderMethod<NoiseFinder>;
/// A method with its parameters.
pub type Asked = asked::FinderRequest<NoiseFinder>;

type Reach = fn(&Asked, &NoiseSpace) -> Result<[i64; 3]>;
type Scores = fn(&Asked, &NoiseSpace, &[Point], &mut dyn NeighborParts) -> Result<Vec<u64>>;

/// How a method finds noise.
#[derive(Clone, Copy, Debug)]
pub struct NoiseFinder {
    /// Steps along each axis beyond which no other point changes a score, or fails where the cloud does not suit it;
    /// `None` where a limit depends on all points.
    pub(super) reach: Option<Reach>,
    pub(super) scores: Scores,
    pub(super) limit: fn(&Asked, &ScoreSums) -> ScoreLimit,
    /// Bytes that scores take for each point of a part.
    pub(super) bytes: fn(&Asked) -> u64,
}

/// The class that noise gets.
pub(super) const CLASS: Parameter =
    Parameter::new("class", 7.0, [7.0, 18.0], "noise class: 7 (low) or 18 (high)").ends();

/// The points around a part of a cloud, in parts of their own.
pub trait NeighborParts {
    /// The bounds of the next part, the nearest first; `None` where the square of its distance from the bounds of the
    /// part, in square metres, is not below `within`, which must not grow from call to call.
    fn next(&mut self, within: f64) -> Option<Bounds>;

    /// Adds the points of that part.
    ///
    /// # Errors
    /// What cannot be read.
    fn load(&mut self, points: &mut Vec<Point>) -> Result<()>;
}

/// Which scores are noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScoreLimit {
    /// Those up to a number of points.
    Few(u64),
    /// Those above a distance, in [`NoiseSpace::unit`]s.
    Far(f64),
}

impl ScoreLimit {
    /// Whether a score is.
    pub fn is_noise(&self, score: u64) -> bool {
        match self {
            Self::Few(most) => score <= *most,
            Self::Far(most) => score as f64 > *most,
        }
    }
}
