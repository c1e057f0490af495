//! Constraints of a point cloud's mesh, in steps of the cloud's lattice: positions whose nearest points become
//! vertices, and lines between positions that edges follow.

use std::path::PathBuf;

use crate::breaklines::BreaklinesReport;
use crate::constraints::{ConstraintFeatures, ConstraintVertices, RequiredPointsReport};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Ends, Point, PointFrame, REACH, cut};
use terrane_cloud::CloudInfo;

/// A segment on the lattice of a point cloud, whose columns and rows are steps east and north of the lowest x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LatticeLine {
    /// The ends, the lower one first (by row, then column).
    pub ends: Ends,
    /// The heights of the ends, in steps, if the file has heights.
    pub heights: Option<[i32; 2]>,
}

/// Constraints on the lattice of a point cloud, with counts for the report.
#[derive(Clone, Debug, Default)]
pub struct OnCloud {
    /// Positions within the bounds of the cloud, sorted, with repetitions.
    pub points: Vec<[u32; 2]>,
    /// Segments within the bounds, sorted, without duplicates.
    pub lines: Vec<LatticeLine>,
    requested_points: Option<(PathBuf, u64)>,
    requested_lines: Option<(PathBuf, u64)>,
    /// Number of segments beyond the bounds.
    lines_beyond: u64,
    /// Number of occurrences of each segment that occurs more than once.
    repeats: Vec<(u32, u64)>,
}

impl ConstraintFeatures {
    /// Places the constraints on a cloud within `bounds`. Time O(n log n) for n points.
    ///
    /// # Errors
    /// Features in another CRS; heights out of range.
    pub fn on_cloud(self, info: &CloudInfo, bounds: [Point; 2]) -> Result<OnCloud> {
        OnCloud::new(self.points, self.lines, info, bounds)
    }
}

impl OnCloud {
    /// The points and lines of files, on a cloud within `bounds`.
    pub fn new(
        points: Option<ConstraintVertices>,
        lines: Option<ConstraintVertices>,
        info: &CloudInfo,
        bounds: [Point; 2],
    ) -> Result<Self> {
        let (mut constraints, lattice) = (Self::default(), CloudLattice::new(info.frame, bounds));
        if let Some(points) = points {
            info.crs
                .check_same_of("cloud", &points.crs, "points")
                .map_err(|e| e.in_file(&points.path))?;
            constraints.points = points.at.iter().filter_map(|&at| lattice.nearest(at)).collect();
            constraints.points.sort_unstable();
            constraints.requested_points = Some((points.path, points.at.len() as u64));
        }
        if let Some(lines) = lines {
            info.crs
                .check_same_of("cloud", &lines.crs, "lines")
                .map_err(|e| e.in_file(&lines.path))?;
            constraints.take_lines(lines, &lattice)?;
        }
        Ok(constraints)
    }

    fn take_lines(&mut self, lines: ConstraintVertices, lattice: &CloudLattice) -> Result<()> {
        let starts = std::iter::once(0).chain(lines.ends.iter().map(|&end| end as usize));
        let (mut segments, mut all) = (0, Vec::new());
        for (start, &end) in starts.zip(&lines.ends) {
            for i in start + 1..end as usize {
                segments += 1;
                let line = lattice.line([i - 1, i].map(|i| lines.vertex(i)));
                all.extend(line.map_err(|e| e.in_file(&lines.path))?);
            }
        }
        self.lines_beyond = segments - all.len() as u64;
        all.sort_unstable();
        for same in all.chunk_by(|a, b| a == b) {
            if same.len() > 1 {
                self.repeats.push((self.lines.len() as u32, same.len() as u64));
            }
            self.lines.push(same[0]);
        }
        self.requested_lines = Some((lines.path, segments));
        Ok(())
    }

    /// True if there are lines.
    pub fn has_lines(&self) -> bool {
        self.requested_lines.is_some()
    }

    /// The bounds of a cloud, extended by the heights of the lines.
    pub fn and_heights(&self, [low, high]: [Point; 2]) -> [Point; 2] {
        let heights = self.lines.iter().filter_map(|line| line.heights).flatten();
        let (min, max) = (heights.clone().fold(low.z, i32::min), heights.fold(high.z, i32::max));
        [Point { z: min, ..low }, Point { z: max, ..high }]
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.points[..]) + size_of_val(&self.lines[..])) as u64
    }

    /// The report on required points: the number of positions beyond the cloud's hull, of points nearest to the others,
    /// and of vertices among these. `None` if no points were requested.
    ///
    /// # Errors
    /// No point is on the cloud.
    pub fn points_report(
        &self,
        beyond_hull: u64,
        nearest: u64,
        vertices: u64,
    ) -> Result<Option<RequiredPointsReport>> {
        let Some((path, points)) = &self.requested_points else { return Ok(None) };
        if nearest == 0 {
            return Err(Error::bad_input("no point lies within the bounds of the point cloud")
                .in_file(path)
                .remedy("compare the extents of both with terrane info"));
        }
        Ok(Some(RequiredPointsReport {
            file: path.display().to_string(),
            points: *points,
            outside: points - self.points.len() as u64 + beyond_hull,
            samples: nearest,
            without_surface: 0,
            vertices,
        }))
    }

    /// The report on breaklines; `is_outside` tests whether a line lies beyond the hull of the cloud. `None` if no
    /// lines were requested.
    ///
    /// # Errors
    /// No line is on the cloud.
    pub fn breaklines_report(
        &self,
        is_outside: impl Fn(usize) -> bool,
        apart: u64,
    ) -> Result<Option<BreaklinesReport>> {
        let Some((path, segments)) = &self.requested_lines else { return Ok(None) };
        let once = (0..self.lines.len()).filter(|&line| is_outside(line)).count() as u64;
        let more = self.repeats.iter().filter(|(line, _)| is_outside(*line as usize));
        let outside = self.lines_beyond + once + more.map(|(_, times)| times - 1).sum::<u64>();
        if outside == *segments {
            return Err(Error::bad_input("no line lies within the bounds of the point cloud")
                .in_file(path)
                .remedy("compare the extents of both with terrane info"));
        }
        let file = path.display().to_string();
        Ok(Some(BreaklinesReport { file, segments: *segments, outside, apart }))
    }
}

/// The lattice of a point cloud in world coordinates.
struct CloudLattice {
    frame: PointFrame,
    low: Point,
    size: [u32; 2],
}

impl CloudLattice {
    fn new(frame: PointFrame, [low, high]: [Point; 2]) -> Self {
        let size =
            [high.x.abs_diff(low.x), high.y.abs_diff(low.y)].map(|span| span.saturating_add(1));
        Self { frame, low, size }
    }

    /// Steps east and north of the lowest x and y.
    fn steps(&self, at: [f64; 2]) -> [f64; 2] {
        let low = [self.low.x, self.low.y].map(f64::from);
        [0, 1].map(|axis| self.frame.ruler(axis).place(at[axis]) - low[axis])
    }

    /// The nearest position, within the bounds.
    fn nearest(&self, at: [f64; 2]) -> Option<[u32; 2]> {
        let at = self.steps(at).map(|at| (at + 0.5).floor());
        let is_inside = (0..2).all(|axis| (0.0..f64::from(self.size[axis])).contains(&at[axis]));
        is_inside.then(|| at.map(|at| at as u32))
    }

    /// A segment clipped to the bounds; independent of its direction.
    fn line(&self, vertices: [([f64; 2], f64); 2]) -> Result<Option<LatticeLine>> {
        let [(a, p), (b, q)] = vertices.map(|(at, z)| (self.steps(at), z));
        let [(a, p), (b, q)] = match [a[1], a[0], p] <= [b[1], b[0], q] {
            true => [(a, p), (b, q)],
            false => [(b, q), (a, p)],
        };
        let Some(ends) = cut([a, b], self.size) else { return Ok(None) };
        if p.is_nan() || q.is_nan() {
            return Ok(Some(LatticeLine { ends: sorted(ends, [0; 2]).0, heights: None }));
        }
        let [first, last] = ends.map(|end| self.height(share([a, b], end.map(f64::from)), [p, q]));
        let (ends, heights) = sorted(ends, [first?, last?]);
        Ok(Some(LatticeLine { ends, heights: Some(heights) }))
    }

    /// The height at a fraction of a segment between two heights, in steps.
    fn height(&self, share: f64, [p, q]: [f64; 2]) -> Result<i32> {
        let ruler = self.frame.ruler(2);
        // Halves, as the difference of distant heights may overflow.
        let world = match share {
            0.0 => p,
            1.0 => q,
            _ => 2.0 * (p / 2.0 + share * (q / 2.0 - p / 2.0)),
        };
        let steps = (ruler.place(world) + 0.5).floor();
        match steps.abs() <= f64::from(REACH) {
            true => Ok(steps as i32),
            false => Err(Error::bad_input(format!(
                "height {world} is outside the coordinate range of the point cloud"
            ))
            .remedy("give heights in the unit of the point cloud, or none")),
        }
    }
}

/// Ends in order, each with its height.
fn sorted([a, b]: Ends, [p, q]: [i32; 2]) -> (Ends, [i32; 2]) {
    match ([a[1], a[0]], p) <= ([b[1], b[0]], q) {
        true => ([a, b], [p, q]),
        false => ([b, a], [q, p]),
    }
}

/// The position of a clipped end as a fraction of the segment: 0 or 1 if it is not clipped.
fn share([a, b]: [[f64; 2]; 2], end: [f64; 2]) -> f64 {
    if rounds_to(a, end) {
        return 0.0;
    }
    if rounds_to(b, end) {
        return 1.0;
    }
    // Halves, as the difference of distant positions may overflow.
    let span = [0, 1].map(|axis| b[axis] / 2.0 - a[axis] / 2.0);
    let axis = usize::from(span[1].abs() > span[0].abs());
    ((end[axis] / 2.0 - a[axis] / 2.0) / span[axis]).clamp(0.0, 1.0)
}

fn rounds_to(at: [f64; 2], end: [f64; 2]) -> bool {
    (0..2).all(|axis| (at[axis] + 0.5).floor() == end[axis])
}
