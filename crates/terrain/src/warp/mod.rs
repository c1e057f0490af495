//! Warps grids to another lattice: another CRS, resolution, rotation or extent. The result is written like any
//! other grid: any size, format and number of threads, with the same bytes.
//!
//! Each sample of the output is transformed to the grid by the exact operation, not by an approximation, and
//! its height is interpolated there ([`terrane_window::resample`]). A sample that cannot be transformed, or
//! lies beyond the cells of the grid, is void. A change of the vertical CRS is applied to the interpolated
//! heights.
//!
//! **Memory.** A thread holds the positions of a piece of the output and the samples they need, both bounded: a
//! piece that needs more is halved.

mod mapping;
pub(crate) mod output_grid;
mod source;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::convert::copy::{DerivedBands, run_of};
use crate::convert::job::{ConvertJob, ConvertReport};
use terrane_base::error::{Error, Result};
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::{Transformed, extent_of};
use terrane_engine::{Cancel, Progress};
use terrane_raster::{GridInfo, GridSource, SampleType};
use terrane_window::resample::{ResamplingMethod, Scale};

use mapping::CrsTransform;
pub use output_grid::{LatticeOptions, LatticeSetters};
use output_grid::{TargetGrid, WarpedExtent};
use source::WarpedGrid;

/// Bytes that a thread holds to read a grid on another lattice.
pub(crate) const WORKER_BYTES: u64 = source::WORKER_BYTES;

/// A grid to be written on another lattice.
struct WarpJob<'a> {
    copy: &'a ConvertJob,
    /// Resampling method.
    resampling: &'static ResamplingMethod,
}

/// Writes a grid on another lattice. By default samples have the type of the grid if heights are not changed,
/// and otherwise float32, or float64 if float32 does not hold the heights of the grid.
///
/// # Errors
/// Those of [`crate::convert::run`]; CRS without a known operation between them; a lattice that is empty, too
/// large, far from the grid, or in another CRS; cells of the grid that cannot be transformed, if no extent is
/// given; heights outside of a geoid model; output cells that cover too many samples of the grid.
pub(crate) fn run(
    copy: &ConvertJob,
    resampling: &'static ResamplingMethod,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let job = WarpJob { copy, resampling };
    let (mut about, nowhere) = (None, Arc::new(AtomicU64::new(0)));
    let report = run_of(copy, source::WORKER_BYTES, progress, cancel, |inner| {
        inner.info().check_cells()?;
        let operation = job.operation(inner.info())?;
        let notes = operation.iter().flat_map(|own| own.notes().iter().cloned()).collect();
        let transformed = operation.as_ref().map(Transformed::of);
        let warped = job.warped(inner, operation, nowhere.clone())?;
        about = Some((transformed, warped.scale()));
        Ok(DerivedBands::of(Box::new(warped), notes))
    })?;
    let (transformed, scale) = about.unwrap_or((None, Scale::ONE));
    let mut notes = report.notes.clone();
    notes.extend(untransformable_note(nowhere.load(Ordering::Relaxed)));
    let resampling = Some(job.resampling.name.to_owned());
    let scale = (job.resampling.radius > 0).then_some(scale.get());
    Ok(ConvertReport { transformed, resampling, scale, notes, ..report })
}

impl WarpJob<'_> {
    /// The operation to the target CRS, if there is one.
    fn operation(&self, info: &GridInfo) -> Result<Option<CoordinateOperation>> {
        let options = &self.copy.options;
        let Some(transform) = options.reprojection.transform() else { return Ok(None) };
        let (input, extent) = (self.copy.input.to_string(), Some(extent_of(info)));
        let (input, crs) = (Path::new(&input), &info.crs);
        transform.operation(input, crs, extent, &options.resources).map(Some)
    }

    fn warped(
        &self,
        inner: Box<dyn GridSource>,
        operation: Option<CoordinateOperation>,
        nowhere: Arc<AtomicU64>,
    ) -> Result<WarpedGrid> {
        let input = inner.info();
        let crs = operation.as_ref().map_or(&input.crs, CoordinateOperation::target).clone();
        let transform = CrsTransform::new(operation);
        let lattice = output_grid::of(&self.copy.options.lattice, input, &crs, &transform)?;
        let is_made = self.resampling.radius > 0 || !transform.keeps_heights();
        let info = GridInfo {
            width: lattice.width,
            height: lattice.height,
            transform: lattice.transform,
            crs,
            block: source::BLOCK,
            details: Vec::new(),
            ..input.clone()
        };
        let info = if is_made { made(info) } else { info };
        let scale = Scale::new(output_grid::scale(&lattice, input, &transform)?);
        check_reach(self.resampling, scale).map_err(|e| {
            e.remedy("pass a finer ‹resolution› or ‹resampling› near, or downsample in two steps")
        })?;
        Ok(WarpedGrid::new(info, inner, transform, self.resampling, scale, is_made, nowhere))
    }
}

/// Fails if a height depends on more samples than a thread may hold.
fn check_reach(resampling: &ResamplingMethod, scale: Scale) -> Result<()> {
    let [cols, rows] = resampling.reach(scale).map(|reach| 2.0 * reach);
    if cols * rows <= source::MAX_SAMPLES as f64 {
        return Ok(());
    }
    let name = resampling.name;
    let message = format!(
        "{name} resampling would average {cols} x {rows} input samples for each output sample"
    );
    Err(Error::unsupported(message))
}

/// The note on samples that cannot be transformed.
pub(crate) fn untransformable_note(nowhere: u64) -> Option<String> {
    let verb = if nowhere == 1 { "sample is" } else { "samples are" };
    (nowhere > 0).then(|| {
        format!("{nowhere} {verb} set to nodata: their positions cannot be transformed to the CRS of the grid")
    })
}

/// How a grid is read on the lattice of another.
pub(crate) struct LatticeChange {
    /// From the CRS of the grid to that of the lattice.
    pub(crate) operation: Option<CoordinateOperation>,
    pub(crate) resampling: &'static ResamplingMethod,
    /// Counts samples of the lattice that have no position in the CRS of the grid.
    pub(crate) nowhere: Arc<AtomicU64>,
}

/// A grid on the lattice and in the CRS of `info`, in double precision; with its columns and rows per cell of the lattice.
///
/// # Errors
/// Cells of the lattice that cover too many samples of the grid; a grid whose centre has no position there.
pub(crate) fn on_lattice(
    inner: Box<dyn GridSource>,
    info: &GridInfo,
    change: LatticeChange,
) -> Result<(Box<dyn GridSource>, [f64; 2])> {
    let LatticeChange { operation, resampling, nowhere } = change;
    let transform = CrsTransform::new(operation);
    let scale = Scale::new(output_grid::scale(&TargetGrid::of(info), inner.info(), &transform)?);
    check_reach(resampling, scale)
        .map_err(|e| e.remedy("pass ‹resampling› near, or downsample that grid first"))?;
    let info = GridInfo {
        sample_type: SampleType::F64,
        scale: 1.0,
        offset: 0.0,
        block: source::BLOCK,
        details: Vec::new(),
        ..info.clone()
    };
    let grid = WarpedGrid::new(info, inner, transform, resampling, scale, true, nowhere);
    Ok((Box::new(grid), scale.get()))
}

/// The rectangles around the cells of a lattice and of a grid, in the CRS of the lattice, if they certainly do not
/// intersect.
pub(crate) fn disjoint_extents(
    grid: &GridInfo,
    lattice: &GridInfo,
    operation: Option<&CoordinateOperation>,
) -> Option<[[f64; 4]; 2]> {
    let extent = TargetGrid::of(lattice).extent();
    let outline = WarpedExtent::of(grid, &CrsTransform::new(operation.cloned()));
    outline.apart_from(extent).map(|other| [extent, other])
}

/// A grid of heights that were computed.
fn made(info: GridInfo) -> GridInfo {
    let sample_type = if info.exact_in_f32() { SampleType::F32 } else { SampleType::F64 };
    GridInfo { sample_type, scale: 1.0, offset: 0.0, ..info }
}
