//! The proof of meshes: what is wrong is found, and nothing else is.

#[path = "../common/cli_support.rs"]
mod cli_support;
mod support;

mod angles;
mod breaklines;
mod faults;
mod headers;
mod kept;
mod quality;
mod samples;
mod twin;
