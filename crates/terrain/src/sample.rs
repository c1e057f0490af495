//! Heights of a grid at the positions of features: as a property of points, or as the z of all vertices.
//!
//! Positions of a batch of features are sorted by the tile of the grid that they lie in, so that each tile is read once a
//! batch, on any thread. Features are written in the order of the file.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::annotate::{self, AnnotatedFeatures, AnnotatedNames, BatchedFeature};
use crate::convert::job::ResamplingName;
use terrane_base::error::{Error, Result};
use terrane_base::registry;
use terrane_engine::memory::{self, MemoryShares};
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FeatureInput, FileName, FileOutput, GridInput};
use terrane_engine::outputs::not_member;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::transform::Transformed;
use terrane_engine::{Cancel, Resources, workers};
use terrane_files::atomic;
use terrane_options::{OptionRange, OptionRule, Options};
use terrane_raster::{self as raster, GridOpenOptions, GridSource};
use terrane_vector::{CoordinateSequence, FieldKind, GeometryType, PropertyValue, VectorFormat};
use terrane_window::resample::{Place, RESAMPLINGS, ResamplingMethod, Scale, SourceWindow};

/// Side of a tile, in samples.
const TILE: u32 = 256;
/// Most positions of a unit of work.
const POSITIONS: usize = 4096;
/// Bytes of a worker: a tile with the samples around it, and the positions of a unit.
const WORKER_BYTES: u64 = (TILE as u64 + 8).pow(2) * 8 + POSITIONS as u64 * 32;
/// Bytes of a vertex at work: as a position, in the order of tiles, its height, and in the feature.
const VERTEX_BYTES: u64 = 96;

/// Heights of a grid at points
///
/// Writes the features with the height of the grid at each point as a property, null at voids and beyond the grid; or, with
/// ‹with_z›, with the heights as z of all vertices, of lines and polygons too. Features in another CRS than the grid are
/// reprojected to find their heights, and written as they are.
#[derive(Clone, Debug, PartialEq, Options)]
#[options(setters = own, rules = RULES)]
#[non_exhaustive]
pub struct SampleOptions {
    /// File of points, lines or polygons
    #[option(value = "FEATURES", with = FileName, role = Reads, positional)]
    pub points: PathBuf,
    /// Interpolation between samples
    #[option(value = "NAME", with = ResamplingName, default = "bilinear".to_owned())]
    pub resampling: String,
    /// Write heights as z of each vertex instead of a property
    #[option(alias = "3d", heading = "Output")]
    pub with_z: bool,
    /// Maximum distance of vertices of lines and polygons, in units of their x and y: longer segments are divided into
    /// equal parts
    #[option(value = "LENGTH", range = OptionRange::POSITIVE, heading = "Output")]
    pub step: Option<f64>,
    /// Name of the height property
    #[option(short = 'a', value = "NAME", default = "height".to_owned(), heading = "Output")]
    pub attribute: String,
    /// How the features are read.
    #[option(flatten)]
    pub features: FeatureInput,
    /// The output file.
    #[option(flatten)]
    pub file: FileOutput,
    /// How the grid is read.
    #[option(flatten)]
    pub grid: GridInput,
    /// Memory, threads and temporary files.
    #[option(flatten)]
    pub resources: Resources,
}

const RULES: &[OptionRule] =
    &[OptionRule::Needs("step", &["with_z"]), OptionRule::NotWith("with_z", &["attribute"])];

impl SampleOptions {
    /// The format to write.
    fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        if !self.with_z {
            return annotate::format(output, &self.file, GeometryType::Point);
        }
        let format = terrane_vector::by_path(output, self.file.format.as_deref())?;
        match format.holds.z {
            true => Ok(format),
            false => Err(Error::usage(format!("{} does not support z", format.name))
                .in_file(output)
                .remedy("write GeoJSON, FlatGeobuf or Shapefile")),
        }
    }

    fn fields(&self) -> Vec<(String, FieldKind)> {
        let named = (!self.with_z).then(|| (self.attribute.clone(), FieldKind::Real));
        named.into_iter().collect()
    }
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct SampleReport {
    pub input: String,
    /// File of the features.
    pub points_file: String,
    pub output: String,
    /// Name of the written format.
    pub format: String,
    /// CRS of the grid.
    pub crs: String,
    /// Transformation of the features to the CRS of the grid, if theirs differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transformed: Option<Transformed>,
    /// Features written.
    pub features: u64,
    /// Positions, and those without a height.
    pub positions: u64,
    pub without_height: u64,
    /// Least and greatest height.
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
    pub notes: Vec<String>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: RunStatistics,
    pub positions_per_second: f64,
}

impl SampleReport {
    fn count(&mut self, height: f64) {
        self.positions += 1;
        if height.is_nan() {
            self.without_height += 1;
            return;
        }
        self.lowest = Some(self.lowest.map_or(height, |low| low.min(height)));
        self.highest = Some(self.highest.map_or(height, |high| high.max(height)));
    }
}

impl Operation for SampleOptions {
    const NAME: &'static str = "sample";
    type Input = GridInput;
    const WRITES: Writes = Writes::Features;
    type Report = SampleReport;

    fn check(&self, output: &Path) -> Result<()> {
        self.format(output).map(drop)
    }

    fn run(&self, request: RunRequest<'_>) -> Result<SampleReport> {
        run(self, request)
    }
}

fn run(options: &SampleOptions, request: RunRequest<'_>) -> Result<SampleReport> {
    let start = Instant::now();
    let RunRequest { inputs, output, progress, cancel, .. } = request;
    let format = options.format(output)?;
    atomic::refuse_existing(output, options.file.replacing.overwrite)?;
    let (resources, cache) = (&options.resources, GridOpenOptions::default().cache_bytes);
    let opening = options.grid.options(resources, cache)?;
    let (grid, shares) = memory::open(inputs, &opening, resources, WORKER_BYTES)?;
    not_member(grid.as_ref(), output)?;
    let info = grid.info();
    info.check_cells().map_err(|e| e.in_file(Path::new(&inputs.to_string())))?;
    let points = annotate::path(&options.points);
    let layer = options.features.layer.as_deref();
    let are_points = !options.with_z;
    let names = AnnotatedNames { input: &points, layer, are_points, output, file: &options.file };
    let fields = options.fields();
    let mut features = AnnotatedFeatures::open(&names, format, &fields, info, &options.resources)?;
    let method = registry::named(RESAMPLINGS, &options.resampling)?;
    let job = SampleJob { options, grid: grid.as_ref(), method, shares, cancel };
    let mut report = SampleReport::default();
    progress.begin("features", 0);
    loop {
        let batch = features.read(shares.mesh / 2)?;
        if batch.is_empty() {
            break;
        }
        let mut left = VecDeque::from(batch);
        while !left.is_empty() {
            cancel.check()?;
            let count = job.write(&mut left, &mut features, &mut report)?;
            progress.advance(count);
        }
    }
    cancel.check()?;
    report.transformed = features.place().transformed();
    let written = features.finish()?;
    progress.end();
    report.notes = [written.notes, raster::cautions(info)].concat();
    let run = RunStatistics::since(start, &options.resources).with_threads(shares.threads);
    Ok(SampleReport {
        input: inputs.to_string(),
        points_file: points.display().to_string(),
        output: output.display().to_string(),
        format: format.name.to_owned(),
        crs: info.crs.label(),
        output_bytes: written.bytes,
        positions_per_second: run.rate(report.positions),
        run,
        ..report
    })
}

struct SampleJob<'a> {
    options: &'a SampleOptions,
    grid: &'a dyn GridSource,
    method: &'static ResamplingMethod,
    shares: MemoryShares,
    cancel: &'a Cancel,
}

impl SampleJob<'_> {
    /// Finds the heights of the next features, writes them, and returns their number.
    fn write(
        &self,
        left: &mut VecDeque<BatchedFeature<'_>>,
        features: &mut AnnotatedFeatures<'_>,
        report: &mut SampleReport,
    ) -> Result<u64> {
        let (mut batch, mut places) = (Vec::new(), Vec::new());
        while let Some(mut own) = left.pop_front() {
            self.divide(&mut own)?;
            for leaf in own.feature.geometry.leaves() {
                let xy = &leaf.coordinates().xy;
                places.extend(features.place().samples(xy));
            }
            batch.push(own);
            // Those divided into parts take more than they did as they were read.
            if places.len() as u64 * VERTEX_BYTES > self.shares.mesh / 4 {
                break;
            }
        }
        let heights = self.heights(&places)?;
        heights.iter().for_each(|height| report.count(*height));
        let count = batch.len() as u64;
        let mut heights = heights.into_iter();
        for mut own in batch {
            let value = if self.options.with_z {
                own.feature.geometry.for_each_leaf(&mut |leaf| {
                    leaf.z = heights.by_ref().take(leaf.xy.len()).collect();
                });
                None
            } else {
                let height = heights.by_ref().take(own.feature.geometry.vertices()).last();
                let height = height.filter(|height| !height.is_nan());
                Some(height.map_or(PropertyValue::Null, PropertyValue::Real))
            };
            features.write(&mut own, value)?;
            report.features += 1;
        }
        Ok(count)
    }

    /// Divides long segments; fails for features that one property cannot describe.
    fn divide(&self, own: &mut BatchedFeature<'_>) -> Result<()> {
        if !self.options.with_z && own.feature.geometry.vertices() > 1 {
            let kind = own.feature.geometry.kind().name();
            let error = Error::bad_input(format!("{kind} has several positions, not one"));
            return Err(own.error(error.remedy("pass ‹with_z› for a height at each vertex")));
        }
        let Some(step) = self.options.step else { return Ok(()) };
        let parts = own.feature.geometry.parts();
        let vertices: f64 = parts
            .flat_map(|part| part.xy.windows(2))
            .map(|pair| pieces(pair[0], pair[1], step))
            .sum();
        if vertices * VERTEX_BYTES as f64 > (self.shares.mesh / 4) as f64 {
            let message = format!("the feature has {vertices} vertices in steps of {step}");
            let workers = WORKER_BYTES * self.options.resources.threads as u64;
            let needed = memory::with_slack(8 * (vertices as u64).saturating_mul(VERTEX_BYTES));
            let enough = (memory::PROGRAM + workers).saturating_add(needed);
            return Err(own.error(memory::short(message, enough).or("a longer ‹step›")));
        }
        own.feature.geometry.for_each_leaf(&mut |leaf| densify(leaf, step));
        Ok(())
    }

    /// The height at each place; NaN for none.
    fn heights(&self, places: &[Place]) -> Result<Vec<f64>> {
        let tile = |place: &Place| place.map(|at| (at.max(0.0) as u32) / TILE);
        let mut order: Vec<u32> = (0..places.len() as u32).collect();
        order.sort_by_key(|place| {
            let [col, row] = tile(&places[*place as usize]);
            (row, col)
        });
        let groups =
            order.chunk_by(|a, b| tile(&places[*a as usize]) == tile(&places[*b as usize]));
        let units: Vec<&[u32]> = groups.flat_map(|group| group.chunks(POSITIONS)).collect();
        let mut heights = vec![f64::NAN; places.len()];
        workers::in_order(
            self.shares.threads,
            units.len() as u64,
            self.cancel,
            SampleBuffers::default,
            |buffers: &mut SampleBuffers, unit| self.unit(places, units[unit as usize], buffers),
            |(unit, found): (&[u32], Vec<f64>)| {
                unit.iter()
                    .zip(found)
                    .for_each(|(place, height)| heights[*place as usize] = height);
                Ok(())
            },
        )?;
        Ok(heights)
    }

    /// The heights of some places in a tile.
    fn unit<'u>(
        &self,
        places: &[Place],
        unit: &'u [u32],
        buffers: &mut SampleBuffers,
    ) -> Result<(&'u [u32], Vec<f64>)> {
        let info = self.grid.info();
        let grid = [info.width, info.height];
        let SampleBuffers { samples, places: own } = buffers;
        own.clear();
        own.extend(unit.iter().map(|place| places[*place as usize]));
        let mut found = vec![f64::NAN; unit.len()];
        let rect = self.method.needed(grid, own, Scale::ONE);
        if !rect.is_empty() {
            samples.clear();
            samples.resize(rect.len(), 0.0);
            self.grid.read_f64(rect, samples)?;
            self.grid.copied(rect);
            let window = SourceWindow { grid, rect, heights: samples };
            self.method.heights(&window, own, Scale::ONE, &mut found);
        }
        Ok((unit, found))
    }
}

#[derive(Default)]
struct SampleBuffers {
    samples: Vec<f64>,
    places: Vec<Place>,
}

/// Parts of a segment that are no longer than a step, at least one.
fn pieces([ax, ay]: [f64; 2], [bx, by]: [f64; 2], step: f64) -> f64 {
    ((bx - ax).hypot(by - ay) / step).ceil().max(1.0)
}

/// Adds vertices to the lines and rings of a geometry; drops heights, which are found anew.
fn densify(leaf: &mut CoordinateSequence, step: f64) {
    let CoordinateSequence { xy, m, ends, polygons, .. } = std::mem::take(leaf);
    let mut dense = CoordinateSequence { polygons, ..CoordinateSequence::default() };
    if ends.is_empty() {
        (dense.xy, dense.m) = (xy, m);
        *leaf = dense;
        return;
    }
    let measure = |at: usize| m.get(at).copied();
    let mut start = 0;
    for end in ends {
        for at in start..end {
            dense.push(xy[at], None, measure(at));
            if at + 1 == end {
                break;
            }
            let ([ax, ay], [bx, by]) = (xy[at], xy[at + 1]);
            let count = pieces(xy[at], xy[at + 1], step);
            for piece in 1..count as u64 {
                let t = piece as f64 / count;
                let mixed = |a: f64, b: f64| a + (b - a) * t;
                let m = measure(at).zip(measure(at + 1)).map(|(a, b)| mixed(a, b));
                dense.push([mixed(ax, bx), mixed(ay, by)], None, m);
            }
        }
        dense.ends.push(dense.xy.len());
        start = end;
    }
    *leaf = dense;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_equal_and_no_longer_than_a_step() {
        let mut leaf = CoordinateSequence {
            m: vec![0.0, 9.0, 9.0, 8.0],
            ends: vec![2, 4],
            ..CoordinateSequence::of(vec![[0.0, 0.0], [9.0, 12.0], [0.0, 0.0], [0.0, 2.0]])
        };
        densify(&mut leaf, 5.0);
        let expected = [[0.0, 0.0], [3.0, 4.0], [6.0, 8.0], [9.0, 12.0], [0.0, 0.0], [0.0, 2.0]];
        assert_eq!(leaf.xy, expected);
        assert_eq!((leaf.m, leaf.ends), (vec![0.0, 3.0, 6.0, 9.0, 9.0, 8.0], vec![4, 6]));
    }
}
