//! The slopes of a grid, rectangle by rectangle, and those of the triangles over them.

use super::report::SlopeReport;
use crate::context::{Asked, Context};
use crate::parts;
use crate::report::place;
use crate::spread::{Reach, Spread};
use crate::work::Work;
use terrane_base::error::Result;
use terrane_engine::ground::Ground;
use terrane_proof::slope::{self, Slopes};
use terrane_raster::GridSource;

/// Holds all triangles against the grid.
pub(super) fn look(work: Work<'_>, grid: &dyn GridSource, ground: &Ground) -> Result<SlopeReport> {
    let context = Context::new(work, grid, Asked::of_samples(None))?;
    let layout = parts::divided(&context)?;
    let spread = Spread::of_triangles(&context.work, &context.snapper, layout, Reach::Touched)?;
    let turn = |col: u32, row: u32| ground.turn(f64::from(col) + 0.5, f64::from(row) + 0.5);
    let judge = |part: &terrane_proof::Part<'_>, slopes: &mut Slopes| {
        slope::look(part, &turn, slopes);
        Ok(())
    };
    let need = |samples, triangles, _| slope::bytes_needed(samples, triangles);
    let found = parts::each(&context, &spread, need, judge, Slopes::merge)?;
    let map = grid.info().transform;
    Ok(SlopeReport::new(&found, ground.notes(), |at| place(&map, at)))
}
