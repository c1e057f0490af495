//! `terrane synth`: a terrain from a seed, straight into a store.

use std::path::PathBuf;

use crate::cli::{Outcome, args, convert};
use crate::error::Result;
use crate::pipeline::Cancel;
use crate::pipeline::convert::ConvertJob;

/// Write a synthetic terrain as an uncompressed tiled BigTIFF
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Args {
    /// Character and parameters, such as rough,size=4097,seed=7
    #[arg(value_name = "TERRAIN")]
    terrain: String,
    /// GeoTIFF to write
    output: PathBuf,
    /// Replace a file that exists
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    machine: args::Machine,
    #[command(flatten)]
    show: args::Show,
}

pub(super) fn run(args: &Args, cancel: &Cancel) -> Result<Outcome> {
    let terrain = args.terrain.strip_prefix("synth:").unwrap_or(&args.terrain);
    let job = ConvertJob {
        format: Some("store".to_owned()),
        overwrite: args.overwrite,
        resources: args.machine.resources(),
        ..ConvertJob::new(format!("synth:{terrain}"), &args.output)
    };
    convert::copy(&job, &args.show, cancel)
}
