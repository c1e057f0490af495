//! Real files of features, and damaged ones: what is read is what the catalogue counts.

use std::path::Path;

use crate::data;
use terrane::Result;
use terrane_vector::{self as vector, Feature, GeometryType, PropertyValue, VectorOpenOptions};

fn read(path: &Path, layer: Option<&str>) -> Result<Vec<Feature>> {
    let options = VectorOpenOptions { layer: layer.map(str::to_owned), ..Default::default() };
    let mut source = vector::open(path, &options)?;
    std::iter::from_fn(|| source.next().transpose()).collect()
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn real_files_hold_what_is_known_of_them() {
    // Features, parts, vertices.
    let known = [
        ("UScounties.shp", None, 3221, 3866, 837_022),
        ("ne_10m_rivers_lake_centerlines.shp", None, 1404, 2391, 253_029),
        ("ne_10m_admin_0_boundary_lines_land.json", None, 462, 8393, 77_623),
        ("world-atlas_countries-10m.json", None, 255, 4270, 544_898),
        // The outline of Illinois does not end where it begins, and is closed.
        ("us-atlas_counties-10m.json", Some("states"), 56, 305, 15_590),
        ("nl_zones.wkt", None, 1, 91, 27_182),
        ("norway_main.wkt", None, 1, 1, 8854),
        ("tuolumne.gpx", None, 9, 1, 5257),
    ];
    for (name, layer, features, parts, vertices) in known {
        let path = data::at(&format!("lines/{name}"));
        let found = read(&path, layer).unwrap();
        let count = |of: fn(&Feature) -> usize| found.iter().map(of).sum::<usize>();
        let counts = (
            found.len(),
            count(|feature| feature.geometry.parts().count()),
            count(|feature| feature.geometry.vertices()),
        );
        assert_eq!(counts, (features, parts, vertices), "{name}");
    }
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn properties_names_and_systems_are_read() {
    let path = data::at("lines/UScounties.shp");
    let source = vector::open(&path, &VectorOpenOptions::default()).unwrap();
    assert_eq!(source.layer().crs.epsg, Some(4269));
    assert_eq!(source.layer().schema.as_ref().map(Vec::len), Some(6));
    let first = &read(&path, None).unwrap()[0];
    assert_eq!(first.properties.get("NAME"), Some(&PropertyValue::Text("Cleburne".to_owned())));
    let path = data::at("lines/ne_10m_admin_0_boundary_lines_land.json");
    let first = &read(&path, None).unwrap()[0];
    assert_eq!(first.properties.get("labelrank"), Some(&PropertyValue::Int(2)));
    assert_eq!(first.properties.get("min_zoom"), Some(&PropertyValue::Real(2.0)));
    assert_eq!(
        first.geometry.coordinates().xy[0],
        [-124.758_865_926_999_95, 48.494_017_843_000_04]
    );
    let path = data::at("lines/tuolumne.gpx");
    let found = read(&path, None).unwrap();
    let track =
        found.iter().find(|feature| feature.geometry.kind() == GeometryType::MultiLineString);
    let track = &track.unwrap().geometry;
    assert_eq!(track.coordinates().z.len(), 5249);
    assert!(track.coordinates().m.iter().all(|moment| *moment > 1.1e9));
}

#[test]
#[ignore = "needs TERRANE_DATA"]
fn damaged_shapefiles_are_refused_by_name_or_read_right() {
    // What is said, or else features and vertices.
    let known = [
        ("bigoffset", Ok((1, 10))),
        ("buggymultiline", Err("feature 1 (record 1): record is truncated")),
        ("buggymultipoly", Err("feature 1 (record 1): record is truncated")),
        ("buggymultipoly2", Err("part offsets do not match the 15 vertices")),
        ("emptymultipoly", Err("part offsets do not match the 15 vertices")),
        ("extentnan", Ok((0, 0))),
        ("issue_14385", Ok((3, 395))),
        ("multipolygon_as_invalid_polygon", Ok((2, 16))),
        ("nonconformant_shx_ticket5608", Ok((1, 2))),
        ("pointnan", Err("feature 2 (record 2): vertex 0: its position is not finite")),
    ];
    for (name, expected) in known {
        let path = data::at(&format!("malformed/shp/{name}.shp"));
        let found = read(&path, None).map(|found| {
            (found.len(), found.iter().map(|feature| feature.geometry.vertices()).sum())
        });
        match (found, expected) {
            (Ok(found), Ok(expected)) => assert_eq!(found, expected, "{name}"),
            (Err(error), Err(told)) => {
                let error = error.to_string();
                assert!(error.contains(told) && error.contains(name), "{error}");
            }
            (found, _) => panic!("{name}: {found:?}"),
        }
    }
}
