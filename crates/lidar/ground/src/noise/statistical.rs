//! Statistical outliers: points whose nearest neighbours are further away than usual.
//!
//! After Rusu, Marton, Blodow, Dolha & Beetz, "Towards 3D point cloud based object maps for household
//! environments" (2008), as in `filters.outlier` of PDAL and `sor` of lidR: a point is noise if the mean
//! distance to its `k` nearest neighbours exceeds the mean over all points by `m` standard deviations.

use terrane_base::error::Result;
use terrane_base::geom::Point;

use super::finder::{CLASS, Method, NeighborParts, NoiseFinder, Request, ScoreLimit};
use super::position::{NoiseSpace, bounds};
use super::score_statistics::ScoreSums;
use super::tree::NoiseKdTree;
use terrane_base::parameters::Parameter;

pub(super) const METHOD: Method = Method {
    name: "statistical",
    source: "Rusu and others 2008, as filters.outlier of PDAL, and sor of lidR",
    about: "points with a mean neighbour distance far above the average",
    parameters: &[
        Parameter::new("k", 8.0, [1.0, 100.0], "number of neighbours for the mean distance")
            .whole(),
        Parameter::new("m", 2.0, [0.0, 1000.0], "threshold in standard deviations above the mean"),
        CLASS,
    ],
    finder: NoiseFinder {
        reach: None,
        scores,
        limit: |request, sums| {
            let [mean, deviation] = sums.mean_and_deviation();
            ScoreLimit::Far(mean + request.value("m") * deviation)
        },
        // Points of a part and of another, as they are and in trees, and distances.
        bytes: |request| 4 * 14 + 8 + 8 * (2 + request.value("k") as u64),
    },
};

/// The sorted squared distances from points to their nearest neighbours.
struct NearestDistances {
    /// Distances for each point: the requested neighbours, and the point itself.
    each: usize,
    squares: Vec<f64>,
}

impl NearestDistances {
    fn of(&mut self, point: u32) -> &mut [f64] {
        let first = point as usize * self.each;
        &mut self.squares[first..first + self.each]
    }

    fn furthest(&self, point: u32) -> f64 {
        self.squares[(point as usize + 1) * self.each - 1]
    }

    fn furthest_of(&self, points: &[u32]) -> f64 {
        points.iter().map(|point| self.furthest(*point)).fold(0.0, f64::max)
    }

    /// The mean distance in units of `unit` metres, rounded; 0 without neighbours.
    fn score(&self, point: usize, unit: f64) -> u64 {
        let all = &self.squares[point * self.each..(point + 1) * self.each];
        let (mut sum, mut count) = (0.0, 0.0);
        // The first is the point itself.
        for square in all.iter().skip(1).filter(|square| square.is_finite()) {
            (sum, count) = (sum + square.sqrt(), count + 1.0);
        }
        let mean: f64 = if count > 0.0 { sum / count } else { 0.0 };
        ((mean / unit).round() as u64).min(ScoreSums::MOST)
    }
}

fn scores(
    request: &Request,
    space: &NoiseSpace,
    own: &[Point],
    around: &mut dyn NeighborParts,
) -> Result<Vec<u64>> {
    let each = request.value("k") as usize + 1;
    let mut nearest = NearestDistances { each, squares: vec![f64::INFINITY; each * own.len()] };
    let tree = NoiseKdTree::new(space, own.to_vec());
    let mut open: Vec<u32> = (0..own.len() as u32).collect();
    open.iter().for_each(|i| tree.search(own[*i as usize], nearest.of(*i)));
    drop(tree);
    let Some(all) = bounds(own.iter().copied()) else { return Ok(Vec::new()) };
    let mut read = Vec::new();
    while let Some(next) = around.next(nearest.furthest_of(&open)) {
        // All that follow are no nearer.
        let away = space.gap(all, next);
        open.retain(|i| nearest.furthest(*i) > away);
        let near: Vec<u32> = open
            .iter()
            .copied()
            .filter(|i| space.gap([own[*i as usize]; 2], next) < nearest.furthest(*i))
            .collect();
        let Some(near_bounds) = bounds(near.iter().map(|i| own[*i as usize])) else { continue };
        let within = nearest.furthest_of(&near);
        read.clear();
        around.load(&mut read)?;
        read.retain(|point| space.gap([*point; 2], near_bounds) < within);
        let tree = NoiseKdTree::new(space, std::mem::take(&mut read));
        near.iter().for_each(|i| tree.search(own[*i as usize], nearest.of(*i)));
    }
    Ok((0..own.len()).map(|i| nearest.score(i, space.unit())).collect())
}
