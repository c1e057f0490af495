//! Proofs of terrain tiles by their options.

use super::options::{CloudTilesProof, TilesProof};
use super::{TilesVerifyReport, verify_tiles, verify_tiles_of_cloud};
use crate::options::Proving;
use terrane_base::error::Result;
use terrane_engine::proof::{Proof, Verdict, Written};
use terrane_engine::{Cancel, Progress};

impl Proof for TilesProof {
    const OF: &'static str = "terrain tiles of grids";
    type Report = TilesVerifyReport;

    fn prove(
        &self,
        written: &Written,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<TilesVerifyReport> {
        verify_tiles(&Proving { written, options: self }, progress, cancel)
    }

    fn verdict(report: &TilesVerifyReport) -> &Verdict {
        &report.verdict
    }
}

impl Proof for CloudTilesProof {
    const OF: &'static str = "terrain tiles of point clouds";
    type Report = TilesVerifyReport;

    fn prove(
        &self,
        written: &Written,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<TilesVerifyReport> {
        verify_tiles_of_cloud(&Proving { written, options: self }, progress, cancel)
    }

    fn verdict(report: &TilesVerifyReport) -> &Verdict {
        &report.verdict
    }
}
