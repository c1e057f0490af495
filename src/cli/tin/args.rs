//! Arguments of `terrane tin`; some are those of plans as well.

use std::path::{Path, PathBuf};

use crate::atomic::refuse_existing;
use crate::bound::Bound;
use crate::cli::shared::lists::ENGINE;
use crate::cli::shared::system::System;
use crate::cli::shared::{args, bands, check, many, names, parse, points};
use crate::cli::tin::textbook;
use crate::error::{Error, Result};
use crate::jobs::placing::Placing;
use crate::jobs::tin::{Goal, Refinement, TILE_CELLS, USUAL_TILE};
use crate::methods::Triangulation;

/// Simplify a grid or a point cloud into a triangle mesh with a proven vertical error bound
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Args {
    /// Grid file, or a synthetic terrain by name such as synth:rough,size=4097,seed=7; several files,
    /// a folder, a list or a pattern in quotes are one mosaic. Or point clouds: .las and .laz files,
    /// one or many. The last name is that of the mesh file to write
    #[arg(required = true, value_names = names::NAMES, value_parser = names::any())]
    pub(crate) input: Vec<String>,
    #[arg(skip)]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) goal: GoalArgs,
    #[command(flatten)]
    pub(crate) many: many::Many,
    #[command(flatten)]
    pub(crate) grid: args::Grid,
    #[command(flatten)]
    pub(crate) points: points::Points,
    /// Mesh format [default: by the output's ending]
    #[arg(short, long, value_name = "NAME", help_heading = "Output")]
    pub(crate) format: Option<String>,
    /// Option of the format: SOLID_BASE=HEIGHT closes an STL or 3MF with walls and a flat bottom
    #[arg(long, value_name = "KEY=VAL", value_parser = parse_creation, help_heading = "Output")]
    pub(crate) co: Vec<Creation>,
    /// Replace files that exist
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,
    /// Write the report to this JSON file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,
    /// Check the written mesh against the grid afterwards
    #[arg(long, help_heading = "Output")]
    pub(crate) verify: bool,
    #[command(flatten)]
    pub(crate) print: PrintArgs,
    #[command(flatten)]
    pub(crate) system: System,
    #[command(flatten)]
    pub(crate) split: Split,
    #[command(flatten)]
    pub(crate) method: Method,
    #[command(flatten)]
    pub(crate) textbook: textbook::Chosen,
    #[command(flatten)]
    pub(crate) bands: bands::Given,
    /// Keep what is done in this folder, so that the same command goes on after it was killed; it can
    /// be removed when the mesh is there
    #[arg(long, value_name = "FOLDER", help_heading = "Resources", conflicts_with_all = ["max_vertices", "max_triangles"])]
    pub(crate) workdir: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) disk: args::Disk,
    #[command(flatten)]
    pub(crate) machine: args::SpillingMachine,
    #[command(flatten)]
    pub(crate) show: args::Show,
}

/// One file or many.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Split {
    /// Write a folder with a mesh for every N x N tiles and an index (GeoJSON), instead of one file
    #[arg(long = "split", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536), help_heading = "Output")]
    pub(crate) tiles: Option<u32>,
}

impl Split {
    /// Fails when `output` cannot become what is asked for.
    pub(crate) fn check_output(&self, output: &Path, overwrite: bool) -> Result<()> {
        match self.tiles {
            Some(_) => refuse_existing(output, overwrite),
            None => check::new_file(output, overwrite),
        }
    }
}

/// How the mesh lies in its file.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Viewers and printers (STL, 3MF and GLB)")]
pub(crate) struct PrintArgs {
    /// Leave longitudes and latitudes as they are [default: metres east, north and up of the middle]
    #[arg(long)]
    keep_degrees: bool,
    /// Longest side of the print, such as 100mm or 12cm; STL and 3MF are in millimetres then
    #[arg(long, value_name = "LENGTH", value_parser = parse::print_length, conflicts_with_all = ["scale", "keep_degrees"])]
    size: Option<f64>,
    /// Scale of the print, such as 1:50000 or 0.001; STL and 3MF are in millimetres then
    #[arg(long, value_name = "SCALE", value_parser = parse::scale, conflicts_with = "keep_degrees")]
    scale: Option<f64>,
    /// Make heights so many times higher
    #[arg(long = "exaggeration", alias = "exaggerate", value_name = "FACTOR", value_parser = parse::positive)]
    exaggerate: Option<f64>,
    /// For STL and 3MF: walls and a flat bottom, so far below the lowest height, such as 3mm of the print
    #[arg(long, value_name = "LENGTH", value_parser = parse::print_length)]
    base: Option<f64>,
}

impl PrintArgs {
    pub(crate) fn placing(&self) -> Result<Placing> {
        let Self { keep_degrees, size, scale, exaggerate, base } = *self;
        if base.is_some() && size.is_none() && scale.is_none() {
            return Err(Error::usage("--base is a length of the print, which has no scale")
                .remedy("add --size or --scale, or give a height with --co SOLID_BASE=HEIGHT"));
        }
        Ok(Placing { keep_degrees, size, scale, exaggerate, base })
    }
}

/// How the mesh is made.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct Method {
    /// Of what the error is promised: of the samples, or of the whole surface: of the lines between
    /// neighbouring samples, too [default: samples]
    #[arg(long, value_name = "WHAT", default_value_t, hide_default_value = true, value_parser = clap::value_parser!(Bound))]
    pub(crate) bound: Bound,
    /// Insert one global maximum at a time (the reference; slower, more vertices)
    #[arg(long)]
    pub(crate) strict: bool,
    /// Keep vertices that turned out to be redundant (faster, more vertices)
    #[arg(long)]
    pub(crate) no_drop: bool,
    /// Let vertices lie above or below their samples, where that takes fewer of them (a tenth to a third
    /// fewer, mostly a fifth; some five times slower). The error is kept all the same
    #[arg(long, conflicts_with_all = ["strict", "no_drop"])]
    pub(crate) fit: bool,
    /// Which triangles vertices get. delaunay, on the lattice of samples; data-dependent: any that keep the error, where that takes fewer
    /// vertices (a fifth to a third fewer; some two times slower), and with a method below, edges flipped for the
    /// smaller sum of largest errors; split3, with a method: nothing is ever flipped [default: delaunay]
    #[arg(long, value_name = "NAME", value_parser = clap::value_parser!(Triangulation))]
    pub(crate) triangulation: Option<Triangulation>,
    /// The smallest angle that triangles may have in plan, in degrees: samples are inserted until that holds
    #[arg(long, value_name = "DEGREES", value_parser = parse::positive)]
    pub(crate) min_angle: Option<f64>,
    /// Samples or points of a cloud that stay vertices, at their heights: the nearest one to each point of a file of
    /// features, and to each vertex of its lines and polygons, in the system of the grid or cloud
    #[arg(long, value_name = "FILE", value_parser = names::any())]
    pub(crate) keep_points: Option<String>,
    /// Lines and polygons of a file of features, in the system of the grid or cloud, that edges of the mesh follow,
    /// from sample to sample; over a cloud along posts of their own, at the heights of the lines, if they have any
    #[arg(long, value_name = "FILE", value_parser = names::any(), conflicts_with = "min_angle")]
    pub(crate) breaklines: Option<String>,
    /// Water of a file of features, in the system of the grid, made level: polygons are lakes, and those that a
    /// line of the file runs within are rivers, falling along it (drawn downstream). Edges follow the banks
    #[arg(long, value_name = "FILE", value_parser = names::any(), conflicts_with_all = ["min_angle", "fit"])]
    pub(crate) water: Option<String>,
    /// Cells along the side of a tile, 16 to 8192 [default: 512]
    #[arg(long, value_name = "CELLS", value_parser = tile_cells())]
    pub(crate) tile: Option<u32>,
}

impl Method {
    /// Fails for a triangulation that the engine does not know.
    pub(crate) fn check_triangulation(&self) -> Result<()> {
        match self.triangulation {
            Some(Triangulation::Split3) => Err(textbook::unknown("--triangulation split3", ENGINE)),
            _ => Ok(()),
        }
    }

    pub(crate) fn refinement(&self) -> Refinement {
        Refinement {
            bound: self.bound,
            strict: self.strict,
            drop: !self.no_drop,
            fit: self.fit,
            data_dependent: self.triangulation == Some(Triangulation::DataDependent),
            min_angle: self.min_angle,
            keep_points: self.keep_points.clone(),
            breaklines: self.breaklines.clone(),
        }
    }

    /// Options that only the engine has, and only for grids, and whether they were given.
    pub(crate) fn engine_options(&self) -> [(&'static str, bool); 7] {
        [
            ("--strict", self.strict),
            ("--no-drop", self.no_drop),
            ("--fit", self.fit),
            ("--min-angle", self.min_angle.is_some()),
            ("--water", self.water.is_some()),
            ("--tile", self.tile.is_some()),
            ("--bound surface", self.bound == Bound::Surface),
        ]
    }

    /// Options that are for grids, and whether they were given.
    pub(crate) fn options_of_grids(&self) -> impl Iterator<Item = (&'static str, bool)> {
        let open = ("--triangulation", self.triangulation.is_some());
        std::iter::once(open).chain(self.engine_options())
    }

    /// The files that it reads.
    pub(crate) fn files(&self) -> impl Iterator<Item = String> {
        self.keep_points.iter().chain(&self.breaklines).chain(&self.water).cloned()
    }

    /// Cells along the side of a tile.
    pub(crate) fn tile(&self) -> u32 {
        self.tile.unwrap_or(USUAL_TILE)
    }
}

fn tile_cells() -> clap::builder::RangedI64ValueParser<u32> {
    let (least, most) = TILE_CELLS.into_inner();
    clap::value_parser!(u32).range(i64::from(least)..=i64::from(most))
}

/// What the mesh has to reach: exactly one of these.
#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
pub(crate) struct GoalArgs {
    /// Largest vertical distance of any valid sample from the mesh, in the vertical unit of the data
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse::tolerance)]
    max_error: Option<f64>,
    /// The smallest error that this many vertices allow
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(3..))]
    max_vertices: Option<u64>,
    /// The smallest error that this many triangles allow
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    max_triangles: Option<u64>,
}

impl GoalArgs {
    /// The largest error, for those who cannot keep to a number of vertices or triangles.
    pub(crate) fn max_error(&self) -> Result<f64> {
        self.max_error.ok_or_else(|| {
            Error::usage("--max-vertices and --max-triangles are for grids")
                .remedy("give a cloud --max-error")
        })
    }

    pub(crate) fn goal(&self) -> Result<Goal> {
        let error = self.max_error.map(Goal::MaxError);
        let vertices = self.max_vertices.map(Goal::MaxVertices);
        let triangles = self.max_triangles.map(Goal::MaxTriangles);
        let goal = error.or(vertices).or(triangles);
        goal.ok_or_else(|| Error::usage("no goal given").remedy("add --max-error"))
    }
}

/// An option of an output format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Creation {
    SolidBase(f64),
}

fn parse_creation(given: &str) -> std::result::Result<Creation, String> {
    match given.split_once('=') {
        Some((key, value)) if key.eq_ignore_ascii_case("SOLID_BASE") => {
            parse::finite(value).map(Creation::SolidBase)
        }
        _ => Err("the only option known is SOLID_BASE=HEIGHT".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn creation_options_are_known_by_name() {
        assert_eq!(parse_creation("solid_base=-12.5"), Ok(Creation::SolidBase(-12.5)));
        assert!(parse_creation("SOLID_BASE=x").is_err() && parse_creation("LEVEL=9").is_err());
    }
}
