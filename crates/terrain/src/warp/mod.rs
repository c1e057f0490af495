//! Grids on another lattice: in another reference system, closer or wider, turned or cut. A grid in front of the one that
//! is read, which is copied as any other; so it has any size, format and number of threads, and the same bytes.
//!
//! Each sample of the output is taken back to the grid by the operation itself, not by an approximation of it, and its
//! height is found there ([`terrane_window::resample`]). A sample that has no place in the grid's system, or beyond its cells,
//! is void. Where the operation changes heights, it does so once they are found.
//!
//! **Memory.** A thread holds the places of a piece of the output and what they need of the grid, both bounded: where a
//! piece needs more, it is halved.

pub(crate) mod lattice;
mod source;
mod way;

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

pub use lattice::{LatticeOptions, LatticeSetters};
use source::WarpedGrid;
use way::CrsTransform;

/// A grid to be written on another lattice.
struct WarpJob<'a> {
    copy: &'a ConvertJob,
    /// How heights are found between samples of the grid.
    resampling: &'static ResamplingMethod,
}

/// Writes a grid on another lattice. Unless told otherwise, samples are of the grid's type where heights stay what they
/// are, and else of single precision, or of double where the grid has heights that single precision does not hold.
///
/// # Errors
/// Those of [`crate::convert::run`]; systems between which no operation is known; a lattice without a sample, with too many,
/// far from the grid, or in another system; cells of the grid without a place in the system to write in, where it is
/// not told which part of that is wanted; heights of which a geoid knows nothing; samples of the output that stand for
/// too many of the grid.
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
    notes.extend(job.lost(nowhere.load(Ordering::Relaxed)));
    let resampling = Some(job.resampling.name.to_owned());
    let scale = (job.resampling.radius > 0).then_some(scale.get());
    Ok(ConvertReport { transformed, resampling, scale, notes, ..report })
}

impl WarpJob<'_> {
    /// What leads to the system to write in.
    fn operation(&self, info: &GridInfo) -> Result<Option<CoordinateOperation>> {
        let options = &self.copy.options;
        let Some(transform) = options.reprojection.transform() else { return Ok(None) };
        let (input, extent) = (self.copy.input.to_string(), Some(extent_of(info)));
        let source = (Path::new(&input), &info.crs);
        transform.operation(source, extent, &options.resources).map(Some)
    }

    fn warped(
        &self,
        inner: Box<dyn GridSource>,
        operation: Option<CoordinateOperation>,
        nowhere: Arc<AtomicU64>,
    ) -> Result<WarpedGrid> {
        let own = inner.info();
        let crs = operation.as_ref().map_or(&own.crs, CoordinateOperation::target).clone();
        let way = CrsTransform::new(operation);
        let lattice = lattice::of(&self.copy.options.lattice, own, &crs, &way)?;
        let is_made = self.resampling.radius > 0 || !way.keeps_heights();
        let info = GridInfo {
            width: lattice.width,
            height: lattice.height,
            transform: lattice.transform,
            crs,
            block: source::BLOCK,
            details: Vec::new(),
            ..own.clone()
        };
        let info = if is_made { made(info) } else { info };
        let scale = Scale::new(lattice::scale(&lattice, own, &way)?);
        self.check_reach(scale)?;
        Ok(WarpedGrid::new(info, inner, way, self.resampling, scale, is_made, nowhere))
    }

    /// Fails where a height depends on more samples than are held.
    fn check_reach(&self, scale: Scale) -> Result<()> {
        let [cols, rows] = self.resampling.reach(scale).map(|reach| 2.0 * reach);
        if cols * rows <= source::MOST_SAMPLES as f64 {
            return Ok(());
        }
        let name = self.resampling.name;
        let message = format!(
            "{name} resampling would average {cols} x {rows} input samples for each output sample"
        );
        Err(Error::unsupported(message)
            .remedy("pass a finer ‹resolution› or ‹resampling› near, or downsample in two steps"))
    }

    /// What is said of samples without a place.
    fn lost(&self, nowhere: u64) -> Option<String> {
        let verb = if nowhere == 1 { "sample is" } else { "samples are" };
        (nowhere > 0)
            .then(|| format!("{nowhere} {verb} set to nodata: their positions cannot be transformed to the CRS of the grid"))
    }
}

/// A grid of heights that were computed.
fn made(info: GridInfo) -> GridInfo {
    let sample_type = if info.exact_in_f32() { SampleType::F32 } else { SampleType::F64 };
    GridInfo { sample_type, scale: 1.0, offset: 0.0, ..info }
}
