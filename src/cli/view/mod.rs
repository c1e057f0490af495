//! `terrane view`: pictures of grids and meshes, and pages of these, of lines and of point clouds.

mod report;
mod serve;

use std::path::{Path, PathBuf};

use crate::cli::operation::{self, OperationInput, RunArguments};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, lists, names, pipes};
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::operation::{HasGroup, Operation};
use terrane_engine::options::Replacing;
use terrane_files::path_of;
use terrane_viewer::page::{
    CloudPageOptions, LinePageOptions, PageOptions, PageReport, TilesPageOptions, is_tiles,
};
use terrane_viewer::view::PictureOptions;

/// Draw a shaded relief picture, or make or serve an interactive page
///
/// Pictures are PNG, transparent outside the surface, with the vertex colours of coloured meshes. A page is one
/// self-contained HTML file of a grid, a mesh, a point cloud or lines. --serve shows the page in browsers on this
/// machine, also for folders of terrain tiles of any size.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ViewArgs {
    /// Grid or mesh file, or name of a synthetic terrain; several grid files, a folder, a list or a quoted pattern are
    /// one mosaic. For pages also a feature file, or point clouds (LAS, LAZ, COPC, or text as cloud:FILE). For --serve
    /// also a folder of terrain tiles (quantized-mesh or 3D Tiles of `terrane tiles`)
    #[arg(required = true, value_parser = names::any())]
    input: Vec<String>,
    /// Output picture (.png)
    #[arg(
        short,
        long,
        value_name = "FILE",
        required_unless_present_any = ["html", "serve"],
        conflicts_with = "html"
    )]
    output: Option<PathBuf>,
    /// Output page (.html) instead of a picture
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Serve the page to browsers on this machine (127.0.0.1 only) until Ctrl-C, and print its address
    #[arg(long, conflicts_with_all = ["output", "html", "overwrite"])]
    serve: bool,
    /// Port of --serve [default: a free port]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    port: Option<u16>,
    #[command(flatten)]
    options: InputUnion<ViewSources>,
    #[command(flatten)]
    many: batch::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Kinds of output.
#[derive(Clone, Debug)]
struct ViewSources;

impl InputKinds for ViewSources {
    const ALL: &'static [InputKindOptions] = &[
        InputKindOptions::of::<PictureOptions>("pictures"),
        InputKindOptions::of::<PageOptions>("pages of grids and meshes"),
        InputKindOptions::of::<CloudPageOptions>("pages of point clouds"),
        InputKindOptions::of::<LinePageOptions>("pages of lines"),
        InputKindOptions::of::<TilesPageOptions>("pages of tiles"),
    ];
}

impl Verb for ViewArgs {
    const NAME: &'static str = "view";

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes()]
    }

    fn input_selection(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        // A clap conflict with --serve would lift a requirement of the parser.
        if self.port.is_some() && !self.serve {
            return Err(
                Error::usage("--port requires --serve").remedy("pass --serve, or leave --port out")
            );
        }
        let input = &self.input;
        input.iter().try_for_each(|name| pipes::refuse_input(name))?;
        if matches!(input.as_slice(), [only] if is_tiles(&path_of(only))) {
            return self.tiles(call);
        }
        let is_page = self.html.is_some() || self.serve;
        if is_page && input.iter().any(|name| are_lines(name)) {
            self.refuse_many("lines")?;
            return self.page::<LinePageOptions>(call);
        }
        match (self.many.are_clouds(input)?, is_page) {
            (true, true) => self.page::<CloudPageOptions>(call),
            (true, false) => Err(Error::usage("shaded relief is not supported for point clouds")
                .in_file(&path_of(&input[0]))
                .remedy("pass --html, or use terrane info --picture")),
            (false, true) => self.page::<PageOptions>(call),
            (false, false) => {
                let options: PictureOptions = self.options.of(&input[0])?;
                let output = self.output.clone().unwrap_or_default();
                operation::run(options, self.frame(&output), call)
            }
        }
    }
}

/// True for a vector file, or synthetic lines by name.
fn are_lines(name: &str) -> bool {
    batch::are_features(name) || batch::are_made_lines(name)
}

impl ViewArgs {
    fn frame<'a>(&'a self, output: &'a Path) -> RunArguments<'a> {
        let Self { input, many, show, .. } = self;
        RunArguments { input, output, given: self.options.given(), report: None, many, show }
    }

    /// Fails for options of several files, because a page shows one.
    fn refuse_many(&self, what: &str) -> Result<()> {
        let Some(option) = self.many.given() else { return Ok(()) };
        Err(Error::usage(format!("{option} is not for a page of {what}"))
            .remedy(format!("leave {option} out")))
    }

    /// Writes a page, or serves it.
    fn page<O>(&self, call: &VerbCall<'_>) -> Result<VerbOutcome>
    where
        O: Operation<Input: OperationInput, Report = PageReport> + HasGroup<Replacing>,
    {
        let mut options: O = self.options.of(&self.input[0])?;
        if let Some(html) = &self.html {
            return operation::run(options, self.frame(html), call);
        }
        let temp_dir = HasGroup::<Resources>::part(&options).temp_dir.clone();
        self.serve(temp_dir.as_deref(), None, call, |file| {
            let made = operation::make(&mut options, &self.frame(file), call)?;
            Ok((made.report, made.skipped))
        })
    }

    /// Serves tiles, which do not fit in a page.
    fn tiles(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        let folder = path_of(&self.input[0]);
        if !self.serve {
            return Err(Error::usage("a folder of tiles requires --serve")
                .in_file(&folder)
                .remedy("pass --serve instead of -o or --html"));
        }
        let options: TilesPageOptions = self.options.of(&self.input[0])?;
        self.refuse_many("tiles")?;
        let temp_dir = options.resources.temp_dir.clone();
        self.serve(temp_dir.as_deref(), Some(folder.to_path_buf()), call, |file| {
            let made = options.run(&self.input.clone().into(), file, call.cancel)?;
            Ok((made, Vec::new()))
        })
    }
}
