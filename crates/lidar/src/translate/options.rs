//! Options of points that are written.

use std::path::Path;

use terrane_options::{Choice, OptionKind, OptionRange, OptionRule, Options};

use super::above::asked::{Classify, HeightAboveGround, HeightsAs};
use super::assign::Assign;
use super::job::TranslateJob;
use super::overlap::Overlap;
use super::sorted::Sort;
use super::split::AttributeSplit;
use super::squares::{BufferMark, SquareSplit};
use super::thin::CellThinning;
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

/// Write the points of clouds with all that is known of them: filtered, merged, thinned, in another format
///
/// Points marked as withheld are carried unless ‹drop_flag=withheld› says otherwise. Every attribute is carried: times,
/// colours, waveforms, extra bytes, and the records of the header that are the same in all files; what the output cannot
/// hold is an error, or told in a note where the format asked for has no field for it. Points stay in the order of the
/// files' names and of the points in them unless ‹sort› is given, so the same files give the same bytes, whatever the order
/// they are named in, threads and memory. The output is .las, .laz, .copc.laz for an octree, or .csv, .txt, .xyz for text; or
/// a folder.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct PointsOptions {
    /// Format of the points, 0 to 10
    #[option(value = "N", with = PointFormatNumber, default_text = "the first that holds all fields of all files")]
    pub point_format: Option<PointFormat>,
    /// Version of LAS, 1.2 to 1.5
    #[option(value = "VERSION", with = AsNumber, default_text = "the first that has points of the format")]
    pub las_version: Option<LasVersion>,
    /// Only one of the points that have the same place and time: the first
    pub dedupe: bool,
    /// The order of points, instead of that of files and of points in them, which those that are equal in it keep
    #[option(value = "ORDER")]
    pub sort: Option<Sort>,
    /// How high points are above the ground, exactly in the triangulation of its points: in the dimension
    /// HeightAboveGround of their extra bytes, or as their z
    #[option(value = "AS", alias = "heights", bare = "dimension", heading = "Ground")]
    pub height_above_ground: Option<HeightsAs>,
    /// Give points classes, noise first, then one way after the other: noise or noise:METHOD (7 for those that a method
    /// finds to be noise, which is no ground; voxel:step=4,isolated=5,class=7 unless told otherwise), ground (2 for those of
    /// classes 0 to 5 found to be ground, and 1 for others of class 2; more classes take part with
    /// ground:reclassify=CLASS,...), or height:CLASS=FROM,... (those of no class, 0 or 1, by their height above the ground;
    /// 3=0.5,4=2,5=5 unless told otherwise); each may be given
    #[option(value = "HOW", with = AsText, heading = "Ground")]
    pub classify: Vec<Classify>,
    /// Which points are ground: class (those of class 2), those that a method of terrane grid ‹ground› finds among
    /// last returns, or auto: by class if there are any, else by the method adaptive
    #[option(value = "HOW", with = AsText, heading = "Ground")]
    pub ground: GroundFrom,
    /// Set an attribute to a number or a formula of attributes, x, y and z with + - * / and parentheses, such as
    /// intensity=intensity/256; names as of terrane grid ‹stat›, those of extra bytes in double quotes where they have
    /// spaces. Fields of whole numbers take the nearest one, and what they cannot hold is an error. May be given several
    /// times
    #[option(value = "NAME=FORMULA", with = AsFormula, heading = "Attributes")]
    pub attribute: Vec<Assign>,
    /// Where flight lines overlap only the points of one: in each square of this size those of the line (point source)
    /// with the least scan angle there, of two the one of the lower number; squares of twice the spacing of points,
    /// rounded up to 1, 2 or 5 times a power of ten, where no size is given
    #[option(value = "CELL", with = AsNumber, bare = "auto", heading = "Fewer points")]
    pub drop_overlap: Option<Overlap>,
    /// Only one point of each square of this size, in units of x and y, whose corners are at its multiples; which one is
    /// said after a colon
    #[option(value = "CELL[:WHICH]", with = AsNumber, heading = "Fewer points")]
    pub thin: Option<CellThinning>,
    /// Only points that are no nearer to each other than this, in space and the units of coordinates, and so many that
    /// each point left out is nearer than that to one of them (Poisson discs); chosen by a hash of places
    #[option(value = "DISTANCE", range = OptionRange::POSITIVE, heading = "Fewer points")]
    pub thin_distance: Option<f64>,
    /// A folder instead of one file, of a file for each square of this size, named by its lowest corner
    #[option(value = "SIDE", range = OptionRange::POSITIVE, heading = "Folders")]
    pub tile: Option<f64>,
    /// A folder instead of one file, of a file for each value of this attribute, such as classification or
    /// point_source_id (flight lines), named by both
    #[option(value = "ATTRIBUTE", heading = "Folders")]
    pub split: Option<String>,
    /// Points around each square up to so far away, too, marked by ‹buffer_mark›
    #[option(value = "WIDTH", range = OptionRange::FROM_ZERO, heading = "Folders")]
    pub buffer: Option<f64>,
    /// How points of buffers are marked
    #[option(value = "MARK", heading = "Folders")]
    pub buffer_mark: BufferMark,
    /// What the files of a folder are
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
    OptionRule::Needs("buffer_mark", &["buffer"]),
    OptionRule::Needs("tile_format", &["tile", "split"]),
    OptionRule::Needs("workdir", &["tile"]),
];

/// The format of files in a folder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum TileFormat {
    /// LAS with compressed points
    #[default]
    Laz,
    /// LAS
    Las,
}

impl PointsOptions {
    /// The job on some files.
    ///
    /// # Errors
    /// Polygons that cannot be read.
    pub fn job(&self, inputs: &[String], output: &Path) -> Result<TranslateJob> {
        let cloud = self.cloud.options(&self.resources)?;
        Ok(TranslateJob { cloud, ..self.unread(inputs, output) })
    }

    /// The same without the polygons that points are within.
    pub(super) fn unread(&self, inputs: &[String], output: &Path) -> TranslateJob {
        let is_plain = self.tile_format == TileFormat::Las;
        let (buffer, mark) = (self.buffer.unwrap_or(0.0), self.buffer_mark);
        TranslateJob {
            cloud: CloudOpenOptions::default(),
            format: self.point_format,
            version: self.las_version,
            dedupe: self.dedupe,
            above: HeightAboveGround {
                from: self.ground,
                heights: self.height_above_ground,
                classify: self.classify.clone(),
            },
            assign: self.attribute.clone(),
            overlap: self.drop_overlap,
            thin: self.thin,
            distance: self.thin_distance,
            transform: self.reprojection.transform(),
            sort: self.sort,
            squares: self.tile.map(|side| (SquareSplit { side, buffer, mark }, is_plain)),
            split: self.split.clone().map(|attribute| AttributeSplit { attribute, is_plain }),
            overwrite: self.replacing.overwrite,
            resources: self.resources.clone(),
            ..TranslateJob::new(inputs.to_vec(), output)
        }
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
