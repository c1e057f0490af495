//! `terrane tiles`: terrain tiles for the globe at all levels of detail.

use std::path::PathBuf;

use crate::cli::operation::{self, RunArguments};
use crate::cli::shared::batch::InputSelection;
use crate::cli::shared::report::Summarize;
use crate::cli::shared::union::{InputKindOptions, InputKinds, InputUnion};
use crate::cli::shared::verb::{Verb, VerbCall};
use crate::cli::shared::{VerbOutcome, args, batch, lists, names, report, text};
use terrane_base::error::Result;
use terrane_tiles::{CloudTilesOptions, TileLevelReport, TilesOptions, TilesReport};

/// Make terrain tiles of a grid or a point cloud for globe viewers, at every level of detail
///
/// The output folder holds quantized-mesh 1.0 tiles (EPSG:4326, TMS) with layer.json, or 3D Tiles 1.1 with
/// tileset.json, at every level down to the resolution of the grid. The error of a tile, as decoded on the ellipsoid,
/// is at most the error that clients assume for its level (77 km at level 0, half at each further level), or the stated
/// error of the level where quantization is coarser. Each tile states its maximum error. Adjacent tiles have the same
/// border. Voids are bridged. The grid may have any CRS; samples are transformed to WGS 84 without resampling. Heights
/// are ellipsoidal, or converted with --geoid. Tiles of a point cloud are made from a terrain model, as by terrane grid
/// --dtm.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TilesArgs {
    /// Grid file; several files, a folder, a list or a quoted pattern are one mosaic. Or point clouds. Stdin is - for a
    /// grid and cloud:- for points. The last name is the output folder
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(super) input: Vec<String>,
    #[arg(skip)]
    pub(super) output: PathBuf,
    /// Output folder, if it is not the last name
    #[arg(short = 'o', long = "output", value_name = "FOLDER", help_heading = "Output")]
    named: Option<PathBuf>,
    /// Write the report to a JSON file as well
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    report: Option<PathBuf>,
    #[command(flatten)]
    options: InputUnion<TilesSources>,
    #[command(flatten)]
    pub(super) many: batch::InputSelection,
    #[command(flatten)]
    show: args::ReportDisplay,
}

/// Kinds of input.
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

    fn input_selection(&self) -> Option<&InputSelection> {
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
        let sets = self.levels.chunk_by(|a, b| a.format == b.format).map(|of_set| {
            let levels: Vec<String> = of_set.iter().map(level_row).collect();
            format!("{}\n{heading}\n{}", of_set[0].format, levels.join("\n"))
        });
        let sets: Vec<String> = sets.collect();
        format!("{} -> {}\n{}\n{}", self.input, self.output, text::table(&rows), sets.join("\n"))
    }
}

fn level_row(l: &TileLevelReport) -> String {
    format!(
        "{:>5} {:>9} {:>10} {:>11} {:>10.3} {:>11.3}",
        l.level, l.tiles, l.triangles, l.bytes, l.error, l.tolerance
    )
}
