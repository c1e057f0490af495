//! What a mesh of a cloud has to keep of files of features, in steps of the cloud's frame: positions whose nearest
//! points are vertices, and lines from position to position that edges follow.

use std::path::PathBuf;

use crate::breaklines::BreaklinesReport;
use crate::constraints::{ConstraintFeatures, ConstraintVertices, RequiredPointsReport};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Ends, Point, PointFrame, REACH, cut};
use terrane_cloud::CloudInfo;

/// A straight line on the lattice of a cloud, whose columns and rows are steps east and north of the lowest x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LatticeLine {
    /// Its ends, the lower first (by row, then column).
    pub ends: Ends,
    /// The heights of its ends, in steps, where the file has them.
    pub heights: Option<[i32; 2]>,
}

/// What is to be kept, and of how much.
#[derive(Clone, Debug, Default)]
pub struct OnCloud {
    /// Positions within the bounds of the cloud, sorted, as often as there are points at them.
    pub points: Vec<[u32; 2]>,
    /// Lines within the bounds, sorted, each once.
    pub lines: Vec<LatticeLine>,
    points_asked: Option<(PathBuf, u64)>,
    lines_asked: Option<(PathBuf, u64)>,
    /// Segments beyond the bounds.
    lines_beyond: u64,
    /// How often each of `lines` is in the file, where that is more than once.
    repeats: Vec<(u32, u64)>,
}

impl ConstraintFeatures {
    /// Where it is on a cloud within `bounds`. Time O(n log n) for n points.
    ///
    /// # Errors
    /// Features in another system; heights beyond all bounds.
    pub fn on_cloud(self, info: &CloudInfo, bounds: [Point; 2]) -> Result<OnCloud> {
        OnCloud::new((self.points, self.lines), info, bounds)
    }
}

impl OnCloud {
    /// The points and lines of files over a cloud within `bounds`.
    pub fn new(
        (points, lines): (Option<ConstraintVertices>, Option<ConstraintVertices>),
        info: &CloudInfo,
        bounds: [Point; 2],
    ) -> Result<Self> {
        let (mut kept, place) = (Self::default(), CloudLattice::new(info.frame, bounds));
        if let Some(points) = points {
            info.crs
                .check_same_of("cloud", &points.crs, "points")
                .map_err(|e| e.in_file(&points.path))?;
            kept.points = points.at.iter().filter_map(|&at| place.nearest(at)).collect();
            kept.points.sort_unstable();
            kept.points_asked = Some((points.path, points.at.len() as u64));
        }
        if let Some(lines) = lines {
            info.crs
                .check_same_of("cloud", &lines.crs, "lines")
                .map_err(|e| e.in_file(&lines.path))?;
            kept.take_lines(lines, &place)?;
        }
        Ok(kept)
    }

    fn take_lines(&mut self, lines: ConstraintVertices, place: &CloudLattice) -> Result<()> {
        let starts = std::iter::once(0).chain(lines.ends.iter().map(|&end| end as usize));
        let (mut asked, mut all) = (0, Vec::new());
        for (start, &end) in starts.zip(&lines.ends) {
            for i in start + 1..end as usize {
                asked += 1;
                let vertex = |i: usize| (lines.at[i], lines.z.get(i).copied().unwrap_or(f64::NAN));
                let line = place.line([vertex(i - 1), vertex(i)]);
                all.extend(line.map_err(|e| e.in_file(&lines.path))?);
            }
        }
        self.lines_beyond = asked - all.len() as u64;
        all.sort_unstable();
        for same in all.chunk_by(|a, b| a == b) {
            if same.len() > 1 {
                self.repeats.push((self.lines.len() as u32, same.len() as u64));
            }
            self.lines.push(same[0]);
        }
        self.lines_asked = Some((lines.path, asked));
        Ok(())
    }

    /// True where there are lines for edges to follow.
    pub fn has_lines(&self) -> bool {
        self.lines_asked.is_some()
    }

    /// The bounds of a cloud and of the heights that lines have over it.
    pub fn and_heights(&self, [low, high]: [Point; 2]) -> [Point; 2] {
        let heights = || self.lines.iter().filter_map(|line| line.heights).flatten();
        let (least, most) = (heights().fold(low.z, i32::min), heights().fold(high.z, i32::max));
        [Point { z: least, ..low }, Point { z: most, ..high }]
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.points[..]) + size_of_val(&self.lines[..])) as u64
    }

    /// What a report says where so many of the positions lie beyond the hull of the cloud, and so many points are
    /// nearest to the others, of which so many are vertices; `None` where none were asked for.
    ///
    /// # Errors
    /// None is on the cloud.
    pub fn constraints(
        &self,
        beyond_hull: u64,
        nearest: u64,
        vertices: u64,
    ) -> Result<Option<RequiredPointsReport>> {
        let Some((path, points)) = &self.points_asked else { return Ok(None) };
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

    /// What a report says where some of the lines have no position in the hull of the cloud; `None` where no lines
    /// were asked for.
    ///
    /// # Errors
    /// None is on the cloud.
    pub fn followed(
        &self,
        is_outside: impl Fn(usize) -> bool,
        apart: u64,
    ) -> Result<Option<BreaklinesReport>> {
        let Some((path, segments)) = &self.lines_asked else { return Ok(None) };
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

/// Where the world is on the lattice of a cloud.
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
        let inside = |axis: usize| (0.0..f64::from(self.size[axis])).contains(&at[axis]);
        (inside(0) && inside(1)).then(|| at.map(|at| at as u32))
    }

    /// A segment as far as it is within the bounds: the same in both directions.
    fn line(&self, vertices: [([f64; 2], f64); 2]) -> Result<Option<LatticeLine>> {
        let [a, b] = vertices.map(|(at, z)| (self.steps(at), z));
        let order = |(at, z): ([f64; 2], f64)| [at[1], at[0], z];
        let [(a, p), (b, q)] = if order(a) <= order(b) { [a, b] } else { [b, a] };
        let Some(ends) = cut([a, b], self.size) else { return Ok(None) };
        if p.is_nan() || q.is_nan() {
            return Ok(Some(LatticeLine { ends: sorted(ends, [0; 2]).0, heights: None }));
        }
        let height = |end: [u32; 2]| self.height(share([a, b], end.map(f64::from)), [p, q]);
        let (ends, heights) = sorted(ends, [height(ends[0])?, height(ends[1])?]);
        Ok(Some(LatticeLine { ends, heights: Some(heights) }))
    }

    /// The height so far along a segment between these, in steps.
    fn height(&self, share: f64, [p, q]: [f64; 2]) -> Result<i32> {
        let ruler = self.frame.ruler(2);
        // Halves, as the difference of what is far apart may be no number.
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

/// Ends in their order, with what belongs to each.
fn sorted([a, b]: Ends, [p, q]: [i32; 2]) -> (Ends, [i32; 2]) {
    match ([a[1], a[0]], p) <= ([b[1], b[0]], q) {
        true => ([a, b], [p, q]),
        false => ([b, a], [q, p]),
    }
}

/// How far along a segment the position is that an end was cut to: 0 or 1 where nothing was cut off.
fn share([a, b]: [[f64; 2]; 2], end: [f64; 2]) -> f64 {
    let is_at = |at: [f64; 2]| (0..2).all(|axis| (at[axis] + 0.5).floor() == end[axis]);
    if is_at(a) {
        return 0.0;
    }
    if is_at(b) {
        return 1.0;
    }
    let span = |axis: usize| b[axis] / 2.0 - a[axis] / 2.0;
    let axis = usize::from(span(1).abs() > span(0).abs());
    ((end[axis] / 2.0 - a[axis] / 2.0) / span(axis)).clamp(0.0, 1.0)
}
