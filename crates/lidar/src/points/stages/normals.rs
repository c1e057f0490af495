//! Normals and shape of the surroundings of each point, from the covariance of its nearest neighbours.
//!
//! After Hoppe and others, "Surface reconstruction from unorganized points" (1992); shape as by Demantké and others,
//! "Dimensionality based scale selection in 3D lidar point clouds" (2011). As `filters.normal` and
//! `filters.covariancefeatures` of PDAL, in metres along all axes.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::neighborhoods::{self, Neighborhood, Neighborhoods, metric_space};
use super::{OpenStage, Stage, StageContext, StageInput, StageName, StageOutput, StageReach};
use crate::grid::surface_model::MetricFrame;
use crate::records::PointRecords;
use crate::records::values::{RecordValues, VALUES};
use terrane_base::error::Result;
use terrane_base::geom::Point;
use terrane_cloud::{CloudInfo, NewDimension, NewDimensionValue};
use terrane_ground::neighbors::{Neighbor, nearest};

/// The stage in messages.
const STAGE: &str = "the stage normals";
/// The dimensions, with descriptions.
const DIMENSIONS: [(&str, &str); 7] = [
    ("NormalX", "Normal of the surface, x"),
    ("NormalY", "Normal of the surface, y"),
    ("NormalZ", "Normal of the surface, z (up)"),
    ("Curvature", "Least share of variance"),
    ("Linearity", "1 along a line"),
    ("Planarity", "1 on a plane"),
    ("Scattering", "1 within a volume"),
];
/// The number of a record in its bucket, and its values.
const ROW: usize = 1 + DIMENSIONS.len();
/// Most neighbours.
const MOST: usize = 100;
/// Steps of the rotations that find eigenvectors: each squares the error, and single precision is written.
const SWEEPS: usize = 12;

/// Normals and shape by this number of neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Normals {
    /// Neighbours of a point, without itself.
    pub neighbors: usize,
}

impl FromStr for Normals {
    type Err = String;

    /// "", "k=16".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = if text.is_empty() {
            Some(8)
        } else {
            text.strip_prefix("k=").and_then(|k| k.parse().ok())
        };
        let neighbors = number.filter(|number| (3..=MOST).contains(number));
        let neighbors = neighbors.ok_or(format!("expected k=NUMBER, from 3 to {MOST}"))?;
        Ok(Self { neighbors })
    }
}

impl Normals {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "normals",
        "[k=NUMBER]",
        "normal, curvature, linearity, planarity and scattering by the nearest neighbours, as dimensions",
    )];
}

impl Stage for Normals {
    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Cloud { option: None, reason: "the nearest points may be far away" })
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        let neighbor = size_of::<(f64, Point)>() * (1 + self.neighbors);
        // Points of a part and of another, as they are and in trees; neighbours and values.
        let each = (4 * size_of::<Point>() + neighbor + 8 * ROW) as u64;
        let [all, thread] = neighborhoods::needed(points, |points| points * each);
        [all + 2 * VALUES, thread]
    }

    fn dimensions(&self) -> Vec<NewDimension> {
        let new = |(name, about)| NewDimension::new(name, about, NewDimensionValue::Single);
        DIMENSIONS.map(new).into()
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        metric_space(input.info, STAGE)?;
        Ok(Box::new(*self))
    }
}

impl OpenStage for Normals {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let work = around.work;
        let (space, is_guess) = metric_space(around.info, STAGE)?;
        let points = Neighborhoods::new(records, &space, around, around.memory() / 2, |_| true)?;
        let values = RecordValues::<ROW>::new(points.numbers.total, work.folder());
        let act = |(): &mut (), mut near: Neighborhood<'_>| {
            let each = 1 + self.neighbors;
            let found = nearest::<(f64, Point)>(each, &space, &near.points, &mut near.around)?;
            let mut writer = values.writer();
            for (i, (point, number)) in near.points.iter().zip(&near.numbers).enumerate() {
                let others = found.of(i).iter().filter(|other| other.square().is_finite());
                let shape = shape(others.map(|(_, other)| offset(*point, *other, space.step)));
                let mut row = [0; ROW];
                for (to, value) in row[1..].iter_mut().zip(shape) {
                    *to = (value as f32).to_bits();
                }
                writer.put(*number, row)?;
            }
            writer.finish()
        };
        points.each("normals", act, |()| Ok(()))?;
        let places = DIMENSIONS.map(|(name, _)| work.converter.added_at(name));
        let set = move |record: &mut [u8], row: [u32; ROW]| {
            for (at, value) in places.iter().zip(&row[1..]) {
                if let Some(at) = *at {
                    record[at..at + size_of::<f32>()].copy_from_slice(&value.to_le_bytes());
                }
            }
            true
        };
        let numbers = points.numbers;
        let records = values.records(records, work.shares.flow.record, numbers, set);
        let notes = is_guess.then(|| MetricFrame::GUESS.to_owned());
        Ok(StageOutput { records: Box::new(records), notes: notes.into_iter().collect() })
    }
}

/// Metres from a point to another.
fn offset(from: Point, to: Point, step: [f64; 3]) -> [f64; 3] {
    let apart = [(from.x, to.x), (from.y, to.y), (from.z, to.z)];
    let apart = apart.map(|(a, b)| f64::from(b) - f64::from(a));
    [0, 1, 2].map(|axis| apart[axis] * step[axis])
}

/// The values of [`DIMENSIONS`] for a point with these neighbours, itself among them; NaN for points that do not span a
/// plane.
fn shape(points: impl Iterator<Item = [f64; 3]> + Clone) -> [f64; DIMENSIONS.len()] {
    let count = points.clone().count().max(1) as f64;
    let mean = points.clone().fold([0.0; 3], |sum, point| [0, 1, 2].map(|i| sum[i] + point[i]));
    let mean = mean.map(|sum| sum / count);
    let mut covariance = [[0.0; 3]; 3];
    for point in points {
        let from = [0, 1, 2].map(|i| point[i] - mean[i]);
        for (row, a) in covariance.iter_mut().zip(from) {
            row.iter_mut().zip(from).for_each(|(sum, b)| *sum += a * b);
        }
    }
    let (values, vectors) = eigen(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let [large, middle, small] = order.map(|i| values[i].max(0.0));
    // Of points on a line, or fewer than three, any direction across is a normal.
    if middle <= large * 1e-12 {
        return [f64::NAN; DIMENSIONS.len()];
    }
    let mut normal = [0, 1, 2].map(|axis| vectors[axis][order[2]]);
    let is_down = match normal {
        [x, y, 0.0] => (x, y) < (0.0, 0.0),
        [_, _, z] => z < 0.0,
    };
    if is_down {
        normal = normal.map(|along| -along);
    }
    let [x, y, z] = normal;
    let roots = [large, middle, small].map(f64::sqrt);
    let curvature = small / (large + middle + small);
    let linearity = (roots[0] - roots[1]) / roots[0];
    let planarity = (roots[1] - roots[2]) / roots[0];
    [x, y, z, curvature, linearity, planarity, roots[2] / roots[0]]
}

/// The eigenvalues of a symmetric matrix, and the eigenvectors as columns, by the rotations of Jacobi: additions,
/// products, quotients and roots alone, which are the same on all machines.
fn eigen(mut matrix: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if matrix[p][q] == 0.0 {
                continue;
            }
            let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
            let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            for row in &mut matrix {
                [row[p], row[q]] =
                    [cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]];
            }
            let (first, second) = (matrix[p], matrix[q]);
            matrix[p] = [0, 1, 2].map(|i| cosine * first[i] - sine * second[i]);
            matrix[q] = [0, 1, 2].map(|i| sine * first[i] + cosine * second[i]);
            // What is left of it is rounding, and would be rotated again and again.
            (matrix[p][q], matrix[q][p]) = (0.0, 0.0);
            for row in &mut vectors {
                [row[p], row[q]] =
                    [cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]];
            }
        }
    }
    ([matrix[0][0], matrix[1][1], matrix[2][2]], vectors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shapes_are_known() {
        let plane = [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0]];
        let found = shape(plane.into_iter());
        let root = 0.5_f64.sqrt();
        let expected = [-root, 0.0, root, 0.0];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert!(found[6].abs() < 1e-7 && (found[4] + found[5] - 1.0).abs() < 1e-7);
        let line = (0..9).map(|i| [f64::from(i), f64::from(2 * i), 0.5]);
        assert!(shape(line).iter().all(|value| value.is_nan()));
        assert!(shape(std::iter::repeat_n([0.0; 3], 9)).iter().all(|value| value.is_nan()));
        // A wall: upwards is either way, and the same for all of its points.
        let wall = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        assert_eq!(shape(wall.into_iter())[0], 1.0);
        for text in ["k=2", "k=101", "8", "k=", "k=-3"] {
            assert!(text.parse::<Normals>().is_err(), "{text}");
        }
    }

    proptest! {
        /// Eigenvectors are turned by the matrix to multiples of themselves, and are at right angles.
        #[test]
        fn vectors_and_values_are_those_of_the_matrix(
            points in prop::collection::vec(prop::array::uniform3(-100.0..100.0f64), 3..20)
        ) {
            let mut matrix = [[0.0; 3]; 3];
            for point in &points {
                for (row, a) in matrix.iter_mut().zip(point) {
                    row.iter_mut().zip(point).for_each(|(sum, b)| *sum += a * b);
                }
            }
            let (values, vectors) = eigen(matrix);
            let size = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            for i in 0..3 {
                let vector = [0, 1, 2].map(|axis| vectors[axis][i]);
                let turned = matrix.map(|row| (0..3).map(|axis| row[axis] * vector[axis]).sum::<f64>());
                for axis in 0..3 {
                    prop_assert!((turned[axis] - values[i] * vector[axis]).abs() <= size * 1e-12);
                }
                let dots = [0, 1, 2].map(|j| (0..3).map(|axis| vector[axis] * vectors[axis][j]).sum::<f64>());
                for (j, dot) in dots.into_iter().enumerate() {
                    prop_assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-12);
                }
            }
        }
    }
}
