//! Tiles of grids whose rows are no parallels: any projection, any datum, turned ones.

use crate::cli_support::{Place, json};
use crate::tiles::{plain, walk};

fn rough(col: usize, row: usize) -> f64 {
    match (col, row) {
        (30..35, 20..30) => -9999.0,
        _ => {
            ((col as f64 / 7.0).sin() + (row as f64 / 11.0).cos()) * 90.0
                + ((row * 37 + col * 91) % 50) as f64
        }
    }
}

/// Each is proved sample by sample, whose places `verify` computes each for itself.
#[test]
fn grids_of_every_system_are_proved() {
    let place = Place::new();
    for (system, at, size) in [
        ("EPSG:32631", [499_000.0, 4_738_000.0, 30.0], [140, 120]),
        ("EPSG:32633", [1_100_000.0, 6_500_000.0, 30.0], [90, 70]),
        ("EPSG:32733", [500_000.0, 6_250_000.0, 90.0], [60, 70]),
        ("EPSG:2154", [700_000.0, 6_600_000.0, 25.0], [100, 80]),
        ("EPSG:27700", [400_000.0, 400_000.0, 50.0], [80, 80]),
        ("EPSG:3035", [4_321_000.0, 3_210_000.0, 1000.0], [90, 110]),
        ("EPSG:3413", [-1_100_000.0, -1_000_000.0, 500.0], [90, 80]),
        ("EPSG:3031", [1_000_000.0, 500_000.0, 5000.0], [70, 90]),
        ("EPSG:3857", [1_000_000.0, 6_000_000.0, 40.0], [80, 80]),
        ("EPSG:2193", [1_700_000.0, 5_500_000.0, 20.0], [70, 50]),
        ("EPSG:28992", [150_000.0, 450_000.0, 10.0], [60, 60]),
        ("EPSG:2056", [2_600_000.0, 1_200_000.0, 10.0], [60, 60]),
        ("EPSG:31467", [3_500_000.0, 5_600_000.0, 15.0], [60, 60]),
        ("EPSG:5514", [-600_000.0, -1_100_000.0, 25.0], [60, 60]),
        ("EPSG:4267", [-100.0, 40.0, 0.001], [60, 60]),
        ("EPSG:6933", [-3_000_000.0, -2_000_000.0, 40_000.0], [150, 100]),
        ("EPSG:32631", [499_000.0, 4_738_000.0, 30.0], [1, 1]),
        ("EPSG:32631", [499_000.0, 4_738_000.0, 30.0], [2, 40]),
        ("EPSG:32631", [499_000.0, 4_738_000.0, 30.0], [40, 1]),
    ] {
        plain(&place, size, at, rough);
        place.write("g.prj", system);
        place.ok(&[
            "tiles",
            "g.asc",
            "t",
            "-f",
            "quantized-mesh",
            "-f",
            "3dtiles",
            "--overwrite",
            "-q",
        ]);
        for set in ["t/quantized-mesh", "t/3dtiles"] {
            let told = json(&place.ok(&["verify", set, "g.asc", "--json"]).out);
            assert_eq!(told["passed"], true, "{system}: {told}");
            let valid =
                (0..size[0] * size[1]).filter(|i| rough(i % size[0], i / size[0]) > -9999.0);
            let deepest = told["levels"].as_array().unwrap().last().unwrap();
            assert!(
                deepest["samples"].as_u64().unwrap() >= valid.count() as u64,
                "{system}: {deepest}"
            );
        }
    }
}

/// Rows that go to the north-east.
#[test]
fn turned_grids_are_proved() {
    let place = Place::new();
    for (system, [x, y], step) in
        [("EPSG:32631", [499_000.0, 4_738_000.0], 20.0), ("EPSG:4326", [7.0, 46.0], 0.0003)]
    {
        plain(&place, [70, 60], [x, y, step], rough);
        place.write("g.prj", system);
        let [a, b] = [step * 0.8, step * 0.6];
        place.write(
            "turned.vrt",
            format!(
                "<VRTDataset rasterXSize=\"70\" rasterYSize=\"60\"><SRS>{system}</SRS>\
                 <GeoTransform>{x},{a},{b},{y},{b},-{a}</GeoTransform>\
                 <VRTRasterBand dataType=\"Float32\" band=\"1\"><NoDataValue>-9999</NoDataValue><SimpleSource>\
                 <SourceFilename relativeToVRT=\"1\">g.asc</SourceFilename><SourceBand>1</SourceBand>\
                 </SimpleSource></VRTRasterBand></VRTDataset>"
            ),
        );
        place.ok(&["tiles", "turned.vrt", "t", "--overwrite", "-q"]);
        let told = json(&place.ok(&["verify", "t", "turned.vrt", "--json"]).out);
        assert_eq!(told["passed"], true, "{told}");
        // Not as if it were not turned.
        assert_eq!(place.run(&["verify", "t", "g.asc", "-q"]).code, 1);
    }
}

/// By threads, memory, and as a plan, of several regions, which have at most 1024 samples a side, here 650 or fewer.
#[test]
fn the_bytes_are_the_same_however_they_are_made() {
    let place = Place::new();
    let grid = "synth:rough,size=720,cell=30,seed=4";
    place.ok(&["tiles", grid, "one", "--threads", "1", "-q"]);
    place.ok(&["verify", "one", grid, "-q"]);
    place.ok(&["tiles", grid, "two", "--threads", "2", "--memory", "400M", "-q"]);
    place.ok(&["tiles", grid, "plan", "--workdir", "work", "--memory", "200M", "-q"]);
    let names = walk(&place, "one");
    for other in ["two", "plan"] {
        assert_eq!(walk(&place, other), names);
        for name in &names {
            let [a, b] = ["one", other].map(|folder| place.bytes(&format!("{folder}/{name}")));
            assert_eq!(a, b, "{other}/{name}");
        }
    }
    place.ok_as_advised(&["tiles", grid, "three", "-q"], "40M", &["memory"]);
}

#[test]
fn what_cannot_be_brought_to_the_globe_is_refused_by_name() {
    let place = Place::new();
    for (system, at, words) in [
        ("EPSG:3413", [-30_000.0, -30_000.0, 1000.0], "pole"),
        ("EPSG:3031", [-1_000_000.0, -1_000_000.0, 40_000.0], "pole"),
        ("EPSG:32660", [750_000.0, 4_000_000.0, 1000.0], "180 degrees"),
        ("EPSG:27700", [-9_000_000.0, 400_000.0, 50.0], "shift"),
        ("EPSG:32631", [499_000.0, 4e12, 30.0], "outside the domain"),
    ] {
        plain(&place, [60, 60], at, rough);
        place.write("g.prj", system);
        place.fails(&["tiles", "g.asc", "t"], 65, &["g.asc", words]);
    }
}

/// Heights of a geoid on whole degrees, 45 to 48 degrees north and 6 to 9 east, that differ by place.
fn geoid(of: impl Fn(u32, u32) -> f32) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [45.0_f64, 6.0, 1.0, 1.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    bytes.extend([4_u32, 4].iter().flat_map(|v| v.to_be_bytes()));
    let all = (0..4).flat_map(|row| (0..4).map(move |col| (col, row)));
    bytes.extend(all.flat_map(|(col, row)| of(col, row).to_be_bytes()));
    bytes
}

/// Heights are those of the geoid higher, in any system; and no others pass for them.
#[test]
fn heights_are_brought_to_the_ellipsoid_by_a_geoid() {
    let place = Place::new();
    place.write("g.gtx", geoid(|col, row| 300.0 + 40.0 * col as f32 - 70.0 * row as f32));
    let [west, south, cell, rows] = [7.2, 46.3, 0.0005, 60.0];
    let at = |col: usize, row: usize| {
        [west + cell * col as f64, south + cell * (rows - 1.0 - row as f64)]
    };
    let lifted = |col: usize, row: usize| {
        let [lon, lat] = at(col, row);
        match rough(col, row) {
            void if void < -9000.0 => void,
            height => height + 300.0 + 40.0 * (lon - 6.0) - 70.0 * (lat - 45.0),
        }
    };
    plain(&place, [60, 60], [west, south, cell], lifted);
    for ending in ["asc", "prj"] {
        std::fs::rename(
            place.path(&format!("g.{ending}")),
            place.path(&format!("lifted.{ending}")),
        )
        .unwrap();
    }
    plain(&place, [60, 60], [west, south, cell], rough);
    let made = json(&place.ok(&["tiles", "g.asc", "t", "--geoid", "g.gtx", "--json"]).out);
    assert!(made["notes"].to_string().contains("from the geoid to the ellipsoid"), "{made}");
    place.ok(&["verify", "t", "g.asc", "--geoid", "g.gtx", "-q"]);
    // Of the lifted grid, whose heights are rounded, nothing but the errors that are stated may differ, by a hair.
    let told = json(&place.run(&["verify", "t", "lifted.asc", "--json"]).out);
    for (level, stated) in
        told["levels"].as_array().unwrap().iter().zip(made["levels"].as_array().unwrap())
    {
        let [found, stated] =
            [&level["max_error"], &stated["error"]].map(|error| error.as_f64().unwrap());
        assert!(found <= stated + 1e-3 && level["over"] == 0, "{level} {stated}");
    }
    assert_eq!(place.run(&["verify", "t", "g.asc", "-q"]).code, 1, "without the geoid");
    place.ok(&["tiles", "g.asc", "plan", "--geoid", "g.gtx", "--workdir", "work", "-q"]);
    for name in walk(&place, "t") {
        assert_eq!(
            place.bytes(&format!("t/{name}")),
            place.bytes(&format!("plan/{name}")),
            "{name}"
        );
    }
    // In another system.
    plain(&place, [60, 60], [450_000.0, 5_150_000.0, 40.0], rough);
    place.write("g.prj", "EPSG:32632");
    place.ok(&["tiles", "g.asc", "t", "--geoid", "g.gtx", "--overwrite", "-q"]);
    place.ok(&["verify", "t", "g.asc", "--geoid", "g.gtx", "-q"]);
    assert_eq!(place.run(&["verify", "t", "g.asc", "-q"]).code, 1);
    // What it cannot be used for.
    let fails = |more: &[&str], code: i32, words: &[&str]| {
        place.fails(&[&["tiles", "g.asc", "none"][..], more].concat(), code, words);
    };
    place.write("bad.gtx", "x");
    fails(&["--geoid", "bad.gtx"], 65, &["bad.gtx", "not a valid GTX"]);
    fails(&["--geoid", "none.gtx"], 65, &["none.gtx", "no such file"]);
    place.fails(&["tiles", "g.asc", "g.gtx", "--geoid", "g.gtx", "--overwrite"], 2, &["g.gtx"]);
    plain(&place, [60, 60], [950_000.0, 5_150_000.0, 40.0], rough);
    place.write("g.prj", "EPSG:32632");
    fails(&["--geoid", "g.gtx"], 65, &["the geoid has no value at longitude"]);
    plain(&place, [60, 60], [west, south, cell], rough);
    place.write("g.prj", "EPSG:4979");
    fails(&["--geoid", "g.gtx"], 2, &["g.gtx", "ellipsoidal already"]);
    place.ok(&["tin", "g.asc", "m.ply", "--max-error", "1", "-q"]);
    place.fails(
        &["verify", "m.ply", "g.asc", "--geoid", "g.gtx"],
        2,
        &["--geoid is for terrain tiles"],
    );
}

/// Depths are heights that are counted downwards.
#[test]
fn depths_are_below_the_ellipsoid() {
    let place = Place::new();
    let make = |system: &str, name: &str, height: &dyn Fn(usize, usize) -> f64| {
        plain(&place, [50, 40], [7.2, 46.3, 0.0005], height);
        place.write("g.prj", system);
        place.ok(&["tiles", "g.asc", name, "-q"]);
        place.ok(&["verify", name, "g.asc", "-q"]);
    };
    let void = |z: f64| if z < -9000.0 { z } else { -z };
    make("EPSG:4326+5714", "up", &rough);
    make("EPSG:4326+5715", "down", &|col, row| void(rough(col, row)));
    for name in walk(&place, "up") {
        assert_eq!(
            place.bytes(&format!("up/{name}")),
            place.bytes(&format!("down/{name}")),
            "{name}"
        );
    }
}
