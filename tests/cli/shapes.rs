//! Features over synthetic terrains of ten metres, as GeoJSON.

/// Where the terrain has its samples.
pub(crate) fn at([col, row]: [f64; 2]) -> String {
    format!("[{},{}]", 500_000.0 + 10.0 * col, 4_750_000.0 - 10.0 * row)
}

pub(crate) fn list(points: &[[f64; 2]]) -> String {
    let all: Vec<_> = points.iter().copied().map(at).collect();
    format!("[{}]", all.join(","))
}

pub(crate) fn ring(corners: &[[f64; 2]]) -> String {
    list(&[corners, &corners[..1]].concat())
}

pub(crate) fn collection(geometries: &[String]) -> String {
    let feature = |geometry: &String| format!(r#"{{"type":"Feature","geometry":{geometry}}}"#);
    let features: Vec<_> = geometries.iter().map(feature).collect();
    let crs = r#"{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32631"}}"#;
    format!(r#"{{"type":"FeatureCollection","crs":{crs},"features":[{}]}}"#, features.join(","))
}
