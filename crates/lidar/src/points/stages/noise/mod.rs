//! Classifies noise, before the ground is used.
//!
//! ```text
//! records ── places, by parts of space ── scores, part by part ──[limit of all]── bits ── records again, with the class
//! ```

pub(in crate::points) mod noise_index;
mod partition;

use std::path::Path;
use std::str::FromStr;
use std::sync::Mutex;

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

use super::ground::queries::{is_known_noise, is_there};
use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::grid::surface_model::MetricFrame;
use crate::records::numbered::{self, RecordNumbers};
use crate::records::selection::place;
use crate::records::{EachRecord, PointRecords, RecordAt, RecordFlow, total};
use partition::{NoisePartsBuilder, NoisePoint, NoiseTiles};
use terrane_base::bits::BitSet;
use terrane_base::error::{Error, Result};
use terrane_cloud::{CloudInfo, PointFormat};
use terrane_engine::plan::RunControl;
use terrane_engine::workers;
use terrane_files::{Buckets, lock};
use terrane_ground::noise::{NoiseSpace, Request, ScoreLimit, ScoreSums};

/// Points divided together.
const TOGETHER: usize = 1 << 14;
/// Least bytes for points being divided.
const DIVIDING: u64 = 4 << 20;
/// Bytes of a thread beside its scores.
const THREAD: u64 = 2 << 20;
/// Largest distance from coordinate zero, in steps.
const MAX_STEPS: f64 = 1e18;
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
        "classify noise (class 7), as ‹classify› noise",
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
        let StageContext { work, info, .. } = *around;
        let search = NoiseSearch {
            request: &self.0,
            info,
            format: work.converter.format(),
            flow: work.shares.flow,
            threads: work.shares.threads,
            memory: around.memory(),
            folder: work.folder(),
            keeps_withheld: work.job.cloud.filter.keep_withheld,
            at: work.at,
        };
        search.mark_records(records)
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
        [points / 8 + partition::tables(points) + DIVIDING, THREAD + self.0.bytes(partition::MOST)]
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
/// As [`space`], and cubes smaller than a step.
fn reach(request: &Request, info: &CloudInfo) -> Result<f64> {
    let [x, y, _] = request.reach(&space(info)?.0)?;
    Ok((x as f64 * info.frame.scale[0]).max(y as f64 * info.frame.scale[1]))
}

/// Scale and origin of points in metres, and whether metres are assumed.
///
/// # Errors
/// Coordinates without a unit of length.
fn space(info: &CloudInfo) -> Result<(NoiseSpace, bool)> {
    let metres = MetricFrame::of(&info.crs, &info.frame).map_err(|_| {
        Error::usage("‹classify› noise requires coordinates in a unit of length")
            .remedy("reproject the points with ‹to_crs› first")
    })?;
    let frame = &info.frame;
    let zero = [0, 1, 2].map(|axis| {
        (frame.offset[axis] / frame.scale[axis]).round().clamp(-MAX_STEPS, MAX_STEPS) as i64
    });
    Ok((NoiseSpace { step: metres.step, zero }, metres.is_guess))
}

/// Context of the search for noise.
struct NoiseSearch<'a> {
    request: &'a Request,
    /// Frame and bounds of the records.
    info: &'a CloudInfo,
    format: PointFormat,
    flow: RecordFlow,
    threads: usize,
    /// Bytes for points.
    memory: u64,
    folder: &'a Path,
    /// Whether points marked as withheld are included.
    keeps_withheld: bool,
    at: RunControl<'a>,
}

impl NoiseSearch<'_> {
    /// The records with classified noise.
    ///
    /// # Errors
    /// As for [`reach`].
    fn mark_records<'r>(&self, records: &'r dyn PointRecords) -> Result<NoiseMarks<'r>> {
        let (space, is_guess) = space(self.info)?;
        self.request.reach(&space)?;
        let (numbers, parts) = self.divide(records, &space)?;
        let noise = Mutex::new(BitSet::new(numbers.total as usize));
        let limit = self.judge(&space, &parts, &noise)?;
        drop(parts);
        let noise = noise.into_inner().unwrap_or_default();
        let notes = self.notes_on_noise(&noise, &limit, &space, is_guess);
        let (format, record, class) = (self.format, self.flow.record, self.request.class());
        Ok(NoiseMarks { records, format, record, class, noise, numbers, notes })
    }

    /// Points that are neither noise yet nor withheld, by parts.
    fn divide<'s>(
        &'s self,
        records: &dyn PointRecords,
        space: &'s NoiseSpace,
    ) -> Result<(RecordNumbers, NoiseTiles<'s>)> {
        let points = total(records);
        self.at.progress.begin("places", points);
        let bounds = self.info.bounds.unwrap_or_default();
        let mut builder =
            NoisePartsBuilder::new(space, bounds, points, self.folder, self.memory / 2);
        let mut some = Vec::with_capacity(TOGETHER);
        let numbers = numbered::pass(records, self.flow, self.at, &mut |number, record| {
            if self.is_candidate(record) {
                some.push(NoisePoint::new(place(record), number));
            }
            if some.len() == TOGETHER { builder.add(&mut some) } else { Ok(()) }
        })?;
        builder.add(&mut some)?;
        let parts = builder.finish(self.at)?;
        self.at.progress.end();
        Ok((numbers, parts))
    }

    fn is_candidate(&self, record: &[u8]) -> bool {
        !is_known_noise(self.format, record) && is_there(self.format, self.keeps_withheld, record)
    }

    /// Finds the noise and its threshold.
    fn judge(
        &self,
        space: &NoiseSpace,
        parts: &NoiseTiles<'_>,
        noise: &Mutex<BitSet>,
    ) -> Result<ScoreLimit> {
        let (request, sums) = (self.request, Mutex::new(ScoreSums::default()));
        let stored = Buckets::new(self.folder, BUCKETS as usize, self.memory / 4);
        let local = request.is_local().then(|| request.limit(&ScoreSums::default()));
        self.at.progress.begin("noise", parts.count());
        workers::run(
            self.threads,
            parts.count(),
            self.at.cancel,
            ScoreSums::default,
            |sums, part| {
                let scores = self.scores(space, parts, part)?;
                match &local {
                    Some(limit) => mark_records(noise, limit, &scores),
                    None => {
                        scores.iter().for_each(|scored| sums.add(scored.score));
                        stored.push((part % BUCKETS) as usize, &scores)?;
                    }
                }
                self.at.progress.advance(1);
                Ok(())
            },
            |of_thread| {
                lock(&sums).merge(&of_thread);
                Ok(())
            },
        )?;
        self.at.progress.end();
        let limit = local.unwrap_or_else(|| request.limit(&lock(&sums)));
        for bucket in 0..BUCKETS as usize {
            self.at.cancel.check()?;
            stored.read(bucket, |scores| mark_records(noise, &limit, scores))?;
        }
        Ok(limit)
    }

    /// The scores of the points of a part.
    fn scores(
        &self,
        space: &NoiseSpace,
        parts: &NoiseTiles<'_>,
        part: u64,
    ) -> Result<Vec<NoiseScore>> {
        let (mut points, mut numbers) = (Vec::new(), Vec::new());
        parts.load(part, &mut points, &mut numbers)?;
        let scores = self.request.scores(space, &points, &mut parts.around(part))?;
        let scores = numbers.into_iter().zip(scores);
        Ok(scores.map(|(number, score)| NoiseScore { number, score }).collect())
    }

    /// Notes on the noise, one line each.
    fn notes_on_noise(
        &self,
        noise: &BitSet,
        limit: &ScoreLimit,
        space: &NoiseSpace,
        is_guess: bool,
    ) -> Vec<String> {
        let count: u64 = noise.words().iter().map(|word| u64::from(word.count_ones())).sum();
        let far = match limit {
            ScoreLimit::Few(_) => String::new(),
            ScoreLimit::Far(distance) => {
                format!(", more than {:.3} m from others", distance * space.unit())
            }
        };
        let (class, request) = (self.request.class(), self.request);
        let note = format!("noise: {count} points of class {class} by {request}{far}");
        [note].into_iter().chain(is_guess.then(|| MetricFrame::GUESS.to_owned())).collect()
    }
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
