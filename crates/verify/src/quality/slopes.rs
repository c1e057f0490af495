//! Comparison of the slopes of a grid with those of the triangles over it, one rectangle at a time.

use super::report::SlopeReport;
use crate::buckets::{DomainReach, MeshSpread};
use crate::context::{GridProofContext, MeshRequirements};
use crate::parts;
use crate::report::place;
use crate::work::ProofResources;
use terrane_base::error::Result;
use terrane_engine::ground_units::GroundScale;
use terrane_proof::slope::{self, SlopeTally};
use terrane_raster::GridSource;

/// Compares all triangles with the grid.
pub(super) fn measure(
    work: ProofResources<'_>,
    grid: &dyn GridSource,
    ground: &GroundScale,
) -> Result<SlopeReport> {
    let context = GridProofContext::new(work, grid, MeshRequirements::of_samples(None))?;
    let layout = parts::divided(&context)?;
    let spread =
        MeshSpread::of_triangles(&context.work, &context.snapper, layout, DomainReach::Touched)?;
    let turn = |col: u32, row: u32| ground.turn(f64::from(col) + 0.5, f64::from(row) + 0.5);
    let slopes = parts::each(
        &context,
        &spread,
        |samples, triangles, _| slope::bytes_needed(samples, triangles),
        |part, slopes| {
            slope::measure(part, &turn, slopes);
            Ok(())
        },
        SlopeTally::merge,
    )?;
    let map = grid.info().transform;
    Ok(SlopeReport::new(&slopes, ground.notes(), |at| place(&map, at)))
}
