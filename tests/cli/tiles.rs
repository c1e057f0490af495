//! `terrane tiles`: proved by `verify`, the same bytes however they are made, and refused by name.

use crate::cli_support::{Place, json};

/// Heights of so many samples a side, a second of arc apart, with a void.
fn grid(side: usize) -> String {
    let height = |i: usize| match (i % side, i / side) {
        (20..24, 30..40) => -9999.0,
        (col, row) => {
            ((col as f64 / 9.0).sin() + (row as f64 / 13.0).cos()) * 150.0 + (i % 7) as f64
        }
    };
    let row = |row: usize| {
        let all = (row * side..(row + 1) * side).map(|i| format!("{:.2}", height(i)));
        all.collect::<Vec<_>>().join(" ")
    };
    let rows: Vec<_> = (0..side).map(row).collect();
    format!(
        "ncols {side}\nnrows {side}\nxllcenter 7.03\nyllcenter 46.02\ncellsize 0.000277777777777778\n\
         NODATA_value -9999\n{}\n",
        rows.join("\n")
    )
}

pub(crate) fn place(side: usize) -> Place {
    let place = Place::new();
    place.write("dem.asc", grid(side)).write("dem.prj", "EPSG:4326");
    place
}

#[test]
fn every_level_is_proved_and_the_bytes_are_the_same() {
    let place = place(150);
    let made = json(&place.ok(&["tiles", "dem.asc", "one", "--threads", "1", "--json"]).out);
    assert_eq!(made["levels"].as_array().unwrap().len(), 15, "{made}");
    for level in made["levels"].as_array().unwrap() {
        let [error, allowed] = ["error", "tolerance"].map(|key| level[key].as_f64().unwrap());
        assert!(error <= allowed && level["tiles"].as_u64().unwrap() > 0, "{level}");
    }
    place.ok(&["tiles", "dem.asc", "two", "--threads", "2", "--memory", "96M", "-q"]);
    for name in walk(&place, "one") {
        assert_eq!(
            place.bytes(&format!("one/{name}")),
            place.bytes(&format!("two/{name}")),
            "{name}"
        );
    }
    assert_eq!(walk(&place, "one"), walk(&place, "two"));
    // Tiles do not depend on those below them, but for those of level 0, which tell of them.
    place.ok(&["tiles", "dem.asc", "few", "--max-level", "7", "-q"]);
    place.ok(&["verify", "few", "dem.asc", "-q"]);
    let few: Vec<_> =
        walk(&place, "few").into_iter().filter(|name| !name.starts_with('0')).collect();
    assert!(few.len() > 7);
    for name in few.iter().filter(|name| name.ends_with(".terrain")) {
        assert_eq!(
            place.bytes(&format!("few/{name}")),
            place.bytes(&format!("one/{name}")),
            "{name}"
        );
    }
    let told = json(&place.ok(&["verify", "one", "dem.asc", "--json"]).out);
    assert_eq!(told["passed"], true, "{told}");
    place.ok(&[
        "tiles",
        "dem.asc",
        "plain",
        "--no-gzip",
        "--no-normals",
        "--max-level",
        "11",
        "-q",
    ]);
    place.ok(&["verify", "plain", "dem.asc", "-q"]);
}

/// All files below a folder.
pub(crate) fn walk(place: &Place, folder: &str) -> Vec<String> {
    let top = place.path(folder);
    let (mut open, mut found) = (vec![top.clone()], Vec::new());
    while let Some(path) = open.pop() {
        for entry in std::fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => open.push(path),
                false => found.push(path.strip_prefix(&top).unwrap().display().to_string()),
            }
        }
    }
    found.sort_unstable();
    found
}

#[test]
fn what_cannot_be_placed_on_the_globe_is_refused_by_name() {
    let place = place(20);
    place.write("plain.asc", grid(20));
    place.fails(&["tiles", "plain.asc", "t"], 65, &["plain.asc", "lacks a georeference"]);
    place.write("far.asc", grid(20).replace("7.03", "179.999")).write("far.prj", "EPSG:4326");
    place.fails(&["tiles", "far.asc", "t"], 65, &["far.asc", "180 degrees"]);
    place.ok(&["tiles", "dem.asc", "t", "-q"]);
    place.fails(&["tiles", "dem.asc", "t"], 2, &["exists"]);
    place.ok(&["tiles", "dem.asc", "t", "--overwrite", "-q"]);
    place.write("t/mine.txt", "mine");
    place.fails(&["tiles", "dem.asc", "t", "--overwrite"], 2, &["contains other files"]);
}

/// A grid of so many columns and rows, of one height or what `height` makes of column and row.
pub(crate) fn plain(
    place: &Place,
    [cols, rows]: [usize; 2],
    [west, south, cell]: [f64; 3],
    height: impl Fn(usize, usize) -> f64,
) {
    let row = |row| (0..cols).map(|col| height(col, row).to_string()).collect::<Vec<_>>().join(" ");
    let rows_of: Vec<_> = (0..rows).map(row).collect();
    let head = format!(
        "ncols {cols}\nnrows {rows}\nxllcenter {west}\nyllcenter {south}\ncellsize {cell}\n"
    );
    place.write("g.asc", format!("{head}NODATA_value -9999\n{}\n", rows_of.join("\n")));
    place.write("g.prj", "EPSG:4326");
}

/// Small ones, up to the poles and 180 degrees, on borders of tiles, far below the ellipsoid.
#[test]
fn grids_of_every_shape_and_place_are_proved() {
    let rough = |col: usize, row: usize| ((row * 37 + col * 91) % 300) as f64;
    let place = Place::new();
    for (size, at) in [
        ([1, 1], [7.03, 46.02, 0.001]),
        ([40, 1], [7.03, 46.02, 0.001]),
        ([1, 40], [7.03, 46.02, 0.001]),
        ([1, 1], [0.0, 0.0, 0.001]),
        ([1, 1], [0.0, 90.0, 0.001]),
        ([1, 1], [180.0, -90.0, 0.001]),
        ([33, 33], [0.0, 0.0, 180.0 / 16384.0]),
        ([37, 19], [-180.0, -90.0, 10.0]),
        ([13, 7], [-180.0, -90.0, 30.0]),
        // Rounding puts the last column a hair beyond 180 degrees.
        ([1081, 3], [-180.0, 0.0, 0.333_333_333_333_334]),
    ] {
        plain(&place, size, at, rough);
        place.ok(&["tiles", "g.asc", "t", "--overwrite", "-q"]);
        place.ok(&["verify", "t", "g.asc", "-q"]);
    }
    plain(&place, [20, 20], [7.0, 46.0, 0.001], |_, _| -1e5);
    place.ok(&["tiles", "g.asc", "t", "--overwrite", "-q"]);
    place.ok(&["verify", "t", "g.asc", "-q"]);
}

#[test]
fn heights_that_are_none_are_refused_by_name() {
    let place = Place::new();
    let at = [7.0, 46.0, 0.001];
    let fails = |code, words: &[&str]| place.fails(&["tiles", "g.asc", "t"], code, words);
    plain(&place, [20, 20], at, |_, _| -9999.0);
    fails(65, &["g.asc", "no valid sample", "nodata"]);
    plain(&place, [20, 20], at, |_, _| -7e6);
    fails(65, &["g.asc", "-7e6", "--nodata -7e6"]);
    plain(&place, [20, 20], at, |_, _| 1e30);
    fails(65, &["g.asc", "1e30", "--nodata 1e30"]);
    // However steep it is, and told.
    plain(&place, [20, 20], at, |col, _| if col == 3 { -32768.0 } else { 500.0 });
    let made = json(&place.ok(&["tiles", "g.asc", "t", "--json"]).out);
    assert!(
        made["notes"].to_string().contains("-3.2768e4, looks like an undeclared nodata"),
        "{made}"
    );
    place.ok(&["verify", "t", "g.asc", "-q"]);
    place.ok(&["tiles", "g.asc", "t", "--nodata", "-32768", "--overwrite", "-q"]);
}

/// Large ones, beside borders of tiles, in steep land: levels differ by no more than their errors there, either.
#[test]
fn voids_beside_borders_are_proved() {
    let place = Place::new();
    let height = |col: usize, row: usize| {
        let (x, y) = (col as f64, row as f64);
        let smooth = 2700.0 * (x / 9.0).sin() * (y / 7.0).cos() + 400.0 * ((x + y) / 3.1).sin();
        let height = smooth + ((col * 7919 + row * 104_729) % 97) as f64;
        if height > 0.0 { -9999.0 } else { (height * 10.0).round() / 10.0 }
    };
    plain(&place, [301, 301], [5.0, 44.0, 0.000833333333], height);
    place.ok(&["tiles", "g.asc", "t", "-q"]);
    place.ok(&["verify", "t", "g.asc", "-q"]);
}

/// The two halves of the globe have one border there, however much higher the grid is in the east than in the west.
#[test]
fn both_halves_have_one_border_at_180_degrees() {
    let place = Place::new();
    plain(&place, [101, 80], [5.0, 44.0, 0.01], |col, _| 1000.0 * col as f64);
    let sides = |tile: &str, east: bool| {
        place.ok(&[
            "tiles",
            "g.asc",
            "plain",
            "--max-level",
            "0",
            "--no-gzip",
            "--overwrite",
            "-q",
        ]);
        let bytes = place.bytes(&format!("plain/0/{tile}/0.terrain"));
        let count = u32::from_le_bytes(bytes[88..92].try_into().unwrap()) as usize;
        let [low, high] =
            [24, 28].map(|at| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())));
        let column = |k: usize| {
            let (mut at, mut value) = (92 + 2 * k * count, 0_i32);
            (0..count)
                .map(|_| {
                    let coded =
                        i32::from(u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()));
                    (at, value) = (at + 2, value + (coded >> 1 ^ -(coded & 1)));
                    value
                })
                .collect::<Vec<_>>()
        };
        let [u, v, h] = [0, 1, 2].map(column);
        let edge = if east { 32_767 } else { 0 };
        let on = (0..count).filter(|i| u[*i] == edge);
        let mut found: Vec<_> = on
            .map(|i| (v[i], (low + (high - low) * f64::from(h[i]) / 32_767.0).round() as i32))
            .collect();
        found.sort_unstable();
        found
    };
    let (west, east) = (sides("0", false), sides("1", true));
    assert!(west.len() > 30 && west == east, "{west:?} {east:?}");
}
