//! Synthetic clouds as sources of points: `synth:cloud,size=1000,density=8,seed=7` in place of a file.

use super::attributes::{AttributeSelection, PointTable};
use super::column;
use super::condition::CompiledCondition;
use super::filter::{CloudFilter, CompiledFilter, FilterRecord, FilterVerdict};
use super::las::ModernLasRecord;
use super::raw::Flags;
use super::source::{CloudInfo, PointConsumer, PointSource, ReturnCounts};
use super::write;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, Point, PointFrame};
use terrane_files::is_in_memory;
use terrane_synth::cloud::{LidarSurvey, SimulatedReturn};

/// Prefix of synthetic clouds.
const PREFIX: &str = "synth:";
/// World position of the south-west corner: on the central meridian of UTM zone 31, in the Pyrenees.
const ORIGIN: [f64; 3] = [500_000.0, 4_750_000.0, 0.0];

/// True for the name of a synthetic cloud: `synth:cloud` with optional parameters.
pub fn is_synthetic(input: &str) -> bool {
    input.strip_prefix(PREFIX).is_some_and(LidarSurvey::is_named)
}

/// Fails if one of `inputs` is synthetic or in memory, where files are required.
pub(super) fn refuse(inputs: &[String]) -> Result<()> {
    if inputs.iter().any(|input| is_in_memory(input)) {
        return Err(Error::usage("points in memory are not supported here")
            .remedy("pass point cloud files"));
    }
    match inputs.iter().find(|input| is_synthetic(input)) {
        Some(name) => Err(Error::usage(format!("{name:?} is a synthetic point cloud, not a file"))
            .remedy("write it with ‹terrane synth› and pass the file")),
        None => Ok(()),
    }
}

/// The survey of this name, with or without the prefix `synth:`.
///
/// # Errors
/// An unknown name.
pub fn survey(name: &str) -> Result<LidarSurvey> {
    LidarSurvey::parse(name.strip_prefix(PREFIX).unwrap_or(name))
}

/// Scale and offset of the points of a survey.
pub fn frame(survey: &LidarSurvey) -> PointFrame {
    PointFrame { scale: [survey.scale; 3], offset: ORIGIN }
}

/// The CRS of synthetic clouds.
pub fn crs() -> Crs {
    Crs {
        epsg: Some(32_631),
        citation: Some("WGS 84 / UTM zone 31N".to_owned()),
        geographic: Some(false),
        vertical_unit: Some("metre".to_owned()),
        ..Crs::default()
    }
}

/// A survey as a point cloud. [`CloudInfo::count`] is the expected number of points; the filter of every n-th point
/// counts within each part; parts outside the filter's bounds are skipped.
pub struct SyntheticCloud {
    survey: LidarSurvey,
    filter: CompiledFilter,
    condition: Option<CompiledCondition>,
    info: CloudInfo,
}

impl SyntheticCloud {
    /// The points of `survey` that pass `filter`.
    ///
    /// # Errors
    /// A condition on an unknown attribute.
    pub fn new(survey: LidarSurvey, filter: CloudFilter) -> Result<Self> {
        let frame = frame(&survey);
        let compiled = CompiledFilter::new(&filter, &frame);
        let columns = column::columns(full()?, &[]);
        let condition = filter.condition.as_ref().map(|condition| condition.bind(&columns, &frame));
        let condition = condition.transpose()?;
        let info = info(&survey, &compiled);
        Ok(Self { survey, filter: compiled, condition, info })
    }

    /// Whether a part may intersect the filter's bounds.
    fn touches(&self, part: usize) -> bool {
        let [west, south, east, north] = self.area(part);
        self.filter.options().touches([west, south, f64::MIN], [east, north, f64::MAX])
    }

    /// World bounds of a part: x min, y min, x max, y max.
    fn area(&self, part: usize) -> [f64; 4] {
        let [west, south, east, north] = self.survey.area(part);
        let [x, y, _] = ORIGIN;
        [x + west, y + south, x + east, y + north]
    }

    /// Whether a return meets the condition, which is judged on its LAS record; `bytes` is a buffer.
    fn meets_condition(
        &self,
        echo: &SimulatedReturn,
        format: write::PointFormat,
        bytes: &mut Vec<u8>,
    ) -> bool {
        let Some(condition) = &self.condition else { return true };
        bytes.clear();
        format.encode(&[echo.into()], bytes);
        condition.holds(echo.point, ModernLasRecord::of(bytes), bytes)
    }

    /// Passes on the filtered returns of a part.
    fn filter(
        &self,
        part: usize,
        mut each: impl FnMut(&SimulatedReturn) -> Result<()>,
    ) -> Result<ReturnCounts> {
        if part >= self.parts() {
            return Err(Error::usage(format!("the cloud has no part {part}")));
        }
        if !self.touches(part) {
            return Ok(ReturnCounts::default());
        }
        let mut echoes = Vec::new();
        self.survey.fill(part, &mut echoes);
        let mut census = ReturnCounts { read: echoes.len() as u64, ..ReturnCounts::default() };
        let (format, mut bytes) = (full()?, Vec::new());
        for (index, echo) in echoes.iter().enumerate() {
            match self.filter.judge(&self.record(echo, index)) {
                FilterVerdict::Keep if !self.meets_condition(echo, format, &mut bytes) => {
                    census.filtered += 1;
                }
                FilterVerdict::Keep => {
                    census.kept += 1;
                    each(echo)?;
                }
                FilterVerdict::Withheld => census.withheld += 1,
                FilterVerdict::Filtered => census.filtered += 1,
            }
        }
        Ok(census)
    }

    fn record(&self, echo: &SimulatedReturn, index: usize) -> FilterRecord {
        FilterRecord {
            point: echo.point,
            world: self.info.frame.world(echo.point),
            class: echo.class,
            number: echo.number,
            returns: echo.of,
            flags: Flags(flags(echo)),
            index: index as u64,
        }
    }
}

fn info(survey: &LidarSurvey, filter: &CompiledFilter) -> CloudInfo {
    let ([width, height], [low, high]) = (survey.steps(), survey.heights());
    let bounds = filter.cut([Point::new(0, 0, low), Point::new(width - 1, height - 1, high)]);
    CloudInfo { frame: frame(survey), bounds, count: survey.expected(), crs: crs() }
}

impl PointSource for SyntheticCloud {
    fn info(&self) -> &CloudInfo {
        &self.info
    }

    fn parts(&self) -> usize {
        self.survey.parts()
    }

    fn points_of(&self, part: usize) -> u64 {
        if self.touches(part) { self.survey.most(part) } else { 0 }
    }

    fn bounds_of(&self, part: usize) -> Option<[Point; 2]> {
        let [low, high] = self.info.bounds?;
        let [west, south, east, north] = self.area(part);
        let frame = &self.info.frame;
        let [west, south] =
            [frame.steps(0, west), frame.steps(1, south)].map(|v| v.floor() as i32 - 1);
        let [east, north] =
            [frame.steps(0, east), frame.steps(1, north)].map(|v| v.ceil() as i32 + 1);
        let low = Point::new(low.x.max(west), low.y.max(south), low.z);
        let high = Point::new(high.x.min(east), high.y.min(north), high.z);
        (low.x <= high.x && low.y <= high.y).then_some([low, high])
    }

    fn read(
        &self,
        part: usize,
        selection: &AttributeSelection,
        each: &mut PointConsumer<'_>,
    ) -> Result<ReturnCounts> {
        let (format, mut bytes) = (full()?, Vec::new());
        let mut table = PointTable::new(Vec::new(), selection.of_file(0));
        let counts = self.filter(part, |echo| {
            if !table.is_plain() {
                bytes.clear();
                format.encode(&[echo.into()], &mut bytes);
            }
            table.push(echo.point, ModernLasRecord::of(&bytes), &bytes, each)
        })?;
        table.flush(each).map(|()| counts)
    }

    fn select(&self, names: &[String]) -> Result<AttributeSelection> {
        AttributeSelection::of_one(names, &column::columns(full()?, &[]))
    }
}

/// The point format with all attributes of returns.
fn full() -> Result<write::PointFormat> {
    write::PointFormat::new(8)
}

/// Flags of a return, with the bits of LAS 1.4.
fn flags(echo: &SimulatedReturn) -> u8 {
    (u8::from(echo.withheld) * Flags::WITHHELD.0) | (u8::from(echo.overlap) * Flags::OVERLAP.0)
}

/// Red, green, blue and near infrared by class.
fn colours(class: u8) -> [u16; 4] {
    match class {
        2 => [120, 100, 70, 110],
        3..=5 => [50, 110, 40, 220],
        6 => [170, 80, 60, 90],
        _ => [90, 90, 90, 90],
    }
}

/// A return as a record of a file, coloured by class and strength.
impl From<&SimulatedReturn> for write::PointRecord {
    fn from(echo: &SimulatedReturn) -> Self {
        let [red, green, blue, infrared] =
            colours(echo.class).map(|colour| colour * 200 + echo.intensity);
        Self {
            point: echo.point,
            time: echo.time,
            intensity: echo.intensity,
            number: echo.number,
            returns: echo.of,
            class: echo.class,
            flags: flags(echo),
            forward: echo.eastward,
            edge: echo.edge,
            angle: echo.angle,
            user: 0,
            source: echo.source,
            colour: [red, green, blue],
            infrared,
        }
    }
}
