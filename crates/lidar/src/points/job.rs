//! A points-to-points job, and its checks before any point is read.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::split::AttributeSplit;
use super::stages::ground::GroundInput;
use super::stages::{
    AnyStage, Classify, ClassifyNoise, HeightQuery, PointSetEffect, Stage, StageReach,
};
use super::tiled_output::PointTiling;
use terrane_base::error::{Error, Result};
use terrane_cloud::write::{PointPacking, packing_by_name};
use terrane_cloud::{
    CloudFilter, CloudInfo, CloudOpenOptions, LasOutputFormat, LasVersion, NewDimension,
    PointCloud, PointFormat,
};
use terrane_engine::Resources;

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
    /// What is done with the points, in order.
    pub stages: Vec<AnyStage>,
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
            stages: Vec::new(),
            squares: None,
            split: None,
            overwrite: false,
            resources: Resources::default(),
        }
    }

    /// The job with one more stage. Heights right after ground are found with it, in the same passes.
    #[must_use]
    pub fn stage(mut self, stage: impl Into<AnyStage>) -> Self {
        let stage = stage.into();
        if let (Some(AnyStage::HeightQuery(ground)), AnyStage::HeightQuery(next)) =
            (self.stages.last_mut(), &stage)
            && let Some(joined) = ground.joined(next)
        {
            *ground = joined;
            return self;
        }
        self.stages.push(stage);
        self
    }

    /// The job with some more stages.
    #[must_use]
    pub fn stages<S: Into<AnyStage>>(self, stages: impl IntoIterator<Item = S>) -> Self {
        stages.into_iter().fold(self, Self::stage)
    }

    /// The job with stages for a query: noise is classified first.
    #[must_use]
    pub fn classify(mut self, mut query: HeightQuery) -> Self {
        query.classify.retain(|step| match step {
            Classify::Noise(request) => {
                self.stages.push(ClassifyNoise(*request).into());
                false
            }
            Classify::Ground(_) | Classify::Height(_) => true,
        });
        let has_query = query != HeightQuery::default();
        self.stages(has_query.then_some(query))
    }
}

/// Least memory for records that are divided into columns or tiles.
const SPREAD: u64 = 32 << 20;

impl TranslateJob {
    /// Opens the point cloud.
    pub(super) fn open(&self) -> Result<PointCloud> {
        terrane_cloud::open(&self.input, &self.reading())
    }

    /// Largest distance of points that a result depends on.
    ///
    /// # Errors
    /// Those of stages.
    pub(super) fn reach(&self, info: &CloudInfo) -> Result<f64> {
        self.stages.iter().try_fold(0.0, |sum, stage| match stage.stage().reach(info)? {
            StageReach::Within(distance) => Ok(sum + distance),
            StageReach::Statistics | StageReach::Cloud { .. } => Ok(sum),
        })
    }

    /// Bytes of memory beside records in flight, for `points` read of a point cloud or a part of it. `info` tells of
    /// the input of each stage.
    pub(super) fn needed<'i>(
        &self,
        packing: PointPacking,
        info: impl Fn(usize) -> &'i CloudInfo,
        points: u64,
        is_part: bool,
    ) -> StageNeeds {
        let is_spread =
            packing == PointPacking::Nodes || self.squares.is_some() || self.split.is_some();
        let mut needed = StageNeeds {
            output: if is_spread { SPREAD } else { 0 },
            held: 0,
            stages: Vec::with_capacity(self.stages.len()),
            thread: 0,
        };
        let ground =
            self.stages.iter().rposition(|stage| matches!(stage, AnyStage::HeightQuery(_)));
        // Of a part, or of some classes.
        let is_wide = is_part || GroundInput::is_filtered(&self.cloud.filter);
        let is_again = |number: usize, stage: &dyn Stage| {
            let before = ground.map(|at| &self.stages[..at]).unwrap_or_default();
            let is_passed = number < before.len()
                && !before.iter().any(|stage| stage.stage().effect() == PointSetEffect::Selects);
            is_wide && is_passed && (is_part || stage.effect() == PointSetEffect::Unchanged)
        };
        for (number, stage) in self.stages.iter().map(AnyStage::stage).enumerate() {
            let info = info(number);
            let [all, each] = stage.needed(info, points);
            // The points that the ground may come from pass it as well.
            let again = match is_again(number, stage) {
                true => stage.needed(info, info.count)[0],
                false => 0,
            };
            needed.stages.push(all + again);
            needed.thread = needed.thread.max(each);
        }
        needed
    }

    /// The stages whose statistics of the whole cloud a plan records.
    ///
    /// # Errors
    /// Other stages before them, whose results would have to be known.
    pub(super) fn surveyed(&self, info: &CloudInfo) -> Result<SurveyedStages<'_>> {
        let mut last = None;
        for (number, stage) in self.stages.iter().enumerate() {
            if stage.stage().reach(info)? == StageReach::Statistics {
                last = Some(number);
            }
        }
        let mut found = SurveyedStages::default();
        for (number, stage) in self.stages[..last.map_or(0, |last| last + 1)].iter().enumerate() {
            let SurveyedStages { dedupe, noise, ground } = &mut found;
            match stage {
                AnyStage::Dedupe(_) if number == 0 => *dedupe = Some(number),
                AnyStage::ClassifyNoise(stage) if noise.is_none() && ground.is_none() => {
                    *noise = Some((number, stage));
                }
                AnyStage::HeightQuery(query) if ground.is_none() => {
                    *ground = Some((number, query));
                }
                _ => return Err(not_first()),
            }
        }
        Ok(found)
    }

    /// Reading options: points marked as withheld are read.
    pub(super) fn reading(&self) -> CloudOpenOptions {
        let filter = CloudFilter { keep_withheld: true, ..self.cloud.filter.clone() };
        CloudOpenOptions { filter, any_extent: self.is_copy(), ..self.cloud.clone() }
    }

    /// Whether no step depends on the positions of several points.
    fn is_copy(&self) -> bool {
        self.squares.is_none() && !self.stages.iter().any(|stage| stage.stage().is_spatial())
    }

    /// The dimensions that stages add to the records. Stages that name the same dimension share it; the type is that of a
    /// stage that replaces it.
    pub(super) fn dimensions(&self) -> Vec<NewDimension> {
        let all = self.stages.iter().flat_map(|stage| stage.stage().dimensions());
        let (kept, mut new): (Vec<_>, Vec<_>) = all.partition(|dimension| dimension.is_kept);
        new.extend(kept);
        let mut names = HashSet::new();
        new.retain(|dimension| names.insert(dimension.name.to_ascii_lowercase()));
        new
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

/// Bytes of memory beside records in flight.
#[derive(Debug, PartialEq)]
pub(super) struct StageNeeds {
    /// For each stage, as long as the work takes.
    pub(super) stages: Vec<u64>,
    /// For the output.
    pub(super) output: u64,
    /// For the files that stages read.
    pub(super) held: u64,
    /// For each thread.
    pub(super) thread: u64,
}

impl StageNeeds {
    /// All but those of threads.
    pub(super) fn total(&self) -> u64 {
        self.output + self.held + self.stages.iter().sum::<u64>()
    }

    /// The part of a stage of `all` bytes: what no other stage and no output needs.
    pub(super) fn share(&self, number: usize, all: u64) -> u64 {
        all - (self.total() - self.stages[number])
    }
}

/// The stages whose statistics of the whole cloud a plan records, each with its place in the chain.
#[derive(Default)]
pub(super) struct SurveyedStages<'a> {
    pub(super) dedupe: Option<usize>,
    pub(super) noise: Option<(usize, &'a ClassifyNoise)>,
    pub(super) ground: Option<(usize, &'a HeightQuery)>,
}

impl SurveyedStages<'_> {
    /// Whether no statistics are needed.
    pub(super) fn is_empty(&self) -> bool {
        self.noise.is_none() && self.ground.is_none()
    }
}

fn not_first() -> Error {
    Error::usage(
        "`plan points` supports one search for noise and one for ground, before all other stages but ‹dedupe›",
    )
    .remedy("plan without the others, then run ‹terrane points› with them on the tiles")
}

fn packing(path: &Path) -> Result<PointPacking> {
    packing_by_name(path).ok_or_else(|| {
        Error::usage("points are written as .las, .laz, .copc.laz, or text in .csv, .txt or .xyz")
            .in_file(path)
            .remedy("use one of these extensions")
    })
}
