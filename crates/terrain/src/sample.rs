//! Heights of a grid at the positions of features: as a property of points, or as the z of all vertices.
//!
//! Positions of a batch of features are sorted by the tile of the grid that they lie in, so that each tile is read once a
//! batch, on any thread.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::annotate::{
    self, AnnotatedFile, AnnotationGrid, AnnotationOptions, AnnotationReport, AnnotationRequest,
    BatchedFeature, FeatureBatch,
};
use crate::convert::job::ResamplingName;
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_base::registry;
use terrane_engine::operation::{Operation, RunRequest, Writes};
use terrane_engine::options::{FileName, GridInput};
use terrane_engine::workers;
use terrane_options::{OptionRange, OptionRule, Options};
use terrane_raster::GridInfo;
use terrane_vector::{self as vector, CoordinateSequence, FieldKind, GeometryType, VectorFormat};
use terrane_window::coverage::TILE;
use terrane_window::resample::{Place, RESAMPLINGS, ResamplingMethod, Scale, SourceWindow};

/// Most positions of a unit of work.
const POSITIONS: usize = 4096;
/// Bytes of a worker: a tile with the samples around it, and the positions of a unit.
const WORKER_BYTES: u64 = (TILE as u64 + 8).pow(2) * 8 + POSITIONS as u64 * 32;
/// Bytes of a position at work: itself, its place in the order of tiles, its height, and as a vertex.
const POSITION_BYTES: u64 = 96;
/// Vertices of a feature beyond which no memory is advised.
const TOO_MANY: f64 = (1_u64 << 40) as f64;

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
    pub features: PathBuf,
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
    /// Grid, features and output.
    #[option(flatten)]
    pub common: AnnotationOptions,
}

const RULES: &[OptionRule] =
    &[OptionRule::Needs("step", &["with_z"]), OptionRule::NotWith("with_z", &["attribute"])];

impl SampleOptions {
    /// The format to write.
    fn format(&self, output: &Path) -> Result<&'static VectorFormat> {
        let file = &self.common.file;
        if !self.with_z {
            return annotate::format(output, file, GeometryType::Point);
        }
        let format = vector::by_path(output, file.format.as_deref())?;
        match format.holds.z {
            true => Ok(format),
            false => Err(Error::usage(format!("{} does not support z", format.name))
                .in_file(output)
                .remedy("write GeoJSON, FlatGeobuf or Shapefile")),
        }
    }

    /// True if heights are whole numbers.
    fn is_whole(&self, info: &GridInfo, method: &ResamplingMethod) -> bool {
        method.radius == 0 && annotate::is_whole(info)
    }
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct SampleReport {
    #[serde(flatten)]
    pub common: AnnotationReport,
    /// Positions, and those without a height.
    pub positions: u64,
    pub without_height: u64,
    /// Least and greatest height.
    pub lowest: Option<f64>,
    pub highest: Option<f64>,
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
        let request = AnnotationRequest {
            options: &self.common,
            features: &self.features,
            run: request,
            format: self.format(request.output)?,
            are_points: !self.with_z,
            omits_geometry: false,
            worker: WORKER_BYTES,
            naming: "‹attribute›",
        };
        let method = registry::named(RESAMPLINGS, &self.resampling)?;
        let mut report = SampleReport::default();
        let fields = |info: &GridInfo| {
            let kind = if self.is_whole(info, method) { FieldKind::Int } else { FieldKind::Real };
            let height = (!self.with_z).then(|| (self.attribute.clone(), kind));
            height.into_iter().collect()
        };
        let common = annotate::run(&request, fields, |grid, batch, file| {
            SampleBatch { options: self, grid, method }.write(batch, file, &mut report)
        })?;
        let positions_per_second = common.run.rate(report.positions);
        Ok(SampleReport { common, positions_per_second, ..report })
    }
}

/// Some features at work.
struct SampleBatch<'a> {
    options: &'a SampleOptions,
    grid: &'a AnnotationGrid<'a>,
    method: &'static ResamplingMethod,
}

impl SampleBatch<'_> {
    /// Finds the heights of some features and writes them.
    fn write(
        &self,
        batch: FeatureBatch<'_>,
        file: &mut AnnotatedFile,
        report: &mut SampleReport,
    ) -> Result<()> {
        let (mut left, mut group, mut places) = (VecDeque::from(batch), Vec::new(), Vec::new());
        while let Some(mut own) = left.pop_front() {
            self.divide(&mut own)?;
            for leaf in own.feature.geometry.leaves() {
                let cells = leaf.coordinates().xy.iter().map(|at| self.grid.place.cell(*at));
                // Samples are in the centres of cells.
                places.extend(cells.map(|at| at.map_or([f64::NAN; 2], |at| at.map(|c| c - 0.5))));
            }
            group.push(own);
            // Those divided into parts take more than they did as they were read.
            let bytes = places.len() as u64 * POSITION_BYTES;
            if bytes > self.grid.shares.mesh / 4 || left.is_empty() {
                let heights = self.heights(&places)?;
                heights.iter().for_each(|height| report.count(*height));
                self.write_group(std::mem::take(&mut group), heights, file)?;
                places.clear();
            }
        }
        Ok(())
    }

    fn write_group(
        &self,
        group: FeatureBatch<'_>,
        heights: Vec<f64>,
        file: &mut AnnotatedFile,
    ) -> Result<()> {
        let is_whole = self.options.is_whole(self.grid.source.info(), self.method);
        let mut heights = heights.into_iter();
        for mut own in group {
            if self.options.with_z {
                own.feature.geometry.for_each_leaf(&mut |leaf| {
                    leaf.z = heights.by_ref().take(leaf.xy.len()).collect();
                });
                file.write(own, None)?;
            } else {
                let own_heights = heights.by_ref().take(own.feature.geometry.vertices());
                let height = own_heights.last().unwrap_or(f64::NAN);
                file.write(own, [annotate::property(height, is_whole)])?;
            }
        }
        Ok(())
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
        let segments = parts.flat_map(|part| part.xy.windows(2));
        let vertices: f64 = segments.map(|pair| pieces(pair[0], pair[1], step)).sum();
        if vertices * POSITION_BYTES as f64 > (self.grid.shares.mesh / 4) as f64 {
            let message = format!("the feature has {vertices:e} vertices in steps of {step:e}");
            let error = match vertices < TOO_MANY {
                true => {
                    let error = self.grid.short(message, vertices as u64 * POSITION_BYTES, 4);
                    error.or("a longer ‹step›")
                }
                false => Error::new(ErrorKind::Resource, message).remedy("pass a longer ‹step›"),
            };
            return Err(own.error(error));
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
            self.grid.shares.threads,
            units.len() as u64,
            self.grid.cancel,
            SampleBuffers::default,
            |buffers: &mut SampleBuffers, unit| {
                let unit = units[unit as usize];
                let found = self.unit(unit.iter().map(|place| places[*place as usize]), buffers)?;
                Ok((unit, found))
            },
            |(unit, found): (&[u32], Vec<f64>)| {
                let found = unit.iter().zip(found);
                found.for_each(|(place, height)| heights[*place as usize] = height);
                Ok(())
            },
        )?;
        Ok(heights)
    }

    /// The heights of some places in a tile.
    fn unit(
        &self,
        places: impl Iterator<Item = Place>,
        buffers: &mut SampleBuffers,
    ) -> Result<Vec<f64>> {
        let (source, method) = (self.grid.source, self.method);
        let info = source.info();
        let grid = [info.width, info.height];
        let SampleBuffers { samples, places: own } = buffers;
        own.clear();
        own.extend(places);
        let mut found = vec![f64::NAN; own.len()];
        let rect = method.needed(grid, own, Scale::ONE);
        if !rect.is_empty() {
            samples.clear();
            samples.resize(rect.len(), 0.0);
            source.read_f64(rect, samples)?;
            source.copied(rect);
            let window = SourceWindow { grid, rect, heights: samples };
            method.heights(&window, own, Scale::ONE, &mut found);
        }
        Ok(found)
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
