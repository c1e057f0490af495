//! The functions that triangulate tiles and mend the seams between them.

use terrane_tin::{
    PatchInput, PatchMesh, TileInput, TileMesh, TileScratch, TinSpec, mend_patch, reduce_patch,
    triangulate_tile,
};

/// The pure functions the pipeline is built around; tests plant faults here.
#[derive(Clone, Copy)]
pub(super) struct PipelineKernel {
    pub(super) tile: fn(&TileInput<'_>, &TinSpec, &mut TileScratch) -> TileMesh,
    pub(super) patch: fn(&PatchInput<'_>, &TinSpec, &mut TileScratch) -> PatchMesh,
    pub(super) reduce: fn(&PatchInput<'_>, &TinSpec, &mut TileScratch) -> PatchMesh,
}

impl PipelineKernel {
    pub(super) const GREEDY: PipelineKernel =
        PipelineKernel { tile: triangulate_tile, patch: mend_patch, reduce: reduce_patch };
}
