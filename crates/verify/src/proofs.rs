//! Proofs by their options.

use super::cloud::{CloudVerifyReport, verify_cloud};
use super::lines::{LineVerifyReport, verify_lines};
use super::mesh::run;
use super::options::{
    CloudMeshProof, LineProof, LineVerifyJob, MeshProof, ProofQuestion, RemovedRings,
};
use super::report::VerifyReport;
use terrane_base::error::{Error, Result};
use terrane_engine::proof::{OutputProof, ProofVerdict, WrittenOutput};
use terrane_engine::{Cancel, Progress};
use terrane_files::path_of;
use terrane_simplify::Metric;

impl OutputProof for MeshProof {
    const OF: &'static str = "meshes of grids";
    type Report = VerifyReport;

    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<VerifyReport> {
        run(&ProofQuestion { written, options: self }, progress, cancel)
    }

    fn verdict(report: &VerifyReport) -> &ProofVerdict {
        &report.verdict
    }
}

impl OutputProof for CloudMeshProof {
    const OF: &'static str = "meshes of point clouds";
    type Report = CloudVerifyReport;

    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<CloudVerifyReport> {
        verify_cloud(&ProofQuestion { written, options: self }, progress, cancel)
    }

    fn verdict(report: &CloudVerifyReport) -> &ProofVerdict {
        &report.verdict
    }
}

impl OutputProof for LineProof {
    const OF: &'static str = "simplified lines";
    type Report = LineVerifyReport;

    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<LineVerifyReport> {
        let [original] = written.original.names() else {
            return Err(Error::usage("lines require exactly one original file")
                .remedy("pass the file from which they were made"));
        };
        let job = LineVerifyJob {
            lines: written.file.clone(),
            original: path_of(original).into_owned(),
            layer: self.features.layer.clone(),
            tolerance: self.tolerance,
            is_space: self.metric == Metric::Space,
            topology: self.topology,
            may_drop: self.collapse == Some(RemovedRings::Drop),
            sides: self.sides.clone(),
            resources: self.resources.clone(),
        };
        verify_lines(&job, progress, cancel)
    }

    fn verdict(report: &LineVerifyReport) -> &ProofVerdict {
        &report.verdict
    }
}
