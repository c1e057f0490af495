//! `terrane tiles`: terrain for the globe, at every level of detail.

use std::path::PathBuf;

use crate::cli::operation::{self, RunArguments};
use crate::cli::shared::many::InputSelection;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, lists, many, names, report, text};
use terrane_base::error::Result;
use terrane_tiles::{CloudTilesOptions, TilesOptions, TilesReport};

/// Make terrain tiles of a grid or a point cloud for viewers of the globe, at every level of detail
///
/// The folder holds quantized-mesh 1.0 tiles (EPSG:4326, TMS) of every level down to the resolution of the
/// grid, and layer.json; or 3D Tiles 1.1 of the same levels, and tileset.json. No sample is further from a tile, as a client decodes it on the bent earth, than
/// clients take its level to be off by (77 km at level 0, half as much at each further one), or than its level states
/// where the steps of its positions cannot tell samples apart; each tile
/// says how far its samples are at the most. Tiles beside each other have the same border. Voids are
/// spanned. The grid may be in any system; its samples are brought to WGS 84, and none is made up. Heights are
/// taken from the ellipsoid on, or brought there with --geoid. Of a cloud a model of the ground is made first, as
/// terrane grid --dtm makes it, and the samples are those of the model.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TilesArgs {
    /// Grid file; several files, a folder, a list or a pattern in quotes are one mosaic. Or point clouds. Stdin is - for a
    /// grid and cloud:- for points. The last name is that of the folder to make
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    /// Folder to make, where it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FOLDER", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a file as JSON, too
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    #[command(flatten)]
    options: InputUnion<TilesSources>,
    #[command(flatten)]
    pub(super) many: many::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// What tiles are made of.
#[derive(Clone, Debug)]
struct TilesSources;

impl InputKinds for TilesSources {
    const ALL: &'static [InputKindOptions] = &[
        InputKindOptions::of::<TilesOptions>("grids"),
        InputKindOptions::of::<CloudTilesOptions>("point clouds"),
    ];
}

impl Verb for TilesArgs {
    const NAME: &'static str = "tiles";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        let Self { input, output, named, .. } = self;
        let Some(named) = named.take() else { return Some((input, output)) };
        *output = named;
        None
    }

    fn many(&self) -> Option<&InputSelection> {
        Some(&self.many)
    }

    fn run(&self, call: &VerbCall<'_>) -> Result<VerbOutcome> {
        let Self { input, output, report, many, show, .. } = self;
        let (given, report) = (self.options.given(), report.as_deref());
        let frame = RunArguments { input, output, given, report, many, show };
        match many.are_clouds(input)? {
            true => operation::run(self.options.of::<CloudTilesOptions>(&input[0])?, frame, call),
            false => operation::run(self.options.of::<TilesOptions>(&input[0])?, frame, call),
        }
    }
}

impl Summarize for TilesReport {
    fn summary(&self) -> String {
        let mut rows = vec![
            ("system", self.crs.clone()),
            ("samples", text::count(self.samples)),
            ("tiles", format!("{}, {}", text::count(self.tiles), text::bytes(self.output_bytes))),
        ];
        rows.extend(report::took(&self.run, None, ""));
        rows.extend(report::notes(&self.notes));
        let heading = "level     tiles  triangles       bytes   error, m  allowed, m";
        let level = |l: &terrane_tiles::TileLevelReport| {
            format!(
                "{:>5} {:>9} {:>10} {:>11} {:>10.3} {:>11.3}",
                l.level, l.tiles, l.triangles, l.bytes, l.error, l.tolerance
            )
        };
        let sets = self.levels.chunk_by(|a, b| a.format == b.format).map(|of_set| {
            let levels: Vec<String> = of_set.iter().map(level).collect();
            format!("{}\n{heading}\n{}", of_set[0].format, levels.join("\n"))
        });
        let sets: Vec<String> = sets.collect();
        format!("{} -> {}\n{}\n{}", self.input, self.output, text::table(&rows), sets.join("\n"))
    }
}
