//! Lines put together from their pieces, and written.

use super::bands;
use super::job::{ContourJob, ContourReport, INDEX};
use super::join::{ContourPieces, JoinedContour};
use terrane_base::error::{Error, ErrorKind, Result};
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress};
use terrane_raster::GridInfo;
use terrane_vector::{
    CoordinateSequence, Feature, FeatureProperties, FeatureSink, FieldDefinition, FieldKind,
    Geometry, GeometryType, Id, LayerHeader, PropertyValue, VectorFormat,
};
use terrane_window::contour::{ContourLevels, ContourVertex};

/// The property that numbers lines in formats without ids.
pub(super) const ID: &str = "id";

/// Lines written between two checks for cancellation.
const BATCH: usize = 256;

/// The layer written to the file before its first line.
pub(super) fn layer(job: &ContourJob, format: &VectorFormat, info: &GridInfo) -> LayerHeader {
    let id = (!format.holds.ids).then(|| field(ID, FieldKind::Int));
    let heights = match job.options.polygons {
        true => Vec::from(bands::fields(&job.options.attribute)),
        false => vec![field(&job.options.attribute, FieldKind::Real)],
    };
    let index = job.options.index.map(|_| field(INDEX, FieldKind::Bool));
    let schema = Some(id.into_iter().chain(heights).chain(index).collect());
    LayerHeader {
        name: Some("contour".to_owned()),
        crs: info.crs.clone(),
        schema,
        ..LayerHeader::default()
    }
}

pub(super) fn field(name: &str, kind: FieldKind) -> FieldDefinition {
    FieldDefinition { name: name.into(), kind, width: None, decimals: None }
}

/// Writes joined contours to a vector file.
pub(super) struct ContourWriter<'a> {
    pub(super) job: &'a ContourJob,
    pub(super) format: &'a VectorFormat,
    pub(super) levels: &'a ContourLevels,
    pub(super) info: &'a GridInfo,
    /// Most vertices of a line.
    pub(super) max_vertices: u64,
}

impl ContourWriter<'_> {
    /// Writes all lines and finishes the file; returns the report.
    pub(super) fn write(
        &self,
        mut pieces: ContourPieces,
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
        let run = RunStatistics::default().with_spilled(pieces.spilled());
        Ok(ContourReport { notes: written.notes, output_bytes: written.bytes, run, ..report })
    }

    fn check(&self, vertices: u64, line: &JoinedContour) -> Result<()> {
        if vertices <= self.max_vertices {
            return Ok(());
        }
        let (height, max_vertices) = (self.levels.height(line.level), self.max_vertices);
        Err(Error::new(
            ErrorKind::Resource,
            format!(
                "the contour at {height} has {vertices} vertices, but only {max_vertices} fit into memory"
            ),
        )
        .remedy("raise ‹memory› or ‹tolerance›"))
    }

    /// True for a line along samples exactly on its level that ends where it began and has no cell
    /// within.
    fn is_around_nothing(&self, line: &JoinedContour, vertices: &[ContourVertex]) -> bool {
        let [first, .., last] = vertices else { return false };
        let width = self.info.width;
        line.around == Some(0) && first.nearer(width) == last.nearer(width)
    }

    fn feature(
        &self,
        line: &JoinedContour,
        vertices: &[ContourVertex],
        number: u64,
    ) -> Result<Feature> {
        let height = self.levels.height(line.level);
        let transform = &self.info.transform;
        let places = vertices.iter().map(|vertex| vertex.place(self.info.width));
        let mut xy: Vec<[f64; 2]> = places.map(|[col, row]| transform.apply(col, row)).collect();
        // Where the first row is in the south, the right is on the left.
        if transform.determinant() > 0.0 {
            xy.reverse();
        }
        let z = if self.job.options.with_z { vec![height; xy.len()] } else { Vec::new() };
        let geometry = Geometry::new(
            GeometryType::LineString,
            CoordinateSequence { z, ..CoordinateSequence::of(xy) },
        )?;
        let number = number as i64;
        let mut properties = FeatureProperties::default();
        let id = self.format.holds.ids.then_some(Id::Int(number));
        if id.is_none() {
            properties.push(ID, PropertyValue::Int(number));
        }
        properties.push(self.job.options.attribute.as_str(), PropertyValue::Real(height));
        if let Some(every) = self.job.options.index {
            let is_index = i64::from(line.level) % i64::from(every) == 0;
            properties.push(INDEX, PropertyValue::Bool(is_index));
        }
        Ok(Feature { id, properties, geometry, foreign: Vec::new() })
    }
}

impl ContourReport {
    /// Counts a line that is about to be written; they come by level.
    pub(super) fn count(&mut self, line: &JoinedContour, vertices: usize, levels: &ContourLevels) {
        let height = levels.height(line.level);
        self.levels += u64::from(self.highest != Some(height));
        self.lowest.get_or_insert(height);
        self.highest = Some(height);
        self.lines += 1;
        self.rings += u64::from(line.closed);
        self.vertices += vertices as u64;
    }
}
