//! Cell sizes from the point density by the headers of a cloud.

use terrane_base::geom::Point;

use crate::source::CloudInfo;

/// Average number of points of a cell within the bounds.
const POINTS_OF_CELL: f64 = 4.0;

/// Cell size for four points on average within the bounds (twice the point spacing), rounded up to 1, 2 or 5 times a
/// power of ten; at least a step of the coordinates. In units of x and y.
pub fn round_side(info: &CloudInfo, bounds: [Point; 2]) -> f64 {
    side_of(POINTS_OF_CELL, info, bounds)
}

/// As [`round_side`], for this number of points on average.
pub fn side_of(points: f64, info: &CloudInfo, [low, high]: [Point; 2]) -> f64 {
    let [west, south, _] = info.frame.world(low);
    let [east, north, _] = info.frame.world(high);
    let area = (east - west) * (north - south);
    let by_density = (area * points / info.count.max(1) as f64).sqrt();
    round_up(by_density.max(info.frame.scale[0]).max(info.frame.scale[1]))
}

/// Rounds up to 1, 2 or 5 times a power of ten.
pub fn round_up(least: f64) -> f64 {
    let power = least.log10().floor() as i32;
    let sizes = [1.0, 2.0, 5.0, 10.0].map(|k| match power {
        0.. => k * 10f64.powi(power),
        _ => k / 10f64.powi(-power),
    });
    sizes.into_iter().find(|size| *size >= least).unwrap_or(sizes[3])
}

#[cfg(test)]
mod tests {
    use super::round_up;

    #[test]
    fn sizes_are_round() {
        assert_eq!(
            [0.3, 1.0, 1.01, 34.0, 0.02, 700.0].map(round_up),
            [0.5, 1.0, 2.0, 50.0, 0.02, 1000.0]
        );
    }
}
