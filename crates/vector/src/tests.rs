//! Every format: random features there and back, and damaged files.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::*;
use terrane_base::geom::wkt;

fn write_all(
    path: &Path,
    format: &VectorFormat,
    layer: &LayerHeader,
    features: &[Feature],
) -> WrittenFeatures {
    let options = VectorWriteOptions { index: false, ..VectorWriteOptions::default() };
    let mut sink = create(path, format, layer, &options).unwrap();
    features.iter().for_each(|feature| sink.write(feature).unwrap());
    sink.finish(&[]).unwrap()
}

fn read_all(path: &Path) -> Result<Vec<Feature>> {
    let mut source = open(path, &VectorOpenOptions::default())?;
    std::iter::from_fn(|| source.next().transpose()).collect()
}

fn written(format: &VectorFormat, folder: &Path) -> PathBuf {
    folder.join("a").with_extension(format.extensions[0])
}

/// The geometry with what the format can hold of heights and measures; `uniform` where all features
/// of a file must have the same.
fn held(geometry: &Geometry, holds: &VectorCapabilities) -> Geometry {
    if geometry.kind() == GeometryType::Collection {
        let members = geometry.members().iter().map(|member| held(member, holds));
        return Geometry::collection(members.collect()).unwrap();
    }
    let mut coordinates = geometry.coordinates().clone();
    if !holds.z || !holds.mixed {
        coordinates.z.clear();
    }
    if !holds.m {
        coordinates.m.clear();
    }
    Geometry::new(geometry.kind(), coordinates).unwrap()
}

fn features(format: &VectorFormat) -> BoxedStrategy<Vec<Feature>> {
    let holds = format.holds;
    let kinds = if holds.mixed {
        Just(holds.kinds.to_vec()).boxed()
    } else {
        let families: [&[GeometryType]; 4] = [
            &[GeometryType::Null, GeometryType::Point],
            &[GeometryType::MultiPoint],
            &[GeometryType::LineString, GeometryType::MultiLineString, GeometryType::Null],
            &[GeometryType::Polygon, GeometryType::MultiPolygon],
        ];
        prop::sample::select(families.to_vec()).prop_map(<[GeometryType]>::to_vec).boxed()
    };
    let one = move |kinds: Vec<GeometryType>| {
        let geometry = prop::sample::select(kinds).prop_flat_map(sample::geometry);
        (geometry, sample::properties(), any::<u8>()).prop_map(move |(geometry, properties, id)| {
            let geometry = held(&geometry, &holds);
            let properties =
                if holds.properties { properties } else { FeatureProperties::default() };
            let id = holds.ids.then(|| Id::Int(id.into()));
            Feature { id, properties, geometry, foreign: Vec::new() }
        })
    };
    kinds.prop_flat_map(move |kinds| prop::collection::vec(one(kinds), 1..5)).boxed()
}

/// Ids that follow one another, so that no two neighbours are alike (in CSV they would be one).
fn numbered(mut features: Vec<Feature>) -> Vec<Feature> {
    for (at, feature) in features.iter_mut().enumerate() {
        feature.id = feature.id.as_ref().map(|_| Id::Int(at as i64));
    }
    features
}

/// The features as a FlatGeobuf has them: with heights or measures a layer of single and several ones
/// is one of several.
fn as_one_type(features: &[Feature]) -> Vec<Feature> {
    let families = [
        [GeometryType::Point, GeometryType::MultiPoint],
        [GeometryType::LineString, GeometryType::MultiLineString],
        [GeometryType::Polygon, GeometryType::MultiPolygon],
    ];
    let geometries = || features.iter().map(|feature| &feature.geometry);
    let has_more = geometries().any(|geometry| geometry.has_z() || geometry.has_m());
    let kinds: Vec<GeometryType> =
        geometries().map(Geometry::kind).filter(|k| *k != GeometryType::Null).collect();
    let mut features = features.to_vec();
    for family in families {
        if !has_more || !family.iter().all(|kind| kinds.contains(kind)) {
            continue;
        }
        if kinds.iter().all(|kind| family.contains(kind)) {
            for feature in features.iter_mut().filter(|f| f.geometry.kind() == family[0]) {
                let coordinates = feature.geometry.coordinates().clone();
                feature.geometry = Geometry::new(family[1], coordinates).unwrap();
            }
        }
    }
    features
}

fn text(features: &[Feature]) -> Vec<String> {
    features.iter().map(|feature| format!("{feature:?}")).collect()
}

#[test]
fn what_a_format_can_hold_comes_back() {
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        let mut runner = TestRunner::new(ProptestConfig::with_cases(40));
        let ran = runner.run(&features(format), |features| {
            let features = numbered(features);
            let folder = tempfile::tempdir().unwrap();
            let path = written(format, folder.path());
            let counted = write_all(&path, format, &LayerHeader::default(), &features);
            prop_assert_eq!(counted.features, features.len() as u64);
            let mut found = read_all(&path).unwrap();
            if format.name == "GPX" {
                // Waypoints, routes and tracks each have their place.
                let order =
                    |kind: GeometryType| format.holds.kinds.iter().position(|known| *known == kind);
                let mut features = features.clone();
                features.sort_by_key(|feature| order(feature.geometry.kind()));
                prop_assert_eq!(text(&found), text(&features));
                return Ok(());
            }
            let features =
                if format.name == "FlatGeobuf" { as_one_type(&features) } else { features };
            if !format.holds.properties {
                found.iter_mut().for_each(|feature| feature.properties.0.clear());
            }
            prop_assert_eq!(text(&found), text(&features));
            Ok(())
        });
        ran.unwrap_or_else(|e| panic!("{}: {e}", format.name));
    }
}

#[test]
fn features_larger_than_any_buffer_come_back() {
    let line = |n: u32| {
        let place = |i: u32| [f64::from(i % 360) * 0.5 - 90.0, f64::from(i / 360 + n) * 0.125];
        let lines = CoordinateSequence {
            ends: vec![10, 40_000],
            ..CoordinateSequence::of((0..40_000).map(place).collect())
        };
        let geometry = Geometry::new(GeometryType::MultiLineString, lines).unwrap();
        Feature { geometry, ..Feature::default() }
    };
    let features: Vec<Feature> = (0..3).map(line).collect();
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        let folder = tempfile::tempdir().unwrap();
        let path = written(format, folder.path());
        write_all(&path, format, &LayerHeader::default(), &features);
        let found = read_all(&path).unwrap();
        let geometries = |features: &[Feature]| {
            features.iter().map(|feature| feature.geometry.clone()).collect::<Vec<_>>()
        };
        assert!(geometries(&found) == geometries(&features), "{}", format.name);
    }
}

#[test]
fn the_crs_comes_back_wherever_a_format_has_a_place_for_it() {
    let line = Geometry::line(vec![[5.0, 50.0], [6.0, 51.0]]);
    let feature = Feature { geometry: line, ..Feature::default() };
    let own = r#"PROJCS["mine",GEOGCS["x",DATUM["y",SPHEROID["z",1,2]]],UNIT["metre",1]]"#;
    let systems = [wkt::of_srs("EPSG:4326"), wkt::of_srs("EPSG:28992"), wkt::from_text(own)];
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        for crs in &systems {
            let folder = tempfile::tempdir().unwrap();
            let path = written(format, folder.path());
            let layer = LayerHeader { crs: crs.clone(), ..LayerHeader::default() };
            if format.name == "GPX" && crs.epsg != Some(4326) {
                let refused = create(&path, format, &layer, &VectorWriteOptions::default());
                assert!(refused.err().unwrap().to_string().contains("reproject"));
                continue;
            }
            let counted = write_all(&path, format, &layer, std::slice::from_ref(&feature));
            let found = open(&path, &VectorOpenOptions::default()).unwrap().layer().crs.clone();
            let is_json = format.name.starts_with("GeoJSON");
            let is_held = !is_json || crs.epsg == Some(4326) || format.name == "GeoJSON";
            if is_held {
                assert!(found.agrees(crs), "{}: {} is {}", format.name, crs.label(), found.label());
            } else {
                let prj = std::fs::read_to_string(path.with_extension("prj")).unwrap();
                assert_eq!(crs.to_wkt().as_deref(), Some(prj.trim()));
            }
            assert_eq!(counted.notes.is_empty(), !is_json || crs.epsg == Some(4326));
        }
    }
}

#[test]
fn nothing_is_replaced_or_left_half_done() {
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        let folder = tempfile::tempdir().unwrap();
        let path = written(format, folder.path());
        drop(
            create(&path, format, &LayerHeader::default(), &VectorWriteOptions::default()).unwrap(),
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{}", format.name);
        std::fs::write(&path, b"mine").unwrap();
        let refused =
            create(&path, format, &LayerHeader::default(), &VectorWriteOptions::default());
        assert!(refused.is_err() && std::fs::read(&path).unwrap() == b"mine");
    }
}

#[test]
fn an_index_holds_every_feature() {
    let format = by_path(Path::new("a.fgb"), None).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.fgb");
    let options = VectorWriteOptions::default();
    let mut sink = create(&path, format, &LayerHeader::default(), &options).unwrap();
    for at in 0..1000 {
        let x = f64::from(at * 37 % 1000);
        let mut feature =
            Feature { geometry: Geometry::line(vec![[x, 0.0], [x, 1.0]]), ..Feature::default() };
        feature.properties.push("n", PropertyValue::Int(at.into()));
        sink.write(&feature).unwrap();
    }
    sink.finish(&[]).unwrap();
    let mut source = open(&path, &VectorOpenOptions::default()).unwrap();
    assert_eq!(source.layer().features, Some(1000));
    let mut seen = [false; 1000];
    while let Some(feature) = source.next().unwrap() {
        let Some(PropertyValue::Int(n)) = feature.properties.get("n") else { panic!() };
        assert_eq!(feature.geometry.coordinates().xy[0][0], (n * 37 % 1000) as f64);
        seen[*n as usize] = true;
    }
    assert!(seen.iter().all(|seen| *seen));
}

#[test]
fn coordinates_that_are_no_numbers_are_refused_with_their_place() {
    for (name, content) in [
        ("a.geojson", r#"{"type":"LineString","coordinates":[[1,2],[1e999,3]]}"#),
        ("a.wkt", "LINESTRING(1 2,1e999 3)"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = read_all(&path).unwrap_err().to_string();
        assert!(error.contains("vertex 1") && error.contains("feature"), "{error}");
    }
}

#[test]
fn what_a_shapefile_cannot_hold_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.shp");
    let format = by_path(&path, None).unwrap();
    let line =
        Feature { geometry: Geometry::line(vec![[0.0, 0.0], [1.0, 1.0]]), ..Feature::default() };
    let refused = |second: Feature| {
        let mut sink =
            create(&path, format, &LayerHeader::default(), &VectorWriteOptions::default()).unwrap();
        sink.write(&line).unwrap();
        sink.write(&second).and_then(|()| sink.finish(&[])).unwrap_err().to_string()
    };
    let mut long = line.clone();
    long.properties.push("story", PropertyValue::Text("x".repeat(255)));
    let error = refused(long);
    assert!(
        error.contains("feature 2") && error.contains("\"story\"") && error.contains("254"),
        "{error}"
    );
    let point =
        Geometry::new(GeometryType::Point, CoordinateSequence::of(vec![[1.0, 2.0]])).unwrap();
    let error = refused(Feature { geometry: point.clone(), ..Feature::default() });
    assert!(error.contains("feature 2") && error.contains("lines and points"), "{error}");
    let collection = Geometry::collection(vec![point]).unwrap();
    let error = refused(Feature { geometry: collection, ..Feature::default() });
    assert!(error.contains("feature 2") && error.contains("collections"), "{error}");
    let mut half = CoordinateSequence::default();
    half.push([0.0, 0.0], Some(1.0), None);
    half.push([1.0, 0.0], None, None);
    let half = Geometry::new(GeometryType::LineString, half).unwrap();
    let error = refused(Feature { geometry: half, ..Feature::default() });
    assert!(error.contains("feature 2") && error.contains("height"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn an_index_of_a_shapefile_that_points_astray_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.shp");
    let line =
        Feature { geometry: Geometry::line(vec![[0.0, 0.0], [1.0, 1.0]]), ..Feature::default() };
    write_all(&path, by_path(&path, None).unwrap(), &LayerHeader::default(), &[line]);
    let index = path.with_extension("shx");
    let sound = std::fs::read(&index).unwrap();
    for offset in [0_u32, 49, 90, u32::MAX] {
        let mut damaged = sound.clone();
        damaged[100..104].copy_from_slice(&offset.to_be_bytes());
        std::fs::write(&index, &damaged).unwrap();
        let error = read_all(&path).unwrap_err().to_string();
        assert!(error.contains("a.shx") && error.contains("delete the .shx"), "{error}");
    }
    std::fs::remove_file(&index).unwrap();
    assert_eq!(read_all(&path).unwrap().len(), 1);
}

/// Small files of each format, written and by hand.
fn small_files(folder: &Path) -> Vec<PathBuf> {
    let mut runner = TestRunner::deterministic();
    let mut paths = Vec::new();
    for format in FORMATS.iter().filter(|format| format.create.is_some()) {
        let features = features(format).new_tree(&mut runner).unwrap().current();
        let layer = LayerHeader { crs: wkt::of_srs("EPSG:4326"), ..LayerHeader::default() };
        let own = folder.join(format.name);
        std::fs::create_dir(&own).unwrap();
        let path = written(format, &own);
        let options = VectorWriteOptions::default();
        let mut sink = create(&path, format, &layer, &options).unwrap();
        features.iter().for_each(|feature| sink.write(feature).unwrap());
        paths.push(sink.finish(&[]).unwrap().files[0].clone());
    }
    let topology = r#"{"type":"Topology","transform":{"scale":[0.5,0.5],"translate":[1,2]},
        "objects":{"a":{"type":"GeometryCollection","geometries":[{"type":"Polygon","id":7,
        "arcs":[[0,-2]]},{"type":"LineString","arcs":[1]}]}},
        "arcs":[[[0,0],[2,0],[0,2]],[[0,0],[0,3],[2,-1]]]}"#;
    let path = folder.join("a.topojson");
    std::fs::write(&path, topology).unwrap();
    paths.push(path);
    paths
}

/// Reads to the end or to an error, which must not take long or much.
fn survive(path: &Path) {
    let Ok(mut source) = open(path, &VectorOpenOptions::default()) else { return };
    let mut count = 0;
    while let Ok(Some(feature)) = source.next() {
        assert!(feature.geometry.vertices() < 100_000);
        count += 1;
        assert!(count < 10_000);
    }
}

#[test]
fn cut_and_flipped_files_give_errors_and_nothing_worse() {
    let folder = tempfile::tempdir().unwrap();
    for path in small_files(folder.path()) {
        let sidecars = ["shx", "dbf", "cpg"].map(|ending| path.with_extension(ending));
        let targets =
            std::iter::once(path.clone()).chain(sidecars.into_iter().filter(|p| p.is_file()));
        for target in targets {
            let sound = std::fs::read(&target).unwrap();
            let step = (sound.len() / 100).max(1);
            for at in (0..sound.len()).step_by(step) {
                std::fs::write(&target, &sound[..at]).unwrap();
                survive(&path);
                for flip in [0xff, 0x01, 0x80, sound[at] ^ b'0', sound[at] ^ b'9'] {
                    let mut damaged = sound.clone();
                    damaged[at] ^= flip;
                    std::fs::write(&target, &damaged).unwrap();
                    survive(&path);
                }
            }
            std::fs::write(&target, &sound).unwrap();
        }
    }
}
