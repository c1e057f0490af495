//! Summary of `terrane info` for grids.

use crate::cli::info::details;
use crate::cli::shared::text;
use terrane_engine::input::GridStats;
use terrane_terrain::tin::TinCost;
use terrane_viewer::info::GridInfoReport;

/// Names and values.
pub(crate) fn rows(grid: &GridInfoReport) -> Vec<(String, String)> {
    let size = [grid.width, grid.height].map(|n| text::count(n.into())).join(" x ");
    let unit = grid.horizontal_unit;
    let mut rows = vec![
        ("format", grid.format.to_owned()),
        ("size", format!("{size}, {} samples", text::count(grid.samples))),
        ("type", grid.sample_type.to_owned()),
        ("band", format!("{} of {}", grid.band, grid.bands)),
        ("nodata", grid.nodata.map_or("none".to_owned(), text::number)),
        ("crs", grid.crs.clone()),
        ("vertical", grid.vertical_unit.clone().unwrap_or_else(|| "unit unknown".to_owned())),
        ("cell", format!("{} {unit}", grid.cell_size.map(text::position).join(" x "))),
        ("samples are", if grid.pixel_is_point { "points" } else { "areas" }.to_owned()),
        ("bounds", grid.bounds.map(text::position).join(", ")),
        ("transform", grid.geotransform.map(text::position).join(", ")),
        ("block", format!("{} x {}", grid.block[0], grid.block[1])),
    ];
    if (grid.scale, grid.offset) != (1.0, 0.0) {
        let line = format!("stored x {} + {}", text::number(grid.scale), text::number(grid.offset));
        rows.push(("height", line));
    }
    let mut rows: Vec<_> = rows.into_iter().map(|(k, v)| (k.to_owned(), v)).collect();
    rows.extend(details::rows(&grid.details));
    rows.extend(grid.stats.iter().flat_map(|stats| stats_rows(stats, grid.samples)));
    rows.extend(grid.tin.iter().flat_map(cost_rows));
    rows.extend(grid.notes.iter().map(|note| ("note".to_owned(), note.text.clone())));
    rows
}

fn cost_rows(plan: &TinCost) -> Vec<(String, String)> {
    let [coarse, fine] = plan.seconds.map(text::seconds);
    let rates: Vec<String> = std::iter::zip(plan.nanoseconds_per_sample, plan.kept)
        .map(|(rate, kept)| format!("{} ns at {} kept", text::number(rate), text::percent(kept)))
        .collect();
    let threads = if plan.threads == 1 { "thread" } else { "threads" };
    let [min_memory, memory] = [plan.least_memory, plan.memory].map(text::bytes);
    let mut rows = vec![
        ("tin memory", format!("at least {min_memory}, {memory} allowed (--memory)")),
        (
            "tin time",
            format!(
                "about {coarse} to {fine} on {} {threads} (per sample and thread: {})",
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
