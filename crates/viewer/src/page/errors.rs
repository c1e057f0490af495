//! The largest error of each triangle: the vertical distance of the grid's samples in it from its plane.
//!
//! Grid rows are read in bands; each band knows the triangles that reach into it. A sample on an edge counts for both
//! triangles, a sample at a vertex for all of its triangles; in the root mean square each counts once. Distances are
//! rounded to doubles; `terrane verify` checks bounds exactly.

use std::ops::Range;

use super::solid::PageMesh;
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Rect};
use terrane_engine::{Cancel, Progress};
use terrane_raster::GridSource;

/// Measured errors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TriangleErrors {
    /// The largest error of each triangle; NaN where no valid sample lies in it.
    pub(super) of_triangles: Vec<f32>,
    /// The largest error of all triangles.
    pub(super) largest: f64,
    /// RMS error of all samples in a triangle, each by the first triangle that contains it.
    pub(super) root_mean_square: f64,
    /// Valid samples that lie in a triangle.
    pub(super) samples: u64,
}

/// Maximum number of samples read at once.
const BAND_SAMPLES: u64 = 1 << 21;
/// Maximum rows of a band.
const BAND_ROWS: u64 = 512;
/// Distance in cells from a triangle within which a sample counts as on its edge: rounding of the transform and of
/// coordinates in files.
const EDGE: f64 = 1e-6;

/// Measures all triangles against a grid.
///
/// # Errors
/// A grid that does not overlap the mesh; errors of its reader.
pub(super) fn measure(
    shape: &PageMesh,
    grid: &dyn GridSource,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TriangleErrors> {
    let info = grid.info();
    let rows = (BAND_SAMPLES / u64::from(info.width)).clamp(1, BAND_ROWS) as u32;
    let bands = TriangleBands::of(shape, &info.transform, rows, info.height);
    let mut tally = TriangleErrorTally::new(shape.triangles.len());
    progress.begin("samples", u64::from(info.height));
    let (mut heights, mut seen) = (Vec::new(), BitSet::default());
    for (band, first) in (0..info.height).step_by(rows as usize).enumerate() {
        cancel.check()?;
        let triangles = bands.triangles(band);
        let height = rows.min(info.height - first);
        if !triangles.is_empty() {
            let rect = Rect::new(0, first, info.width, height);
            heights.resize(rect.len(), 0.0);
            grid.read_f64(rect, &mut heights)?;
            seen.reset(rect.len());
            for &triangle in triangles {
                let plane = SampledTriangle::of(shape, triangle, &info.transform);
                plane.each(rect, |at, z| {
                    tally.add(triangle, (heights[at] - z).abs(), seen.insert(at));
                });
            }
            grid.release(rect);
        }
        progress.advance(u64::from(height));
    }
    progress.end();
    tally.errors()
}

struct TriangleErrorTally {
    largest: Vec<f64>,
    squares: f64,
    samples: u64,
}

impl TriangleErrorTally {
    fn new(triangles: usize) -> Self {
        Self { largest: vec![f64::NAN; triangles], squares: 0.0, samples: 0 }
    }

    /// Adds the error of a sample in a triangle; `is_first` if no triangle before contained it.
    fn add(&mut self, triangle: u32, error: f64, is_first: bool) {
        if error.is_nan() {
            return;
        }
        let largest = &mut self.largest[triangle as usize];
        *largest = largest.max(error);
        if is_first {
            self.squares += error * error;
            self.samples += 1;
        }
    }

    fn errors(self) -> Result<TriangleErrors> {
        if self.samples == 0 {
            return Err(Error::usage("the mesh covers no sample of the grid")
                .remedy("pass the source grid of the mesh, in the same CRS"));
        }
        let largest = self.largest.iter().copied().fold(0.0, f64::max);
        let root_mean_square = (self.squares / self.samples as f64).sqrt();
        let of_triangles = self.largest.iter().map(|error| *error as f32).collect();
        Ok(TriangleErrors { of_triangles, largest, root_mean_square, samples: self.samples })
    }
}

/// Triangles by the bands of rows that they reach into.
struct TriangleBands {
    /// Where the list of each band starts, and the end of the last.
    starts: Vec<usize>,
    list: Vec<u32>,
}

impl TriangleBands {
    fn of(shape: &PageMesh, map: &Affine, rows: u32, height: u32) -> Self {
        let count = height.div_ceil(rows) as usize;
        // Two passes: counts give the starts of all lists in one array.
        let mut starts = vec![0; count + 1];
        for triangle in &shape.triangles {
            for band in bands_of(shape, triangle, map, rows, height) {
                starts[band + 1] += 1;
            }
        }
        (0..count).for_each(|band| starts[band + 1] += starts[band]);
        let mut list = vec![0; starts[count]];
        let mut next = starts.clone();
        for (id, triangle) in (0..).zip(&shape.triangles) {
            for band in bands_of(shape, triangle, map, rows, height) {
                list[next[band]] = id;
                next[band] += 1;
            }
        }
        Self { starts, list }
    }

    fn triangles(&self, band: usize) -> &[u32] {
        &self.list[self.starts[band]..self.starts[band + 1]]
    }
}

/// The bands of `rows` rows, in a grid of `height` rows, that a triangle reaches into.
fn bands_of(
    shape: &PageMesh,
    triangle: &[u32; 3],
    map: &Affine,
    rows: u32,
    height: u32,
) -> Range<usize> {
    let corners = triangle.map(|vertex| {
        let [x, y, _] = shape.at(vertex);
        map.invert(x, y)[1]
    });
    let (low, high) = (fold(corners, f64::min) - EDGE, fold(corners, f64::max) + EDGE);
    let end = f64::from(height) - 1.0;
    // Negated, so that NaN is outside.
    if !(high >= 0.0 && low <= end) {
        return 0..0;
    }
    let [first, last] =
        [low.ceil(), high.floor()].map(|row| row.clamp(0.0, end) as usize / rows as usize);
    first..last + 1
}

/// A triangle on the lattice of the grid.
struct SampledTriangle {
    /// Columns and rows of the corners.
    corners: [[f64; 2]; 3],
    /// Height at the first corner, and its changes by column and row; NaN for a triangle without area.
    z: [f64; 3],
}

impl SampledTriangle {
    fn of(shape: &PageMesh, triangle: u32, map: &Affine) -> Self {
        let at = shape.triangles[triangle as usize].map(|vertex| shape.at(vertex));
        let corners = at.map(|[x, y, _]| map.invert(x, y));
        let [u, v] = [1, 2].map(|k| {
            [corners[k][0] - corners[0][0], corners[k][1] - corners[0][1], at[k][2] - at[0][2]]
        });
        let area = u[0] * v[1] - u[1] * v[0];
        let by_col = (u[2] * v[1] - u[1] * v[2]) / area;
        let by_row = (u[0] * v[2] - u[2] * v[0]) / area;
        Self { corners, z: [at[0][2], by_col, by_row] }
    }

    /// Visits the samples of `rect` in the triangle: places in it, row by row, and heights of the plane.
    fn each(&self, rect: Rect, mut visit: impl FnMut(usize, f64)) {
        if !self.z.iter().all(|z| z.is_finite()) {
            return;
        }
        let rows = self.corners.map(|corner| corner[1]);
        let [low, high] = [fold(rows, f64::min), fold(rows, f64::max)];
        for row in lattice_range(low, high, rect.row, rect.height) {
            let [west, east] = self.span(f64::from(row));
            let line = (row - rect.row) as usize * rect.width as usize;
            for col in lattice_range(west, east, rect.col, rect.width) {
                let [c, r] =
                    [f64::from(col) - self.corners[0][0], f64::from(row) - self.corners[0][1]];
                visit(line + (col - rect.col) as usize, self.z[0] + c * self.z[1] + r * self.z[2]);
            }
        }
    }

    /// The first and the last column of the triangle along a row.
    fn span(&self, row: f64) -> [f64; 2] {
        let mut span = [f64::INFINITY, f64::NEG_INFINITY];
        for k in 0..3 {
            let [a, b] = [self.corners[k], self.corners[(k + 1) % 3]];
            if (row - a[1]).abs() <= EDGE {
                span = [span[0].min(a[0]), span[1].max(a[0])];
            }
            if (a[1] < row) != (b[1] < row) {
                let col = a[0] + (b[0] - a[0]) * (row - a[1]) / (b[1] - a[1]);
                span = [span[0].min(col), span[1].max(col)];
            }
        }
        span
    }
}

fn fold(values: [f64; 3], of: impl Fn(f64, f64) -> f64) -> f64 {
    of(of(values[0], values[1]), values[2])
}

/// The rows or columns from `low` to `high`, within [`EDGE`], among `count` from `first` on.
fn lattice_range(low: f64, high: f64, first: u32, count: u32) -> Range<u32> {
    let start = (low - EDGE).ceil().max(f64::from(first));
    let end = (high + EDGE).floor().min(f64::from(first) + f64::from(count) - 1.0);
    if start <= end { start as u32..end as u32 + 1 } else { 0..0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_engine::Silent;
    use terrane_raster::{GridInfo, SampleType};

    /// A small grid in memory.
    struct Held(GridInfo, Vec<f64>);

    impl GridSource for Held {
        fn info(&self) -> &GridInfo {
            &self.0
        }

        fn read_f32(&self, _: Rect, _: &mut [f32]) -> Result<()> {
            Ok(())
        }

        fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
            for (i, z) in (0..).zip(out) {
                let (col, row) = (rect.col + i % rect.width, rect.row + i / rect.width);
                *z = self.1[(row * self.0.width + col) as usize];
            }
            Ok(())
        }
    }

    fn grid(side: u32, map: Affine, heights: Vec<f64>) -> Held {
        Held(
            GridInfo { transform: map, ..GridInfo::plain("test", side, side, SampleType::F64) },
            heights,
        )
    }

    /// The same by asking every sample of every triangle; and how many samples lie in any.
    fn slowly(shape: &PageMesh, grid: &Held) -> (Vec<f64>, u64) {
        let mut seen = vec![false; grid.1.len()];
        let mut of = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| shape.at(vertex));
            let cross = |p: [f64; 2], q: [f64; 3], r: [f64; 3]| {
                (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
            };
            let all = cross([a[0], a[1]], b, c);
            let mut largest = f64::NAN;
            for (i, z) in grid.1.iter().enumerate() {
                let side = grid.0.width as usize;
                let p = grid.0.transform.apply((i % side) as f64, (i / side) as f64);
                let w = [cross(p, b, c), cross(p, c, a), cross(p, a, b)].map(|part| part / all);
                if w.iter().all(|share| *share >= -1e-9) && !z.is_nan() {
                    let plane = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                    largest = largest.max((z - plane).abs());
                    seen[i] = true;
                }
            }
            largest
        };
        let errors = shape.triangles.iter().map(&mut of).collect();
        (errors, seen.into_iter().filter(|is_seen| *is_seen).count() as u64)
    }

    proptest! {
        #[test]
        fn errors_are_those_of_every_sample_asked(
            heights in prop::collection::vec(-50.0..50.0f64, 81),
            corners in prop::collection::vec((0u32..9, 0u32..9, -50.0..50.0f64), 12),
            void in 0usize..81,
            turned in any::<bool>(),
        ) {
            let map = Affine { x0: 500.0, a: 2.0, b: if turned { 1.0 } else { 0.0 }, y0: 90.0, d: 0.0, e: -2.0 };
            let mut heights = heights;
            heights[void] = f64::NAN;
            let grid = grid(9, map, heights);
            let mut shape = PageMesh::default();
            for (col, row, z) in corners {
                let [x, y] = map.apply(col.into(), row.into());
                shape.push([x, y, z]);
            }
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| shape.at(v));
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
            shape.triangles = triangles.into_iter().filter(|t| area(t) != 0.0).collect();
            let (expected, samples) = slowly(&shape, &grid);
            match measure(&shape, &grid, &Silent, &Cancel::default()) {
                Err(_) => prop_assert!(expected.iter().all(|error| error.is_nan())),
                Ok(found) => {
                    prop_assert_eq!(found.samples, samples, "each counts once");
                    prop_assert!(found.root_mean_square <= found.largest);
                    for (own, other) in found.of_triangles.iter().zip(&expected) {
                        let near = (f64::from(*own) - other).abs() < 1e-4 || own.is_nan() && other.is_nan();
                        prop_assert!(near, "{own} {other}");
                    }
                }
            }
        }
    }
}
