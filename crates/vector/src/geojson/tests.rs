//! What GeoJSON may look like, and what it must not.

use std::path::Path;

use crate::{
    Feature, GeometryType, Id, JsonMember, LayerHeader, PropertyValue, VectorOpenOptions,
    VectorWriteOptions, by_path, create, open,
};
use terrane_base::error::Result;

/// The layer at the end, and the features.
fn read(text: &str) -> Result<(LayerHeader, Vec<Feature>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.geojson");
    std::fs::write(&path, text).unwrap();
    read_file(&path)
}

fn read_file(path: &Path) -> Result<(LayerHeader, Vec<Feature>)> {
    let mut source = open(path, &VectorOpenOptions::default())?;
    let mut features = Vec::new();
    while let Some(feature) = source.next()? {
        features.push(feature);
    }
    Ok((source.layer().clone(), features))
}

fn member(name: &str, json: &str) -> JsonMember {
    JsonMember { name: name.to_owned(), json: json.to_owned() }
}

const POINT: &str = r#"{"type":"Point","coordinates":[1,2]}"#;

#[test]
fn members_of_others_are_kept_and_written() {
    let text = r#"{ "type": "FeatureCollection", "name": "a \"b\"",
        "crs": { "type": "name", "properties": { "name": "urn:ogc:def:crs:EPSG::28992" } },
        "bbox": [ 1, 2, 3, 4 ], "features": [ { "bbox": [1,2], "id": 1.5, "geometry":
        {"coordinates":[[1,2],[3,4]],"bbox":[0],"type":"LineString"}, "extra": "\n", "type":"Feature",
        "properties": {"n": 12345678901234567890, "o": {"p": [1, "x y"]}, "r": 1.0, "e": 1e3} } ],
        "after": { "a": [ ] } }"#;
    let (layer, features) = read(text).unwrap();
    assert_eq!((layer.name.as_deref(), layer.crs.epsg), (Some("a \"b\""), Some(28992)));
    assert_eq!(layer.foreign, [member("bbox", "[1,2,3,4]"), member("after", "{\"a\":[]}")]);
    let feature = &features[0];
    assert_eq!(feature.id, Some(Id::Real(1.5)));
    assert_eq!(feature.foreign, [member("bbox", "[1,2]"), member("extra", r#""\n""#)]);
    let value = |name| feature.properties.get(name).unwrap().clone();
    assert_eq!(value("n"), PropertyValue::Json("12345678901234567890".to_owned()));
    assert_eq!(value("o"), PropertyValue::Json("{\"p\":[1,\"x y\"]}".to_owned()));
    assert_eq!((value("r"), value("e")), (PropertyValue::Real(1.0), PropertyValue::Real(1000.0)));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("b.geojson");
    let ahead = LayerHeader { foreign: layer.foreign[..1].to_vec(), ..layer.clone() };
    let options = VectorWriteOptions { decimals: Some(3), ..VectorWriteOptions::default() };
    let mut sink = create(&path, by_path(&path, None).unwrap(), &ahead, &options).unwrap();
    sink.write(feature).unwrap();
    sink.finish(&layer.foreign[1..]).unwrap();
    assert_eq!(read_file(&path).unwrap(), (layer, features));
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{text}");
}

#[test]
fn sequences_and_single_objects() {
    let feature = format!(r#"{{"type":"Feature","properties":null,"geometry":{POINT}}}"#);
    let late = r#"{"coordinates":[1,2],"type":"Point"}"#;
    let collection = format!(r#"{{"features":[{feature},{feature}],"type":"FeatureCollection"}}"#);
    for (text, count) in [
        (POINT.to_owned(), 1),
        (late.to_owned(), 1),
        (feature.clone(), 1),
        (format!("{feature}\n{feature}\n"), 2),
        (format!("\u{1e}{feature}\n\u{1e}{feature}\n"), 2),
        (format!("\u{feff}{collection}"), 2),
        (format!("{POINT}\n\n{collection}\r\n{late}"), 4),
        (r#"{"type":"FeatureCollection","features":[]}"#.to_owned(), 0),
    ] {
        let (_, features) = read(&text).unwrap();
        assert_eq!(features.len(), count, "{text}");
        assert!(features.iter().all(|feature| feature.geometry.kind() == GeometryType::Point));
    }
    let null = r#"{"type":"Feature","geometry":null,"properties":{}}"#;
    assert_eq!(read(null).unwrap().1[0].geometry.kind(), GeometryType::Null);
    let open = r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]],[]]}"#;
    assert_eq!(read(open).unwrap().1[0].geometry.coordinates().xy.len(), 4, "is closed");
}

#[test]
fn damage_is_told_with_its_place() {
    let nested = |depth: usize| {
        let open = r#"{"type":"GeometryCollection","geometries":["#;
        format!("{}{POINT}{}", open.repeat(depth), "]}".repeat(depth))
    };
    assert!(read(&nested(32)).is_ok());
    let late_crs = format!(
        r#"{{"type":"FeatureCollection","features":[{POINT}],"crs":{{"type":"name","properties":{{"name":"EPSG:3857"}}}}}}"#
    );
    for (text, told) in [
        (nested(33).as_str(), "depth of a geometry collection"),
        (&nested(100_000), "depth of a geometry collection"),
        (&late_crs, "move it before the features"),
        (r#"{"type":"FeatureCollection","features":[{"type":"Feature""#, "unexpected end of file"),
        (r#"{"type":"FeatureCollection","features":[1]}"#, "byte 40: missing feature"),
        (r#"{"type":"Nothing"}"#, "is not Feature"),
        (r#"{"a":1}"#, "no known type"),
        (r#"{"type":"Point","coordinates":[[1,2]]}"#, "nested 2 deep, expected 1"),
        (r#"{"type":"Point"}"#, "lacks coordinates"),
        (r#"{"type":"Point","coordinates":[1,"2"]}"#, "byte 33: number expected"),
        (r#"{"type":"Feature","geometry":7,"properties":{}}"#, "geometry is not an object"),
        (r#"{"type":"Feature","geometry":null,"properties":[]}"#, "properties are not an object"),
        (r#"{"type":"Feature","geometry":null,"properties":{"a":01}}"#, "not valid JSON"),
        ("{", "unexpected end of file"),
        ("  ", "no JSON object"),
        ("[1]", "byte 0: not a JSON object"),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(told), "{}: {error}", &text[..text.len().min(80)]);
    }
}
