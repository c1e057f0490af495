//! Arguments of `terrane verify`.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::bound::Bound;
use crate::cli::shared::{args, bands, ground, many, names, parse, points};
use crate::error::{Error, Result};
use crate::jobs::line::Length;

/// Prove a mesh against its grid or point cloud, terrain tiles against their grid or cloud, or simplified lines
/// against their original: error bound, coverage, topology; of lines also features, properties, heights
/// and points; of tiles also borders, gaps between levels, and which there are. Exits with 1
/// when a promise is broken, and with 3 when none is known to be, but one could not be judged (such
/// as the error of a mesh that states no bound). Vertices that are no samples of the grid, or points of the cloud, are a
/// failure of meshes written by terrane only: the bound of other meshes may hold all the same
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    /// Mesh file, or simplified lines, or a folder of terrain tiles: quantized-mesh with its layer.json, 3D Tiles with its tileset.json
    pub(crate) mesh: PathBuf,
    /// Grid file it was made from, or a synthetic terrain by name; several files, a folder, a list or
    /// a pattern in quotes are one mosaic. Or point clouds, with the options of points that it was
    /// made with. Or the file that lines were made from
    #[arg(required = true, value_name = "ORIGINAL", value_parser = names::any())]
    pub(crate) source: Vec<String>,
    /// Largest vertical distance allowed [default: the one the mesh file states]
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    pub(crate) max_error: Option<f64>,
    /// What the bound is of, for meshes of grids: samples, or surface for every point of the lines between
    /// neighbouring samples as well [default: what the mesh file states; samples, where it states nothing]
    #[arg(long, value_name = "WHAT")]
    pub(crate) bound: Option<Bound>,
    /// The smallest angle that triangles may have in plan, in degrees, for meshes of grids [default: the one the
    /// mesh file states]
    #[arg(long, value_name = "DEGREES", value_parser = parse::positive)]
    pub(crate) min_angle: Option<f64>,
    /// Samples or points of the cloud that have to be vertices, at their heights: the nearest one to each point of
    /// this file, as in terrane tin
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(crate) keep_points: Option<String>,
    /// Lines and polygons of this file, that edges have to follow, as in terrane tin
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(crate) breaklines: Option<String>,
    /// Water of this file, that has to be level, and whose banks edges have to follow, as in terrane tin; masks of
    /// water of tiles are held to it
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(crate) water: Option<String>,
    /// Heights of the geoid that those of the grid are counted from, as in terrane tiles
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(crate) geoid: Option<String>,
    #[command(flatten)]
    pub(crate) many: many::Many,
    #[command(flatten)]
    pub(crate) grid: args::Grid,
    #[command(flatten)]
    pub(crate) ground: ground::Ground,
    #[command(flatten)]
    pub(crate) points: points::Points,
    #[command(flatten)]
    pub(crate) bands: bands::Given,
    #[command(flatten)]
    pub(crate) lines: Promises,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Replace a report that exists
    #[arg(long)]
    pub(crate) overwrite: bool,
    #[command(flatten)]
    pub(crate) machine: args::SpillingMachine,
    #[command(flatten)]
    pub(crate) show: args::Show,
}

/// What simplified lines are held to by `terrane verify`.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Lines")]
pub(crate) struct Promises {
    /// Largest distance allowed, as in terrane simplify [default: only measure it]
    #[arg(long, value_name = "LENGTH", value_parser = parse::length)]
    pub(crate) tolerance: Option<Length>,
    /// What a distance is: 3d for x, y and z
    #[arg(long, value_name = "NAME", value_enum)]
    pub(crate) metric: Option<Solid>,
    /// Judge crossings, rings, sides and shared borders, too
    #[arg(long)]
    pub(crate) topology: bool,
    /// Points that had to stay on their side
    #[arg(long, value_name = "FILE", requires = "topology")]
    pub(crate) sides: Option<PathBuf>,
    /// Rings may be gone: those with two vertices whose segment has all others within the tolerance, and
    /// their holes with them [default: nothing may be gone]
    #[arg(long, value_name = "HOW", value_enum)]
    collapse: Option<Gone>,
    /// The object of a TopoJSON file that the lines were made from
    #[arg(long, value_name = "NAME")]
    pub(crate) layer: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Solid {
    #[value(name = "3d")]
    Space,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Gone {
    Drop,
}

impl Promises {
    /// Whether rings may be gone.
    pub(crate) fn may_drop(&self) -> bool {
        self.collapse == Some(Gone::Drop)
    }

    /// The first of these options that was given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--tolerance", self.tolerance.is_some()),
            ("--metric", self.metric.is_some()),
            ("--topology", self.topology),
            ("--sides", self.sides.is_some()),
            ("--collapse", self.collapse.is_some()),
            ("--layer", self.layer.is_some()),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }
}

impl Args {
    /// Refuses what meshes of grids alone are held to, as `what` is proved.
    pub(crate) fn refuse_of_surfaces(&self, what: &str) -> Result<()> {
        self.refuse_of_triangles(what)?;
        self.refuse(given("--water", self.water.is_some()), "meshes of grids", what)?;
        self.refuse_of_tiles(what)
    }

    /// Refuses what tiles alone are held to, as `what` is proved.
    pub(crate) fn refuse_of_tiles(&self, what: &str) -> Result<()> {
        self.refuse(given("--geoid", self.geoid.is_some()), "terrain tiles", what)?;
        let ground = self.ground.given();
        let given = ground.as_ref().map(|option| (option.as_str(), option.clone()));
        self.refuse(given, "terrain tiles", what)
    }

    /// Refuses what meshes alone are held to, as tiles are proved.
    pub(crate) fn refuse_of_meshes(&self, what: &str) -> Result<()> {
        self.refuse_of_kept(what)?;
        self.refuse_of_triangles(what)
    }

    /// Refuses what meshes of grids and of clouds are held to, as `what` is proved.
    pub(crate) fn refuse_of_kept(&self, what: &str) -> Result<()> {
        let kept = given("--keep-points", self.keep_points.is_some());
        let lines = given("--breaklines", self.breaklines.is_some());
        self.refuse(kept.or(lines), "meshes of grids and clouds", what)
    }

    fn refuse_of_triangles(&self, what: &str) -> Result<()> {
        let bound = self.bound.map(|bound| ("--bound", format!("--bound {bound}")));
        let angle = given("--min-angle", self.min_angle.is_some());
        let bands = given("--bands", self.bands.is_given());
        self.refuse(bound.or(angle).or(bands), "meshes of grids", what)
    }

    fn refuse(&self, given: Option<(&str, String)>, of: &str, what: &str) -> Result<()> {
        let Some((option, given)) = given else { return Ok(()) };
        Err(Error::usage(format!("{given} is for {of}, and {what}"))
            .in_file(&self.mesh)
            .remedy(format!("leave {option} out")))
    }
}

fn given(option: &'static str, is: bool) -> Option<(&'static str, String)> {
    is.then(|| (option, option.to_owned()))
}

/// The error of a mesh and its original that have changed places.
pub(crate) fn wrong_way_round(what: &str, first: &str, second: &str) -> Error {
    Error::usage(format!("mesh and {what} are the wrong way round"))
        .remedy(format!("write `terrane verify {second} {first}`"))
}
