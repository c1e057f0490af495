//! A cloud-to-grid job, and its checks before any point is read.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::placement::{Compat, Placement, usual_cell};
use super::preset::kinds::{GroundFrom, SurfaceModel};
use terrane_base::error::{Error, Result};
use terrane_cloud::{self as cloud, CloudFilter, CloudOpenOptions};
use terrane_engine::Resources;
use terrane_files::folder_for;
use terrane_gridding::canopy::CanopyAlgorithm;
use terrane_gridding::{
    self as gridding, Canopy, StatisticDefaults, StatisticRecipe, StatisticRequest,
};
use terrane_raster::SampleType;
use terrane_raster::write::{self, BandName, GridFormat, GridWriteOptions};

/// A cloud-to-grid job. A plan notes what the cells depend on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridJob {
    /// Files, folders, patterns or lists of clouds.
    pub input: Vec<String>,
    /// How they are read.
    #[serde(flatten)]
    pub cloud: CloudOpenOptions,
    /// File to write.
    #[serde(skip)]
    pub output: PathBuf,
    /// Name of the format to write; by the output's ending when `None`, a plain GeoTIFF in tiles for
    /// a `.tif`.
    pub format: Option<String>,
    /// Creation options of the format, as (key, value).
    pub creation: Vec<(String, String)>,
    /// A band for each ([`gridding::parse_list`]).
    pub stats: Vec<StatisticRequest>,
    /// The model of the terrain that the only band is ([`SurfaceModel::band`]), if it is one.
    pub preset: Option<SurfaceModel>,
    /// Which points are ground, for a preset: `cloud.filter.classes` names their classes, 2 if `None`.
    pub ground: GroundFrom,
    /// How a preset of what is seen from above gets rid of returns from deep in crowns.
    #[serde(default, skip_serializing_if = "Canopy::is_usual")]
    pub canopy: Canopy,
    /// The name of a file with water, which is made level, for a model of the ground.
    #[serde(skip)]
    pub water: Option<String>,
    /// Where the cells lie.
    pub placement: Placement,
    /// Whose conventions are followed.
    pub compat: Compat,
    /// Radius of idw and nearest (of all statistics, in the manner of PDAL), in world units; the
    /// greater side of a cell times the root of 2 when `None`.
    pub radius: Option<f64>,
    /// Power of the distance that weights of idw fall off by; 1 when `None`.
    pub power: Option<f64>,
    /// Triangles with a longer edge, in world units, are no surface; all are when `None`.
    pub max_edge: Option<f64>,
    /// Voids are filled from known cells at most so many columns and rows away; 0 fills none.
    pub fill: u32,
    /// Type of the written samples.
    pub sample_type: SampleType,
    /// Write the nearest value where a type of whole numbers does not hold one exactly.
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

/// Stands for voids unless told otherwise.
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

    /// As [`new`](Self::new), for a model of the terrain.
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

    /// The creation options: a GeoTIFF is tiled unless it is to be in strips, for tiles are what
    /// blocks of cells fit into.
    pub(super) fn creation(&self) -> Vec<(String, String)> {
        let mut creation = self.creation.clone();
        let given = creation.iter().any(|(key, _)| key.eq_ignore_ascii_case("TILED"));
        if !given && self.format().is_ok_and(|format| format.name == "GTiff") {
            creation.push(("TILED".to_owned(), "YES".to_owned()));
        }
        creation
    }

    pub(super) fn write_options(&self) -> GridWriteOptions {
        let bands = self.stats.iter().map(|asked| BandName {
            name: asked.label.clone(),
            in_vertical_unit: asked.is_height(),
            counts: asked.statistic.counts(),
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

    /// How the cloud is read: where only a box of cells is wanted, without the points that are too far
    /// away from it to be in any of its values, so that files and parts beyond are not even read. A
    /// triangle may have corners anywhere.
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

    /// Folder for what does not fit into memory.
    pub(super) fn spill_folder(&self) -> &Path {
        folder_for(&self.output, self.resources.temp_dir.as_deref())
    }

    /// The same with the size of its cells: of a model of the terrain, where none is given, one that follows
    /// from the density of all points of the cloud, whatever the filter.
    ///
    /// # Errors
    /// Those of opening the cloud; points whose density is not known.
    pub fn settled(&self) -> Result<Self> {
        let mut job = self.clone();
        if job.preset.is_some() && job.placement.cell.is_none() && job.placement.like.is_none() {
            let all = CloudOpenOptions { filter: CloudFilter::default(), ..self.cloud.clone() };
            let side = usual_cell(cloud::source(&self.input, &all)?.info())?;
            (job.placement.cell, job.placement.is_chosen) = (Some([side; 2]), true);
        }
        Ok(job)
    }

    /// Whether the ground has to be known.
    pub(super) fn needs_ground(&self) -> bool {
        let has_layers = self.canopy.way() == CanopyAlgorithm::PitFree;
        self.preset.is_some_and(|preset| preset != SurfaceModel::Dsm || has_layers)
    }

    /// Fails when something is asked for that acts on none of the bands.
    fn check_idle(&self) -> Result<()> {
        let lack = |key| self.stats.iter().any(|asked| asked.statistic.lacks(key));
        let around = self.compat == Compat::Pdal || lack("radius");
        let fills = self.stats.iter().any(|asked| asked.statistic.fills());
        let options = [
            ("‹radius›", self.radius.is_some() && !around, "for idw and nearest without one"),
            ("‹power›", self.power.is_some() && !lack("power"), "for idw without one"),
            (
                "‹max_edge›",
                self.max_edge.is_some() && !lack("max_edge"),
                "for tin without one, ‹dtm›, ‹dsm› and ‹chm›",
            ),
            ("‹fill›", self.fill > 0 && !fills, "for heights, not for counts and classes"),
        ];
        match options.into_iter().find(|(_, idles, _)| *idles) {
            Some((option, _, why)) => {
                Err(Error::usage(format!("{option} cannot act: it is {why}"))
                    .remedy(format!("leave {option} out")))
            }
            None => Ok(()),
        }
    }

    /// Fails when the job cannot be done whatever the points.
    pub fn check(&self) -> Result<()> {
        let format = self.format()?;
        format.check(&self.creation)?;
        if self.nodata != NODATA {
            format.check_voids("‹nodata›")?;
        }
        gridding::check_power(self.power.unwrap_or(1.0))?;
        if self.stats.is_empty() {
            return Err(Error::usage("no statistic is asked for").remedy("add ‹stat› mean"));
        }
        self.preset.map_or(Ok(()), |preset| check_preset(preset, self))?;
        if self.water.is_some() && self.preset != Some(SurfaceModel::Dtm) {
            return Err(Error::usage("‹water› is for models of the ground")
                .remedy("leave it out, or pass ‹dtm›"));
        }
        self.placement.check(self.compat, self.preset.is_some())?;
        self.check_idle()?;
        terrane_files::atomic::refuse_existing(&self.output, self.overwrite)
    }
}

/// Fails when a preset cannot be made as asked for, whatever the points.
fn check_preset(preset: SurfaceModel, job: &GridJob) -> Result<()> {
    let wanted = &job.cloud.filter;
    if job.stats != [preset.band()] {
        let message = "a preset is one band, beside which there is no statistic";
        return Err(Error::usage(message).remedy("leave out ‹stat› or the preset"));
    }
    if wanted.returns.is_some() {
        let message = "‹return› cannot act: a preset takes the returns that it is made of";
        return Err(Error::usage(message).remedy("leave ‹return› out"));
    }
    if wanted.classes.is_some() && job.ground.is_method() {
        let message = "‹class› cannot act: it names the classes of ground, which a method of \
            ‹ground› does not ask for";
        return Err(Error::usage(message).remedy("leave ‹class› out, or pass ‹ground› class"));
    }
    check_canopy(preset, job)
}

/// Fails where what is said of the surface, or of a ground that it does not stand on, cannot act.
fn check_canopy(preset: SurfaceModel, job: &GridJob) -> Result<()> {
    if preset == SurfaceModel::Dtm && !job.canopy.is_usual() {
        return Err(Error::usage("‹canopy› cannot act: it is for ‹dsm› and ‹chm›")
            .remedy("leave ‹canopy› out"));
    }
    let idle = [
        ("‹ground›", job.ground != GroundFrom::Auto),
        ("‹class›", job.cloud.filter.classes.is_some()),
    ];
    match idle.into_iter().find(|(_, given)| *given && !job.needs_ground()) {
        Some((option, _)) => {
            let name = job.canopy.name();
            let message = format!("{option} cannot act: a {name} ‹dsm› knows of no ground");
            Err(Error::usage(message).remedy(format!("leave {option} out")))
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
