//! The lattice of the output.
//!
//! By default the output covers the bounding rectangle of the grid or of all grids, and its cells are squares as large as
//! the cell at the centre of the grid with the smallest; of several grids, one that is not reprojected stays on its
//! lattice. For that the outline is transformed, and some positions inside: the poles and the edges of a map may lie on the
//! outline of a grid of the globe, and everything else outside of it. With a resolution, but no rectangle, edges of cells lie at whole multiples of it, so
//! that parts of one grid, written one by one, are on one lattice.

use std::path::Path;

use super::mapping::CrsTransform;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Crs};
use terrane_base::limits;
use terrane_engine::memory;
use terrane_engine::options::{BoundsText, CellSize, FileName};
use terrane_options::Options;
use terrane_raster::{GridInfo, GridOpenOptions, Inputs};

/// Output lattice
#[derive(Clone, Debug, PartialEq, Options)]
#[options(heading = "Output grid", setters = group)]
pub struct LatticeOptions {
    /// Output cell size, or cell width and height, in CRS units; edges are at multiples of it
    #[option(value = "X[,Y]", with = CellSize, default_text = "that of the input at its centre")]
    pub resolution: Option<[f64; 2]>,
    /// Output extent, in the CRS of the output
    #[option(value = "XMIN,YMIN,XMAX,YMAX", with = BoundsText, default_text = "all of the input")]
    pub extent: Option<[f64; 4]>,
    /// Grid that defines the output lattice
    #[option(value = "GRID", with = FileName, role = ReadsGrid)]
    pub like: Option<String>,
}

/// Geotransform and size of the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TargetGrid {
    pub(super) transform: Affine,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// Less of a cell than this is rounding.
const HAIR: f64 = 1e-6;

/// Most positions transformed along each edge of the grids, and least along one.
const MAX_PLACES: u32 = 1 << 14;
const MIN_PLACES: u32 = 1 << 8;

/// Columns and rows of positions transformed inside a grid.
const INNER_PLACES: u32 = 16;

/// A grid with its transformation to the target CRS.
pub(super) struct LatticeSource<'a> {
    /// Its file, one of several.
    pub(super) name: Option<&'a Path>,
    pub(super) info: &'a GridInfo,
    pub(super) transform: &'a CrsTransform,
}

impl LatticeSource<'_> {
    /// An error with the name of the file.
    fn named(&self, error: Error) -> Error {
        match self.name {
            Some(name) if error.path().is_none() => error.in_file(name),
            _ => error,
        }
    }
}

/// The lattice in the target CRS `crs` for grids.
pub(super) fn of(
    options: &LatticeOptions,
    grids: &[LatticeSource<'_>],
    crs: &Crs,
) -> Result<TargetGrid> {
    let places = (MAX_PLACES / grids.len().max(1) as u32).max(MIN_PLACES);
    let is_geographic = crs.horizontal_unit() == "degree";
    let mut outline = WarpedExtent::none();
    for grid in grids {
        let mut own = WarpedExtent::of(grid.info, grid.transform, places);
        own.lost = own.lost.map(|error| grid.named(error));
        outline.join(own, is_geographic);
    }
    if let Some(like) = &options.like {
        let lattice = alike(like, crs)?;
        outline.check_near(lattice.extent()).map_err(|e| e.in_file(Path::new(like)))?;
        return Ok(lattice);
    }
    let (cell, finest) = match options.resolution {
        Some(cell) => (cell, None),
        None => finest(grids)?,
    };
    match (options.extent, options.resolution) {
        (Some(extent), None) => {
            outline.check_near(extent)?;
            let count = spans(extent, cell).map(|span| span.round().max(1.0));
            let [width, height] = [extent[2] - extent[0], extent[3] - extent[1]];
            upright([extent[0], extent[3]], [width / count[0], height / count[1]], count)
        }
        (Some(extent), Some(cell)) => {
            outline.check_near(extent)?;
            covering(extent, cell)
        }
        (None, None) => match finest {
            // Its samples stay where they are.
            Some(origin) => aligned(outline.complete()?, cell, origin),
            None => covering(outline.complete()?, cell),
        },
        (None, Some(cell)) => aligned(outline.complete()?, cell, [0.0; 2]),
    }
}

/// The smallest of the natural cells; with the corner of a cell if the lattice is to continue that of its grid, one of
/// several.
fn finest(grids: &[LatticeSource<'_>]) -> Result<([f64; 2], Option<[f64; 2]>)> {
    let mut finest = ([f64::MAX; 2], None);
    for grid in grids {
        let cell = natural(grid.info, grid.transform).map_err(|error| grid.named(error))?;
        if cell[0] * cell[1] < finest.0[0] * finest.0[1] {
            let map = grid.info.transform;
            let is_upright = (map.b, map.d) == (0.0, 0.0);
            let is_kept = grids.len() > 1 && grid.transform.is_none() && is_upright;
            finest = (cell, is_kept.then(|| map.apply(-0.5, -0.5)));
        }
    }
    Ok(finest)
}

/// Cells of this size that cover a rectangle, with edges at multiples of it from `origin` on.
fn aligned([x0, y0, x1, y1]: [f64; 4], cell: [f64; 2], origin: [f64; 2]) -> Result<TargetGrid> {
    let multiple = |at: f64, axis: usize| (at - origin[axis]) / cell[axis];
    // A hair inward: an extent on the lattice, rounded, would get a row of cells without samples.
    let low = [multiple(x0, 0), multiple(y0, 1)].map(|at| (at + HAIR).floor());
    let high = [multiple(x1, 0), multiple(y1, 1)].map(|at| (at - HAIR).ceil());
    let [[x0, y0], [x1, y1]] =
        [low, high].map(|at| [0, 1].map(|axis| at[axis] * cell[axis] + origin[axis]));
    covering([x0, y0, x1, y1], cell)
}

/// Columns and rows of the grid for each of the lattice, at the centre of the lattice or, if that has no position in the
/// CRS of the grid, at the centre of the grid.
pub(super) fn scale(
    lattice: &TargetGrid,
    grid: &GridInfo,
    transform: &CrsTransform,
) -> Result<[f64; 2]> {
    let backward = slopes(
        |[col, row]| {
            let position = lattice.transform.apply(col, row);
            transform.inverse(position).map(|[x, y]| grid.transform.invert(x, y))
        },
        centre(lattice.width, lattice.height),
    );
    if let Some([a, b]) = backward {
        return Ok([a[0].hypot(b[0]), a[1].hypot(b[1])]);
    }
    scale_inside(lattice, grid, transform)
}

/// As [`scale`], at the centre of the grid.
pub(super) fn scale_inside(
    lattice: &TargetGrid,
    grid: &GridInfo,
    transform: &CrsTransform,
) -> Result<[f64; 2]> {
    // The inverse of the forward derivatives.
    let forward = slopes(
        |[col, row]| {
            let [x, y] = transform.forward(grid.transform.apply(col, row)).ok()?;
            Some(lattice.transform.invert(x, y))
        },
        centre(grid.width, grid.height),
    );
    let Some([a, b]) = forward else {
        return Err(placeless().remedy("clip the grid with ‹bounds›"));
    };
    let determinant = (a[0] * b[1] - a[1] * b[0]).abs();
    Ok([b[1].hypot(b[0]) / determinant, a[1].hypot(a[0]) / determinant])
}

/// The position of the centre of a grid among its samples.
fn centre(width: u32, height: u32) -> [f64; 2] {
    [width, height].map(|samples| (f64::from(samples) - 1.0) / 2.0)
}

fn placeless() -> Error {
    Error::unsupported("the centre of the grid cannot be transformed to the target CRS")
}

/// Derivatives of a map by both coordinates, by central differences.
fn slopes(
    map: impl Fn([f64; 2]) -> Option<[f64; 2]>,
    [col, row]: [f64; 2],
) -> Option<[[f64; 2]; 2]> {
    let [by_col, by_row] = [[0.5, 0.0], [0.0, 0.5]].map(|step| {
        let [a, b] = [map([col - step[0], row - step[1]])?, map([col + step[0], row + step[1]])?];
        let by = [b[0] - a[0], b[1] - a[1]];
        by.iter().all(|by| by.is_finite()).then_some(by)
    });
    Some([by_col?, by_row?])
}

/// The cell size at the centre of the grid.
pub(super) fn natural(grid: &GridInfo, transform: &CrsTransform) -> Result<[f64; 2]> {
    let map = grid.transform;
    if transform.is_none() && map.b == 0.0 && map.d == 0.0 {
        return Ok([map.a.abs(), map.e.abs()]);
    }
    let side = slopes(
        |[col, row]| transform.forward(map.apply(col, row)).ok(),
        centre(grid.width, grid.height),
    )
    // A square of the area of a cell there: about as many samples as the grid has.
    .map(|[a, b]| (a[0] * b[1] - a[1] * b[0]).abs().sqrt())
    .filter(|side| *side > 0.0 && side.is_finite());
    side.map(|side| [side; 2])
        .ok_or_else(|| placeless().remedy("pass the cell size with ‹resolution›"))
}

/// The bounding rectangle of the cells of a grid in another CRS.
pub(super) struct WarpedExtent {
    /// Bounds of the positions that can be transformed.
    extent: [f64; 4],
    /// The first error of those on edges that cannot.
    lost: Option<Error>,
}

impl WarpedExtent {
    /// Of a grid.
    pub(super) fn around(grid: &GridInfo, transform: &CrsTransform) -> Self {
        Self::of(grid, transform, MAX_PLACES)
    }

    /// Of a grid, by at most `places` positions along each edge.
    fn of(grid: &GridInfo, transform: &CrsTransform, places: u32) -> Self {
        let mut outline = Self::none();
        outline.add_edges(grid, transform, places);
        if !transform.is_none() {
            outline.add_inside(grid, transform);
        }
        outline
    }

    fn none() -> Self {
        Self { extent: [f64::MAX, f64::MAX, f64::MIN, f64::MIN], lost: None }
    }

    fn add_inside(&mut self, grid: &GridInfo, transform: &CrsTransform) {
        let places = (1..INNER_PLACES).flat_map(|row| (1..INNER_PLACES).map(move |col| [col, row]));
        for place in places {
            let share = place.map(|at| f64::from(at) / f64::from(INNER_PLACES));
            let [col, row] = [share[0] * f64::from(grid.width), share[1] * f64::from(grid.height)];
            if let Ok(at) = transform.forward(grid.transform.apply(col - 0.5, row - 0.5)) {
                self.add(Ok(at));
            }
        }
    }

    /// Adds another; longitudes by as many turns as bring it next to this.
    fn join(&mut self, other: Self, is_geographic: bool) {
        let ([x0, y0, x1, y1], [left, low, right, high]) = (self.extent, other.extent);
        let turns = ((x0 + x1) - (left + right)) / 720.0;
        let is_first = x0 > x1;
        let by = if is_geographic && !is_first { turns.round() * 360.0 } else { 0.0 };
        self.extent = [x0.min(left + by), y0.min(low), x1.max(right + by), y1.max(high)];
        self.lost = self.lost.take().or(other.lost);
    }

    fn add_edges(&mut self, grid: &GridInfo, transform: &CrsTransform, places: u32) {
        let steps = grid.width.max(grid.height).min(places);
        let [right, bottom] = [grid.width, grid.height].map(f64::from);
        for step in 0..=steps {
            let share = f64::from(step) / f64::from(steps);
            let [col, row] = [share * right, share * bottom];
            for [col, row] in [[col, 0.0], [col, bottom], [0.0, row], [right, row]] {
                self.add(transform.forward(grid.transform.apply(col - 0.5, row - 0.5)));
            }
        }
    }

    fn add(&mut self, place: Result<[f64; 2]>) {
        match place {
            Ok([x, y]) => {
                let [x0, y0, x1, y1] = self.extent;
                self.extent = [x0.min(x), y0.min(y), x1.max(x), y1.max(y)];
            }
            Err(error) => self.lost = self.lost.take().or(Some(error)),
        }
    }

    /// The rectangle, if all edge positions can be transformed.
    fn complete(self) -> Result<[f64; 4]> {
        self.lost.map_or(Ok(self.extent), |error| {
            Err(error.remedy("pass the output extent with ‹extent› or ‹like›"))
        })
    }

    /// The bounds of the grid, if they certainly do not intersect a rectangle.
    pub(super) fn apart_from(&self, [x0, y0, x1, y1]: [f64; 4]) -> Option<[f64; 4]> {
        let [left, low, right, high] = self.extent;
        let is_near = x0 < right && left < x1 && y0 < high && low < y1;
        (self.lost.is_none() && !is_near).then_some(self.extent)
    }

    /// Fails if the grid does not intersect a rectangle.
    fn check_near(&self, extent: [f64; 4]) -> Result<()> {
        let Some([left, low, right, high]) = self.apart_from(extent) else { return Ok(()) };
        let [x0, y0, x1, y1] = extent;
        let message = format!("the output extent {x0},{y0},{x1},{y1} does not intersect the grid");
        Err(Error::usage(message).remedy(format!(
            "pass XMIN,YMIN,XMAX,YMAX in the target CRS, where the grid covers {left},{low},{right},{high}"
        )))
    }
}

impl TargetGrid {
    /// The lattice of a grid.
    pub(super) fn of(info: &GridInfo) -> Self {
        let GridInfo { transform, width, height, .. } = *info;
        Self { transform, width, height }
    }

    /// The rectangle around all cells.
    pub(super) fn extent(&self) -> [f64; 4] {
        let [right, bottom] = [self.width, self.height].map(|side| f64::from(side) - 0.5);
        let corners = [[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]];
        let corners = corners.map(|[col, row]| self.transform.apply(col, row));
        let low = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).fold(f64::MAX, f64::min));
        let high = [0, 1].map(|axis| corners.iter().map(|c| c[axis]).fold(f64::MIN, f64::max));
        [low[0], low[1], high[0], high[1]]
    }
}

/// The lattice of another grid.
fn alike(name: &str, crs: &Crs) -> Result<TargetGrid> {
    let other = memory::open_for_estimate(
        &Inputs::from(vec![name.to_owned()]),
        &GridOpenOptions::default(),
    )?;
    if other.info().crs.is_named() && !other.info().crs.agrees(crs) {
        let [theirs, ours] = other.info().crs.distinct_names(crs);
        let message = format!("its CRS is {theirs}, that of the output is {ours}");
        return Err(Error::usage(message)
            .in_file(Path::new(name))
            .remedy("pass its CRS as ‹to_crs›"));
    }
    Ok(TargetGrid::of(other.info()))
}

/// Columns and rows of a rectangle.
fn spans([x0, y0, x1, y1]: [f64; 4], cell: [f64; 2]) -> [f64; 2] {
    [(x1 - x0) / cell[0], (y1 - y0) / cell[1]]
}

/// Cells of this size from the upper left corner of a rectangle on, until it is covered.
fn covering(extent: [f64; 4], cell: [f64; 2]) -> Result<TargetGrid> {
    let count = spans(extent, cell).map(|span| (span - HAIR).ceil().max(1.0));
    upright([extent[0], extent[3]], cell, count)
}

/// A north-up lattice.
fn upright([x, y]: [f64; 2], [across, down]: [f64; 2], count: [f64; 2]) -> Result<TargetGrid> {
    let transform = Affine::from_gdal([x, across, 0.0, y, 0.0, -down]);
    let max_side = limits::MAX_SIDE as f64;
    let is_good =
        count.iter().all(|count| (1.0..=max_side).contains(count)) && transform.is_valid();
    if !is_good {
        let message =
            format!("the output size of {} x {} samples is out of range", count[0], count[1]);
        return Err(Error::usage(message).remedy("raise ‹resolution›, or reduce ‹extent›"));
    }
    let [width, height] = count.map(|count| count as u32);
    Ok(TargetGrid { transform, width, height })
}
