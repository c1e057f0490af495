//! Items of a Virtual Point Cloud, as QGIS and PDAL wrench read it: STAC items with the extensions "pointcloud" 1.0.0 and
//! "projection" 1.1.0.

use std::fmt::Write;
use std::path::{Component, Path};

use chrono::{Days, NaiveDate};
use serde_json::{Value, json};

use super::index::{TileIndex, geometry};
use super::report::QaFile;
use terrane_base::error::{Error, Result};
use terrane_cloud::{PointFormat, StatedHeader};
use terrane_crs::CoordinateOperation;
use terrane_engine::transform::PositionExtent;
use terrane_files::path_of;
use terrane_vector::{CoordinateSequence, Feature, Id, JsonMember, PropertyValue};

/// Versions of the items and of their extensions.
const STAC_VERSION: &str = "1.0.0";
const EXTENSIONS: [&str; 2] = [
    "https://stac-extensions.github.io/pointcloud/v1.0.0/schema.json",
    "https://stac-extensions.github.io/projection/v1.1.0/schema.json",
];
/// Seconds of a day, and most seconds of GPS time: three centuries.
const DAY: f64 = 86_400.0;
const MAX_SECONDS: f64 = 1e10;

/// The STAC item of a file with a footprint, or why it has none.
///
/// # Errors
/// The folder of the process is unknown.
pub(super) fn item(
    index: &TileIndex<'_>,
    file: usize,
    mut shape: CoordinateSequence,
    operation: Option<&CoordinateOperation>,
) -> Result<std::result::Result<Feature, String>> {
    let (entry, header) = (&index.files[file], &index.headers[file]);
    if header.las.is_none() {
        return Ok(Err("a Virtual Point Cloud has LAS and LAZ files only".to_owned()));
    }
    if shape.xy.is_empty() {
        return Ok(Err("it has no points that are not withheld".to_owned()));
    }
    let [low, high] = entry.bounds.unwrap_or_default();
    let is_compressed = header.name.to_lowercase().ends_with("laz");
    let mut properties = times(entry, header);
    properties.extend([
        ("pc:count", json!(entry.points)),
        ("pc:type", json!("lidar")),
        ("pc:encoding", json!(if is_compressed { "LASzip" } else { "ASPRS LAS" })),
        ("pc:schemas", schemas(header.format)),
        ("pc:density", json!(entry.density)),
        ("proj:bbox", json!([low[0], low[1], low[2], high[0], high[1], high[2]])),
        ("proj:wkt2", json!(index.crs.to_wkt().unwrap_or_default())),
    ]);
    properties.extend(index.crs.epsg.map(|code| ("proj:epsg", json!(code))));
    let own_geometry = json_geometry(&shape);
    let mut extent = PositionExtent::NONE;
    for at in &mut shape.xy {
        if let Some(operation) = operation {
            match operation.position(*at) {
                Ok(transformed) => *at = transformed,
                Err(error) => return Ok(Err(error.to_string())),
            }
        }
        extent.add(*at);
    }
    let [west, south, east, north] = extent.get().unwrap_or_default();
    let path = path_of(header.name);
    let id = path.file_stem().unwrap_or_default().to_string_lossy();
    let foreign = [
        ("stac_version", json!(STAC_VERSION)),
        ("stac_extensions", json!(EXTENSIONS)),
        ("bbox", json!([west, south, low[2], east, north, high[2]])),
        ("links", json!([])),
        ("assets", json!({ "data": { "href": relative(&path, index.path)?, "roles": ["data"] } })),
    ];
    let mut feature = Feature {
        // Files of several folders may have one name.
        id: Some(Id::Text(format!("{file}-{id}"))),
        geometry: geometry(shape)?,
        ..Feature::default()
    };
    for (name, value) in foreign {
        feature.foreign.push(JsonMember { name: name.to_owned(), json: value.to_string() });
    }
    for (name, value) in properties {
        feature.properties.push(name, PropertyValue::Json(value.to_string()));
    }
    feature.properties.push("proj:geometry", PropertyValue::Json(own_geometry));
    Ok(Ok(feature))
}

/// The day of creation; without it, the days of the GPS times, or the longest range that STAC allows.
fn times(entry: &QaFile, header: &StatedHeader<'_>) -> Vec<(&'static str, Value)> {
    if let Some(day) = &entry.created {
        return vec![("datetime", json!(format!("{day}T00:00:00Z")))];
    }
    let days = entry.gps_time.zip(header.time_offset).and_then(|(time, offset)| {
        // GPS time is 18 seconds ahead of UTC.
        let [low, high] = [time.low, time.high].map(|time| (time + offset - 18.0).max(0.0));
        let start = NaiveDate::from_ymd_opt(1980, 1, 6).filter(|_| high <= MAX_SECONDS)?;
        let day = |time: f64| start.checked_add_days(Days::new((time / DAY) as u64));
        Some([day(low)?.to_string(), day(high)?.to_string()])
    });
    let [start, end] = days.unwrap_or(["0001-01-01", "9999-12-31"].map(str::to_owned));
    vec![
        ("datetime", Value::Null),
        ("start_datetime", json!(format!("{start}T00:00:00Z"))),
        ("end_datetime", json!(format!("{end}T23:59:59Z"))),
    ]
}

/// A multipolygon of GeoJSON.
fn json_geometry(shape: &CoordinateSequence) -> String {
    let CoordinateSequence { xy, ends, polygons, .. } = shape;
    let mut out = r#"{"type":"MultiPolygon","coordinates":["#.to_owned();
    let (mut from, mut ring) = (0, 0);
    for (at, last) in polygons.iter().enumerate() {
        out.push_str(if at > 0 { ",[" } else { "[" });
        for (at, end) in ends[ring..*last].iter().enumerate() {
            out.push_str(if at > 0 { ",[" } else { "[" });
            for (at, [x, y]) in xy[from..*end].iter().enumerate() {
                let _ = write!(out, "{}[{x},{y}]", if at > 0 { "," } else { "" });
            }
            out.push(']');
            from = *end;
        }
        out.push(']');
        ring = *last;
    }
    out + "]}"
}

/// Dimensions of a point format, by the names of PDAL.
fn schemas(format: u8) -> Value {
    let common = [
        ("X", "floating", 8),
        ("Y", "floating", 8),
        ("Z", "floating", 8),
        ("Intensity", "unsigned", 2),
        ("ReturnNumber", "unsigned", 1),
        ("NumberOfReturns", "unsigned", 1),
        ("Classification", "unsigned", 1),
        ("ScanAngleRank", "floating", 4),
        ("UserData", "unsigned", 1),
        ("PointSourceId", "unsigned", 2),
    ];
    let has_time = PointFormat::new(format).is_ok_and(|format| format.time_at().is_some());
    let time = has_time.then_some(("GpsTime", "floating", 8));
    let colours: &[&str] = match format {
        2 | 3 | 5 | 7 => &["Red", "Green", "Blue"],
        8 | 10 => &["Red", "Green", "Blue", "Infrared"],
        _ => &[],
    };
    let colours = colours.iter().map(|name| (*name, "unsigned", 2));
    let all = common.into_iter().chain(time).chain(colours);
    all.map(|(name, kind, size)| json!({ "name": name, "type": kind, "size": size })).collect()
}

/// A file as seen from the folder of the index. PDAL wrench takes only names that begin with "./" for relative.
fn relative(file: &Path, index: &Path) -> Result<String> {
    let absolute = |path: &Path| std::path::absolute(path).map_err(|e| Error::read(path, e));
    let (file, index) = (absolute(file)?, absolute(index)?);
    let folder = index.parent().unwrap_or(Path::new(""));
    let (own, base): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (file.components().collect(), folder.components().collect());
    let common = own.iter().zip(&base).take_while(|(a, b)| a == b).count();
    let up = base[common..].iter().map(|_| "..".to_owned());
    let down = own[common..].iter().map(|part| part.as_os_str().to_string_lossy().into_owned());
    let parts: Vec<String> = up.chain(down).collect();
    Ok("./".to_owned() + &parts.join("/"))
}
