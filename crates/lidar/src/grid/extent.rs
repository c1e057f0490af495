//! The cells of a grid: from the cell size, the bounds of the point cloud, a box or another grid.

use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Rect};
use terrane_base::limits;
use terrane_cloud::CloudInfo;
use terrane_files::path_of;
use terrane_gridding::{CellEdgeRule, CellLattice, FAR, Statistic, StatisticDefaults};
use terrane_raster::{self as raster, GridInfo};

use super::geometry::{Compat, Placement};
use super::job::GridJob;

/// Requested cells.
#[derive(Clone, Copy)]
pub(super) struct CellRequest<'a> {
    /// All cells.
    pub(super) extent: &'a GridExtent,
    /// The requested rectangle.
    pub(super) rect: Rect,
    /// Longest edge of triangles that are surface, in world units.
    pub(super) max_edge: Option<f64>,
}

/// The cells of a job.
#[derive(Clone, Debug)]
pub(super) struct GridExtent {
    /// All cells that are computed.
    pub(super) lattice: CellLattice,
    /// Those of them that are written.
    pub(super) output: Rect,
    /// Cells that voids may be filled from: those that the bounds of the point cloud overlap, independent of
    /// the part that is computed.
    pub(super) known: Rect,
    /// Columns and rows that voids are filled from.
    pub(super) fill: u32,
    pub(super) crs: Crs,
    pub(super) notes: Vec<String>,
}

/// Less of a cell than this is rounding, not overlap.
const HAIR: f64 = 1e-6;

/// First and number of the cells along both axes, by lattice index.
type Spans = [[i64; 2]; 2];

impl GridExtent {
    pub(super) fn new(cloud: &CloudInfo, job: &GridJob) -> Result<Self> {
        let (base, spans, crs, notes) = match &job.placement.like {
            Some(like) => like_grid(like, cloud, job)?,
            None => {
                let (base, spans) = by_cell(cloud, job)?;
                let note = job.placement.is_chosen.then(|| {
                    let cell = base.x.world_cell();
                    format!("cell size {cell}: about the point spacing; ‹cell› overrides it")
                });
                (base, spans, cloud.crs.clone(), note.into_iter().collect())
            }
        };
        let margin = i64::from(job.fill);
        let [[x, width], [y, height]] = spans;
        let sides = [width + 2 * margin, height + 2 * margin].map(|side| side as u64);
        limits::check("number of columns", sides[0], limits::MAX_SIDE)?;
        limits::check("number of rows", sides[1], limits::MAX_SIDE)?;
        let lattice = CellLattice {
            x: base.x.covering(x - margin, sides[0] as u32),
            y: base.y.covering(y - margin, sides[1] as u32),
        };
        let output = Rect::new(job.fill, job.fill, width as u32, height as u32);
        let known = known(&lattice, cloud);
        Ok(Self { lattice, output, known, fill: job.fill, crs, notes })
    }

    /// The grid as it is written.
    pub(super) fn written(&self, job: &GridJob) -> GridInfo {
        let Rect { col, row, width, height } = self.output;
        GridInfo {
            transform: self.lattice.transform().shifted(f64::from(col), f64::from(row)),
            georeferenced: true,
            crs: self.crs.clone(),
            nodata: Some(job.nodata),
            bands: u32::try_from(job.stats.len()).unwrap_or(u32::MAX),
            ..GridInfo::plain("grid of points", width, height, job.sample_type)
        }
    }

    /// The same for a rectangle of the cells that are written, by their columns and rows.
    pub(super) fn part(&self, rect: Rect, cloud: &CloudInfo) -> Self {
        let CellLattice { x, y } = self.lattice;
        let below = i64::from(self.output.height - rect.row - rect.height);
        let lattice = CellLattice {
            x: x.covering(x.first() + i64::from(rect.col), rect.width + 2 * self.fill),
            y: y.covering(y.first() + below, rect.height + 2 * self.fill),
        };
        let output = Rect::new(self.fill, self.fill, rect.width, rect.height);
        let known = known(&lattice, cloud);
        Self { lattice, output, known, notes: Vec::new(), ..self.clone() }
    }

    /// Sides of a cell.
    pub(super) fn cell(&self) -> [f64; 2] {
        [self.lattice.x.world_cell(), self.lattice.y.world_cell()]
    }

    /// The radius to report: that of the job, if a statistic uses it.
    pub(super) fn radius(&self, rules: &StatisticDefaults, job: &GridJob) -> Option<f64> {
        let mut stats = job.stats.iter();
        stats.any(|request| uses_radius(request.statistic, rules)).then_some(rules.radius)
    }
}

/// Whether a statistic uses the radius of the job.
fn uses_radius(statistic: Statistic, rules: &StatisticDefaults) -> bool {
    statistic.parameter("radius").is_none() && (rules.around || statistic.lacks("radius"))
}

/// The cells that the bounds of the point cloud overlap.
fn known(lattice: &CellLattice, cloud: &CloudInfo) -> Rect {
    let Some(bounds) = cloud.bounds else { return Rect::new(0, 0, 0, 0) };
    let (width, height) = lattice.size();
    let [[west, east], [south, north]] = lattice.span(bounds);
    let (width, height) = (i64::from(width), i64::from(height));
    let [left, right] = [west, east + 1].map(|x| (x - lattice.x.first()).clamp(0, width) as u32);
    let [top, bottom] =
        [north + 1, south].map(|y| (height - (y - lattice.y.first())).clamp(0, height) as u32);
    Rect::new(left, top, right - left, bottom - top)
}

/// The bounds of the point cloud in world units.
fn world(cloud: &CloudInfo) -> Option<[f64; 4]> {
    let [low, high] = cloud.bounds?.map(|corner| cloud.frame.world(corner));
    Some([low[0], low[1], high[0], high[1]])
}

/// Metres along a degree of latitude, about.
const DEGREE: f64 = 111_320.0;

/// Fails if a cell size in degrees was apparently meant in metres: the cell is larger than the extent.
fn refuse_degrees(cell: [f64; 2], bounds: Option<[f64; 4]>, crs: &Crs) -> Result<()> {
    let Some([west, south, east, north]) = bounds else { return Ok(()) };
    let sides = [east - west, north - south];
    if crs.horizontal_unit() != "degree" || (0..2).any(|axis| cell[axis] <= sides[axis]) {
        return Ok(());
    }
    let shrink = f64::midpoint(south, north).to_radians().cos().abs().max(1e-3);
    let [x, y] = [cell[0] / (DEGREE * shrink), cell[1] / DEGREE];
    Err(Error::usage(format!(
        "a cell of {} x {} degrees is larger than the extent of the points, {:.2e} x {:.2e} degrees",
        cell[0], cell[1], sides[0], sides[1]
    ))
    .remedy(format!(
        "‹cell› is in degrees: for {} x {} metres pass ‹cell› {x:.2e},{y:.2e}",
        cell[0], cell[1]
    )))
}

/// A lattice of cells of the given size, and the cells of the point cloud or the box.
fn by_cell(cloud: &CloudInfo, job: &GridJob) -> Result<(CellLattice, Spans)> {
    let Placement { cell, align, extent, .. } = &job.placement;
    let cell = cell.unwrap_or([1.0; 2]);
    refuse_degrees(cell, extent.or_else(|| world(cloud)), &cloud.crs)?;
    let anchor = match job.compat {
        Compat::Pdal => extent.or_else(|| world(cloud)).map(|[x, y, ..]| [x, y]),
        Compat::None | Compat::Lasr => *align,
    };
    let anchor = anchor.unwrap_or([0.0; 2]);
    let lattice = CellLattice::new(&cloud.frame, anchor, cell, edge_rule(job.compat));
    let spans = match (extent, cloud.bounds) {
        (Some([x0, y0, x1, y1]), _) if job.compat == Compat::Pdal => {
            let [width, height] = [(x1 - x0) / cell[0], (y1 - y0) / cell[1]];
            [[0, width.floor() as i64 + 1], [0, height.floor() as i64 + 1]]
        }
        (Some([x0, y0, x1, y1]), _) => {
            let [west, east] = [x0, x1].map(|x| (x - anchor[0]) / cell[0]);
            let [south, north] = [y0, y1].map(|y| (y - anchor[1]) / cell[1]);
            [overlapped(west, east)?, overlapped(south, north)?]
        }
        (None, Some(bounds)) => {
            let [x, y] = lattice.span(bounds).map(|[low, high]| [low, high - low + 1]);
            [within_reach(x)?, within_reach(y)?]
        }
        (None, None) => {
            return Err(Error::bad_input(
                "the point cloud is empty, so the extent of the grid is unknown",
            )
            .remedy("check the filters, or the files with `terrane info`"));
        }
    };
    Ok((lattice, spans))
}

/// The edges that belong to a cell.
fn edge_rule(compat: Compat) -> CellEdgeRule {
    match compat {
        Compat::Lasr => CellEdgeRule::NorthClosed,
        Compat::None | Compat::Pdal => CellEdgeRule::LowerClosed,
    }
}

/// First and number of the cells between two lattice positions.
fn overlapped(low: f64, high: f64) -> Result<[i64; 2]> {
    let max_count = limits::MAX_SIDE as f64;
    let first = (low + HAIR).floor();
    let count = ((high - HAIR).ceil() - first).max(1.0);
    if count > max_count {
        return Err(Error::limit("number of columns or rows", count, max_count)
            .remedy("use larger cells, or reduce ‹extent›"));
    }
    within_reach([first as i64, count as i64])
}

/// Fails if cells are too far from the origin of the lattice to be exact.
fn within_reach([first, count]: [i64; 2]) -> Result<[i64; 2]> {
    match first.abs().saturating_add(count) < FAR {
        true => Ok([first, count]),
        false => Err(Error::usage(format!(
            "the cells are too small: the points are more than {FAR} cells from the grid origin"
        ))
        .remedy("raise ‹cell›, or pass a closer ‹align›")),
    }
}

/// The cells of another grid.
fn like_grid(
    name: &str,
    cloud: &CloudInfo,
    job: &GridJob,
) -> Result<(CellLattice, Spans, Crs, Vec<String>)> {
    let path = &*path_of(name);
    let source = raster::open(name, &raster::GridOpenOptions::default())?;
    let GridInfo { width, height, transform: t, georeferenced, .. } = *source.info();
    let upright = t.b == 0.0 && t.d == 0.0 && t.a > 0.0 && t.e < 0.0;
    if !georeferenced || !upright {
        return Err(
            Error::unsupported("‹like› requires a georeferenced, north-up grid").in_file(path)
        );
    }
    let corner = [t.x0 - 0.5 * t.a, t.y0 - 0.5 * t.e];
    let edges = edge_rule(job.compat);
    let lattice = CellLattice::new(&cloud.frame, corner, [t.a, -t.e], edges);
    let (width, height) = (i64::from(width), i64::from(height));
    let (crs, notes) = agreed(&source.info().crs, &cloud.crs).map_err(|e| e.in_file(path))?;
    Ok((lattice, [[0, width], [-height, height]], crs, notes))
}

/// The common CRS of a grid and a point cloud.
fn agreed(grid: &Crs, cloud: &Crs) -> Result<(Crs, Vec<String>)> {
    let [a, b] = grid.distinct_names(cloud);
    match (grid.is_named(), cloud.is_named()) {
        (false, false) => Ok((grid.clone(), Vec::new())),
        (true, false) => {
            let note = format!("the point cloud lacks a CRS; that of the grid is assumed, {a}");
            Ok((grid.clone(), vec![note]))
        }
        (false, true) => {
            let note = format!("the grid lacks a CRS; that of the point cloud is assumed, {b}");
            Ok((cloud.clone(), vec![note]))
        }
        // Heights are the cloud's, whatever those of the grid are.
        _ if grid.epsg.is_some() && grid.epsg == cloud.epsg || grid.agrees(cloud) => {
            Ok((cloud.clone(), Vec::new()))
        }
        _ => {
            Err(Error::usage(format!("the CRS of the grid is {a}, that of the point cloud is {b}"))
                .remedy("reproject one of them"))
        }
    }
}
