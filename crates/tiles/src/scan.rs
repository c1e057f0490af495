//! First pass over a grid.

use super::input::OpenedTilesGrid;
use terrane_base::error::Result;
use terrane_base::geom::Rect;
use terrane_engine::plan::RunControl;
use terrane_engine::workers;
use terrane_globe::BlockSummary;

/// Approximate number of samples per window.
const WINDOW: u32 = 1 << 20;

/// Surveys rows of a grid; results are passed on in order.
pub(super) fn scan(
    opened: &OpenedTilesGrid,
    rows: [u32; 2],
    at: RunControl<'_>,
    take: impl FnMut(BlockSummary) -> Result<()> + Send,
) -> Result<()> {
    let (plan, width) = (&opened.survey, opened.division.place.size[0]);
    let rects = rects(width, rows, plan.blocks.side, opened.grid.info().block);
    at.progress.begin("survey", rects.iter().map(|rect| rect.len() as u64).sum());
    workers::in_order(
        opened.shares.threads,
        rects.len() as u64,
        at.cancel,
        Vec::new,
        |heights: &mut Vec<f64>, i| {
            let rect = rects[i as usize];
            opened.read(rect, heights)?;
            let summary = plan.summarize(rect, heights);
            opened.grid.copied(rect);
            at.progress.advance(rect.len() as u64);
            Ok(summary)
        },
        take,
    )?;
    at.progress.end();
    Ok(())
}

/// Size in bytes of the survey results as written by tasks.
pub(super) fn written_bytes(opened: &OpenedTilesGrid) -> u64 {
    let plan = &opened.survey;
    let [width, height] = opened.division.place.size;
    let rects = rects(width, [0, height], plan.blocks.side, opened.grid.info().block);
    rects.into_iter().map(|rect| plan.written_bytes(rect)).sum()
}

/// Windows of whole blocks, aligned with those of the file.
fn rects(width: u32, [first, end]: [u32; 2], side: u32, block: (u32, u32)) -> Vec<Rect> {
    let rows = whole_blocks(block.1.min(1024), end - first, side);
    let cols = whole_blocks(WINDOW / rows, width, side);
    let starts = (first..end).step_by(rows as usize);
    let corners =
        starts.flat_map(|row| (0..width).step_by(cols as usize).map(move |col| [col, row]));
    corners
        .map(|[col, row]| Rect::new(col, row, cols.min(width - col), rows.min(end - row)))
        .collect()
}

/// About this many samples in whole blocks: at least one, at most as many as cover `max`.
fn whole_blocks(samples: u32, max: u32, side: u32) -> u32 {
    samples.max(1).next_multiple_of(side).min(max.next_multiple_of(side)).max(side)
}
