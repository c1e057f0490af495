//! A mesh as a field of heights: triangles are streamed and filled in, whatever their number.

use crate::render::{
    PictureFrame, PictureHeights, PixelColors, StrokeCoverage, fill_coloured, fill_triangle,
};
use crate::view::drawn::{COLOUR_BYTES, DrawnSurface, FINENESS, PIXEL_BYTES, frame, within_memory};
use crate::view::options::ViewJob;
use terrane_base::error::{Error, Result};
use terrane_base::geom::Point3;
use terrane_engine::input::{is_geographic, mesh_bounds, vertex_count};
use terrane_engine::{Cancel, Progress};
use terrane_mesh::{MeshInfo, MeshSource, is_colour};

/// Triangles read at once.
const TRIANGLE_BATCH: u64 = 1 << 16;
/// Pixels across an edge.
const EDGE_THICKNESS: f64 = 1.0;
/// Coverage of long edges, and the length in pixels from which an edge counts as long: shorter
/// ones are fainter, so that dense parts do not turn black.
const EDGE_STRENGTH: f64 = 0.54;
const LONG_EDGE: f64 = 14.0;
const FAINTEST_EDGE: f64 = 0.08;

pub(super) fn draw(
    mesh: &dyn MeshSource,
    job: &ViewJob,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<DrawnSurface> {
    let bounds = mesh_bounds(mesh, progress, cancel)?;
    let [low, high] = bounds.ok_or_else(|| Error::bad_input("the mesh has no vertices"))?;
    let geographic = is_geographic(mesh.info());
    let frame = frame(job, [low[0], low[1], high[0], high[1]], None, geographic)?;
    let channels = colour_channels(mesh.info());
    if channels > 0 {
        within_memory(&frame, PIXEL_BYTES + COLOUR_BYTES, &job.options.resources)?;
    }
    let mut canvas = MeshCanvas::new(frame, job.options.edges, channels > 0);
    let triangles = mesh.info().triangles;
    let mut gather = PositionGatherer::new(vertex_count(mesh), channels);
    let mut batch = vec![[0u64; 3]; triangles.min(TRIANGLE_BATCH) as usize];
    progress.begin("triangles", triangles);
    for first in (0..triangles).step_by(TRIANGLE_BATCH as usize) {
        cancel.check()?;
        let count = (triangles - first).min(TRIANGLE_BATCH);
        let batch = &mut batch[..count as usize];
        mesh.read_triangles(first, batch)?;
        gather.load(mesh, batch)?;
        batch.iter().for_each(|ids| canvas.draw(ids.map(|id| gather.corner(id))));
        progress.advance(count);
    }
    progress.end();
    let MeshCanvas { field, edges, colours, .. } = canvas;
    Ok(DrawnSurface { frame, field, edges, colours })
}

/// Channels of the colour that vertices have: 3, 4, or none.
fn colour_channels(info: &MeshInfo) -> usize {
    match is_colour(info.channels.iter().map(String::as_str)) {
        true => info.channels.len(),
        false => 0,
    }
}

struct MeshCanvas {
    frame: PictureFrame,
    fine: PictureFrame,
    field: PictureHeights,
    edges: Option<StrokeCoverage>,
    colours: Option<PixelColors>,
}

impl MeshCanvas {
    fn new(frame: PictureFrame, edges: bool, colours: bool) -> Self {
        let fine = frame.finer(FINENESS);
        let [width, height] = [fine.width, fine.height].map(|side| side as usize);
        let field = PictureHeights::void(width, height);
        let colours = colours.then(|| PixelColors::none(width, height));
        let edges =
            edges.then(|| StrokeCoverage::empty(frame.width as usize, frame.height as usize));
        Self { frame, fine, field, edges, colours }
    }

    fn draw(&mut self, corners: [Corner; 3]) {
        let colour_of = corners.map(|(_, colour)| colour);
        let corners = corners.map(|(at, _)| at);
        let placed = corners.map(|[x, y, z]| {
            let [col, row] = self.fine.to_picture(x, y);
            [col, row, z]
        });
        match &mut self.colours {
            None => fill_triangle(&mut self.field, placed),
            Some(colours) => fill_coloured(&mut self.field, colours, placed, colour_of),
        }
        if let Some(edges) = &mut self.edges {
            let ends = corners.map(|[x, y, _]| self.frame.to_picture(x, y));
            for (a, b) in [(ends[0], ends[1]), (ends[1], ends[2]), (ends[2], ends[0])] {
                edges.stroke(a, b, EDGE_THICKNESS, edge_strength(a, b));
            }
        }
    }
}

fn edge_strength(a: [f64; 2], b: [f64; 2]) -> f64 {
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    EDGE_STRENGTH * (length / LONG_EDGE).clamp(FAINTEST_EDGE, 1.0)
}

/// Vertices read at once, and the largest gap of unused ones that is read rather than skipped.
const RUN: u64 = 1 << 13;
const GAP: u64 = 1 << 8;

/// A position and its colour: red, green, blue and opacity, 0 to 255.
type Corner = (Point3, [f64; 4]);

/// Fetches the positions of a batch's vertices with few reads, in bounded memory for any
/// distribution of ids; and their colours, if `channels` is not 0.
struct PositionGatherer {
    vertices: u64,
    channels: usize,
    ids: Vec<u64>,
    positions: Vec<Point3>,
    values: Vec<f64>,
    run: Vec<Point3>,
    run_values: Vec<f64>,
}

impl PositionGatherer {
    fn new(vertices: u64, channels: usize) -> Self {
        Self {
            vertices,
            channels,
            ids: Vec::new(),
            positions: Vec::new(),
            values: Vec::new(),
            run: Vec::new(),
            run_values: Vec::new(),
        }
    }

    /// Reads the positions of all vertices of `triangles`.
    fn load(&mut self, mesh: &dyn MeshSource, triangles: &[[u64; 3]]) -> Result<()> {
        self.ids.clear();
        self.ids.extend(triangles.iter().flatten());
        self.ids.sort_unstable();
        self.ids.dedup();
        self.positions.clear();
        self.values.clear();
        if let Some(&last) = self.ids.last().filter(|&&last| last >= self.vertices) {
            return Err(Error::bad_input(format!(
                "a triangle refers to vertex {last}, but the mesh has {}",
                self.vertices
            )));
        }
        let mut rest = self.ids.as_slice();
        while let Some(&first) = rest.first() {
            let gaps = rest.windows(2);
            let count = 1 + gaps
                .take_while(|pair| pair[1] - pair[0] <= GAP && pair[1] - first < RUN)
                .count();
            let (ids, others) = rest.split_at(count);
            self.run.resize((ids[count - 1] - first + 1) as usize, [0.0; 3]);
            mesh.read_vertices(first, &mut self.run)?;
            self.positions.extend(ids.iter().map(|id| self.run[(id - first) as usize]));
            if self.channels > 0 {
                self.run_values.resize(self.run.len() * self.channels, 0.0);
                mesh.read_channels(first, &mut self.run_values)?;
                for id in ids {
                    let from = (id - first) as usize * self.channels;
                    self.values.extend(&self.run_values[from..from + self.channels]);
                }
            }
            rest = others;
        }
        Ok(())
    }

    /// A vertex of the loaded triangles; without an opacity it is opaque.
    fn corner(&self, id: u64) -> Corner {
        let Ok(at) = self.ids.binary_search(&id) else { return ([f64::NAN; 3], [0.0; 4]) };
        let mut colour = [0.0, 0.0, 0.0, 255.0];
        let values = self.values.iter().skip(at * self.channels).take(self.channels);
        colour.iter_mut().zip(values).for_each(|(channel, value)| *channel = *value);
        (self.positions[at], colour)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vertex `i` is at (i, 2i, 3i).
    struct Line(MeshInfo);

    impl Line {
        fn new(vertices: u64) -> Self {
            Self(MeshInfo::plain("test", vertices, 0))
        }
    }

    impl MeshSource for Line {
        fn info(&self) -> &MeshInfo {
            &self.0
        }

        fn read_vertices(&self, first: u64, out: &mut [Point3]) -> Result<()> {
            assert!(first + out.len() as u64 <= self.0.vertices && out.len() as u64 <= RUN);
            for (i, v) in out.iter_mut().enumerate() {
                *v = [1.0, 2.0, 3.0].map(|k| k * (first + i as u64) as f64);
            }
            Ok(())
        }

        fn read_triangles(&self, _: u64, _: &mut [[u64; 3]]) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn gathers_near_and_far_vertices() {
        let mesh = Line::new(1 << 40);
        let mut gather = PositionGatherer::new(vertex_count(&mesh), 0);
        let far = (1 << 40) - 1;
        let dense: Vec<[u64; 3]> = (0..30_000).step_by(3).map(|i| [i, i + 1, i + 2]).collect();
        for triangles in [vec![[5, far, 5], [1 << 33, 6, 300]], dense] {
            gather.load(&mesh, &triangles).unwrap();
            for &id in triangles.iter().flatten() {
                assert_eq!(gather.corner(id).0, [1.0, 2.0, 3.0].map(|k| k * id as f64));
            }
        }
        assert!(gather.load(&mesh, &[[0, 1, 1 << 40]]).is_err());
    }
}
