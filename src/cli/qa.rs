//! Summary of a report on the quality of a point cloud.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{points, report, text};
use terrane_viewer::qa::{QaOverlap, QaReport};

impl Summarize for QaReport {
    fn summary(&self) -> String {
        let mut rows: Vec<report::Row> = vec![
            ("points", points::census(&self.contents.stats.census)),
            ("crs", self.crs.clone()),
        ];
        let unit = self.area_unit;
        if let (Some(points), Some(pulses)) = (&self.density, &self.pulse_density) {
            let [points, pulses] = [points, pulses].map(|it| text::number(it.mean));
            rows.push(("density", format!("{points} points, {pulses} pulses per square {unit}")));
        }
        if let Some(required) = &self.min_density {
            let verdict = required.verdict();
            let [density, below] = [required.required, required.below * 100.0].map(text::number);
            rows.push((
                "required",
                format!("{density} pulses: {verdict}; {below} % of cells below"),
            ));
        }
        if let Some(voids) = &self.voids {
            let [area, least] = [voids.area, voids.min_area].map(text::number);
            let count = text::count(voids.count);
            rows.push(("voids", format!("{count} of {least} or more, together {area}")));
        }
        let worst = self.overlaps.iter().filter_map(|QaOverlap { rmse, .. }| *rmse);
        let worst = worst.max_by(f64::total_cmp).map(text::number);
        let worst = worst.map_or(String::new(), |worst| format!(", RMSE up to {worst}"));
        let overlaps =
            format!("{} overlapping pairs{worst}", text::count(self.overlaps.len() as u64));
        rows.push(("lines", format!("{}; {overlaps}", text::count(self.lines.len() as u64))));
        rows.push(("findings", text::count(self.findings.len() as u64)));
        rows.extend(report::took(&self.run, None, ""));
        rows.extend(report::notes(&self.notes));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}
