//! `terrane tin`: a grid or a point cloud becomes a mesh with a proven error bound.

mod args;
mod cloud;
mod grid;

pub(crate) use args::{Args, Method, Split};
pub(crate) use grid::{proof, stages, summary};

use crate::cli::shared::Outcome;
use crate::error::Result;
use crate::jobs::Cancel;

pub(crate) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    match args.many.are_clouds(&args.input)? {
        true => cloud::run(args, cancel),
        false => grid::run(args, cancel),
    }
}
