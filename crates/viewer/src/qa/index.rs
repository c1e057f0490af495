//! The tile index: a feature per file with its footprint, in any format of features that is written, or as a Virtual
//! Point Cloud.

use std::path::{Path, PathBuf};

use super::footprint::{FootprintRun, MAX_RUNS, polygons};
use super::lattice::QaLattice;
use super::report::QaFile;
use super::tally::FileTally;
use super::vpc;
use terrane_base::error::{Error, Result};
use terrane_base::geom::{Crs, wkt};
use terrane_cloud::StatedHeader;
use terrane_crs::CoordinateOperation;
use terrane_files::AggregatedRecords;
use terrane_files::format::by_extension;
use terrane_vector::{
    self as vector, CoordinateSequence, Feature, FeatureSink, FieldDefinition, FieldKind, Geometry,
    GeometryType, LayerHeader, PropertyValue, VectorFormat, VectorWriteOptions,
};

/// Extension of Virtual Point Clouds.
const VPC: &str = "vpc";
/// Most bytes of a text in a dBASE table.
const MAX_TEXT: usize = 254;
/// Attributes of a file, with names that fit into dBASE tables.
const FIELDS: [(&str, FieldKind); 18] = [
    ("file", FieldKind::Text),
    ("points", FieldKind::Int),
    ("area", FieldKind::Real),
    ("density", FieldKind::Real),
    ("classes", FieldKind::Text),
    ("x_min", FieldKind::Real),
    ("y_min", FieldKind::Real),
    ("z_min", FieldKind::Real),
    ("x_max", FieldKind::Real),
    ("y_max", FieldKind::Real),
    ("z_max", FieldKind::Real),
    ("time_min", FieldKind::Real),
    ("time_max", FieldKind::Real),
    ("version", FieldKind::Text),
    ("format", FieldKind::Int),
    ("created", FieldKind::Text),
    ("crs", FieldKind::Text),
    ("footprint", FieldKind::Text),
];

/// The format of an index.
#[derive(Clone, Copy)]
pub(super) enum IndexFormat {
    Features(&'static VectorFormat),
    Vpc,
}

impl IndexFormat {
    /// By the extension of a file.
    ///
    /// # Errors
    /// Extensions of no format, or of one without polygons or attributes.
    pub(super) fn of(path: &Path) -> Result<Self> {
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(VPC)) {
            return Ok(Self::Vpc);
        }
        let format = by_extension(vector::FORMATS, path).filter(|format| {
            let holds = &format.holds;
            format.create.is_some()
                && holds.properties
                && holds.kinds.contains(&GeometryType::MultiPolygon)
        });
        let format = format.ok_or_else(|| {
            Error::usage("no format of tile indexes has this extension")
                .in_file(path)
                .remedy("use .geojson, .fgb, .shp or .vpc")
        })?;
        Ok(Self::Features(format))
    }
}

/// The files of an index: that of a Shapefile has companion files.
pub(super) fn written_files(index: &Path) -> Vec<PathBuf> {
    let is_shape = index.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("shp"));
    let companions = ["shx", "dbf", "cpg", "prj"].map(|ending| index.with_extension(ending));
    let companions = companions.into_iter().filter(|_| is_shape);
    std::iter::once(index.to_path_buf()).chain(companions).collect()
}

/// What is written.
pub(super) struct TileIndex<'a> {
    pub(super) path: &'a Path,
    pub(super) format: IndexFormat,
    pub(super) overwrite: bool,
    pub(super) temp_dir: Option<PathBuf>,
    pub(super) crs: &'a Crs,
    pub(super) lattice: Option<&'a QaLattice>,
    pub(super) headers: &'a [StatedHeader<'a>],
    pub(super) tallies: &'a [FileTally],
    pub(super) files: &'a [QaFile],
}

/// An index whose files come in their order.
struct IndexWriter<'a> {
    index: &'a TileIndex<'a>,
    /// To WGS 84, for a Virtual Point Cloud.
    operation: Option<CoordinateOperation>,
    sink: Box<dyn FeatureSink>,
    /// The next file, its runs, and the number of those beyond [`MAX_RUNS`].
    file: usize,
    runs: Vec<FootprintRun>,
    beyond: u64,
    notes: Vec<String>,
}

impl IndexWriter<'_> {
    fn add(&mut self, run: FootprintRun) -> Result<()> {
        self.end_files(run.file as usize)?;
        match self.runs.len() < MAX_RUNS {
            true => self.runs.push(run),
            false => self.beyond += 1,
        }
        Ok(())
    }

    /// Writes the files before `end`.
    fn end_files(&mut self, end: usize) -> Result<()> {
        while self.file < end {
            let (index, is_box) = (self.index, self.beyond > 0);
            let shape = match index.lattice {
                _ if is_box => self.bounding_box(),
                Some(lattice) => polygons(&self.runs, lattice),
                None => CoordinateSequence::default(),
            };
            match index.format {
                IndexFormat::Features(format) => {
                    let mut feature = index.feature(self.file, shape, is_box)?;
                    if format.name == "Shapefile" {
                        shorten(&mut feature, &index.files[self.file].file, &mut self.notes);
                    }
                    self.sink.write(&feature)?;
                }
                IndexFormat::Vpc => {
                    match vpc::item(index, self.file, shape, self.operation.as_ref())? {
                        Ok(item) => self.sink.write(&item)?,
                        Err(reason) => {
                            let file = &index.files[self.file].file;
                            self.notes.push(format!("{file} is left out: {reason}"));
                        }
                    }
                }
            }
            self.runs.clear();
            (self.file, self.beyond) = (self.file + 1, 0);
        }
        Ok(())
    }

    fn bounding_box(&mut self) -> CoordinateSequence {
        let file = &self.index.files[self.file];
        self.notes.push(format!(
            "the footprint of {} is its bounding box: it has more than {MAX_RUNS} runs of cells",
            file.file
        ));
        bounding_box(file)
    }
}

impl TileIndex<'_> {
    /// Writes the index of files with the runs of their cells; returns it, to be finished, and notes.
    ///
    /// # Errors
    /// A file that exists or cannot be written; temporary files that cannot be read.
    pub(super) fn write(
        &self,
        runs: Option<AggregatedRecords<FootprintRun>>,
    ) -> Result<(Box<dyn FeatureSink>, Vec<String>)> {
        let (mut operation, mut notes) = (None, Vec::new());
        if let IndexFormat::Vpc = self.format {
            match CoordinateOperation::to_wgs84(self.crs, None) {
                Ok(found) => operation = Some(found),
                Err(_) if !self.crs.is_named() => notes.push(
                    "geometries are not in WGS 84: the CRS is unknown; set it with ‹crs›"
                        .to_owned(),
                ),
                Err(error) => notes.push(format!("geometries are not in WGS 84: {error}")),
            }
        }
        let sink = self.create(operation.is_some())?;
        let (file, runs_of_file, beyond) = (0, Vec::new(), 0);
        let mut writer =
            IndexWriter { index: self, operation, sink, file, runs: runs_of_file, beyond, notes };
        if let Some(runs) = runs {
            runs.read(&mut |run| writer.add(*run))?;
        }
        writer.end_files(self.headers.len())?;
        Ok((writer.sink, writer.notes))
    }

    fn create(&self, is_wgs84: bool) -> Result<Box<dyn FeatureSink>> {
        let options = VectorWriteOptions {
            overwrite: self.overwrite,
            temp_dir: self.temp_dir.clone(),
            ..VectorWriteOptions::default()
        };
        let field = |(name, kind): &(&str, FieldKind)| FieldDefinition {
            name: (*name).into(),
            kind: *kind,
            width: None,
            decimals: None,
        };
        let layer = LayerHeader {
            name: Some("footprints".to_owned()),
            crs: self.crs.clone(),
            schema: Some(FIELDS.iter().map(field).collect()),
            ..LayerHeader::default()
        };
        match self.format {
            IndexFormat::Features(format) => vector::create(self.path, format, &layer, &options),
            IndexFormat::Vpc => {
                let format = vector::by_path(self.path, Some("GeoJSON"))?;
                // Geometries that cannot be reprojected are declared to be in no CRS.
                let crs = if is_wgs84 { wkt::of_srs("EPSG:4326") } else { Crs::default() };
                let layer = LayerHeader { name: None, schema: None, crs, ..layer };
                vector::create(self.path, format, &layer, &options)
            }
        }
    }

    fn feature(&self, file: usize, shape: CoordinateSequence, is_box: bool) -> Result<Feature> {
        let QaFile { file: name, points, area, density, bounds, gps_time, .. } = &self.files[file];
        let QaFile { version, point_format, created, crs, .. } = &self.files[file];
        let real = |value: Option<f64>| {
            value.filter(|value| value.is_finite()).map_or(PropertyValue::Null, PropertyValue::Real)
        };
        let text = |value: Option<&String>| {
            value.map_or(PropertyValue::Null, |text| PropertyValue::Text(text.clone()))
        };
        let classes = &self.tallies[file].stats.classes;
        let classes: Vec<String> =
            classes.iter().map(|(class, points)| format!("{class}:{points}")).collect();
        let [low, high] = [0, 1].map(|end| bounds.map(|ends| ends[end]));
        let values = [
            text(Some(name)),
            PropertyValue::Int(i64::try_from(*points).unwrap_or(i64::MAX)),
            real(Some(*area)),
            real(Some(*density)),
            text(Some(&classes.join(" "))),
            real(low.map(|at| at[0])),
            real(low.map(|at| at[1])),
            real(low.map(|at| at[2])),
            real(high.map(|at| at[0])),
            real(high.map(|at| at[1])),
            real(high.map(|at| at[2])),
            real(gps_time.map(|time| time.low)),
            real(gps_time.map(|time| time.high)),
            text(version.as_ref()),
            point_format.map_or(PropertyValue::Null, |format| PropertyValue::Int(format.into())),
            text(created.as_ref()),
            text(Some(crs)),
            PropertyValue::Text(if is_box { "bounding box" } else { "occupied cells" }.to_owned()),
        ];
        let mut feature = Feature { geometry: geometry(shape)?, ..Feature::default() };
        for ((name, _), value) in FIELDS.into_iter().zip(values) {
            feature.properties.push(name, value);
        }
        Ok(feature)
    }
}

/// Shortens texts to what a dBASE table holds.
fn shorten(feature: &mut Feature, file: &str, notes: &mut Vec<String>) {
    for (name, value) in &mut feature.properties.0 {
        let PropertyValue::Text(text) = value else { continue };
        if text.len() > MAX_TEXT {
            let end = (0..=MAX_TEXT).rfind(|end| text.is_char_boundary(*end)).unwrap_or(0);
            // Whole words: a class with part of its count is wrong.
            let end = text[..end].rfind(' ').unwrap_or(end);
            text.truncate(end);
            notes.push(format!("{name} of {file} is shortened to {MAX_TEXT} bytes"));
        }
    }
}

/// The footprint of a file without cells is empty.
pub(super) fn geometry(shape: CoordinateSequence) -> Result<Geometry> {
    match shape.xy.is_empty() {
        true => Ok(Geometry::default()),
        false => Geometry::new(GeometryType::MultiPolygon, shape),
    }
}

fn bounding_box(file: &QaFile) -> CoordinateSequence {
    let Some([[west, south, _], [east, north, _]]) = file.bounds else {
        return CoordinateSequence::default();
    };
    let corners = [[west, south], [east, south], [east, north], [west, north], [west, south]];
    let mut shape = CoordinateSequence::of(corners.to_vec());
    shape.end_part();
    shape.end_polygon();
    shape
}
