//! Stages of a job on points. Each is one file with its options, memory and reach.

mod assign;
mod dedupe;
pub(super) mod ground;
mod lookup;
mod neighborhoods;
pub(super) mod noise;
mod normals;
mod operand;
mod overlap;
mod overlay;
mod poisson;
mod reproject;
mod sample_grid;
mod sort;
mod thin;
mod tree_tops;
mod trees;
mod r#where;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::context::TranslateContext;
use crate::records::selection::{ChosenRecords, RecordRanking};
use crate::records::{PointRecords, total};
use terrane_base::error::{Error, Result};
use terrane_cloud::write::{PointColumn, PointPacking};
use terrane_cloud::{CloudInfo, NewDimension, PointFormat};
use terrane_engine::transform::Transformed;

pub(super) use ground::queries::refuse_twice;
pub use ground::{Classify, HeightClasses, HeightsAs, Reclassify};
pub(super) use kinds::*;
pub(super) use operand::column;
pub use overlay::OverlayValue;
pub use sample_grid::SampledBands;
pub use thin::{KEPT, ThinningRule};

/// Most stages of a chain: records pass through all of them at once.
const MAX_STAGES: usize = 64;

/// How far around a point a stage has to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StageReach {
    /// At the points within this distance in x and y, in world units.
    Within(f64),
    /// At statistics of the whole point cloud, which a plan computes once.
    Statistics,
    /// Anywhere.
    Cloud {
        /// The option that stands for the stage, if any.
        option: Option<&'static str>,
        /// Why plans do not support it.
        reason: &'static str,
    },
}

/// What a stage does to the set of points. Ground is searched among more points than those that are written, unless a
/// stage before has selected some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PointSetEffect {
    /// Points stay where they are; their attributes may change.
    Unchanged,
    /// Only their order changes.
    Reorders,
    /// Duplicates are dropped and nothing else.
    DropsDuplicates,
    /// Points are dropped or moved.
    Selects,
}

/// A step of a job on points.
pub(super) trait Stage {
    /// What it does to the set of points.
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Unchanged
    }

    /// How far around a point it has to look.
    ///
    /// # Errors
    /// Distances without a unit of length.
    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Within(0.0))
    }

    /// Whether it compares or changes positions. Without such stages, coordinates may lie anywhere.
    fn is_spatial(&self) -> bool {
        true
    }

    /// Whether z becomes a height above ground.
    fn replaces_z(&self) -> bool {
        false
    }

    /// Bytes of memory for `points` of a point cloud, and for each thread.
    fn needed(&self, _info: &CloudInfo, _points: u64) -> [u64; 2] {
        [0; 2]
    }

    /// The dimensions that it adds to the records.
    fn dimensions(&self) -> Vec<NewDimension> {
        Vec::new()
    }

    /// The stage as a plan records it, if it is another: with the defaults that it takes from the whole point cloud, and
    /// absolute paths.
    ///
    /// # Errors
    /// Paths that cannot be made absolute.
    fn resolved(&self, _: &CloudInfo) -> Result<Option<AnyStage>> {
        Ok(None)
    }

    /// The files that it reads.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    /// The stage for records of an input.
    ///
    /// # Errors
    /// Options that the records do not support.
    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>>;
}

/// The records that a stage gets.
#[derive(Clone, Copy)]
pub(super) struct StageInput<'a> {
    /// Frame, bounds and CRS.
    pub(super) info: &'a CloudInfo,
    pub(super) format: PointFormat,
    /// Their columns except the coordinates.
    pub(super) columns: &'a [PointColumn],
    /// The same, and those of dimensions that the stage adds.
    pub(super) added: &'a [PointColumn],
    /// Whether a dimension of this name is added to the records.
    pub(super) is_new: &'a dyn Fn(&str) -> bool,
    /// How the output is packed.
    pub(super) packing: PointPacking,
    pub(super) job: &'a super::TranslateJob,
    /// Whether no stage follows.
    pub(super) is_last: bool,
    /// Whether z is a height above ground.
    pub(super) is_above_ground: bool,
    /// Step of the heights of added dimensions.
    pub(super) height_step: f64,
}

/// A stage whose options are checked.
pub(super) trait OpenStage: Send + Sync {
    /// Frame, bounds and CRS of its output, if not those of its input.
    fn output(&self) -> Option<CloudInfo> {
        None
    }

    /// Bytes that it holds beside those of [`Stage::needed`].
    fn bytes(&self) -> u64 {
        0
    }

    /// The report on a reprojection.
    fn transformed(&self) -> Option<Transformed> {
        None
    }

    /// The records that it makes of others.
    ///
    /// # Errors
    /// Records that cannot be read; values that do not fit.
    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>>;
}

/// The records that a stage makes, and notes, one line each.
pub(super) struct StageOutput<'r> {
    pub(super) records: Box<dyn PointRecords + 'r>,
    pub(super) notes: Vec<String>,
}

impl<'r> StageOutput<'r> {
    /// Without notes.
    pub(super) fn new(records: impl PointRecords + 'r) -> Self {
        Self { records: Box::new(records), notes: Vec::new() }
    }
}

/// A run, and the stages before one of a chain.
#[derive(Clone, Copy)]
pub(super) struct StageContext<'a> {
    pub(super) work: &'a TranslateContext<'a>,
    /// Frame, bounds and CRS of the records.
    pub(super) info: &'a CloudInfo,
    /// The stages before it.
    pub(super) before: &'a [ChainLink],
}

/// A stage of a chain.
pub(super) struct ChainLink {
    stage: Box<dyn OpenStage>,
    /// Frame, bounds and CRS of its input.
    info: CloudInfo,
    effect: PointSetEffect,
}

/// Stages, each for the output of the one before.
pub(super) struct StageChain {
    links: Vec<ChainLink>,
    /// Frame, bounds and CRS of the last output.
    pub(super) output: CloudInfo,
}

impl StageChain {
    /// The chain of some stages.
    ///
    /// # Errors
    /// As [`Stage::open`]; too many stages.
    pub(super) fn open(stages: &[AnyStage], input: StageInput<'_>) -> Result<Self> {
        if stages.len() > MAX_STAGES {
            return Err(Error::usage(format!(
                "{} stages exceed the limit of {MAX_STAGES}",
                stages.len()
            ))
            .remedy("run some of them, and the others on the output"));
        }
        let mut chain = Self { links: Vec::new(), output: input.info.clone() };
        let (mut is_above_ground, height_step) = (false, input.info.frame.scale[2]);
        for (number, stage) in stages.iter().map(AnyStage::stage).enumerate() {
            // A dimension has no values before the stage that adds it.
            let added = |stages: &[AnyStage]| {
                let all = stages.iter().flat_map(|stage| stage.stage().dimensions());
                let names = all.map(|dimension| dimension.name);
                names.filter(|name| (input.is_new)(name)).collect::<Vec<_>>()
            };
            let columns_before = |number: usize| {
                let (earlier, later) = (added(&stages[..number]), added(&stages[number..]));
                let has_values = |column: &&PointColumn| {
                    let is_of = |names: &[String]| {
                        names.iter().any(|name| name.eq_ignore_ascii_case(column.name()))
                    };
                    is_of(&earlier) || !is_of(&later)
                };
                input.columns.iter().filter(has_values).cloned().collect::<Vec<_>>()
            };
            let (columns, with_own) = (columns_before(number), columns_before(number + 1));
            let info = &chain.output;
            let is_last = number + 1 == stages.len();
            let opened = stage.open(&StageInput {
                info,
                columns: &columns,
                added: &with_own,
                is_last,
                is_above_ground,
                height_step,
                ..input
            })?;
            is_above_ground |= stage.replaces_z();
            let output = opened.output().unwrap_or_else(|| chain.output.clone());
            let info = std::mem::replace(&mut chain.output, output);
            chain.links.push(ChainLink { stage: opened, info, effect: stage.effect() });
        }
        Ok(chain)
    }

    /// Frame, bounds and CRS of the input of a stage.
    pub(super) fn input(&self, number: usize) -> &CloudInfo {
        &self.links[number].info
    }

    /// Bytes that the stages hold.
    pub(super) fn bytes(&self) -> u64 {
        self.links.iter().map(|link| link.stage.bytes()).sum()
    }

    /// The report on its last reprojection.
    pub(super) fn transformed(&self) -> Option<Transformed> {
        self.links.iter().rev().find_map(|link| link.stage.transformed())
    }

    /// Passes records through all stages, and the result to `act`; notes are added.
    ///
    /// # Errors
    /// Those of the stages and of `act`.
    pub(super) fn run<T>(
        &self,
        records: &dyn PointRecords,
        work: &TranslateContext<'_>,
        notes: &mut Vec<String>,
        act: impl FnOnce(&dyn PointRecords) -> Result<T>,
    ) -> Result<T> {
        run(&self.links, 0, |_| true, records, work, notes, act)
    }

    /// The context of a stage by its number.
    pub(super) fn context<'a>(
        &'a self,
        number: usize,
        work: &'a TranslateContext<'a>,
    ) -> StageContext<'a> {
        StageContext { work, info: &self.links[number].info, before: &self.links[..number] }
    }
}

/// Passes records through the stages from number `next` on whose effect is wanted.
fn run<T>(
    links: &[ChainLink],
    next: usize,
    is_wanted: fn(PointSetEffect) -> bool,
    records: &dyn PointRecords,
    work: &TranslateContext<'_>,
    notes: &mut Vec<String>,
    act: impl FnOnce(&dyn PointRecords) -> Result<T>,
) -> Result<T> {
    let Some(ChainLink { stage, info, effect }) = links.get(next) else { return act(records) };
    if !is_wanted(*effect) {
        return run(links, next + 1, is_wanted, records, work, notes, act);
    }
    let made = stage.apply(records, &StageContext { work, info, before: &links[..next] })?;
    notes.extend(made.notes);
    run(links, next + 1, is_wanted, &*made.records, work, notes, act)
}

impl StageContext<'_> {
    /// Bytes of memory for this stage.
    pub(super) fn memory(&self) -> u64 {
        self.work.shares.of_stage(self.before.len())
    }

    /// Whether a stage before this one has selected points.
    pub(super) fn is_selected(&self) -> bool {
        self.before.iter().any(|link| link.effect == PointSetEffect::Selects)
    }

    /// Passes other records through the stages before this one whose effect is wanted.
    ///
    /// # Errors
    /// As [`StageChain::run`].
    pub(super) fn run_before<T>(
        &self,
        is_wanted: fn(PointSetEffect) -> bool,
        records: &dyn PointRecords,
        act: impl FnOnce(&dyn PointRecords) -> Result<T>,
    ) -> Result<T> {
        run(self.before, 0, is_wanted, records, self.work, &mut Vec::new(), act)
    }

    /// The best record of each group.
    pub(super) fn select<'r>(
        &self,
        records: &'r dyn PointRecords,
        choice: &dyn RecordRanking,
        progress: &str,
    ) -> Result<ChosenRecords<'r>> {
        let TranslateContext { at, shares, .. } = self.work;
        at.progress.begin(progress, total(records));
        let (flow, memory) = (shares.flow, self.memory());
        let chosen = ChosenRecords::new(records, choice, flow, memory, self.work.folder(), *at)?;
        at.progress.end();
        Ok(chosen)
    }
}

/// A name of stages.
pub struct StageName {
    /// The name.
    pub name: &'static str,
    /// Syntax of its arguments, which follow after a colon.
    pub arguments: &'static str,
    /// What the stage does.
    pub about: &'static str,
    parse: fn(&str) -> std::result::Result<AnyStage, String>,
}

impl StageName {
    const fn of<S: FromStr + Into<AnyStage>>(
        name: &'static str,
        arguments: &'static str,
        about: &'static str,
    ) -> Self
    where
        S::Err: fmt::Display,
    {
        Self { name, arguments, about, parse: parse::<S> }
    }
}

fn parse<S>(arguments: &str) -> std::result::Result<AnyStage, String>
where
    S: FromStr + Into<AnyStage>,
    S::Err: fmt::Display,
{
    arguments.parse::<S>().map(Into::into).map_err(|error| error.to_string())
}

/// The kinds of stages: their files and types, each of which has its `NAMES`.
macro_rules! stages {
    ($($file:ident::$kind:ident),* $(,)?) => {
        /// The types of stages.
        pub(in crate::points) mod kinds {
            $(pub use super::$file::$kind;)*
        }

        /// A stage of any kind.
        #[allow(missing_docs)]
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum AnyStage {
            $($kind($kind),)*
        }

        $(impl From<$kind> for AnyStage {
            fn from(stage: $kind) -> Self {
                Self::$kind(stage)
            }
        })*

        impl AnyStage {
            /// The first name of its kind.
            pub(super) fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $kind::NAMES[0].name,)*
                }
            }

            pub(super) fn stage(&self) -> &dyn Stage {
                match self {
                    $(Self::$kind(stage) => stage,)*
                }
            }
        }

        /// The names of all kinds.
        const NAMES: &[&[StageName]] = &[$(&$kind::NAMES,)*];
    };
}

stages![
    dedupe::Dedupe,
    noise::ClassifyNoise,
    ground::HeightQuery,
    assign::Assign,
    assign::AddDimension,
    overlay::Overlay,
    sample_grid::SampleGrid,
    r#where::Where,
    overlap::Overlap,
    thin::CellThinning,
    poisson::PoissonSampling,
    tree_tops::TreeTops,
    trees::Trees,
    normals::Normals,
    reproject::Reproject,
    sort::Sort,
];

/// All stages, by name.
pub fn stage_names() -> impl Iterator<Item = &'static StageName> + Clone {
    NAMES.iter().copied().flatten()
}

/// A stage as written: its name, then its arguments after a colon.
#[derive(Clone, Debug, PartialEq)]
pub struct StageText {
    text: String,
    stage: AnyStage,
}

impl StageText {
    /// The stage.
    pub fn stage(&self) -> &AnyStage {
        &self.stage
    }
}

impl FromStr for StageText {
    type Err = String;

    /// "dedupe", "thin:2.5:lowest", "where:classification = 2".
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, arguments) = text.split_once(':').unwrap_or((text, ""));
        let known = stage_names().find(|known| known.name == name.trim()).ok_or_else(|| {
            let names: Vec<_> = stage_names().map(|known| known.name).collect();
            format!("expected one of {}, not {name}", names.join(", "))
        })?;
        let stage = (known.parse)(arguments.trim()).map_err(|what| format!("{name}: {what}"))?;
        Ok(Self { text: text.to_owned(), stage })
    }
}

impl fmt::Display for StageText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
