//! Summaries of filled voids and of differences of grids.

use crate::cli::shared::report::{Row, Summarize};
use crate::cli::shared::{report, text};
use terrane_terrain::convert::ConvertReport;
use terrane_terrain::difference::DifferenceReport;
use terrane_terrain::fill::FillReport;

impl Summarize for FillReport {
    fn summary(&self) -> String {
        let [filled, left] = [self.filled, self.left].map(text::count);
        summary(&self.common, vec![("filled", filled), ("still void", left)])
    }
}

impl Summarize for DifferenceReport {
    fn summary(&self) -> String {
        let common = &self.common;
        let mut rows = vec![("reference", self.reference.clone())];
        rows.extend(common.transformed.iter().map(|own| ("reprojected by", own.operation.clone())));
        rows.extend(common.resampling.iter().map(|name| ("resampled by", name.clone())));
        let [compared, grid, reference] =
            [self.compared, self.only_grid, self.only_reference].map(text::count);
        let one = format!("{grid} in the grid, {reference} in the reference");
        rows.extend([("compared", compared), ("only", one)]);
        let place = |value: Option<f64>, at: Option<[f64; 2]>| {
            let [x, y] = at?.map(text::position);
            Some(format!("{} at {x}, {y}", text::number(value?)))
        };
        let lowest = place(common.lowest, self.lowest_at);
        let highest = place(common.highest, self.highest_at);
        rows.extend(lowest.map(|lowest| ("lowest", lowest)));
        rows.extend(highest.map(|highest| ("highest", highest)));
        let spread = self.mean.zip(self.stdev).zip(self.rmse.zip(self.mean_absolute));
        rows.extend(spread.map(|((mean, stdev), (rmse, absolute))| {
            let [mean, stdev, rmse, absolute] = [mean, stdev, rmse, absolute].map(text::number);
            ("mean", format!("{mean}, stdev {stdev}, RMSE {rmse}, mean absolute {absolute}"))
        }));
        let sides = [
            ("above", "fill", self.area_above, self.volume_above),
            ("below", "cut", self.area_below, self.volume_below),
        ];
        rows.extend(sides.into_iter().filter_map(|(side, name, area, volume)| {
            let [area, volume] = [area?, volume?].map(text::number);
            Some((side, format!("{area} m2, {volume} m3 ({name})")))
        }));
        summary(common, rows)
    }
}

fn summary(common: &ConvertReport, own: Vec<Row>) -> String {
    let size = format!("{} x {} samples, {}", common.width, common.height, common.sample_type);
    let mut rows = vec![("grid", size), ("CRS", common.crs.clone())];
    rows.extend(common.water.iter().map(|water| ("water", text::water(water))));
    rows.extend(own);
    rows.push(("output", format!("{}, {}", common.format, text::bytes(common.output_bytes))));
    rows.extend(report::took(
        &common.run,
        Some(text::rate(common.samples_per_second, "samples")),
        "",
    ));
    rows.extend(report::notes(&common.notes));
    format!("{} -> {}\n{}", common.input, common.output, text::table(&rows))
}
