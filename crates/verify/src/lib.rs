//! Proof of a written mesh against its source grid or point cloud, out of core.
//!
//! Three passes: vertices and triangles (and the points of a cloud) are spread over rectangles of
//! the plane through temporary files; then each rectangle is checked by itself ([`terrane_proof`]). Nothing in the report but
//! times and memory depends on threads, memory budget, or the order of work.

mod bands;
mod buckets;
mod cloud;
mod context;
mod findings;
mod header;
mod lines;
mod mesh;
mod options;
mod parts;
mod plane_tiles;
mod proofs;
mod quality;
mod report;
mod stated;
#[cfg(feature = "tiles")]
pub mod tiles;
mod vertices;
mod work;

pub use cloud::{CloudProofFindings, CloudVerifyReport, prove_cloud};
pub use context::MeshRequirements;
pub use findings::{FaultReport, MeshOriginal, MeshReport};
pub use lines::{LineVerifyReport, verify_lines};
pub use options::{
    CloudMeshProof, CloudMeshProofSetters, LineProof, LineProofSetters, LineVerifyJob, MeshProof,
    MeshProofSetters, RemovedRings, SelectedBands,
};
pub use parts::verify;
pub use quality::{
    AngleReport, AngleShare, AspectReport, DegreeReport, MeasuredMesh, QualityReport,
    SlopeReference, SlopeReport, quality,
};
pub use report::{BandProof, GridLocation, OfGrid, VerifyReport};
