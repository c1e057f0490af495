//! Proofs of terrain tiles by their options.

use super::options::{CloudTilesProof, TilesProof};
use super::{TilesVerifyReport, verify_tiles, verify_tiles_of_cloud};
use crate::options::ProofQuestion;
use terrane_base::error::Result;
use terrane_engine::proof::{OutputProof, ProofVerdict, WrittenOutput};
use terrane_engine::{Cancel, Progress};

impl OutputProof for TilesProof {
    const OF: &'static str = "terrain tiles of grids";
    type Report = TilesVerifyReport;

    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<TilesVerifyReport> {
        verify_tiles(&ProofQuestion { written, options: self }, progress, cancel)
    }

    fn verdict(report: &TilesVerifyReport) -> &ProofVerdict {
        &report.verdict
    }
}

impl OutputProof for CloudTilesProof {
    const OF: &'static str = "terrain tiles of point clouds";
    type Report = TilesVerifyReport;

    fn prove(
        &self,
        written: &WrittenOutput,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<TilesVerifyReport> {
        verify_tiles_of_cloud(&ProofQuestion { written, options: self }, progress, cancel)
    }

    fn verdict(report: &TilesVerifyReport) -> &ProofVerdict {
        &report.verdict
    }
}
