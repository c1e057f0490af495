//! Terrain larger than memory, reduced to small meshes with a proven error bound.
//!
//! terrane reads elevation grids, point clouds and lines out of core and makes triangle meshes, grids and
//! simplified lines. Every sample lies within the requested tolerance of the mesh, vertically; [`Grid::verify`]
//! proves this for the written file with independent code. Results do not depend on threads or memory, and a
//! job stays within its memory budget.
//!
//! # From an array
//!
//! ```
//! # fn main() -> terrane::Result<()> {
//! use terrane::prelude::*;
//! let (width, height) = (200, 100);
//! let heights: Vec<f32> = (0..width * height).map(|i| ((i % width) as f32 / 9.0).sin()).collect();
//!
//! let tin = terrane::Tin::from_array(&heights, width, height)?.max_error(0.1).build()?;
//!
//! println!("{} vertices, {} triangles", tin.vertices().len(), tin.triangles().len());
//! assert!(tin.max_error() <= 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! # From file to file
//!
//! ```
//! # fn main() -> terrane::Result<()> {
//! use terrane::prelude::*;
//! # let folder = tempfile::tempdir().unwrap();
//! # let path = |name| folder.path().join(name);
//! # terrane::open("synth:rough,size=257")?.convert().write(path("dem.tif"))?;
//! # let (dem, mesh, lines) = (path("dem.tif"), path("mesh.ply"), path("lines.geojson"));
//! let dem = terrane::open(dem)?;                                            // "dem.tif"
//! let report = dem.tin().max_error(1.5).memory("512M").write(&mesh)?;       // "mesh.ply"
//! assert!(dem.verify(&mesh).run()?.verdict.passed);
//! dem.contour().interval(10.0).write(lines)?;                                 // "lines.geojson"
//! println!("{} of {} samples kept", report.vertices, report.valid_samples);
//! # Ok(())
//! # }
//! ```
//!
//! # Where to look
//!
//! | data | entry point | operations |
//! |---|---|---|
//! | heights in memory | [`Tin::from_array`] | a [`Tin`] |
//! | grids in files, or in memory | [`open`], [`open_array`] | [`tin`](Grid::tin), [`contour`](Grid::contour), [`sample`](Grid::sample), [`zonal`](Grid::zonal), [`convert`](Grid::convert), [`fill`](Grid::fill), [`difference`](Grid::difference), [`slope`](Grid::slope), [`hillshade`](Grid::hillshade) and others, [`picture`](Grid::picture), [`page`](Grid::page), [`inspect`](Grid::inspect), [`verify`](Grid::verify) |
//! | several bands of a grid, such as a photograph | [`open_bands`] | [`tin`](BandGrid::tin), [`verify`](BandGrid::verify) |
//! | point clouds, or points in memory | [`open_cloud`], [`open_cloud_as`], [`open_points`] | [`grid`](Cloud::grid), [`tin`](Cloud::tin), [`points`](Cloud::points), [`page`](Cloud::page), [`inspect`](Cloud::inspect), [`verify`](Cloud::verify) |
//! | lines and polygons | [`open_features`] | [`simplify`](Features::simplify), [`page`](Features::page), [`inspect`](Features::inspect), [`verify`](Features::verify) |
//! | meshes in files | [`open_mesh`] | [`picture`](Mesh::picture), [`page`](Mesh::page), [`inspect`](Mesh::inspect) |
//! | a line in memory | [`simplify`] | fewer vertices |
//! | a folder with a plan | [`open_plan`] | its output, on any number of machines |
//!
//! Options are setters of the job: one trait for each options struct, imported by `use terrane::prelude::*`. A
//! job has a goal, optional resources (`memory`, `threads`), optional [`Progress`] and [`Cancel`], and ends in
//! `build`, `write` or `run`. Outputs are written atomically. The library prints nothing and changes no handler
//! or hook of the process.
//!
//! Parts that are useful on their own (triangulations, line simplification, file formats) are separate crates
//! named `terrane-*`.

//! # Features
//!
//! | feature | contents |
//! |---|---|
//! | `cli` (default) | the program `terrane`, with all other features |
//! | `lidar` | operations on point clouds: meshes, grids, files of points |
//! | `tiles` | terrain tiles and their verification; includes `lidar` |
//! | `viewer` | pictures, pages, and properties of data |
//! | `remote` (default) | remote files: HTTP(S), S3, Google Cloud Storage, Azure |

#[cfg(feature = "cli")]
mod cli;
mod facade;
mod operations;
pub mod prelude;

/// The command line: runs `args` (program name first) and prints the result on the standard streams. For whole
/// processes only: it sets signal handlers and allocator options.
#[cfg(feature = "cli")]
#[doc(hidden)]
pub fn command_line(args: impl IntoIterator<Item = std::ffi::OsString>) -> std::process::ExitCode {
    cli::main(args)
}

pub use facade::*;
pub use operations::OPERATIONS;
pub use terrane_base::bound::ErrorBound;
pub use terrane_base::geom::{Affine, Crs, Rect};
pub use terrane_base::{Error, ErrorKind, Result};
pub use terrane_baselines::TriangulationRule;
pub use terrane_cloud::{CloudInfo, Condition, Flags, LasVersion, PointFlags, PointFormat, Return};
pub use terrane_engine::input::is_mesh;
pub use terrane_engine::local_frame::LocalFrame;
pub use terrane_engine::operation::{
    AnyOperation, Divisible, Job, Memory, Operation, Reads, RunRequest, Writes, check_named,
};
pub use terrane_engine::options::{CloudInput, Constraints, GridInput, PointFilter};
pub use terrane_engine::plan::{Plan, PlanRun, PlanStatus, RunOptions, TaskReport};
pub use terrane_engine::proof::Inspection;
pub use terrane_engine::proof::{OutputProof, ProofVerdict, WrittenOutput};
pub use terrane_engine::run_statistics::RunStatistics;
pub use terrane_engine::{Cancel, FileAt, Progress, Silent};
#[cfg(feature = "lidar")]
pub use terrane_lidar::cloud_tin::{CloudTinOptions, CloudTinReport};
#[cfg(feature = "lidar")]
pub use terrane_lidar::grid::{Canopy, Compat, GridOptions, GridReport, GroundFrom};
#[cfg(feature = "lidar")]
pub use terrane_lidar::points::{
    Assign, BufferFlag, CellThinning, Classify, HeightClasses, HeightsAs, Overlap, PointsOptions,
    Reclassify, Sort, StageText, ThinningRule, TileFormat, TranslateReport,
};
pub use terrane_raster::{
    ArrayGrid, ArraySample, GridInfo, GridNote, Inputs, SampleType, WaterReport,
};
pub use terrane_simplify::{Length, LineOptions, LineReport, Metric};
pub use terrane_terrain::colours::ColorReliefOptions;
pub use terrane_terrain::contour::{ContourOptions, ContourReport};
pub use terrane_terrain::convert::{ConvertOptions, ConvertReport};
pub use terrane_terrain::difference::{DifferenceOptions, DifferenceReport};
pub use terrane_terrain::fill::{FillOptions, FillReport};
pub use terrane_terrain::relief::{
    AspectOptions, CurvatureOptions, HillshadeOptions, RoughnessOptions, SlopeOptions, TpiOptions,
    TriOptions,
};
pub use terrane_terrain::sample::{SampleOptions, SampleReport};
pub use terrane_terrain::tin::{Tin, TinMethod, TinOptions, TinParts, TinReport, TinTarget};
pub use terrane_terrain::warp::LayerPriority;
pub use terrane_terrain::zonal::{ZonalOptions, ZonalReport, ZoneStatistic, ZoneStatistics};
pub use terrane_terrain::{AnnotationOptions, AnnotationReport};
#[cfg(feature = "tiles")]
pub use terrane_tiles::{
    CloudTilesOptions, ModelOptions, TileOptions, TilesBeyond, TilesFormat, TilesOptions,
    TilesReport,
};
#[cfg(feature = "tiles")]
pub use terrane_verify::tiles::{CloudTilesProof, TilesProof, TilesVerifyReport};
pub use terrane_verify::{
    CloudMeshProof, CloudVerifyReport, LineProof, LineVerifyReport, MeshProof, VerifyReport,
};
#[cfg(feature = "viewer")]
pub use terrane_viewer::info::{
    CloudInfoOptions, CloudInfoReport, FeaturesInfoOptions, FeaturesInfoReport, GridInfoOptions,
    GridInfoReport, MeshInfoOptions, MeshInfoReport,
};
#[cfg(feature = "viewer")]
pub use terrane_viewer::page::{CloudPageOptions, LinePageOptions, PageOptions, PageReport};
#[cfg(feature = "viewer")]
pub use terrane_viewer::qa::{QaOptions, QaReport};
#[cfg(feature = "viewer")]
pub use terrane_viewer::view::{PictureOptions, ViewReport};

/// The code of the tutorial, tested with that of the documentation.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/tutorials/rust.md")]
struct Tutorial;
