//! Lines put together from their pieces, and written.

use super::job::{ContourJob, ContourReport, INDEX};
use super::join::{Line, Pieces};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::figures::Figures;
use terrane_engine::{Cancel, Progress};
use terrane_raster::GridInfo;
use terrane_vector::{
    Coordinates, Feature, FeatureSink, Field, FieldKind, Geometry, Id, Kind, Layer, Properties,
    Value, VectorFormat,
};
use terrane_window::contour::{Levels, Vertex};

/// The property that numbers lines in formats without ids.
const ID: &str = "id";

/// Lines written between two looks at whether to stop.
const BATCH: usize = 256;

/// What is said of the file before its first line.
pub(super) fn layer(job: &ContourJob, format: &VectorFormat, info: &GridInfo) -> Layer {
    let field = |name: &str, kind| Field { name: name.into(), kind, width: None, decimals: None };
    let id = (!format.holds.ids).then(|| field(ID, FieldKind::Int));
    let height = field(&job.options.attribute, FieldKind::Real);
    let index = job.options.index.map(|_| field(INDEX, FieldKind::Bool));
    let schema = Some(id.into_iter().chain([height]).chain(index).collect());
    Layer { name: Some("contour".to_owned()), crs: info.crs.clone(), schema, ..Layer::default() }
}

/// What is needed to write.
pub(super) struct Writer<'a> {
    pub(super) job: &'a ContourJob,
    pub(super) format: &'a VectorFormat,
    pub(super) levels: &'a Levels,
    pub(super) info: &'a GridInfo,
    /// Most vertices of a line.
    pub(super) most: u64,
}

impl Writer<'_> {
    /// Writes all lines and finishes the file; of the report, what follows from that.
    pub(super) fn write(
        &self,
        mut pieces: Pieces,
        mut sink: Box<dyn FeatureSink>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ContourReport> {
        let lines = pieces.lines();
        let (original_vertices, left_out) = (pieces.original_vertices, pieces.left_out);
        let mut report = ContourReport { original_vertices, left_out, ..ContourReport::default() };
        let mut vertices = Vec::new();
        progress.begin("write", lines.len() as u64);
        for batch in lines.chunks(BATCH) {
            cancel.check()?;
            for line in batch {
                self.check(pieces.count(line), line)?;
                pieces.read(line, &mut vertices)?;
                if self.is_around_nothing(line, &vertices) {
                    report.left_out += 1;
                    continue;
                }
                report.count(line, vertices.len(), self.levels);
                sink.write(&self.feature(line, &vertices, report.lines)?)?;
            }
            progress.advance(batch.len() as u64);
        }
        cancel.check()?;
        let written = sink.finish(&[])?;
        progress.end();
        let run = Figures::default().with_spilled(pieces.spilled());
        Ok(ContourReport { notes: written.notes, output_bytes: written.bytes, run, ..report })
    }

    fn check(&self, vertices: u64, line: &Line) -> Result<()> {
        if vertices <= self.most {
            return Ok(());
        }
        let (height, most) = (self.levels.height(line.level), self.most);
        Err(Error::new(
            ErrorKind::Resource,
            format!("a contour at {height} has {vertices} vertices, and {most} fit into memory"),
        )
        .remedy("allow more ‹memory›, or a larger ‹tolerance›"))
    }

    /// True for a line along samples exactly on its level that ends where it began and has no cell
    /// within.
    fn is_around_nothing(&self, line: &Line, vertices: &[Vertex]) -> bool {
        let [first, .., last] = vertices else { return false };
        let nearer = |vertex: &Vertex| vertex.nearer(self.info.width);
        line.around == Some(0) && nearer(first) == nearer(last)
    }

    fn feature(&self, line: &Line, vertices: &[Vertex], number: u64) -> Result<Feature> {
        let height = self.levels.height(line.level);
        let transform = &self.info.transform;
        let position = |vertex: &Vertex| {
            let [col, row] = vertex.place(self.info.width);
            transform.apply(col, row)
        };
        let mut xy: Vec<[f64; 2]> = vertices.iter().map(position).collect();
        // Where the first row is in the south, the right is on the left.
        if transform.determinant() > 0.0 {
            xy.reverse();
        }
        let z = if self.job.options.with_z { vec![height; xy.len()] } else { Vec::new() };
        let geometry = Geometry::new(Kind::LineString, Coordinates { z, ..Coordinates::of(xy) })?;
        let number = number as i64;
        let mut properties = Properties::default();
        let id = self.format.holds.ids.then_some(Id::Int(number));
        if id.is_none() {
            properties.push(ID, Value::Int(number));
        }
        properties.push(self.job.options.attribute.as_str(), Value::Real(height));
        if let Some(every) = self.job.options.index {
            let is_index = i64::from(line.level) % i64::from(every) == 0;
            properties.push(INDEX, Value::Bool(is_index));
        }
        Ok(Feature { id, properties, geometry, foreign: Vec::new() })
    }
}

impl ContourReport {
    /// Counts a line that is about to be written; they come by level.
    fn count(&mut self, line: &Line, vertices: usize, levels: &Levels) {
        let height = levels.height(line.level);
        self.levels += u64::from(self.highest != Some(height));
        self.lowest.get_or_insert(height);
        self.highest = Some(height);
        self.lines += 1;
        self.rings += u64::from(line.closed);
        self.vertices += vertices as u64;
    }
}
