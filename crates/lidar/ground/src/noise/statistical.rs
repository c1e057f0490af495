//! Statistical outliers: points whose nearest neighbours are further away than usual.
//!
//! After Rusu, Marton, Blodow, Dolha & Beetz, "Towards 3D point cloud based object maps for household
//! environments" (2008), as in `filters.outlier` of PDAL and `sor` of lidR: a point is noise if the mean
//! distance to its `k` nearest neighbours exceeds the mean over all points by `m` standard deviations.

use terrane_base::error::Result;
use terrane_base::geom::Point;

use super::finder::{CLASS, Method, NoiseFinder, Request, ScoreLimit};
use super::score_statistics::ScoreSums;
use crate::neighbors::{MetricSpace, NeighborParts, nearest};
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

/// The mean of the sorted squared distances to the nearest points, in units of `unit` metres, rounded; 0 without
/// neighbours.
fn score(nearest: &[f64], unit: f64) -> u64 {
    let (mut sum, mut count) = (0.0, 0.0);
    // The first is the point itself.
    for square in nearest.iter().skip(1).filter(|square| square.is_finite()) {
        (sum, count) = (sum + square.sqrt(), count + 1.0);
    }
    let mean: f64 = if count > 0.0 { sum / count } else { 0.0 };
    ((mean / unit).round() as u64).min(ScoreSums::MOST)
}

fn scores(
    request: &Request,
    space: &MetricSpace,
    own: &[Point],
    around: &mut dyn NeighborParts,
) -> Result<Vec<u64>> {
    let each = request.value("k") as usize + 1;
    let nearest = nearest::<f64>(each, space, own, around)?;
    Ok((0..own.len()).map(|point| score(nearest.of(point), space.unit())).collect())
}
