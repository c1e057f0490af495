//! Heights and classes from the ground, as a stage.

use super::input::height_dimension;
use super::{Classify, HeightClasses, HeightQuery, HeightsAs, Reclassify};
use crate::grid::GroundFrom;
use crate::points::stages::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::records::PointRecords;
use terrane_base::error::{Error, Result};
use terrane_cloud::{CloudInfo, NewDimension};
use terrane_options::Choice;

/// Before the classes that may become ground.
const RECLASSIFY: &str = "reclassify=";

impl HeightQuery {
    pub(in crate::points::stages) const NAMES: [StageName; 3] = [
        StageName {
            name: "ground",
            arguments: "[METHOD][:reclassify=CLASS,...]",
            about: "classify ground (class 2) by a method, such as csf:cloth=0.5",
            parse: |text| Self::of_ground(text).map(Into::into),
        },
        StageName {
            name: "height-above-ground",
            arguments: "[dimension|z]",
            about: "height above the triangulated ground points, as a dimension or as z",
            parse: |text| {
                let text = if text.is_empty() { HeightsAs::Dimension.name() } else { text };
                let heights = Some(HeightsAs::named(text)?);
                Ok(Self { heights, from: GroundFrom::Class, classify: Vec::new() }.into())
            },
        },
        StageName {
            name: "height-classes",
            arguments: "[CLASS=FROM,...]",
            about: "classify points of class 0 and 1 by height above ground",
            parse: |text| {
                let classes = match text {
                    "" => HeightClasses::default(),
                    _ => text.parse()?,
                };
                let classify = vec![Classify::Height(classes)];
                Ok(Self { from: GroundFrom::Class, heights: None, classify }.into())
            },
        },
    ];

    /// "", "csf:cloth=0.5", "csf:reclassify=9,17", "reclassify=9".
    fn of_ground(text: &str) -> std::result::Result<Self, String> {
        let (method, classes) = match text.find(RECLASSIFY) {
            Some(at) => (text[..at].trim_end_matches(':'), text[at..].parse()?),
            None => (text, Reclassify::default()),
        };
        let from = match method {
            "" => GroundFrom::Auto,
            _ => method.parse().map_err(|error: Error| error.to_string())?,
        };
        Ok(Self { from, heights: None, classify: vec![Classify::Ground(classes)] })
    }
}

impl Stage for HeightQuery {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Statistics)
    }

    fn replaces_z(&self) -> bool {
        self.heights == Some(HeightsAs::Z)
    }

    fn needed(&self, info: &CloudInfo, _: u64) -> [u64; 2] {
        Self::needed(self, info)
    }

    fn dimensions(&self) -> Vec<NewDimension> {
        let is_dimension = self.heights == Some(HeightsAs::Dimension);
        is_dimension.then(height_dimension).into_iter().collect()
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        self.check(input.format)?;
        let is_dimension = self.heights == Some(HeightsAs::Dimension);
        if is_dimension && input.info.frame.scale[2] != input.height_step {
            let (needed, scale) = (input.height_step, input.info.frame.scale[2]);
            return Err(Error::usage(format!(
                "‹height_above_ground› as a dimension requires the z scale of the input ({needed}); a stage before changed it to {scale}"
            ))
            .remedy("put it before the stage that reprojects, or pass z"));
        }
        Ok(Box::new(GroundStage { query: self.clone(), output: self.info(input.info) }))
    }
}

/// A query for records of one format.
struct GroundStage {
    query: HeightQuery,
    output: CloudInfo,
}

impl OpenStage for GroundStage {
    fn output(&self) -> Option<CloudInfo> {
        Some(self.output.clone())
    }

    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        self.query.annotate(records, around)
    }
}
