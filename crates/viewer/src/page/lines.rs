//! The page of lines: all lines and rings of a file. Each vertex has the thresholds at which Ramer-Douglas-Peucker and
//! Visvalingam-Whyatt drop it, so that the page simplifies by a comparison.

use std::path::Path;

use serde_json::json;

use super::{MAX_VERTICES, PageJob, PageReport, facts, within_memory};
use crate::html::HtmlPage;
use crate::html::pack::{PackedArray, QuantizedAxis};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::Crs;
use terrane_engine::{Cancel, Progress};
use terrane_files::path_of;
use terrane_simplify::{DistanceKind, thresholds};
use terrane_vector::{self as vector, GeometryPart, VectorOpenOptions};

/// Bytes that a page takes for a vertex: positions, thresholds, codes, planes of bytes and texts.
const VERTEX_BYTES: u64 = 16 + 16 + 8 + 48;

/// Names of the methods, their bounds, and their arrays.
const METHODS: [(&str, &str, &str); 2] =
    [("Ramer-Douglas-Peucker", "distance", "distances"), ("Visvalingam-Whyatt", "area", "areas")];

/// All lines, one after the other; rings without their closing vertex.
#[derive(Default)]
struct PageLines {
    axes: [Vec<f64>; 2],
    thresholds: [Vec<f32>; 2],
    /// Vertices of each part, doubled, and one more for rings.
    parts: Vec<i32>,
    /// Vertices as the file has them.
    vertices: u64,
    features: u64,
    /// Features without a line.
    others: u64,
}

pub(super) fn page(
    layer: Option<&String>,
    job: &PageJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(HtmlPage, PageReport)> {
    let [input] = job.input.names() else {
        return Err(
            Error::usage("a page shows only one line file").remedy("pass one file at a time")
        );
    };
    let path = path_of(input);
    let options = VectorOpenOptions { layer: layer.cloned(), ..Default::default() };
    let mut source = vector::open(&path, &options)?;
    let mut crs = source.layer().crs.clone();
    let measure = match crs.geographic == Some(true) && are_degrees(&path, &options, cancel)? {
        true => DistanceKind::Geographic,
        false => DistanceKind::Plane,
    };
    if measure == DistanceKind::Plane && crs.geographic == Some(true) {
        // GeoJSON without a CRS is in degrees by its standard, but often is not in practice.
        crs = Crs::default();
    }
    let mut lines = PageLines::default();
    progress.begin("features", source.layer().features.unwrap_or(0));
    while let Some(feature) = source.next()? {
        cancel.check()?;
        lines.features += 1;
        let before = lines.parts.len();
        for part in feature.geometry.parts() {
            lines.push(&part, measure, job).map_err(|e| e.at(source.location()).in_file(&path))?;
        }
        lines.others += u64::from(lines.parts.len() == before);
        progress.advance(1);
    }
    progress.end();
    lines.page(job, &crs, measure)
}

/// True if all positions of a file are longitudes and latitudes.
fn are_degrees(path: &Path, options: &VectorOpenOptions, cancel: &Cancel) -> Result<bool> {
    let mut source = vector::open(path, options)?;
    while let Some(feature) = source.next()? {
        cancel.check()?;
        if !feature.geometry.parts().all(|part| part.xy.iter().all(is_degree)) {
            return Ok(false);
        }
    }
    Ok(true)
}

fn is_degree([x, y]: &[f64; 2]) -> bool {
    x.abs() <= 360.0 && y.abs() <= 90.0
}

impl PageLines {
    fn push(
        &mut self,
        part: &GeometryPart<'_>,
        measure: DistanceKind,
        job: &PageJob<'_>,
    ) -> Result<()> {
        self.vertices += part.xy.len() as u64;
        if self.vertices > MAX_VERTICES {
            let message = format!("the lines exceed the page limit of {MAX_VERTICES} vertices");
            return Err(Error::new(ErrorKind::Limit, message)
                .remedy("simplify the lines first with ‹terrane simplify›"));
        }
        within_memory(self.vertices * VERTEX_BYTES, "these vertices", job.resources)?;
        let thresholds = thresholds(part, measure)?;
        let count = thresholds[0].len();
        for (all, added) in self.thresholds.iter_mut().zip(&thresholds) {
            all.extend(added.iter().map(|threshold| *threshold as f32));
        }
        for (axis, all) in self.axes.iter_mut().enumerate() {
            all.extend(part.xy[..count].iter().map(|xy| xy[axis]));
        }
        // Fits: a page has at most 2^22 vertices.
        self.parts.push(2 * count as i32 + i32::from(part.is_ring()));
        Ok(())
    }

    fn page(
        self,
        job: &PageJob<'_>,
        crs: &Crs,
        measure: DistanceKind,
    ) -> Result<(HtmlPage, PageReport)> {
        if self.parts.is_empty() {
            return Err(Error::bad_input("no lines to show")
                .in_file(&path_of(&job.input.to_string()))
                .remedy("name a file with lines or polygons"));
        }
        let mut page = HtmlPage::new("lines", &facts::title(job.input))?;
        let mut report = PageReport {
            page: "lines",
            vertices: Some(self.vertices),
            parts: Some(self.parts.len() as u64),
            features: Some(self.features),
            ..PageReport::default()
        };
        let mut ends = [[0.0; 2]; 2];
        for ((name, values), ends) in ["x", "y"].into_iter().zip(&self.axes).zip(&mut ends) {
            let axis = QuantizedAxis::of(values);
            *ends = [axis.low, values.iter().copied().fold(f64::NEG_INFINITY, f64::max)];
            report.rounding = report.rounding.max(axis.rounding);
            page.axis(name, &axis);
        }
        let [[west, east], [south, north]] = ends;
        report.bounds = [west, south, east, north];
        page.array("parts", PackedArray::signed(self.parts.iter().copied()));
        for ((_, _, array), thresholds) in METHODS.iter().zip(&self.thresholds) {
            page.array(array, PackedArray::floats(thresholds));
        }
        self.add_facts(&mut page, &report, crs, measure);
        Ok((page, report))
    }

    fn add_facts(
        &self,
        page: &mut HtmlPage,
        report: &PageReport,
        crs: &Crs,
        measure: DistanceKind,
    ) {
        let system = facts::SurfaceSystem::of_features(crs);
        let unit = match measure {
            DistanceKind::Geographic => "m".to_owned(),
            _ => system.units[0].clone(),
        };
        page.fact("about", facts::about(&system));
        page.fact("geographic", system.geographic);
        page.fact("ground", json!(system.ground(report.bounds)));
        page.fact("unit", unit);
        page.fact("vertices", self.vertices);
        page.fact("features", self.features);
        page.fact("methods", json!(METHODS));
        let mut notes = vec![match measure {
            DistanceKind::Geographic => {
                "Distances and areas are in metres on the ellipsoid.".to_owned()
            }
            _ => "Distances and areas are in the units of the data.".to_owned(),
        }];
        if report.rounding > 0.0 {
            notes.push(format!(
                "Lines are drawn to within {:.2e}; thresholds use the file's coordinates.",
                report.rounding
            ));
        }
        if self.others > 0 {
            notes.push(format!("{} features have no lines.", self.others));
        }
        page.fact("notes", json!(notes));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::tests::{job, within};
    use terrane_raster::Inputs;
    use terrane_vector::Geometry;

    #[test]
    fn lines_beyond_the_limit_and_the_memory_are_refused_by_name() {
        let line = Geometry::line(vec![[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]);
        let part = line.parts().next().unwrap();
        let push = |vertices, memory| {
            let mut lines = PageLines { vertices, ..PageLines::default() };
            lines.push(&part, DistanceKind::Plane, &job(&Inputs::default(), &within(memory)))
        };
        assert!(push(0, 64 << 20).is_ok());
        assert_eq!(push(MAX_VERTICES - 2, 4 << 30).unwrap_err().kind(), ErrorKind::Limit);
        assert_eq!(push(MAX_VERTICES - 3, 64 << 20).unwrap_err().kind(), ErrorKind::Resource);
    }
}
