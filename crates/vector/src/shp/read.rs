//! Reader of shapes one by one, in the order of the `.shx` if there is one.

use std::path::{Path, PathBuf};

use super::shape;
use crate::feature::{Feature, FeatureProperties, LayerHeader};
use crate::pages::PagedFile;
use crate::source::{FeatureSource, VectorOpenOptions};
use crate::tree::Bounds;
use crate::{crs, dbf};
use terrane_base::error::{Error, Result};

/// The file code 9994.
pub(super) const MAGIC: [u8; 4] = 9994_u32.to_be_bytes();
/// Version 1000.
pub(super) const VERSION: [u8; 4] = 1000_u32.to_le_bytes();
/// Size in bytes of the header of a `.shp` and a `.shx`.
pub(super) const HEADER_BYTES: u64 = 100;

/// Opens the files of a shapefile.
pub(super) fn open(path: &Path, _: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    let is_index = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("shx"));
    if is_index {
        return Err(Error::usage("is the index of a shapefile").remedy("name the .shp file"));
    }
    let mut shapes = PagedFile::open(path)?;
    let extent = extent(&mut shapes)?;
    let places = sibling(path, "shx").map(|path| ShxIndex::open(&path)).transpose()?;
    let table = sibling(path, "dbf").map(|path| dbf::DbfReader::open(&path)).transpose()?;
    let mut notes = Vec::new();
    if table.is_none() {
        notes.push(".dbf file is missing: features have no properties".to_owned());
    }
    let layer = LayerHeader {
        name: path.file_stem().map(|stem| stem.to_string_lossy().into_owned()),
        crs: crs::sidecar_crs(path)?,
        schema: table.as_ref().map(|table| table.schema().to_vec()),
        extent,
        features: places.as_ref().map(|places| places.count),
        ..LayerHeader::default()
    };
    let source =
        ShapefileSource { shapes, places, table, layer, record: 0, offset: HEADER_BYTES, notes };
    Ok(Box::new(source))
}

/// The sidecar of `path` with `extension`, in lower or upper case.
fn sibling(path: &Path, extension: &str) -> Option<PathBuf> {
    let names = [extension.to_owned(), extension.to_uppercase()];
    names.iter().map(|name| path.with_extension(name)).find(|path| path.is_file())
}

/// Checks the header; returns the bounding box it declares, if valid.
fn extent(shapes: &mut PagedFile) -> Result<Option<Bounds>> {
    let header = shapes.get(0, HEADER_BYTES)?;
    if header[..4] != MAGIC {
        return Err(Error::bad_input("is not a shapefile: file code is not 9994"));
    }
    let mut bytes = crate::pages::RecordBytes(&header[32..]);
    shape::ShapefileType::of_code(bytes.u32()?)?;
    let mut bounds = [0.0; 4];
    for bound in &mut bounds {
        *bound = bytes.f64()?;
    }
    let is_one = bounds[0] <= bounds[2] && bounds[1] <= bounds[3];
    Ok(is_one.then_some(bounds))
}

/// The `.shx`: offsets of the records.
struct ShxIndex {
    pages: PagedFile,
    count: u64,
    path: PathBuf,
}

impl ShxIndex {
    fn open(path: &Path) -> Result<Self> {
        let mut pages = PagedFile::open(path)?;
        let header = pages.get(0, HEADER_BYTES)?;
        if header[..4] != MAGIC {
            return Err(Error::bad_input("is not the index of a shapefile")
                .in_file(path)
                .remedy("delete the .shx to read the .shp sequentially"));
        }
        let count = (pages.len() - HEADER_BYTES) / 8;
        Ok(Self { pages, count, path: path.to_path_buf() })
    }

    /// The offset of a record, in bytes.
    fn get(&mut self, record: u64) -> Result<u64> {
        let entry = self.pages.get(HEADER_BYTES + record * 8, 4)?;
        Ok(u64::from(u32::from_be_bytes([entry[0], entry[1], entry[2], entry[3]])) * 2)
    }
}

struct ShapefileSource {
    shapes: PagedFile,
    places: Option<ShxIndex>,
    table: Option<dbf::DbfReader>,
    layer: LayerHeader,
    /// Records read.
    record: u64,
    /// Offset of the next record, if there is no `.shx`.
    offset: u64,
    notes: Vec<String>,
}

impl FeatureSource for ShapefileSource {
    fn next(&mut self) -> Result<Option<Feature>> {
        loop {
            let record = self.record;
            let Some(offset) = self.offset()? else { return Ok(None) };
            self.record += 1;
            let Some(properties) = self.properties(record)? else {
                self.skip(offset)?;
                continue;
            };
            let geometry = self.geometry(offset)?;
            return Ok(Some(Feature { properties, geometry, ..Feature::default() }));
        }
    }

    fn layer(&self) -> &LayerHeader {
        &self.layer
    }

    fn location(&self) -> String {
        format!("record {}", self.record)
    }

    fn notes(&self) -> Vec<String> {
        let deleted = self.table.as_ref().map_or(0, dbf::DbfReader::deleted);
        let note = format!("{deleted} records marked as deleted omitted");
        self.notes.iter().cloned().chain((deleted > 0).then_some(note)).collect()
    }
}

impl ShapefileSource {
    /// Offset of the next record; `None` at the end.
    fn offset(&mut self) -> Result<Option<u64>> {
        let Some(places) = &mut self.places else {
            return Ok((self.offset < self.shapes.len()).then_some(self.offset));
        };
        if self.record == places.count {
            return Ok(None);
        }
        let offset = places.get(self.record)?;
        if offset < HEADER_BYTES || offset.saturating_add(12) > self.shapes.len() {
            let message = format!("offset {offset} of record {} is outside the .shp", self.record);
            return Err(Error::bad_input(message)
                .in_file(&places.path)
                .remedy("delete the .shx to read the .shp sequentially"));
        }
        Ok(Some(offset))
    }

    /// Content of the record at `offset`, without its header.
    fn bytes(&mut self, offset: u64) -> Result<u64> {
        let header = self.shapes.get(offset, 8)?;
        let words = u32::from_be_bytes([header[4], header[5], header[6], header[7]]);
        let bytes = u64::from(words) * 2;
        self.offset = offset + 8 + bytes;
        Ok(bytes)
    }

    fn skip(&mut self, offset: u64) -> Result<()> {
        self.bytes(offset).map(|_| ())
    }

    fn geometry(&mut self, offset: u64) -> Result<crate::Geometry> {
        let bytes = self.bytes(offset)?;
        shape::decode(self.shapes.get(offset + 8, bytes)?)
    }

    /// The properties of a record; `None` if it is deleted.
    fn properties(&mut self, record: u64) -> Result<Option<FeatureProperties>> {
        match &mut self.table {
            None => Ok(Some(FeatureProperties::default())),
            Some(table) => table.get(record),
        }
    }
}
