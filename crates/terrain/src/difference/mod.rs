//! Differences of two grids, with their statistics, areas and volumes, written like any other grid.
//!
//! The reference is read on the lattice of the grid: sample by sample where the lattices agree, resampled otherwise, and
//! reprojected from its CRS. Statistics are collected as samples are read, each once, and summed exactly
//! ([`terrane_base::exact_total`]), so they do not depend on threads, memory or the format of the output.

mod reference;
mod tally;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use serde::Serialize;

use crate::convert::copy::{DerivedBands, run_beside};
use crate::convert::job::{ConvertJob, ConvertReport, DerivedGridOptions, ResamplingName};
use crate::relief::NODATA;
use crate::{stored, warp};
use reference::{ReferenceFile, ReferenceOnLattice};
use tally::{DifferenceScale, DifferenceTally};
use terrane_base::error::Result;
use terrane_base::geom::{Crs, Rect};
use terrane_engine::ground_units::GroundScale;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FileName, GridInput, OperationFiles, SampleOutput};
use terrane_engine::outputs::not_member;
use terrane_files::lock;
use terrane_options::{OptionRange, Options};
use terrane_raster::{GridInfo, GridSource, Inputs, SampleType};

/// Columns and rows of a piece.
const PIECE: [u32; 2] = [512, 64];
/// Bytes of a thread: heights of both grids and their differences for a piece, sums, and what resampling takes.
const WORKER_BYTES: u64 = (PIECE[0] * PIECE[1]) as u64 * 8 * 3 + (64 << 10) + warp::WORKER_BYTES;

/// Differences of two grids, areas and volumes between them
///
/// Heights of a grid minus those of a reference, on the lattice and in the CRS of the grid; positive where the grid is
/// above the reference. Reports statistics of the differences, and areas and volumes above the reference (fill) and below
/// it (cut). Written as float32 (-9999 is nodata), or float64 if float32 does not hold the heights.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own)]
#[non_exhaustive]
pub struct DifferenceOptions {
    /// Grid to subtract. Its band 1 is read, with its own nodata value: options of reading are for the first grid
    #[option(value = "REFERENCE", with = FileName, role = ReadsGrid, positional)]
    pub reference: String,
    /// Interpolation of the reference where the lattices differ
    #[option(value = "NAME", with = ResamplingName, default = "bilinear".to_owned())]
    pub resampling: String,
    /// Minimum level of detection, in the unit of heights of the grid: smaller absolute differences are left out of areas
    /// and volumes
    #[option(value = "HEIGHT", range = OptionRange::FROM_ZERO)]
    pub level_of_detection: f64,
    /// Files of the operation to the CRS of the grid.
    #[option(flatten)]
    pub files: OperationFiles,
    /// How its samples are stored.
    #[option(flatten)]
    pub samples: SampleOutput,
    /// Input and output.
    #[option(flatten)]
    pub common: DerivedGridOptions,
}

/// Statistics of differences, in the unit of heights of the grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DifferenceReport {
    /// The written grid. Its lowest and highest heights are the differences before they were rounded to its type.
    #[serde(flatten)]
    pub common: ConvertReport,
    /// File of the reference.
    pub reference: String,
    /// Samples that both grids have.
    pub compared: u64,
    /// Samples that only the grid has.
    pub only_grid: u64,
    /// Samples that only the reference has, on the lattice of the grid.
    pub only_reference: u64,
    /// Mean of the differences; absent without any, as all statistics.
    pub mean: Option<f64>,
    /// Root of the mean square.
    pub rmse: Option<f64>,
    /// Standard deviation, of the population.
    pub stdev: Option<f64>,
    /// Mean of the absolute differences.
    pub mean_absolute: Option<f64>,
    /// Position of the lowest difference, in the CRS of the grid: the first along rows among equals.
    pub lowest_at: Option<[f64; 2]>,
    /// Position of the highest difference.
    pub highest_at: Option<[f64; 2]>,
    /// Area where the grid is above the reference, in square metres; absent if units are unknown.
    pub area_above: Option<f64>,
    /// Area where it is below, in square metres.
    pub area_below: Option<f64>,
    /// Volume between them where the grid is above the reference (fill), in cubic metres.
    pub volume_above: Option<f64>,
    /// Volume where it is below (cut), in cubic metres.
    pub volume_below: Option<f64>,
}

impl DifferenceOptions {
    /// The job that writes the differences.
    fn job(&self, inputs: &Inputs, output: &Path) -> ConvertJob {
        self.common.job(inputs, output).with(|options| options.samples = self.samples.clone())
    }
}

impl Operation for DifferenceOptions {
    const NAME: &'static str = "difference";
    type Input = GridInput;
    const WRITES: Writes = Writes::Grid;
    type Report = DifferenceReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.job(&Inputs::default(), output).options.check(output)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<DifferenceReport> {
        let RunRequest { inputs, output, progress, cancel, .. } = request;
        let job = self.job(inputs, output);
        let file = ReferenceFile::inspect(self)?;
        let (tally, nowhere) = (Arc::<Mutex<DifferenceTally>>::default(), Arc::default());
        let mut report = DifferenceReport::default();
        let mut known = None;
        let common =
            run_beside(&job, WORKER_BYTES, file.cache(), progress, cancel, |inner, cache| {
                let (info, name) = (inner.info(), inputs.to_string());
                let name = Path::new(&name);
                info.check_cells().map_err(|e| e.in_file(name))?;
                let reference = file.open(info, name, cache, Arc::clone(&nowhere))?;
                let own = GridInfo { crs: reference.crs.clone(), ..info.clone() };
                let (scale, mut notes) = self.scale(&own);
                notes.extend(reference.notes.iter().cloned());
                let about = (reference.transformed.clone(), reference.resampled);
                known = Some((info.transform, scale.clone(), about));
                let tally = Arc::clone(&tally);
                let grid = DifferenceGrid::new(inner, reference, scale, &self.samples, tally);
                not_member(&grid, output)?;
                Ok(DerivedBands::of(Box::new(grid), notes))
            })?;
        report.common = common;
        report.reference = self.reference.clone();
        report.common.notes.extend(warp::untransformable_note(nowhere.load(Ordering::Relaxed)));
        if let Some((lattice, scale, (transformed, resampled))) = known {
            lock(&tally).report(&lattice, &scale, &mut report);
            report.common.transformed = transformed;
            report.common.resampling = resampled.map(|(name, _)| name.to_owned());
            report.common.scale = resampled.map(|(_, scale)| scale);
        }
        if report.compared == 0 {
            report.common.notes.push("the grids have no sample in common".to_owned());
        }
        Ok(report)
    }
}

impl DifferenceOptions {
    /// Units of areas and heights, with notes.
    fn scale(&self, info: &GridInfo) -> (DifferenceScale, Vec<String>) {
        let (ground, notes) = match GroundScale::of(info) {
            Ok(ground) => {
                let mut notes = ground.notes();
                if info.crs.is_mercator() {
                    let note = "areas and volumes are those on the Mercator map, not on the ground";
                    notes.push(note.to_owned());
                }
                (Some(ground), notes)
            }
            Err(error) => (None, vec![format!("no areas and volumes: {}", error.message())]),
        };
        (DifferenceScale { ground, level_of_detection: self.level_of_detection }, notes)
    }
}

/// The CRS of differences: that of the grid without its vertical datum, but with its unit of heights.
fn crs_of(grid: &Crs) -> Crs {
    let flat = grid.without_heights();
    let is_metre = grid.vertical_unit.is_none() && grid.vertical_metres() == Some(1.0);
    let vertical_unit = grid.vertical_unit.clone().or(is_metre.then(|| "metre".to_owned()));
    Crs { vertical_unit, vertical_unit_text: grid.vertical_unit_text.clone(), ..flat }
}

/// A grid of differences.
struct DifferenceGrid {
    info: GridInfo,
    inner: Box<dyn GridSource>,
    reference: ReferenceOnLattice,
    scale: DifferenceScale,
    tally: Arc<Mutex<DifferenceTally>>,
}

/// Heights of a piece.
#[derive(Default)]
struct DifferenceBuffers {
    grid: Vec<f64>,
    reference: Vec<f64>,
    differences: Vec<f64>,
}

impl DifferenceGrid {
    fn new(
        inner: Box<dyn GridSource>,
        reference: ReferenceOnLattice,
        scale: DifferenceScale,
        samples: &SampleOutput,
        tally: Arc<Mutex<DifferenceTally>>,
    ) -> Self {
        let own = inner.info();
        let is_narrow = own.exact_in_f32() && reference.is_exact_in_f32;
        let own_type = if is_narrow { SampleType::F32 } else { SampleType::F64 };
        // Differences are rounded to floats, and to integers on request alone.
        let sample_type = samples.sample_type.filter(|kind| kind.is_float()).unwrap_or(own_type);
        let info = GridInfo {
            sample_type,
            nodata: samples.out_nodata.or(Some(NODATA)),
            crs: crs_of(&own.crs),
            scale: 1.0,
            offset: 0.0,
            details: Vec::new(),
            ..own.clone()
        };
        Self { info, inner, reference, scale, tally }
    }

    /// Hands on each row of a rectangle, piece by piece, with its first column and its row; adds it to the statistics.
    fn each(&self, rect: Rect, visit: &mut dyn FnMut([u32; 2], &[f64])) -> Result<()> {
        let (mut buffers, mut tally) = (DifferenceBuffers::default(), DifferenceTally::default());
        for row in (rect.row..rect.end_row()).step_by(PIECE[1] as usize) {
            for col in (rect.col..rect.end_col()).step_by(PIECE[0] as usize) {
                let piece = Rect::new(col, row, PIECE[0], PIECE[1]).intersect(&rect);
                self.subtract(piece, &mut buffers)?;
                let DifferenceBuffers { grid, reference, differences } = &mut buffers;
                tally.add(piece, [grid, reference, differences], &self.scale);
                let rows = differences.chunks_exact_mut(piece.width as usize);
                for (row, differences) in (piece.row..).zip(rows) {
                    for difference in differences.iter_mut().filter(|own| !own.is_nan()) {
                        *difference = stored::nearest_storable(&self.info, *difference);
                    }
                    visit([piece.col, row], differences);
                }
            }
        }
        self.copied(rect);
        lock(&self.tally).merge(&tally);
        Ok(())
    }

    /// Reads both grids in a piece.
    fn subtract(&self, piece: Rect, buffers: &mut DifferenceBuffers) -> Result<()> {
        let DifferenceBuffers { grid, reference, differences } = buffers;
        grid.resize(piece.len(), 0.0);
        reference.resize(piece.len(), 0.0);
        self.inner.read_f64(piece, grid)?;
        self.reference.source.read_f64(piece, reference)?;
        let factor = self.reference.factor;
        differences.clear();
        differences
            .extend(grid.iter().zip(reference.iter()).map(|(own, other)| own - other * factor));
        Ok(())
    }
}

impl GridSource for DifferenceGrid {
    fn info(&self) -> &GridInfo {
        &self.info
    }

    fn read_f32(&self, rect: Rect, out: &mut [f32]) -> Result<()> {
        self.each(rect, &mut |[col, row], values| {
            let from = (row - rect.row) as usize * rect.width as usize + (col - rect.col) as usize;
            out[from..].iter_mut().zip(values).for_each(|(out, value)| *out = *value as f32);
        })
    }

    fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
        self.each(rect, &mut |[col, row], values| {
            let from = (row - rect.row) as usize * rect.width as usize + (col - rect.col) as usize;
            out[from..].iter_mut().zip(values).for_each(|(out, value)| *out = *value);
        })
    }

    fn block_bytes(&self) -> u64 {
        self.inner.block_bytes()
    }

    fn members(&self) -> Vec<PathBuf> {
        [self.inner.members(), self.reference.members.clone()].concat()
    }

    fn release(&self, rect: Rect) {
        self.inner.release(rect);
        self.reference.source.release(rect);
    }

    fn copied(&self, rect: Rect) {
        self.inner.copied(rect);
        self.reference.source.copied(rect);
    }
}
