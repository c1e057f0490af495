//! The page of greedy insertion: a small grid, or every n-th sample of a larger one; the page inserts.

use serde_json::json;

use super::facts::{self, SurfaceSystem};
use super::grid_sample::{part, places};
use super::surface::reported_steps;
use super::{PageJob, PageReport, within_memory};
use crate::html::HtmlPage;
use crate::html::pack::QuantizedAxis;
use crate::view::corner_bounds;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Affine, Rect};
use terrane_engine::Cancel;
use terrane_engine::memory::cache_beside;
use terrane_raster::GridSource;

/// Maximum number of samples along a side.
pub const MOST_SIDE: u32 = 129;
/// Maximum number of steps from the lowest height to the highest: errors of whole steps are exact in the page's
/// doubles, and different ones stay different.
const MAX_STEPS: f64 = 65_535.0;

pub(super) fn page(
    grid: &dyn GridSource,
    bounds: Option<[f64; 4]>,
    job: &PageJob<'_>,
    cancel: &Cancel,
) -> Result<(HtmlPage, PageReport)> {
    let info = grid.info();
    let part = part(info, bounds)?;
    if part.width < 2 || part.height < 2 {
        return Err(Error::usage("the grid has fewer than two rows or columns")
            .remedy("use a larger grid, or enlarge ‹bounds›"));
    }
    let need = cache_beside(job.resources.memory) as u64 + 8 * u64::from(part.width) + (4 << 20);
    within_memory(need, "a small grid", job.resources)?;
    let stride = (part.width.max(part.height) - 1).div_ceil(MOST_SIDE - 1);
    let cols = even_places(part.col, part.width, stride);
    let rows = even_places(part.row, part.height, stride);
    let heights = read(grid, &cols, &rows, cancel)?;
    let axis = coarse(&heights);
    let mut page = HtmlPage::new("insertion", &facts::title(job.input))?;
    page.fact("width", cols.len());
    page.fact("height", rows.len());
    page.axis("z", &axis);
    let report = report(&heights, axis.rounding, &info.transform, [&cols, &rows], stride);
    let system = SurfaceSystem::of_grid(info);
    facts::put(&mut page, job, &system, report.bounds, reported_steps(&report, system.geographic));
    let ground = system.ground(report.bounds);
    let map = &info.transform;
    let cell = [
        (map.a * ground[0]).hypot(map.d * ground[1]),
        (map.b * ground[0]).hypot(map.e * ground[1]),
    ];
    page.fact("cell", json!(cell.map(|side| side * f64::from(stride))));
    page.fact("about", facts::about(&system));
    page.fact("notes", json!(notes(&report, stride)));
    Ok((page, report))
}

/// Every `stride`-th place; the last one only if a stride ends there, so that all cells have one size.
fn even_places(first: u32, count: u32, stride: u32) -> Vec<u32> {
    places(first, count - (count - 1) % stride, stride)
}

fn notes(report: &PageReport, stride: u32) -> Vec<String> {
    let mut notes = vec![];
    if stride > 1 {
        notes.push(format!("Every {stride}th sample of rows and columns is shown."));
    }
    if report.rounding > 0.0 {
        notes.push(format!("Heights are within {:.2e} of the file's heights.", report.rounding));
    }
    notes
}

/// The heights at some columns and rows.
///
/// # Errors
/// A void.
fn read(grid: &dyn GridSource, cols: &[u32], rows: &[u32], cancel: &Cancel) -> Result<Vec<f64>> {
    let (first, last) = (cols[0], cols[cols.len() - 1]);
    let mut line = vec![0.0; (last - first + 1) as usize];
    let mut heights = Vec::with_capacity(cols.len() * rows.len());
    for &row in rows {
        cancel.check()?;
        let rect = Rect::new(first, row, last - first + 1, 1);
        grid.read_f64(rect, &mut line)?;
        for &col in cols {
            let z = line[(col - first) as usize];
            if !z.is_finite() {
                return Err(Error::usage("this page does not support voids")
                    .at(format!("column {col}, row {row}"))
                    .remedy("choose a part without voids with ‹bounds›"));
            }
            heights.push(z);
        }
        grid.release(rect);
    }
    Ok(heights)
}

/// Heights in at most [`MAX_STEPS`] steps; exact if these suffice.
fn coarse(heights: &[f64]) -> QuantizedAxis {
    let axis = QuantizedAxis::of(heights);
    let top = axis.codes.iter().copied().max().unwrap_or(0);
    if f64::from(top) <= MAX_STEPS {
        return axis;
    }
    let step = axis.step * f64::from(top) / MAX_STEPS;
    let codes = heights.iter().map(|z| ((z - axis.low) / step).round() as u32).collect();
    let coarse = QuantizedAxis { step, codes, ..axis };
    QuantizedAxis { rounding: coarse.max_distance(heights), ..coarse }
}

fn report(
    heights: &[f64],
    rounding: f64,
    map: &Affine,
    [cols, rows]: [&[u32]; 2],
    stride: u32,
) -> PageReport {
    let [[west, east], [north, south]] =
        [cols, rows].map(|all| [all[0], all[all.len() - 1]].map(f64::from));
    let corners = [(west, north), (east, north), (west, south), (east, south)];
    PageReport {
        page: "insertion",
        vertices: Some(heights.len() as u64),
        stride: Some(stride),
        bounds: corner_bounds(corners.map(|(col, row)| map.apply(col, row))),
        lowest: heights.iter().copied().reduce(f64::min),
        highest: heights.iter().copied().reduce(f64::max),
        rounding,
        ..PageReport::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_of_few_steps_are_exact_and_others_are_rounded() {
        let whole: Vec<f64> = (0..500).map(|i| f64::from(i * 37 % 501) / 4.0).collect();
        let axis = coarse(&whole);
        assert_eq!(axis.rounding, 0.0);
        assert!(whole.iter().zip(&axis.codes).all(|(z, code)| axis.at(*code) == *z));
        let fine: Vec<f64> = (0..500).map(|i| f64::from(i).sin() * 1000.0).collect();
        let axis = coarse(&fine);
        assert!(axis.codes.iter().all(|code| f64::from(*code) <= MAX_STEPS));
        assert!(axis.rounding > 0.0 && axis.rounding <= 2000.0 / MAX_STEPS);
    }
}
