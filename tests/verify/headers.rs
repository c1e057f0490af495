//! Every field of the headers of meshes written wrongly in turn, in every format: a broken promise, an error, or
//! named as not judged, and never "every promise is kept".

use std::io::{Cursor, Read, Write};

use crate::cli_support::{Place, Ran};
use terrane_mesh::{FORMATS, MeshFormat};

const TERRAIN: &str = "synth:rough,size=120,seed=3";
const PEAKS: &str = r#"{"type":"FeatureCollection","crs":{"type":"name","properties":{"name":"EPSG:32631"}},
"features":[{"type":"Feature","properties":{},"geometry":{"type":"Point","coordinates":[500300,4749700]}}]}"#;

/// A mesh's bound and options, those of its proof, and whether an STL file states them.
struct Made {
    error: &'static str,
    options: &'static [&'static str],
    proof: &'static [&'static str],
    in_stl: bool,
}

const PLAIN: Made = Made { error: "5", options: &[], proof: &[], in_stl: true };
const SURFACE: Made = Made { options: &["--bound", "surface"], ..PLAIN };
const FITTED: Made = Made { options: &["--fit-heights"], ..PLAIN };
const ANGLES: Made = Made { options: &["--min-angle", "10"], ..PLAIN };
const FREE: Made = Made { options: &["--triangulation", "data-dependent"], ..PLAIN };
const NAMES: Made = Made { in_stl: false, ..PLAIN };
const FINE: Made = Made { error: "1", ..NAMES };
const KEPT: Made = Made {
    options: &["--keep-points", "peaks.geojson"],
    proof: &["--keep-points", "peaks.geojson"],
    ..NAMES
};

/// What a header says, what it is made to say instead, the exit code, and what is told.
type Wrong = (&'static Made, &'static str, &'static str, i32, &'static str);

const STATEMENTS: [Wrong; 39] = [
    (&PLAIN, "max error 5", "max error 0.1", 1, "further from the mesh than the tolerance"),
    (&PLAIN, "max error 5", "max error five", 65, "invalid statement"),
    (&PLAIN, "max error 5", "max error -5", 65, "invalid statement"),
    (&PLAIN, "max error 5", "most error 5", 3, "the statement \"most error 5"),
    (&NAMES, "max error 5 metre", "max error 5 foot", 1, "largest error in foot"),
    (&NAMES, "max error 5 metre", "max error 5 rods", 1, "largest error in rods"),
    (&NAMES, "max error 5 metre", "max error 5", 3, "the unit of its largest error"),
    (&SURFACE, "bound surface", "bound volume", 65, "bound volume"),
    (&SURFACE, "bound surface", "bounds surface", 3, "bounds surface"),
    (&FITTED, "fitted heights", "fitted widths", 65, "fitted widths"),
    (&FITTED, "fitted heights", "sundry heights", 1, "vertices off the samples"),
    (&ANGLES, "min angle 10", "min angle 50", 1, "angle below the minimum"),
    (&ANGLES, "min angle 10", "min angle ten", 65, "invalid statement"),
    (&ANGLES, "min angle 10", "least angle 10", 3, "least angle 10"),
    (&FREE, "triangulation data-dependent", "triangulation delaunay", 1, "not Delaunay on the"),
    (&FREE, "triangulation data-dependent", "triangle data-dependent", 1, "not Delaunay on the"),
    (&FREE, "triangulation data-dependent", "triangulation sloppy", 65, "triangulation sloppy"),
    (&KEPT, "keep points peaks", "lose points peaks", 3, "the statement \"lose points"),
    (&NAMES, "crs EPSG:32631", "crs EPSG:32632", 1, "EPSG:32632"),
    (&NAMES, "crs EPSG:32631", "crs EPSG:4326", 1, "EPSG:4326"),
    (&NAMES, "crs EPSG:32631", "crs somewhere", 3, "somewhere"),
    (&NAMES, "crs EPSG:32631", "crs EPSG:32631+5773", 3, "EPSG:32631+5773"),
    // What is stated in place of the name of the grid.
    (&FINE, "source synth:rough", "bound surface\nx", 1, "between samples further"),
    (&NAMES, "source synth:rough", "fitted widths\nx", 65, "fitted widths"),
    (&NAMES, "source synth:rough", "min angle 50\nx", 1, "angle below the minimum"),
    (&NAMES, "source synth:rough", "clip area.fgb\nx", 3, "the polygons of area.fgb"),
    (&NAMES, "source synth:rough", "water sea.fgb\nx", 3, "the water of sea.fgb"),
    (&NAMES, "source synth:rough", "keep points p.fgb\nx", 3, "the points of p.fgb"),
    (&NAMES, "source synth:rough", "breaklines b.fgb\nx", 3, "the lines of b.fgb"),
    (&NAMES, "source synth:rough", "bands 1,2\nx", 3, "bands 1,2"),
    (&NAMES, "source synth:rough", "weights 1,2\nx", 3, "weights 1,2"),
    (&NAMES, "source synth:rough", "heights band 1\nx", 3, "heights band 1"),
    (&NAMES, "source synth:rough", "heights in feet\nx", 3, "heights in feet"),
    (&NAMES, "source synth:rough", "transformed from EPSG:2\nx", 65, "was transformed from"),
    (&NAMES, "source synth:rough", "max error 50\nx", 65, "states contradictory"),
    (&NAMES, "source synth:rough", "crs EPSG:32632\nx", 65, "states contradictory"),
    (&NAMES, "source synth:rough", "size small\nx", 3, "the statement \"size small"),
    // No promises: what they say is told, and not judged.
    (
        &NAMES,
        "source synth:rough",
        "source synth:smooth",
        0,
        "smooth,size=120,seed=3 (from the header, not judged)",
    ),
    (&NAMES, "terrane 0.", "another 0.", 0, "(not promised by this mesh)"),
];

/// Fields that formats have beside their comments.
const OF_FORMATS: [(&str, Wrong); 22] = [
    ("LandXML", (&PLAIN, "linearUnit=\"meter\"", "linearUnit=\"foot\"", 1, "its unit is foot")),
    ("LandXML", (&PLAIN, "linearUnit=\"meter\"", "linearUnit=\"rod\"", 3, "its unit is rod")),
    ("LandXML", (&PLAIN, "epsgCode=\"32631\"", "epsgCode=\"32632\"", 1, "EPSG:32632")),
    ("LandXML", (&PLAIN, "desc=\"EPSG:32631", "desc=\"EPSG:32632", 1, "EPSG:32632")),
    ("LandXML", (&PLAIN, "&quot;,3]", "&quot;,9]", 1, "the mesh names the CRS")),
    ("LandXML", (&PLAIN, "surfType=\"TIN\"", "surfType=\"grid\"", 65, "grid")),
    ("DXF", (&PLAIN, "$INSUNITS\n70\n6", "$INSUNITS\n70\n2", 1, "its unit is foot")),
    ("DXF", (&PLAIN, "$INSUNITS\n70\n6", "$INSUNITS\n70\n13", 3, "$INSUNITS 13")),
    ("3MF", (&PLAIN, "unit=\"meter\"", "unit=\"foot\"", 1, "its unit is foot")),
    ("3MF", (&PLAIN, "unit=\"meter\"", "unit=\"league\"", 3, "league")),
    ("3MF", (&PLAIN, "terrane:origin\">5", "terrane:origin\">6", 1, "not covered by the mesh")),
    ("3MF", (&PLAIN, "terrane:origin\">5", "terrane:origin\">x", 1, "not covered by the mesh")),
    ("3MF", (&PLAIN, "type=\"surface\"", "type=\"model\"", 65, "solid")),
    ("GLB", (&PLAIN, "\"origin\":[5", "\"origin\":[6", 1, "not covered by the mesh")),
    ("GLB", (&PLAIN, "\"origin\":[5", "\"centre\":[5", 1, "not covered by the mesh")),
    ("GLB", (&PLAIN, "\"max\":[", "\"max\":[1", 1, "the mesh states that it lies from")),
    ("GLB", (&PLAIN, "\"min\":[-", "\"min\":[-1", 1, "the mesh states that it lies from")),
    ("GLB-meshopt", (&PLAIN, "\"max\":[", "\"max\":[1", 1, "the mesh states that it lies from")),
    ("GLB-meshopt", (&PLAIN, "\"origin\":[5", "\"origin\":[6", 1, "not covered by the mesh")),
    ("STL", (&PLAIN, "origin 5", "origin 6", 1, "not covered by the mesh")),
    ("STL", (&PLAIN, "origin 5", "centre 5", 1, "not covered by the mesh")),
    ("PLY", (&PLAIN, "element vertex ", "element vertex 1", 65, "do not fit")),
];

#[test]
fn no_statement_that_is_wrong_passes_in_any_format() {
    for format in FORMATS {
        let place = Place::new();
        place.write("peaks.geojson", PEAKS);
        let names = format.name != "STL";
        for wrong in STATEMENTS.iter().filter(|(made, ..)| names || made.in_stl) {
            check(&place, format, wrong);
        }
        for (_, wrong) in OF_FORMATS.iter().filter(|(name, _)| *name == format.name) {
            check(&place, format, wrong);
        }
    }
}

/// Makes a mesh, which is proved, and writes one field of it wrongly.
fn check(place: &Place, format: &MeshFormat, (made, from, to, code, told): &Wrong) {
    let mesh = &format!("{}-mesh.{}", format.name, format.extensions[0]);
    let make = ["tin", TERRAIN, mesh, "-f", format.name, "--max-error", made.error, "--overwrite"];
    place.ok(&[&make, made.options].concat());
    let proof = [&["verify", mesh, TERRAIN], made.proof].concat();
    let sound = place.ok(&proof).out;
    assert!(sound.contains("every promise is kept"), "{mesh}: {sound}");
    place.write(mesh, edited(&place.bytes(mesh), from, to, format.name));
    let Ran { code: found, out, err } = place.run(&proof);
    let what = format!("{mesh}: \"{to}\" for \"{from}\": {out}{err}");
    assert_eq!(found, *code, "{what}");
    assert!(format!("{out}{err}").contains(told), "{what}");
    assert_eq!(out.contains("every promise is kept"), *code == 0, "{what}");
}

/// The bytes of a mesh with the first of some words replaced; behind a line break, by a comment of its own.
fn edited(bytes: &[u8], from: &str, to: &str, format: &str) -> Vec<u8> {
    let from = &match format {
        "LandXML" => from.replacen("crs ", "desc=\"", 1),
        "GLB" | "GLB-meshopt" => from.replacen("crs ", "\"crs\":\"", 1),
        "STL" => from.replacen("triangulation data-dependent", "by any", 1),
        _ => from.to_owned(),
    };
    let to = &if format == "STL" { to.replacen("triangulation ", "by ", 1) } else { to.to_owned() };
    let to = match (from.contains('"'), to.strip_prefix("crs ")) {
        (true, Some(system)) => from.split("EPSG").next().unwrap_or_default().to_owned() + system,
        _ => to.to_owned(),
    };
    let change = |text: &str| {
        let comment = match format {
            "PLY" => "\ncomment ",
            "OBJ" => "\n# ",
            "DXF" => "\n999\n",
            "LandXML" => "\"/><Property label=\"comment\" value=\"",
            "3MF" => "</metadata><metadata name=\"terrane:comment-9\">",
            _ => "\",\"",
        };
        // Of the mark there may be two.
        let most = if from.starts_with("terrane") { 2 } else { 1 };
        text.contains(from).then(|| {
            text.replacen(
                from,
                &to.replace('\n', if from.contains('\n') { "\n" } else { comment }),
                most,
            )
        })
    };
    match format {
        "3MF" => in_archive(bytes, change),
        "GLB" | "GLB-meshopt" => in_glb(bytes, change),
        "STL" => {
            let title = change(std::str::from_utf8(&bytes[..80]).unwrap()).expect("not there");
            [format!("{:<80.80}", title.trim_end()).as_bytes(), &bytes[80..]].concat()
        }
        _ => in_bytes(bytes, from, change),
    }
}

fn in_bytes(bytes: &[u8], from: &str, change: impl Fn(&str) -> Option<String>) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|some| some == from.as_bytes());
    let at = at.unwrap_or_else(|| panic!("no {from}"));
    let changed = change(from).unwrap();
    [&bytes[..at], changed.as_bytes(), &bytes[at + from.len()..]].concat()
}

fn in_archive(bytes: &[u8], change: impl Fn(&str) -> Option<String>) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut changed = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let mut count = 0;
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).unwrap();
        let mut text = String::new();
        file.read_to_string(&mut text).unwrap();
        let new = change(&text);
        count += usize::from(new.is_some());
        changed.start_file(file.name().unwrap(), zip::write::SimpleFileOptions::default()).unwrap();
        changed.write_all(new.unwrap_or(text).as_bytes()).unwrap();
    }
    assert_eq!(count, 1, "files of the archive that were changed");
    changed.finish().unwrap().into_inner()
}

/// The same of the JSON of a GLB file, whose lengths change.
fn in_glb(bytes: &[u8], change: impl Fn(&str) -> Option<String>) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = std::str::from_utf8(&bytes[20..20 + length]).unwrap();
    let mut json = change(text.trim_end()).expect("not there");
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let rest = &bytes[20 + length..];
    let total = (20 + json.len() + rest.len()) as u32;
    let head = [&bytes[..8], &total.to_le_bytes(), &(json.len() as u32).to_le_bytes()].concat();
    [&head, &bytes[16..20], json.as_bytes(), rest].concat()
}

/// The `.prj` beside a mesh of any format: another system, one that cannot be read, and none.
#[test]
fn the_system_beside_a_mesh_is_judged() {
    for format in FORMATS {
        let place = Place::new();
        let mesh = &format!("a.{}", format.extensions[0]);
        place.ok(&["tin", TERRAIN, mesh, "-f", format.name, "--max-error", "5"]);
        let proof = ["verify", mesh, TERRAIN];
        assert!(place.ok(&proof).out.contains("every promise is kept"), "{mesh}");
        let prj = &mesh.replace(mesh.rsplit('.').next().unwrap_or_default(), "prj");
        let sound = String::from_utf8(place.bytes(prj)).unwrap();
        let other = sound.replace("\"central_meridian\",3]", "\"central_meridian\",9]");
        let other = other.replace("32631", "32632").replace("zone 31N", "zone 32N");
        assert_ne!(sound, other);
        place.write(prj, other);
        let found = place.run(&proof);
        assert_eq!(found.code, 1, "{mesh}: {}", found.out);
        assert!(found.out.contains(".prj beside it names the CRS EPSG:32632"), "{}", found.out);
        place.write(prj, "somewhere");
        let found = place.run(&proof);
        assert_eq!(found.code, 3, "{mesh}: {}", found.out);
        std::fs::remove_file(place.path(prj)).unwrap();
        let found = place.run(&proof);
        assert_eq!(found.code, if format.names_crs { 0 } else { 3 }, "{mesh}: {}", found.out);
        assert_eq!(found.out.contains("STL has no place for one"), !format.names_crs);
    }
}

/// A grid that names another system, or none.
#[test]
fn the_system_of_the_grid_is_that_of_the_mesh() {
    let place = Place::new();
    place.ok(&["synth", "rough,size=60,seed=3", "a.tif"]);
    place.ok(&["tin", "a.tif", "mesh.ply", "--max-error", "5"]);
    place.ok(&["convert", "a.tif", "b.asc"]);
    let told = |code: i32, words: &str| {
        let found = place.run(&["verify", "mesh.ply", "b.asc"]);
        assert_eq!(found.code, code, "{}{}", found.out, found.err);
        assert!(found.out.contains(words), "{}", found.out);
    };
    told(0, "every promise is kept");
    let own = String::from_utf8(place.bytes("b.prj")).unwrap();
    let other = own
        .replace("zone 31N", "zone 32N")
        .replace("\"central_meridian\",3]", "\"central_meridian\",9]");
    place.write("b.prj", other.replace("32631", "32632"));
    told(1, "the mesh names the CRS EPSG:32631");
    std::fs::remove_file(place.path("b.prj")).unwrap();
    told(3, "the grid names none");
}

/// The index of a folder of meshes, and the header of one of its blocks.
#[test]
fn no_field_of_an_index_that_is_wrong_passes() {
    for (name, wrong) in [
        ("index.geojson", ("max error 5 metre", "max error 9 metre", 65)),
        ("index.geojson", ("max error 5 metre", "most error 5 metre", 3)),
        ("index.geojson", ("\"epsg\":32631", "\"epsg\":32632", 1)),
        ("index.geojson", ("crs:EPSG::32631", "crs:EPSG::32632", 1)),
        ("index.geojson", ("\"format\":\"PLY\"", "\"format\":\"OBJ\"", 65)),
        ("index.geojson", ("\"triangles\":", "\"triangles\":1", 65)),
        ("index.geojson", ("\"vertices\":", "\"vertices\":1", 65)),
        ("index.geojson", ("\"bytes\":", "\"bytes\":1", 65)),
        ("index.geojson", ("block-0000-0000", "block-0000-0001", 65)),
        ("index.geojson", ("terrane mesh in blocks", "some mesh in blocks", 65)),
        ("block-0000-0001.ply", ("max error 5 metre", "max error 1 metre", 65)),
        ("block-0000-0001.ply", ("crs EPSG:32631", "crs EPSG:32632", 65)),
        ("block-0000-0000.prj", ("central_meridian\",3]", "central_meridian\",9]", 1)),
    ] {
        let place = Place::new();
        let make = ["tin", TERRAIN, "m", "-f", "PLY", "--max-error", "5", "--tile", "64"];
        place.ok(&[&make[..], &["--split", "1"]].concat());
        let proof = ["verify", "m", TERRAIN];
        assert!(place.ok(&proof).out.contains("every promise is kept"));
        let (from, to, code) = wrong;
        let path = format!("m/{name}");
        let change = |text: &str| text.contains(from).then(|| to.to_owned());
        place.write(&path, in_bytes(&place.bytes(&path), from, change));
        let found = place.run(&proof);
        let what = format!("{name}: {to} for {from}: {}{}", found.out, found.err);
        assert_eq!(found.code, code, "{what}");
        assert!(!found.out.contains("every promise is kept"), "{what}");
    }
}
