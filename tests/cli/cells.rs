//! Cells of models that are chosen, and cells on the sides of triangles that do not count.

use crate::cli_support::{Place, json};

/// Two triangles with the side from (5, 0) to (5, 10): a short one in the west, a long one in the east; far
/// from them others that are all long. The centre of the first cell is on that side.
const SIDE: [[f64; 3]; 8] = [
    [5.0, 0.0, 0.0],
    [5.0, 10.0, 10.0],
    [0.0, 5.0, 3.0],
    [60.0, 5.0, 9.0],
    [5.0, 40.0, 2.0],
    [0.0, 45.0, 2.0],
    [60.0, 45.0, 4.0],
    [5.0, 50.0, 9.0],
];

fn points(turn: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let line = |at: [f64; 3]| {
        let [x, y, z] = turn(at);
        format!("{x} {y} {z} 2\n")
    };
    format!("x y z class\n{}", SIDE.map(line).concat())
}

/// The value of an ESRI ASCII grid at a place.
fn at(text: &str, [x, y]: [f64; 2]) -> f64 {
    let head = |key: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    let (cell, rows) = (head("cellsize"), head("nrows"));
    let [col, row] = [(x - head("xllcorner")) / cell, rows - (y - head("yllcorner")) / cell];
    let line =
        text.lines().filter(|l| !l.starts_with(|c: char| c.is_alphabetic())).nth(row as usize);
    line.unwrap().split_whitespace().nth(col as usize).unwrap().parse().unwrap()
}

#[test]
fn a_centre_on_the_side_of_a_kept_triangle_has_its_value() {
    let place = Place::new();
    type Turn = fn([f64; 3]) -> [f64; 3];
    let turns: [(&str, Turn, [f64; 2]); 4] = [
        ("as it is", |at| at, [5.0, 5.0]),
        ("mirrored", |[x, y, z]| [70.0 - x, y, z], [65.0, 5.0]),
        ("lying", |[x, y, z]| [y, x, z], [5.0, 5.0]),
        ("lying, mirrored", |[x, y, z]| [y, 70.0 - x, z], [5.0, 65.0]),
    ];
    let models: [&[&str]; 5] = [
        &["--stat", "tin", "--max-edge", "12"],
        &["--stat", "tin:max_edge=12"],
        &["--dtm", "--max-edge", "12"],
        &["--dsm", "--max-edge", "12"],
        &["--dsm", "--canopy", "spike-free:freeze=1", "--max-edge", "12"],
    ];
    for (name, turn, centre) in turns {
        place.write("p.xyz", points(turn));
        for model in models {
            let args = [
                "grid",
                "cloud:p.xyz",
                "o.asc",
                "--cell",
                "10",
                "--crs",
                "EPSG:32631",
                "--overwrite",
            ];
            place.ok(&[&args[..], model].concat());
            let found = at(&std::fs::read_to_string(place.path("o.asc")).unwrap(), centre);
            assert_eq!(found, 5.0, "{name}: {model:?}");
        }
        // By tiles, which see a part of the points, the same bytes.
        let options = ["--cell", "10", "--stat", "tin", "--max-edge", "12"];
        place.ok(&[&["grid", "cloud:p.xyz", "once.tif", "--overwrite"], &options[..]].concat());
        place.ok(&[&["plan", "grid", "cloud:p.xyz", "-o", "work", "--tile", "256"], &options[..]]
            .concat());
        place.ok(&["run", "work", "-o", "planned.tif", "--overwrite"]);
        assert_eq!(place.bytes("once.tif"), place.bytes("planned.tif"), "{name}");
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn models_choose_cells_by_the_density_of_all_points() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=100,density=6,seed=3", "c.laz"]);
    let cell = |more: &[&str]| {
        let report = json(
            &place.ok(&[&["grid", "c.laz", "o.tif", "--json", "--overwrite"], more].concat()).out,
        );
        let told = report["notes"].to_string().contains("cell size 0.5: about the point spacing");
        (report["cell"][0].as_f64().unwrap(), told)
    };
    for model in ["--dtm", "--dsm", "--chm"] {
        assert_eq!(cell(&[model]), (0.5, true), "{model}");
        // A filter leaves no trace, and neither does the part that is asked for.
        assert_eq!(cell(&[model, "--bbox", "500010,4750010,500020,4750020"]), (0.5, true));
        assert_eq!(cell(&[model, "--cell", "2"]), (2.0, false));
    }
    assert_eq!(cell(&["--dsm", "--bounds", "500010,4750010,500020,4750020"]), (0.5, true));
    place.ok(&["plan", "grid", "c.laz", "-o", "work", "--dtm"]);
    place.ok(&["run", "work", "-o", "planned.tif"]);
    cell(&["--dtm"]);
    assert_eq!(place.bytes("planned.tif"), place.bytes("o.tif"));
    place.fails(&["grid", "c.laz", "new.tif"], 2, &["no cell size given", "--cell"]);
    place.write("one.xyz", "0 0 1\n");
    place.fails(
        &["grid", "cloud:one.xyz", "new.tif", "--dsm"],
        2,
        &["the point spacing", "with --cell"],
    );
}
