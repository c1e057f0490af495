//! Isolated points: voxels with few points around them.
//!
//! After `lasnoise` of LAStools and the isolated voxel filter (`ivf`) of lidR: space is divided into voxels,
//! and points are noise if the 27 voxels around them hold few points, themselves included.

use terrane_base::error::{Error, Result};
use terrane_base::geom::Point;

use super::finder::{CLASS, Method, NoiseFinder, Request, ScoreLimit};
use crate::neighbors::{Bounds, MetricSpace, NeighborParts};
use terrane_base::parameters::Parameter;

pub(super) const METHOD: Method = Method {
    name: "voxel",
    source: "as lasnoise, and ivf of lidR",
    about: "points with few others in the surrounding 27 voxels; the default method",
    parameters: &[
        Parameter::new("step", 4.0, [0.001, 100_000.0], "voxel size, metres"),
        Parameter::new(
            "isolated",
            5.0,
            [1.0, 1e6],
            "maximum number of points in 27 voxels to be noise",
        )
        .whole(),
        CLASS,
    ],
    finder: NoiseFinder {
        reach: Some(|request, space| Ok(Voxels::new(request, space)?.side.map(|side| 2 * side))),
        scores,
        limit: |request, _| ScoreLimit::Few(max_points(request)),
        // Points, cubes and counts of a part, and of another.
        bytes: |_| 2 * (12 + 24 + 32) + 8,
    },
};

/// Most points in 27 voxels that are noise.
fn max_points(request: &Request) -> u64 {
    request.value("isolated") as u64
}

/// Most steps of a side.
const MAX_STEPS: f64 = 1e18;

/// Numbers of a cube along x, y and z.
type Voxel = [i64; 3];

/// Space in cubes whose corners are at multiples of their sides, which are whole steps.
struct Voxels {
    zero: [i64; 3],
    side: [i64; 3],
}

impl Voxels {
    fn new(request: &Request, space: &MetricSpace) -> Result<Self> {
        let side = request.value("step");
        if let Some(step) = space.step.into_iter().find(|step| side < *step) {
            return Err(too_small(side, step));
        }
        Ok(Self {
            zero: space.zero,
            side: space.step.map(|step| (side / step).round().min(MAX_STEPS) as i64),
        })
    }

    fn of(&self, point: Point) -> Voxel {
        let steps = [point.x, point.y, point.z].map(i64::from);
        [0, 1, 2].map(|axis| (steps[axis] + self.zero[axis]).div_euclid(self.side[axis]))
    }

    /// Whether points within bounds may be in or beside a voxel of others.
    fn touches(&self, [low, high]: [Voxel; 2], bounds: Bounds) -> bool {
        let [first, last] = bounds.map(|point| self.of(point));
        (0..3).all(|axis| first[axis] <= high[axis] + 1 && last[axis] >= low[axis] - 1)
    }
}

/// Points by cube, in order.
struct VoxelCounts(Vec<(Voxel, u64)>);

impl VoxelCounts {
    fn of(voxels: impl Iterator<Item = Voxel>) -> Self {
        let mut all: Vec<Voxel> = voxels.collect();
        all.sort_unstable();
        Self(all.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u64)).collect())
    }

    /// Number of points in a voxel and the 26 around it; counting stops above `max_points`.
    fn around(&self, [x, y, z]: Voxel, max_points: u64) -> u64 {
        let mut sum = 0;
        for column in (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j])) {
            let [i, j] = column;
            let first = self.0.partition_point(|(voxel, _)| *voxel < [i, j, z - 1]);
            let near = self.0[first..].iter().take_while(|(voxel, _)| *voxel <= [i, j, z + 1]);
            sum += near.map(|(_, count)| count).sum::<u64>();
            if sum > max_points {
                break;
            }
        }
        sum
    }
}

fn scores(
    request: &Request,
    space: &MetricSpace,
    own: &[Point],
    around: &mut dyn NeighborParts,
) -> Result<Vec<u64>> {
    let (voxels, max_points) = (Voxels::new(request, space)?, max_points(request));
    let counts = VoxelCounts::of(own.iter().map(|point| voxels.of(*point)));
    // Cubes that may be noise, in order, with the points that are known around them.
    let few = counts.0.iter().filter(|(_, count)| *count <= max_points);
    let mut open: Vec<_> =
        few.map(|(voxel, _)| (*voxel, counts.around(*voxel, max_points))).collect();
    open.retain(|(_, count)| *count <= max_points);
    let within = space.square(voxels.side.map(|side| 2.0 * side as f64));
    let mut read = Vec::new();
    while let Some(span) = span(&open)
        && let Some(bounds) = around.next(within)
    {
        if !open.iter().any(|(voxel, _)| voxels.touches([*voxel; 2], bounds)) {
            continue;
        }
        read.clear();
        around.load(&mut read)?;
        let near = read.iter().filter(|point| voxels.touches(span, [**point; 2]));
        let others = VoxelCounts::of(near.map(|point| voxels.of(*point)));
        for (voxel, count) in &mut open {
            *count += others.around(*voxel, max_points);
        }
        open.retain(|(_, count)| *count <= max_points);
    }
    let scores = own.iter().map(|point| {
        let found = open.binary_search_by(|(voxel, _)| voxel.cmp(&voxels.of(*point)));
        found.map_or(max_points + 1, |at| open[at].1)
    });
    Ok(scores.collect())
}

/// The bounds of voxels; `None` for none.
fn span(open: &[(Voxel, u64)]) -> Option<[Voxel; 2]> {
    let ends = open.iter().map(|(voxel, _)| [*voxel; 2]);
    ends.reduce(|[low, high], [voxel, _]| {
        [
            [0, 1, 2].map(|axis| low[axis].min(voxel[axis])),
            [0, 1, 2].map(|axis| high[axis].max(voxel[axis])),
        ]
    })
}

/// The error of a cube smaller than the coordinate resolution.
fn too_small(side: f64, step: f64) -> Error {
    Error::usage(format!(
        "cubes of {side} m are smaller than the coordinate resolution of {step} m"
    ))
    .remedy("pass a larger step=")
}
