//! Options of points that are written.

use std::path::Path;

use terrane_options::{Choice, OptionKind, OptionRange, OptionRule, Options};

use super::job::TranslateJob;
use super::split::AttributeSplit;
use super::staged::CloudStages;
use super::stages::{
    AnyStage, Assign, CellThinning, Classify, Dedupe, HeightQuery, HeightsAs, Overlap,
    PoissonSampling, Reproject, Sort, refuse_twice,
};
use super::tiled_output::{BufferFlag, PointTiling};
use crate::grid::{AsText, GroundFrom};
use terrane_base::error::Result;
use terrane_cloud::{CloudOpenOptions, LasVersion, PointFormat};
use terrane_engine::Resources;
use terrane_engine::options::{
    AsFormula, AsNumber, CloudInput, PointFormatNumber, Replacing, Reprojection, Resuming,
};

terrane_engine::by_text!(AsFormula, OptionKind::Shaped("str"), Assign);
terrane_engine::by_text!(AsNumber, OptionKind::Shaped("float | str"), Overlap CellThinning);
terrane_engine::by_text!(AsText, OptionKind::Text, Classify);

/// Filter, merge, thin, classify and convert point clouds, with all attributes
///
/// Withheld points are kept unless ‹drop_flag=withheld› is given. All attributes are kept: times, colours, waveforms,
/// extra bytes, and the header records that are the same in all files. An attribute that the output cannot hold is an
/// error; a field that the requested point format lacks is reported in a note. Points stay in the order of file names
/// and of points within files unless ‹sort› is given; the output does not depend on the order of inputs, threads or
/// memory. The output is .las, .laz, .copc.laz (octree), text (.csv, .txt, .xyz), or a folder.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct PointsOptions {
    /// LAS point format, 0 to 10
    #[option(value = "N", with = PointFormatNumber, default_text = "the first that holds all fields of all files")]
    pub point_format: Option<PointFormat>,
    /// LAS version, 1.2 to 1.5
    #[option(value = "VERSION", with = AsNumber, default_text = "the first that supports the point format")]
    pub las_version: Option<LasVersion>,
    /// Remove duplicates: of points with the same position and time the first is kept
    pub dedupe: bool,
    /// Order of points; equal points stay in input order
    #[option(value = "ORDER")]
    pub sort: Option<Sort>,
    /// Height above the triangulated ground points, as an extra dimension or as z
    #[option(value = "AS", alias = "heights", bare = "dimension", heading = "Ground")]
    pub height_above_ground: Option<HeightsAs>,
    /// Classify points: noise or noise:METHOD (class 7; default method voxel:step=4,isolated=5,class=7), ground (class
    /// 2 for ground among classes 0 to 5, class 1 for other points of class 2; ground:reclassify=CLASS,... adds
    /// classes), height:CLASS=FROM,... (classes 0 and 1 by height above ground; default 3=0.5,4=2,5=5). Repeatable;
    /// noise is classified first
    #[option(value = "HOW", with = AsText, heading = "Ground")]
    pub classify: Vec<Classify>,
    /// Ground points: class (class 2), a method of terrane grid ‹ground› that classifies last returns, or auto (by
    /// class if the cloud has ground points, else csf-ptd)
    #[option(value = "HOW", with = AsText, heading = "Ground")]
    pub ground: GroundFrom,
    /// Set an attribute to a number or a formula of attributes, x, y and z with + - * / and parentheses, such as
    /// intensity=intensity/256. Names as in terrane grid ‹stat›; extra bytes in double quotes if the name has spaces.
    /// Integer fields are rounded; values out of range are an error. Repeatable
    #[option(value = "NAME=FORMULA", with = AsFormula, heading = "Attributes")]
    pub attribute: Vec<Assign>,
    /// Remove flight-line overlap: in each CELL keep the flight line (point source) with the smallest scan angle, in
    /// ties the lower number. Default cell: twice the point spacing, rounded up to 1, 2 or 5 times a power of ten
    #[option(value = "CELL", with = AsNumber, bare = "auto", heading = "Thinning")]
    pub drop_overlap: Option<Overlap>,
    /// Keep one point per cell of this size, in units of x and y; cell corners are at multiples of the size. WHICH
    /// selects the point
    #[option(value = "CELL[:WHICH]", with = AsNumber, heading = "Thinning")]
    pub thin: Option<CellThinning>,
    /// Thin to a minimum 3D distance between points, in coordinate units (Poisson disk sampling). The selection is
    /// reproducible
    #[option(value = "DISTANCE", range = OptionRange::POSITIVE, heading = "Thinning")]
    pub thin_distance: Option<f64>,
    /// Further stages: they run after those of other options and before ‹sort›.
    #[option(flatten)]
    pub stages: CloudStages,
    /// Write a folder of square tiles with this side, one file each, named by the lower left corner
    #[option(value = "SIDE", range = OptionRange::POSITIVE, heading = "Folders")]
    pub tile: Option<f64>,
    /// Write a folder with one file for each value of this attribute, such as classification or point_source_id (flight
    /// lines)
    #[option(value = "ATTRIBUTE", heading = "Folders")]
    pub split: Option<String>,
    /// Buffer around each tile: points within this distance are included, flagged by ‹buffer_flag›
    #[option(value = "WIDTH", range = OptionRange::FROM_ZERO, heading = "Folders")]
    pub buffer: Option<f64>,
    /// Flag of buffer points
    #[option(value = "FLAG", heading = "Folders")]
    pub buffer_flag: BufferFlag,
    /// Format of the files in a folder
    #[option(value = "NAME", heading = "Folders")]
    pub tile_format: TileFormat,
    /// Existing output.
    #[option(flatten)]
    pub replacing: Replacing,
    /// The coordinate reference system of the output.
    #[option(flatten)]
    pub reprojection: Reprojection,
    /// How the cloud is read.
    #[option(flatten)]
    pub cloud: CloudInput,
    /// Where work is kept.
    #[option(flatten)]
    pub resuming: Resuming,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] = &[
    OptionRule::NotWith("tile", &["split"]),
    OptionRule::Needs("buffer", &["tile"]),
    OptionRule::Needs("buffer_flag", &["buffer"]),
    OptionRule::Needs("tile_format", &["tile", "split"]),
    OptionRule::Needs("workdir", &["tile"]),
];

/// The format of files in a folder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum TileFormat {
    /// LAZ (compressed LAS)
    #[default]
    Laz,
    /// LAS
    Las,
}

impl PointsOptions {
    /// The job on some files.
    ///
    /// # Errors
    /// Polygons or a pipeline that cannot be read; a method of ‹classify› given twice.
    pub fn job(&self, inputs: &[String], output: &Path) -> Result<TranslateJob> {
        refuse_twice(&self.classify)?;
        let cloud = self.cloud.options(&self.resources)?;
        Ok(TranslateJob { cloud, ..self.unread(inputs, output, self.stages.all()?) })
    }

    /// The job without its clip polygons, with these further stages.
    pub(super) fn unread(
        &self,
        inputs: &[String],
        output: &Path,
        further: Vec<AnyStage>,
    ) -> TranslateJob {
        let is_plain = self.tile_format == TileFormat::Las;
        let tiling =
            |side| PointTiling { side, buffer: self.buffer.unwrap_or(0.0), flag: self.buffer_flag };
        let job = TranslateJob {
            cloud: CloudOpenOptions::default(),
            format: self.point_format,
            version: self.las_version,
            squares: self.tile.map(|side| (tiling(side), is_plain)),
            split: self.split.clone().map(|attribute| AttributeSplit { attribute, is_plain }),
            overwrite: self.replacing.overwrite,
            resources: self.resources.clone(),
            ..TranslateJob::new(inputs.to_vec(), output)
        };
        // The usual order: what selects comes before what moves, and noise is not ground.
        let ground = HeightQuery {
            from: self.ground,
            heights: self.height_above_ground,
            classify: self.classify.clone(),
        };
        job.stages(self.dedupe.then_some(Dedupe))
            .classify(ground)
            .stages(self.attribute.clone())
            .stages(self.drop_overlap)
            .stages(self.thin)
            .stages(self.thin_distance.map(PoissonSampling))
            .stages(self.reprojection.transform().map(Reproject))
            .stages(further)
            .stages(self.sort)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_options::{Json, OptionCodec};

    #[test]
    fn cells_of_flight_lines_are_written_as_they_are_read() {
        for text in ["auto", "2.5"] {
            let overlap: Overlap = AsNumber::parse(text).unwrap();
            assert_eq!(AsNumber::json(&overlap), Json::from(text));
        }
    }
}
