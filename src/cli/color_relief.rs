//! `terrane color-relief`: the colours of a grid's heights, as a picture.

use std::path::PathBuf;

use crate::cli::convert;
use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, report};
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::colours::{self, ColourJob};
use crate::jobs::convert::ConvertJob;
use crate::jobs::sift::Sifted;
use crate::raster::write;
use crate::relief::Between;

/// Colour a grid by its heights, as a picture
///
/// The file of colours has a height and its colour in each line, as gdaldem has it: 1200 255 128 0, with
/// opacity from 0 to 255 behind it if wanted, or 1200 orange. Heights may be shares of the range of
/// heights (25%), and nv stands for voids. Between two heights colours are mixed. A .tif is a GeoTIFF of
/// bytes, red, green and blue; a .png is a picture with a .pgw and .prj beside it.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid file, or a synthetic terrain by name; several files, a folder, a list or a pattern in
    /// quotes are one mosaic. Behind it comes the file of colours, and last the file to write
    #[arg(required = true, value_names = ["INPUT", "COLORS", "OUTPUT"], num_args = 1.., value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    /// The colour of the nearest height of the file, instead of a mixed one
    #[arg(long, visible_alias = "nearest_color_entry", conflicts_with = "exact")]
    nearest: bool,
    /// Colours of the heights of the file alone; all others are black, and nothing to be seen with --alpha
    #[arg(long, visible_alias = "exact_color_entry")]
    exact: bool,
    /// Write opacity, too, as a fourth band
    #[arg(long)]
    alpha: bool,
    #[command(flatten)]
    written: args::Written,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

impl Verb for Args {
    const NAME: &'static str = "color-relief";
    const USAGE: Option<&'static str> = Some("[OPTIONS] <INPUT>... <COLORS> <OUTPUT>");

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::creation_options(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        let (colours, inputs) = self.colours()?;
        let format = write::of_colours(&self.output, self.written.format.as_deref())?;
        let resources = self.machine.resources();
        let grids = self.grid.open_options(&resources);
        let Sifted { names, skipped } =
            self.many.take(inputs, many::Kind::Grids(&grids), &resources)?;
        self.grid.check_all(&names)?;
        let copy = ConvertJob {
            format: Some(format.name.to_owned()),
            creation: self.written.co.clone(),
            reading: self.grid.reading(None),
            overwrite: self.written.overwrite,
            resources,
            ..ConvertJob::new(names, &self.output)
        };
        convert::check(&copy)?;
        check::input(colours)?;
        check::not_among(std::slice::from_ref(colours), &[&self.output])?;
        let colours = path_of(colours).into_owned();
        let job = ColourJob { copy, colours, between: self.between(), opacity: self.alpha };
        let made = colours::run(&job, self.show.progress().as_ref(), call.cancel)?;
        let told = report::WithSkipped { report: &made, skipped: &skipped };
        self.show.tell(&told, || report::plain(&made))?;
        Ok(Outcome::Kept)
    }
}

impl Args {
    /// The file of colours, and what comes before it.
    fn colours(&self) -> Result<(&String, &[String])> {
        match self.input.split_last() {
            Some((colours, inputs)) if !inputs.is_empty() => Ok((colours, inputs)),
            _ => Err(Error::usage("a grid, a file of colours and the file to write are needed")
                .remedy("name all three: terrane color-relief dem.tif colors.txt out.tif")),
        }
    }

    fn between(&self) -> Between {
        match (self.nearest, self.exact) {
            (true, _) => Between::Nearest,
            (_, true) => Between::Nothing,
            _ => Between::Mixed,
        }
    }
}
