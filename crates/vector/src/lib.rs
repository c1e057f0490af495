//! Vector files (points, lines, polygons with properties): one module per format, and the registry of
//! formats. Features are read and written one by one; files may be larger than memory.

mod crs;
mod csv;
mod dbf;
mod decimal;
mod feature;
mod find;
mod flatgeobuf;
mod format;
mod geojson;
mod geometry;
mod gpx;
mod json;
mod out;
mod pages;
mod reduce;
mod rings;
mod round;
#[cfg(test)]
mod sample;
mod shp;
mod sink;
mod source;
mod synth;
mod table;
#[cfg(test)]
mod tests;
mod topojson;
mod tree;
mod window;
mod wkt;

use std::path::Path;

use terrane_base::error::{Error, Result};
use terrane_base::registry::offered;
use terrane_files::RawFile;
use terrane_files::format::by_extension;

pub use feature::{
    Feature, FeatureProperties, FieldDefinition, FieldKind, Id, JsonMember, LayerHeader,
    PropertyValue,
};
pub use find::{files, files_below, is_collection};
pub use format::{Create, PropertySupport, VectorCapabilities, VectorFormat};
pub use geometry::{CoordinateSequence, Geometry, GeometryPart, GeometryType, PartRole};
pub use reduce::RetainedVertices;
pub use round::rounded;
pub use sink::{FeatureSink, VectorWriteOptions, WrittenFeatures};
pub use source::{FeatureSource, VectorOpenOptions};
pub use synth::synthetic;

/// All formats, in the order of detection; a new one is a file in this folder and a line here.
pub const FORMATS: &[VectorFormat] = &[
    topojson::FORMAT,
    geojson::LINES,
    geojson::FORMAT,
    shp::FORMAT,
    flatgeobuf::FORMAT,
    gpx::FORMAT,
    wkt::FORMAT,
    csv::FORMAT,
];

/// Formats that can be read from and written to pipes; their data are buffered in a file.
pub const STREAMED: [&str; 4] = ["GeoJSON", "GeoJSONSeq", "WKT", "CSV"];

/// Opens a vector file, identified by its first bytes or else by its name, or synthetic lines such as
/// `synth:koch,vertices=1000000`.
///
/// # Errors
/// An unreadable file, an unknown format, or a damaged header.
pub fn open(path: &Path, options: &VectorOpenOptions) -> Result<Box<dyn FeatureSource>> {
    if let Some(lines) = synthetic(path) {
        return Ok(Box::new(synth::SyntheticFeatures::new(lines?)));
    }
    let format = identify(path)?.ok_or_else(|| {
        Error::bad_input("not a vector file of a known format")
            .in_file(path)
            .remedy(format!("known formats are {}", known(|f| f.name.to_owned())))
    })?;
    if options.layer.is_some() && format.name != topojson::FORMAT.name {
        return Err(Error::usage(format!("‹layer› applies to TopoJSON, not to {}", format.name))
            .in_file(path)
            .remedy("leave ‹layer› out"));
    }
    let inner = (format.open)(path, options).map_err(|e| e.in_file(path))?;
    Ok(Box::new(source::CheckedFeatures::new(inner, path)))
}

/// Starts a file of `format`, see [`by_path`]. It appears under its name when it is finished.
///
/// # Errors
/// A read-only format; a file that exists or cannot be created.
pub fn create(
    path: &Path,
    format: &VectorFormat,
    layer: &LayerHeader,
    options: &VectorWriteOptions,
) -> Result<Box<dyn FeatureSink>> {
    let create = format.create.ok_or_else(|| {
        Error::usage(format!("{} is read-only", format.name))
            .in_file(path)
            .remedy(format!("writable formats are {}", offered(FORMATS, |f| f.name.to_owned())))
    })?;
    let inner = create(path, layer, options)?;
    Ok(match options.decimals {
        Some(decimals) => Box::new(round::RoundingSink {
            inner,
            decimals,
            lines: !options.lines_are_rounded,
            measures: !layer.m_is_time,
        }),
        None => inner,
    })
}

/// Number of leading bytes that [`VectorFormat::sniff`] examines.
const SNIFF_BYTES: u64 = 4096;

/// The format of an existing file, by its first bytes, or else by its name; `None` if unknown.
///
/// # Errors
/// A file that cannot be read.
pub fn identify(path: &Path) -> Result<Option<&'static VectorFormat>> {
    let head = RawFile::open(path)?.head(SNIFF_BYTES)?;
    Ok(FORMATS.iter().find(|format| (format.sniff)(&head)).or_else(|| by_extension(FORMATS, path)))
}

/// The format called `name`, or else the one with the extension of `path`, in any case.
///
/// # Errors
/// Unknown name or extension; the message lists the known ones.
pub fn by_path(path: &Path, name: Option<&str>) -> Result<&'static VectorFormat> {
    terrane_files::format::by_path(FORMATS, path, name)
}

fn known(text: impl Fn(&VectorFormat) -> String) -> String {
    FORMATS.iter().map(text).collect::<Vec<_>>().join(", ")
}
