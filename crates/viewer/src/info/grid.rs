//! Report on a grid: metadata, anomalies, and the estimated cost of a TIN.

use serde::Serialize;

use crate::view::grid_bounds;
use terrane_engine::input::GridStats;
use terrane_raster::{GridInfo, GridNote, notes, notes_on_heights};
use terrane_terrain::tin::TinCost;

/// Report on a grid.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct GridInfoReport {
    pub file: String,
    pub format: &'static str,
    pub width: u32,
    pub height: u32,
    pub samples: u64,
    pub sample_type: &'static str,
    pub bands: u32,
    pub band: u32,
    pub nodata: Option<f64>,
    pub scale: f64,
    pub offset: f64,
    pub crs: String,
    pub epsg: Option<u32>,
    pub vertical_epsg: Option<u32>,
    pub horizontal_unit: &'static str,
    pub vertical_unit: Option<String>,
    pub georeferenced: bool,
    pub pixel_is_point: bool,
    /// GDAL's geotransform, from the outer corner of cell (0, 0).
    pub geotransform: [f64; 6],
    pub cell_size: [f64; 2],
    /// West, south, east, north of the samples.
    pub sample_bounds: [f64; 4],
    /// West, south, east, north of the cells around them.
    pub bounds: [f64; 4],
    pub block: [u32; 2],
    pub details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stats: Option<GridStats>,
    /// Estimated cost of a TIN; absent without cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tin: Option<TinCost>,
    pub notes: Vec<GridNote>,
}

impl GridInfoReport {
    pub(super) fn new(
        file: &str,
        info: &GridInfo,
        stats: Option<GridStats>,
        tin: Option<TinCost>,
    ) -> Self {
        let map = &info.transform;
        Self {
            file: file.to_owned(),
            format: info.format,
            width: info.width,
            height: info.height,
            samples: u64::from(info.width) * u64::from(info.height),
            sample_type: info.sample_type.name(),
            bands: info.bands,
            band: info.band,
            nodata: info.nodata,
            scale: info.scale,
            offset: info.offset,
            crs: info.crs.label(),
            epsg: info.crs.epsg,
            vertical_epsg: info.crs.vertical_epsg,
            horizontal_unit: info.crs.horizontal_unit(),
            vertical_unit: info.crs.vertical_unit.clone(),
            georeferenced: info.georeferenced,
            pixel_is_point: info.pixel_is_point,
            geotransform: map.to_gdal(),
            cell_size: [map.a.hypot(map.d), map.b.hypot(map.e)],
            sample_bounds: grid_bounds(info, 0.0),
            bounds: grid_bounds(info, 0.5),
            block: [info.block.0, info.block.1],
            // The last of several facts with one name remains.
            details: info.details.iter().cloned().map(|(k, v)| (k, v.into())).collect(),
            notes: all_notes(info, stats.as_ref()),
            stats,
            tin,
        }
    }
}

/// Notes on the metadata, and on the heights if they were read.
fn all_notes(info: &GridInfo, stats: Option<&GridStats>) -> Vec<GridNote> {
    let samples = u64::from(info.width) * u64::from(info.height);
    let on_heights = stats.map(|stats| {
        let suspects = stats.suspected_nodata.map(|stored| (stored, stats.at_min));
        let range = stats.min.zip(stats.max).map(|(low, high)| [low, high]);
        notes_on_heights(info, (samples, stats.valid), range, suspects)
    });
    notes(info).into_iter().chain(on_heights.into_iter().flatten()).collect()
}
