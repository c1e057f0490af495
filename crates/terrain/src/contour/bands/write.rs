//! Polygons put together from walks, and written.

use std::collections::HashMap;

use super::loops::inconsistent;
use super::probe::{in_order, sample_vertex};
use super::walks::{BandWalks, WalkPart};
use crate::contour::budget::ContourMemory;
use crate::contour::job::{ContourJob, ContourReport};
use crate::contour::join::ContourPieces;
use crate::contour::tiles::ContourTiles;
use crate::contour::write::{ID, field};
use terrane_base::error::Result;
use terrane_engine::run_statistics::RunStatistics;
use terrane_engine::{Cancel, Progress, memory};
use terrane_raster::GridInfo;
use terrane_vector::{
    CoordinateSequence, Feature, FeatureProperties, FeatureSink, FieldDefinition, FieldKind,
    Geometry, GeometryType, Id, PropertyValue, VectorFormat,
};
use terrane_window::contour::{ContourLevels, ContourVertex, CrossedEdge};

/// Polygons written between two checks for cancellation.
const BATCH: u64 = 256;

/// Writes bands to a vector file.
pub(in crate::contour) struct BandWriter<'a> {
    pub(in crate::contour) job: &'a ContourJob,
    pub(in crate::contour) format: &'a VectorFormat,
    pub(in crate::contour) levels: &'a ContourLevels,
    pub(in crate::contour) info: &'a GridInfo,
    pub(in crate::contour) budget: &'a ContourMemory,
    /// True if polygons have all samples on borders, for another CRS; else those where the border turns.
    pub(in crate::contour) all_samples: bool,
}

/// The fields of a layer of bands.
pub(in crate::contour) fn fields(attribute: &str) -> [FieldDefinition; 2] {
    names(attribute).map(|name| field(&name, FieldKind::Real))
}

fn names(attribute: &str) -> [String; 2] {
    ["min", "max"].map(|end| format!("{attribute}_{end}"))
}

impl BandWriter<'_> {
    /// Writes all polygons and finishes the file; returns the report.
    pub(in crate::contour) fn write(
        &self,
        mut pieces: ContourPieces,
        mut sink: Box<dyn FeatureSink>,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<ContourReport> {
        let tiles = ContourTiles::new(self.info, self.job.options.tile);
        let parts = pieces.bands.take().unwrap_or_default();
        let bands = parts.walks(&mut pieces, tiles, cancel)?;
        let polygons = polygons(&bands, cancel)?;
        let (original_vertices, left_out) = (pieces.original_vertices, pieces.left_out);
        let mut report = ContourReport { original_vertices, left_out, ..ContourReport::default() };
        for line in &bands.lines {
            match line.is_dropped {
                true => report.left_out += 1,
                false => report.count(&line.line, 0, self.levels),
            }
        }
        progress.begin("write", polygons.len() as u64);
        let mut rings = BandRings { writer: self, bands: &bands, pieces: &mut pieces };
        let mut written = 0_u64;
        for batch in polygons.chunk_by(|a, b| a.outer == b.outer) {
            if written.is_multiple_of(BATCH) {
                cancel.check()?;
            }
            written += 1;
            let geometry = rings.polygon(batch)?;
            report.vertices += geometry.coordinates().xy.len() as u64;
            let band = bands.walks[batch[0].outer as usize].band;
            sink.write(&self.feature(band, geometry, written as i64))?;
            progress.advance(batch.len() as u64);
        }
        cancel.check()?;
        let finished = sink.finish(&[])?;
        progress.end();
        let run = RunStatistics::default().with_spilled(pieces.spilled());
        Ok(ContourReport {
            notes: finished.notes,
            output_bytes: finished.bytes,
            polygons: Some(written),
            run,
            ..report
        })
    }

    fn feature(&self, band: i32, geometry: Geometry, number: i64) -> Feature {
        let mut properties = FeatureProperties::default();
        let id = self.format.holds.ids.then_some(Id::Int(number));
        if id.is_none() {
            properties.push(ID, PropertyValue::Int(number));
        }
        let ends = self.levels.band(band);
        for (name, end) in names(&self.job.options.attribute).into_iter().zip(ends) {
            properties.push(name, end.map_or(PropertyValue::Null, PropertyValue::Real));
        }
        Feature { id, properties, geometry, foreign: Vec::new() }
    }
}

/// A walk of a polygon; the outer one comes first.
#[derive(Clone, Copy, Debug)]
struct PolygonWalk {
    outer: u32,
    walk: u32,
}

/// The walks of all polygons: by band, then by lowest vertex.
fn polygons(bands: &BandWalks, cancel: &Cancel) -> Result<Vec<PolygonWalk>> {
    let owners = bands.owners(cancel)?;
    let walks = 0..owners.len() as u32;
    let mut polygons: Vec<PolygonWalk> =
        walks.map(|walk| PolygonWalk { outer: owners[walk as usize], walk }).collect();
    let of = |at: u32| &bands.walks[at as usize];
    polygons.sort_unstable_by(|a, b| {
        let [one, other] = [of(a.outer), of(b.outer)];
        let outer = one.band.cmp(&other.band).then_with(|| in_order(&one.low, &other.low));
        let holes = || of(a.walk).is_hole.cmp(&of(b.walk).is_hole);
        outer.then_with(holes).then_with(|| in_order(&of(a.walk).low, &of(b.walk).low))
    });
    Ok(polygons)
}

/// Reads the rings of polygons.
struct BandRings<'a> {
    writer: &'a BandWriter<'a>,
    bands: &'a BandWalks,
    pieces: &'a mut ContourPieces,
}

impl BandRings<'_> {
    fn polygon(&mut self, walks: &[PolygonWalk]) -> Result<Geometry> {
        self.check(walks)?;
        let mut coordinates = CoordinateSequence::default();
        for walk in walks {
            let mut rings = simple_rings(self.vertices(walk.walk)?);
            if walk.walk == walk.outer && rings.len() > 1 {
                // The others are holes that touch it.
                let width = self.writer.info.width;
                let sizes: Vec<f64> = rings.iter().map(|ring| size(ring, width)).collect();
                let outer = (0..rings.len()).max_by(|&a, &b| sizes[a].total_cmp(&sizes[b]));
                rings.swap(0, outer.unwrap_or_default());
                rings[1..].sort_by(|a, b| in_order(&a[0], &b[0]));
            }
            rings.into_iter().try_for_each(|ring| self.add(ring, &mut coordinates))?;
        }
        Geometry::new(GeometryType::Polygon, coordinates)
    }

    /// Fails if the vertices of a polygon do not fit into memory.
    fn check(&self, walks: &[PolygonWalk]) -> Result<()> {
        let mut vertices = 0;
        for walk in walks {
            self.bands.parts_of(walk.walk, |part| {
                vertices += match part {
                    WalkPart::Line(line, _) => {
                        self.pieces.count(&self.bands.lines[line as usize].line)
                    }
                    part => self.on_border(part).len() as u64,
                };
            })?;
        }
        let most = self.writer.budget.line_vertices();
        if vertices <= most {
            return Ok(());
        }
        let ends = self.writer.levels.band(self.bands.walks[walks[0].outer as usize].band);
        let band = match ends {
            [Some(low), Some(high)] => format!("from {low} to {high}"),
            [Some(low), None] => format!("above {low}"),
            [None, Some(high)] => format!("below {high}"),
            [None, None] => "of all heights".to_owned(),
        };
        let message =
            format!("a polygon {band} has {vertices} vertices, but only {most} fit into memory");
        Err(memory::short(message, ContourMemory::for_line(vertices)).or("a larger ‹tolerance›"))
    }

    /// The vertices of a part on a border.
    fn on_border(&self, part: WalkPart) -> Vec<ContourVertex> {
        let borders = &self.bands.borders;
        let (width, all) = (borders.tiles.width, self.writer.all_samples);
        let mut vertices = Vec::new();
        match part {
            WalkPart::Line(..) => (),
            WalkPart::Border(from, to) => borders.between(from, to, all, &mut |at| {
                vertices.push(sample_vertex(at.sample, width));
            }),
            WalkPart::Loop(number) => borders.around(number, all, &mut |at| {
                vertices.push(sample_vertex(at.sample, width));
            }),
        }
        vertices
    }

    /// The vertices of a walk, the first of which is not repeated.
    fn vertices(&mut self, walk: u32) -> Result<Vec<ContourVertex>> {
        let mut parts = Vec::new();
        self.bands.parts_of(walk, |part| parts.push(part))?;
        let (mut vertices, mut line) = (Vec::new(), Vec::new());
        for part in parts {
            let WalkPart::Line(number, forward) = part else {
                vertices.extend(self.on_border(part));
                continue;
            };
            let joined = &self.bands.lines[number as usize].line;
            self.pieces.read(joined, &mut line)?;
            if joined.closed {
                line.pop();
            }
            if !forward {
                line.reverse();
            }
            vertices.extend_from_slice(&line);
        }
        Ok(vertices)
    }

    /// Appends a ring that begins at its lowest vertex.
    fn add(&self, mut ring: Vec<ContourVertex>, to: &mut CoordinateSequence) -> Result<()> {
        let lowest = (0..ring.len()).min_by(|&a, &b| in_order(&ring[a], &ring[b]));
        ring.rotate_left(lowest.unwrap_or_default());
        ring.extend(ring.first().copied());
        let info = self.writer.info;
        // Where the first row is in the south, the left is on the right.
        if info.transform.determinant() > 0.0 {
            ring.reverse();
        }
        if ring.len() < 4 {
            return Err(inconsistent("a ring without area"));
        }
        to.xy.extend(ring.iter().map(|vertex| {
            let [col, row] = vertex.place(info.width);
            info.transform.apply(col, row)
        }));
        to.end_part();
        Ok(())
    }
}

/// The rings of a walk that may touch itself at samples.
fn simple_rings(vertices: Vec<ContourVertex>) -> Vec<Vec<ContourVertex>> {
    let mut rings = Vec::new();
    let mut open: Vec<ContourVertex> = Vec::with_capacity(vertices.len());
    let mut samples: HashMap<CrossedEdge, usize> = HashMap::new();
    for vertex in vertices {
        if vertex.at == 0.0
            && let Some(at) = samples.insert(vertex.edge, open.len())
        {
            for left in open[at + 1..].iter().filter(|left| left.at == 0.0) {
                samples.remove(&left.edge);
            }
            samples.insert(vertex.edge, at);
            rings.push(open.drain(at..).collect());
        }
        open.push(vertex);
    }
    rings.push(open);
    rings
}

/// Twice the area of a ring, in cells.
fn size(ring: &[ContourVertex], width: u32) -> f64 {
    let Some([x, y]) = ring.first().map(|vertex| vertex.place(width)) else { return 0.0 };
    let places = ring.iter().chain(ring.first()).map(|vertex| vertex.place(width));
    let places: Vec<[f64; 2]> = places.collect();
    let crosses = places
        .windows(2)
        .map(|pair| (pair[0][0] - x) * (pair[1][1] - y) - (pair[1][0] - x) * (pair[0][1] - y));
    crosses.sum::<f64>().abs()
}
