//! Arguments about points of clouds, which several verbs share.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use crate::cli::shared::{parse, text};
use crate::cloud::{Census, Condition, Filter, Flags, OpenOptions, PointFormat, Polygon, Return};
use crate::error::{Error, Result};
use crate::files::{name_of, path_of};
use crate::geom::wkt;
use crate::jobs::Resources;

/// Which points of a cloud are read, and how.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Points")]
#[group(id = "cloud")]
pub(crate) struct Points {
    /// Only points of these classes, such as 2,9 (2 is ground, 6 buildings, 9 water)
    #[arg(long, value_name = "CODES", value_delimiter = ',')]
    class: Vec<u8>,
    /// Only this return of each pulse: first, last, only, or a number from 1
    #[arg(long = "return", value_name = "WHICH", value_parser = parse_return)]
    returns: Option<Return>,
    /// Points that are marked as withheld, too
    #[arg(long)]
    keep_withheld: bool,
    /// No points with these marks: synthetic, keypoint, withheld, overlap
    #[arg(long, value_name = "MARKS", value_delimiter = ',', value_parser = parse_flag)]
    drop_flag: Vec<Flags>,
    /// Only points within this box, its borders included
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true, value_parser = parse::bbox)]
    bounds: Option<[f64; 4]>,
    /// Only points inside the polygons of this GeoJSON file, in the coordinates of the cloud
    #[arg(long, value_name = "FILE")]
    polygon: Option<PathBuf>,
    /// Only points at these heights, the ends included
    #[arg(long, value_name = "LOW,HIGH", allow_hyphen_values = true, value_parser = parse_range)]
    z_range: Option<[f64; 2]>,
    /// Only points of which this is true, such as "intensity > 100 and point_source in (3, 7)": = != < <= > >= and in, and
    /// or not, + - * / and parentheses, of numbers, attributes as of terrane grid --stat, extra bytes (in double quotes
    /// where their names have spaces), x, y and z. A missing value is neither equal nor unequal to any
    #[arg(long = "where", value_name = "CONDITION", allow_hyphen_values = true)]
    condition: Option<Condition>,
    /// Only every N-th point of each file
    #[arg(long, value_name = "N")]
    every: Option<NonZeroU32>,
    /// The coordinate system of files that name none, such as EPSG:2154 or well-known text
    #[arg(long, value_name = "CRS", value_parser = parse::crs)]
    crs: Option<String>,
    /// Go on with the good part of damaged files; the points lost are counted
    #[arg(long)]
    salvage: bool,
}

impl Points {
    /// Options for opening a cloud within `resources`.
    ///
    /// # Errors
    /// A polygon file that cannot be read.
    pub(crate) fn open_options(&self, resources: &Resources) -> Result<OpenOptions> {
        let polygon = self.polygon.as_deref().map(Polygon::read).transpose()?;
        let filter = Filter {
            classes: (!self.class.is_empty()).then(|| self.class.clone()),
            returns: self.returns,
            keep_withheld: self.keep_withheld,
            drop: self.drop_flag.iter().fold(Flags::default(), |all, flag| all.and(*flag)),
            bounds: self.bounds,
            polygon: polygon.map(Arc::new),
            z_range: self.z_range,
            condition: self.condition.clone(),
            every: self.every,
        };
        let (salvage, threads) = (self.salvage, resources.threads);
        let crs = self.crs.as_deref().map(wkt::of_srs);
        Ok(OpenOptions { filter, salvage, crs, threads, ..OpenOptions::default() })
    }

    /// The files that the options name.
    pub(crate) fn files(&self) -> Result<Vec<String>> {
        self.polygon.iter().map(|path| name_of(path.clone())).collect()
    }

    /// The first of these options that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--class", !self.class.is_empty()),
            ("--return", self.returns.is_some()),
            ("--keep-withheld", self.keep_withheld),
            ("--drop-flag", !self.drop_flag.is_empty()),
            ("--bounds", self.bounds.is_some()),
            ("--polygon", self.polygon.is_some()),
            ("--z-range", self.z_range.is_some()),
            ("--where", self.condition.is_some()),
            ("--every", self.every.is_some()),
            ("--crs", self.crs.is_some()),
            ("--salvage", self.salvage),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// Fails when any of these options was given, because `input` is no cloud.
    pub(crate) fn refuse(&self, input: &str) -> Result<()> {
        let Some(option) = self.given() else { return Ok(()) };
        Err(Error::usage(format!("{option} is for point clouds, and this is none"))
            .in_file(&path_of(input))
            .remedy(format!("leave {option} out, or name a .las or .laz file")))
    }
}

/// What became of the points, for people.
pub(crate) fn census(census: &Census) -> String {
    let left_out = [
        (census.withheld, "withheld"),
        (census.filtered, "filtered out"),
        (census.outside, "outside the claimed bounds"),
        (census.lost, "lost"),
    ];
    let left_out = left_out.iter().filter(|(count, _)| *count > 0);
    let left_out: String =
        left_out.map(|(count, how)| format!(", {} {how}", text::count(*count))).collect();
    format!("{} of {}{left_out}", text::count(census.kept), text::count(census.read))
}

/// A point format by number.
pub(crate) fn parse_format(text: &str) -> std::result::Result<PointFormat, String> {
    let number = text.parse().map_err(|_| "expected a number".to_owned())?;
    PointFormat::new(number).map_err(|error| error.to_string())
}

/// A return by name or number.
fn parse_return(text: &str) -> std::result::Result<Return, String> {
    text.parse().map_err(|error: Error| error.to_string())
}

/// A mark by name.
fn parse_flag(text: &str) -> std::result::Result<Flags, String> {
    let found = Flags::ALL.into_iter().find(|(name, _)| *name == text.trim());
    found.map(|(_, flag)| flag).ok_or_else(|| {
        let names = Flags::ALL.map(|(name, _)| name).join(", ");
        format!("expected one of {names}")
    })
}

/// "low,high".
fn parse_range(text: &str) -> std::result::Result<[f64; 2], String> {
    let ends = text
        .split_once(',')
        .and_then(|(low, high)| Some([parse::finite(low).ok()?, parse::finite(high).ok()?]));
    let ends = ends.filter(|[low, high]| low <= high);
    ends.ok_or_else(|| "expected low,high with low <= high".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_marks_and_ranges_by_name() {
        assert_eq!(parse_return("last"), Ok(Return::Last));
        assert_eq!(parse_return(" 3 "), Ok(Return::Number(3)));
        assert!(["0", "16", "second", ""].iter().all(|text| parse_return(text).is_err()));
        assert_eq!(parse_flag("overlap"), Ok(Flags::OVERLAP));
        assert!(parse_flag("withhold").is_err());
        assert_eq!(parse_range("-1.5,2"), Ok([-1.5, 2.0]));
        assert!(
            ["2,1", "1", "a,b", "1,nan", "1,2,3"].iter().all(|text| parse_range(text).is_err())
        );
    }
}
