//! Summary of grids of point clouds.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{report, text};
use terrane_lidar::grid::GridReport;

impl Summarize for GridReport {
    fn summary(&self) -> String {
        let unit = self.vertical_unit.as_deref().unwrap_or("vertical unit unknown");
        let [width, height] = self.cell.map(text::number);
        let mut rows = vec![
            ("points", points(self)),
            (
                "grid",
                format!(
                    "{} x {} cells of {width} x {height}, {}, {unit}",
                    text::count(self.width.into()),
                    text::count(self.height.into()),
                    self.crs
                ),
            ),
            ("bands", bands(self)),
        ];
        rows.extend(self.water.as_ref().map(|water| ("water", text::water(water))));
        rows.push((
            "file",
            format!("{}, {}, {}", text::bytes(self.output_bytes), self.format, self.sample_type),
        ));
        let stages = self.stages.iter().map(|s| format!("{} {}", s.name, text::seconds(s.seconds)));
        let stages = stages.collect::<Vec<_>>().join(", ");
        let rate = text::rate(self.points_per_second, "points");
        rows.extend(report::took(&self.run, Some(rate), &stages));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}

fn points(r: &GridReport) -> String {
    let p = &r.points;
    let dropped = [
        (p.withheld, "withheld"),
        (p.filtered, "filtered out"),
        (p.outside, "outside the bounds of the header"),
        (p.lost, "lost"),
        (r.outside_grid, "outside the grid"),
    ];
    let dropped = dropped.into_iter().filter(|(count, _)| *count > 0);
    let dropped = dropped.map(|(count, why)| format!(", {} {why}", text::count(count)));
    let read = match r.cloud_points {
        None => format!("{} read", text::count(p.read)),
        Some(all) => {
            let [all, read] = [all, p.read].map(text::count);
            format!(
                "{all} in the cloud; {read} read by tiles (points near a border more than once)"
            )
        }
    };
    read + &dropped.collect::<String>()
}

fn bands(r: &GridReport) -> String {
    let bands = r.bands.iter().map(|band| {
        let share = band.valid as f64 / r.cells.max(1) as f64;
        format!("{} ({} of the cells)", band.name, text::percent(share))
    });
    bands.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_lidar::grid::GridBandReport;

    #[test]
    fn a_summary_tells_what_became_of_the_points() {
        let mut report = GridReport::default();
        report.points =
            terrane_cloud::ReturnCounts { read: 1234, kept: 1200, withheld: 34, ..report.points };
        report.outside_grid = 7;
        report.bands = vec![GridBandReport { name: "mean".into(), valid: 5 }];
        report.cells = 10;
        (report.run.spilled_bytes, report.run.peak_memory) = (Some(2048), Some(1));
        let told = report.summary();
        for part in
            ["1,234 read, 34 withheld, 7 outside the grid", "mean (50.00 % of", "2.0 KiB through"]
        {
            assert!(told.contains(part), "{part} in\n{told}");
        }
    }
}
