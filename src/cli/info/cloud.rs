//! `terrane info` of point clouds.

use serde::Serialize;

use super::picture;
use crate::cli::shared::text;
use crate::cloud::{Cloud, OpenOptions, PointSource, open};
use crate::error::Result;
use crate::geom::Point3;
use crate::jobs::cloud_picture::PictureReport;
use crate::jobs::cloud_stats::{CloudStats, cloud_stats};
use crate::jobs::heights::Heights;
use crate::jobs::sift::Losses;
use crate::jobs::{Cancel, Progress, Resources};

/// What is known of a cloud.
#[derive(Serialize)]
pub(crate) struct Facts {
    file: String,
    format: &'static str,
    files: usize,
    /// Points that the headers claim, of the parts that may be wanted.
    points: u64,
    parts: usize,
    scale: [f64; 3],
    offset: [f64; 3],
    /// Lowest and highest coordinates that the headers claim; absent without points.
    bounds: Option<[Point3; 2]>,
    /// Points to a unit of area, by what the headers claim.
    density: Option<f64>,
    crs: String,
    epsg: Option<u32>,
    vertical_epsg: Option<u32>,
    horizontal_unit: &'static str,
    vertical_unit: Option<String>,
    details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stats: Option<CloudStats>,
    #[serde(skip_serializing_if = "Option::is_none")]
    picture: Option<PictureReport>,
    notes: Vec<String>,
}

/// Opens a cloud and tells what it is; with `stats`, all its points are read, withheld ones too; these are not drawn
/// unless they are asked for.
pub(crate) fn describe(
    (files, told): (&[String], &str),
    mut options: OpenOptions,
    (stats, picture): (bool, &picture::Asked),
    resources: &Resources,
    (progress, cancel): (&dyn Progress, &Cancel),
) -> Result<Facts> {
    let drawn = picture.draw(files, &options, resources, (progress, cancel))?;
    options.filter.keep_withheld = true;
    options.any_extent = true;
    let cloud = open(files, &options)?;
    let measure = || cloud_stats(&cloud, resources, progress, cancel);
    let stats = stats.then(measure).transpose()?;
    let mut facts = Facts { picture: drawn, ..Facts::new(told, &cloud, stats) };
    facts.notes.extend(Losses::of(&cloud).notes());
    Ok(facts)
}

impl Facts {
    fn new(file: &str, cloud: &Cloud, stats: Option<CloudStats>) -> Self {
        let info = cloud.info();
        let bounds = info.bounds.map(|ends| ends.map(|point| info.frame.world(point)));
        let area = bounds.map(|[low, high]| (high[0] - low[0]) * (high[1] - low[1]));
        // Of points that were chosen only these count.
        let count = stats.as_ref().map_or(info.count, |stats| stats.census.kept);
        let mut notes = cloud.notes().to_vec();
        notes.extend(outside(bounds, stats.as_ref()));
        Self {
            file: file.to_owned(),
            format: cloud.format(),
            files: cloud.files().len(),
            points: info.count,
            parts: cloud.parts(),
            scale: info.frame.scale,
            offset: info.frame.offset,
            bounds,
            density: area.filter(|area| *area > 0.0).map(|area| count as f64 / area),
            crs: info.crs.label(),
            epsg: info.crs.epsg,
            vertical_epsg: info.crs.vertical_epsg,
            horizontal_unit: info.crs.horizontal_unit(),
            vertical_unit: info.crs.vertical_unit.clone(),
            details: cloud.details().into_iter().map(|(k, v)| (k, v.into())).collect(),
            stats,
            picture: None,
            notes,
        }
    }

    /// Names and values for people.
    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let unit = self.horizontal_unit;
        let mut rows = vec![
            ("format", self.format.to_owned()),
            (
                "points",
                format!("{} in {} parts", text::count(self.points), text::count(self.parts as u64)),
            ),
            ("files", text::count(self.files as u64)),
            ("crs", self.crs.clone()),
            (
                "unit",
                format!(
                    "{unit}, heights in {}",
                    self.vertical_unit.as_deref().unwrap_or("unit unknown")
                ),
            ),
            ("scale", self.scale.map(|v| v.to_string()).join(", ")),
            ("offset", self.offset.map(|v| v.to_string()).join(", ")),
        ];
        rows.extend(self.bounds.iter().flat_map(|ends| {
            let [low, high] = self.corners(ends);
            [("lowest corner", low), ("highest corner", high)]
        }));
        let density = |density: f64| format!("{} points per square {unit}", text::number(density));
        rows.extend(self.density.map(|d| ("density", density(d))));
        let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        let value = |v: &serde_json::Value| v.as_str().unwrap_or_default().to_owned();
        rows.extend(self.details.iter().map(|(k, v)| (k.clone(), value(v))));
        rows.extend(self.stats.iter().flat_map(|stats| self.stats_rows(stats)));
        let heights = self.stats.iter().filter_map(|stats| stats.heights.as_ref());
        rows.extend(heights.flat_map(heights_rows));
        rows.extend(self.picture.iter().flat_map(|drawn| picture::rows(drawn, unit)));
        rows.extend(self.notes.iter().map(|note| ("note".to_owned(), note.clone())));
        rows
    }

    /// Corners with as many decimals as the scale tells apart.
    fn corners(&self, ends: &[Point3; 2]) -> [String; 2] {
        let decimals = self.scale.map(|s| (-s.log10()).ceil().clamp(0.0, 12.0) as usize);
        ends.map(|p| {
            std::array::from_fn::<_, 3, _>(|i| format!("{:.*}", decimals[i], p[i])).join(", ")
        })
    }

    fn stats_rows(&self, stats: &CloudStats) -> Vec<(String, String)> {
        let counts = |all: &mut dyn Iterator<Item = (String, u64)>| {
            all.map(|(name, n)| format!("{name}: {}", text::count(n)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let mut of_returns = stats.returns.iter().map(|(k, n)| (k.to_string(), *n));
        let mut of_classes = stats.classes.iter().map(|(k, n)| (k.to_string(), *n));
        let mut of_flags = stats.flags.iter().map(|(k, n)| ((*k).to_owned(), *n));
        let census = &stats.census;
        let mut rows = vec![
            ("read", format!("{}, {} kept", text::count(census.read), text::count(census.kept))),
            ("classes", counts(&mut of_classes)),
            ("returns", format!("{}, last: {}", counts(&mut of_returns), text::count(stats.last))),
            ("marks", counts(&mut of_flags)),
        ];
        if census.lost > 0 {
            rows.push(("lost", text::count(census.lost)));
        }
        rows.extend(stats.bounds.iter().flat_map(|ends| {
            let [low, high] = self.corners(ends);
            [("lowest found", low), ("highest found", high)]
        }));
        rows.into_iter().filter(|(_, v)| !v.is_empty()).map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

/// Signs of the longest bar.
const LONGEST: u64 = 40;

/// The mean, percentiles, and a bar for each step.
fn heights_rows(heights: &Heights) -> Vec<(String, String)> {
    let percentiles = heights.percentiles.iter();
    let told = percentiles.map(|(percent, z)| format!("{percent} %: {}", text::number(*z)));
    let told = told.collect::<Vec<_>>().join(", ");
    let mut rows = vec![
        ("mean height".to_owned(), text::number(heights.mean)),
        ("percentiles".to_owned(), format!("{told} (within {})", text::number(heights.within))),
    ];
    let most = heights.histogram.iter().map(|bar| bar.points).max().unwrap_or(1).max(1);
    rows.extend(heights.histogram.iter().map(|bar| {
        // What is there is seen.
        let long = (bar.points as f64 / most as f64 * LONGEST as f64).ceil() as usize;
        let name = format!("{} to {}", text::number(bar.low), text::number(bar.high));
        let gap = if long > 0 { " " } else { "" };
        (name, format!("{}{gap}{}", "#".repeat(long), text::count(bar.points)))
    }));
    rows
}

/// Where points lie beyond what the headers claim.
fn outside(claimed: Option<[Point3; 2]>, stats: Option<&CloudStats>) -> Option<String> {
    let ([low, high], [lowest, highest]) = (claimed?, stats?.bounds?);
    // Coordinates have errors; a step is far more.
    let slack = |v: f64| 1e-9 * v.abs().max(1.0);
    let is_out =
        (0..3).any(|i| lowest[i] < low[i] - slack(low[i]) || highest[i] > high[i] + slack(high[i]));
    is_out.then(|| "points lie outside the bounds that the header claims".to_owned())
}
