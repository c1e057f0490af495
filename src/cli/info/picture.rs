//! `terrane info CLOUD --picture`: a cloud from above.

use std::path::PathBuf;

use crate::cli::shared::{check, parse, text};
use crate::cloud::{OpenOptions, open};
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::cloud_picture::{PictureJob, PictureReport, SHOWN, Shows, draw};
use crate::jobs::{Cancel, Progress, Resources};

/// The picture asked for.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Pictures of clouds")]
#[group(id = "picture-of-clouds")]
pub(super) struct Asked {
    /// Draw a cloud from above into this file, which ends in .png
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// What the picture shows of each cell [default: density]
    #[arg(long, value_name = "WHAT", requires = "picture", value_parser = parse_shows, long_help = shows_help())]
    picture_of: Option<Shows>,
    /// Side of the cells of the picture, in units of x and y [default: so that they have four points on the average,
    /// and are at most a thousand along a side]
    #[arg(long, value_name = "SIZE", requires = "picture", value_parser = parse::positive)]
    cell: Option<f64>,
    /// Replace a picture that exists
    #[arg(long, requires = "picture")]
    overwrite: bool,
}

fn parse_shows(name: &str) -> std::result::Result<Shows, String> {
    let found = SHOWN.iter().find(|(known, ..)| *known == name.trim());
    found.map(|(_, shows, _)| *shows).ok_or_else(|| {
        let names = SHOWN.map(|(name, ..)| name).join(", ");
        format!("expected one of {names}")
    })
}

fn shows_help() -> String {
    let names = SHOWN.map(|(name, _, about)| format!("{name:<8} {about}"));
    format!("What the picture shows of each cell [default: {}]:\n{}", SHOWN[0].0, names.join("\n"))
}

impl Asked {
    /// Fails when a picture was asked for, because `files` are no cloud.
    pub(super) fn refuse(&self, files: &[String], what: &str) -> Result<()> {
        if self.picture.is_none() {
            return Ok(());
        }
        let input = files.first().map(String::as_str).unwrap_or_default();
        Err(Error::usage(format!("--picture is of point clouds, and this is {what}"))
            .in_file(&path_of(input))
            .remedy("leave --picture out, or draw grids and meshes with `terrane view -o`"))
    }

    /// Fails where the picture cannot be of all that is told about, or written.
    pub(super) fn check(&self, files: &[String], at_once: usize) -> Result<()> {
        let Some(picture) = &self.picture else { return Ok(()) };
        if files.len() > at_once {
            return Err(Error::usage("--picture is of one cloud, and here are several files")
                .remedy("take them together with --mosaic, or name one"));
        }
        check::ending(picture, &["png"], "a picture")?;
        check::new_file(picture, self.overwrite)
    }

    /// Draws the picture, if one was asked for.
    pub(super) fn draw(
        &self,
        files: &[String],
        options: &OpenOptions,
        resources: &Resources,
        at: (&dyn Progress, &Cancel),
    ) -> Result<Option<PictureReport>> {
        let Some(picture) = &self.picture else { return Ok(None) };
        let job = PictureJob {
            output: picture.clone(),
            overwrite: self.overwrite,
            shows: self.picture_of.unwrap_or_default(),
            cell: self.cell,
        };
        draw(&open(files, options)?, &job, resources, at).map(Some)
    }
}

/// Names and values for people; areas are in squares of `unit`.
pub(super) fn rows(report: &PictureReport, unit: &str) -> Vec<(String, String)> {
    let shows = SHOWN.iter().find(|(_, shows, _)| *shows == report.shows);
    let cells = format!(
        "{} x {} of {} {unit}, {} with points",
        text::count(report.columns),
        text::count(report.rows),
        text::number(report.cell),
        text::count(report.filled)
    );
    let area = |area: f64| format!("{} square {unit}", text::number(area));
    let voids = &report.voids;
    let mut told = format!(
        "{} cells, {:.1} % of the hull, {}",
        text::count(voids.cells),
        100.0 * voids.share,
        area(voids.area)
    );
    if let Some(bounds) = voids.largest_bounds {
        let bounds = bounds.map(text::number).join(", ");
        told += &format!("; the largest {} within {bounds}", area(voids.largest_area));
    }
    let what = shows.map_or("", |(name, ..)| *name);
    let picture = format!("{}, {what}, {}", report.output, text::bytes(report.output_bytes));
    let rows = [
        ("picture", picture),
        ("cells", cells),
        ("densest", format!("{} points per square {unit}", text::number(report.densest))),
        ("voids", told),
    ];
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
