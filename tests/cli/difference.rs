//! `terrane difference`: differences, areas and volumes by hand, on other lattices and in other systems, the same bytes and
//! figures however they are made.

use crate::cli_support::{Place, json};
use crate::relief::values;
use serde_json::Value;

/// Heights in text, with `*` for voids, as ESRI ASCII with this corner and cell.
fn grid([x, y, cell]: [f64; 3], rows: &str) -> String {
    let rows: Vec<&str> = rows.lines().collect();
    let (columns, lines) = (rows[0].split_whitespace().count(), rows.len());
    let head =
        format!("ncols {columns}\nnrows {lines}\nxllcorner {x}\nyllcorner {y}\ncellsize {cell}\n");
    head + "NODATA_value -9999\n" + &rows.join("\n").replace('*', "-9999") + "\n"
}

fn report(place: &Place, args: &[&str]) -> Value {
    json(&place.ok(&[&["difference"], args, &["--overwrite", "--json"]].concat()).out)
}

fn near(found: &Value, expected: f64, relative: f64) {
    let number = found.as_f64().unwrap_or_else(|| panic!("{found} is no number"));
    assert!(
        (number - expected).abs() <= relative * expected.abs().max(1e-9),
        "{number} {expected}"
    );
}

#[test]
fn differences_areas_and_volumes_are_those_found_by_hand() {
    let place = Place::new();
    place.write("a.asc", grid([100.0, 200.0, 10.0], "1 2 3 4\n5 * 7 8\n9 10 11 12.5"));
    place.write("b.asc", grid([100.0, 200.0, 10.0], "1 1 5 4\n9 9 * 5.5\n* 10 1 2.5"));
    for name in ["a.prj", "b.prj"] {
        place.write(name, "EPSG:32631");
    }
    let told = report(&place, &["a.asc", "b.asc", "o.asc"]);
    let (_, found) = values(&place, "o.asc");
    let expected = [0.0, 1.0, -2.0, 0.0, -4.0, f64::NAN, f64::NAN, 2.5, f64::NAN, 0.0, 10.0, 10.0];
    assert!(
        found.iter().zip(expected).all(|(a, b)| *a == b || a.is_nan() && b.is_nan()),
        "{found:?}"
    );
    for (name, value) in
        [("compared", 9), ("only_grid", 2), ("only_reference", 1), ("valid_samples", 9)]
    {
        assert_eq!(told[name], value, "{name}");
    }
    let squares: f64 = 1.0 + 4.0 + 16.0 + 6.25 + 200.0;
    let mean = 17.5 / 9.0;
    for (name, value) in [
        ("mean", mean),
        ("rmse", (squares / 9.0).sqrt()),
        ("stdev", (squares / 9.0 - mean * mean).sqrt()),
        ("mean_absolute", 29.5 / 9.0),
        ("lowest", -4.0),
        ("highest", 10.0),
        ("area_above", 400.0),
        ("area_below", 200.0),
        ("volume_above", 2350.0),
        ("volume_below", 600.0),
    ] {
        near(&told[name], value, 1e-14);
    }
    // Of equal ones the first along rows.
    assert_eq!(told["lowest_at"], serde_json::json!([105.0, 215.0]));
    assert_eq!(told["highest_at"], serde_json::json!([125.0, 205.0]));
    // Small differences are written, and count for no volume.
    let told = report(&place, &["a.asc", "b.asc", "p.asc", "--level-of-detection", "2.5"]);
    assert!(place.bytes("o.asc") == place.bytes("p.asc"));
    for (name, value) in [
        ("area_above", 300.0),
        ("area_below", 100.0),
        ("volume_above", 2250.0),
        ("volume_below", 400.0),
    ] {
        near(&told[name], value, 1e-14);
    }
    let summary = place.ok(&["difference", "a.asc", "b.asc", "q.tif"]).out;
    for words in ["400 m2, 2350 m3 (fill)", "10 at 125, 205", "2 in the grid, 1 in the reference"] {
        assert!(summary.contains(words), "{summary}");
    }
    let itself = report(&place, &["a.asc", "a.asc", "q.asc"]);
    assert!(itself["rmse"] == 0.0 && itself["area_above"] == 0.0 && itself["volume_below"] == 0.0);
}

/// The lattice of the reference begins elsewhere, in whole cells and in parts of them.
#[test]
fn the_reference_may_have_another_lattice() {
    let place = Place::new();
    let plane = |x: f64, y: f64, cell: f64, size: i32| {
        let at = |row: i32, col: i32| {
            let [x, y] =
                [x + cell * (f64::from(col) + 0.5), y + cell * (f64::from(size - row) - 0.5)];
            format!("{} ", x / 4.0 - y / 8.0)
        };
        let rows: Vec<String> =
            (0..size).map(|row| (0..size).map(|col| at(row, col)).collect()).collect();
        grid([x, y, cell], &rows.join("\n"))
    };
    place.write("a.asc", plane(100.0, 200.0, 8.0, 20));
    for (name, x, y, cell, size) in [
        ("shifted.asc", 140.0, 176.0, 8.0, 20),
        ("between.asc", 97.0, 203.0, 8.0, 22),
        ("coarse.asc", 60.0, 160.0, 16.0, 14),
        ("fine.asc", 101.0, 190.0, 2.0, 100),
    ] {
        place.write(name, plane(x, y, cell, size));
        let told = report(&place, &["a.asc", name, "o.tif"]);
        // On a plane, bilinear interpolation is exact but at the border of the reference.
        let (columns, found) = values(&place, "o.tif");
        assert_eq!(columns, 20);
        let inner = (0..400).filter(|at| {
            let [px, py] = [104.0 + 8.0 * f64::from(at % 20), 356.0 - 8.0 * f64::from(at / 20)];
            let most = cell * f64::from(size);
            // Kernels are as wide as the coarser of both cells.
            let [far, near] = [most - cell.max(8.0), cell.max(8.0)];
            px > x + near && px < x + far && py > y + near && py < y + far
        });
        for at in inner {
            assert!(found[at as usize].abs() < 1e-4, "{name} {at}: {}", found[at as usize]);
        }
        assert_eq!(told["resampling"].is_null(), name == "shifted.asc", "{name}");
        let compared = told["compared"].as_u64().unwrap();
        assert_eq!(compared, found.iter().filter(|z| !z.is_nan()).count() as u64, "{name}");
        assert_eq!(told["only_grid"], 400 - compared, "{name}");
    }
    // 15 columns and 17 rows of the shifted one.
    assert_eq!(report(&place, &["a.asc", "shifted.asc", "o.tif"])["compared"], 15 * 17);
    let near = report(&place, &["a.asc", "between.asc", "o.tif", "--resampling", "near"]);
    assert!(near["rmse"].as_f64().unwrap() > 0.1 && near["resampling"] == "near");
    // A mosaic by its pattern, and a part of the grid.
    place
        .write("m1.asc", plane(100.0, 200.0, 8.0, 12))
        .write("m2.asc", plane(196.0, 200.0, 8.0, 8));
    let told = report(&place, &["a.asc", "m?.asc", "o.tif", "--bounds", "101,201,250,259"]);
    assert!(told["compared"] == 19 * 8 && told["rmse"] == 0.0, "{told}");
}

#[test]
fn the_reference_may_be_in_another_system() {
    let place = Place::new();
    place.ok(&["convert", "synth:smooth,size=200,seed=3", "a.tif", "-q"]);
    let degrees = ["--to-crs", "EPSG:4326", "--resampling", "cubic", "-q"];
    place.ok(&[&["convert", "a.tif", "b.tif"], &degrees[..]].concat());
    let told = report(&place, &["a.tif", "b.tif", "o.tif", "--resampling", "cubic"]);
    assert!(
        told["transformed"]["operation"].is_string()
            && told["crs"] == "EPSG:32631 (WGS 84 / UTM zone 31N)"
    );
    assert!(told["compared"].as_u64().unwrap() > 39_800, "{told}");
    assert!(
        told["rmse"].as_f64().unwrap() < 0.02 * told["highest"].as_f64().unwrap().max(1.0),
        "{told}"
    );
    let back = report(&place, &["b.tif", "a.tif", "p.tif", "--resampling", "near"]);
    assert_eq!(back["crs"], "EPSG:4326 (WGS 84)");
    // Volumes of degrees are those of metres, but for the scale of the projection.
    place.ok(&["convert", "synth:smooth,size=200,seed=4", "c.tif", "-q"]);
    place.ok(&[&["convert", "c.tif", "d.tif"], &degrees[..]].concat());
    let [metres, globe] =
        [["a.tif", "c.tif"], ["b.tif", "d.tif"]].map(|[a, b]| report(&place, &[a, b, "q.tif"]));
    for name in ["volume_above", "volume_below", "area_above", "area_below"] {
        near(&globe[name], metres[name].as_f64().unwrap(), 4e-3);
    }
}

/// Areas of cells of degrees, by the closed form for the ellipsoid.
#[test]
fn areas_of_degrees_are_those_of_the_ellipsoid() {
    let place = Place::new();
    let rows = |height: &str| vec![format!("{height} ").repeat(7); 5].join("\n");
    place.write("a.asc", grid([6.0, 45.0, 0.5], &rows("12.5"))).write("a.prj", "EPSG:4326");
    place.write("b.asc", grid([6.0, 45.0, 0.5], &rows("10"))).write("b.prj", "EPSG:4326");
    let told = report(&place, &["a.asc", "b.asc", "o.tif"]);
    let band = |latitude: f64| {
        let (axis, squared) = (6_378_137.0_f64, 0.006_694_379_990_141_316_f64);
        let (sine, e) = (latitude.to_radians().sin(), squared.sqrt());
        axis * axis * (1.0 - squared) / 2.0
            * (sine / (1.0 - squared * sine * sine) + (e * sine).atanh() / e)
    };
    let area = (band(47.5) - band(45.0)) * 3.5_f64.to_radians();
    near(&told["area_above"], area, 1e-12);
    near(&told["volume_above"], 2.5 * area, 1e-12);
    assert_eq!((&told["area_below"], &told["volume_below"]), (&0.0.into(), &0.0.into()));
}

#[test]
fn threads_memory_and_formats_leave_no_trace() {
    let place = Place::new();
    place.ok(&["convert", "synth:salt,size=900,voids=0.05,seed=5", "a.tif", "-q"]);
    let cog = ["-f", "COG", "--co", "BLOCKSIZE=128", "-q"];
    place.ok(&[&["convert", "synth:salt,size=1000,voids=0.05,seed=6", "b.tif"], &cog[..]].concat());
    let degrees = ["--to-crs", "EPSG:4326", "--resampling", "bilinear", "-q"];
    place.ok(&[&["convert", "b.tif", "c.tif"], &degrees[..]].concat());
    for reference in ["b.tif", "c.tif"] {
        let make = |name: &str, more: &[&str]| {
            let mut told = report(&place, &[&["a.tif", reference, name], more].concat());
            let told = told.as_object_mut().unwrap();
            for passing in [
                "memory_budget",
                "notes",
                "output",
                "output_bytes",
                "peak_memory",
                "samples_per_second",
                "threads",
                "wall_seconds",
                "spilled_bytes",
                "format",
            ] {
                told.remove(passing);
            }
            told.clone()
        };
        let first = make("one.tif", &["--threads", "1"]);
        assert!(
            first["compared"].as_u64().unwrap() > 700_000
                && first["only_grid"].as_u64().unwrap() > 30_000
        );
        assert_eq!(make("two.tif", &["--threads", "2", "--memory", "48M"]), first);
        assert!(place.bytes("one.tif") == place.bytes("two.tif"), "{reference}");
        let (_, whole) = values(&place, "one.tif");
        for (name, more) in [
            ("o.tif", &["-f", "COG"][..]),
            ("s.tif", &["-f", "store"]),
            ("t.tif", &["--co", "TILED=YES", "--co", "COMPRESS=ZSTD", "--threads", "2"]),
            ("o.asc", &[]),
        ] {
            assert_eq!(make(name, more), first, "{reference} {name}");
            let (_, other) = values(&place, name);
            let is_same = whole
                .iter()
                .zip(&other)
                .all(|(a, b)| (a - b).abs() < 1e-4 || a.is_nan() && b.is_nan());
            assert!(is_same, "{reference} {name}");
        }
    }
}

#[test]
fn sample_types_hold_the_differences() {
    let place = Place::new();
    place.write("a.asc", grid([0.0, 0.0, 1.0], "3 250 *\n7 0 1"));
    place.write("b.asc", grid([0.0, 0.0, 1.0], "200 1 5\n7 255 0"));
    for (kind, of_output) in
        [("uint8", "float32"), ("int32", "float64"), ("float64", "float64"), ("float32", "float32")]
    {
        for name in ["a", "b"] {
            let (source, copy) = (format!("{name}.asc"), format!("{name}.tif"));
            let nodata = if kind == "uint8" { "99" } else { "-9999" };
            place.ok(&[
                "convert",
                &source,
                &copy,
                "--type",
                kind,
                "--out-nodata",
                nodata,
                "--overwrite",
                "-q",
            ]);
        }
        let told = report(&place, &["a.tif", "b.tif", "o.tif"]);
        assert_eq!(told["sample_type"], of_output, "{kind}");
        let (_, found) = values(&place, "o.tif");
        let expected = [-197.0, 249.0, f64::NAN, 0.0, -255.0, 1.0];
        assert!(
            found.iter().zip(expected).all(|(a, b)| *a == b || a.is_nan() && b.is_nan()),
            "{found:?}"
        );
    }
    // What would be read as nodata is not written.
    place
        .write("c.asc", grid([0.0, 0.0, 1.0], "1 2"))
        .write("d.asc", grid([0.0, 0.0, 1.0], "10000 0"));
    let told = report(&place, &["c.asc", "d.asc", "o.tif"]);
    assert_eq!((&told["compared"], &told["valid_samples"]), (&2.into(), &2.into()));
    assert_eq!(told["lowest"], -9999.0);
    near(&Value::from(values(&place, "o.tif").1[0]), -9999.0, 1e-5);
}

#[test]
fn units_of_heights_meet_or_are_named() {
    let place = Place::new();
    let shape = "1 2\n3 4";
    place
        .write("feet.asc", grid([2e5, 6e5, 10.0], "10 20\n30 40"))
        .write("feet.prj", "EPSG:6339+6360");
    place.write("metres.asc", grid([2e5, 6e5, 10.0], shape)).write("metres.prj", "EPSG:6339+5703");
    let told = report(&place, &["metres.asc", "feet.asc", "o.tif"]);
    let foot = 1200.0 / 3937.0;
    let (_, found) = values(&place, "o.tif");
    let expected = [1.0, 2.0, 3.0, 4.0].map(|z| z - 10.0 * z * foot);
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {told}");
    // Volumes are in cubic metres in either unit.
    let back = report(&place, &["feet.asc", "metres.asc", "p.tif"]);
    near(&back["volume_above"], told["volume_below"].as_f64().unwrap(), 1e-6);
    near(&back["volume_above"], -100.0 * expected.iter().sum::<f64>(), 1e-9);
    let [info, other] = ["o.tif", "p.tif"].map(|name| place.ok(&["info", name]).out);
    assert!(info.contains("metre") && other.contains("foot"), "{info} {other}");
    // One is above the ellipsoid, the other above a geoid that is not passed.
    place.write("up.asc", grid([-96.0, 40.0, 1e-4], shape)).write("up.prj", "EPSG:4979");
    place.write("geoid.asc", grid([-96.0, 40.0, 1e-4], shape)).write("geoid.prj", "EPSG:4326+5773");
    place.fails(&["difference", "up.asc", "geoid.asc", "q.tif"], 65, &["geoid.asc", "--geoid"]);
    place.write("plain.asc", grid([-96.0, 40.0, 1e-4], shape)).write("plain.prj", "EPSG:4326");
    let told = report(&place, &["plain.asc", "geoid.asc", "q.tif"]);
    assert!(told["notes"].to_string().contains("the grid has no vertical CRS"), "{told}");
    place.write("bare.asc", grid([-96.0, 40.0, 1e-4], shape));
    let told = report(&place, &["plain.asc", "bare.asc", "q.tif"]);
    assert!(told["notes"].to_string().contains("the reference has no CRS"), "{told}");
    assert_eq!(told["rmse"], 0.0);
}

/// Cells beyond a pole have no area: statistics alone.
#[test]
fn areas_and_volumes_that_are_unknown_are_null() {
    let place = Place::new();
    place
        .write("a.asc", grid([0.0, 87.0, 1.0], "1 2\n3 4\n1 2\n3 4\n5 5"))
        .write("a.prj", "EPSG:4326");
    let told = report(&place, &["a.asc", "a.asc", "o.tif"]);
    assert!(told["notes"].to_string().contains("no areas and volumes: latitude 91"), "{told}");
    for name in ["area_above", "area_below", "volume_above", "volume_below"] {
        assert!(told.get(name).is_some_and(Value::is_null), "{name}: {told}");
    }
    assert!(told["compared"] == 10 && told["rmse"] == 0.0, "{told}");
    let summary = place.ok(&["difference", "a.asc", "a.asc", "p.tif"]).out;
    assert!(!summary.contains("(fill)"), "{summary}");
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let place = Place::new();
    place.write("a.asc", grid([100.0, 200.0, 10.0], "1 2\n3 4")).write("a.prj", "EPSG:32631");
    place.write("far.asc", grid([900.0, 200.0, 10.0], "1 2\n3 4")).write("far.prj", "EPSG:32631");
    place.write("bad.asc", "ncols 4\nnrows").write("cloud.las", "LASF");
    place.write("local.asc", grid([100.0, 200.0, 10.0], "1 2\n3 4"));
    place.write(
        "local.prj",
        r#"LOCAL_CS["site",LOCAL_DATUM["site",0],UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]"#,
    );
    let apart = ["far.asc", "a.asc covers 100,200,120,220", "900,200,920,220", "does not overlap"];
    place.fails(&["difference", "a.asc", "far.asc", "o.tif"], 2, &apart);
    place.fails(&["difference", "a.asc", "no.asc", "o.tif"], 65, &["no.asc: no such file"]);
    let bad = place.run(&["difference", "a.asc", "bad.asc", "o.tif"]);
    assert!(bad.code == 65 && bad.err.contains("bad.asc: line 2"), "{}", bad.err);
    place.fails(&["difference", "a.asc", "local.asc", "o.tif"], 65, &["local.asc"]);
    place.fails(&["difference", "a.asc", "a.asc", "a.asc", "--overwrite"], 2, &["a.asc"]);
    place.fails(&["difference", "a.asc", "far.asc", "far.asc", "--overwrite"], 2, &["far.asc"]);
    place.fails(&["difference", "a.asc", "o.tif"], 2, &["missing names"]);
    place.fails(
        &["difference", "a.asc", "a.asc", "o.tif", "--level-of-detection", "-1"],
        2,
        &["--level-of-detection"],
    );
    // A reference in large blocks needs memory, which is named.
    let store = [
        "--co",
        "TILED=YES",
        "--co",
        "BLOCKXSIZE=2048",
        "--co",
        "BLOCKYSIZE=2048",
        "--co",
        "COMPRESS=ZSTD",
        "-q",
    ];
    place.ok(&[&["convert", "synth:rough,size=2048", "large.tif"], &store[..]].concat());
    let job = ["difference", "synth:rough,size=2048,seed=4", "large.tif", "p.tif", "-q"];
    place.ok_as_advised(&job, "30M", &["memory"]);
}

/// A CRS or a unit that one grid does not state is that of the other, in areas and volumes too; Mercator has a note.
#[test]
fn what_one_grid_does_not_state_is_as_in_the_other() {
    let place = Place::new();
    let lattice = [7.0, 46.0, 0.01];
    place.write("plain.asc", grid(lattice, "3 3 3\n3 3 3"));
    place.write("degrees.asc", grid(lattice, "1 1 1\n1 1 1")).write("degrees.prj", "EPSG:4326");
    let [one, other] = [["plain.asc", "degrees.asc"], ["degrees.asc", "plain.asc"]]
        .map(|both| report(&place, &[&both[..], &["o.tif"]].concat()));
    assert!(one["area_above"].as_f64().unwrap() > 5e6, "{one}");
    assert_eq!(one["area_above"], other["area_below"]);
    assert_eq!(one["volume_above"], other["volume_below"]);
    let notes = |told: &Value| told["notes"].to_string();
    assert!(!notes(&one).contains("metres are assumed") || !notes(&one).contains("x and y"));

    // The same positions, with ellipsoidal heights and without.
    place.write("solid.asc", grid(lattice, "1.1 5 7\n2 3 4")).write("solid.prj", "EPSG:4979");
    place.write("flat.asc", grid(lattice, "1.1 5 7\n2 3 4")).write("flat.prj", "EPSG:4326");
    let same = report(&place, &["solid.asc", "flat.asc", "o.tif"]);
    assert_eq!((&same["area_above"], &same["area_below"]), (&0.0.into(), &0.0.into()), "{same}");

    place.write("map.asc", grid([0.0, 8e6, 100.0], "1 2")).write("map.prj", "EPSG:3857");
    assert!(notes(&report(&place, &["map.asc", "map.asc", "o.tif"])).contains("Mercator"));
}

/// Longitudes from 0 to 360 meet those from -180 to 180, and those of grids in metres on either side of the seam.
#[test]
fn longitudes_may_be_counted_from_anywhere() {
    let place = Place::new();
    let globe = |west: i32| -> String {
        let height = |row: i32, col: i32| {
            let longitude = (west + col * 10 + 180).rem_euclid(360) - 180;
            format!("{} ", row * 1000 + longitude)
        };
        let rows: Vec<String> =
            (0..18).map(|row| (0..36).map(|col| height(row, col)).collect()).collect();
        grid([f64::from(west), -90.0, 10.0], &rows.join("\n"))
    };
    for (name, west) in [("pacific", 0), ("atlantic", -180)] {
        place.write(&format!("{name}.asc"), globe(west));
        place.write(&format!("{name}.prj"), "EPSG:4326");
    }
    for both in [["pacific.asc", "atlantic.asc"], ["atlantic.asc", "pacific.asc"]] {
        let told = report(&place, &[both[0], both[1], "o.tif"]);
        assert_eq!((&told["compared"], &told["rmse"]), (&648.into(), &0.0.into()), "{told}");
    }
    place.write("west.asc", grid([-80.0, 40.0, 10.0], "1 2")).write("west.prj", "EPSG:4326");
    assert_eq!(report(&place, &["west.asc", "pacific.asc", "o.tif"])["compared"], 2);
    // UTM 18, all of it west of Greenwich, and UTM 31 on both sides of it.
    for (name, code) in [("w", 32618), ("e", 32631)] {
        place.write(&format!("{name}.asc"), grid([100_000.0, 4.6e6, 50_000.0], "1 2 3 4 5 6"));
        place.write(&format!("{name}.prj"), format!("EPSG:{code}"));
        let told = report(&place, &[&format!("{name}.asc"), "pacific.asc", "o.tif"]);
        assert_eq!(told["compared"], 6, "{name}: {told}");
    }
    place.write("far.asc", grid([100.0, 40.0, 1.0], "1 2")).write("far.prj", "EPSG:4326");
    place.fails(&["difference", "west.asc", "far.asc", "p.tif"], 2, &["does not overlap"]);
}
