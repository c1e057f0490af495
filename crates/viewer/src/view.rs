//! Draws a grid or a mesh as a shaded relief picture, out of core: memory depends on the picture's
//! size, not on the file's.
//!
//! The lattice of heights is twice as fine as the picture: from a grid by averaging blocks of samples and
//! interpolating between the means, from a mesh by filling triangles (the higher surface wins) as they
//! stream by, with colours interpolated between vertices that have them. Of a grid with more than 2^26 samples under the picture not all are read: each pixel gets
//! the mean of a square of samples in the middle of its block, as large as 2^22 samples in all allow and
//! at least one sample, so the time depends on the picture and not on the grid (a compressed file still
//! decodes each block that a pixel falls into).

mod grid;
mod mesh;
mod options;
mod sheet;

pub use options::{
    Exaggeration, ExaggerationSetters, Lighting, LightingSetters, PictureOptions, PictureSetters,
};
pub use sheet::{Panel, SheetJob, run_sheet};

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use crate::render::{Colours, Coverage, Field, Frame, Light, Painter, Style, natural_exaggeration};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::figures::Figures;
use terrane_engine::input::{self, Surface};
use terrane_engine::memory::{cache_beside, short};
use terrane_engine::{Cancel, Progress, Resources};
use terrane_files::atomic::AtomicFile;
use terrane_raster::{Inputs, OpenOptions};

/// A picture to draw.
#[derive(Clone, Debug)]
pub struct ViewJob {
    /// Grid files or a mesh, or a synthetic terrain by name.
    pub input: Inputs,
    /// PNG file to write.
    pub output: PathBuf,
    /// How it is drawn.
    pub options: PictureOptions,
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
#[non_exhaustive]
pub struct ViewReport {
    pub input: String,
    pub output: String,
    pub width: u32,
    pub height: u32,
    /// West, south, east, north of the picture.
    pub bounds: [f64; 4],
    pub exaggeration: f64,
    /// Lowest and highest height drawn; `None` when all is void.
    pub lowest: Option<f32>,
    pub highest: Option<f32>,
    pub output_bytes: u64,
    #[serde(flatten)]
    pub run: Figures,
}

/// A surface ready to be painted.
struct Drawn {
    frame: Frame,
    field: Field,
    edges: Option<Coverage>,
    /// The surface's own, if it has any.
    colours: Option<Colours>,
}

impl Drawn {
    fn painter(&self, style: Style) -> Painter<'_> {
        Painter::new(&self.field, self.edges.as_ref(), style).coloured(self.colours.as_ref())
    }
}

/// Field pixels per picture pixel along each side: smooths outlines and facets.
const FINENESS: u32 = 2;
/// Bytes a picture pixel takes at the peak: heights, those of the coarser grid they come from (up
/// to four for each), edges, and colours.
const PIXEL_BYTES: u64 = 4 * (4 + 16) + 1 + 4;

/// What it takes more where the surface has colours of its own.
const COLOUR_BYTES: u64 = 4 * 4;

/// Draws a picture.
pub fn run(job: &ViewJob, progress: &dyn Progress, cancel: &Cancel) -> Result<ViewReport> {
    let started = Instant::now();
    terrane_files::atomic::refuse_existing(&job.output, job.options.replacing.overwrite)?;
    let drawn = match input::open(job.input.names(), &options(job)?)? {
        Surface::Grid(_) if job.options.edges => {
            return Err(Error::usage("a grid has no triangle edges to draw")
                .remedy("leave ‹edges› out, or view a mesh made by ‹terrane tin›"));
        }
        Surface::Grid(grid) => grid::draw(grid.as_ref(), job, progress, cancel)?,
        Surface::Mesh(mesh) => {
            job.options.grid.refuse_for_meshes()?;
            mesh::draw(mesh.as_ref(), job, progress, cancel)?
        }
    };
    let report = paint(job, &drawn, progress, cancel)?;
    Ok(ViewReport { run: Figures::since(started, &job.options.resources), ..report })
}

fn options(job: &ViewJob) -> Result<OpenOptions> {
    let PictureOptions { grid, resources, .. } = &job.options;
    // A part is that of the picture.
    let whole = grid.unbounded();
    whole.options(resources, cache_beside(resources.memory))
}

/// The frame of a picture of `data` (west, south, east, north), or of the part asked for.
fn frame(job: &ViewJob, data: [f64; 4], geographic: bool) -> Result<Frame> {
    let bounds = job.options.grid.bounds.unwrap_or(data);
    let apart =
        bounds[0] > data[2] || bounds[2] < data[0] || bounds[1] > data[3] || bounds[3] < data[1];
    if apart {
        let [west, south, east, north] = data;
        return Err(Error::usage("‹bounds› lies outside the data")
            .in_file(Path::new(&job.input.to_string()))
            .remedy(format!("the data reach from {west},{south} to {east},{north}")));
    }
    let frame = Frame::fit(bounds, job.options.width, ground_scale(bounds, geographic));
    within_memory(&frame, PIXEL_BYTES, &job.options.resources)?;
    Ok(frame)
}

/// Metres of one degree along a meridian.
pub(crate) const DEGREE_METRES: f64 = 111_320.0;

/// Ground units per world unit along x and y.
fn ground_scale([_, south, _, north]: [f64; 4], geographic: bool) -> [f64; 2] {
    if !geographic {
        return [1.0, 1.0];
    }
    let latitude = ((south + north) / 2.0).clamp(-89.0, 89.0);
    [DEGREE_METRES * latitude.to_radians().cos(), DEGREE_METRES]
}

fn within_memory(frame: &Frame, pixel_bytes: u64, resources: &Resources) -> Result<()> {
    let pixels = u64::from(frame.width) * u64::from(frame.height);
    let need = pixels * pixel_bytes;
    if need > resources.memory {
        let mib = need.div_ceil(1 << 20);
        let message = format!(
            "a picture of {} x {} pixels needs {mib} MiB of memory",
            frame.width, frame.height,
        );
        return Err(short(message, need).or("a smaller ‹width›"));
    }
    Ok(())
}

fn paint(
    job: &ViewJob,
    drawn: &Drawn,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<ViewReport> {
    let frame = &drawn.frame;
    let style = style(job, drawn);
    let painter = drawn.painter(style);
    let mut file = AtomicFile::create(&job.output, job.options.replacing.overwrite)?;
    let size = [painter.width(), painter.height()];
    let fill = |row, line: &mut [u8]| painter.row(row, line);
    write_png(&mut file, size, fill, &job.options.resources, progress, cancel)?;
    let (low, high) = extremes(&drawn.field);
    Ok(ViewReport {
        input: job.input.to_string(),
        output: job.output.display().to_string(),
        width: frame.width,
        height: frame.height,
        bounds: frame.bounds,
        exaggeration: style.exaggeration,
        lowest: low.is_finite().then_some(low),
        highest: high.is_finite().then_some(high),
        output_bytes: file.commit()?,
        run: Figures::default(),
    })
}

/// How `drawn` is lit.
fn style(job: &ViewJob, drawn: &Drawn) -> Style {
    let ground = drawn.frame.finer(FINENESS).ground_pixel();
    let natural = || natural_exaggeration(&drawn.field, ground);
    let exaggeration = job.options.lighting.heights.exaggeration.unwrap_or_else(natural);
    let Lighting { azimuth, altitude, .. } = job.options.lighting;
    let light = Light::new(azimuth, altitude);
    Style { light, exaggeration, ground, fineness: FINENESS as usize }
}

fn extremes(field: &Field) -> (f32, f32) {
    let start = (f32::INFINITY, f32::NEG_INFINITY);
    field.z.iter().fold(start, |(low, high), &z| (low.min(z), high.max(z)))
}

/// Rows painted together.
const BAND: usize = 64;

/// Writes a picture of `width` x `height` pixels, whose rows `fill` makes from their numbers: RGBA, any row on
/// its own.
pub(crate) fn write_png(
    file: &mut AtomicFile,
    [width, height]: [usize; 2],
    fill: impl Fn(usize, &mut [u8]) + Sync,
    resources: &Resources,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<()> {
    let path = file.path().to_path_buf();
    let failed = |e| Error::write(&path, e);
    let fail = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => failed(e),
        other => Error::new(ErrorKind::Internal, other.to_string()).in_file(&path),
    };
    let mut out = BufWriter::new(file);
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(fail)?;
    let mut stream = writer.stream_writer().map_err(fail)?;
    let workers = input::workers(resources)?;
    let mut band = vec![0; width * 4 * BAND];
    progress.begin("paint", height as u64);
    for first in (0..height).step_by(BAND) {
        cancel.check()?;
        let rows = BAND.min(height - first);
        let band = &mut band[..rows * width * 4];
        workers.install(|| {
            let lines = band.par_chunks_mut(width * 4).enumerate();
            lines.for_each(|(row, line)| fill(first + row, line));
        });
        stream.write_all(band).map_err(failed)?;
        progress.advance(rows as u64);
    }
    progress.end();
    stream.finish().map_err(fail)?;
    writer.finish().map_err(fail)?;
    out.flush().map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_shrink_towards_the_pole_but_never_vanish() {
        let [x, y] = ground_scale([0.0, 59.0, 1.0, 61.0], true);
        assert!((x / y - 0.5).abs() < 1e-9);
        assert!(ground_scale([0.0, 89.0, 1.0, 91.0], true)[0] > 0.0);
        assert_eq!(ground_scale([0.0; 4], false), [1.0, 1.0]);
    }
}
