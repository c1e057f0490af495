//! `terrane view`: a picture of a grid or a mesh, or a page to look at these, at lines and at clouds in.

mod page;
mod serve;

use std::path::PathBuf;

use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, args, check, lists, many, names, parse, points, report, text};
use crate::cloud::OpenOptions;
use crate::error::{Error, Result};
use crate::files::path_of;
use crate::jobs::sift::Sifted;
use crate::jobs::view::{self, ViewJob, ViewReport};
use crate::jobs::{Cancel, Resources};

/// Draw a grid or a mesh as a shaded relief picture (PNG, transparent where there is no surface); a mesh whose
/// vertices have colours is drawn in these. Or make a page of it for a browser: one HTML file that holds all it
/// shows and loads nothing; or serve it to browsers on this machine, and folders of terrain tiles of any size, too
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Grid or mesh file, or a synthetic terrain by name; several grid files, a folder, a list or a
    /// pattern in quotes are one mosaic; for a page also a file of lines or polygons, or point clouds (LAS, LAZ,
    /// COPC, or text after cloud:), of which several are one; to be served also a folder of terrain tiles
    /// (quantized-mesh or 3D Tiles of `terrane tiles`)
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Picture to write, ending in .png
    #[arg(
        short,
        long,
        value_name = "FILE",
        required_unless_present_any = ["html", "serve"],
        conflicts_with = "html"
    )]
    output: Option<PathBuf>,
    /// Page to write in place of a picture, ending in .html
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Serve the page to browsers on this machine (127.0.0.1 alone) until Ctrl-C, and print where it is
    #[arg(long, conflicts_with_all = ["output", "html", "overwrite"])]
    serve: bool,
    /// Port to serve on [default: a free one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    /// Grid whose samples the page of a mesh is compared with: every triangle gets its largest error
    #[arg(long, value_name = "GRID", conflicts_with = "output", value_parser = names::any())]
    against: Option<String>,
    /// Page that inserts the samples of a small grid one by one, for teaching: how a mesh of it grows, and
    /// how its error falls; of a large grid every n-th sample, at most 129 along a side
    #[arg(long, conflicts_with_all = ["output", "against", "edges"])]
    insertion: bool,
    /// Most points of a cloud that a page shows: of more, some that are chosen evenly [default: 2000000]
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "output",
        value_parser = clap::value_parser!(u64).range(1..=page::MOST_POINTS)
    )]
    points: Option<u64>,
    /// The object of a TopoJSON file that a page shows [default: the first one]
    #[arg(long, value_name = "NAME", conflicts_with = "output")]
    layer: Option<String>,
    /// Replace a picture or page that exists
    #[arg(long)]
    overwrite: bool,
    /// Columns of the picture; rows follow from the aspect on the ground
    #[arg(long, value_name = "PX", default_value_t = 1600, conflicts_with_all = ["html", "serve"])]
    width: u32,
    /// Draw the edges of a mesh's triangles; on a page, from the start
    #[arg(long)]
    edges: bool,
    /// Where the light comes from, in degrees clockwise from north [default: 315]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = parse::finite)]
    azimuth: Option<f64>,
    /// Height of the light above the horizon, in degrees from 1 to 90 [default: 45]
    #[arg(long, value_name = "DEG", value_parser = parse::altitude)]
    altitude: Option<f64>,
    /// Factor on heights before they are lit [default: one that suits the terrain]
    #[arg(long, value_name = "FACTOR", value_parser = parse::positive)]
    exaggeration: Option<f64>,
    #[command(flatten)]
    pub(super) many: many::Many,
    #[command(flatten)]
    grid: args::Grid,
    #[command(flatten)]
    cloud: points::Points,
    #[command(flatten)]
    machine: args::SpillingMachine,
    #[command(flatten)]
    show: args::Show,
}

/// Where the light comes from unless told otherwise, in degrees.
const AZIMUTH: f64 = 315.0;
const ALTITUDE: f64 = 45.0;

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
    // What --serve excludes would lift a requirement of the parser's.
    if args.port.is_some() && !args.serve {
        return Err(Error::usage("--port is for pages that are served")
            .remedy("pass --serve, or leave --port out"));
    }
    let is_page = args.html.is_some() || args.serve;
    let (Sifted { names, skipped }, cloud) = inputs(args, is_page, &resources)?;
    let args = &Args { input: names, ..args.clone() };
    args.input.iter().try_for_each(|input| args.machine.check_temp_dir(input))?;
    if args.serve {
        return serve::run(args, page::show(args, cloud)?, &skipped, resources, cancel);
    }
    if let Some(html) = &args.html {
        let show = page::show(args, cloud)?;
        check::ending(html, &["html", "htm"], "a page")?;
        check::new_file(html, args.overwrite)?;
        let report = page::make(args, show, html, resources, cancel)?;
        let told = report::WithSkipped { report: &report, skipped: &skipped };
        args.show.tell(&told, || page::summary(&report))?;
        return Ok(Outcome::Kept);
    }
    let report = picture(args, resources, cancel)?;
    let told = report::WithSkipped { report: &report, skipped: &skipped };
    args.show.tell(&told, || summary(&report))?;
    Ok(Outcome::Kept)
}

/// The files that are taken; and how they are read, where they are clouds.
fn inputs(
    args: &Args,
    is_page: bool,
    resources: &Resources,
) -> Result<(Sifted, Option<OpenOptions>)> {
    if serve::are_tiles(&args.input) || is_page && page::are_lines(&args.input) {
        return Ok((Sifted { names: args.input.clone(), skipped: Vec::new() }, None));
    }
    if !args.many.are_clouds(&args.input)? {
        let options = args.grid.open_options(resources);
        return Ok((args.many.take(&args.input, many::Kind::Grids(&options), resources)?, None));
    }
    if !is_page {
        return Err(Error::usage("there is a page of a point cloud, but no shaded relief")
            .in_file(&path_of(&args.input[0]))
            .remedy("pass --html, or draw it from above with `terrane info --stats --picture`"));
    }
    let options = args.cloud.open_options(&args.grid, resources)?;
    let files = args.many.take(&args.input, many::Kind::Clouds(&options), resources)?;
    Ok((files, Some(args.many.reading(options))))
}

fn picture(args: &Args, resources: Resources, cancel: &Cancel) -> Result<ViewReport> {
    if serve::are_tiles(&args.input) {
        serve::check_tiles(args)?;
    }
    page::refuse_cloud(args)?;
    args.grid.whole().check_all(&args.input)?;
    let output = args.output.clone().unwrap_or_default();
    check::ending(&output, &["png"], "a picture")?;
    check::new_file(&output, args.overwrite)?;
    view::check_width(args.width)?;
    let job = ViewJob {
        input: args.input.clone().into(),
        reading: args.grid.whole().reading(None),
        output,
        overwrite: args.overwrite,
        width: args.width,
        edges: args.edges,
        azimuth: args.azimuth.unwrap_or(AZIMUTH),
        altitude: args.altitude.unwrap_or(ALTITUDE),
        exaggeration: args.exaggeration,
        bbox: args.grid.bounds,
        resources,
    };
    view::run(&job, args.show.progress().as_ref(), cancel)
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
