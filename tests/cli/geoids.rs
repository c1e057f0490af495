//! Geoids as GeoTIFF, as PROJ's grids are, beside the same ones as GTX: the same bytes come of both.

use crate::cli_support::{Place, json};
use crate::tiff_builder::{Spec, Value};
use crate::tiles::{plain, walk};

const SIZE: usize = 9;
const WEST: f64 = 6.0;
const SOUTH: f64 = 45.0;
const STEP: f64 = 0.25;
/// What a geodetic grid says that it is.
const KIND: &str = "VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL";

fn height(col: usize, row: usize) -> f32 {
    47.0 + 1.7 * col as f32 - 0.9 * row as f32 + 0.01 * ((col * 7 + row * 13) % 11) as f32
}

/// Counted from the south.
fn gtx() -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [SOUTH, WEST, STEP, STEP].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([SIZE as u32; 2].iter().flat_map(|v| v.to_be_bytes()));
    let all = (0..SIZE).flat_map(|row| (0..SIZE).map(move |col| (col, row)));
    bytes.extend(all.flat_map(|(col, row)| height(col, row).to_be_bytes()));
    bytes
}

/// Counted from the north: 32-bit floats, samples at points, in longitudes and latitudes of WGS 84.
fn tiff() -> Spec {
    let north = SOUTH + STEP * (SIZE - 1) as f64;
    let mut spec = Spec::new(SIZE, SIZE, 3, 32);
    spec.extra = vec![
        (33550, Value::Double(vec![STEP, STEP, 0.0])),
        (33922, Value::Double(vec![0.0, 0.0, 0.0, WEST, north, 0.0])),
        keys(&[(1024, 2), (1025, 2), (2048, 4326), (4096, 4979)]),
        items(KIND, "metre"),
    ];
    spec
}

fn keys(list: &[(u16, u16)]) -> (u16, Value) {
    let mut all = vec![1, 1, 1, list.len() as u16];
    all.extend(list.iter().flat_map(|(key, value)| [*key, 0, 1, *value]));
    (34735, Value::Short(all))
}

fn items(kind: &str, unit: &str) -> (u16, Value) {
    let text = format!(
        "<GDALMetadata><Item name=\"TYPE\">{kind}</Item>\
         <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">{unit}</Item>\
         <Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">geoid_undulation</Item></GDALMetadata>"
    );
    (42112, Value::Text(text))
}

/// Another value of a tag.
fn with(mut spec: Spec, tag: (u16, Value)) -> Spec {
    spec.extra.retain(|(own, _)| *own != tag.0);
    spec.extra.push(tag);
    spec
}

fn samples(col: usize, row: usize, _: usize) -> f64 {
    f64::from(height(col, SIZE - 1 - row))
}

/// A grid, and its mesh with heights above the ellipsoid by a geoid.
fn place() -> Place {
    let place = Place::new();
    plain(&place, [60, 60], [7.2, 46.3, 0.0005], |col, row| ((col * 37 + row * 91) % 50) as f64);
    place.write("g.gtx", gtx());
    place.ok(&["tiles", "g.asc", "gtx", "--geoid", "g.gtx", "-q"]);
    place
}

/// However it is stored: blocks, order of bytes, samples at points or of areas, whole numbers with a scale.
#[test]
fn a_geotiff_is_the_same_as_a_gtx() {
    let place = place();
    let north = SOUTH + STEP * (SIZE - 1) as f64;
    let area = with(
        with(tiff(), keys(&[(1024, 2), (1025, 1), (2048, 4326)])),
        (33922, Value::Double(vec![0.0, 0.0, 0.0, WEST - STEP / 2.0, north + STEP / 2.0, 0.0])),
    );
    let plain_metadata = {
        let mut spec = tiff();
        spec.extra.retain(|(tag, _)| *tag != 42112);
        spec
    };
    let specs = [
        ("points", tiff()),
        ("area", area),
        ("bare", plain_metadata),
        ("big", Spec { big_endian: true, big_tiff: true, ..tiff() }),
        ("tiled", Spec { tile: Some((16, 16)), compression: 8, predictor: 3, ..tiff() }),
        ("double", Spec { bits: 64, ..tiff() }),
        ("accuracy", Spec { bands: 2, separate: true, ..tiff() }),
    ];
    for (name, spec) in specs {
        let file = format!("{name}.tif");
        place.write(&file, spec.build(samples));
        place.ok(&["tiles", "g.asc", name, "--geoid", &file, "-q"]);
        for tile in walk(&place, "gtx") {
            let [one, other] = ["gtx", name].map(|set| place.bytes(&format!("{set}/{tile}")));
            assert!(one == other, "{name}: {tile}");
        }
    }
    place.ok(&["verify", "points", "g.asc", "--geoid", "area.tif", "-q"]);
    place.ok(&["plan", "tiles", "g.asc", "-o", "work", "--geoid", "points.tif", "-q"]);
    place.ok(&["run", "work", "-q"]);
    let made = walk(&place, "work/tiles");
    assert!(!made.is_empty());
    // The other verbs.
    for verb in [
        &["tin", "g.asc", "m.ply", "--max-error", "2"][..],
        &["contour", "g.asc", "-o", "m.geojson", "--interval", "10"],
    ] {
        let mesh = |geoid: &str| {
            let more = ["--to-crs", "EPSG:4979", "--geoid", geoid, "--overwrite", "-q"];
            let ran = place.run(&[verb, &more].concat());
            (ran.code, ran.err.replace(geoid, ""), std::fs::read(place.path(verb[2])).ok())
        };
        assert_eq!(mesh("g.gtx"), mesh("points.tif"), "{verb:?}");
    }
    // Whole numbers of hundredths; and samples that are not known.
    let scale =
        "<GDALMetadata><Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.01</Item></GDALMetadata>";
    let whole =
        with(Spec { format: 2, bits: 16, ..tiff() }, (42112, Value::Text(scale.to_owned())));
    place.write("whole.tif", whole.build(|col, row, _| (samples(col, row, 0) * 100.0).round()));
    place.ok(&["tiles", "g.asc", "whole", "--geoid", "whole.tif", "-q"]);
    let told = json(&place.run(&["verify", "whole", "g.asc", "--geoid", "g.gtx", "--json"]).out);
    for level in told["levels"].as_array().unwrap() {
        assert!(level["over"].as_u64().unwrap() < 20, "within half a hundredth: {level}");
    }
    let holed = with(tiff(), (42113, Value::Text("-99".to_owned())));
    place.write("holed.tif", holed.build(|_, _, _| -99.0));
    place.fails(
        &["tiles", "g.asc", "none", "--geoid", "holed.tif"],
        65,
        &["the geoid has no value at longitude 7.2"],
    );
}

#[test]
fn what_is_no_geoid_is_refused_by_name() {
    let place = place();
    let turned = {
        let mut spec = tiff();
        spec.extra.retain(|(tag, _)| ![33550, 33922].contains(tag));
        let matrix = [0.2, 0.1, 0.0, 6.0, 0.1, -0.2, 0.0, 47.0];
        let all = matrix.into_iter().chain([0.0; 7]).chain([1.0]).collect();
        with(spec, (34264, Value::Double(all)))
    };
    let unsaid = |spec: Spec| {
        let mut spec = spec;
        spec.extra.retain(|(tag, _)| *tag != 42112);
        spec
    };
    let nowhere = {
        let mut spec = tiff();
        spec.extra.retain(|(tag, _)| *tag != 34735);
        spec
    };
    let beyond = with(tiff(), (33922, Value::Double(vec![0.0, 0.0, 0.0, WEST, 91.0, 0.0])));
    let cases = [
        ("feet", with(tiff(), items(KIND, "foot")), "heights in foot, not in metres"),
        (
            "seconds",
            with(tiff(), items(KIND, "arc-second")),
            "heights in arc-second, not in metres",
        ),
        ("shift", with(tiff(), items("HORIZONTAL_OFFSET", "metre")), "of type HORIZONTAL_OFFSET"),
        ("bands", unsaid(Spec { bands: 3, ..tiff() }), "has 3 bands"),
        ("bytes", Spec { format: 1, bits: 8, ..tiff() }, "samples of type uint8"),
        (
            "utm",
            with(tiff(), keys(&[(1024, 1), (1025, 2), (3072, 32632)])),
            "has the CRS EPSG:32632",
        ),
        ("paris", with(tiff(), keys(&[(1024, 2), (1025, 2), (2048, 4807)])), "from Greenwich"),
        ("turned", turned, "are not meridians"),
        ("nowhere", nowhere, "lacks a georeference"),
        ("beyond", beyond, "exceeds the globe"),
    ];
    for (name, spec, words) in cases {
        let file = format!("{name}.tif");
        place.write(&file, spec.build(samples));
        let asked = ["tiles", "g.asc", "none", "--geoid", &file];
        place.fails(&asked, 65, &[&file, words]);
    }
    // Damage of any kind is an error, too, and a size that does not fit is told before anything is held.
    let sound = tiff().build(samples);
    // The last bytes say that no other image follows.
    for length in (0..sound.len() - 4).step_by(37) {
        place.write("cut.tif", &sound[..length]);
        let ran = place.run(&["tiles", "g.asc", "none", "--geoid", "cut.tif"]);
        assert_eq!(ran.code, 65, "{length}: {ran:?}");
    }
    let sparse = |rows: u64| {
        let mut spec = Spec { rows_per_strip: SIZE, sparse: vec![0], ..tiff() };
        for (tag, value) in [(256, 1 << 14), (257, rows), (278, rows)] {
            spec = with(spec, (tag, Value::Long(vec![value])));
        }
        with(spec, (33550, Value::Double(vec![1e-4, 1e-4, 0.0]))).build(|_, _, _| 0.0)
    };
    place.write("huge.tif", sparse(1 << 14)).write("large.tif", sparse(1 << 12));
    place.fails(
        &["tiles", "g.asc", "none", "--geoid", "huge.tif"],
        65,
        &["huge.tif", "the size of the geoid grid"],
    );
    place.fails(
        &["tiles", "g.asc", "none", "--geoid", "large.tif", "--memory", "1G"],
        75,
        &["large.tif", "--memory 2048M or more"],
    );
}
