//! The page of a grid: every n-th sample of it along rows and columns, the last ones included, as a mesh.

use serde_json::json;

use super::facts::{self, SurfaceSystem};
use super::solid::{PageMesh, TRIANGLE_BYTES, VERTEX_BYTES};
use super::surface::reported_steps;
use super::{MAX_SAMPLES, PageJob, PageReport, within_memory};
use crate::html::HtmlPage;
use crate::view::corner_bounds;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_engine::memory::cache_beside;
use terrane_engine::{Cancel, Progress};
use terrane_raster::{GridInfo, GridSource};

pub(super) fn page(
    grid: &dyn GridSource,
    bounds: Option<[f64; 4]>,
    job: &PageJob<'_>,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(HtmlPage, PageReport)> {
    let info = grid.info();
    let part = part(info, bounds)?;
    let stride = stride(part, MAX_SAMPLES);
    let samples = [part.width, part.height].map(|side| u64::from(side.div_ceil(stride)) + 1);
    let shown = samples[0] * samples[1];
    let need = shown * (8 + VERTEX_BYTES + 2 * TRIANGLE_BYTES) + 8 * u64::from(info.width);
    let cache = cache_beside(job.resources.memory) as u64;
    within_memory(need + cache, &format!("{shown} samples"), job.resources)?;
    let shape = shape(grid, part, stride, progress, cancel)?;
    let mut page = HtmlPage::new("surface", &facts::title(job.input))?;
    let mut report = shape.put(&mut page)?;
    report.stride = Some(stride);
    let system = SurfaceSystem::of_grid(info);
    let steps = reported_steps(&report, system.geographic);
    facts::put(&mut page, job, &system, report.bounds, steps);
    page.fact("about", facts::about(&system));
    let size = format!("{} × {} samples", info.width, info.height);
    page.fact("figures", json!([["Grid", size], ["Shown", shown_text(stride)]]));
    page.fact("notes", json!(notes(stride)));
    Ok((page, report))
}

fn shown_text(stride: u32) -> String {
    if stride == 1 {
        "every sample".to_owned()
    } else {
        format!("1 sample in {}", u64::from(stride) * u64::from(stride))
    }
}

fn notes(stride: u32) -> Vec<String> {
    let all = "Each cell with four valid samples is drawn as two triangles.".to_owned();
    let some = format!("Every {stride}th sample of rows and columns is shown.");
    if stride == 1 { vec![all] } else { vec![some, all] }
}

/// The samples in `bbox`, and those around it.
pub(super) fn part(info: &GridInfo, bbox: Option<[f64; 4]>) -> Result<Rect> {
    let Some([west, south, east, north]) = bbox else { return Ok(info.bounds()) };
    let corners = [(west, south), (west, north), (east, south), (east, north)];
    let places = corners.map(|(x, y)| info.transform.invert(x, y));
    let [left, top, right, bottom] = corner_bounds(places);
    match (samples_between(left, right, info.width), samples_between(top, bottom, info.height)) {
        (Some((col, width)), Some((row, height))) => Ok(Rect::new(col, row, width, height)),
        _ => Err(Error::usage("‹bounds› lies outside the data").remedy("see `terrane info`")),
    }
}

/// First and number of the samples from `low` to `high` and next to them, among `count`.
fn samples_between(low: f64, high: f64, count: u32) -> Option<(u32, u32)> {
    let (low, high) = (low.floor().max(0.0), high.ceil().min(f64::from(count - 1)));
    (low <= high).then(|| (low as u32, (high - low) as u32 + 1))
}

/// The smallest stride that leaves about `max_samples` samples or fewer.
fn stride(part: Rect, max_samples: u64) -> u32 {
    let estimate = ((part.len() as f64 / max_samples as f64).sqrt() as u32).max(1);
    (estimate..)
        .find(|stride| {
            let [cols, rows] = [part.width, part.height].map(|side| side.div_ceil(*stride));
            u64::from(cols) * u64::from(rows) <= max_samples
        })
        .unwrap_or(u32::MAX)
}

/// Every `stride`-th of `count` places from `first` on, and the last.
pub(super) fn places(first: u32, count: u32, stride: u32) -> Vec<u32> {
    let last = first + count - 1;
    let mut places: Vec<u32> = (first..last).step_by(stride as usize).collect();
    places.push(last);
    places
}

fn shape(
    grid: &dyn GridSource,
    part: Rect,
    stride: u32,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<PageMesh> {
    let (cols, rows) =
        (places(part.col, part.width, stride), places(part.row, part.height, stride));
    let map = grid.info().transform;
    let mut shape = PageMesh::default();
    let mut line = vec![0.0; part.width as usize];
    let [mut above, mut below] = [vec![None; cols.len()], vec![None; cols.len()]];
    progress.begin("read", rows.len() as u64);
    for row in rows {
        cancel.check()?;
        let rect = Rect::new(part.col, row, part.width, 1);
        grid.read_f64(rect, &mut line)?;
        for (place, col) in below.iter_mut().zip(&cols) {
            let z = line[(col - part.col) as usize];
            *place = z.is_finite().then_some(shape.vertices() as u32);
            if z.is_finite() {
                let [x, y] = map.apply((*col).into(), row.into());
                shape.push([x, y, z]);
            }
        }
        let is_mirrored = map.determinant() > 0.0;
        for (north, south) in above.windows(2).zip(below.windows(2)) {
            let &[Some(a), Some(b)] = north else { continue };
            let &[Some(c), Some(d)] = south else { continue };
            let pair = if is_mirrored { [[a, d, c], [a, b, d]] } else { [[a, c, d], [a, d, b]] };
            shape.triangles.extend(pair);
        }
        std::mem::swap(&mut above, &mut below);
        grid.release(rect);
        progress.advance(1);
    }
    progress.end();
    shape.drop_unused();
    Ok(shape)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_base::geom::Affine;
    use terrane_engine::Silent;
    use terrane_raster::SampleType;

    /// Heights of 100 * column + row, with a void.
    struct Plane(GridInfo);

    impl GridSource for Plane {
        fn info(&self) -> &GridInfo {
            &self.0
        }

        fn read_f32(&self, _: Rect, _: &mut [f32]) -> Result<()> {
            Ok(())
        }

        fn read_f64(&self, rect: Rect, out: &mut [f64]) -> Result<()> {
            for (i, z) in (0..).zip(out) {
                let (col, row) = (rect.col + i % rect.width, rect.row + i / rect.width);
                *z = if (col, row) == (8, 4) { f64::NAN } else { f64::from(100 * col + row) };
            }
            Ok(())
        }
    }

    fn plane() -> Plane {
        let transform = Affine { x0: 1000.0, a: 10.0, b: 0.0, y0: 5000.0, d: 0.0, e: -10.0 };
        Plane(GridInfo { transform, ..GridInfo::plain("test", 10, 7, SampleType::F32) })
    }

    #[test]
    fn every_nth_sample_and_the_last_are_vertices_with_their_own_heights() {
        let grid = plane();
        let shape = shape(&grid, grid.0.bounds(), 4, &Silent, &Cancel::default()).unwrap();
        // Columns 0, 4, 8, 9 and rows 0, 4, 6; the void at (8, 4) takes four cells.
        assert_eq!((shape.vertices(), shape.triangles.len()), (6, 4));
        for vertex in 0..6 {
            let [x, y, z] = shape.at(vertex);
            assert_eq!(z, 100.0 * (x - 1000.0) / 10.0 + (5000.0 - y) / 10.0);
        }
        for triangle in &shape.triangles {
            let [a, b, c] = triangle.map(|vertex| shape.at(vertex));
            let turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            assert!(turn > 0.0, "counter-clockwise from above");
        }
    }

    #[test]
    fn strides_keep_within_the_limit() {
        for (width, height, most) in
            [(1, 1, 1), (4097, 4097, 1 << 20), (100_000, 3, 1000), (7, 9, 1)]
        {
            let stride = stride(Rect::new(0, 0, width, height), most);
            let of = |s: u32| u64::from(width.div_ceil(s)) * u64::from(height.div_ceil(s));
            assert!(of(stride) <= most && (stride == 1 || of(stride - 1) > most), "{stride}");
        }
        assert_eq!(places(5, 1, 3), [5]);
    }

    #[test]
    fn a_part_is_what_lies_around_its_box() {
        let info = plane().0;
        let part = |bbox| part(&info, Some(bbox)).map(|r| [r.col, r.row, r.width, r.height]);
        assert_eq!(part([1015.0, 4955.0, 1041.0, 4985.0]).unwrap(), [1, 1, 5, 5]);
        assert_eq!(part([0.0, 0.0, 9999.0, 9999.0]).unwrap(), [0, 0, 10, 7]);
        assert!(part([2000.0, 0.0, 2100.0, 9999.0]).is_err());
    }
}
