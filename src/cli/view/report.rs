//! Summary of pictures and pages.

use crate::cli::shared::report::Summarize;
use crate::cli::shared::{points, report, text};
use terrane_viewer::page::PageReport;
use terrane_viewer::view::ViewReport;

impl Summarize for ViewReport {
    fn summary(&self) -> String {
        let heights = match (self.lowest, self.highest) {
            (Some(low), Some(high)) => {
                format!("{} to {}", text::number(low.into()), text::number(high.into()))
            }
            _ => "none (no surface in this picture)".to_owned(),
        };
        let mut rows = vec![
            (
                "picture",
                format!(
                    "{} x {} pixels, {}",
                    self.width,
                    self.height,
                    text::bytes(self.output_bytes)
                ),
            ),
            ("bounds", self.bounds.map(text::number).join(", ")),
            ("heights", heights),
            ("exaggeration", text::number(self.exaggeration)),
        ];
        rows.extend(report::took(&self.run, None, ""));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}

impl Summarize for PageReport {
    fn summary(&self) -> String {
        let mut rows = vec![("page", format!("{}, {}", self.page, text::bytes(self.output_bytes)))];
        let triangles = self.triangles.map(|n| format!(", {} triangles", text::count(n)));
        if let Some(vertices) = self.vertices {
            let vertices =
                format!("{} vertices{}", text::count(vertices), triangles.unwrap_or_default());
            rows.push(("holds", vertices));
        }
        if let (Some(shown), Some(census)) = (self.points, &self.census) {
            let of = if shown < census.kept { ", chosen evenly" } else { "" };
            let shown =
                format!("{} of {} points{of}", text::count(shown), text::count(census.kept));
            rows.push(("shows", shown));
            rows.push(("points", points::census(census)));
        }
        if let (Some(tiles), Some(levels)) = (self.tiles, self.levels) {
            rows.push(("shows", format!("{} tiles of {levels} levels", text::count(tiles))));
        }
        if let (Some(parts), Some(features)) = (self.parts, self.features) {
            let of = format!(
                "{} lines and rings of {} features",
                text::count(parts),
                text::count(features)
            );
            rows.push(("lines", of));
        }
        if let Some(stride) = self.stride.filter(|stride| *stride > 1) {
            rows.push(("samples", format!("one in {stride} along rows and columns")));
        }
        rows.push(("bounds", self.bounds.map(text::number).join(", ")));
        if let (Some(low), Some(high)) = (self.lowest, self.highest) {
            rows.push(("heights", format!("{} to {}", text::number(low), text::number(high))));
        }
        if let Some(error) = self.max_error {
            rows.push(("error", format!("at most {}", text::number(error))));
        }
        rows.extend(report::took(&self.run, None, ""));
        format!("{} -> {}\n{}", self.input, self.output, text::table(&rows))
    }
}
