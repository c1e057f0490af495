//! Reprojects points; later stages use the new CRS.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{
    OpenStage, PointSetEffect, Stage, StageContext, StageInput, StageName, StageOutput, StageReach,
};
use crate::records::selection::place;
use crate::records::{EachRecord, PointRecords};
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point, PointFrame, REACH};
use terrane_cloud::CloudInfo;
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::{TargetCrs, Transformed};
use terrane_files::path_of;

/// Approximate metres of a degree.
const DEGREE: f64 = 111_320.0;
/// Positions along a side of the point cloud, transformed to estimate its bounds.
const PLACES: u32 = 32;
/// Margin of these bounds, as a fraction of the size.
const MARGIN: f64 = 0.01;

/// Reprojects to a CRS.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reproject(pub TargetCrs);

impl FromStr for Reproject {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        if text.is_empty() { Err("expected a CRS") } else { Ok(Self(TargetCrs::to(text))) }
    }
}

impl Reproject {
    pub(super) const NAMES: [StageName; 1] = [StageName::of::<Self>(
        "reproject",
        "CRS",
        "transform coordinates to a CRS: a code such as EPSG:32632, a compound code, or WKT",
    )];
}

impl Stage for Reproject {
    fn effect(&self) -> PointSetEffect {
        PointSetEffect::Selects
    }

    fn reach(&self, _: &CloudInfo) -> Result<StageReach> {
        Ok(StageReach::Cloud {
            option: Some("to_crs"),
            reason: "a tile in the target CRS needs all points",
        })
    }

    fn open(&self, input: &StageInput<'_>) -> Result<Box<dyn OpenStage>> {
        let StageInput { info, job, .. } = *input;
        let corners = info.bounds.map(|ends| ends.map(|point| info.frame.world(point)));
        let extent = corners.map(|[low, high]| [low[0], low[1], high[0], high[1]]);
        let name = job.input.first().map(|name| path_of(name).into_owned()).unwrap_or_default();
        let operation = self.0.operation(&name, &info.crs, extent, &job.resources)?;
        if input.is_above_ground && !operation.keeps_heights() {
            return Err(Error::usage(
                "heights above ground do not support a change of the vertical CRS",
            )
            .remedy("leave out ‹geoid›, or write them to a dimension"));
        }
        Ok(Box::new(CloudReprojection::new(info, operation)?))
    }
}

impl OpenStage for CloudReprojection {
    fn output(&self) -> Option<CloudInfo> {
        Some(self.info.clone())
    }

    fn transformed(&self) -> Option<Transformed> {
        Some(Transformed::of(&self.operation))
    }

    fn apply<'r>(
        &'r self,
        records: &'r dyn PointRecords,
        around: &StageContext<'r>,
    ) -> Result<StageOutput<'r>> {
        let record = around.work.shares.flow.record;
        let each = |_, record: &mut [u8], (): &mut ()| {
            let Point { x, y, z } = self.place(record)?;
            record[..12].copy_from_slice([x, y, z].map(i32::to_le_bytes).as_flattened());
            Ok(true)
        };
        let records = Box::new(EachRecord::new(records, record, each));
        Ok(StageOutput { records, notes: self.notes.clone() })
    }
}

/// A reprojection of a point cloud.
struct CloudReprojection {
    operation: CoordinateOperation,
    from: PointFrame,
    /// Frame, bounds and CRS of the output.
    info: CloudInfo,
    /// Notes for the report.
    notes: Vec<String>,
}

impl CloudReprojection {
    /// The reprojection of a point cloud by an operation.
    ///
    /// # Errors
    /// Positions that cannot be transformed.
    fn new(info: &CloudInfo, operation: CoordinateOperation) -> Result<Self> {
        let [low, high] = extent(info, &operation)?;
        let keeps_heights = operation.keeps_heights();
        let finest = scale(&info.frame, &info.crs, operation.target(), keeps_heights);
        let scale = [0, 1, 2].map(|axis| covering(finest[axis], high[axis] - low[axis]));
        let note = (scale != finest).then(|| {
            format!("coordinates have a scale of {scale:?}: finer scales do not cover the extent")
        });
        let heights = keeps_heights.then_some(info.frame.offset[2]);
        let offset = [low[0].floor(), low[1].floor(), heights.unwrap_or_else(|| low[2].floor())];
        let frame = PointFrame { scale, offset };
        let bounds = info.bounds.map(|_| [steps(&frame, low, -1), steps(&frame, high, 1)]);
        let crs = operation.target().clone();
        let of_heights = keeps_heights.then(|| note_on_heights(&info.crs, &crs)).flatten();
        let notes = operation.notes().iter().cloned().chain(of_heights).chain(note).collect();
        let from = info.frame;
        Ok(Self {
            operation,
            from,
            info: CloudInfo { frame, bounds, count: info.count, crs },
            notes,
        })
    }
}

/// A scale with which `i32` covers the extent of an axis: the finest, or a power of ten.
fn covering(finest: f64, extent: f64) -> f64 {
    let required = extent / f64::from(REACH);
    if finest < required { power_of_ten(required.log10().ceil() as i32) } else { finest }
}

/// A position in steps, with `margin` steps added along each axis.
fn steps(frame: &PointFrame, world: [f64; 3], margin: i32) -> Point {
    let steps = [0, 1, 2].map(|axis| frame.steps(axis, world[axis]).round() as i32);
    let [x, y, z] = steps.map(|steps| steps.saturating_add(margin));
    Point { x, y, z }
}

/// The note on unchanged heights, if the horizontal unit changes, or only one CRS defines heights.
fn note_on_heights(from: &Crs, to: &Crs) -> Option<String> {
    let (across, other) = (from.horizontal_unit(), to.horizontal_unit());
    let unit = match (&from.vertical_unit, &to.vertical_unit) {
        (Some(unit), None) if unit != other => unit.as_str(),
        (None, None) if !matches!(across, "degree" | "unit") && across != other => {
            "an unknown unit"
        }
        _ => return None,
    };
    Some(format!(
        "heights stay in {unit}: the target CRS does not define them (a compound CRS such as EPSG:26910+5703 does)"
    ))
}

/// Lowest and highest coordinates of a point cloud in the target CRS, with a margin.
fn extent(info: &CloudInfo, operation: &CoordinateOperation) -> Result<[[f64; 3]; 2]> {
    let (mut lowest, mut highest) = ([f64::MAX; 3], [f64::MIN; 3]);
    let Some([low, high]) = info.bounds else { return Ok([[0.0; 3]; 2]) };
    let [low, high] = [low, high].map(|point| info.frame.world(point));
    for i in 0..=PLACES {
        for j in 0..=PLACES {
            let [x, y] = [(0, i), (1, j)].map(|(axis, i)| {
                low[axis] + (high[axis] - low[axis]) * f64::from(i) / f64::from(PLACES)
            });
            for z in [low[2], high[2]] {
                let at = operation.point([x, y, z])?;
                lowest = std::array::from_fn(|axis| lowest[axis].min(at[axis]));
                highest = std::array::from_fn(|axis| highest[axis].max(at[axis]));
            }
        }
    }
    let margin = std::array::from_fn::<_, 3, _>(|axis| (highest[axis] - lowest[axis]) * MARGIN);
    Ok([
        std::array::from_fn(|axis| lowest[axis] - margin[axis]),
        std::array::from_fn(|axis| highest[axis] + margin[axis]),
    ])
}

/// Scales as powers of ten, not coarser than those of the point cloud.
fn scale(frame: &PointFrame, from: &Crs, to: &Crs, keeps_heights: bool) -> [f64; 3] {
    let [from, to] = [from, to].map(|crs| crs.horizontal_metres().unwrap_or(DEGREE));
    let [x, y, z] = frame.scale;
    let [x, y] = [x, y].map(|step| power_of_ten_below(step * from / to));
    [x, y, if keeps_heights { z } else { power_of_ten_below(z) }]
}

/// The largest power of ten that is not above a length.
fn power_of_ten_below(length: f64) -> f64 {
    // The logarithm of a power of ten may be a hair below an integer.
    power_of_ten((length.log10() + 1e-9).floor() as i32)
}

/// The nearest number to a power of ten.
fn power_of_ten(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(1.0)
}

impl CloudReprojection {
    /// The position of a record in the frame of the output.
    fn place(&self, record: &[u8]) -> Result<Point> {
        let Self { operation, from, info, .. } = self;
        let world = operation.point(from.world(place(record)))?;
        let steps = [0, 1, 2].map(|axis| info.frame.steps(axis, world[axis]).round());
        let [x, y, z] = steps.map(|step| step as i32);
        let is_inside = info.bounds.is_some_and(|[low, high]| {
            (low.x..=high.x).contains(&x)
                && (low.y..=high.y).contains(&y)
                && (low.z..=high.z).contains(&z)
        });
        match is_inside {
            true => Ok(Point { x, y, z }),
            false => Err(Error::unsupported(format!(
                "the position {world:?} of a point in {} is far from its neighbours",
                info.crs.label()
            ))
            .remedy("exclude it with ‹bounds›")),
        }
    }
}
