//! terrane: an out-of-core terrain engine. This file is the door of the house: it gives its rooms, each a
//! crate, their names, and holds no logic.
//!
//! Pure rooms ([`geom`], [`tin`], [`contour`], [`delaunay`], [`gridding`], [`line`](mod@line), [`synth`],
//! [`proof`], [`render`]) know slices and numbers only: no path, no file, no thread pool. Rooms at the edge
//! ([`raster`], [`cloud`], [`vector`], [`mesh`]) read and write files. [`jobs`] joins them under one memory
//! budget, and [`cli`] turns arguments into jobs. ARCHITECTURE.md says more.

pub mod cli;
mod facade;

pub use facade::*;
pub use terrane_base::geom::{Affine, Crs, Rect};
pub use terrane_cloud::{CloudInfo, Filter, Return};
pub use terrane_jobs::cloud_tin::CloudTinReport;
pub use terrane_jobs::contour::ContourReport;
pub use terrane_jobs::convert::ConvertReport;
pub use terrane_jobs::grid::{GridReport, Preset};
pub use terrane_jobs::line::LineReport;
pub use terrane_jobs::tin::TinReport;
pub use terrane_jobs::verify::{CloudVerifyReport, LineVerifyReport, VerifyReport};
pub use terrane_jobs::{Cancel, Progress};
pub use terrane_raster::{ArraySample, GridInfo, Inputs, SampleType};

pub use terrane_base::{Error, ErrorKind, Result, error, geom, limits};
pub use terrane_cloud as cloud;
pub use terrane_contour as contour;
pub use terrane_delaunay as delaunay;
use terrane_files as files;
pub use terrane_files::atomic;
pub use terrane_gridding as gridding;
pub use terrane_jobs as jobs;
pub use terrane_line as line;
pub use terrane_mesh as mesh;
pub use terrane_proof as proof;
pub use terrane_raster as raster;
pub use terrane_render as render;
pub use terrane_synth as synth;
pub use terrane_tin as tin;
pub use terrane_vector as vector;
