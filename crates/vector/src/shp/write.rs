//! Writer: features are buffered until the shape type and the field widths are known.

use std::path::{Path, PathBuf};

use super::read::{HEADER_BYTES, MAGIC, VERSION};
use super::shape::{self, NO_MEASURE, ShapeType, ShapefileType, too_large};
use crate::feature::{Feature, JsonMember, LayerHeader};
use crate::out::VectorOutputFile;
use crate::sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
use crate::table::{FeatureRows, FeatureTable};
use crate::tree::NOTHING;
use crate::{crs, dbf};
use terrane_base::error::{Error, Result};
use terrane_files::atomic::Sidecar;

/// Creates the files of a shapefile.
pub(super) fn create(
    path: &Path,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    let out =
        |ending: &str| VectorOutputFile::create(&path.with_extension(ending), options.overwrite);
    Ok(Box::new(ShapefileSink {
        shapes: VectorOutputFile::create(path, options.overwrite)?,
        places: out("shx")?,
        table: out("dbf")?,
        encoding: out("cpg")?,
        prj: crs::prj(path, &layer.crs, options.overwrite)?,
        notes: crs::notes(&layer.crs),
        features: FeatureTable::new(path, layer, options.temp_dir.as_deref())?,
        base: None,
        has_z: false,
        has_m: false,
        without_z: 0,
        path: path.to_path_buf(),
    }))
}

struct ShapefileSink {
    shapes: VectorOutputFile,
    places: VectorOutputFile,
    table: VectorOutputFile,
    encoding: VectorOutputFile,
    prj: Sidecar,
    notes: Vec<String>,
    features: FeatureTable,
    base: Option<ShapeType>,
    has_z: bool,
    has_m: bool,
    /// Number of non-empty features without heights.
    without_z: u64,
    path: PathBuf,
}

impl FeatureSink for ShapefileSink {
    fn write(&mut self, feature: &Feature) -> Result<()> {
        self.take(feature).map_err(|e| {
            e.at(format!("feature {}", self.features.len().max(1))).in_file(&self.path)
        })
    }

    fn finish(mut self: Box<Self>, _: &[JsonMember]) -> Result<WrittenFeatures> {
        let base = self.base.unwrap_or(ShapeType::Line);
        let kind = ShapefileType { base, has_z: self.has_z, has_m: self.has_m };
        let mut rows = self.features.finish()?;
        let mut notes = std::mem::take(&mut self.notes);
        notes.append(&mut rows.notes);
        if self.has_z && self.without_z > 0 {
            let count = self.without_z;
            notes.push(format!("{count} features without heights are written with height 0"));
        }
        let records = u32::try_from(rows.len()).map_err(|_| too_large())?;
        let path = self.path.clone();
        let in_file = |e: Error| e.in_file(&path);
        write_shapes(&mut self.shapes, &mut self.places, kind, &mut rows).map_err(in_file)?;
        let plan = dbf::DbfTablePlan::new(&rows.columns, &mut notes).map_err(in_file)?;
        dbf::write(&mut self.table, &plan, records, |at| Ok(rows.get(at as usize)?.values))
            .map_err(in_file)?;
        self.encoding.buffer.extend_from_slice(b"UTF-8");
        self.prj.commit()?;
        let mut committed = Vec::from_iter(self.prj.place());
        // The .shp is committed last: if it exists, so do the others.
        for out in [self.encoding, self.table, self.places, self.shapes] {
            committed.push(out.commit()?);
        }
        let bytes = committed.iter().map(|(_, bytes)| bytes).sum();
        let files = committed.into_iter().rev().map(|(path, _)| path).collect();
        Ok(WrittenFeatures { features: records.into(), bytes, files, notes })
    }
}

impl ShapefileSink {
    fn take(&mut self, feature: &Feature) -> Result<()> {
        self.features.push(feature, dbf::DbfTablePlan::MOST)?;
        let geometry = &feature.geometry;
        let Some(base) = ShapefileType::base_of(geometry.kind())? else { return Ok(()) };
        let known = *self.base.get_or_insert(base);
        if known != base {
            let (found, kind) = (base.plural(), known.plural());
            let message = format!("Shapefile supports one geometry type, found {kind} and {found}");
            return Err(Error::usage(message).remedy("write GeoJSON or FlatGeobuf"));
        }
        self.has_z |= geometry.has_z();
        self.has_m |= geometry.has_m();
        self.without_z += u64::from(!geometry.has_z() && !geometry.is_empty());
        Ok(())
    }
}

impl ShapeType {
    fn plural(self) -> &'static str {
        match self {
            Self::Point => "points",
            Self::Line => "lines",
            Self::Polygon => "polygons",
            Self::MultiPoint => "multipoints",
        }
    }
}

/// Writes the `.shp` and the `.shx`.
fn write_shapes(
    shapes: &mut VectorOutputFile,
    places: &mut VectorOutputFile,
    kind: ShapefileType,
    rows: &mut FeatureRows,
) -> Result<()> {
    let (mut bounds, mut z, mut m) = (NOTHING, None, None);
    shapes.buffer.resize(HEADER_BYTES as usize, 0);
    places.buffer.resize(HEADER_BYTES as usize, 0);
    let mut shape = Vec::new();
    for row in 0..rows.len() {
        let geometry = rows.get(row)?.geometry;
        shape.clear();
        shape::encode(&geometry, kind, &mut shape)
            .map_err(|e| e.at(format!("feature {}", row + 1)))?;
        bounds = shape::union(bounds, &geometry);
        z = joined(z, shape::range(&geometry.coordinates().z));
        m = joined(m, shape::range(&geometry.coordinates().m));
        let entry = [words(shapes.bytes())?, words(shape.len() as u64)?];
        places.buffer.extend(entry.iter().flat_map(|word| word.to_be_bytes()));
        shapes.buffer.extend_from_slice(&(row as u32 + 1).to_be_bytes());
        shapes.buffer.extend_from_slice(&entry[1].to_be_bytes());
        shapes.buffer.extend_from_slice(&shape);
        shapes.settle()?;
        places.settle()?;
    }
    let none = (NO_MEASURE * 10.0, NO_MEASURE * 10.0);
    let plane = if bounds[0] <= bounds[2] { bounds } else { [0.0; 4] };
    let z = z.unwrap_or_default();
    let m = if kind.has_m { m.unwrap_or(none) } else { (0.0, 0.0) };
    for out in [shapes, places] {
        let mut head = Vec::new();
        head.extend_from_slice(&MAGIC);
        head.resize(24, 0);
        head.extend_from_slice(&words(out.bytes())?.to_be_bytes());
        head.extend_from_slice(&VERSION);
        head.extend_from_slice(&kind.code().to_le_bytes());
        let numbers = plane.iter().chain([&z.0, &z.1, &m.0, &m.1]);
        head.extend(numbers.flat_map(|number| number.to_le_bytes()));
        out.replace(0, &head)?;
    }
    Ok(())
}

type Range = Option<(f64, f64)>;

fn joined(a: Range, b: Range) -> Range {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (a, b) => a.or(b),
    }
}

/// Length in 16-bit words, which must fit into 31 bits.
fn words(bytes: u64) -> Result<u32> {
    i32::try_from(bytes / 2).map(i32::cast_unsigned).map_err(|_| too_large())
}
