//! Classifies noise, before the ground is used.
//!
//! ```text
//! records ── places, by parts of space ── scores, part by part ──[limit of all]── bits ── records again, with the class
//! ```

pub(in crate::points) mod noise_index;

use std::str::FromStr;
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use super::ground::queries::{is_known_noise, is_there};
use super::neighborhoods::{self, Neighborhood, Neighborhoods, metric_space};
use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::grid::surface_model::MetricFrame;
use crate::records::numbered::RecordNumbers;
use crate::records::{EachRecord, PointRecords, RecordAt};
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, Result};
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_files::{Buckets, lock, unlocked};
use terrane_ground::neighbors::MetricSpace;
use terrane_ground::noise::{Request, ScoreLimit, ScoreSums};

/// The stage in messages.
const STAGE: &str = "‹classify› noise";
/// Buckets of scores.
const BUCKETS: u64 = 64;

/// A score and the number of its record.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct NoiseScore {
    number: u64,
    score: u64,
}

/// Gives noise found by a method its class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ClassifyNoise(pub Request);

impl TryFrom<String> for ClassifyNoise {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<ClassifyNoise> for String {
    fn from(stage: ClassifyNoise) -> Self {
        stage.0.to_string()
    }
}

impl FromStr for ClassifyNoise {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text.is_empty() { Ok(Self(Request::DEFAULT)) } else { Request::parse(text).map(Self) }
    }
}

impl ClassifyNoise {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "noise",
        "[METHOD]",
        "classify noise (class 7) by a method, such as statistical:k=12",
    )];

    /// The records with classified noise.
    ///
    /// # Errors
    /// As [`reach`].
    pub(in crate::points) fn mark<'r>(
        &self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<NoiseMarks<'r>> {
        let (request, work) = (&self.0, around.work);
        let (space, is_guess) = metric_space(around.info, STAGE)?;
        request.reach(&space)?;
        let (format, keeps_withheld) =
            (work.converter.format(), work.job.cloud.filter.keep_withheld);
        let memory = around.memory() / 2;
        let points = Neighborhoods::new(records, &space, around, memory, |record| {
            !is_known_noise(format, record) && is_there(format, keeps_withheld, record)
        })?;
        let (noise, limit) = judge(request, &space, &points, around)?;
        let notes = notes_on_noise(request, &noise, &limit, &space, is_guess);
        let (record, class, numbers) = (work.shares.flow.record, request.class(), points.numbers);
        Ok(NoiseMarks { records, format, record, class, noise, numbers, notes })
    }
}

impl Stage for ClassifyNoise {
    fn reach(&self, info: &CloudInfo) -> Result<StageReach> {
        match self.0.is_local() {
            true => reach(&self.0, info).map(StageReach::Within),
            false => Ok(StageReach::Statistics),
        }
    }

    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Unchanged
    }

    fn needed(&self, _: &CloudInfo, points: u64) -> [u64; 2] {
        let [all, each] = neighborhoods::needed(points, |most| self.0.bytes(most));
        [points / 8 + all, each]
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        reach(&self.0, input.info)?;
        Ok(Box::new(self.clone()))
    }
}

impl OpenStage for ClassifyNoise {
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let mut marks = self.mark(records, around)?;
        let notes = std::mem::take(&mut marks.notes);
        Ok(StageOutput { records: Box::new(marks.records()), notes })
    }
}

/// Distance in world units along x or y beyond which points do not matter; 0 if all may.
///
/// # Errors
/// Coordinates without a unit of length; cubes smaller than a step.
fn reach(request: &Request, info: &CloudInfo) -> Result<f64> {
    let [x, y, _] = request.reach(&metric_space(info, STAGE)?.0)?;
    Ok((x as f64 * info.frame.scale[0]).max(y as f64 * info.frame.scale[1]))
}

/// Finds the noise among points, and its threshold.
fn judge(
    request: &Request,
    space: &MetricSpace,
    points: &Neighborhoods<'_>,
    around: &StageContext<'_>,
) -> Result<(BitSet, ScoreLimit)> {
    let noise = Mutex::new(BitSet::new(points.numbers.total as usize));
    let sums = Mutex::new(ScoreSums::default());
    let stored = Buckets::new(around.work.folder(), BUCKETS as usize, around.memory() / 4);
    let local = request.is_local().then(|| request.limit(&ScoreSums::default()));
    let act = |sums: &mut ScoreSums, mut near: Neighborhood<'_>| {
        let scores = request.scores(space, &near.points, &mut near.around)?;
        let scores = near.numbers.iter().zip(scores);
        let scores: Vec<_> =
            scores.map(|(number, score)| NoiseScore { number: *number, score }).collect();
        match &local {
            Some(limit) => mark_records(&noise, limit, &scores),
            None => {
                scores.iter().for_each(|scored| sums.add(scored.score));
                stored.push((near.part % BUCKETS) as usize, &scores)?;
            }
        }
        Ok(())
    };
    points.each("noise", act, |of_thread| {
        lock(&sums).merge(&of_thread);
        Ok(())
    })?;
    let limit = local.unwrap_or_else(|| request.limit(&lock(&sums)));
    for bucket in 0..BUCKETS as usize {
        around.work.at.cancel.check()?;
        stored.read(bucket, |scores| mark_records(&noise, &limit, scores))?;
    }
    Ok((unlocked(noise), limit))
}

/// Notes on the noise, one line each.
fn notes_on_noise(
    request: &Request,
    noise: &BitSet,
    limit: &ScoreLimit,
    space: &MetricSpace,
    is_guess: bool,
) -> Vec<String> {
    let count: u64 = noise.words().iter().map(|word| u64::from(word.count_ones())).sum();
    let far = match limit {
        ScoreLimit::Few(_) => String::new(),
        ScoreLimit::Far(distance) => {
            format!(", more than {:.3} m from others", distance * space.unit())
        }
    };
    let note = format!("noise: {count} points of class {} by {request}{far}", request.class());
    [note].into_iter().chain(is_guess.then(|| MetricFrame::GUESS.to_owned())).collect()
}

/// Marks noise.
fn mark_records(noise: &Mutex<BitSet>, limit: &ScoreLimit, scores: &[NoiseScore]) {
    let mut noise = lock(noise);
    for scored in scores.iter().filter(|scored| limit.is_noise(scored.score)) {
        noise.insert(scored.number as usize);
    }
}

/// The noise among records.
pub(in crate::points) struct NoiseMarks<'a> {
    records: &'a dyn PointRecords,
    format: PointFormat,
    record: usize,
    class: u8,
    noise: BitSet,
    numbers: RecordNumbers,
    pub(in crate::points) notes: Vec<String>,
}

impl<'a> NoiseMarks<'a> {
    /// The records with classified noise.
    pub(in crate::points) fn records(self) -> impl PointRecords + 'a {
        let Self { records, format, record, class, noise, numbers, .. } = self;
        let each = move |at: RecordAt, record: &mut [u8], (): &mut ()| {
            if noise.contains(at.number as usize) {
                format.set_class(record, class);
            }
            Ok(true)
        };
        EachRecord::new(records, record, each).numbered(numbers)
    }
}
