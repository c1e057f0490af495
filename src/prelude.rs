//! Traits for `use terrane::prelude::*`: the setters of jobs, one trait for each options struct, and other
//! methods of jobs and data.

pub use crate::facade::Data;
pub use terrane_engine::ResourcesSetters;
pub use terrane_engine::local_frame::LocalFrameSetters;
pub use terrane_engine::options::{
    CloudInputSetters, ConstraintsSetters, FeatureInputSetters, FileOutputSetters,
    GridInputSetters, GridOutputSetters, OperationFilesSetters, PointFilterSetters,
    ReplacingSetters, ReprojectionSetters, ResumingSetters, SampleOutputSetters,
};
pub use terrane_engine::plan::RunSetters;
#[cfg(feature = "lidar")]
pub use terrane_lidar::cloud_tin::CloudTinSetters;
#[cfg(feature = "lidar")]
pub use terrane_lidar::grid::GridSetters;
#[cfg(feature = "lidar")]
pub use terrane_lidar::points::{CloudStagesSetters, PointsSetters};
pub use terrane_simplify::LineSetters;
pub use terrane_terrain::AnnotationSetters;
pub use terrane_terrain::colours::ColorReliefSetters;
pub use terrane_terrain::contour::ContourSetters;
pub use terrane_terrain::convert::{ConvertSetters, DerivedGridSetters};
pub use terrane_terrain::difference::DifferenceSetters;
pub use terrane_terrain::fill::FillSetters;
pub use terrane_terrain::relief::{
    AspectSetters, CurvatureSetters, DerivativeSetters, HillshadeSetters, RoughnessSetters,
    SlopeSetters, TpiSetters, TriSetters,
};
pub use terrane_terrain::sample::SampleSetters;
pub use terrane_terrain::tin::{
    BuildTin, SamplePositions, TinMethodSetters, TinSetters, TinTargetSetters,
};
pub use terrane_terrain::warp::LatticeSetters;
pub use terrane_terrain::zonal::ZonalSetters;
#[cfg(feature = "tiles")]
pub use terrane_tiles::{CloudTilesSetters, ModelSetters, TileSetters, TilesSetters};
#[cfg(feature = "tiles")]
pub use terrane_verify::tiles::{CloudTilesProofSetters, TilesProofSetters};
pub use terrane_verify::{CloudMeshProofSetters, LineProofSetters, MeshProofSetters};
#[cfg(feature = "viewer")]
pub use terrane_viewer::info::{
    CloudInfoSetters, FeaturesInfoSetters, GridInfoSetters, MeshInfoSetters,
};
#[cfg(feature = "viewer")]
pub use terrane_viewer::page::{CloudPageSetters, LinePageSetters, PageSetters, TilesPageSetters};
#[cfg(feature = "viewer")]
pub use terrane_viewer::qa::QaSetters;
#[cfg(feature = "viewer")]
pub use terrane_viewer::view::{ExaggerationSetters, LightingSetters, PictureSetters};
