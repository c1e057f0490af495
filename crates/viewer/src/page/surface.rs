//! The page of a mesh, complete, with the error of each triangle if a grid is given.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::facts::{self, SurfaceSystem};
use super::solid::{PageMesh, TRIANGLE_BYTES, VERTEX_BYTES};
use super::{MAX_TRIANGLES, PageJob, PageReport, errors, within_memory};
use crate::html::HtmlPage;
use crate::html::pack::PackedArray;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::input::vertex_count;
use terrane_engine::memory::cache_beside;
use terrane_engine::{Cancel, Progress};
use terrane_mesh::{MeshInfo, MeshSource};
use terrane_raster::{self as raster, GridOpenOptions, Inputs};

/// Vertices or triangles read at once.
const BATCH: u64 = 1 << 16;

/// A grid that errors are measured against, and its options.
pub(super) struct ReferenceGrid {
    pub(super) name: Inputs,
    pub(super) opening: GridOpenOptions,
}

pub(super) fn page(
    mesh: &dyn MeshSource,
    against: Option<&ReferenceGrid>,
    bounds: Option<[f64; 4]>,
    job: &PageJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(HtmlPage, PageReport)> {
    check_size(mesh.info(), job)?;
    let mut shape = read(mesh, progress, cancel)?;
    if let Some(bounds) = bounds {
        shape.crop(bounds);
    }
    let mut page = HtmlPage::new("surface", &facts::title(job.input))?;
    let system = SurfaceSystem::of_mesh(mesh.info());
    let mut figures = vec![];
    let mut max_error = None;
    if let Some(against) = against {
        let grid = raster::open_all(against.name.names(), &against.opening)?;
        let measured = errors::measure(&shape, grid.as_ref(), progress, cancel)?;
        figures.push(("Errors against", json!(facts::title(&against.name))));
        figures.push(("Largest error", json!(describe(measured.largest, &system))));
        figures.push(("Error RMS", json!(describe(measured.root_mean_square, &system))));
        figures.push(("Samples compared", json!(measured.samples)));
        page.fact("error_scale", measured.largest);
        page.array("errors", PackedArray::floats(&measured.of_triangles));
        max_error = Some(measured.largest);
    }
    let mut report = shape.put(&mut page)?;
    report.max_error = max_error;
    let steps = reported_steps(&report, system.geographic);
    facts::put(&mut page, job, &system, report.bounds, steps);
    page.fact("about", facts::about(&system));
    figures.extend(stated(mesh.info()));
    page.fact("figures", json!(figures));
    page.fact("notes", json!(notes(&report)));
    Ok((page, report))
}

fn check_size(info: &MeshInfo, job: &PageJob<'_>) -> Result<()> {
    let vertices = if info.indexed { info.vertices } else { info.triangles.saturating_mul(3) };
    if info.triangles > MAX_TRIANGLES || vertices > 3 * MAX_TRIANGLES {
        let message = format!(
            "the page limit is {MAX_TRIANGLES} triangles; this mesh has {}",
            info.triangles.max(vertices / 3)
        );
        return Err(Error::new(ErrorKind::Limit, message)
            .remedy("use a larger ‹max_error›, or draw a picture with -o"));
    }
    // Meshes without indices are welded through a map of positions.
    let vertex = VERTEX_BYTES + if info.indexed { 0 } else { 64 };
    let need = info.triangles * TRIANGLE_BYTES
        + vertices * vertex
        + cache_beside(job.resources.memory) as u64;
    within_memory(need, &format!("{} triangles", info.triangles), job.resources)
}

/// Reads all of a mesh.
fn read(mesh: &dyn MeshSource, progress: &dyn Progress, cancel: &Cancel) -> Result<PageMesh> {
    let (vertices, triangles) = (vertex_count(mesh), mesh.info().triangles);
    let mut shape = PageMesh::default();
    shape.axes.iter_mut().for_each(|axis| axis.reserve_exact(vertices as usize));
    shape.triangles.reserve_exact(triangles as usize);
    progress.begin("read", vertices + triangles);
    batches(vertices, |first, count| {
        cancel.check()?;
        let mut batch = vec![[0.0; 3]; count];
        mesh.read_vertices(first, &mut batch)?;
        for (id, position) in (first..).zip(batch) {
            if !position.iter().all(|c| c.is_finite()) {
                return Err(Error::bad_input(format!("vertex {id} lacks a finite position")));
            }
            shape.push(position);
        }
        progress.advance(count as u64);
        Ok(())
    })?;
    batches(triangles, |first, count| {
        cancel.check()?;
        let mut batch = vec![[0; 3]; count];
        mesh.read_triangles(first, &mut batch)?;
        for (id, triangle) in (first..).zip(batch) {
            if let Some(vertex) = triangle.iter().find(|vertex| **vertex >= vertices) {
                let message = format!("triangle {id} refers to vertex {vertex} of {vertices}");
                return Err(Error::bad_input(message));
            }
            shape.triangles.push(triangle.map(|vertex| vertex as u32));
        }
        progress.advance(count as u64);
        Ok(())
    })?;
    progress.end();
    if !mesh.info().indexed {
        weld(&mut shape);
    }
    Ok(shape)
}

fn batches(all: u64, mut each: impl FnMut(u64, usize) -> Result<()>) -> Result<()> {
    let mut starts = (0..all).step_by(BATCH as usize);
    starts.try_for_each(|first| each(first, (all - first).min(BATCH) as usize))
}

/// Merges vertices at the same position.
fn weld(shape: &mut PageMesh) {
    let mut known = HashMap::new();
    let firsts: Vec<u32> = (0..shape.vertices() as u32)
        .map(|id| *known.entry(shape.at(id).map(f64::to_bits)).or_insert(id))
        .collect();
    shape.triangles.iter_mut().flatten().for_each(|vertex| *vertex = firsts[*vertex as usize]);
    shape.drop_unused();
}

/// An error with its unit, to six digits.
fn describe(error: f64, system: &SurfaceSystem) -> String {
    let digits = (5 - error.max(1e-9).log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{error:.digits$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {}", system.units[1]).trim_end().to_owned()
}

/// Metadata of a mesh.
fn stated(info: &MeshInfo) -> Vec<(&'static str, Value)> {
    let promises = info.promises().unwrap_or_default();
    let statements = promises.statements().filter(|(key, _)| *key == "max error");
    statements.map(|(_, text)| ("Declared max error", json!(text))).collect()
}

/// Rounding steps of positions and heights.
pub(super) fn reported_steps(report: &PageReport, geographic: bool) -> [f64; 2] {
    let [west, _, east, _] = report.bounds;
    let level = if geographic { 1e-6 } else { decade((east - west) * 1e-6).clamp(1e-4, 1.0) };
    let range = report.highest.unwrap_or(0.0) - report.lowest.unwrap_or(0.0);
    [level, decade(range * 1e-6).clamp(1e-5, 0.01)]
}

/// The power of ten above a number.
fn decade(value: f64) -> f64 {
    if value > 0.0 { 10f64.powf(value.log10().ceil()) } else { 1e-5 }
}

fn notes(report: &PageReport) -> Vec<String> {
    let mut notes = vec![];
    if report.rounding > 0.0 {
        notes.push(format!(
            "Coordinates are within {:.2e} of the file's coordinates.",
            report.rounding
        ));
    }
    if report.max_error.is_some() {
        notes.push("Errors are vertical distances at grid samples.".to_owned());
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::tests::{job, within};

    #[test]
    fn meshes_beyond_the_limit_and_the_memory_are_refused_by_name() {
        let (input, resources) = (Inputs::default(), within(1 << 30));
        let job = job(&input, &resources);
        let check =
            |vertices, triangles| check_size(&MeshInfo::plain("PLY", vertices, triangles), &job);
        assert!(check(1_000_000, 2_000_000).is_ok());
        let error = check(5_500_000, MAX_TRIANGLES + 1).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Limit);
        assert!(error.to_string().contains("10485760 triangles"), "{error}");
        let error = check(5_000_000, 10_000_000).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Resource);
        assert!(error.to_string().contains("‹memory›"), "{error}");
    }

    #[test]
    fn errors_are_told_to_six_digits() {
        let system = SurfaceSystem::of_mesh(&MeshInfo::plain("PLY", 3, 1));
        let told = |error| describe(error, &system);
        assert_eq!(
            [told(10.0), told(3.321_818), told(0.0), told(123_456.7)],
            ["10", "3.32182", "0", "123457"]
        );
    }

    #[test]
    fn equal_positions_become_one_vertex() {
        let mut shape = PageMesh::default();
        for position in [
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
        ] {
            shape.push(position);
        }
        shape.triangles = vec![[0, 1, 2], [3, 4, 5]];
        weld(&mut shape);
        assert_eq!((shape.vertices(), &shape.triangles[..]), (4, &[[0, 1, 2], [1, 3, 2]][..]));
    }
}
