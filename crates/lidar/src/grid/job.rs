//! A cloud-to-grid job, and its checks before any point is read.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::geometry::{Compat, Placement, default_cell};
use super::surface_model::kinds::{GroundFrom, SurfaceModel};
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, CloudFilter, CloudOpenOptions};
use terrane_engine::Resources;
use terrane_files::{folder_for, shown_all};
use terrane_gridding::canopy::CanopyAlgorithm;
use terrane_gridding::{
    self as gridding, Canopy, StatisticDefaults, StatisticRecipe, StatisticRequest,
};
use terrane_raster::SampleType;
use terrane_raster::write::{self, BandName, GridFormat, GridWriteOptions};

/// A cloud-to-grid job. A plan records everything the cells depend on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridJob {
    /// Files, folders, patterns or lists of clouds.
    pub input: Vec<String>,
    /// Their name in the report, if it is another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<String>,
    /// How they are read.
    #[serde(flatten)]
    pub cloud: CloudOpenOptions,
    /// File to write.
    #[serde(skip)]
    pub output: PathBuf,
    /// Name of the format to write; by the output's extension when `None`, a tiled GeoTIFF for `.tif`.
    pub format: Option<String>,
    /// Creation options of the format, as (key, value).
    pub creation: Vec<(String, String)>,
    /// A band for each ([`gridding::parse_list`]).
    pub stats: Vec<StatisticRequest>,
    /// The terrain model of the only band ([`SurfaceModel::band`]), if it is one.
    pub preset: Option<SurfaceModel>,
    /// Source of ground points for a terrain model: `cloud.filter.classes` has their classes, 2 if `None`.
    pub ground: GroundFrom,
    /// Canopy method of a surface model.
    #[serde(default, skip_serializing_if = "Canopy::is_default")]
    pub canopy: Canopy,
    /// File of water to flatten, for a terrain model.
    #[serde(skip)]
    pub water: Option<String>,
    /// Position and size of the cells.
    pub placement: Placement,
    /// Program whose conventions are followed.
    pub compat: Compat,
    /// Radius of idw and nearest (of all statistics with PDAL's conventions), in world units; the longer side
    /// of a cell times the root of 2 when `None`.
    pub radius: Option<f64>,
    /// Power of the inverse distance of idw; 1 when `None`.
    pub power: Option<f64>,
    /// Triangles with a longer edge, in world units, are ignored; none are when `None`.
    pub max_edge: Option<f64>,
    /// Fills voids from valid cells at most this number of columns and rows away; 0 fills none.
    pub fill: u32,
    /// Type of the written samples.
    pub sample_type: SampleType,
    /// Rounds values to integer types instead of failing.
    pub round: bool,
    /// Nodata value of the output.
    #[serde(with = "as_text")]
    pub nodata: f64,
    /// Replace an existing output.
    #[serde(skip)]
    pub overwrite: bool,
    /// Resources of the job.
    #[serde(skip)]
    pub resources: Resources,
}

/// Default nodata value.
pub(super) const NODATA: f64 = -9999.0;

impl GridJob {
    /// The job with everything else at its default, for cells of `cell` world units.
    pub fn new(
        input: impl IntoIterator<Item = impl Into<String>>,
        output: impl Into<PathBuf>,
        stats: Vec<StatisticRequest>,
        cell: f64,
    ) -> Self {
        Self {
            input: input.into_iter().map(Into::into).collect(),
            label: None,
            cloud: CloudOpenOptions::default(),
            output: output.into(),
            format: None,
            creation: Vec::new(),
            stats,
            preset: None,
            ground: GroundFrom::default(),
            canopy: Canopy::default(),
            water: None,
            placement: Placement::new([cell; 2]),
            compat: Compat::None,
            radius: None,
            power: None,
            max_edge: None,
            fill: 0,
            sample_type: SampleType::F32,
            round: false,
            nodata: NODATA,
            overwrite: false,
            resources: Resources::default(),
        }
    }

    /// The name of the input.
    pub(super) fn label(&self) -> String {
        self.label.clone().unwrap_or_else(|| shown_all(&self.input))
    }

    /// As [`new`](Self::new), for a terrain model.
    pub fn of_preset(
        input: impl IntoIterator<Item = impl Into<String>>,
        output: impl Into<PathBuf>,
        preset: SurfaceModel,
        cell: f64,
    ) -> Self {
        Self { preset: Some(preset), ..Self::new(input, output, vec![preset.band()], cell) }
    }

    /// The format to write.
    pub fn format(&self) -> Result<&'static GridFormat> {
        write::by_path(&self.output, self.format.as_deref())
    }

    /// The creation options: a GeoTIFF is tiled by default, to match the blocks of cells.
    pub(super) fn creation(&self) -> Vec<(String, String)> {
        let mut creation = self.creation.clone();
        let given = creation.iter().any(|(key, _)| key.eq_ignore_ascii_case("TILED"));
        if !given && self.format().is_ok_and(|format| format.name == "GTiff") {
            creation.push(("TILED".to_owned(), "YES".to_owned()));
        }
        creation
    }

    pub(super) fn write_options(&self) -> GridWriteOptions {
        let bands = self.stats.iter().map(|request| BandName {
            name: request.label.clone(),
            in_vertical_unit: request.is_height(),
            counts: request.statistic.counts(),
        });
        let single = !self.format().is_ok_and(|format| format.several_bands);
        GridWriteOptions {
            overwrite: self.overwrite,
            creation: self.creation(),
            sample_type: None,
            nodata: None,
            round: self.round,
            temp_dir: self.resources.temp_dir.clone(),
            bands: if single && self.stats.len() == 1 { Vec::new() } else { bands.collect() },
            are_colours: false,
            read: Vec::new(),
        }
    }

    pub(super) fn rules(&self, cell: [f64; 2]) -> StatisticDefaults {
        let usual = cell[0].max(cell[1]) * std::f64::consts::SQRT_2;
        StatisticDefaults {
            radius: self.radius.unwrap_or(usual),
            power: self.power.unwrap_or(1.0),
            around: self.compat == Compat::Pdal,
        }
    }

    /// Reading options: for a box of cells, points too far away to contribute are filtered out, so that files
    /// and parts beyond are not read. Triangulations need all points.
    pub(super) fn reading(&self) -> CloudOpenOptions {
        let mut options = self.cloud.clone();
        let cell = self.placement.cell.unwrap_or_default();
        let recipe = StatisticRecipe::new(&self.stats, &self.rules(cell));
        if let (Some([x0, y0, x1, y1]), None, false) =
            (self.placement.extent, options.filter.bounds, recipe.triangulates())
        {
            let reach = recipe.reach();
            let [x, y] = cell.map(|side| reach + f64::from(self.fill + 2) * side);
            options.filter.bounds = Some([x0 - x, y0 - y, x1 + x, y1 + y]);
        }
        options
    }

    /// Folder for spilled data.
    pub(super) fn spill_folder(&self) -> &Path {
        folder_for(&self.output, self.resources.temp_dir.as_deref())
    }

    /// The job with its cell size: for a terrain model without one, it is derived from the density of all
    /// points, regardless of filters.
    ///
    /// # Errors
    /// Errors of opening the point cloud; unknown density of points.
    pub fn settled(&self) -> Result<Self> {
        let mut job = self.clone();
        if job.preset.is_some() && job.placement.cell.is_none() && job.placement.like.is_none() {
            let all = CloudOpenOptions { filter: CloudFilter::default(), ..self.cloud.clone() };
            let side = default_cell(cloud::source(&self.input, &all)?.info())?;
            (job.placement.cell, job.placement.is_chosen) = (Some([side; 2]), true);
        }
        Ok(job)
    }

    /// Whether ground points are needed.
    pub(super) fn needs_ground(&self) -> bool {
        let has_layers = self.canopy.algorithm() == CanopyAlgorithm::PitFree;
        self.preset.is_some_and(|preset| preset != SurfaceModel::Dsm || has_layers)
    }

    /// Fails if an option has no effect on any band.
    fn check_idle(&self) -> Result<()> {
        let [lack_radius, lack_power, lack_edge] = ["radius", "power", "max_edge"]
            .map(|key| self.stats.iter().any(|request| request.statistic.lacks(key)));
        let around = self.compat == Compat::Pdal || lack_radius;
        let fills = self.stats.iter().any(|request| request.statistic.fills());
        let options = [
            (
                "‹radius›",
                self.radius.is_some() && !around,
                "idw and nearest without a radius of their own",
            ),
            ("‹power›", self.power.is_some() && !lack_power, "idw without a power of its own"),
            (
                "‹max_edge›",
                self.max_edge.is_some() && !lack_edge,
                "‹dtm›, ‹dsm›, ‹chm›, and tin without a max_edge of its own",
            ),
            ("‹fill›", self.fill > 0 && !fills, "statistics of heights, not to counts and classes"),
        ];
        match options.into_iter().find(|(_, idles, _)| *idles) {
            Some((option, _, why)) => {
                Err(Error::usage(format!("{option} has no effect: it applies to {why}"))
                    .remedy(format!("leave out {option}")))
            }
            None => Ok(()),
        }
    }

    /// Fails if the job is invalid for any points.
    pub fn check(&self) -> Result<()> {
        let format = self.format()?;
        format.check(&self.creation)?;
        if self.nodata != NODATA {
            format.check_voids("‹nodata›")?;
        }
        gridding::check_power(self.power.unwrap_or(1.0))?;
        if self.stats.is_empty() {
            return Err(Error::usage("no statistic given").remedy("add ‹stat› mean"));
        }
        self.preset.map_or(Ok(()), |preset| check_preset(preset, self))?;
        if self.water.is_some() && self.preset != Some(SurfaceModel::Dtm) {
            return Err(Error::usage("‹water› requires a terrain model")
                .remedy("leave it out, or pass ‹dtm›"));
        }
        self.placement.check(self.compat, self.preset.is_some())?;
        self.check_idle()?;
        terrane_files::atomic::refuse_existing(&self.output, self.overwrite)
    }
}

/// Fails if the options are invalid for a terrain model.
fn check_preset(preset: SurfaceModel, job: &GridJob) -> Result<()> {
    let filter = &job.cloud.filter;
    if job.stats != [preset.band()] {
        let message = "‹dtm›, ‹dsm› and ‹chm› do not support ‹stat›";
        return Err(Error::usage(message).remedy("leave out ‹stat›"));
    }
    if filter.returns.is_some() {
        let message =
            "‹return› has no effect with ‹dtm›, ‹dsm› or ‹chm›, which select returns themselves";
        return Err(Error::usage(message).remedy("leave out ‹return›"));
    }
    if filter.classes.is_some() && job.ground.is_method() {
        let message = "‹class› has no effect: the method of ‹ground› does not use ground classes";
        return Err(Error::usage(message).remedy("leave out ‹class›, or pass ‹ground› class"));
    }
    check_canopy(preset, job)
}

/// Fails for canopy or ground options without an effect on the model.
fn check_canopy(preset: SurfaceModel, job: &GridJob) -> Result<()> {
    if preset == SurfaceModel::Dtm && !job.canopy.is_default() {
        return Err(Error::usage("‹canopy› has no effect: it applies to ‹dsm› and ‹chm›")
            .remedy("leave out ‹canopy›"));
    }
    let idle = [
        ("‹ground›", job.ground != GroundFrom::Auto),
        ("‹class›", job.cloud.filter.classes.is_some()),
    ];
    match idle.into_iter().find(|(_, given)| *given && !job.needs_ground()) {
        Some((option, _)) => {
            let name = job.canopy.name();
            let message = format!("{option} has no effect: a {name} ‹dsm› does not use the ground");
            Err(Error::usage(message).remedy(format!("leave out {option}")))
        }
        None => Ok(()),
    }
}

/// A number as text, because it may be NaN, which JSON has no word for.
mod as_text {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

    pub(super) fn serialize<S: Serializer>(value: &f64, out: S) -> Result<S::Ok, S::Error> {
        value.to_string().serialize(out)
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<f64, D::Error> {
        String::deserialize(from)?.parse().map_err(de::Error::custom)
    }
}
