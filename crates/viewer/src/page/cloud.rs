//! The page of a point cloud: a sample of its points that fits into a page, with their attributes.

use serde_json::{Value, json};

use super::point_sample::{self, PageCloudPoint, PagePointTally, Ranked};
use super::{PageJob, PageReport, facts};
use crate::html::HtmlPage;
use crate::html::pack::{PackedArray, QuantizedAxis};
use crate::render::class_colour;
use terrane_base::error::{Error, Result};
use terrane_base::frontend::Frontend;
use terrane_base::geom::PointFrame;
use terrane_cloud::{CloudOpenOptions, PointCloud, PointSource, class_name};
use terrane_engine::input::workers;
use terrane_engine::memory::{PROGRAM, beside_program, short, with_polygons};
use terrane_engine::{Cancel, Progress, Resources};

/// Maximum number of points on a page.
pub const MAX_POINTS: u64 = 1 << 24;

/// Bytes that a page takes for a point once it is chosen: itself, codes, planes of bytes and texts.
const POINT_BYTES: u64 = 112;
/// Bytes of a thread that reads points.
const WORKER: u64 = 12 << 20;
/// Colours above this have two bytes a channel.
const ONE_BYTE: u16 = 255;

pub(super) fn page(
    open: &CloudOpenOptions,
    max_points: u64,
    job: &PageJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(HtmlPage, PageReport)> {
    let cloud = terrane_cloud::open(job.input.names(), open)?;
    let max_points = max_points.min(cloud.info().count);
    let threads = with_polygons(open, job.resources, |resources| threads(max_points, &resources))?;
    let resources = Resources { threads, ..job.resources.clone() };
    let (points, tally) = workers(&resources)?.install(|| {
        let (mut points, tally) =
            point_sample::select(&cloud, max_points as usize, progress, cancel)?;
        point_sample::arrange(&mut points);
        Ok::<_, Error>((points, tally))
    })?;
    if points.is_empty() {
        return Err(Error::bad_input("no points to show")
            .remedy("name a point cloud with points, or relax the filters"));
    }
    cancel.check()?;
    put(job, &cloud, points, &tally)
}

/// Number of threads that fit into memory with the points.
fn threads(points: u64, resources: &Resources) -> Result<usize> {
    let need = point_sample::needed(points).max(points * POINT_BYTES);
    let free = beside_program(resources.memory);
    let Some(rest) = free.checked_sub(need + WORKER) else {
        let required = need + WORKER + PROGRAM;
        let mib = required.div_ceil(1 << 20);
        let message = format!("a page of {points} points needs {mib} MiB of memory");
        return Err(short(message, required).or("show fewer with ‹points›"));
    };
    Ok(resources.threads.clamp(1, 1 + (rest / WORKER) as usize))
}

/// Puts the points into a page, an array at a time.
fn put(
    job: &PageJob<'_>,
    cloud: &PointCloud,
    points: Vec<Ranked>,
    tally: &PagePointTally,
) -> Result<(HtmlPage, PageReport)> {
    let mut page = HtmlPage::new("cloud", &facts::title(job.input))?;
    let mut report = PageReport {
        page: "cloud",
        points: Some(points.len() as u64),
        census: Some(tally.census),
        ..PageReport::default()
    };
    let placed = place(&mut page, &points, &cloud.info().frame, &mut report);
    let seen = || points.iter().map(|(_, seen)| seen);
    page.array("marks", PackedArray::signed(seen().map(packed_flags)));
    if tally.strongest > 0 {
        page.array("intensity", PackedArray::signed(seen().map(|seen| seen.intensity.into())));
    }
    if tally.brightest > 0 {
        let is_short = tally.brightest <= ONE_BYTE;
        page.array("colour", PackedArray::signed(seen().map(|seen| colour(seen.colour, is_short))));
    }
    drop(points);
    let system = facts::SurfaceSystem::of_features(&cloud.info().crs);
    facts::put(&mut page, job, &system, report.bounds, placed);
    page.fact("about", facts::about(&system));
    add_facts(&mut page, cloud, tally, &report);
    Ok((page, report))
}

/// Adds the positions and their metadata; returns the rounding steps of positions and heights.
fn place(
    page: &mut HtmlPage,
    points: &[Ranked],
    frame: &PointFrame,
    report: &mut PageReport,
) -> [f64; 2] {
    let (mut ends, mut steps) = ([[0.0; 2]; 3], [0.0; 3]);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let coordinates: Vec<i32> = points
            .iter()
            .map(|(_, seen)| [seen.point.x, seen.point.y, seen.point.z][axis])
            .collect();
        let coded = QuantizedAxis::of_steps(&coordinates, frame.scale[axis], frame.offset[axis]);
        let last = coded.codes.iter().max().copied().unwrap_or(0);
        ends[axis] = [coded.low, coded.at(last)];
        steps[axis] = frame.scale[axis].max(coded.rounding);
        report.rounding = report.rounding.max(coded.rounding);
        page.axis(name, &coded);
    }
    let [[west, east], [south, north], [low, high]] = ends;
    report.bounds = [west, south, east, north];
    (report.lowest, report.highest) = (Some(low), Some(high));
    [steps[0].max(steps[1]), steps[2]]
}

/// Class, return number, number of returns and flags in one number: 8, 4, 4 and 4 bits.
fn packed_flags(seen: &PageCloudPoint) -> i32 {
    let [number, returns] = seen.returns.map(|n| i32::from(n & 15));
    i32::from(seen.class) | number << 8 | returns << 12 | i32::from(seen.flags.0) << 16
}

/// Red, green and blue of 8 bits each in one number.
fn colour(stored: [u16; 3], is_short: bool) -> i32 {
    let [red, green, blue] = stored.map(i32::from).map(|value| match is_short {
        true => value,
        false => (value * 255 + 32_767) / 65_535,
    });
    red | green << 8 | blue << 16
}

/// Numbers of classes or returns that have points, with their counts.
fn nonzero(counts: &[u64]) -> impl Iterator<Item = (u8, u64)> {
    (0u8..=u8::MAX).zip(counts.iter().copied()).filter(|(_, count)| *count > 0)
}

fn add_facts(page: &mut HtmlPage, cloud: &PointCloud, tally: &PagePointTally, report: &PageReport) {
    let classes = nonzero(&tally.classes).map(|(class, points)| {
        json!({
            "class": class, "name": class_name(class), "colour": class_colour(class), "points": points,
        })
    });
    page.fact("classes", Value::from_iter(classes));
    let returns = nonzero(&tally.returns)
        .map(|(number, points)| json!({ "number": number, "points": points }));
    page.fact("returns", Value::from_iter(returns));
    let (shown, kept) = (report.points.unwrap_or(0), tally.census.kept);
    page.fact("points", json!({ "shown": shown, "of": kept }));
    page.fact("files", cloud.files().len());
    page.fact("notes", json!(notes(cloud, tally, report)));
}

/// Notes on shown and hidden points.
fn notes(cloud: &PointCloud, tally: &PagePointTally, report: &PageReport) -> Vec<String> {
    let (shown, census) = (report.points.unwrap_or(0), &tally.census);
    let mut notes = Vec::new();
    if shown < census.kept {
        let kept = census.kept;
        notes.push(format!(
            "{shown} of {kept} points are shown (an even sample by position); class and return \
             counts cover all points."
        ));
    }
    let left_out = [
        (census.withheld, "are flagged as withheld"),
        (census.filtered, "were filtered out"),
        (census.outside, "lie outside the bounds in the file header"),
        (census.lost, "cannot be read"),
    ];
    let left_out = left_out.iter().filter(|(count, _)| *count > 0);
    notes.extend(left_out.map(|(count, why)| format!("{count} points are left out: they {why}.")));
    notes.push(match report.rounding > 0.0 {
        true => format!("Positions are within {:.1e} of the file's positions.", report.rounding),
        false => "Positions are exact.".to_owned(),
    });
    if tally.brightest > ONE_BYTE {
        notes.push("Colours are reduced from 16 to 8 bits.".to_owned());
    }
    // Readers of a page have no command line: notes name options as in Python.
    notes.extend(cloud.notes().iter().map(|note| format!("{}.", Frontend::Python.spell(note))));
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::error::ErrorKind;

    #[test]
    fn colours_of_one_byte_and_of_two_are_the_same() {
        assert_eq!(colour([255, 128, 0], true), 255 | 128 << 8);
        for value in 0..=255u16 {
            assert_eq!(colour([value * 257; 3], false), colour([value; 3], true));
        }
        assert_eq!(colour([300, 65_535, 0], false), 1 | 255 << 8);
    }

    #[test]
    fn threads_give_way_before_points_do() {
        let threads = |points, mib: u64| {
            threads(points, &Resources { memory: mib << 20, threads: 8, ..Resources::default() })
        };
        assert_eq!(threads(1_000, 1_000).unwrap(), 8);
        let few = threads(1_000, 60).unwrap();
        assert!((1..4).contains(&few), "{few}");
        let error = threads(MAX_POINTS, 1_000).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Resource);
        assert!(error.to_string().contains("‹points›"), "{error}");
        let told = error.to_string();
        let enough = told.split("‹memory› ").nth(1).unwrap().split('M').next().unwrap();
        assert_eq!(threads(MAX_POINTS, enough.parse().unwrap()).unwrap(), 1);
    }

    #[test]
    fn what_is_known_of_a_point_is_packed_apart() {
        let flags = terrane_cloud::Flags::WITHHELD.and(terrane_cloud::Flags::OVERLAP);
        let seen =
            PageCloudPoint { class: 200, returns: [3, 15], flags, ..PageCloudPoint::default() };
        assert_eq!(packed_flags(&seen), 200 | 3 << 8 | 15 << 12 | 12 << 16);
    }
}
