//! `terrane tin`: a grid or a point cloud becomes a mesh with a proven error bound.

mod args;
mod cloud;
mod grid;
mod textbook;
mod told;

pub(crate) use args::{Args, Method, Split};
pub(crate) use cloud::{refuse_options, summary as cloud_summary};
pub(crate) use grid::{proof, summary};
pub(crate) use told::{Told, stages};

use std::path::PathBuf;

use crate::cli::shared::many::Many;
use crate::cli::shared::verb::{Call, Verb};
use crate::cli::shared::{Outcome, lists};
use crate::error::Result;
use crate::jobs::Cancel;

impl Verb for Args {
    const NAME: &'static str = "tin";

    fn usage() -> Option<String> {
        Some("[OPTIONS] <--max-error <E>|--max-vertices <N>|--max-triangles <N>> <INPUT>... <OUTPUT>".to_owned())
    }

    fn lists() -> Vec<String> {
        vec![lists::grids(), lists::meshes(), lists::meshers(), lists::EXIT_CODES.to_owned()]
    }

    fn names(&mut self) -> Option<(&mut Vec<String>, &mut PathBuf)> {
        Some((&mut self.input, &mut self.output))
    }

    fn many(&self) -> Option<&Many> {
        Some(&self.many)
    }

    fn run(&self, call: &Call<'_>) -> Result<Outcome> {
        run(self, call.cancel)
    }
}

fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    match args.many.are_clouds(&args.input)? {
        true => cloud::run(args, cancel),
        false => grid::run(args, cancel),
    }
}
