//! `terrane info` of grids.

use serde::Serialize;

use crate::cli::info::details;
use crate::cli::shared::text;
use crate::jobs::input::GridStats;
use crate::jobs::tin::Cost;
use crate::raster::{GridInfo, Note, notes, notes_on_heights};

/// What is known of a grid.
#[derive(Serialize)]
pub(crate) struct Facts {
    file: String,
    format: &'static str,
    width: u32,
    height: u32,
    samples: u64,
    sample_type: &'static str,
    bands: u32,
    band: u32,
    nodata: Option<f64>,
    scale: f64,
    offset: f64,
    crs: String,
    epsg: Option<u32>,
    vertical_epsg: Option<u32>,
    horizontal_unit: &'static str,
    vertical_unit: Option<String>,
    georeferenced: bool,
    pixel_is_point: bool,
    /// As GDAL has it: of the outer corner of cell (0, 0).
    geotransform: [f64; 6],
    cell_size: [f64; 2],
    /// West, south, east, north of the samples.
    sample_bounds: [f64; 4],
    /// West, south, east, north of the cells around them.
    bounds: [f64; 4],
    block: [u32; 2],
    details: serde_json::Map<String, serde_json::Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stats: Option<GridStats>,
    /// What a TIN of it would take; absent where it has no cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    tin: Option<Cost>,
    notes: Vec<Note>,
}

impl Facts {
    pub(crate) fn new(
        file: &str,
        info: &GridInfo,
        stats: Option<GridStats>,
        tin: Option<Cost>,
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
            sample_bounds: bounds(info, 0.0),
            bounds: bounds(info, 0.5),
            block: [info.block.0, info.block.1],
            details: details::of(&info.details),
            notes: all_notes(info, stats.as_ref()),
            stats,
            tin,
        }
    }

    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let size = [self.width, self.height].map(|n| text::count(n.into())).join(" x ");
        let unit = self.horizontal_unit;
        let mut rows = vec![
            ("format", self.format.to_owned()),
            ("size", format!("{size}, {} samples", text::count(self.samples))),
            ("type", self.sample_type.to_owned()),
            ("band", format!("{} of {}", self.band, self.bands)),
            ("nodata", self.nodata.map_or("none".to_owned(), text::number)),
            ("crs", self.crs.clone()),
            ("vertical", self.vertical_unit.clone().unwrap_or_else(|| "unit unknown".to_owned())),
            ("cell", format!("{} {unit}", self.cell_size.map(text::position).join(" x "))),
            ("samples are", if self.pixel_is_point { "points" } else { "areas" }.to_owned()),
            ("bounds", self.bounds.map(text::position).join(", ")),
            ("transform", self.geotransform.map(text::position).join(", ")),
            ("block", format!("{} x {}", self.block[0], self.block[1])),
        ];
        if (self.scale, self.offset) != (1.0, 0.0) {
            let line =
                format!("stored x {} + {}", text::number(self.scale), text::number(self.offset));
            rows.push(("height", line));
        }
        let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
        rows.extend(details::rows(&self.details));
        rows.extend(self.stats.iter().flat_map(|stats| stats_rows(stats, self.samples)));
        rows.extend(self.tin.iter().flat_map(cost_rows));
        rows.extend(self.notes.iter().map(|note| ("note".to_owned(), note.text.clone())));
        rows
    }
}

/// Notes on what the file says, and on its heights where they were read.
fn all_notes(info: &GridInfo, stats: Option<&GridStats>) -> Vec<Note> {
    let samples = u64::from(info.width) * u64::from(info.height);
    let on_heights = stats.map(|stats| {
        let suspects = stats.suspected_nodata.map(|stored| (stored, stats.at_min));
        let range = stats.min.zip(stats.max).map(|(low, high)| [low, high]);
        notes_on_heights(info, (samples, stats.valid), range, suspects)
    });
    notes(info).into_iter().chain(on_heights.into_iter().flatten()).collect()
}

fn cost_rows(plan: &Cost) -> Vec<(String, String)> {
    let [coarse, fine] = plan.seconds.map(text::seconds);
    let rates: Vec<String> = std::iter::zip(plan.nanoseconds_per_sample, plan.kept)
        .map(|(rate, kept)| format!("{} ns at {} kept", text::number(rate), text::percent(kept)))
        .collect();
    let threads = if plan.threads == 1 { "thread" } else { "threads" };
    let [least, memory] = [plan.least_memory, plan.memory].map(text::bytes);
    let mut rows = vec![
        ("tin memory", format!("{least} at least, {memory} allowed (--memory)")),
        (
            "tin time",
            format!(
                "about {coarse} to {fine} on {} {threads} (a sample and thread: {})",
                plan.threads,
                rates.join(", ")
            ),
        ),
    ];
    let [coarse, fine] = plan.mesh_bytes.map(text::bytes);
    let mut disk = format!("about {coarse} to {fine} for the mesh (PLY)");
    if plan.spill_bytes[1] > 0 {
        let [coarse, fine] = plan.spill_bytes.map(text::bytes);
        disk += &format!(", {coarse} to {fine} of temporary space");
    }
    rows.push(("tin disk", disk));
    rows.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn stats_rows(stats: &GridStats, samples: u64) -> Vec<(String, String)> {
    let share = text::percent(stats.valid as f64 / samples.max(1) as f64);
    let mut rows = vec![("valid".to_owned(), format!("{}, {share}", text::count(stats.valid)))];
    let heights = [
        ("lowest", stats.min),
        ("highest", stats.max),
        ("mean", stats.mean),
        ("std dev", stats.std_dev),
    ];
    let known =
        heights.iter().filter_map(|(name, z)| Some((name.to_string(), text::number((*z)?))));
    rows.extend(known);
    rows
}

/// World rectangle around the samples, widened by `margin` cells.
fn bounds(info: &GridInfo, margin: f64) -> [f64; 4] {
    let (right, bottom) =
        (f64::from(info.width) - 1.0 + margin, f64::from(info.height) - 1.0 + margin);
    let corners = [(-margin, -margin), (right, -margin), (-margin, bottom), (right, bottom)];
    let world = corners.map(|(col, row)| info.transform.apply(col, row));
    let low = |axis: usize| world.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| world.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    [low(0), low(1), high(0), high(1)]
}
