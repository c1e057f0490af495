//! World coordinates of stored vertices to positions on the lattice.
//!
//! The rule: a vertex that lies as close to a sample as the rounding of its storage explains *is*
//! that sample. Everything further away is kept where it is, to 2^-30 of a cell.

use terrane_base::geom::{Affine, Point3};

use super::triangle::{ProofPosition, ProofVertex};

/// Rounding steps allowed between a sample's true place and its stored coordinates.
pub(crate) const STEPS: f64 = 8.0;
/// Maximum distance in cells that rounding of storage can explain; coarser storage is not compensated.
const LARGEST_RADIUS: f64 = 0.25;
/// Fixed-point positions themselves are rounded by half of 2^-30 cell.
pub(crate) const SMALLEST_RADIUS: f64 = 1.0 / (1u64 << 29) as f64;

/// How a mesh stores heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HeightPrecision {
    /// In `f64`, or in text that reads back as such.
    Double,
    /// In `f32`, relative to a height and multiplied by a scale.
    Single {
        /// The height.
        origin: f64,
        /// The scale.
        scale: f64,
    },
}

impl HeightPrecision {
    /// True when `stored` is `height` in this precision.
    pub(crate) fn is(self, stored: f64, height: f64) -> bool {
        // A mesh may be made from heights already rounded for storage; rounding is not idempotent.
        let once = self.rounded(height);
        stored == height || stored == once || stored == self.rounded(once)
    }

    /// The height as stored.
    fn rounded(self, z: f64) -> f64 {
        match self {
            Self::Double => z,
            Self::Single { origin, scale } => {
                origin + f64::from(((z - origin) * scale) as f32) / scale
            }
        }
    }
}

/// Position of a stored vertex on the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SnapOutcome {
    /// Stored exactly at the world position of a sample.
    Exact(ProofVertex),
    /// Moved to a sample, by this distance in cells.
    Moved(ProofVertex, f64),
    /// Not at a sample; kept where it is.
    Free(ProofVertex),
    /// No finite position or height, or absurdly far away.
    Unusable,
}

/// Maps stored vertices to a lattice.
pub trait Snap: Copy + Send + Sync {
    /// Maps a stored vertex to the lattice.
    fn snap(&self, stored: Point3) -> SnapOutcome;
}

/// Maps stored vertices to the lattice of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapper {
    map: Affine,
    radius: f64,
}

impl Snapper {
    /// For the grid of `width` x `height` samples with the (valid) `map`, and vertices stored
    /// relative to `origin`, in f32 when `single_precision`.
    pub fn new(
        map: Affine,
        [width, height]: [u32; 2],
        origin: Point3,
        single_precision: bool,
    ) -> Self {
        let (right, below) = (f64::from(width.max(1) - 1), f64::from(height.max(1) - 1));
        let corners = [[0.0, 0.0], [right, 0.0], [0.0, below], [right, below]];
        let corners = corners.map(|[col, row]| map.apply(col, row));
        let [x, y] = [0, 1].map(|axis| {
            storage_rounding(&corners.map(|at| at[axis]), origin[axis], single_precision)
        });
        let det = map.determinant().abs();
        let cols = (map.e.abs() * x + map.b.abs() * y) / det;
        let rows = (map.a.abs() * y + map.d.abs() * x) / det;
        Self { map, radius: cols.hypot(rows).clamp(SMALLEST_RADIUS, LARGEST_RADIUS) }
    }

    /// Vertices this close (in cells) to a sample are that sample.
    pub fn radius(&self) -> f64 {
        self.radius
    }
}

impl Snap for Snapper {
    fn snap(&self, [x, y, z]: Point3) -> SnapOutcome {
        let [col, row] = self.map.invert(x, y);
        let is_near = col.abs() < ProofPosition::LIMIT && row.abs() < ProofPosition::LIMIT;
        if !is_near || !z.is_finite() {
            return SnapOutcome::Unusable;
        }
        let (c, r) = (col.round(), row.round());
        let sample = ProofVertex { at: ProofPosition::sample(c as i64, r as i64), z };
        if self.map.apply(c, r) == [x, y] {
            return SnapOutcome::Exact(sample);
        }
        let distance = (col - c).hypot(row - r);
        if distance <= self.radius {
            SnapOutcome::Moved(sample, distance)
        } else {
            SnapOutcome::Free(ProofVertex { at: ProofPosition::nearest(col, row), z })
        }
    }
}

/// The rounding, times [`STEPS`], of coordinates up to these that are computed in `f64` and, in single
/// precision, stored relative to `origin`.
pub(crate) fn storage_rounding(coordinates: &[f64], origin: f64, single_precision: bool) -> f64 {
    let stored = f64::from(f32::EPSILON) / 2.0 * farthest(coordinates, origin);
    let single = if single_precision { stored } else { 0.0 };
    STEPS * (f64::EPSILON / 2.0 * farthest(coordinates, 0.0) + single)
}

/// The largest distance of coordinates from one value.
pub(crate) fn farthest(coordinates: &[f64], from: f64) -> f64 {
    coordinates.iter().map(|coordinate| (coordinate - from).abs()).fold(0.0, f64::max)
}

impl SnapOutcome {
    /// The vertex, unless unusable.
    pub fn vertex(self) -> Option<ProofVertex> {
        match self {
            Self::Exact(vertex) | Self::Moved(vertex, _) | Self::Free(vertex) => Some(vertex),
            Self::Unusable => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UTM: Affine = Affine { x0: 512_345.678, a: 0.3, b: 0.01, y0: 4e6, d: 0.02, e: -0.3 };

    fn grid_points() -> impl Iterator<Item = (i64, i64)> {
        (0..50_000).step_by(997).flat_map(|c| (0..50_000).step_by(1499).map(move |r| (c, r)))
    }

    #[test]
    fn doubles_come_back_to_their_samples() {
        let snapper = Snapper::new(UTM, [50_000, 50_000], [0.0; 3], false);
        assert!(snapper.radius() < 1e-7);
        for (c, r) in grid_points() {
            let [x, y] = UTM.apply(c as f64, r as f64);
            for (x, y) in [(x, y), (x.next_up(), y.next_down())] {
                let vertex = snapper.snap([x, y, 1.0]).vertex().unwrap();
                assert_eq!(vertex.at, ProofPosition::sample(c, r));
            }
        }
    }

    #[test]
    fn floats_with_an_origin_come_back_too() {
        let origin = [UTM.x0, UTM.y0, 0.0];
        let snapper = Snapper::new(UTM, [50_000, 50_000], origin, true);
        assert!(snapper.radius() < 0.1);
        for (c, r) in grid_points() {
            let [x, y] = UTM.apply(c as f64, r as f64);
            let stored = |v: f64, from: f64| f64::from((v - from) as f32) + from;
            let vertex = snapper.snap([stored(x, origin[0]), stored(y, origin[1]), 1.0]).vertex();
            assert_eq!(vertex.unwrap().at, ProofPosition::sample(c, r));
        }
    }

    #[test]
    fn anything_further_stays_where_it_is() {
        let snapper = Snapper::new(Affine::LATTICE, [100, 100], [0.0; 3], false);
        let free = ProofVertex { at: ProofPosition::nearest(3.001, 7.0), z: 2.0 };
        assert_eq!(snapper.snap([3.001, -7.0, 2.0]), SnapOutcome::Free(free));
        assert!(matches!(snapper.snap([3.0, -7.0, 2.0]), SnapOutcome::Exact(_)));
        assert!(matches!(snapper.snap([3.0 + 1e-12, -7.0, 2.0]), SnapOutcome::Moved(..)));
        for bad in [[f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::INFINITY], [1e10, 0.0, 0.0]] {
            assert_eq!(snapper.snap(bad), SnapOutcome::Unusable);
        }
    }
}
