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
mod near;
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
use layers::WarpedLayers;
use mapping::CrsTransform;
pub use output_grid::{LatticeOptions, LatticeSetters};
use output_grid::{LatticeSource, TargetGrid, WarpedExtent};
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
    let WarpFacts { transformed, scale, notes: of_inputs } = facts.into_inner();
    let more = untransformable_note(job.nowhere.load(Ordering::Relaxed));
    let mut notes = Vec::new();
    for note in of_inputs.into_iter().chain(report.notes.iter().cloned()).chain(more) {
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
            Ok(grid) if is_single || self.has_lattice() => return self.warp_one(grid),
            Ok(grid) => {
                let notes = vec!["the files agree: nothing is resampled".to_owned()];
                return Ok((grid, WarpFacts { notes, ..WarpFacts::default() }));
            }
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

    /// True if a lattice or CRS of the output is asked for.
    fn has_lattice(&self) -> bool {
        let ConvertOptions { lattice, reprojection, .. } = &self.copy.options;
        *lattice != LatticeOptions::default() || reprojection.to_crs.is_some()
    }

    /// Fails if an option would change nothing of a single file.
    fn check_change(&self) -> Result<()> {
        let ConvertOptions { priority, feather, .. } = &self.copy.options;
        let of_several =
            [("‹priority›", *priority != LayerPriority::default()), ("‹feather›", *feather > 0)];
        if let Some((name, _)) = of_several.iter().find(|(_, is_given)| *is_given) {
            return Err(Error::usage(format!("{name} has no effect on a single file"))
                .remedy(format!("leave {name} out, or pass several files")));
        }
        if self.has_lattice() {
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
        let warped =
            self.warped(input, &info, is_made, self.nowhere.clone(), output_grid::scale)?;
        let scale = Some(warped.scale().get());
        Ok((Box::new(warped), WarpFacts { scale, ..facts }))
    }

    /// Layers from bottom to top.
    fn warp_layers(&self, layers: Vec<MosaicLayer>) -> Result<(Box<dyn GridSource>, WarpFacts)> {
        let (mut inputs, crs) = self.in_one_crs(layers)?;
        if self.copy.options.priority == LayerPriority::Resolution {
            // Coarse cells first; the order of equals stays.
            let sizes = inputs.iter().map(|input| input.cell_area()).collect::<Result<Vec<_>>>()?;
            let mut sized: Vec<_> = sizes.into_iter().zip(inputs).collect();
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
        let feather = Feather(self.copy.options.feather);
        let (is_made, sample_type) = {
            let scales = infos().map(|info| (info.scale, info.offset));
            let is_made = feather.0 > 0
                || scales.into_iter().any(|scale| scale != (first.scale, first.offset))
                || inputs.iter().any(|input| self.is_made(input));
            let is_narrow = infos().all(GridInfo::exact_in_f32);
            let types = infos().map(|info| info.sample_type);
            match is_made {
                true => (true, if is_narrow { SampleType::F32 } else { SampleType::F64 }),
                false => (false, types.fold(first.sample_type, raster::wider_type)),
            }
        };
        let nodata = raster::common_nodata(infos().map(|info| info.nodata), sample_type);
        let mut info = GridInfo { sample_type, nodata, ..on(&lattice, first, &crs) };
        if is_made {
            (info.scale, info.offset) = (1.0, 0.0);
        }
        let layers = inputs.into_iter().map(|input| {
            // A position that is nowhere in one grid may be in another.
            let (name, nowhere) = (input.name.clone(), Arc::default());
            let scale = output_grid::scale_inside;
            self.warped(input, &info, is_made, nowhere, scale)
                .map_err(|e| e.in_file(Path::new(&name)))
        });
        let layers = layers.collect::<Result<Vec<_>>>()?;
        let memory = self.copy.options.resources.memory;
        Ok((Box::new(WarpedLayers::new(info, layers, feather, memory)), facts))
    }

    /// The operation to the target CRS, if there is one.
    fn operation(&self, name: &str, info: &GridInfo) -> Result<Option<CoordinateOperation>> {
        let options = &self.copy.options;
        let Some(transform) = options.reprojection.transform() else { return Ok(None) };
        let (extent, resources) = (Some(extent_of(info)), &options.resources);
        transform.operation(Path::new(name), &info.crs, extent, resources).map(Some)
    }

    /// Layers with their operations to the target CRS, or else to that of the first; with that CRS and what is stated of
    /// heights.
    ///
    /// # Errors
    /// CRSs without an operation; heights that differ in unit or vertical CRS.
    fn in_one_crs(&self, layers: Vec<MosaicLayer>) -> Result<(Vec<WarpInput>, Crs)> {
        let resources = &self.copy.options.resources;
        let mut inputs: Vec<WarpInput> = Vec::with_capacity(layers.len());
        // The CRS of the output, and the file that states its heights.
        let mut common: Option<(Crs, String)> = None;
        for MosaicLayer { name, grid } in layers {
            let (info, path) = (grid.info(), Path::new(&name));
            let operation = || match &common {
                Some((target, _)) if self.copy.options.reprojection.to_crs.is_none() => {
                    if target.agrees(&info.crs) {
                        return Ok(None);
                    }
                    let is_named = [target.is_named(), info.crs.is_named()];
                    if is_named != [true; 2] {
                        return Err(without_crs(is_named[0], &inputs[0].name, &name));
                    }
                    let has_heights = info.crs.heights() != VerticalReference::Unknown;
                    let target =
                        if has_heights { target.clone() } else { target.without_heights() };
                    let (extent, files) = (Some(extent_of(info)), OperationFiles::default());
                    files.operation(&target, path, &info.crs, extent, resources).map(Some)
                }
                _ => self.operation(&name, info),
            };
            let operation = info.check_cells().and_then(|()| operation());
            let operation = operation.map_err(|error| match error.path() {
                None => error.in_file(path),
                Some(_) => error,
            })?;
            let input = WarpInput { name: name.clone(), grid, operation };
            common = Some(match common {
                None => (input.crs().clone(), name),
                Some((crs, first)) => {
                    check_heights(&crs, &first, &input)?;
                    match completed(&crs, input.crs()) {
                        Some(crs) => (crs, name),
                        None => (crs, first),
                    }
                }
            });
            inputs.push(input);
        }
        let (crs, _) = common.unwrap_or_default();
        Ok((inputs, crs))
    }

    fn lattice(&self, inputs: &[WarpInput]) -> Result<TargetGrid> {
        let transforms = inputs.iter().map(|input| CrsTransform::new(input.operation.clone()));
        let transforms: Vec<CrsTransform> = transforms.collect();
        let is_one = inputs.len() == 1;
        let grids = inputs.iter().zip(&transforms).map(|(input, transform)| LatticeSource {
            name: (!is_one).then(|| Path::new(&input.name)),
            info: input.grid.info(),
            transform,
        });
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
        scale: impl Fn(&TargetGrid, &GridInfo, &CrsTransform) -> Result<[f64; 2]>,
    ) -> Result<WarpedGrid> {
        let transform = CrsTransform::new(input.operation);
        let scale = scale(&TargetGrid::of(info), input.grid.info(), &transform)?;
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
}

/// Fails if the heights of a grid mean something else than those of the output, as a file states them.
fn check_heights(crs: &Crs, first: &str, input: &WarpInput) -> Result<()> {
    let both = [crs, input.crs()];
    let units = both.map(Crs::heights_unit);
    let is_alike = match (units, both.map(Crs::vertical_metres)) {
        ([Some(_), Some(_)], [Some(own), Some(theirs)]) => own == theirs,
        ([Some(own), Some(theirs)], _) => own == theirs,
        _ => true,
    };
    let error = |what: String| Err(Error::bad_input(what).in_file(Path::new(&input.name)));
    match units {
        [Some(own), Some(theirs)] if !is_alike => {
            let what = format!("heights are in {theirs}, those of {first} in {own}");
            error(what).map_err(|error| {
                error.remedy("convert the heights of one file first: gdal_calc.py -A IN --calc=A*0.3048 --outfile=OUT")
            })
        }
        _ if !crs.agrees(input.crs()) => {
            let [own, theirs] = crs.distinct_names(input.crs());
            error(format!("the heights belong to {theirs}, those of {first} to {own}")).map_err(|error| {
                error.remedy("convert the heights of one file first, with ‹terrane convert›, ‹to_crs› and ‹geoid›")
            })
        }
        _ => Ok(()),
    }
}

/// A CRS with the heights of another that agrees with it, if these are stated and its own are not.
fn completed(crs: &Crs, other: &Crs) -> Option<Crs> {
    let is_unknown = |crs: &Crs| crs.heights() == VerticalReference::Unknown;
    let has_more =
        !is_unknown(other) || crs.heights_unit().is_none() && other.heights_unit().is_some();
    (is_unknown(crs) && has_more).then(|| crs.with_heights_of(other))
}

/// The error of a file without a CRS: the other, if `has_first`.
fn without_crs(has_first: bool, first: &str, other: &str) -> Error {
    let [name, known] = if has_first { [other, first] } else { [first, other] };
    Error::bad_input(format!("CRS is missing, which {known} has"))
        .in_file(Path::new(name))
        .remedy(format!("declare it: gdal_edit.py -a_srs EPSG:CODE {name}"))
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
    format!(
        "{count} grids of the files are resampled, from bottom to top, by their first files: {names}{more}"
    )
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
    let outline = WarpedExtent::around(grid, &CrsTransform::new(operation.cloned()));
    outline.apart_from(extent).map(|other| [extent, other])
}

/// A grid of heights that were computed.
fn made(info: GridInfo) -> GridInfo {
    let sample_type = if info.exact_in_f32() { SampleType::F32 } else { SampleType::F64 };
    GridInfo { sample_type, scale: 1.0, offset: 0.0, ..info }
}
