//! The `terrane` binary: the command line, and the rooms it works with by the names it has for them.

mod cli;

use terrane_base::{bound, error, geom};
use terrane_cloud as cloud;
use terrane_files::{self as files, atomic};
use terrane_gridding as gridding;
use terrane_jobs as jobs;
use terrane_line as line;
use terrane_mesh as mesh;
use terrane_methods as methods;
use terrane_raster as raster;
use terrane_synth as synth;
use terrane_vector as vector;

fn main() -> std::process::ExitCode {
    cli::main(std::env::args_os())
}
