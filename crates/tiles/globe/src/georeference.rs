//! Mapping between columns and rows of a grid and positions on the globe.
//!
//! Grids whose rows and columns are parallels and meridians are mapped linearly; all others are bent: positions
//! are known at nodes, and interpolated by cubic polynomials in between, which follow a projection closely.
//!
//! So samples need no projection, and triangles do not tear. The proof computes each sample by the operation
//! itself.

#[cfg(test)]
mod tests;

use std::sync::{Arc, OnceLock};

use crate::globe::{EllipsoidNormal, SinCos, Vector, bend};
use crate::outline::{crossings, metres, outline, spacing};
use crate::sample_run::TerrainSample;
use crate::table::CubicTable;
use crate::tiling::GeodeticBounds;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Affine;

/// Tolerance in samples for a position on a sample.
pub(crate) const HAIR: f64 = 1e-7;
/// Samples between nodes, for small grids; fewer where a projection bends more.
const BETWEEN: [u32; 3] = [16, 4, 1];
/// Largest number of parts between nodes along an axis, and the minimum for a polynomial.
const PARTS: [u32; 2] = [3, 1023];
/// Largest error of an interpolated position in metres, and of the inverse in samples.
const OFF: f64 = 1e-4;
const OFF_BACK: f64 = 1e-3;
/// Points along each side of a rectangle used to find its samples.
const ALONG: u32 = 4;

/// Positions of the samples of a grid on the globe.
#[derive(Clone, Debug)]
pub struct GridGeolocation {
    size: [u32; 2],
    way: GlobeMapping,
    /// Descent of heights beyond the grid, in metres per metre.
    slope: f64,
}

/// A position in columns and rows; beyond the grid, the nearest position on its edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GlobePosition {
    /// Columns and rows.
    pub(crate) at: [f64; 2],
    /// Descent towards the ellipsoid in metres.
    pub(crate) fall: f64,
}

impl GlobePosition {
    /// Height at the position, from the height at the edge.
    pub(crate) fn lower(&self, height: f64) -> f64 {
        if self.fall == 0.0 {
            height
        } else {
            height.signum() * (height.abs() - self.fall).max(0.0)
        }
    }
}

#[derive(Clone, Debug)]
enum GlobeMapping {
    Straight(Affine),
    Bent(Arc<CurvedLattice>),
}

/// Rows and columns that are not parallels and meridians.
#[derive(Debug)]
struct CurvedLattice {
    /// From columns and rows to the vertical there, nearly of length 1.
    upright: CubicTable<3>,
    /// From longitudes and latitudes to columns and rows; NaN outside.
    samples: CubicTable<2>,
    bounds: GeodeticBounds,
    spacing: f64,
    /// Sampling distance along the border in degrees.
    stop: f64,
    /// Largest error of positions between nodes in metres.
    off: OnceLock<f64>,
}

impl GridGeolocation {
    /// For a grid of columns and rows that `map` transforms to longitudes and latitudes without rotation.
    pub fn straight(map: Affine, size: [u32; 2]) -> Self {
        debug_assert!(map.b == 0.0 && map.d == 0.0);
        Self { size, way: GlobeMapping::Straight(map), slope: 0.0 }
    }

    /// The same with ground beyond the grid that descends to the ellipsoid by this many metres per metre along
    /// the meridian and the parallel; level for 0.
    #[must_use]
    pub fn sloping(self, slope: f64) -> Self {
        Self { slope, ..self }
    }

    /// Descent of the ground beyond the grid.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// For a grid of columns and rows that `to` transforms to longitudes and latitudes in degrees, with inverse
    /// `back`.
    ///
    /// # Errors
    /// Errors of `to`; a grid across 180 degrees or with a pole, or one too bent for a thousand by a thousand
    /// nodes.
    pub fn bent(
        size: [u32; 2],
        to: impl Fn([f64; 2]) -> Result<[f64; 2]>,
        back: impl Fn([f64; 2]) -> Result<[f64; 2]>,
    ) -> Result<Self> {
        let ends = size.map(|count| count.max(2) - 1);
        let poles = [-90.0, 90.0].into_iter().flat_map(|pole| back([0.0, pole]));
        let is_in = |[col, row]: [f64; 2]| {
            (0.0..=f64::from(ends[0])).contains(&col) && (0.0..=f64::from(ends[1])).contains(&row)
        };
        if poles.into_iter().any(is_in) {
            return Err(Error::unsupported("contains a pole")
                .remedy("split it into parts without the pole"));
        }
        let mut result = Err(Error::bad_input("is empty"));
        for between in BETWEEN {
            let parts = ends.map(|end| end.div_ceil(between).clamp(PARTS[0], PARTS[1]));
            let chart = Self::of_parts(size, parts, &to, &back)?;
            result = chart.check(parts, &to).map(|off| match &chart.way {
                GlobeMapping::Bent(bent) => {
                    bent.off.set(off).unwrap_or_default();
                    chart
                }
                GlobeMapping::Straight(_) => chart,
            });
            if result.is_ok() {
                break;
            }
        }
        result
    }

    /// A bent grid with nodes this many parts apart.
    fn of_parts(
        size: [u32; 2],
        parts: [u32; 2],
        to: &impl Fn([f64; 2]) -> Result<[f64; 2]>,
        back: &impl Fn([f64; 2]) -> Result<[f64; 2]>,
    ) -> Result<Self> {
        let ends = size.map(|count| f64::from(count.max(2) - 1));
        let sides = ends.map(|end| [0.0, end]);
        let upright =
            CubicTable::new(sides, parts, |at| Ok(EllipsoidNormal::at(to(at)?).normal.0))?;
        let spacing = spacing(&upright);
        let bounds = outline(size, &upright, spacing)?;
        // With a margin, so that the table covers the border of the samples.
        let known = bounds.grown(2.0 * spacing);
        let sides = [[known.west, known.east], [known.south, known.north]];
        let samples = CubicTable::new(sides, parts, |at| Ok(back(at).unwrap_or([f64::NAN; 2])))?;
        // At most half the sample spacing, and a divisor of every tile's side.
        let stop = 180.0 / (360.0 / spacing).log2().ceil().exp2();
        let bent = CurvedLattice { upright, samples, bounds, spacing, stop, off: OnceLock::new() };
        Ok(Self { size, way: GlobeMapping::Bent(Arc::new(bent)), slope: 0.0 })
    }

    /// Fails if positions between nodes are inaccurate; returns their largest error in metres.
    fn check(&self, parts: [u32; 2], to: impl Fn([f64; 2]) -> Result<[f64; 2]>) -> Result<f64> {
        /// Largest number of test positions along an axis.
        const MAX_TESTS: u32 = 64;
        let mut max_off = 0.0_f64;
        for row in (0..parts[1]).step_by(parts[1].div_ceil(MAX_TESTS) as usize) {
            for col in (0..parts[0]).step_by(parts[0].div_ceil(MAX_TESTS) as usize) {
                // Samples halfway between nodes, where polynomials are off most.
                let at = [0, 1].map(|axis: usize| {
                    let last = f64::from(self.size[axis] - 1);
                    ((f64::from([col, row][axis]) + 0.5) * last / f64::from(parts[axis])).round()
                });
                let place = to(at)?;
                let off =
                    (self.upright(at).point(0.0) - EllipsoidNormal::at(place).point(0.0)).length();
                if off > OFF {
                    return Err(too_bent(off, "m"));
                }
                max_off = max_off.max(off);
                let back = self.at(place);
                let off = (back[0] - at[0]).abs().max((back[1] - at[1]).abs());
                if off.is_nan() || off > OFF_BACK {
                    return Err(too_bent(off, "samples"));
                }
            }
        }
        Ok(max_off)
    }

    /// Largest error of sample positions in metres.
    pub fn doubt(&self) -> f64 {
        /// Rounding: some places of a number of the size of the earth.
        const ROUNDED: f64 = 5e-8;
        match &self.way {
            GlobeMapping::Straight(_) => ROUNDED,
            GlobeMapping::Bent(bent) => ROUNDED + bent.off.get().unwrap_or(&OFF),
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Affine map to longitudes and latitudes, if rows are parallels and columns meridians.
    pub(crate) fn map(&self) -> Option<&Affine> {
        match &self.way {
            GlobeMapping::Straight(map) => Some(map),
            GlobeMapping::Bent(_) => None,
        }
    }

    /// Whether rows are not parallels, or columns not meridians.
    pub fn is_bent(&self) -> bool {
        matches!(self.way, GlobeMapping::Bent(_))
    }

    /// Bounds of all samples.
    pub fn bounds(&self) -> GeodeticBounds {
        match &self.way {
            GlobeMapping::Straight(map) => {
                let [a, b] = [[0; 2], self.size.map(|count| count - 1)]
                    .map(|[col, row]| map.apply(f64::from(col), f64::from(row)));
                GeodeticBounds {
                    west: a[0].min(b[0]),
                    south: a[1].min(b[1]),
                    east: a[0].max(b[0]),
                    north: a[1].max(b[1]),
                }
            }
            GlobeMapping::Bent(bent) => bent.bounds,
        }
    }

    /// Degrees between samples along the finer axis: of longitude, latitude, or along the equator.
    pub fn spacing(&self) -> f64 {
        match &self.way {
            GlobeMapping::Straight(map) => map.a.abs().min(map.e.abs()),
            GlobeMapping::Bent(bent) => bent.spacing,
        }
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> u64 {
        match &self.way {
            GlobeMapping::Straight(_) => 0,
            GlobeMapping::Bent(bent) => bent.upright.bytes() + bent.samples.bytes(),
        }
    }

    /// Vertical at a column and row.
    fn upright(&self, at: [f64; 2]) -> EllipsoidNormal {
        match &self.way {
            GlobeMapping::Straight(map) => EllipsoidNormal::at(map.apply(at[0], at[1])),
            GlobeMapping::Bent(bent) => EllipsoidNormal::along(Vector(bent.upright.at(at))),
        }
    }

    /// Longitude and latitude at a column and row.
    pub fn place(&self, at: [f64; 2]) -> [f64; 2] {
        match &self.way {
            GlobeMapping::Straight(map) => map.apply(at[0], at[1]),
            GlobeMapping::Bent(_) => self.upright(at).place(),
        }
    }

    /// Sample at a column and row.
    pub(crate) fn sample(&self, at: [f64; 2], height: f64) -> TerrainSample {
        match &self.way {
            GlobeMapping::Straight(map) => {
                let place = map.apply(at[0], at[1]);
                let lat = SinCos::of(place[1]);
                TerrainSample {
                    place,
                    height,
                    upright: EllipsoidNormal::of(SinCos::of(place[0]), lat, bend(lat)),
                }
            }
            GlobeMapping::Bent(_) => {
                let upright = self.upright(at);
                TerrainSample { place: upright.place(), height, upright }
            }
        }
    }

    /// Columns and rows of a position. For a bent grid, the nearest position in the bounds of all samples; NaN
    /// if there is none.
    pub(crate) fn at(&self, place: [f64; 2]) -> [f64; 2] {
        self.columns(self.on_one_side(place))
    }

    /// The same, on the side of 180 degrees of the given position.
    fn columns(&self, place: [f64; 2]) -> [f64; 2] {
        match &self.way {
            GlobeMapping::Straight(map) => map.invert(place[0], place[1]),
            GlobeMapping::Bent(bent) => bent.samples.at(bent.bounds.nearest(place)),
        }
    }

    /// 180 degrees is one meridian: assigned to the side nearer to the samples.
    fn on_one_side(&self, place: [f64; 2]) -> [f64; 2] {
        let GeodeticBounds { west, east, .. } = self.bounds();
        if place[0].abs() != 180.0 || (west..=east).contains(&place[0]) {
            return place;
        }
        [if 180.0 - east < west + 180.0 { 180.0 } else { -180.0 }, place[1]]
    }

    /// The same, snapped to samples within the tolerance. Outside of columns and rows, as at the first sample.
    pub(crate) fn within(&self, place: [f64; 2]) -> GlobePosition {
        let at = self.at(place);
        if at[0].is_nan() || at[1].is_nan() {
            let fall = if self.slope > 0.0 { f64::INFINITY } else { 0.0 };
            return GlobePosition { at: [0.0; 2], fall };
        }
        let near = at.map(|at| if (at - at.round()).abs() < HAIR { at.round() } else { at });
        let at = [0, 1].map(|axis: usize| near[axis].clamp(0.0, f64::from(self.size[axis] - 1)));
        let is_beside = match &self.way {
            GlobeMapping::Straight(_) => false,
            GlobeMapping::Bent(bent) => !bent.bounds.holds(place),
        };
        let fall = match self.slope > 0.0 && (is_beside || at != near) {
            true => self.slope * metres(self.on_one_side(place), self.place(at)),
            false => 0.0,
        };
        GlobePosition { at, fall }
    }

    /// Position this many metres outside a sample at the edge, along the columns or rows that end there;
    /// `inwards` is 1 where these start and -1 where they end.
    pub(crate) fn outside(&self, at: [f64; 2], axis: usize, inwards: f64, far: f64) -> [f64; 2] {
        let (edge, mut inner) = (self.place(at), at);
        inner[axis] += inwards;
        let inner = self.place(inner);
        let share = far / metres(inner, edge);
        [0, 1].map(|axis: usize| edge[axis] + (edge[axis] - inner[axis]) * share)
    }

    /// Range of columns and rows for positions in a rectangle, in fractions of samples.
    pub fn range(&self, bounds: &GeodeticBounds) -> [[f64; 2]; 2] {
        let GeodeticBounds { west, south, east, north } = *bounds;
        if let GlobeMapping::Straight(map) = &self.way {
            let [a, b] = [[west, north], [east, south]].map(|[lon, lat]| map.invert(lon, lat));
            return [0, 1].map(|axis: usize| [a[axis].min(b[axis]), a[axis].max(b[axis])]);
        }
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut bow = [0.0_f64; 2];
        let corners = [[west, south], [east, south], [east, north], [west, north]];
        for (i, from) in corners.into_iter().enumerate() {
            let to = corners[(i + 1) % 4];
            let points: [[f64; 2]; ALONG as usize + 1] = std::array::from_fn(|k| {
                let part = f64::from(k as u32) / f64::from(ALONG);
                self.columns([0, 1].map(|axis: usize| from[axis] + (to[axis] - from[axis]) * part))
            });
            for (axis, [low, high]) in ends.iter_mut().enumerate() {
                for point in points {
                    // Where nothing is known there may be any sample.
                    let [from, to] = match point[axis].is_nan() {
                        true => [0.0, f64::from(self.size[axis])],
                        false => [point[axis]; 2],
                    };
                    (*low, *high) = (low.min(from), high.max(to));
                }
                for three in points.windows(3) {
                    let off = three[1][axis] - (three[0][axis] + three[2][axis]) / 2.0;
                    bow[axis] = bow[axis].max(off.abs());
                }
            }
        }
        [0, 1].map(|axis: usize| [ends[axis][0] - bow[axis], ends[axis][1] + bow[axis]])
    }

    /// Largest distance of the middle of a rectangle of samples from a flat surface through its corners, in
    /// metres; 0 where rows are parallels, whose curvature is that of the earth.
    pub(crate) fn bow(&self, [left, top]: [f64; 2], [right, bottom]: [f64; 2]) -> f64 {
        if let GlobeMapping::Straight(_) = &self.way {
            return 0.0;
        }
        let [across, below] = [top, bottom].map(|row| self.sagitta([left, row], [right, row]));
        let [down, beside] = [left, right].map(|col| self.sagitta([col, top], [col, bottom]));
        across.max(below) + down.max(beside)
    }

    /// Distance of the middle of two samples from the straight line between them, in metres.
    fn sagitta(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let middle = [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0];
        let [a, middle, b] = [a, middle, b].map(|at| self.upright(at).point(0.0));
        (middle - (a + b) * 0.5).length()
    }

    /// Passes on positions along the straight line between two positions on one meridian or parallel that
    /// describe the course of a bent grid: the same for any part of the line. None for a straight grid.
    pub(crate) fn stops(&self, [from, to]: [[f64; 2]; 2], found: &mut impl FnMut([f64; 2])) {
        let GlobeMapping::Bent(bent) = &self.way else { return };
        let axis = usize::from(from[0] == to[0]);
        let GeodeticBounds { west, south, east, north } = bent.bounds;
        let [origin, low, high] =
            if axis == 0 { [-180.0, west, east] } else { [-90.0, south, north] };
        let [a, b] = [from[axis].min(to[axis]).max(low), from[axis].max(to[axis]).min(high)];
        let across = from[1 - axis];
        // The ground beyond the samples begins at their bounds.
        for end in [low, high].into_iter().filter(|end| (a..=b).contains(end)) {
            found(on_line(axis, end, across));
        }
        let [first, last] = [a, b].map(|value| (value - origin) / bent.stop);
        let mut i = first.ceil();
        while i <= last.floor() {
            found(on_line(axis, origin + i * bent.stop, across));
            i += 1.0;
        }
        // Crossings with rows or columns of samples may be breaks of the ground.
        let mut i = first.floor();
        let mut here = self.at(on_line(axis, origin + i * bent.stop, across));
        while i < last.ceil() {
            let ends = [i, i + 1.0].map(|i| origin + i * bent.stop);
            let next = self.at(on_line(axis, ends[1], across));
            for crossing in (0..2).flat_map(|axis| crossings(ends, [here[axis], next[axis]])) {
                if (a..=b).contains(&crossing) {
                    found(on_line(axis, crossing, across));
                }
            }
            (i, here) = (i + 1.0, next);
        }
    }
}

/// Position on a meridian (axis 1) or a parallel (axis 0).
fn on_line(axis: usize, along: f64, across: f64) -> [f64; 2] {
    if axis == 0 { [along, across] } else { [across, along] }
}

fn too_bent(off: f64, unit: &str) -> Error {
    Error::unsupported(format!(
        "is too large for its projection: positions are off by {off:.1e} {unit}"
    ))
    .remedy("split it, or transform it with gdalwarp -t_srs EPSG:4326")
}
