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

/// By threads, memory, and as a plan, of several regions.
#[test]
fn the_bytes_are_the_same_however_they_are_made() {
    let place = Place::new();
    let grid = "synth:rough,size=1500,cell=30,seed=4";
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
        ("EPSG:32631", [499_000.0, 4e12, 30.0], "reaches"),
    ] {
        plain(&place, [60, 60], at, rough);
        place.write("g.prj", system);
        place.fails(&["tiles", "g.asc", "t"], 65, &["g.asc", words]);
    }
}
