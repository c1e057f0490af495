//! The manifest of a plan of tiles: the job, and the tiles.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::points::job::TranslateJob;
use crate::points::stages::{AnyStage, StageReach};
use crate::points::tile_subset::CloudKnowledge;
use crate::points::tiled_output::{self, PointTiling, Spans};
use terrane_base::error::{Error, Result};
use terrane_base::limits;
use terrane_cloud::{CloudInfo, CloudOpenOptions, LasVersion, PointFormat};
use terrane_engine::plan;
use terrane_files::{name_of, path_of};

/// Approximate default number of points of a task.
const TASK_POINTS: f64 = (1_u64 << 26) as f64;
/// Most tiles along the side of a task.
const MAX_CUT: u32 = 1 << 10;

/// Tiles to make of a point cloud.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PointTilesPlan {
    pub(super) method: PlannedTranslateJob,
    pub(super) blocks: PointTileBlocks,
    /// Statistics of the whole point cloud.
    #[serde(flatten)]
    pub(super) knowledge: CloudKnowledge,
}

/// The job, with paths that are valid wherever a task runs on this file system.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PlannedTranslateJob {
    input: Vec<String>,
    #[serde(flatten)]
    cloud: CloudOpenOptions,
    format: Option<u8>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    version: Option<LasVersion>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) stages: Vec<AnyStage>,
    pub(super) squares: PointTiling,
    /// True for files that are not compressed.
    is_plain: bool,
}

/// The tiles of the tasks, as found when the plan was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PointTileBlocks {
    /// First and last tile along both axes.
    pub(super) spans: Spans,
    /// Tiles along the side of a task.
    pub(super) cut: u32,
    /// Points that the headers claim.
    pub(super) points: u64,
    crs: String,
}

/// A task: a block by its number, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PointTileTask(pub(super) u32);

impl fmt::Display for PointTileTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "squares-{}", self.0)
    }
}

impl PlannedTranslateJob {
    /// The plan of a job on a cloud, without its output and resources.
    ///
    /// # Errors
    /// Options that need more than the surroundings of a tile.
    pub(super) fn of(job: &TranslateJob, info: &CloudInfo) -> Result<Self> {
        // Named one by one, so that what is new has to be decided on here.
        let TranslateJob {
            input,
            cloud,
            output: _,
            format,
            version,
            stages,
            squares,
            split,
            overwrite: _,
            resources: _,
        } = job;
        if split.is_some() {
            return Err(Error::usage(
                "‹split› is not supported by `plan points` (a value may have points in every task)",
            )
            .remedy("plan without it, then run ‹terrane points› with ‹split› on the tiles"));
        }
        let Some((squares, is_plain)) = *squares else {
            return Err(Error::usage(
                "`plan points` requires ‹tile›: a single file is written by one run",
            )
            .remedy("pass ‹tile›, the side of the tiles"));
        };
        for stage in stages {
            if let StageReach::Cloud { option, reason } = stage.stage().reach(info)? {
                let name = stage.name();
                let [what, with] = match option {
                    Some(option) => [
                        format!(
                            "‹{option}› is not supported by `plan points`, nor is the stage {name}"
                        ),
                        format!("‹{option}›"),
                    ],
                    None => [
                        format!("the stage {name} is not supported by `plan points`"),
                        name.to_owned(),
                    ],
                };
                return Err(Error::usage(format!("{what} ({reason})")).remedy(format!(
                    "plan without it, then run ‹terrane points› with {with} on the tiles"
                )));
            }
        }
        job.surveyed(info)?;
        // What depends on the extent is that of the whole cloud.
        let resolved =
            |stage: &AnyStage| Ok(stage.stage().resolved(info)?.unwrap_or_else(|| stage.clone()));
        Ok(Self {
            input: input.clone(),
            cloud: cloud.clone(),
            format: format.map(PointFormat::number),
            version: *version,
            stages: stages.iter().map(resolved).collect::<Result<_>>()?,
            squares,
            is_plain,
        })
    }

    /// The job, without its output and resources.
    pub(super) fn job(&self) -> Result<TranslateJob> {
        Ok(TranslateJob {
            cloud: self.cloud.clone(),
            format: self.format.map(PointFormat::new).transpose()?,
            version: self.version,
            stages: self.stages.clone(),
            squares: Some((self.squares, self.is_plain)),
            ..TranslateJob::new(self.input.clone(), "")
        })
    }

    /// Uses the files of the opened point cloud as input, if there are any.
    pub(super) fn set_files(&mut self, files: &[String]) -> Result<()> {
        if !files.is_empty() {
            let absolute = files.iter().map(|name| name_of(plan::noted_path(&path_of(name))?));
            self.input = absolute.collect::<Result<_>>()?;
        }
        Ok(())
    }

    /// Extension of the files of tiles.
    pub(super) fn ending(&self) -> &'static str {
        if self.is_plain { "las" } else { "laz" }
    }

    pub(super) fn input(&self) -> &[String] {
        &self.input
    }
}

impl PointTileBlocks {
    /// The tiles of a point cloud, with tasks of `cut` tiles a side or the default.
    ///
    /// # Errors
    /// Too many tiles.
    pub(super) fn of(info: &CloudInfo, squares: &PointTiling, cut: Option<u32>) -> Result<Self> {
        let spans = tiled_output::spans(squares, info)?;
        let count = counts(spans).iter().product::<u64>();
        let fair = (TASK_POINTS * count as f64 / info.count.max(1) as f64).sqrt().round();
        let cut = cut.unwrap_or(fair.clamp(1.0, f64::from(MAX_CUT)) as u32);
        let crs = info.crs.wkt.clone().unwrap_or_else(|| info.crs.label());
        Ok(Self { spans, cut, points: info.count, crs })
    }

    /// Fails if there are no tiles, or too many.
    pub(super) fn check(&self) -> Result<()> {
        if !(1..=MAX_CUT).contains(&self.cut) {
            return Err(Error::usage(format!("‹task_size› {} is out of range", self.cut))
                .remedy(format!("pass 1 to {MAX_CUT}")));
        }
        if self.spans.iter().any(|[first, last]| first > last) {
            return Err(Error::bad_input("it has no tiles"));
        }
        limits::check("number of tasks", self.count(), plan::MAX_TASKS)
    }

    /// Columns and rows of tiles.
    pub(super) fn counts(&self) -> [u64; 2] {
        counts(self.spans)
    }

    /// Columns and rows of tasks.
    fn tasks(&self) -> [u64; 2] {
        self.counts().map(|count| count.div_ceil(u64::from(self.cut.max(1))))
    }

    /// Number of tasks.
    fn count(&self) -> u64 {
        self.tasks().iter().product()
    }

    /// All tasks, row by row.
    pub(super) fn all(&self) -> impl Iterator<Item = PointTileTask> + use<> {
        (0..self.count() as u32).map(PointTileTask)
    }

    /// The tiles of a task.
    pub(super) fn of_task(&self, PointTileTask(block): PointTileTask) -> Spans {
        let across = self.tasks()[0] as u32;
        let place = [block % across, block / across];
        [0, 1].map(|axis| {
            let [first, last] = self.spans[axis];
            let low = first + i64::from(place[axis]) * i64::from(self.cut);
            [low, (low + i64::from(self.cut) - 1).min(last)]
        })
    }

    /// Number of tiles.
    pub(super) fn size(spans: Spans) -> u64 {
        counts(spans).iter().product()
    }
}

fn counts(spans: Spans) -> [u64; 2] {
    spans.map(|[first, last]| (last - first).unsigned_abs() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_have_each_square_once() {
        for (spans, cut) in [([[0, 0], [0, 0]], 1), ([[-3, 4], [7, 9]], 3), ([[5, 9], [-1, 5]], 2)]
        {
            let blocks = PointTileBlocks { spans, cut, points: 1, crs: String::new() };
            let [x, y] = spans;
            let mut seen = std::collections::BTreeSet::new();
            for block in blocks.all() {
                let [[west, east], [south, north]] = blocks.of_task(block);
                for at in (south..=north).flat_map(|row| (west..=east).map(move |col| (col, row))) {
                    assert!(seen.insert(at), "{at:?} twice");
                }
            }
            let all = (y[0]..=y[1]).flat_map(|row| (x[0]..=x[1]).map(move |col| (col, row)));
            assert!(seen.into_iter().eq(all.collect::<std::collections::BTreeSet<_>>()));
        }
    }
}
