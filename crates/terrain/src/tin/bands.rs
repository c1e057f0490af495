//! Several bands of a grid to one mesh: read whole, triangulated on one thread, written with their values at
//! vertices.

use std::path::Path;
use std::time::Instant;

use super::baseline::{self, SampleMesh, StageTimes, WholeGridMethod, surface};
use super::goal::TinGoal;
use super::job::TinJob;
use super::make::{OpenedTinJob, TinMaker, VertexExtras, in_input, options};
use super::report::TinReport;
use super::run::TinOutcome;
use super::window::HeightBuffers;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Rect;
use terrane_baselines::{MultichannelTin, PackedSample, WeightedChannels, join_voids};
use terrane_engine::bands::{MeshBandReport, MeshBands, kind_of};
use terrane_engine::memory;
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::refuse_existing;
use terrane_mesh::{ChannelKind, MeshSink, VertexChannel};

/// Runs a job on several bands of its input: the error of a sample is the largest over the bands of weight x
/// |value - mesh|. Options of refinement and tiles are ignored.
///
/// # Errors
/// Those of [`run_by`](super::run_by); usage for bands that the grid does not have, and for a format that does
/// not support them.
pub fn run_bands(
    job: &TinJob,
    bands: &MeshBands,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<TinReport> {
    let started = Instant::now();
    job.goal.check()?;
    baseline::refuse_water(job, "for several bands")?;
    refuse_existing(&job.output, job.overwrite)?;
    let mut opened =
        OpenedTinJob::with(job, || open(job, bands).map_err(|error| in_input(error, &job.input)))?;
    let kinds = kinds(job, bands).map_err(|error| in_input(error, &job.input))?;
    // By their types alone first: a format without room for them fails before all is read.
    opened.carried = extras(bands, &kinds);
    opened.format.check_channels(&opened.carried.channels)?;
    let maker = TinMaker { job, opened: &opened, progress, cancel };
    let values = maker
        .check_output()
        .and_then(|()| BandValues::read(&maker, bands))
        .map_err(|error| in_input(error, &job.input))?;
    opened.carried = extras(bands, &values.kinds(kinds));
    let maker = TinMaker { job, opened: &opened, progress, cancel };
    let mut report = values.make(&maker, bands).map_err(|error| in_input(error, &job.input))?;
    report.took(started.elapsed());
    Ok(report)
}

/// Opens the band of heights, or else the first; fails if all bands do not fit into memory.
fn open(job: &TinJob, bands: &MeshBands) -> Result<memory::Opened> {
    let options = options(job)?;
    let all = memory::open_for_estimate(&job.input, &MeshBands::options(1, &options))?;
    bands.check(all.info()).map_err(|e| e.in_file(Path::new(&job.input.to_string())))?;
    drop(all);
    let (first, _) = bands.list()[0];
    baseline::open(
        job,
        &MeshBands::options(bands.heights().unwrap_or(first), &options),
        &whole_grid_method(bands),
    )
}

/// What a mesh of several bands needs in memory.
fn whole_grid_method(bands: &MeshBands) -> WholeGridMethod {
    WholeGridMethod {
        what: format!("a mesh of {} bands", bands.list().len()),
        sample_bytes: WeightedChannels::sample_bytes(bands.list().len()),
        otherwise: "downsample it first (gdal_translate -outsize)".to_owned(),
    }
}

/// How each band is stored, by its type alone.
fn kinds(job: &TinJob, bands: &MeshBands) -> Result<Vec<ChannelKind>> {
    let options = options(job)?;
    let sources = bands.list().iter().map(|&(band, _)| {
        memory::open_for_estimate(&job.input, &MeshBands::options(band, &options))
    });
    sources.map(|source| Ok(kind_of(source?.info()))).collect()
}

fn extras(bands: &MeshBands, kinds: &[ChannelKind]) -> VertexExtras {
    let numbers = bands.list().iter().map(|(band, _)| *band);
    let stored: Vec<_> = numbers.zip(kinds.iter().copied()).collect();
    let channels = VertexChannel::of_bands(&stored);
    VertexExtras { channels, bands: Some(bands.clone()), triangulation: None }
}

/// The values of all bands.
struct BandValues {
    size: [u32; 2],
    planes: Vec<Vec<f64>>,
    stages: StageTimes,
}

impl BandValues {
    /// Reads all bands in turn; a sample void in one band is void in all.
    fn read(maker: &TinMaker<'_>, bands: &MeshBands) -> Result<Self> {
        let info = maker.opened.source.info();
        let (size, mut stages) = ([info.width, info.height], StageTimes::default());
        let planes = stages.time(maker, "read", || {
            let planes = bands.list().iter().map(|&(band, _)| read(maker, band));
            let mut planes = planes.collect::<Result<Vec<_>>>()?;
            join_voids(&mut planes);
            Ok(planes)
        })?;
        Ok(Self { size, planes, stages })
    }

    /// How each band is stored: as f32 if that holds all its values.
    fn kinds(&self, by_type: Vec<ChannelKind>) -> Vec<ChannelKind> {
        let planes = by_type.into_iter().zip(&self.planes);
        let kinds = planes.map(|(kind, plane)| match kind {
            ChannelKind::Double if fits_f32(plane) => ChannelKind::Single,
            _ => kind,
        });
        kinds.collect()
    }

    fn make(self, maker: &TinMaker<'_>, bands: &MeshBands) -> Result<TinReport> {
        let Self { size, planes, mut stages } = self;
        let weights: Vec<f64> = bands.list().iter().map(|(_, weight)| *weight).collect();
        let goal = maker.job.goal;
        let drawn = stages.time(maker, "method", || {
            WeightedChannels::new(size, &planes, &weights)?
                .triangulate(baseline::baseline_goal(goal), &|| maker.cancel.check())
        })?;
        let [vertices, triangles] =
            [drawn.vertices.len(), drawn.triangles.len()].map(|count| count as u64);
        maker.opened.format.check_capacity(vertices, triangles)?;
        let values = VertexValues { planes: &planes, width: size[0], heights: heights(bands) };
        values.check_heights(maker, &drawn)?;
        let tolerance = match goal {
            TinGoal::MaxError(tolerance) => tolerance,
            TinGoal::MaxVertices(_) | TinGoal::MaxTriangles(_) => drawn.max_error,
        };
        let surface = surface(&drawn.census);
        let report = maker.complete(tolerance, 0, |sink, _| {
            let output_bytes = stages.time(maker, "write", || values.write(maker, &drawn, sink))?;
            Ok(TinOutcome {
                vertices,
                triangles,
                valid: drawn.census.valid,
                isolated: drawn.census.isolated,
                max_error: drawn.max_error,
                output_bytes,
                stages: stages.0,
                ..TinOutcome::default()
            })
        })?;
        let channels = bands.list().iter().zip(&drawn.channels);
        let band_reports = channels.map(|(&(band, weight), errors)| MeshBandReport {
            band,
            weight,
            max_error: Some(errors.max_error),
            rmse: Some((errors.square_sum / surface).sqrt()),
        });
        Ok(TinReport {
            method: Some("greedy4".to_owned()),
            triangulation: Some("delaunay".to_owned()),
            vertical_unit: "units".to_owned(),
            bands: band_reports.collect(),
            tiles: 1,
            tile_cells: size[0].max(size[1]) - 1,
            max_error: Some(drawn.max_error),
            rmse: None,
            ..report
        })
    }
}

/// True if each value is one of f32, or void.
fn fits_f32(plane: &[f64]) -> bool {
    plane.iter().all(|z| z.is_nan() || f64::from(*z as f32) == *z)
}

/// The index of the band of heights in the list.
fn heights(bands: &MeshBands) -> Option<usize> {
    let heights = bands.heights()?;
    bands.list().iter().position(|(band, _)| *band == heights)
}

/// All values of a band, checked as heights are.
fn read(maker: &TinMaker<'_>, band: u32) -> Result<Vec<f64>> {
    maker.cancel.check()?;
    let TinMaker { job, opened, .. } = maker;
    let info = opened.source.info();
    let other = match info.band == band {
        true => None,
        false => {
            let options = MeshBands::options(band, &options(job)?);
            let resources = Resources { threads: 1, ..job.resources.clone() };
            let samples = u64::from(info.width) * u64::from(info.height);
            let worker_bytes = samples * baseline::READ_BYTES;
            Some(memory::open(&job.input, &options, &resources, worker_bytes)?.0)
        }
    };
    let source = other.as_deref().unwrap_or(&*opened.source);
    let found = source.info();
    if [found.width, found.height] != [info.width, info.height] || found.transform != info.transform
    {
        let message = format!("bands {} and {band} differ in size or georeference", info.band);
        return Err(Error::unsupported(message).remedy("pass bands of one grid"));
    }
    let mut window = HeightBuffers::default();
    window.read(source, Rect::new(0, 0, info.width, info.height))?;
    Ok(baseline::all_heights(&window))
}

/// Values of the bands at vertices.
struct VertexValues<'a> {
    planes: &'a [Vec<f64>],
    width: u32,
    /// The plane of heights.
    heights: Option<usize>,
}

impl VertexValues<'_> {
    fn index(&self, at: PackedSample) -> usize {
        at.row() as usize * self.width as usize + at.col() as usize
    }

    fn height(&self, at: PackedSample) -> f64 {
        self.heights.map_or(0.0, |plane| self.planes[plane][self.index(at)])
    }

    /// The values of all bands at a sample.
    fn of_sample(&self, at: PackedSample) -> impl Iterator<Item = f64> + '_ {
        let index = self.index(at);
        self.planes.iter().map(move |plane| plane[index])
    }

    /// Fails where the format does not store the heights of vertices as they are.
    fn check_heights(&self, maker: &TinMaker<'_>, drawn: &MultichannelTin) -> Result<()> {
        let Some(rounding) = maker.opened.rounding() else { return Ok(()) };
        let mut heights = drawn.vertices.iter().map(|&at| self.height(at));
        match heights.find(|&height| rounding.apply(height) != height) {
            None => Ok(()),
            Some(height) => Err(Error::usage(format!(
                "{} stores heights as 32-bit floats, which do not hold {height} exactly",
                maker.opened.format.name
            ))
            .remedy("write PLY, or leave out ‹band›, ‹size›, ‹scale› and ‹exaggeration›")),
        }
    }

    fn write(
        &self,
        maker: &TinMaker<'_>,
        drawn: &MultichannelTin,
        sink: Box<dyn MeshSink>,
    ) -> Result<u64> {
        let mesh = SampleMesh {
            vertices: &drawn.vertices,
            triangles: &drawn.triangles,
            to_world: &maker.opened.source.info().transform,
        };
        mesh.write(|at| self.height(at), |at| self.of_sample(at), sink)
    }
}
