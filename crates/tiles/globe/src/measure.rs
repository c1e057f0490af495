//! Distance of samples from the decoded surface of a tile: flat triangles between positions on and above the
//! ellipsoid, measured along the vertical of each sample.

use std::collections::BTreeMap;

use crate::fold::{FoldedTriangles, cell};
use crate::globe::{EastNorthUpFrame, POLE, SinCos, Vector, beneath};
use crate::level::TileLevel;
use crate::sample_run::{
    SampleMeridian, SampleParallel, SampleRow, TerrainSample, TerrainSampleRun,
};
use crate::tile::{TileErrorMeasure, TileVertex};
use crate::tile_triangle::{FacetView, TileFacet};
use crate::tiling::GlobeTileId;

/// Latitude beyond which meridians are too close to each other for planes.
const FAR_NORTH: f64 = 80.0;
/// Largest number of triangles for a block.
const MAX_FACETS: usize = 24;

/// Distance from the axis of the earth in metres below which a vertex is a pole.
const POLAR: f64 = 1e-6;

/// No triangle.
const NONE: u32 = u32::MAX;

/// Bound of all rounding errors in metres.
const HAIR: f64 = 1e-6;

/// A triangle for samples of a parallel. A sample lies on its vertical, and the verticals of a parallel meet
/// the axis of the earth in one point. Seen from there, each side and the triangle are planes through or near
/// the origin: the side test of a sample is a sum of three products.
struct ParallelFacet {
    /// What the cosine and the sine of a longitude are multiplied by, and what is added: of each side, where samples
    /// within are positive by more than is rounded; and of the triangle, how steep it is.
    along: [[f64; 4]; 3],
    /// Distance of the triangle from the point on the axis, times its slope.
    plane: f64,
    /// Rounding error of that distance.
    doubt: f64,
    bend: f64,
}

impl ParallelFacet {
    /// For samples within `tolerance` metres of the triangle.
    fn new(facet: &TileFacet, parallel: &SampleParallel, tolerance: f64) -> Self {
        let TileFacet { corners, across, .. } = facet;
        let SampleParallel { turn: lat, bend, .. } = *parallel;
        let axis = Vector([0.0, 0.0, beneath(lat, bend)]);
        let sides = [0, 1, 2].map(|k| corners[(k + 2) % 3] - corners[(k + 1) % 3]);
        let longest = sides.iter().fold(0.0_f64, |longest, side| longest.max(side.length()));
        let slack = HAIR * (longest + tolerance);
        let [p, q, r] = [0, 1, 2].map(|k| (corners[(k + 1) % 3] - axis).cross(sides[k]).0);
        let planes = [p, q, r, across.0];
        let less = [slack, slack, slack, 0.0];
        let along = [
            planes.map(|plane| plane[0] * lat.cos),
            planes.map(|plane| plane[1] * lat.cos),
            std::array::from_fn(|i| planes[i][2] * lat.sin - less[i]),
        ];
        let plane = across.dot(corners[0] - axis);
        Self { along, plane, doubt: HAIR * across.length(), bend }
    }

    /// Whether a sample certainly lies in the triangle and within `limit` metres of it.
    #[inline]
    fn is_near(&self, lon: SinCos, height: f64, limit: f64) -> bool {
        let [x, y, z] = &self.along;
        let [a, b, c, steep]: [f64; 4] =
            std::array::from_fn(|i| x[i] * lon.cos + y[i] * lon.sin + z[i]);
        let off = (self.plane - (self.bend + height) * steep).abs();
        (a > 0.0) & (b > 0.0) & (c > 0.0) & (off < limit * steep - self.doubt)
    }
}

/// Surface of a tile.
pub struct TileShell {
    id: GlobeTileId,
    facets: Vec<TileFacet>,
    /// Start triangle for each cell of positions.
    starts: Vec<u32>,
    /// Cells along a side.
    cells: usize,
    last: u32,
    /// Overlapping triangles, if some are reversed.
    folds: Option<FoldedTriangles>,
    doubt: f64,
    /// Lowest and highest vertex at the south pole, and at the north pole.
    poles: [[f64; 2]; 2],
    measure: TileErrorMeasure,
    /// By triangle, the sample with the largest error beyond the tolerance.
    beyond: BTreeMap<u32, (f64, TerrainSample)>,
}

impl TileShell {
    /// From vertices, their points, and triangles with neighbours opposite each corner.
    pub(crate) fn new(
        id: GlobeTileId,
        level: &TileLevel,
        vertices: &[TileVertex],
        points: Vec<Vector>,
        mut triangles: Vec<([u32; 3], [u32; 3])>,
    ) -> Self {
        let cells = (triangles.len() as f64).sqrt().ceil().max(1.0) as usize;
        let (poles, is_flat) = flatten(&points, &mut triangles);
        let first = (0..).zip(&is_flat).find(|(_, is_flat)| !**is_flat).map_or(0, |(i, _)| i);
        let mut starts = vec![first; cells * cells];
        for (number, (corners, _)) in (0..).zip(&triangles).filter(|(i, _)| !is_flat[*i as usize]) {
            let at = vertices[corners[0] as usize].at;
            let [col, row] = at.map(|at| cell(f64::from(at), cells));
            starts[row * cells + col] = number;
        }
        let facets = triangles.iter().map(|(corners, twins)| {
            let at = corners.map(|corner| vertices[corner as usize].at);
            TileFacet::new(corners.map(|corner| points[corner as usize]), at, *twins)
        });
        let facets: Vec<TileFacet> = facets.collect();
        let inner = (0..).zip(&triangles).zip(&is_flat).filter(|(_, is_flat)| !**is_flat);
        let inner = inner.map(|((number, (corners, _)), _)| {
            (number, corners.map(|corner| vertices[corner as usize].at))
        });
        let folds = FoldedTriangles::of(id, level.lattice.unwrap_or_default(), &facets, inner);
        let (measure, beyond, doubt) = (TileErrorMeasure::default(), BTreeMap::new(), level.doubt);
        let last = first;
        Self { id, facets, starts, cells, last, folds, doubt, poles, measure, beyond }
    }

    /// Measures a sample, and records it if its error exceeds the tolerance.
    pub fn add(&mut self, sample: TerrainSample, tolerance: f64) {
        let frame = EastNorthUpFrame::new(&sample.upright, sample.height);
        let (facet, view) = self.facet(&sample, &frame);
        let off = match sample.place[1].abs() == 90.0 {
            true => self.off_pole(&sample),
            false => {
                let here = &self.facets[facet as usize];
                match &self.folds {
                    // On a side both triangles have the same distance: a vertical one gives none.
                    None => {
                        let twins = (0..3).zip(here.twins).filter(|(_, twin)| *twin != NONE);
                        let beside =
                            twins.filter(|(corner, _)| view.is_beside(*corner, self.doubt));
                        beside
                            .map(|(_, twin)| self.facets[twin as usize].view_from(&frame))
                            .fold(view.off(self.doubt), |off, twin| off.min(twin.off(self.doubt)))
                    }
                    Some(folds) => {
                        let near = folds.near(self.id.steps(sample.place)).iter();
                        let near = near.map(|number| &self.facets[*number as usize]);
                        let met = near.filter(|facet| facet.is_met(&frame));
                        let distances = met.map(|facet| facet.within(&frame, self.doubt));
                        distances
                            .reduce(f64::max)
                            .unwrap_or_else(|| here.within(&frame, self.doubt))
                    }
                }
            }
        };
        // NaN must not count as 0.
        let off = if off.is_nan() { f64::INFINITY } else { off };
        self.measure.samples += 1;
        self.measure.largest = self.measure.largest.max(off);
        if off > tolerance {
            self.note(facet, off, sample);
        }
    }

    /// Measures samples, each as by [`add`](Self::add).
    pub fn add_run(&mut self, run: &TerrainSampleRun<'_>, tolerance: f64) {
        match run {
            TerrainSampleRun::Row(row) if row.stride == 1 => self.add_row(row, tolerance),
            _ => run.each(&mut |sample| self.add(sample, tolerance)),
        }
    }

    /// Most samples lie in the triangle of the previous sample and have a smaller error than another: they are
    /// only counted.
    fn add_row(&mut self, row: &SampleRow<'_>, tolerance: f64) {
        let mut from = 0;
        while let Some(column) = row.columns.get(from) {
            let height = row.heights[from];
            from += 1;
            if height.is_finite() {
                self.add(row.parallel.sample(column, height), tolerance);
                let near =
                    self.near(&row.parallel, &row.columns[from..], &row.heights[from..], tolerance);
                self.measure.samples += near as u64;
                from += near;
            }
        }
    }

    /// Number of samples after the last one that need no test.
    fn near(
        &self,
        parallel: &SampleParallel,
        columns: &[SampleMeridian],
        heights: &[f64],
        tolerance: f64,
    ) -> usize {
        if self.folds.is_some() {
            return 0;
        }
        let strip = ParallelFacet::new(&self.facets[self.last as usize], parallel, tolerance);
        let limit = tolerance.min(self.measure.largest);
        let samples = columns.iter().zip(heights);
        samples.take_while(|(column, height)| strip.is_near(column.turn, **height, limit)).count()
    }

    /// A pole is one position with the heights of several vertices: the largest distance counts.
    fn off_pole(&self, sample: &TerrainSample) -> f64 {
        let [low, high] = self.poles[usize::from(sample.place[1] > 0.0)];
        (sample.height - low).abs().max((sample.height - high).abs())
    }

    /// Measures a block of samples at once. All are within `off` of the plane through `corners`, whose
    /// positions are within `bow` of a flat surface. If none can exceed the tolerance, they count with their
    /// upper bound; `false` otherwise.
    pub fn add_block(
        &mut self,
        corners: &[TerrainSample; 4],
        [off, bow]: [f64; 2],
        count: u32,
        tolerance: f64,
    ) -> bool {
        let points = corners.each_ref().map(|corner| corner.upright.point(corner.height));
        let Some((furthest, steep)) = self.furthest(corners, &points) else { return false };
        // Between the corners the earth is curved, unlike a plane.
        let across = (points[2] - points[0]).length().max((points[3] - points[1]).length());
        let bound = furthest + off + across * across / (4.0 * POLE) + bow * steep;
        let is_far = bound > tolerance || corners[0].place[1].abs() > FAR_NORTH;
        if is_far || self.folds.is_some() {
            return false;
        }
        self.measure.samples += u64::from(count);
        self.measure.largest = self.measure.largest.max(bound);
        true
    }

    /// Largest vertical distance of a corner from the plane of a triangle that touches a block, and the
    /// steepest slope per step in any direction; `None` for many triangles, or a corner outside the border:
    /// parallels are curved, sides of triangles are not.
    fn furthest(
        &mut self,
        corners: &[TerrainSample; 4],
        points: &[Vector; 4],
    ) -> Option<(f64, f64)> {
        let frames =
            corners.each_ref().map(|corner| EastNorthUpFrame::new(&corner.upright, corner.height));
        let mut first = NONE;
        for (corner, frame) in corners.iter().zip(&frames).rev() {
            let (facet, view) = self.facet(corner, frame);
            let twins = self.facets[facet as usize].twins;
            if view.parts.iter().zip(twins).any(|(part, twin)| *part < 0.0 && twin == NONE) {
                return None;
            }
            first = facet;
        }
        let [east, north] = corners[0].upright.across();
        let flat = |point: Vector| [(point - points[0]).dot(east), (point - points[0]).dot(north)];
        let quad = points.map(flat);
        let (mut open, mut visited) = (vec![first], vec![first]);
        let (mut furthest, mut steep) = (0.0_f64, 1.0_f64);
        while let Some(number) = open.pop() {
            let facet = &self.facets[number as usize];
            let TileFacet { corners: ends, twins, .. } = facet;
            // The first triangle contains a corner, up to rounding.
            if number != first && !meets(ends.map(flat), &quad) {
                continue;
            }
            for [off, slope] in frames.iter().map(|frame| facet.view_from(frame).plane()) {
                (furthest, steep) = (furthest.max(off), steep.max(slope));
            }
            for twin in twins.iter().filter(|twin| **twin != NONE) {
                if !visited.contains(twin) {
                    visited.push(*twin);
                    open.push(*twin);
                }
            }
            if visited.len() > MAX_FACETS {
                return None;
            }
        }
        Some((furthest, steep))
    }

    /// Records the sample with the largest error of each triangle, so that few become vertices.
    fn note(&mut self, facet: u32, off: f64, sample: TerrainSample) {
        let noted = self.beyond.entry(facet).or_insert((off, sample));
        if noted.0 < off {
            *noted = (off, sample);
        }
    }

    /// Triangle on the vertical of a sample: a walk across edges, which ends at the border of the tile.
    fn facet(&mut self, sample: &TerrainSample, frame: &EastNorthUpFrame) -> (u32, FacetView) {
        let mut now = self.last;
        let mut steps = 0;
        let view = 'walk: loop {
            let facet = &self.facets[now as usize];
            let view = facet.view_from(frame);
            for (part, twin) in view.parts.into_iter().zip(facet.twins) {
                if part < 0.0 && twin != NONE {
                    steps += 1;
                    // Most walks are short, from the sample before. One that is not begins again near this sample, and
                    // the count ends it in any case: where triangles are turned over it may go in circles.
                    if steps == 64 {
                        now = self.start(sample);
                    } else if steps > 64 + self.facets.len() {
                        break 'walk view;
                    } else {
                        now = twin;
                    }
                    continue 'walk;
                }
            }
            let mut out = (0..3).filter(|k| view.parts[*k] < 0.0 && facet.twins[*k] == NONE);
            match out.find_map(|k| self.along_border(now, k, sample, frame)) {
                Some(next) if steps < 64 + self.facets.len() => (now, steps) = (next, steps + 1),
                _ => break view,
            }
        };
        self.last = now;
        (now, view)
    }

    /// The triangle of the border beside which a sample is, where that is another one: the sample is beyond the side
    /// across from `corner`. Sides are straight and parallels are not, so that a walk may meet the border far from where
    /// the sample is. Of two triangles that meet at a vertex of the border, and that it is beyond, it stays at the one on
    /// whose side it is.
    fn along_border(
        &self,
        facet: u32,
        corner: usize,
        sample: &TerrainSample,
        frame: &EastNorthUpFrame,
    ) -> Option<u32> {
        let next = |(facet, corner)| self.next_on_border(facet, corner, sample, frame);
        let (mut now, mut is_next) = (next((facet, corner))?, true);
        for _ in &self.facets {
            let Some(further) = next(now) else { break };
            (now, is_next) = (further, false);
        }
        let is_beyond = self.facets[now.0 as usize].view_from(frame).parts[now.1] < 0.0;
        let stays = is_next && is_beyond && !self.holds(now.0, frame);
        (now.0 != facet && !stays).then_some(now.0)
    }

    /// The next triangle of the border, and its corner across from there, in the direction of a sample; `None` where its
    /// meridian passes the side across from `corner`, or its parallel does where that side is on a meridian.
    fn next_on_border(
        &self,
        facet: u32,
        corner: usize,
        sample: &TerrainSample,
        frame: &EastNorthUpFrame,
    ) -> Option<(u32, usize)> {
        let here = &self.facets[facet as usize];
        let [a, b] = [1, 2].map(|k| here.corners[(corner + k) % 3]);
        // Positive if the sample is before the first end, and past the other one.
        let [before, beyond] = if here.on_parallel[corner] {
            let (east, normal) = (turn(a, b), sample.upright.normal);
            [turn(normal, a) * east, turn(b, normal) * east]
        } else {
            let [from, to] = [a, b].map(|end| frame.local(end)[1]);
            [from * (to - from), to * (from - to)]
        };
        // For a corner: its counter-clockwise successors on the current side and on the next.
        let (pivot, [first, next]) = if beyond > 0.0 {
            (b, [1, 2])
        } else if before > 0.0 {
            (a, [2, 1])
        } else {
            return None;
        };
        let (mut now, mut side) = (facet, (corner + first) % 3);
        for _ in 0..self.facets.len() {
            let there = &self.facets[now as usize];
            if there.twins[side] != NONE {
                now = there.twins[side];
                let corners = &self.facets[now as usize].corners;
                side = (corners.iter().position(|at| *at == pivot)? + next) % 3;
                continue;
            }
            // Beyond a corner of the tile, the side on a parallel has priority over the one on a meridian.
            let is_same = there.on_parallel[side] == here.on_parallel[corner];
            let is_first = there.on_parallel[side] && self.holds(now, frame);
            return (is_same || is_first).then_some((now, side));
        }
        None
    }

    /// Whether a sample is on the inner side of all sides of a triangle that are no borders.
    fn holds(&self, facet: u32, frame: &EastNorthUpFrame) -> bool {
        let facet = &self.facets[facet as usize];
        let mut parts = facet.view_from(frame).parts.into_iter().zip(facet.twins);
        parts.all(|(part, twin)| twin == NONE || part >= 0.0)
    }

    /// A triangle near a sample.
    fn start(&self, sample: &TerrainSample) -> u32 {
        let [col, row] = self.id.steps(sample.place).map(|at| cell(at, self.cells));
        self.starts[row * self.cells + col]
    }

    /// Measured errors, and for each triangle the sample with the largest error beyond the tolerance.
    pub fn end(self) -> (TileErrorMeasure, Vec<TerrainSample>) {
        let beyond = self.beyond.into_values().map(|(_, sample)| sample).collect();
        (self.measure, beyond)
    }
}

/// Cross product seen along the axis of the earth: positive if `b` is to the east of `a`.
fn turn(Vector([ax, ay, _]): Vector, Vector([bx, by, _]): Vector) -> f64 {
    ax * by - ay * bx
}

/// Whether a point of a vertex lies on the axis of the earth.
fn is_pole(point: &Vector) -> bool {
    point.0[0].abs().max(point.0[1].abs()) < POLAR
}

/// At a pole a whole border is one position, and a triangle with two corners there is degenerate: it is
/// unlinked from its neighbours. Returns the lowest and the highest vertex at both poles, and the unlinked
/// triangles.
fn flatten(
    points: &[Vector],
    triangles: &mut [([u32; 3], [u32; 3])],
) -> ([[f64; 2]; 2], Vec<bool>) {
    let mut poles = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for point in points.iter().filter(|point| is_pole(point)) {
        let ([low, high], height) =
            (&mut poles[usize::from(point.0[2] > 0.0)], point.0[2].abs() - POLE);
        (*low, *high) = (low.min(height), high.max(height));
    }
    let mut is_flat = vec![false; triangles.len()];
    if poles.as_flattened().iter().all(|height| height.is_infinite()) {
        return (poles, is_flat);
    }
    for number in 0..triangles.len() {
        let (corners, twins) = triangles[number];
        let corners = corners.map(|corner| &points[corner as usize]);
        let polar = [false, true]
            .map(|is_north| corners.map(|point| is_pole(point) && (point.0[2] > 0.0) == is_north));
        let is_line = |polar: &[bool; 3]| polar.iter().filter(|polar| **polar).count() > 1;
        let Some(polar) = polar.into_iter().find(is_line) else { continue };
        is_flat[number] = true;
        let mut neighbors = twins.into_iter().zip(polar).filter(|(_, polar)| *polar);
        let (Some((a, _)), Some((b, _))) = (neighbors.next(), neighbors.next()) else { continue };
        for (one, other) in [(a, b), (b, a)].into_iter().filter(|(one, _)| *one != NONE) {
            let back = triangles[one as usize].1.iter_mut();
            back.filter(|twin| **twin == number as u32).for_each(|twin| *twin = other);
        }
    }
    (poles, is_flat)
}

/// Whether a counter-clockwise triangle may intersect a quadrilateral: no edge of the triangle has it entirely
/// on the right, and the bounding boxes intersect.
fn meets(triangle: [[f64; 2]; 3], quad: &[[f64; 2]; 4]) -> bool {
    let [of_triangle, of_quad] =
        [&triangle[..], quad].map(|points| [0, 1].map(|axis| range(points, axis)));
    // Margin for rounding and for the curvature of the earth.
    let [width, height] = of_quad.map(|[low, high]| high - low);
    let slack = width.max(height) * SLACK;
    let is_apart = of_triangle
        .iter()
        .zip(of_quad)
        .any(|([low, high], [from, to])| *high < from - slack || to < low - slack);
    !is_apart && (0..3).all(|k| !is_right_of(quad, [triangle[k], triangle[(k + 1) % 3]], slack))
}

/// Lowest and highest coordinate along an axis.
fn range(points: &[[f64; 2]], axis: usize) -> [f64; 2] {
    let all = points.iter().map(|point| point[axis]);
    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| [low.min(at), high.max(at)])
}

/// Whether all points lie on the right of an edge, more than `slack` away.
fn is_right_of(points: &[[f64; 2]], [[ax, ay], [bx, by]]: [[f64; 2]; 2], slack: f64) -> bool {
    let [ex, ey] = [bx - ax, by - ay];
    let size = (ex * ex + ey * ey).sqrt() * slack;
    points.iter().all(|[x, y]| ex * (y - ay) - ey * (x - ax) < -size)
}

/// Tolerance for triangles beside a block, relative to its size.
const SLACK: f64 = 0.05;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::georeference::GridGeolocation;
    use crate::level::LevelRelief;
    use crate::surface::TileBuilder;
    use crate::terrain::{HeightPatch, TerrainSampler as _, VoidFillSums};
    use crate::tiling::GeodeticBounds;
    use proptest::prelude::*;
    use terrane_base::geom::{Affine, Rect};

    /// A tile of a level, by part of all columns and rows.
    fn tile(level: u8, at: (f64, f64)) -> GlobeTileId {
        let across = f64::from(1_u32 << level);
        GlobeTileId { level, x: (at.0 * across * 2.0) as u32, y: (at.1 * across) as u32 }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// A block on a plane, anywhere in a tile and more often beside its border than not.
        #[test]
        fn no_sample_of_a_block_is_further_off_than_the_block(
            number in 0_u8..12, at in (0.0..1.0_f64, 0.0..1.0_f64), size in (1_u32..17, 1_u32..17),
            place in (0.0..1.0_f64, 0.0..1.0_f64), ends in (-3..6_i32, -3..6_i32),
            fine in prop::sample::select(vec![1e-6, 1e-4, 1e-3, 0.01, 0.03]),
            plane in (-3000.0..3000.0_f64, -9.0..9.0_f64, -9.0..9.0_f64),
        ) {
            let id = tile(number, at);
            let GeodeticBounds { west, south, east, north } = id.bounds();
            let step = (east - west) * fine;
            // Some samples from the border, or anywhere.
            let begin = |[from, to]: [f64; 2], end: i32, place: f64, count: u32| match end {
                -3..0 => from - f64::from(end + 1) * step * 3.0,
                3.. => to - f64::from(count - 1) * step - f64::from(end - 3) * step * 3.0,
                _ => from + (to - from - f64::from(count) * step) * place,
            };
            let west = begin([west, east], ends.0, place.0, size.0);
            let south = begin([south, north], ends.1, place.1, size.1);
            let top = south + f64::from(size.1 - 1) * step;
            let map = Affine { x0: west, a: step, b: 0.0, y0: top, d: 0.0, e: -step };
            let height = |col: u32, row: u32| {
                plane.0 + f64::from(col) * plane.1 + f64::from(row) * plane.2
            };
            let all = (0..size.1).flat_map(|row| (0..size.0).map(move |col| height(col, row)));
            let heights: Vec<f64> = all.collect();
            let mut means = VoidFillSums::new([size.0, size.1]);
            (0..).zip(heights.chunks(size.0 as usize)).for_each(|(row, line)| means.add(0, row, line));
            let (chart, fill) = (GridGeolocation::straight(map, [size.0, size.1]), means.fill().unwrap());
            let patch = HeightPatch::new(&heights, Rect::new(0, 0, size.0, size.1), &chart, &fill);
            let relief = LevelRelief { reach: 9000.0, range: 9000.0, ..LevelRelief::default() };
            let level = TileLevel::new(number, step, &relief);
            let builder = TileBuilder::new(id, &level, &patch).unwrap();
            let [right, down] = [size.0 - 1, size.1 - 1];
            let corners = [[0, 0], [right, 0], [right, down], [0, down]].map(|[col, row]| {
                chart.sample([col, row].map(f64::from), height(col, row))
            });
            let [mut whole, mut each] = [0; 2].map(|_| builder.shell());
            if whole.add_block(&corners, [0.0; 2], size.0 * size.1, f64::INFINITY) {
                patch.each(&id.bounds().grown(1e-9), 1, &mut |sample| each.add(sample, f64::INFINITY));
                let [whole, each] = [whole, each].map(|shell| shell.end().0);
                prop_assert!(each.largest <= whole.largest * (1.0 + 1e-9) + 1e-6, "{each:?} {whole:?}");
                prop_assert_eq!(each.samples, whole.samples);
            }
        }

        /// Parallels bend, so that a tile is not convex: a sample is as far off wherever the search begins.
        #[test]
        fn every_walk_ends_at_the_same_distance(
            number in 0_u8..12, at in (0.0..1.0_f64, 0.0..1.0_f64),
            vertices in prop::collection::vec((along(), along(), -4000.0..4000.0_f64), 0..12),
            place in (along(), along()),
        ) {
            let id = tile(number, at);
            let GeodeticBounds { west, south, east, north } = id.bounds();
            let sample = |(x, y): (f64, f64), height: f64| {
                TerrainSample::new([west + (east - west) * x, south + (north - south) * y], height)
            };
            let map = Affine { x0: west, a: 1e-5, b: 0.0, y0: south, d: 0.0, e: -1e-5 };
            let mut means = VoidFillSums::new([1, 1]);
            means.add(0, 0, &[500.0]);
            let (chart, fill) = (GridGeolocation::straight(map, [1, 1]), means.fill().unwrap());
            let patch = HeightPatch::new(&[500.0], Rect::new(0, 0, 1, 1), &chart, &fill);
            let level = TileLevel::new(number, 1e-5, &LevelRelief { reach: 9000.0, ..LevelRelief::default() });
            let mut builder = TileBuilder::new(id, &level, &patch).unwrap();
            let vertices = vertices.into_iter().map(|(x, y, height)| sample((x, y), height));
            builder.insert(&vertices.collect::<Vec<_>>());
            let (mut shell, sample, mut first) = (builder.shell(), sample(place, 500.0), None);
            let frame = EastNorthUpFrame::new(&sample.upright, sample.height);
            // No walk comes to those that are a line at a pole.
            let is_pole = |at: &&Vector| at.0[0].hypot(at.0[1]) < 1e-3;
            let is_wide = |facet: &TileFacet| facet.corners.iter().filter(is_pole).count() < 2;
            let all = (0..).zip(&shell.facets).filter(|(_, facet)| is_wide(facet));
            let all: Vec<u32> = all.map(|(number, _)| number).collect();
            let seen = shell.facets.iter().filter(|facet| facet.is_met(&frame));
            let expected = seen.map(|facet| facet.within(&frame, 0.0)).reduce(f64::max);
            for from in all {
                shell.last = from;
                shell.measure = TileErrorMeasure::default();
                shell.add(sample, f64::INFINITY);
                let off = shell.measure.largest;
                let expected = *first.get_or_insert(expected.unwrap_or(off));
                prop_assert!((off - expected).abs() < 1e-3, "{from} {off} {expected}");
            }
        }
    }

    /// Part of the side of a tile, often near an end.
    fn along() -> impl Strategy<Value = f64> {
        prop_oneof![0.001..0.999_f64, 0.0001..0.01, 0.99..0.9999]
    }
}
