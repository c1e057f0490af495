//! Constraints of a mesh from feature files: required vertices at the samples nearest to points, and breaklines.
//!
//! These vertices exist from the start; no pass drops or moves them.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::Resources;
use crate::breaklines::Breaklines;
use crate::feature_files::AuxiliaryFeatures;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Rect};
use terrane_raster::{GridInfo, Water};

/// Constraints in world coordinates.
#[derive(Default)]
pub struct ConstraintFeatures {
    pub(super) points: Option<ConstraintVertices>,
    pub(super) lines: Option<ConstraintVertices>,
    water: Option<Arc<Water>>,
}

impl ConstraintFeatures {
    /// Reads the files of points and of breaklines; the banks of `water` are breaklines, too.
    ///
    /// # Errors
    /// Errors of the format's reader; a file without points, or without lines; more points than a quarter of the memory
    /// holds.
    pub fn read(
        points: Option<&str>,
        lines: Option<&str>,
        water: Option<&Arc<Water>>,
        resources: &Resources,
    ) -> Result<Self> {
        Ok(Self {
            water: water.cloned(),
            points: points
                .map(|name| ConstraintVertices::read(name, "point", resources))
                .transpose()?,
            lines: lines
                .map(|name| ConstraintVertices::read(name, "line", resources))
                .transpose()?,
        })
    }

    /// The same for meshes of point clouds: lines have the heights of their vertices.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_for_cloud(
        points: Option<&str>,
        lines: Option<&str>,
        resources: &Resources,
    ) -> Result<Self> {
        let lines =
            lines.map(|name| ConstraintVertices::read_solid(name, resources)).transpose()?;
        Ok(Self { lines, ..Self::read(points, None, None, resources)? })
    }

    /// Constraints of these points and lines.
    pub fn of(points: Option<ConstraintVertices>, lines: Option<ConstraintVertices>) -> Self {
        Self { points, lines, water: None }
    }

    /// True if there are lines.
    pub fn has_lines(&self) -> bool {
        self.lines.is_some() || self.water.is_some()
    }

    /// Maximum bytes of all constraints.
    pub fn bytes(&self) -> u64 {
        let lines = self.lines.as_ref().map_or(0, |lines| lines.at.len());
        let banks = self.water.as_ref().map_or(0, |water| water.vertices());
        let lines = Breaklines::max_bytes(lines + banks);
        self.points.as_ref().map_or(0, |points| bytes(points.at.len())) + lines
    }

    /// Places the constraints on a grid. Time O(n log n) for n points.
    ///
    /// # Errors
    /// Features in another CRS; no feature on the grid.
    pub fn on(self, grid: &GridInfo) -> Result<GridConstraints> {
        let mut kept =
            self.points.map_or_else(|| Ok(GridConstraints::default()), |points| points.on(grid))?;
        if let Some(lines) = self.lines {
            kept.lines = lines.along(grid)?;
        }
        if let Some(water) = self.water {
            kept.lines = kept.lines.and_banks(water.banks(grid)?, water.path());
        }
        Ok(kept)
    }
}

/// Points of a file in world coordinates: its points, and the vertices of its lines and polygons.
pub struct ConstraintVertices {
    /// The file.
    pub path: PathBuf,
    /// Its CRS.
    pub crs: Crs,
    /// x and y of each point.
    pub at: Vec<[f64; 2]>,
    /// Heights, if requested; NaN where the file has no height.
    pub z: Vec<f64>,
    /// End index of each line or ring.
    pub ends: Vec<u32>,
}

impl ConstraintVertices {
    /// Bytes per point: for a growing list, and for a point with a height and the data of its line on a point cloud.
    const BYTES: u64 = 48;
    const SOLID: u64 = 192;

    /// Reads all points, or only the vertices of lines and rings.
    fn read(name: &str, what: &str, resources: &Resources) -> Result<Self> {
        Self::read_as(name, what, Self::BYTES, resources)
    }

    /// Reads the vertices of lines and rings, with heights.
    fn read_solid(name: &str, resources: &Resources) -> Result<Self> {
        Self::read_as(name, "line", Self::SOLID, resources)
    }

    fn read_as(name: &str, what: &str, bytes: u64, resources: &Resources) -> Result<Self> {
        let wants_lines = what == "line";
        let remedy = if wants_lines { "keep fewer lines" } else { "keep fewer points" };
        let mut file = AuxiliaryFeatures::open(name, &format!("{what}s"), bytes, remedy)?;
        let (mut at, mut z, mut ends) = (Vec::new(), Vec::new(), Vec::new());
        file.each(resources.memory / 4, resources, |feature| {
            for leaf in feature.geometry.leaves() {
                let xy = &leaf.coordinates().xy;
                if wants_lines && leaf.parts().next().is_none() && !xy.is_empty() {
                    return Err(Error::bad_input("a point is not a line")
                        .remedy("pass points in a separate file with ‹keep_points›"));
                }
                let first = at.len();
                at.extend_from_slice(xy);
                if bytes == Self::SOLID {
                    z.extend_from_slice(&leaf.coordinates().z);
                    z.resize(at.len(), f64::NAN);
                }
                let parts = leaf.parts().scan(first, |end, part| {
                    *end += part.xy.len();
                    Some(*end as u32)
                });
                ends.extend(parts);
            }
            Ok(())
        })?;
        if at.is_empty() {
            return Err(Error::bad_input(format!("contains no {what}"))
                .in_file(&file.path)
                .remedy(format!("name a file with the {what}s to keep")));
        }
        Ok(Self { crs: file.source.layer().crs.clone(), path: file.path, at, z, ends })
    }

    /// Position and height of a vertex; NaN without a height.
    pub(super) fn vertex(&self, i: usize) -> ([f64; 2], f64) {
        (self.at[i], self.z.get(i).copied().unwrap_or(f64::NAN))
    }

    /// The breaklines on a grid.
    fn along(self, grid: &GridInfo) -> Result<Breaklines> {
        grid.crs.check_same(&self.crs, "lines").map_err(|e| e.in_file(&self.path))?;
        let at: Vec<_> = self.at.iter().map(|&[x, y]| grid.transform.invert(x, y)).collect();
        Breaklines::on(&at, &self.ends, [grid.width, grid.height], self.path)
    }

    /// The grid samples nearest to the points.
    fn on(self, grid: &GridInfo) -> Result<GridConstraints> {
        grid.crs.check_same(&self.crs, "points").map_err(|e| e.in_file(&self.path))?;
        let samples = self.at.iter().filter_map(|&[x, y]| {
            let [col, row] = grid.transform.invert(x, y);
            Some([nearest(col, grid.width)?, nearest(row, grid.height)?])
        });
        let samples: Vec<_> = samples.collect();
        if samples.is_empty() {
            return Err(Error::bad_input("no point lies on the grid")
                .in_file(&self.path)
                .remedy("compare the extents of both with terrane info"));
        }
        let [points, inside] = [self.at.len(), samples.len()].map(|count| count as u64);
        Ok(GridConstraints {
            path: Some(self.path),
            outside: points - inside,
            points,
            ..GridConstraints::of(samples)
        })
    }
}

/// The sample nearest to a position along an axis, if it is one of `count`.
fn nearest(at: f64, count: u32) -> Option<u32> {
    // Halves go up on both sides of 0. `round` takes them away from 0, and would put a point half a
    // cell before the first sample outside.
    let at = (at + 0.5).floor();
    (0.0..f64::from(count)).contains(&at).then_some(at as u32)
}

fn bytes(samples: usize) -> u64 {
    (samples * size_of::<[u32; 2]>()) as u64
}

/// Required samples.
#[derive(Clone, Debug, Default)]
pub struct GridConstraints {
    /// Columns and rows, without duplicates, ordered by block, then row and column.
    samples: Vec<[u32; 2]>,
    path: Option<PathBuf>,
    points: u64,
    outside: u64,
    lines: Breaklines,
}

/// Samples along a block side.
const BLOCK: u32 = 256;

/// The block of a sample: row, then column.
fn block([col, row]: [u32; 2]) -> [u32; 2] {
    [row / BLOCK, col / BLOCK]
}

impl GridConstraints {
    /// No constraints.
    pub const NONE: &Self =
        &Self { samples: Vec::new(), path: None, points: 0, outside: 0, lines: Breaklines::NONE };

    /// The given samples, by column and row, in any order.
    pub fn of(mut samples: Vec<[u32; 2]>) -> Self {
        let points = samples.len() as u64;
        samples.sort_unstable_by_key(|&at| (block(at), at[1], at[0]));
        samples.dedup();
        Self { samples, points, ..Self::default() }
    }

    /// The same with breaklines.
    pub fn with(self, lines: Breaklines) -> Self {
        Self { lines, ..self }
    }

    /// The breaklines.
    pub fn lines(&self) -> &Breaklines {
        &self.lines
    }

    /// The samples in a rectangle, row by row within blocks. Time linear in the samples of the touched blocks, and
    /// logarithmic in all.
    pub fn within(&self, rect: Rect) -> impl Iterator<Item = [u32; 2]> + '_ {
        let [first, last] = match rect.is_empty() || self.samples.is_empty() {
            true => [[1, 0], [0, 0]],
            false => [[rect.col, rect.row], [rect.end_col() - 1, rect.end_row() - 1]].map(block),
        };
        (first[0]..=last[0])
            .flat_map(move |row| self.in_blocks([row, first[1]], [row, last[1]]))
            .copied()
            .filter(move |&[col, row]| rect.contains(col, row))
    }

    /// The samples from one block to another in block order.
    fn in_blocks(&self, first: [u32; 2], last: [u32; 2]) -> &[[u32; 2]] {
        let from = self.samples.partition_point(|&at| block(at) < first);
        let rest = &self.samples[from..];
        &rest[..rest.partition_point(|&at| block(at) <= last)]
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        bytes(self.samples.len()) + self.lines.paths().bytes()
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.samples.len() as u64
    }

    /// The report: the number of samples on the surface and of vertices among these; `None` if there are no
    /// constraints.
    pub fn report(&self, on_surface: u64, vertices: u64) -> Option<RequiredPointsReport> {
        let Self { points, outside, .. } = *self;
        let samples = self.count();
        (points > 0).then(|| RequiredPointsReport {
            file: self.path.as_deref().map_or_else(String::new, |path| path.display().to_string()),
            points,
            outside,
            samples,
            without_surface: samples - on_surface,
            vertices,
        })
    }
}

/// Report on required points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RequiredPointsReport {
    /// The source file.
    pub file: String,
    /// Number of points in the file.
    pub points: u64,
    /// Points beyond the grid by more than half a cell.
    pub outside: u64,
    /// Samples nearest to the other points.
    pub samples: u64,
    /// Samples that are voids or touch no cell of the surface.
    pub without_surface: u64,
    /// Samples that are vertices.
    pub vertices: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use terrane_base::geom::Affine;
    use terrane_raster::SampleType;

    fn grid(width: u32, height: u32, transform: Affine) -> GridInfo {
        GridInfo { transform, ..GridInfo::plain("test", width, height, SampleType::F32) }
    }

    fn nearest_samples(at: Vec<[f64; 2]>, grid: &GridInfo) -> Result<GridConstraints> {
        let (path, crs) = ("points.csv".into(), Crs::default());
        ConstraintVertices { path, crs, at, z: Vec::new(), ends: Vec::new() }.on(grid)
    }

    #[test]
    fn a_point_keeps_the_sample_it_is_nearest_to() {
        // Samples 10 by 20 apart, rows going south, from (100, 500).
        let map = Affine { x0: 100.0, a: 10.0, b: 0.0, y0: 500.0, d: 0.0, e: -20.0 };
        let grid = grid(4, 3, map);
        for (at, expected) in [
            ([100.0, 500.0], Some([0, 0])),
            ([104.9, 490.1], Some([0, 0])),
            ([105.0, 490.0], Some([1, 1])),
            ([95.0, 510.0], Some([0, 0])),
            ([94.9, 500.0], None),
            ([134.9, 450.1], Some([3, 2])),
            ([135.0, 460.0], None),
            ([f64::NAN, 460.0], None),
            ([f64::INFINITY, 460.0], None),
        ] {
            // The last sample, that there is one in any case.
            let kept = nearest_samples(vec![at, [130.0, 460.0]], &grid).unwrap();
            let mut all: Vec<_> = expected.into_iter().chain([[3, 2]]).collect();
            all.dedup();
            assert_eq!(kept.within(Rect::new(0, 0, 4, 3)).collect::<Vec<_>>(), all, "{at:?}");
            assert_eq!(kept.outside, u64::from(expected.is_none()), "{at:?}");
        }
        let error = nearest_samples(vec![[0.0, 0.0]], &grid).unwrap_err().to_string();
        assert!(error.contains("points.csv") && error.contains("on the grid"), "{error}");
    }

    proptest! {
        /// Reference implementation that scans every sample.
        #[test]
        fn a_rectangle_has_its_own_samples(
            at in prop::collection::vec((0..700_u32, 0..600_u32), 1..300),
            (col, row) in (0..700_u32, 0..600_u32), (width, height) in (0..700_u32, 0..600_u32)
        ) {
            let grid = grid(700, 600, Affine::LATTICE);
            let points = at.iter().map(|&(col, row)| [f64::from(col), -f64::from(row)]).collect();
            let kept = nearest_samples(points, &grid).unwrap();
            let rect = Rect::new(col, row, width.min(700 - col), height.min(600 - row));
            let mut expected: Vec<_> = at.iter().map(|&(col, row)| [col, row]).collect();
            expected.retain(|&[col, row]| rect.contains(col, row));
            expected.sort_unstable();
            expected.dedup();
            let mut found: Vec<_> = kept.within(rect).collect();
            found.sort_unstable();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn nothing_is_kept_of_nothing() {
        assert_eq!(GridConstraints::NONE.within(Rect::new(0, 0, 9, 9)).count(), 0);
        assert_eq!(GridConstraints::NONE.report(0, 0), None);
    }
}
