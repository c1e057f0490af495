//! A points-to-points job, and its checks before any point is read.

use std::path::{Path, PathBuf};

use super::assign::Assign;
use super::flight_lines::Overlap;
use super::height_above_ground::queries::{HeightQuery, HeightsAs};
use super::reprojection::CloudReprojection;
use super::sorted::{self, Sort};
use super::split::AttributeSplit;
use super::thinning::CellThinning;
use super::tiled_output::PointTiling;
use super::{discs, noise};
use crate::records::selection::needed;
use terrane_base::error::{Error, Result};
use terrane_cloud::write::{PointPacking, packing_by_name};
use terrane_cloud::{
    CloudFilter, CloudInfo, CloudOpenOptions, LasOutputFormat, LasVersion, PointCloud, PointFormat,
};
use terrane_engine::Resources;
use terrane_engine::transform::TargetCrs;
use terrane_files::path_of;

/// A job that writes point clouds as one.
#[derive(Clone, Debug)]
pub struct TranslateJob {
    /// File names, folders, patterns, lists.
    pub input: Vec<String>,
    /// Reading options and filters; points marked as withheld are kept unless the filter drops them.
    pub cloud: CloudOpenOptions,
    /// LAS, LAZ or COPC file to write, or a folder of LAS or LAZ files.
    pub output: PathBuf,
    /// Format of its points; the first that holds all fields of all files when `None`.
    pub format: Option<PointFormat>,
    /// LAS version; the first that supports the point format when `None`.
    pub version: Option<LasVersion>,
    /// Keep one of the points with the same position and time.
    pub dedupe: bool,
    /// Heights above the ground, and classes.
    pub above: HeightQuery,
    /// Assigned attributes, in order.
    pub assign: Vec<Assign>,
    /// Keep the points of one flight line in each cell.
    pub overlap: Option<Overlap>,
    /// Keep one point of each cell.
    pub thin: Option<CellThinning>,
    /// Poisson disk sampling with this distance in 3D, in world units.
    pub distance: Option<f64>,
    /// Target CRS.
    pub transform: Option<TargetCrs>,
    /// Order of points; that of the files when `None`.
    pub sort: Option<Sort>,
    /// Write a folder with a file for each tile; uncompressed if true.
    pub squares: Option<(PointTiling, bool)>,
    /// Write a folder with a file for each value of an attribute.
    pub split: Option<AttributeSplit>,
    /// Replace an existing output.
    pub overwrite: bool,
    /// Resources of the job.
    pub resources: Resources,
}

impl TranslateJob {
    /// The job with everything else at its default.
    pub fn new(input: Vec<String>, output: impl Into<PathBuf>) -> Self {
        Self {
            input,
            cloud: CloudOpenOptions::default(),
            output: output.into(),
            format: None,
            version: None,
            dedupe: false,
            above: HeightQuery::default(),
            assign: Vec::new(),
            overlap: None,
            thin: None,
            distance: None,
            transform: None,
            sort: None,
            squares: None,
            split: None,
            overwrite: false,
            resources: Resources::default(),
        }
    }
}

/// Least memory for records that are divided into columns or tiles.
const SPREAD: u64 = 32 << 20;

impl TranslateJob {
    /// Opens the point cloud.
    pub(super) fn open(&self) -> Result<PointCloud> {
        terrane_cloud::open(&self.input, &self.reading())
    }

    /// Number of selections of points.
    pub(super) fn choices(&self) -> u64 {
        let choices = [self.dedupe, self.thin.is_some(), self.overlap.is_some()];
        choices.map(u64::from).iter().sum()
    }

    /// Largest distance of points that decide whether a point is kept or noise.
    pub(super) fn reach(&self, info: &CloudInfo) -> Result<f64> {
        let overlap = self.overlap.and_then(|overlap| overlap.cell).unwrap_or_default();
        let noise = self.above.noise().map_or(Ok(0.0), |request| noise::reach(request, info))?;
        Ok(self.thin.map_or(0.0, |thin| thin.cell) + overlap + noise)
    }

    /// Bytes of memory beside records in flight, for `points` read of a point cloud or a part of it; and for
    /// each thread.
    pub(super) fn needed(
        &self,
        packing: PointPacking,
        info: &CloudInfo,
        points: u64,
        is_part: bool,
    ) -> [u64; 2] {
        // However far around a part the ground is read.
        let has_ground = is_part && self.dedupe && self.above.is_requested();
        let of_ground = if has_ground { needed(info.count) } else { 0 };
        let choices = self.choices() * needed(points) + of_ground;
        let is_spread =
            packing == PointPacking::Nodes || self.squares.is_some() || self.split.is_some();
        let spread = if is_spread { SPREAD } else { 0 };
        let sort = self.sort.map_or(0, |_| sorted::LEAST);
        let [discs, each_disc] = self.distance.map_or([0; 2], |_| discs::needed(info.count));
        let [above, each] = self.above.needed(info);
        let noise = self.above.noise().map(|request| noise::needed(request, points));
        let [noise, each_part] = noise.unwrap_or_default();
        let each = each.max(each_disc).max(each_part);
        [choices + above + noise + discs + spread + sort, each]
    }

    /// Fails for options that the point format, the packing or the coordinates do not support.
    pub(super) fn check(
        &self,
        format: PointFormat,
        packing: PointPacking,
        info: &CloudInfo,
    ) -> Result<()> {
        self.above.check(format)?;
        self.above.noise().map_or(Ok(0.0), |request| noise::reach(request, info))?;
        if let Some(distance) = self.distance {
            discs::check(distance, info)?;
        }
        match self.sort {
            Some(_) if packing == PointPacking::Nodes => {
                Err(Error::usage("‹sort› has no effect on COPC, which has the order of its octree")
                    .remedy("leave it out, or write .laz"))
            }
            Some(by) => sorted::check(by, format),
            None => Ok(()),
        }
    }

    /// Reading options: points marked as withheld are read.
    pub(super) fn reading(&self) -> CloudOpenOptions {
        let filter = CloudFilter { keep_withheld: true, ..self.cloud.filter.clone() };
        CloudOpenOptions { filter, any_extent: self.is_copy(), ..self.cloud.clone() }
    }

    /// Whether no step depends on the positions of several points.
    fn is_copy(&self) -> bool {
        let is_divided = self.squares.is_some() || self.overlap.is_some() || self.thin.is_some();
        let is_measured = self.distance.is_some() || self.transform.is_some();
        let is_looked_at = self.above.is_requested() || self.above.noise().is_some();
        !(is_divided || is_measured || is_looked_at)
    }

    /// The reprojection to the target CRS, if there is one.
    pub(super) fn reprojection(&self, info: &CloudInfo) -> Result<Option<CloudReprojection>> {
        let Some(transform) = &self.transform else { return Ok(None) };
        let corners = info.bounds.map(|ends| ends.map(|point| info.frame.world(point)));
        let extent = corners.map(|[low, high]| [low[0], low[1], high[0], high[1]]);
        let name = self.input.first().map(|name| path_of(name).into_owned()).unwrap_or_default();
        let operation = transform.operation(&name, &info.crs, extent, &self.resources)?;
        if self.above.heights == Some(HeightsAs::Z) && !operation.keeps_heights() {
            return Err(Error::usage(
                "heights above ground do not support a change of the vertical CRS",
            )
            .remedy("leave out ‹geoid›, or write them to a dimension"));
        }
        CloudReprojection::new(info, operation).map(Some)
    }

    /// Format of the output.
    pub(super) fn target(&self) -> Result<LasOutputFormat> {
        Ok(LasOutputFormat { format: self.format, version: self.version, packing: self.packing()? })
    }

    /// Packing of its files.
    pub(super) fn packing(&self) -> Result<PointPacking> {
        match (&self.squares, &self.split) {
            (Some((_, plain)), _) => {
                Ok(if *plain { PointPacking::Plain } else { PointPacking::Chunks })
            }
            (None, Some(split)) => Ok(split.packing()),
            (None, None) => packing(&self.output),
        }
    }
}

fn packing(path: &Path) -> Result<PointPacking> {
    packing_by_name(path).ok_or_else(|| {
        Error::usage("points are written as .las, .laz, .copc.laz, or text in .csv, .txt or .xyz")
            .in_file(path)
            .remedy("use one of these extensions")
    })
}
