//! A reference system is one value: every kind of it through every writer, and back by our readers.

use std::path::Path;

use crate::cli_support::Place;
use crate::tiff_builder::{Spec, Value};
use terrane_base::geom::{Crs, wkt};
use terrane_raster as raster;
use terrane_vector as vector;

/// GeoKeys: their directory behind its header, their numbers and their texts.
type Keys = (&'static [[u16; 4]], &'static [f64], &'static str);

/// A kind of system: its name, its keys, the units of x and y and of z, and words of its text.
struct Kind {
    name: &'static str,
    keys: Keys,
    units: [&'static str; 2],
    words: &'static [&'static str],
}

const KINDS: &[Kind] = &[
    Kind {
        name: "custom transverse Mercator",
        keys: (
            &[
                [1024, 0, 1, 1],
                [1025, 0, 1, 1],
                [1026, 34737, 6, 0],
                [2048, 0, 1, 32767],
                [2049, 34737, 20, 6],
                [2050, 0, 1, 6326],
                [2054, 0, 1, 9102],
                [3072, 0, 1, 32767],
                [3074, 0, 1, 32767],
                [3075, 0, 1, 1],
                [3076, 0, 1, 9001],
                [3080, 34736, 1, 1],
                [3081, 34736, 1, 0],
                [3082, 34736, 1, 3],
                [3083, 34736, 1, 4],
                [3092, 34736, 1, 2],
            ],
            &[0.0, -147.06, 0.9996, 500_000.0, 0.0],
            "Local|GCS Name = WGS 84||",
        ),
        units: ["metre", ""],
        words: &["Transverse_Mercator", "\"central_meridian\",-147.06", "WGS_1984"],
    },
    Kind {
        name: "custom equal area in feet, without a datum",
        keys: (
            &[
                [1024, 0, 1, 1],
                [1025, 0, 1, 1],
                [1026, 34737, 8, 0],
                [2048, 0, 1, 32767],
                [2050, 0, 1, 32767],
                [2056, 0, 1, 7019],
                [3072, 0, 1, 32767],
                [3074, 0, 1, 32767],
                [3075, 0, 1, 10],
                [3076, 0, 1, 9003],
                [3082, 34736, 1, 2],
                [3083, 34736, 1, 3],
                [3088, 34736, 1, 1],
                [3089, 34736, 1, 0],
            ],
            &[52.5, 9.3, 4_321_000.0, 3_210_000.0],
            "unknown|",
        ),
        units: ["US survey foot", ""],
        words: &["Lambert_Azimuthal_Equal_Area", "\"latitude_of_center\",52.5", "298.257222101"],
    },
    Kind {
        name: "custom transverse Mercator with heights of a code",
        keys: (
            &[
                [1024, 0, 1, 1],
                [1026, 34737, 6, 0],
                [2048, 0, 1, 4326],
                [3072, 0, 1, 32767],
                [3074, 0, 1, 32767],
                [3075, 0, 1, 1],
                [3076, 0, 1, 9001],
                [3080, 34736, 1, 1],
                [3081, 34736, 1, 0],
                [3082, 34736, 1, 3],
                [3083, 34736, 1, 4],
                [3092, 34736, 1, 2],
                [4096, 0, 1, 6360],
            ],
            &[0.0, -147.06, 0.9996, 500_000.0, 0.0],
            "Local|",
        ),
        units: ["metre", "US survey foot"],
        words: &["COMPD_CS", "\"central_meridian\",-147.06", "\"EPSG\",\"6360\""],
    },
    Kind {
        name: "ESRI:102003",
        keys: (
            &[
                [1024, 0, 1, 1],
                [1025, 0, 1, 1],
                [1026, 34737, 39, 0],
                [2048, 0, 1, 4269],
                [3072, 0, 1, 32767],
                [3074, 0, 1, 32767],
                [3075, 0, 1, 11],
                [3076, 0, 1, 9001],
                [3078, 34736, 1, 0],
                [3079, 34736, 1, 1],
                [3080, 34736, 1, 3],
                [3081, 34736, 1, 2],
            ],
            &[29.5, 45.5, 37.5, -96.0],
            "USA_Contiguous_Albers_Equal_Area_Conic|",
        ),
        units: ["metre", ""],
        words: &["Albers_Conic_Equal_Area", "\"standard_parallel_2\",45.5", "\"EPSG\",\"4269\""],
    },
    Kind {
        name: "compound in metres",
        keys: (&[[1024, 0, 1, 1], [3072, 0, 1, 6339], [4096, 0, 1, 5703]], &[], ""),
        units: ["metre", "metre"],
        words: &["COMPD_CS", "\"EPSG\",\"6339\"", "\"EPSG\",\"5703\""],
    },
    Kind {
        name: "compound with heights in US survey feet",
        keys: (&[[1024, 0, 1, 1], [3072, 0, 1, 6339], [4096, 0, 1, 6360]], &[], ""),
        units: ["metre", "US survey foot"],
        words: &["COMPD_CS", "\"EPSG\",\"6360\""],
    },
    Kind {
        name: "a code in another unit",
        keys: (&[[1024, 0, 1, 1], [3072, 0, 1, 32104], [3076, 0, 1, 9003]], &[], ""),
        units: ["US survey foot", ""],
        words: &["\"false_easting\",1640416.66", "US survey foot"],
    },
    Kind {
        name: "geographic with ellipsoidal heights",
        keys: (&[[1024, 0, 1, 2], [2048, 0, 1, 4258], [4096, 0, 1, 4937]], &[], ""),
        units: ["degree", "metre"],
        words: &["GEOGCS", "LINUNIT[\"metre\",1]", "\"EPSG\",\"4937\""],
    },
    Kind {
        name: "local",
        keys: (&[[1025, 0, 1, 1], [1026, 34737, 14, 0], [3076, 0, 1, 9001]], &[], "Arbitrary (m)|"),
        units: ["metre", ""],
        words: &["LOCAL_CS[\"Arbitrary (m)\""],
    },
    Kind { name: "none", keys: (&[], &[], ""), units: ["unit", ""], words: &[] },
];

/// A slope of 8 x 6 cells with `keys`, as a GeoTIFF.
fn tiff((keys, numbers, texts): Keys) -> Vec<u8> {
    let mut spec = Spec::new(8, 6, 2, 16);
    let directory = [&[[1, 1, 1, keys.len() as u16]], keys].concat().concat();
    spec.extra = vec![
        (33550, Value::Double(vec![1.0, 1.0, 0.0])),
        (33922, Value::Double(vec![0.0, 0.0, 0.0, 10.0, 50.0, 0.0])),
    ];
    if !keys.is_empty() {
        spec.extra.push((34735, Value::Short(directory)));
    }
    if !numbers.is_empty() {
        spec.extra.push((34736, Value::Double(numbers.to_vec())));
    }
    if !texts.is_empty() {
        spec.extra.push((34737, Value::Text(texts.to_owned())));
    }
    spec.build(|col, row, _| (3 * col + 5 * row) as f64)
}

fn of_grid(path: &Path) -> Crs {
    raster::open(path.to_str().unwrap(), &raster::GridOpenOptions::default())
        .unwrap()
        .info()
        .crs
        .clone()
}

fn beside(path: &Path) -> Crs {
    wkt::of_srs(&std::fs::read_to_string(path.with_extension("prj")).unwrap_or_default())
}

/// Fails unless `found` is `given` in all it says.
fn check(kind: &Kind, given: &Crs, found: &Crs, what: &str) {
    let [across, up] = kind.units;
    let who = format!("{} as {what}: {} is {}", kind.name, given.label(), found.label());
    assert!(given.agrees(found) && found.agrees(given), "{who}\n{found:?}");
    assert_eq!(found.horizontal_unit(), across, "{who}");
    assert_eq!(found.vertical_unit.as_deref().unwrap_or_default(), up, "{who}\n{found:?}");
    assert_eq!((found.epsg, found.vertical_epsg), (given.epsg, given.vertical_epsg), "{who}");
    let text = found.to_wkt().unwrap_or_default();
    assert!(kind.words.iter().all(|word| text.contains(word)), "{who}\n{text}");
    assert_eq!(found.is_named(), given.is_named(), "{who}");
}

fn each(mut test: impl FnMut(&Kind, &Place, &Crs)) {
    for kind in KINDS {
        let place = Place::new();
        place.write("in.tif", tiff(kind.keys));
        let given = of_grid(&place.path("in.tif"));
        check(kind, &given, &given, "read");
        test(kind, &place, &given);
    }
}

#[test]
fn every_mesh_has_the_whole_system_beside_it() {
    each(|kind, place, given| {
        for ending in ["ply", "obj", "stl", "glb"] {
            let out = format!("mesh-{ending}.{ending}");
            place.ok(&["tin", "in.tif", &out, "--max-error", "0", "-q"]);
            check(kind, given, &beside(&place.path(&out)), ending);
        }
    });
}

#[test]
fn every_grid_has_the_whole_system_in_it_or_beside_it() {
    each(|kind, place, given| {
        for (out, format) in [
            ("store.tif", "store"),
            ("g.tif", "GTiff"),
            ("cog.tif", "COG"),
            ("a.asc", "AAIGrid"),
            ("f.flt", "GridFloat"),
            ("p-terrain-rgb.png", "PNG"),
        ] {
            place.ok(&["convert", "in.tif", out, "-f", format, "-q"]);
            let mut found = of_grid(&place.path(out));
            if format == "PNG" {
                // Heights of these pictures are metres by what they are.
                found.vertical_unit = given.vertical_unit.clone();
            }
            check(kind, given, &found, format);
        }
        // From text to keys, too.
        for out in ["again.tif", "again.asc"] {
            place.ok(&["convert", "a.asc", out, "-q"]);
            check(kind, given, &of_grid(&place.path(out)), out);
        }
    });
}

#[test]
fn every_file_of_lines_has_the_whole_system_in_it_or_beside_it() {
    each(|kind, place, given| {
        for out in ["c.shp", "c.fgb", "c.geojson", "w.wkt", "v.csv"] {
            place.ok(&["contour", "in.tif", "-o", out, "--interval", "4", "-q"]);
            let options = vector::VectorOpenOptions::default();
            let found = vector::open(&place.path(out), &options).unwrap().layer().crs.clone();
            // GeoJSON means WGS 84 where it says nothing, and then a note says so.
            if given.is_named() || out != "c.geojson" {
                check(kind, given, &found, out);
            }
        }
    });
}

#[test]
fn a_sidecar_of_another_file_never_speaks_for_a_new_one() {
    let foreign = wkt::of_srs("EPSG:28992").to_wkt().unwrap();
    each(|kind, place, given| {
        for (verb, out, more) in [
            ("tin", "x.ply", &["--max-error", "0"][..]),
            ("tin", "x.stl", &["--max-error", "0"]),
            ("contour", "x.shp", &["--interval", "4"]),
            ("contour", "x.csv", &["--interval", "4"]),
            ("contour", "x.wkt", &["--interval", "4"]),
            ("convert", "x.asc", &[]),
            ("convert", "x.flt", &[]),
            ("convert", "x.png", &[]),
        ] {
            let files = if verb == "contour" { &["-o", out][..] } else { &[out] };
            let args = [&[verb, "in.tif"], files, &["-q"], more].concat();
            place.write("x.prj", &foreign);
            place.fails(&args, 2, &["x.prj", "--overwrite"]);
            place.ok(&[&args[..], &["--overwrite"]].concat());
            let found = beside(&place.path(out));
            assert_eq!(place.path("x.prj").exists(), given.is_named(), "{} {out}", kind.name);
            check(kind, given, &found, out);
            // What says the same is no hindrance, and stays.
            for file in place.files().iter().filter(|f| f.starts_with("x.") && *f != "x.prj") {
                std::fs::remove_file(place.path(file)).unwrap();
            }
            place.ok(&args);
            std::fs::remove_file(place.path(out)).unwrap();
            place.files().iter().filter(|file| file.starts_with("x.")).for_each(|file| {
                std::fs::remove_file(place.path(file)).unwrap();
            });
        }
    });
}

#[test]
fn custom_systems_are_told_apart() {
    let place = Place::new();
    let (keys, numbers, texts) = KINDS[1].keys;
    let moved: &'static [f64] = &[52.5, 10.0, 4_321_000.0, 3_210_000.0];
    place.write("a.tif", tiff((keys, numbers, texts))).write("b.tif", tiff((keys, moved, texts)));
    let args = ["tin", "a.tif", "b.tif", "x.ply", "--max-error", "0"];
    place.fails(&args, 65, &["longitude_of_center 10", "longitude_of_center 9.3"]);
    let near: &'static [f64] = &[52.5, 9.3 + 1e-12, 4_321_000.0, 3_210_000.0];
    place.write("b.tif", tiff((keys, near, "another name|")));
    assert!(of_grid(&place.path("a.tif")).agrees(&of_grid(&place.path("b.tif"))));
}
