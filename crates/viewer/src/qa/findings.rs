//! Disagreements of headers with the points of their files, with the standard and with other files: one line each.

use chrono::{Days, NaiveDate};

use super::page::{exact, file_name};
use super::report::QaFinding;
use super::tally::{AllowedTimes, FileTally, QaRange};
use terrane_cloud::{PointFormat, StatedHeader, StatedLas, class_name};
use terrane_files::shown;

/// Steps of the coordinates by which bounds may differ.
const SLACK: f64 = 1.001;
/// The first year of lidar files.
const FIRST_YEAR: u16 = 1990;

/// Times that a header allows.
pub(super) fn allowed_times(header: &StatedHeader<'_>) -> AllowedTimes {
    let offset = header.time_offset;
    let created = header.las.and_then(|las| created(&las)).zip(offset).and_then(|(day, offset)| {
        let start = NaiveDate::from_ymd_opt(1980, 1, 6)?;
        // The date may be that of any time zone, and GPS time is ahead of UTC.
        let days = day.checked_add_days(Days::new(2))?.signed_duration_since(start).num_days();
        Some(days as f64 * 86_400.0 - offset)
    });
    AllowedTimes { offset, created }
}

/// The date of creation, if it is one.
pub(super) fn created(las: &StatedLas<'_>) -> Option<NaiveDate> {
    let [day, year] = las.created;
    NaiveDate::from_yo_opt(year.into(), day.into()).filter(|_| year >= FIRST_YEAR)
}

/// The disagreements of all files, in their order. Points are compared if filters leave none of them out.
pub(super) fn findings(
    headers: &[StatedHeader<'_>],
    tallies: &[FileTally],
    are_compared: bool,
) -> Vec<QaFinding> {
    let mut all = Vec::new();
    for (header, tally) in headers.iter().zip(tallies) {
        let mut found = FileFindings { header, tally, found: Vec::new() };
        found.standard();
        found.contents();
        if are_compared {
            found.counts();
            found.bounds();
        }
        if let Some(first) = headers.first() {
            found.others(first);
        }
        let file = shown(header.name);
        all.extend(
            found.found.into_iter().map(|finding| QaFinding { file: file.clone(), finding }),
        );
    }
    all
}

/// Disagreements of one file.
struct FileFindings<'a> {
    header: &'a StatedHeader<'a>,
    tally: &'a FileTally,
    found: Vec<String>,
}

impl FileFindings<'_> {
    fn add(&mut self, finding: impl Into<String>) {
        self.found.push(finding.into());
    }

    /// Statements that contradict the standard or each other.
    fn standard(&mut self) {
        let Some(las) = self.header.las else { return };
        let ([major, minor], format) = (las.version, self.header.format);
        let least = [0, 0, 2, 2, 3, 3].get(usize::from(format)).copied().unwrap_or(4);
        if [major, minor] < [1, least] {
            self.add(format!("point format {format} requires LAS 1.{least}, not {major}.{minor}"));
        }
        match las.created {
            [0, 0] => self.add("the creation date is missing"),
            [day, year] if created(&las).is_none() => {
                self.add(format!("the creation date is invalid: day {day} of {year}"));
            }
            _ => {}
        }
        if let Some(legacy) = las.legacy {
            let fits = format < 6 && las.points <= u32::MAX.into();
            let expected = if fits { las.points } else { 0 };
            if legacy.points != expected {
                let stated = legacy.points;
                self.add(format!("the legacy point count is {stated}, not {expected}"));
            }
            let by_return: Vec<u64> =
                las.returns.iter().take(5).map(|n| if fits { *n } else { 0 }).collect();
            if legacy.returns != by_return {
                let [stated, expected] = [&legacy.returns, &by_return].map(|n| listed(n));
                self.add(format!("the legacy counts by return are {stated}, not {expected}"));
            }
        }
        if !self.header.crs.is_named() {
            self.add("the CRS is missing");
        }
    }

    /// Points that contradict the header or the standard.
    fn contents(&mut self) {
        let (tally, format) = (self.tally, self.header.format);
        let is_new = PointFormat::new(format).is_ok_and(PointFormat::is_new);
        for (class, points) in &tally.stats.classes {
            // Key points and overlap became flags; classes above 18 are new.
            let is_reserved = self.header.las.is_some()
                && match is_new {
                    true => matches!(class, 8 | 12) || class_name(*class) == "reserved",
                    false => matches!(class, 10 | 11 | 13..),
                };
            if is_reserved {
                self.add(format!(
                    "class {class} is reserved in point format {format}: {points} points"
                ));
            }
        }
        if tally.bad_returns > 0 {
            self.add(format!(
                "return numbers are 0 or above the number of returns: {} points",
                tally.bad_returns
            ));
        }
        let limit = if is_new { 180.0 } else { 90.0 };
        if let Some(QaRange { low, high }) = tally.angle.filter(|it| -it.low.min(-it.high) > limit)
        {
            self.add(format!("scan angles are beyond {limit} degrees: {low} to {high}"));
        }
        self.times();
    }

    fn times(&mut self) {
        let FileTally { time, bad_times, late_times, .. } = *self.tally;
        let range =
            time.map_or(String::new(), |it| format!(" ({} to {})", exact(it.low), exact(it.high)));
        if time == Some(QaRange { low: 0.0, high: 0.0 }) {
            self.add("all GPS times are 0");
        } else if bad_times > 0 {
            let what = match self.header.time_offset {
                Some(_) => "before the start of GPS time, though the header states standard times",
                None => "outside a week, though the header states seconds of the week",
            };
            self.add(format!("GPS times are {what}: {bad_times} points{range}"));
        }
        if late_times > 0 {
            self.add(format!("GPS times are after the creation date: {late_times} points{range}"));
        }
    }

    /// Counts of points.
    fn counts(&mut self) {
        let (stats, Some(las)) = (&self.tally.stats, self.header.las) else { return };
        if stats.census.lost > 0 {
            let lost = stats.census.lost;
            self.add(format!("{lost} of {} stated points are unreadable", las.points));
            return;
        }
        if stats.census.read != las.points {
            self.add(format!("{} points are stated, {} found", las.points, stats.census.read));
        }
        let found: Vec<u64> = (1..=las.returns.len() as u8)
            .map(|number| stats.returns.get(&number).copied().unwrap_or(0))
            .collect();
        if found != las.returns {
            let [stated, found] = [las.returns, &found].map(listed);
            self.add(format!("counts by return are stated as {stated}, found are {found}"));
        }
    }

    /// Bounds of the points.
    fn bounds(&mut self) {
        let (Some([low, high]), Some(las)) = (self.tally.stats.bounds, self.header.las) else {
            return;
        };
        let [stated_low, stated_high] = las.bounds;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let stated = [stated_low[axis], stated_high[axis]];
            let found = [low[axis], high[axis]];
            // Large coordinates are rounded.
            let slack = SLACK * las.scale[axis] + 1e-12 * found[0].abs().max(found[1].abs());
            let is_outside = found[0] < stated[0] - slack || found[1] > stated[1] + slack;
            let is_wide = found[0] > stated[0] + slack || found[1] < stated[1] - slack;
            let what = match (is_outside, is_wide) {
                (true, _) => "points lie outside the bounds",
                (false, true) => "the bounds are wider than the points",
                (false, false) => continue,
            };
            self.add(format!(
                "{what} in {name}: {} to {} stated, {} to {} found",
                exact(stated[0]),
                exact(stated[1]),
                exact(found[0]),
                exact(found[1])
            ));
        }
    }

    /// Differences from the first file.
    fn others(&mut self, first: &StatedHeader<'_>) {
        let (own, name) = (self.header, file_name(&shown(first.name)));
        if own.las.is_some() && first.las.is_some() && own.format != first.format {
            let [own, other] = [own.format, first.format];
            self.add(format!("the point format is {own}, that of {name} is {other}"));
        }
        if own.time_offset != first.time_offset {
            self.add(format!("the GPS time encoding differs from that of {name}"));
        }
        let [crs, other] = [own.crs, first.crs].map(terrane_base::geom::Crs::label);
        if crs != other {
            self.add(format!("the CRS is {crs}, that of {name} is {other}"));
        }
        let [unit, other] = [own.crs, first.crs].map(|crs| crs.heights_unit().unwrap_or("unknown"));
        if unit != other {
            self.add(format!("the unit of heights is {unit}, that of {name} is {other}"));
        }
    }
}

/// Counts without the zeros at their end.
fn listed(counts: &[u64]) -> String {
    let last = counts.iter().rposition(|n| *n > 0).map_or(1, |at| at + 1);
    let texts: Vec<String> = counts.iter().take(last).map(u64::to_string).collect();
    texts.join(", ")
}
