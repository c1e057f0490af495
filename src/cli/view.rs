//! `terrane view`: a picture of a grid or a mesh.

use std::path::PathBuf;

use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, report, text};
use crate::error::Result;
use crate::jobs::Cancel;
use crate::jobs::sift::Sifted;
use crate::jobs::view::{self, ViewJob, ViewReport};

/// Draw a grid or a mesh as a shaded relief picture (PNG, transparent where there is no surface); a mesh whose
/// vertices have colours is drawn in these
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid or mesh file, or a synthetic terrain by name; several grid files, a folder, a list or a
    /// pattern in quotes are one mosaic
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Picture to write, ending in .png
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Replace a picture that exists
    #[arg(long)]
    overwrite: bool,
    /// Columns of the picture; rows follow from the aspect on the ground
    #[arg(long, value_name = "PX", default_value_t = 1600)]
    width: u32,
    /// Draw the edges of a mesh's triangles
    #[arg(long)]
    edges: bool,
    /// Where the light comes from, in degrees clockwise from north
    #[arg(long, value_name = "DEG", default_value_t = 315.0, allow_hyphen_values = true,
          value_parser = parse::finite)]
    azimuth: f64,
    /// Height of the light above the horizon, in degrees from 1 to 90
    #[arg(long, value_name = "DEG", default_value_t = 45.0, value_parser = parse::altitude)]
    altitude: f64,
    /// Factor on heights before they are lit [default: one that suits the terrain]
    #[arg(long, value_name = "FACTOR", value_parser = parse::positive)]
    exaggeration: Option<f64>,
    /// Part to show, in the coordinates of the data
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true,
          value_parser = parse::bbox)]
    bbox: Option<[f64; 4]>,
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
    const NAME: &'static str = "view";

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes()]
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let resources = args.machine.resources();
    let options = args.grid.open_options(&resources);
    let Sifted { names, skipped } =
        args.many.take(&args.input, many::Kind::Grids(&options), &resources)?;
    let args = &Args { input: names, ..args.clone() };
    args.grid.check_all(&args.input)?;
    args.input.iter().try_for_each(|input| args.machine.check_temp_dir(input))?;
    check::ending(&args.output, &["png"], "a picture")?;
    check::new_file(&args.output, args.overwrite)?;
    view::check_width(args.width)?;
    let job = ViewJob {
        input: args.input.clone().into(),
        reading: args.grid.reading(None),
        output: args.output.clone(),
        overwrite: args.overwrite,
        width: args.width,
        edges: args.edges,
        azimuth: args.azimuth,
        altitude: args.altitude,
        exaggeration: args.exaggeration,
        bbox: args.bbox,
        resources,
    };
    let report = view::run(&job, args.show.progress().as_ref(), cancel)?;
    let told = report::WithSkipped { report: &report, skipped: &skipped };
    args.show.tell(&told, || summary(&report))?;
    Ok(Outcome::Kept)
}

fn summary(r: &ViewReport) -> String {
    let heights = match (r.lowest, r.highest) {
        (Some(low), Some(high)) => {
            format!("{} to {}", text::number(low.into()), text::number(high.into()))
        }
        _ => "none: there is no surface in this picture".to_owned(),
    };
    let mut rows = vec![
        ("picture", format!("{} x {} pixels, {}", r.width, r.height, text::bytes(r.output_bytes))),
        ("bounds", r.bounds.map(text::number).join(", ")),
        ("heights", heights),
        ("exaggeration", text::number(r.exaggeration)),
    ];
    rows.extend(report::took(&r.run, None, ""));
    format!("{} -> {}\n{}", r.input, r.output, text::table(&rows))
}
