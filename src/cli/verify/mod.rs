//! `terrane verify`: a written mesh is proved against its grid or cloud, simplified lines against their
//! original, terrain tiles against their grid.

mod args;
pub(crate) mod cloud;
mod grid;
mod line;
mod tiles;
mod told;

pub(crate) use args::Args;
pub(crate) use grid::summary;
pub(crate) use told::{outcome, tell};

use std::path::{Path, PathBuf};

use terrane_options::Choice;

use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, check, lists, many};
use crate::cloud::is_cloud;
use crate::error::{Error, Result};
use crate::files::name_of;
use crate::jobs::Cancel;
use crate::jobs::input::is_mesh;
use crate::jobs::tiles::Format;
use crate::jobs::verify::tiles::is_tiles;

impl Verb for Args {
    const NAME: &'static str = "verify";

    fn lists() -> Vec<String> {
        vec![lists::meshes(), lists::grids(), lists::EXIT_CODES.to_owned()]
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

/// The first set of tiles in a folder that is none itself.
fn one_of_sets(folder: &Path) -> Option<PathBuf> {
    let mut sets = Format::names().into_iter().map(|format| folder.join(format.name));
    sets.find(|set| set.is_dir() && is_tiles(set))
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let mesh = name_of(args.mesh.clone())?;
    check::input(&mesh)?;
    if is_tiles(&args.mesh) {
        return tiles::run(args, cancel);
    }
    if let Some(set) = one_of_sets(&args.mesh) {
        return Err(Error::usage("holds sets of tiles of several formats")
            .in_file(&args.mesh)
            .remedy(format!("name one of them, such as {}", set.display())));
    }
    if !is_mesh(&mesh).unwrap_or(false) && many::are_lines(&args.mesh) {
        return line::run(args, cancel);
    }
    if let Some(option) = args.lines.given() {
        return Err(Error::usage(format!("{option} is for simplified lines"))
            .in_file(&args.mesh)
            .remedy(format!("leave {option} out")));
    }
    if is_cloud(&mesh) {
        return Err(args::wrong_way_round("cloud", &mesh, &args.source[0]));
    }
    if args.many.are_clouds(&args.source)? {
        return cloud::run(args, cancel);
    }
    args.points.refuse(&args.source[0])?;
    args.refuse_of_tiles("this is a mesh")?;
    grid::run(args, cancel)
}
