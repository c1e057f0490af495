//! `--bbox`: of every verb that reads grids, the part is a grid of its own.

use crate::cli_support::{Place, json};
use crate::tiles::walk;

const WHOLE: &str = "synth:rough,size=260";
const BOX: &str = "500500,4748600,501490,4749800";

/// A file without what a mesh says of the one it was made of.
fn bare(place: &Place, name: &str) -> Vec<u8> {
    let bytes = place.bytes(name);
    let head = bytes.windows(14).position(|part| part == b"element vertex").unwrap_or(0);
    bytes[head..].to_vec()
}

/// What is made of the part is what is made of a file with the part alone.
#[test]
fn every_verb_reads_the_part_alone() {
    let place = Place::new();
    place.ok(&["convert", WHOLE, "part.tif", "--bbox", BOX, "-q"]);
    let told = json(&place.ok(&["info", "part.tif", "--json"]).out);
    assert!(told["width"] == 100 && told["height"] == 121, "{told}");
    let part = json(&place.ok(&["info", WHOLE, "--bbox", BOX, "--json"]).out);
    assert_eq!([&part["width"], &part["height"]], [&told["width"], &told["height"]]);
    for (verb, name, more) in [
        ("tin", "m.ply", &["--max-error", "2"][..]),
        ("contour", "c.wkt", &["-i", "50"]),
        ("convert", "c.asc", &[]),
        ("tiles", "t", &["--max-level", "9", "--no-gzip"]),
    ] {
        let make = |input: &str, name: &str, part: &[&str]| {
            let output = if verb == "contour" { vec!["-o", name] } else { vec![name] };
            let names = [&[verb, input][..], &output, more, part, &["-q"]].concat();
            place.ok(&names);
        };
        let (a, b) = (format!("a-{name}"), format!("b-{name}"));
        make("part.tif", &a, &[]);
        make(WHOLE, &b, &["--bbox", BOX]);
        if verb == "tiles" {
            assert_eq!(walk(&place, &a), walk(&place, &b));
            for file in walk(&place, &a).iter().filter(|file| *file != "layer.json") {
                assert_eq!(
                    place.bytes(&format!("{a}/{file}")),
                    place.bytes(&format!("{b}/{file}")),
                    "{file}"
                );
            }
        } else {
            assert!(bare(&place, &a) == bare(&place, &b), "{verb}");
        }
    }
    for made in ["b-m.ply", "b-t"] {
        place.ok(&["verify", made, WHOLE, "--bbox", BOX, "-q"]);
        assert_eq!(
            place.run(&["verify", made, WHOLE, "-q"]).code,
            1,
            "{made} is of the part alone"
        );
    }
    place.ok(&["tin", WHOLE, "p.ply", "--max-error", "2", "--bbox", BOX, "--workdir", "w", "-q"]);
    assert!(bare(&place, "p.ply") == bare(&place, "b-m.ply"));
    // With water and polygons, which are of the whole.
    let pond = "POLYGON ((500400 4749800, 500900 4749700, 500700 4749200, 500400 4749800))";
    place.write("pond.wkt", pond).write("pond.prj", "EPSG:32631");
    place.ok(&["convert", WHOLE, "wet.tif", "--water", "pond.wkt", "-q"]);
    place.ok(&["convert", "wet.tif", "one.asc", "--bbox", BOX, "-q"]);
    place.ok(&["convert", WHOLE, "two.asc", "--water", "pond.wkt", "--bbox", BOX, "-q"]);
    assert_eq!(place.bytes("one.asc"), place.bytes("two.asc"));
}

#[test]
fn boxes_that_cannot_be_are_refused() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=1", "c.laz", "-q"]);
    place.ok(&["tin", WHOLE, "m.ply", "--max-error", "5", "-q"]);
    for verb in
        [&["tin", WHOLE, "o.ply", "--max-error", "1"][..], &["tiles", WHOLE, "o"], &["info", WHOLE]]
    {
        place.fails(
            &[verb, &["--bbox", "0,0,1,1"]].concat(),
            2,
            &["contains no cell", "y max within"],
        );
        place.fails(&[verb, &["--bbox", "1,2,3"]].concat(), 2, &["--bounds"]);
    }
    place.fails(&["info", "m.ply", "--bbox", BOX], 2, &["--bounds"]);
    let tin = ["tin", "c.laz", "--max-error", "1"];
    for (name, option) in [("a.ply", "--bounds"), ("b.ply", "--bbox")] {
        place.ok(&[&tin[..], &[option, "500010,4750010,500050,4750040", name, "-q"]].concat());
    }
    assert!(place.bytes("a.ply") == place.bytes("b.ply"));
}
