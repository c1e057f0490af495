//! A surface ready to be painted, and the frame of its picture.

use std::path::Path;

use super::options::ViewJob;
use crate::render::{
    FieldPainter, PictureFrame, PictureHeights, PictureStyle, PixelColors, StrokeCoverage,
};
use terrane_base::error::{Error, Result};
use terrane_engine::Resources;
use terrane_engine::memory::short;

/// A surface ready to be painted.
pub(super) struct DrawnSurface {
    pub(super) frame: PictureFrame,
    pub(super) field: PictureHeights,
    pub(super) edges: Option<StrokeCoverage>,
    /// Colours of the surface, if it has any.
    pub(super) colours: Option<PixelColors>,
}

impl DrawnSurface {
    pub(super) fn painter(&self, style: PictureStyle) -> FieldPainter<'_> {
        FieldPainter::new(&self.field, self.edges.as_ref(), style).coloured(self.colours.as_ref())
    }
}

/// Field pixels per picture pixel along each side: smooths outlines and facets.
pub(super) const FINENESS: u32 = 2;
/// Bytes a picture pixel takes at the peak: heights, those of the coarser grid they come from (up
/// to four for each), edges, and colours.
pub(super) const PIXEL_BYTES: u64 = 4 * (4 + 16) + 1 + 4;

/// Additional memory if the surface has its own colours.
pub(super) const COLOUR_BYTES: u64 = 4 * 4;

/// Default width of a picture.
const WIDTH: u32 = 1600;
/// Maximum default width by column of a grid: more shows nothing but the interpolation.
const WIDTH_PER_COLUMN: f64 = 8.0;

/// The frame of a picture of `data` (west, south, east, north), or of the requested bounds; `cell` is the width of a
/// grid's cell.
pub(super) fn frame(
    job: &ViewJob,
    data: [f64; 4],
    cell: Option<f64>,
    geographic: bool,
) -> Result<PictureFrame> {
    let bounds = job.options.grid.bounds.unwrap_or(data);
    let is_disjoint =
        bounds[0] > data[2] || bounds[2] < data[0] || bounds[1] > data[3] || bounds[3] < data[1];
    if is_disjoint {
        let [west, south, east, north] = data;
        return Err(Error::usage("‹bounds› lies outside the data")
            .in_file(Path::new(&job.input.to_string()))
            .remedy(format!("choose bounds within {west},{south} to {east},{north}")));
    }
    let width = job.options.width.unwrap_or_else(|| default_width(bounds, cell));
    let frame = PictureFrame::fit(bounds, width, ground_scale(bounds, geographic));
    within_memory(&frame, PIXEL_BYTES, &job.options.resources)?;
    Ok(frame)
}

fn default_width([west, _, east, _]: [f64; 4], cell: Option<f64>) -> u32 {
    let enough = cell.map(|cell| (WIDTH_PER_COLUMN * (east - west) / cell).round());
    enough.map_or(WIDTH, |enough| enough.clamp(1.0, f64::from(WIDTH)) as u32)
}

/// Metres of one degree along a meridian.
pub(crate) const DEGREE_METRES: f64 = 111_320.0;

/// Ground units per world unit along x and y.
fn ground_scale([_, south, _, north]: [f64; 4], geographic: bool) -> [f64; 2] {
    if !geographic {
        return [1.0, 1.0];
    }
    let latitude = ((south + north) / 2.0).clamp(-89.0, 89.0);
    [DEGREE_METRES * latitude.to_radians().cos(), DEGREE_METRES]
}

pub(super) fn within_memory(
    frame: &PictureFrame,
    pixel_bytes: u64,
    resources: &Resources,
) -> Result<()> {
    let pixels = u64::from(frame.width) * u64::from(frame.height);
    let need = pixels * pixel_bytes;
    if need > resources.memory {
        let mib = need.div_ceil(1 << 20);
        let message = format!(
            "a picture of {} x {} pixels needs {mib} MiB of memory",
            frame.width, frame.height,
        );
        return Err(short(message, need).or("a smaller ‹width›"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_grids_have_small_pictures() {
        let wide = [10.0, 0.0, 20.0, 99.0];
        for (cell, expected) in
            [(None, 1600), (Some(0.01), 1600), (Some(0.5), 160), (Some(99.0), 1)]
        {
            assert_eq!(default_width(wide, cell), expected, "{cell:?}");
        }
    }

    #[test]
    fn degrees_shrink_towards_the_pole_but_never_vanish() {
        let [x, y] = ground_scale([0.0, 59.0, 1.0, 61.0], true);
        assert!((x / y - 0.5).abs() < 1e-9);
        assert!(ground_scale([0.0, 89.0, 1.0, 91.0], true)[0] > 0.0);
        assert_eq!(ground_scale([0.0; 4], false), [1.0, 1.0]);
    }
}
