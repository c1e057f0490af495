//! A grid-to-grid job: its options and its report.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::colours::ColorReliefOptions;
use crate::difference::DifferenceOptions;
use crate::fill::FillOptions;
use crate::relief::{
    AspectOptions, CurvatureOptions, DerivativeOptions, HillshadeOptions, RoughnessOptions,
    SlopeOptions, TpiOptions, TriOptions,
};
use crate::warp::LayerPriority;
use crate::warp::output_grid::LatticeOptions;
use terrane_base::error::Result;
use terrane_base::registry;
use terrane_engine::Resources;
use terrane_engine::options::{FileOutput, GridInput, GridOutput, Reprojection, SampleOutput};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;
use terrane_files::{beside_grid, path_of};
use terrane_options::{
    ChoiceName, Json, OptionCodec, OptionKind, OptionRange, OptionRule, Options,
};
use terrane_raster::write::{self, GridFormat, GridWriteOptions};
use terrane_raster::{self as raster, GridSource, Inputs, WaterReport};
use terrane_window::resample::RESAMPLINGS;

/// Convert a grid, or a part of it, to another format
///
/// A .tif is a plain GeoTIFF unless the format is COG or store (an uncompressed tiled BigTIFF for fast memory-mapped
/// reading). A height that the sample type cannot hold is an error that gives its position; ‹round› writes the nearest
/// value instead. A change of CRS, resolution or alignment requires ‹resampling›, and so do several files that differ in
/// these: each is resampled to the lattice of the output, and voids of those on top are filled from those below.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct ConvertOptions {
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How its format is written.
    #[option(flatten)]
    pub written: GridOutput,
    /// How its samples are stored.
    #[option(flatten)]
    pub samples: SampleOutput,
    /// Resampling method; required if output samples lie between input samples
    #[option(value = "NAME", with = ResamplingName, heading = "Output grid")]
    pub resampling: Option<String>,
    /// Files on top, of several that differ in lattice or CRS
    #[option(value = "RULE", heading = "Output grid")]
    pub priority: LayerPriority,
    /// Width of the border and of the surroundings of voids where such files fade into those below, in cells of the output
    #[option(value = "CELLS", heading = "Output grid", range = OptionRange::new(0.0, 256.0))]
    pub feather: u32,
    /// The lattice of the output.
    #[option(flatten)]
    pub lattice: LatticeOptions,
    /// The coordinate reference system of the output.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::Needs("priority", &["resampling"]),
    OptionRule::Needs("feather", &["resampling"]),
    OptionRule::Needs("to_crs", &["resampling"]),
    OptionRule::Needs("resolution", &["resampling"]),
    OptionRule::Needs("extent", &["resampling"]),
    OptionRule::Needs("like", &["resampling"]),
    OptionRule::NotWith("like", &["resolution", "extent"]),
];

/// What all operations have in common that write a grid computed from another, on its lattice
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = group)]
pub struct DerivedGridOptions {
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How its format is written.
    #[option(flatten)]
    pub written: GridOutput,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

terrane_engine::has_within!(
    SlopeOptions AspectOptions HillshadeOptions CurvatureOptions RoughnessOptions TpiOptions TriOptions:
    DerivativeOptions => [DerivedGridOptions]
);
terrane_engine::has_within!(
    SlopeOptions AspectOptions HillshadeOptions CurvatureOptions RoughnessOptions TpiOptions TriOptions
    ColorReliefOptions FillOptions DifferenceOptions:
    DerivedGridOptions => [FileOutput GridOutput GridInput Resources]
);

impl DerivedGridOptions {
    /// The job that writes the computed grid.
    pub(crate) fn job(&self, inputs: &Inputs, output: &Path) -> ConvertJob {
        let Self { file, written, grid, resources } = self.clone();
        let options =
            ConvertOptions { file, written, grid, resources, ..ConvertOptions::default() };
        ConvertJob { input: inputs.clone(), output: output.to_path_buf(), options }
    }
}

impl ConvertOptions {
    /// The format to write.
    pub(crate) fn format(&self, output: &Path) -> Result<&'static GridFormat> {
        write::by_path(output, self.file.format.as_deref())
    }
}

/// A grid-to-grid job.
#[derive(Clone, Debug)]
pub struct ConvertJob {
    /// File names, or a synthetic terrain by name (`synth:rough,size=4097,seed=7`).
    pub input: Inputs,
    /// File to write.
    pub output: PathBuf,
    /// Options.
    pub options: ConvertOptions,
}

impl ConvertJob {
    /// The job with all options at their defaults.
    pub fn new(input: impl Into<Inputs>, output: impl Into<PathBuf>) -> Self {
        let options = ConvertOptions::default();
        Self { input: input.into(), output: output.into(), options }
    }

    /// The same with other options.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut ConvertOptions)) -> Self {
        change(&mut self.options);
        self
    }

    pub(super) fn write_options(&self) -> GridWriteOptions {
        let ConvertOptions { file, written, samples, resources, .. } = self.options.clone();
        let SampleOutput { sample_type, out_nodata, round } = samples;
        GridWriteOptions {
            overwrite: file.replacing.overwrite,
            creation: written.co,
            sample_type,
            nodata: out_nodata,
            round,
            temp_dir: resources.temp_dir,
            bands: Vec::new(),
            are_colours: false,
            read: Vec::new(),
        }
    }

    /// Sidecar files of the input whose names may collide with sidecars of the output.
    pub(super) fn read_beside(&self, source: &dyn GridSource) -> Result<Vec<PathBuf>> {
        let stem = self.output.file_stem().unwrap_or_default().as_encoded_bytes();
        let named = raster::files(self.input.names())?;
        let named = named.iter().map(|name| path_of(raster::file_name(name)).into_owned());
        let all = source.members().into_iter().chain(named);
        let alike = all.filter(|path| {
            let name = path.file_name().unwrap_or_default();
            name.as_encoded_bytes().starts_with(stem)
        });
        Ok(alike.flat_map(|path| beside_grid(&path)).collect())
    }
}

/// What a grid-to-grid job did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct ConvertReport {
    pub input: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    pub width: u32,
    pub height: u32,
    pub crs: String,
    /// Transformation to the CRS of the output, if it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Resampling method, if any, and the number of columns and rows of the input per column and row of the output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resampling: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f64; 2]>,
    pub sample_type: String,
    pub nodata: Option<f64>,
    pub samples: u64,
    pub valid_samples: u64,
    /// Lowest and highest valid height; absent when there is none.
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
    /// Report on flattened water.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water: Option<WaterReport>,
    /// Properties of the grid that the format cannot store.
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub samples_per_second: f64,
}

/// The name of a resampling method.
pub struct ResamplingName;

impl OptionCodec<String> for ResamplingName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        let methods = RESAMPLINGS.iter();
        methods.map(|method| ChoiceName { name: method.name, about: method.about }).collect()
    });

    fn parse(text: &str) -> std::result::Result<String, String> {
        let method = registry::named(RESAMPLINGS, text);
        method.map(|method| method.name.to_owned()).map_err(|error| error.to_string())
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}
