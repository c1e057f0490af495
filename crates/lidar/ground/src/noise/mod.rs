//! Which points of a cloud are noise: methods by name, from the points around each.
//!
//! A method ([`METHODS`], [`Asked`]) gives each point of a part of the cloud a score, from the points of the part and
//! those [`Around`] it; a score is a function of all points, however these are put into parts. Which scores are noise
//! ([`Limit`]) may depend on those of all points, of which whole-number sums are kept ([`Sums`]): they are the same
//! whatever the order.

mod statistical;
mod sums;
mod tree;
mod voxel;

use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;
use terrane_base::parameters::Parameter;

use crate::asked::{self, Finder};
pub use sums::Sums;

/// All methods. A new one is a file in this folder and a line here.
pub const METHODS: &[Method] = &[voxel::METHOD, statistical::METHOD];

/// One method of the registry.
pub type Method = asked::Method<NoiseFinder>;
/// A method with its parameters.
pub type Asked = asked::Asked<NoiseFinder>;

type Reach = fn(&Asked, &Space) -> Result<[i64; 3]>;
type Scores = fn(&Asked, &Space, &[Point], &mut dyn Around) -> Result<Vec<u64>>;

/// How a method finds noise.
#[derive(Clone, Copy, Debug)]
pub struct NoiseFinder {
    /// Steps along each axis beyond which no other point changes a score, or fails where the cloud does not suit it;
    /// `None` where a limit depends on all points.
    reach: Option<Reach>,
    scores: Scores,
    limit: fn(&Asked, &Sums) -> Limit,
    /// Bytes that scores take for each point of a part.
    bytes: fn(&Asked) -> u64,
}

impl Finder for NoiseFinder {
    const KIND: &'static str = "noise method";
    const METHODS: &'static [Method] = METHODS;
}

/// The class that noise gets.
const CLASS: Parameter =
    Parameter::new("class", 7.0, [7.0, 18.0], "the class of noise: 7, low, or 18, high").ends();

/// Where points lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Space {
    /// Metres of a step along each axis.
    pub step: [f64; 3],
    /// Steps from where coordinates are zero to the origin.
    pub zero: [i64; 3],
}

/// The lowest and the highest coordinates of some points.
pub type Bounds = [Point; 2];

/// The points around a part of a cloud, in parts of their own.
pub trait Around {
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
pub enum Limit {
    /// Those up to a number of points.
    Few(u64),
    /// Those above a distance, in [`Space::unit`]s.
    Far(f64),
}

impl Limit {
    /// Whether a score is.
    pub fn is_noise(&self, score: u64) -> bool {
        match self {
            Self::Few(most) => score <= *most,
            Self::Far(most) => score as f64 > *most,
        }
    }
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
    pub fn reach(&self, space: &Space) -> Result<[i64; 3]> {
        self.finder().reach.map_or(Ok([0; 3]), |reach| reach(self, space))
    }

    /// The score of each point of a part.
    ///
    /// # Errors
    /// What is around it cannot be read.
    pub fn scores(
        &self,
        space: &Space,
        own: &[Point],
        around: &mut dyn Around,
    ) -> Result<Vec<u64>> {
        (self.finder().scores)(self, space, own, around)
    }

    /// Which scores are noise, all of them having these sums; of a local method, whatever they are.
    pub fn limit(&self, sums: &Sums) -> Limit {
        (self.finder().limit)(self, sums)
    }

    /// Bytes of memory for the scores of a part of so many points, with another of as many beside it.
    pub fn bytes(&self, points: u64) -> u64 {
        points * (self.finder().bytes)(self)
    }
}

/// Parts of the longest step that distances are counted in.
const PARTS: f64 = 1024.0;

impl Space {
    /// Metres of the unit that distances are counted in.
    pub fn unit(&self) -> f64 {
        self.step.into_iter().fold(0.0, f64::max) / PARTS
    }

    /// The squared distance of two points, in square metres.
    fn between(&self, a: Point, b: Point) -> f64 {
        self.square(apart(a, b).map(f64::abs))
    }

    /// The same of steps along the axes. No number of it gets less when steps get more: bounds hold for what is within
    /// them to the last bit.
    fn square(&self, steps: [f64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| steps[axis] * self.step[axis]);
        x * x + y * y + z * z
    }

    /// The squared distance of two boxes, in square metres.
    pub fn gap(&self, a: Bounds, b: Bounds) -> f64 {
        self.square(gaps(a, b))
    }
}

/// Steps from a point to another.
fn apart(a: Point, b: Point) -> [f64; 3] {
    [(a.x, b.x), (a.y, b.y), (a.z, b.z)].map(|(a, b)| f64::from(b) - f64::from(a))
}

/// Steps between two boxes along each axis.
fn gaps(a: Bounds, b: Bounds) -> [f64; 3] {
    let (over, under) = (apart(a[1], b[0]), apart(b[1], a[0]));
    [0, 1, 2].map(|axis| over[axis].max(under[axis]).max(0.0))
}

/// The bounds of some points; `None` of none.
fn bounds(points: impl Iterator<Item = Point>) -> Option<Bounds> {
    points.map(|point| [point; 2]).reduce(|[low, high], [point, _]| {
        [
            Point { x: low.x.min(point.x), y: low.y.min(point.y), z: low.z.min(point.z) },
            Point { x: high.x.max(point.x), y: high.y.max(point.y), z: high.z.max(point.z) },
        ]
    })
}

/// A cube smaller than a step of the points.
fn too_small(side: f64, step: f64) -> Error {
    Error::usage(format!("cubes of {side} m are smaller than a step of the points, {step} m"))
        .remedy("choose larger ones with step=")
}

#[cfg(test)]
mod tests;
