//! Opens and measures a surface from any file, grid or mesh, out of core.

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use crate::{Cancel, Progress, Resources};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::geom::{self, Point3, Rect};
use terrane_files::{RawFile, is_made, path_of, without_query};
use terrane_mesh::{self as mesh, MeshInfo, MeshSource};
use terrane_raster::{self as raster, GridInfo, GridOpenOptions, GridSource};

/// An opened surface.
pub enum SurfaceInput {
    /// A grid of heights.
    Grid(Box<dyn GridSource>),
    /// A mesh.
    Mesh(Box<dyn MeshSource>),
}

/// Opens a grid or a mesh, detected by file extension, then by the first bytes. An input may be a synthetic terrain by
/// name; several inputs form one mosaic.
pub fn open(inputs: &[String], options: &GridOpenOptions) -> Result<SurfaceInput> {
    match inputs {
        [one] if is_mesh(one)? => mesh::open(&path_of(one)).map(SurfaceInput::Mesh),
        _ => raster::open_all(inputs, options).map(SurfaceInput::Grid),
    }
}

/// True if `input` is a mesh, false if it is a grid. Fails if it is neither, or unreadable.
pub fn is_mesh(input: &str) -> Result<bool> {
    let path = &*path_of(raster::file_name(input));
    if mesh::split::is_split(path) {
        return Ok(true);
    }
    if is_made(input) || raster::is_collection(input) {
        return Ok(false);
    }
    let name = without_query(path).file_name().unwrap_or_default();
    let name = name.to_string_lossy().to_lowercase();
    let head = head(path)?;
    if raster::FORMATS.iter().any(|f| has_extension(&name, f.extensions)) {
        return Ok(false);
    }
    if mesh::FORMATS.iter().any(|f| has_extension(&name, f.extensions)) {
        return Ok(true);
    }
    if raster::has_header(path)
        || raster::FORMATS.iter().any(|f| (f.sniff)(&head[..head.len().min(64)]))
    {
        return Ok(false);
    }
    if mesh::FORMATS.iter().any(|f| (f.sniff)(&head)) {
        return Ok(true);
    }
    let known: Vec<&str> = raster::FORMATS
        .iter()
        .map(|f| f.name)
        .chain(mesh::FORMATS.iter().map(|f| f.name))
        .collect();
    Err(Error::bad_input("not a grid or mesh of a known format")
        .in_file(path)
        .remedy(format!("supported: {}", known.join(", "))))
}

fn has_extension(name: &str, extensions: &[&str]) -> bool {
    extensions.iter().any(|e| name.strip_suffix(e).is_some_and(|stem| stem.ends_with('.')))
}

/// The first 512 bytes of a file, or all of a shorter one.
fn head(path: &Path) -> Result<Vec<u8>> {
    RawFile::open(path)?.head(512)
}

/// Height statistics of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridStats {
    /// Samples with a height.
    pub valid: u64,
    /// Lowest height, when there is one.
    pub min: Option<f64>,
    /// Highest height.
    pub max: Option<f64>,
    /// Mean height.
    pub mean: Option<f64>,
    /// Standard deviation of the heights.
    pub std_dev: Option<f64>,
    /// Samples at the lowest height.
    pub at_min: u64,
    /// Suggested nodata value: the stored lowest height, if it looks like an undeclared nodata value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suspected_nodata: Option<f64>,
}

/// Maximum samples per read of a worker.
const WINDOW_SAMPLES: u64 = 1 << 20;

/// Computes the height statistics of a grid, window by window. The result does not depend on the number of threads.
pub fn grid_stats(
    grid: &dyn GridSource,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<GridStats> {
    let info = grid.info();
    let windows = windows(info, window_samples(resources));
    progress.begin("read", u64::from(info.width) * u64::from(info.height));
    let moments = workers(resources)?.install(|| {
        let measured = windows.par_iter().map(|&rect| {
            cancel.check()?;
            let mut heights = vec![0.0; rect.len()];
            grid.read_f64(rect, &mut heights)?;
            grid.release(rect);
            progress.advance(rect.len() as u64);
            Ok(HeightMoments::of(&heights))
        });
        measured.collect::<Result<Vec<_>>>()
    })?;
    progress.end();
    let stats = moments.into_iter().fold(HeightMoments::NONE, HeightMoments::and).stats();
    let suspected_nodata = stats.min.and_then(|min| raster::looks_like_nodata(min, info));
    Ok(GridStats { suspected_nodata, ..stats })
}

/// Samples per worker, at 8 bytes each: all workers together use a quarter of the budget.
pub fn window_samples(resources: &Resources) -> u64 {
    (resources.memory / 32 / resources.threads.max(1) as u64).clamp(1 << 12, WINDOW_SAMPLES)
}

/// A thread pool of the requested size.
pub fn workers(resources: &Resources) -> Result<rayon::ThreadPool> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(resources.threads).build();
    pool.map_err(|e| Error::new(ErrorKind::Resource, format!("cannot start threads: {e}")))
}

/// Windows that cover a grid, row by row, aligned to its blocks, of about `max` samples at most.
fn windows(info: &GridInfo, max: u64) -> Vec<Rect> {
    let (block_cols, block_rows) = (info.block.0.max(1), info.block.1.max(1));
    let max_rows = (max / u64::from(info.width.max(1))).max(u64::from(block_rows).min(max));
    let rows = whole_blocks(block_rows, max_rows, info.height);
    let cols = whole_blocks(block_cols, max / u64::from(rows.max(1)), info.width);
    let first_cols = (0..info.width).step_by(cols.max(1) as usize);
    (0..info.height)
        .step_by(rows.max(1) as usize)
        .flat_map(|row| first_cols.clone().map(move |col| Rect::new(col, row, cols, rows)))
        .map(|window| window.intersect(&info.bounds()))
        .collect()
}

/// Whole blocks that fit in `max` samples along a side of `end`; part of a block if none fits.
fn whole_blocks(block: u32, max: u64, end: u32) -> u32 {
    let blocks = max / u64::from(block);
    let size = if blocks > 0 { blocks * u64::from(block) } else { max.max(1) };
    size.min(u64::from(end)) as u32
}

/// Count, extremes, mean and sum of squared deviations of heights.
#[derive(Clone, Copy)]
struct HeightMoments {
    count: u64,
    min: f64,
    at_min: u64,
    max: f64,
    mean: f64,
    squares: f64,
}

impl HeightMoments {
    const NONE: Self = Self {
        count: 0,
        min: f64::INFINITY,
        at_min: 0,
        max: f64::NEG_INFINITY,
        mean: 0.0,
        squares: 0.0,
    };

    fn of(heights: &[f64]) -> Self {
        let valid = heights.iter().copied().filter(|z| !z.is_nan());
        let (count, sum) = valid.clone().fold((0u64, 0.0), |(n, sum), z| (n + 1, sum + z));
        if count == 0 {
            return Self::NONE;
        }
        let mean = sum / count as f64;
        let squares = valid.clone().map(|z| (z - mean) * (z - mean)).sum();
        let min = valid.clone().fold(f64::INFINITY, f64::min);
        let max = valid.clone().fold(f64::NEG_INFINITY, f64::max);
        let at_min = valid.filter(|z| *z == min).count() as u64;
        Self { count, min, at_min, max, mean, squares }
    }

    /// Merges two sets of statistics (Chan, Golub & LeVeque 1979).
    fn and(self, other: Self) -> Self {
        let count = self.count + other.count;
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { other } else { self };
        }
        let (share, apart) = (other.count as f64 / count as f64, other.mean - self.mean);
        Self {
            count,
            min: self.min.min(other.min),
            at_min: self.at_min_with(&other),
            max: self.max.max(other.max),
            mean: self.mean + apart * share,
            squares: self.squares + other.squares + apart * apart * share * self.count as f64,
        }
    }

    /// Samples at the lowest height of both.
    fn at_min_with(&self, other: &Self) -> u64 {
        let min = self.min.min(other.min);
        [self, other].iter().filter(|m| m.min == min).map(|m| m.at_min).sum()
    }

    fn stats(self) -> GridStats {
        let has_heights = self.count > 0;
        GridStats {
            valid: self.count,
            min: has_heights.then_some(self.min),
            max: has_heights.then_some(self.max),
            mean: has_heights.then_some(self.mean),
            std_dev: has_heights.then_some((self.squares / self.count.max(1) as f64).sqrt()),
            at_min: self.at_min,
            suspected_nodata: None,
        }
    }
}

/// Vertices per read.
const VERTEX_BATCH: u64 = 1 << 16;

/// Minimum and maximum coordinates of a mesh's vertices, `None` without vertices. Ignores vertices that are not finite.
pub fn mesh_bounds(
    mesh: &dyn MeshSource,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<Option<[Point3; 2]>> {
    let vertices = vertex_count(mesh);
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let mut batch = vec![[0.0; 3]; vertices.min(VERTEX_BATCH) as usize];
    progress.begin("bounds", vertices);
    for first in (0..vertices).step_by(VERTEX_BATCH as usize) {
        cancel.check()?;
        let count = (vertices - first).min(VERTEX_BATCH);
        let batch = &mut batch[..count as usize];
        mesh.read_vertices(first, batch)?;
        batch.iter().filter(|v| v.iter().all(|c| c.is_finite())).for_each(|v| grow(&mut bounds, v));
        progress.advance(count);
    }
    progress.end();
    Ok((bounds[0][0] <= bounds[1][0]).then_some(bounds))
}

/// Number of vertices that [`MeshSource::read_vertices`] can read.
pub fn vertex_count(mesh: &dyn MeshSource) -> u64 {
    let info = mesh.info();
    if info.indexed { info.vertices } else { info.triangles.saturating_mul(3) }
}

/// True if x and y of a mesh are longitudes and latitudes.
pub fn is_geographic(info: &MeshInfo) -> bool {
    // Only degrees are stored in a unit of their own along each axis.
    let [x, y, _] = info.scale;
    x != y || info.crs.as_deref().is_some_and(names_geographic)
}

/// True if a label such as "EPSG:4326 (WGS 84)" names a geographic CRS.
fn names_geographic(label: &str) -> bool {
    let digits = label.split("EPSG:").nth(1).unwrap_or_default();
    let code: String = digits.chars().take_while(char::is_ascii_digit).collect();
    code.parse().ok().and_then(geom::is_geographic).unwrap_or(false)
}

fn grow(bounds: &mut [Point3; 2], vertex: &Point3) {
    for axis in 0..3 {
        bounds[0][axis] = bounds[0][axis].min(vertex[axis]);
        bounds[1][axis] = bounds[1][axis].max(vertex[axis]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrane_raster::SampleType;

    fn info(width: u32, height: u32, block: (u32, u32)) -> GridInfo {
        GridInfo { block, ..GridInfo::plain("test", width, height, SampleType::F32) }
    }

    #[test]
    fn windows_cover_a_grid_once_within_their_size() {
        let shapes = [
            (1000, 700, (256, 256)),
            (1000, 700, (1000, 1)),
            (5000, 3, (5000, 3)),
            (1, 900, (1, 900)),
        ];
        for (width, height, block) in shapes {
            let windows = windows(&info(width, height, block), 4096);
            let all: usize = windows.iter().map(Rect::len).sum();
            assert_eq!(all, width as usize * height as usize);
            let most = windows.iter().map(Rect::len).max().unwrap();
            assert!(most <= 4096, "{width}x{height}: {most}");
        }
    }

    #[test]
    fn moments_join_like_one_pass() {
        let heights: Vec<f64> = (0..100).map(|i| f64::from(i * i % 37)).collect();
        let whole = HeightMoments::of(&heights).stats();
        let parts = heights
            .chunks(7)
            .map(HeightMoments::of)
            .fold(HeightMoments::NONE, HeightMoments::and)
            .stats();
        assert_eq!((whole.valid, whole.min, whole.max), (parts.valid, parts.min, parts.max));
        assert_eq!((whole.at_min, parts.at_min), (3, 3), "0, 37 and 74");
        assert!((whole.mean.unwrap() - parts.mean.unwrap()).abs() < 1e-12);
        assert!((whole.std_dev.unwrap() - parts.std_dev.unwrap()).abs() < 1e-12);
        let none = HeightMoments::of(&[f64::NAN]).stats();
        assert_eq!((none.valid, none.mean), (0, None));
    }

    #[test]
    fn latitude_and_longitude_are_told_by_code() {
        assert!(names_geographic("EPSG:4326 (WGS 84)"));
        assert!(!names_geographic("EPSG:32611 (WGS 84 / UTM zone 11N)"));
        assert!(!names_geographic("unknown") && !names_geographic("EPSG:99999999999"));
    }
}
