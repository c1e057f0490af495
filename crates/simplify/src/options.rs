//! Options of line simplification.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;
use terrane_options::{
    Choice, ChoiceName, OptionCodec, OptionKind, OptionRange, OptionRule, Options,
};

use super::{Length, LengthText, LineGoal, LineJob, LineReport, Topology, method, run};
use terrane_base::error::Result;
use terrane_engine::Resources;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FeatureInput, FileName, FileOutput, FileSize, Reprojection};
use terrane_files::path_of;
use terrane_line::topology::{RingCollapse, Strategy};
use terrane_line::{METHODS, SimplifyMethod};

/// Simplify lines and polygons within a distance tolerance
///
/// Each removed vertex is within the tolerance of the segment that replaces it. Features keep their properties, ids,
/// heights and measures. With ‹topology› shared borders stay shared, no new crossings appear, and no ring flips or
/// changes sides.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct LineOptions {
    /// Maximum distance of a removed vertex from its segment, in units of the data or with a unit: 100m, 2km, 50ft (on
    /// the ellipsoid for longitude and latitude)
    #[option(value = "LENGTH", with = LengthText, range = OptionRange::FROM_ZERO, heading = "Target")]
    pub tolerance: Option<Length>,
    /// Effective area threshold of the Visvalingam methods, in squared units of the data
    #[option(value = "A", range = OptionRange::FROM_ZERO, heading = "Target")]
    pub area: Option<f64>,
    /// Share of vertices to keep, from 0 to 1
    #[option(value = "SHARE", range = OptionRange::new(0.0, 1.0), heading = "Target")]
    pub keep_ratio: Option<f64>,
    /// Maximum number of vertices
    #[option(value = "N", heading = "Target")]
    pub keep_count: Option<u64>,
    /// Maximum file size, such as 5M
    #[option(value = "SIZE", with = FileSize, heading = "Target")]
    pub target_size: Option<u64>,
    /// Simplification method
    #[option(value = "NAME", with = MethodName, default_text = "cone; rdp with ‹hierarchy›", heading = "Method")]
    pub method: Option<String>,
    /// File of the rdp split hierarchy, for any tolerance, ratio, count or size. Created if missing; an existing file
    /// replaces the method
    #[option(value = "FILE", with = FileName, heading = "Method")]
    pub hierarchy: Option<PathBuf>,
    /// Distance metric
    #[option(value = "NAME", heading = "Method")]
    pub metric: Metric,
    /// Handling of rings that would collapse to less than a triangle
    #[option(value = "HOW", heading = "Method")]
    pub collapse: RingCollapse,
    /// Preserve topology: shared borders stay shared, and no line newly crosses, flips or changes sides
    #[option(heading = "Topology")]
    pub topology: bool,
    /// When crossings are tested
    #[option(value = "WHEN", default_text = "retroactive", heading = "Topology")]
    pub strategy: Option<Strategy>,
    /// Snap vertices within this distance, in units of the data
    #[option(value = "DISTANCE", range = OptionRange::POSITIVE, heading = "Topology")]
    pub snap: Option<f64>,
    /// File of points that stay on the same side of every line
    #[option(value = "FILE", with = FileName, role = Reads, heading = "Topology")]
    pub sides: Option<PathBuf>,
    /// Decimal places of coordinates; with ‹topology› a vertex is not rounded if lines would touch, cross or change
    /// sides
    #[option(value = "N", range = OptionRange::new(0.0, 17.0), default_text = "no rounding", heading = "Output")]
    pub decimals: Option<u8>,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// The coordinate reference system of the output.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// Input features.
    #[option(flatten)]
    pub features: FeatureInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::OneOf(&["tolerance", "area", "keep_ratio", "keep_count", "target_size"], "target"),
    OptionRule::NotWith("hierarchy", &["topology"]),
    OptionRule::Needs("strategy", &["topology"]),
    OptionRule::Needs("snap", &["topology"]),
    OptionRule::Needs("sides", &["topology"]),
];

/// Distance metric.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum Metric {
    /// Distance in x and y
    #[default]
    Plane,
    /// Distance in x, y and z
    #[choice(name = "3d")]
    Space,
}

/// The name of a method.
pub(super) struct MethodName;

impl OptionCodec<String> for MethodName {
    const KIND: OptionKind = OptionKind::Choice(|| {
        METHODS.iter().map(|own| ChoiceName { name: own.name, about: own.summary }).collect()
    });

    fn parse(text: &str) -> std::result::Result<String, String> {
        method(text).map(|own| own.name.to_owned()).map_err(|error| error.to_string())
    }

    fn json(value: &String) -> Json {
        value.as_str().into()
    }
}

impl LineOptions {
    /// The target.
    fn goal(&self) -> LineGoal {
        let goals = [
            self.tolerance.map(LineGoal::Tolerance),
            self.area.map(LineGoal::Area),
            self.keep_ratio.map(LineGoal::Ratio),
            self.keep_count.map(LineGoal::Count),
            self.target_size.map(LineGoal::Size),
        ];
        // The rules ask for one of them.
        goals.into_iter().flatten().next().unwrap_or(LineGoal::Ratio(1.0))
    }

    /// Simplification method.
    fn chosen(&self) -> Result<&'static SimplifyMethod> {
        match (&self.method, &self.hierarchy) {
            (Some(name), _) => method(name),
            (None, Some(_)) => Ok(&SimplifyMethod::RDP),
            (None, None) => Ok(&METHODS[0]),
        }
    }

    /// The job on some files.
    ///
    /// # Errors
    /// Usage: a method that there is not.
    pub fn job(&self, inputs: &[String], output: &Path) -> Result<LineJob> {
        let topology = Topology {
            strategy: self.strategy.unwrap_or_default(),
            snap: self.snap.unwrap_or(0.0),
            sides: self.sides.clone(),
            ..Topology::default()
        };
        Ok(LineJob {
            input: inputs.iter().map(|name| path_of(name).into_owned()).collect(),
            layer: self.features.layer.clone(),
            output: output.to_path_buf(),
            into_folder: false,
            format: self.file.format.clone(),
            method: self.chosen()?,
            goal: self.goal(),
            is_space: self.metric == Metric::Space,
            topology: self.topology.then_some(topology),
            hierarchy: self.hierarchy.clone(),
            collapse: self.collapse,
            decimals: self.decimals,
            transform: self.reprojection.transform(),
            overwrite: self.file.replacing.overwrite,
            resources: self.resources.clone(),
        })
    }
}

impl Operation for LineOptions {
    const NAME: &'static str = "simplify";
    type Input = FeatureInput;
    const WRITES: Writes = Writes::Features;
    type Report = LineReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.job(&[], output)?.check()
    }

    fn run(&self, request: RunRequest<'_>) -> Result<LineReport> {
        let job = self.job(request.inputs.names(), request.output)?;
        run(&job, request.progress, request.cancel)
    }
}
