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

mod feather;
mod layers;
mod mapping;
pub(crate) mod output_grid;
mod source;

use std::cell::RefCell;
use std::path::Path;
use std::slice;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::convert::copy::{DerivedBands, ReservedMemory, run_opened};
use crate::convert::job::{ConvertJob, ConvertOptions, ConvertReport};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{Crs, VerticalReference};
use terrane_crs::CoordinateOperation;
use terrane_engine::options::OperationFiles;
use terrane_engine::transform::{Transformed, extent_of};
use terrane_engine::{Cancel, Progress};
use terrane_raster::{
    self as raster, GridInfo, GridOpenOptions, GridSource, MosaicLayer, SampleType,
};
use terrane_window::resample::{ResamplingMethod, Scale};

use feather::Feather;
pub use layers::LayerPriority;
use layers::{WarpedLayer, WarpedLayers};
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
    nowhere: Arc<AtomicU64>,
}

/// What a report tells of the resampling.
#[derive(Default)]
struct WarpFacts {
    transformed: Option<Transformed>,
    /// Columns and rows of a single grid per cell of the output.
    scale: Option<[f64; 2]>,
    notes: Vec<String>,
}

/// A grid, or files on one lattice, with its operation to the CRS of the output.
struct WarpInput {
    name: String,
    grid: Box<dyn GridSource>,
    operation: Option<CoordinateOperation>,
}

/// Most layers that are named in a note.
const MAX_NAMED: usize = 8;

/// Writes a grid on another lattice. By default samples have the type of the grid if heights are not changed,
/// and otherwise float32, or float64 if float32 does not hold the heights of the grid. Files that differ in lattice or
/// CRS are resampled one by one, and laid on top of each other.
///
/// # Errors
/// Those of [`crate::convert::run`]; CRS without a known operation between them; a lattice that is empty, too
/// large, far from the grid, or in another CRS; cells of the grid that cannot be transformed, if no extent is
/// given; heights outside of a geoid model; output cells that cover too many samples of the grid; files whose heights
/// differ in unit or vertical CRS.
pub(crate) fn run(
    copy: &ConvertJob,
    resampling: &'static ResamplingMethod,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ConvertReport> {
    let job = WarpJob { copy, resampling, nowhere: Arc::default() };
    let facts = RefCell::default();
    let open = |options: &GridOpenOptions| {
        let (grid, own) = job.open(options)?;
        facts.replace(own);
        Ok(grid)
    };
    let feather = Feather(copy.options.feather);
    let bytes = layers::worker_bytes(feather);
    let bands = layers::bands_bytes(feather, copy.options.resources.memory);
    let (reserved, watch) = (ReservedMemory { wanted: bands, least: bands }, (progress, cancel));
    let report = run_opened(copy, &open, bytes, reserved, watch, |warped, _| {
        Ok(DerivedBands::of(warped, Vec::new()))
    })?;
    let WarpFacts { transformed, scale, mut notes } = facts.into_inner();
    let more = untransformable_note(job.nowhere.load(Ordering::Relaxed));
    for note in report.notes.iter().cloned().chain(more) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    let scale = scale.filter(|_| resampling.radius > 0);
    let resampling = Some(resampling.name.to_owned());
    Ok(ConvertReport { transformed, resampling, scale, notes, ..report })
}

impl WarpJob<'_> {
    /// Opens the grid on its new lattice.
    fn open(&self, options: &GridOpenOptions) -> Result<(Box<dyn GridSource>, WarpFacts)> {
        let names = self.copy.input.names();
        let is_single = raster::files(names)?.len() == 1;
        if is_single {
            self.check_change()?;
        }
        let layers = match raster::open_all(names, options) {
            Ok(grid) => return self.warp_one(grid),
            // Perhaps files that disagree.
            Err(error)
                if error.kind() == ErrorKind::BadInput && raster::files(names)?.len() > 1 =>
            {
                let layers = raster::open_layers(names, options)?;
                if layers.len() > 1 { layers } else { return Err(error) }
            }
            Err(error) => return Err(error),
        };
        refuse_parts(options)?;
        self.warp_layers(layers)
    }

    /// Fails if an option would change nothing of a single file.
    fn check_change(&self) -> Result<()> {
        let ConvertOptions { lattice, reprojection, priority, feather, .. } = &self.copy.options;
        let of_several =
            [("‹priority›", *priority != LayerPriority::default()), ("‹feather›", *feather > 0)];
        if let Some((name, _)) = of_several.iter().find(|(_, is_given)| *is_given) {
            return Err(Error::usage(format!("{name} has no effect on a single file"))
                .remedy(format!("leave {name} out, or pass several files")));
        }
        if *lattice != LatticeOptions::default() || reprojection.to_crs.is_some() {
            return Ok(());
        }
        Err(Error::usage("‹resampling› has no effect: the output has the lattice of the input")
            .remedy("add ‹to_crs›, ‹resolution›, ‹extent› or ‹like›, or leave ‹resampling› out"))
    }

    fn warp_one(&self, grid: Box<dyn GridSource>) -> Result<(Box<dyn GridSource>, WarpFacts)> {
        grid.info().check_cells()?;
        let name = self.copy.input.to_string();
        let operation = self.operation(&name, grid.info())?;
        let input = WarpInput { name, grid, operation };
        let facts = input.facts();
        let lattice = self.lattice(slice::from_ref(&input))?;
        let is_made = self.is_made(&input);
        let info = on(&lattice, input.grid.info(), input.crs());
        let info = if is_made { made(info) } else { info };
        let warped = self.warped(input, &info, is_made, self.nowhere.clone())?;
        let scale = Some(warped.scale().get());
        Ok((Box::new(warped), WarpFacts { scale, ..facts }))
    }

    /// Layers from bottom to top.
    fn warp_layers(&self, layers: Vec<MosaicLayer>) -> Result<(Box<dyn GridSource>, WarpFacts)> {
        let mut inputs = self.in_one_crs(layers)?;
        if self.copy.options.priority == LayerPriority::Resolution {
            // Coarse cells first; the order of equals stays.
            let sizes = inputs.iter().map(|input| input.cell_area());
            let mut sized: Vec<_> =
                sizes.collect::<Result<Vec<_>>>()?.into_iter().zip(inputs).collect();
            sized.sort_by(|a, b| b.0.total_cmp(&a.0));
            inputs = sized.into_iter().map(|(_, input)| input).collect();
        }
        let mut facts = WarpFacts { notes: vec![stack_note(&inputs)], ..WarpFacts::default() };
        for own in inputs.iter().map(WarpInput::facts) {
            facts.transformed = facts.transformed.or(own.transformed);
            facts.notes.extend(own.notes);
        }
        let lattice = self.lattice(&inputs)?;
        let infos = || inputs.iter().map(|input| input.grid.info());
        let first = inputs[0].grid.info();
        let is_alike = infos().all(|info| {
            let parts = |info: &GridInfo| (info.sample_type, info.nodata, info.scale, info.offset);
            parts(info) == parts(first)
        });
        let feather = Feather(self.copy.options.feather);
        let memory = self.copy.options.resources.memory;
        let is_made = !is_alike || feather.0 > 0 || inputs.iter().any(|input| self.is_made(input));
        let mut info = on(&lattice, first, inputs[0].crs());
        if is_made {
            let is_narrow = infos().all(GridInfo::exact_in_f32);
            let sample_type = if is_narrow { SampleType::F32 } else { SampleType::F64 };
            let nodata = raster::common_nodata(infos().map(|info| info.nodata), sample_type);
            info = GridInfo { sample_type, nodata, scale: 1.0, offset: 0.0, ..info };
        }
        let layers = inputs.into_iter().map(|input| {
            let transform = CrsTransform::new(input.operation.clone());
            let extent = output_grid::surely_around(input.grid.info(), &transform);
            // A position that is nowhere in one grid may be in another.
            let grid = self.warped(input, &info, is_made, Arc::default())?;
            Ok(WarpedLayer { grid, extent })
        });
        let layers = layers.collect::<Result<Vec<_>>>()?;
        Ok((Box::new(WarpedLayers::new(info, layers, feather, memory)), facts))
    }

    /// The operation to the target CRS, if there is one.
    fn operation(&self, name: &str, info: &GridInfo) -> Result<Option<CoordinateOperation>> {
        let options = &self.copy.options;
        let Some(transform) = options.reprojection.transform() else { return Ok(None) };
        let (extent, resources) = (Some(extent_of(info)), &options.resources);
        transform.operation(Path::new(name), &info.crs, extent, resources).map(Some)
    }

    /// Layers with their operations to the target CRS, or else to that of the first.
    ///
    /// # Errors
    /// CRSs without an operation; heights that differ in unit or vertical CRS.
    fn in_one_crs(&self, layers: Vec<MosaicLayer>) -> Result<Vec<WarpInput>> {
        let resources = &self.copy.options.resources;
        let mut inputs: Vec<WarpInput> = Vec::with_capacity(layers.len());
        for MosaicLayer { name, grid } in layers {
            let info = grid.info();
            info.check_cells().map_err(|e| e.in_file(Path::new(&name)))?;
            let operation = match inputs.first() {
                None => self.operation(&name, info)?,
                Some(_) if self.copy.options.reprojection.to_crs.is_some() => {
                    self.operation(&name, info)?
                }
                Some(first) if first.crs().agrees(&info.crs) => None,
                Some(first) => {
                    let has_heights = info.crs.heights() != VerticalReference::Unknown;
                    let target = first.crs();
                    let target =
                        if has_heights { target.clone() } else { target.without_heights() };
                    let (path, extent) = (Path::new(&name), Some(extent_of(info)));
                    let files = OperationFiles::default();
                    let operation = files.operation(&target, path, &info.crs, extent, resources);
                    Some(operation.map_err(|e| e.in_file(path))?)
                }
            };
            let input = WarpInput { name, grid, operation };
            if let Some(first) = inputs.first() {
                first.check_heights(&input)?;
            }
            inputs.push(input);
        }
        Ok(inputs)
    }

    fn lattice(&self, inputs: &[WarpInput]) -> Result<TargetGrid> {
        let transforms = inputs.iter().map(|input| CrsTransform::new(input.operation.clone()));
        let transforms: Vec<CrsTransform> = transforms.collect();
        let grids = inputs.iter().map(|input| input.grid.info()).zip(&transforms);
        output_grid::of(&self.copy.options.lattice, &grids.collect::<Vec<_>>(), inputs[0].crs())
    }

    /// True if heights are computed.
    fn is_made(&self, input: &WarpInput) -> bool {
        let keeps = input.operation.as_ref().is_none_or(CoordinateOperation::keeps_heights);
        self.resampling.radius > 0 || !keeps
    }

    fn warped(
        &self,
        input: WarpInput,
        info: &GridInfo,
        is_made: bool,
        nowhere: Arc<AtomicU64>,
    ) -> Result<WarpedGrid> {
        let transform = CrsTransform::new(input.operation);
        let scale = output_grid::scale(&TargetGrid::of(info), input.grid.info(), &transform)?;
        let (info, scale) = (info.clone(), Scale::new(scale));
        check_reach(self.resampling, scale).map_err(|e| {
            e.remedy("pass a finer ‹resolution› or ‹resampling› near, or downsample in two steps")
        })?;
        Ok(WarpedGrid::new(info, input.grid, transform, self.resampling, scale, is_made, nowhere))
    }
}

impl WarpInput {
    /// The CRS of the output.
    fn crs(&self) -> &Crs {
        self.operation.as_ref().map_or(&self.grid.info().crs, CoordinateOperation::target)
    }

    fn facts(&self) -> WarpFacts {
        let mut notes = raster::cautions(self.grid.info());
        notes.extend(self.operation.iter().flat_map(|own| own.notes().iter().cloned()));
        let transformed = self.operation.as_ref().map(Transformed::of);
        WarpFacts { transformed, scale: None, notes }
    }

    /// Area of a cell at the centre of the grid, in the CRS of the output.
    fn cell_area(&self) -> Result<f64> {
        let transform = CrsTransform::new(self.operation.clone());
        let [width, height] = output_grid::natural(self.grid.info(), &transform)
            .map_err(|e| e.in_file(Path::new(&self.name)))?;
        Ok(width * height)
    }

    /// Fails if heights of another grid mean something else.
    fn check_heights(&self, other: &Self) -> Result<()> {
        let [own, theirs] = [self, other].map(Self::crs);
        let units = [own, theirs].map(Crs::heights_unit);
        let is_alike = match (units, [own, theirs].map(Crs::vertical_metres)) {
            ([Some(_), Some(_)], [Some(own), Some(theirs)]) => own == theirs,
            ([Some(own), Some(theirs)], _) => own == theirs,
            _ => true,
        };
        if is_alike && own.agrees(theirs) {
            return Ok(());
        }
        let first = &self.name;
        let message = match units {
            [Some(own), Some(theirs)] if !is_alike => {
                format!("heights are in {theirs}, those of {first} in {own}")
            }
            _ => {
                let [own, theirs] = own.distinct_names(theirs);
                format!("the heights belong to {theirs}, those of {first} to {own}")
            }
        };
        Err(Error::bad_input(message)
            .in_file(Path::new(&other.name))
            .remedy("name the vertical CRS of the output in ‹to_crs›, or convert one file first"))
    }
}

/// The lattice of the output with the properties of a grid.
fn on(lattice: &TargetGrid, grid: &GridInfo, crs: &Crs) -> GridInfo {
    let TargetGrid { transform, width, height } = *lattice;
    let crs = crs.clone();
    GridInfo {
        transform,
        width,
        height,
        crs,
        block: source::BLOCK,
        details: Vec::new(),
        ..grid.clone()
    }
}

/// Fails if a part of the grid is asked for: files that disagree have no common cells to cut at.
fn refuse_parts(options: &GridOpenOptions) -> Result<()> {
    let refuse = |name: &str, remedy: &str| {
        let message = format!("{name} cannot be used with files that differ in lattice or CRS");
        Err(Error::usage(message).remedy(remedy.to_owned()))
    };
    match (&options.bbox, &options.clip, &options.water) {
        (Some(_), ..) => refuse("‹bounds›", "pass ‹extent›"),
        (_, Some(_), _) => refuse("‹clip›", "merge the files first, then clip them"),
        (.., Some(_)) => refuse("‹water›", "merge the files first, then flatten the water"),
        _ => Ok(()),
    }
}

/// The note on the order of layers.
fn stack_note(inputs: &[WarpInput]) -> String {
    let names = inputs.iter().take(MAX_NAMED).map(|input| input.name.as_str());
    let names = names.collect::<Vec<_>>().join(", ");
    let more = inputs.len().saturating_sub(MAX_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let count = inputs.len();
    format!("files on {count} lattices, from bottom to top those of {names}{more}")
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
