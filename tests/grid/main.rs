//! Clouds to grids.

#[path = "../common/cli_support.rs"]
mod cli_support;
#[path = "../common/data.rs"]
mod data;
mod support;

mod canopies;
mod cells;
mod ground;
mod presets;
mod surface;
