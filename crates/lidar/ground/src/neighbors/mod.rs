//! The points nearest to each point of a part of a point cloud, whatever part they are in.

mod position;
mod tree;

use terrane_base::error::Result;
use terrane_base::geom::Point;

use tree::PointKdTree;

pub(crate) use position::bounds;
pub use position::{Bounds, MetricSpace};

/// The points around a part of a cloud, in parts of their own.
pub trait NeighborParts {
    /// The bounds of the next part, the nearest first; `None` if its squared distance from the bounds of the
    /// part, in square metres, is not below `within`, which must not increase between calls.
    fn next(&mut self, within: f64) -> Option<Bounds>;

    /// Adds the points of that part.
    ///
    /// # Errors
    /// Read errors.
    fn load(&mut self, points: &mut Vec<Point>) -> Result<()>;
}

/// A point near another: its squared distance in square metres, or that and more. The least is the nearest.
pub trait Neighbor: Copy + PartialOrd {
    /// No point.
    const NONE: Self;

    /// The point at a squared distance.
    fn new(square: f64, point: Point) -> Self;

    /// Its squared distance.
    fn square(self) -> f64;
}

impl Neighbor for f64 {
    const NONE: Self = Self::INFINITY;

    fn new(square: f64, _: Point) -> Self {
        square
    }

    fn square(self) -> f64 {
        self
    }
}

/// Points at equal distances are in the order of their coordinates: which of them are the nearest does not depend on the
/// parts.
impl Neighbor for (f64, Point) {
    const NONE: Self = (f64::INFINITY, Point { x: i32::MAX, y: i32::MAX, z: i32::MAX });

    fn new(square: f64, point: Point) -> Self {
        (square, point)
    }

    fn square(self) -> f64 {
        self.0
    }
}

/// The nearest points of each point of a part.
pub struct NearestPoints<N> {
    each: usize,
    all: Vec<N>,
}

impl<N: Neighbor> NearestPoints<N> {
    /// Those of a point, the nearest first, which is at the place of the point itself; [`Neighbor::NONE`] where the
    /// cloud has no more.
    pub fn of(&self, point: usize) -> &[N] {
        &self.all[point * self.each..(point + 1) * self.each]
    }

    fn of_mut(&mut self, point: u32) -> &mut [N] {
        let first = point as usize * self.each;
        &mut self.all[first..first + self.each]
    }

    fn furthest(&self, point: u32) -> f64 {
        self.all[(point as usize + 1) * self.each - 1].square()
    }

    fn furthest_of(&self, points: &[u32]) -> f64 {
        points.iter().map(|point| self.furthest(*point)).fold(0.0, f64::max)
    }
}

/// The `each` nearest points of each point of a part, itself included.
///
/// # Errors
/// Those of reading the parts around it.
pub fn nearest<N: Neighbor>(
    each: usize,
    space: &MetricSpace,
    own: &[Point],
    around: &mut dyn NeighborParts,
) -> Result<NearestPoints<N>> {
    let mut nearest = NearestPoints { each, all: vec![N::NONE; each * own.len()] };
    let tree = PointKdTree::new(space, own.to_vec());
    let mut open: Vec<u32> = (0..own.len() as u32).collect();
    open.iter().for_each(|i| tree.search(own[*i as usize], nearest.of_mut(*i)));
    drop(tree);
    let Some(all) = bounds(own.iter().copied()) else { return Ok(nearest) };
    let mut read = Vec::new();
    loop {
        open.retain(|i| nearest.furthest(*i) > 0.0);
        // A point at the same distance as the furthest known one may come before it.
        let most = nearest.furthest_of(&open);
        let within = if open.is_empty() { 0.0 } else { most.next_up() };
        let Some(next) = around.next(within) else { break };
        // All that follow are no nearer.
        let away = space.gap(all, next);
        open.retain(|i| nearest.furthest(*i) >= away);
        let near: Vec<u32> = open
            .iter()
            .copied()
            .filter(|i| space.gap([own[*i as usize]; 2], next) <= nearest.furthest(*i))
            .collect();
        let Some(near_bounds) = bounds(near.iter().map(|i| own[*i as usize])) else { continue };
        let within = nearest.furthest_of(&near);
        read.clear();
        around.load(&mut read)?;
        read.retain(|point| space.gap([*point; 2], near_bounds) <= within);
        let tree = PointKdTree::new(space, std::mem::take(&mut read));
        near.iter().for_each(|i| tree.search(own[*i as usize], nearest.of_mut(*i)));
    }
    Ok(nearest)
}
