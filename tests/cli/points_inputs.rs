//! Clouds that are not as they seem: text with many columns, headers that count too few, waveforms beside, systems that
//! say less than others.

use crate::cli_support::{Place, json};

/// The notes of a report.
fn notes(told: &str) -> String {
    json(told)["notes"].to_string()
}

/// Where the header of LAS 1.4 has the global encoding, and the wide count of points.
const ENCODING: usize = 6;
const COUNT: usize = 247;

/// The file again, with other bytes somewhere.
fn patch(place: &Place, (from, to): (&str, &str), at: usize, with: &[u8]) {
    let mut bytes = place.bytes(from);
    bytes[at..at + with.len()].copy_from_slice(with);
    place.write(to, bytes);
}

#[test]
fn every_field_survives_text() {
    let place = Place::new();
    for format in ["3", "6", "7", "8"] {
        let synth = "cloud,size=40,density=2,seed=5";
        place.ok(&["synth", synth, "a.laz", "--point-format", format, "--overwrite"]);
        let set = ["--attribute", "intensity=x-500000", "--attribute", "user_data=3"];
        let set = [&["points", "a.laz", "b.laz", "--keep-withheld", "--overwrite"], &set[..]];
        place.ok(&set.concat());
        let keep = ["--keep-withheld", "--overwrite", "--json"];
        place.ok(&[&["points", "b.laz", "b.csv"], &keep[..]].concat());
        let told = place.ok(&[&["points", "cloud:b.csv", "c.laz"], &keep[..]].concat()).out;
        assert!(!notes(&told).contains("not read"), "{told}");
        place.ok(&[&["points", "c.laz", "c.csv"], &keep[..]].concat());
        let [one, other] =
            ["b.csv", "c.csv"].map(|name| String::from_utf8(place.bytes(name)).unwrap());
        let columns = |text: &str| -> Vec<String> {
            text.lines().next().unwrap().split(',').map(str::to_owned).collect()
        };
        let (old, new) = (columns(&one), columns(&other));
        assert!(old.iter().all(|column| new.contains(column)), "{old:?}, {new:?}");
        let of = |text: &str, columns: &[String], asked: &[String]| -> Vec<String> {
            let at: Vec<usize> = asked
                .iter()
                .map(|name| columns.iter().position(|own| own == name).unwrap())
                .collect();
            let line = |line: &str| {
                let fields: Vec<&str> = line.split(',').collect();
                at.iter().map(|at| fields[*at]).collect::<Vec<_>>().join(",")
            };
            text.lines().skip(1).map(line).collect()
        };
        // Whole degrees are no steps of formats from 6 on.
        let is_kept = |name: &&String| format != "3" || *name != "scan_angle";
        let asked: Vec<String> = old.iter().filter(is_kept).cloned().collect();
        let (before, after) = (of(&one, &old, &asked), of(&other, &new, &asked));
        let odd = before.iter().zip(&after).find(|(before, after)| before != after);
        assert!(odd.is_none() && before.len() == after.len(), "format {format}: {odd:?}");
    }
    // What is asked of attributes is asked of those of text.
    place.write(
        "t.csv",
        "x,y,z,intensity,gps_time,withheld,r,g,b,mine\n0,0,1,500,10.5,1,65535,0,0,7\n\
         0,0,1,600,11.5,0,0,65535,0,8\n5,5,2,700,12.5,0,0,0,65535,8\n",
    );
    let count = |more: &[&str]| {
        let args = [&["points", "cloud:t.csv", "t.las", "--overwrite", "--json"], more].concat();
        let told = json(&place.ok(&args).out);
        assert!(told["notes"].to_string().contains("ignored columns: mine"), "{told}");
        told["points"].as_u64().unwrap()
    };
    assert_eq!(count(&["--dedupe"]), 3);
    assert_eq!(count(&["--drop-flag", "withheld"]), 2);
    let max = ["grid", "t.las", "t.asc", "--cell", "10", "--stat", "max:attribute=intensity"];
    place.ok(&[&max[..], &["--keep-withheld"]].concat());
    assert!(String::from_utf8(place.bytes("t.asc")).unwrap().contains("700"));
    let of_text = ["grid", "t.csv", "u.asc", "--cell", "10", "--stat", "max:attribute=intensity"];
    place.ok(&[&of_text[..], &["--keep-withheld"]].concat());
    assert!(place.bytes("t.asc") == place.bytes("u.asc"));
    place.write("n.xyz", "0 0 1 5 6\n1 1 2 5 6\n");
    let told = place.ok(&["points", "cloud:n.xyz", "n.las", "--json"]).out;
    assert!(notes(&told).contains("the 2 columns after the third are ignored"), "{told}");
}

#[test]
fn points_that_no_header_counts_are_told_of() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=200,density=4,seed=5", "a.las"]);
    place.ok(&["synth", "cloud,size=200,density=4,seed=5", "a.laz"]);
    let all = json(&place.ok(&["info", "a.las", "--json"]).out)["points"].as_u64().unwrap();
    assert!(all > 100_000, "several chunks");
    for ending in ["las", "laz"] {
        let (whole, few, none) =
            (format!("a.{ending}"), format!("few.{ending}"), format!("none.{ending}"));
        patch(&place, (&whole, &few), COUNT, &50_000_u64.to_le_bytes());
        patch(&place, (&whole, &none), COUNT, &0_u64.to_le_bytes());
        for name in [&few, &whole] {
            let told = place.ok(&["points", name, "o.las", "--json", "--overwrite"]).out;
            let is_told = notes(&told).contains("after the 50000 points");
            assert_eq!(is_told, *name == few, "{told}");
        }
        let asked = ["points", &none, "p.las"];
        place.fails(&asked, 65, &[&none, "states 0 points", "lasinfo"]);
        let told = place.ok(&[&asked[..], &["--salvage", "--json", "--overwrite"]].concat()).out;
        assert!(notes(&told).contains("after the 0 points"), "{told}");
        std::fs::remove_file(place.path("p.las")).unwrap();
    }
    // A cloud without points that is whole has nothing to tell.
    place.ok(&["points", "a.las", "e.laz", "--bounds", "0,0,1,1"]);
    let told = place.ok(&["points", "e.laz", "e.las", "--json"]).out;
    assert!(!notes(&told).contains("possible points"), "{told}");
    place.ok(&["points", "e.las", "f.laz"]);
}

#[test]
fn waveforms_beside_are_told_of_and_never_mixed() {
    let place = Place::new();
    for (name, seed) in [("a", 5), ("b", 6)] {
        let synth = format!("cloud,size=20,density=2,seed={seed}");
        place.ok(&["synth", &synth, "plain.las", "--overwrite"]);
        place.ok(&["points", "plain.las", "w.las", "--point-format", "9", "--overwrite"]);
        let encoding = place.bytes("w.las")[ENCODING] | 4;
        patch(&place, ("w.las", &format!("{name}.las")), ENCODING, &[encoding]);
    }
    let told = place.ok(&["points", "a.las", "c.las", "--json"]).out;
    assert!(notes(&told).contains(".wdp file of a.las"), "{told}");
    place.fails(&["points", "a.las", "b.las", "d.las"], 65, &["b.las", "waveforms", "a.las"]);
    place.ok(&["points", "a.las", "b.las", "d.las", "--point-format", "6"]);
    place.ok(&["points", "a.las", "b.las", "d.csv"]);
}

#[test]
fn heights_that_only_some_files_name_are_told_of_in_any_order() {
    let place = Place::new();
    place.write("t.xyz", "500001 4750001 3.25\n500002 4750002 4.5\n");
    for (name, crs) in [("k1", "EPSG:32611"), ("k2", "EPSG:32611+5703"), ("k3", "EPSG:32611")] {
        place.ok(&["points", "cloud:t.xyz", &format!("{name}.las"), "--crs", crs]);
    }
    for pair in [["k1.las", "k2.las"], ["k2.las", "k3.las"]] {
        let told = place.ok(&["points", pair[0], pair[1], "o.las", "--json", "--overwrite"]).out;
        let silent = pair.into_iter().find(|name| *name != "k2.las").unwrap();
        let expected = format!("{silent} has no vertical CRS");
        assert!(notes(&told).contains(&expected), "{told}");
        let told = place.ok(&["info", "o.las", "--json"]).out;
        assert!(told.contains("5703") || told.contains("NAVD88"), "{told}");
    }
    let told = place.ok(&["points", "k1.las", "k3.las", "o.las", "--json", "--overwrite"]).out;
    assert!(!notes(&told).contains("no vertical CRS"), "{told}");
}

#[test]
fn heights_that_stay_in_another_unit_than_x_and_y_are_told_of() {
    let place = Place::new();
    place.write("t.xyz", "6500001 2150001 300.25\n6500002 2150002 400.5\n");
    place.ok(&["points", "cloud:t.xyz", "ft.las", "--crs", "EPSG:2225"]);
    place.ok(&["points", "cloud:t.xyz", "both.las", "--crs", "EPSG:2225+6360"]);
    let to = |from: &str, crs: &str| {
        notes(&place.ok(&["points", from, "m.las", "--to-crs", crs, "--json", "--overwrite"]).out)
    };
    let told = to("ft.las", "EPSG:26910");
    assert!(told.contains("heights stay in an unknown unit"), "{told}");
    // Heights that are named go on to be.
    for (from, crs) in
        [("both.las", "EPSG:26910"), ("both.las", "EPSG:26910+5703"), ("ft.las", "EPSG:2226")]
    {
        let told = to(from, crs);
        assert!(!told.contains("heights stay"), "{from} to {crs}: {told}");
    }
}

#[test]
fn cells_and_squares_are_where_they_are_told_to_be() {
    let place = Place::new();
    place.write("t.xyz", "500001.5 4750001 3.25\n500102 4750102 4.5\n");
    let grid = ["grid", "t.xyz", "t.tif", "--stat", "mean", "--cell"];
    for cell in ["1e-9", "1e-8"] {
        place.fails(&[&grid[..], &[cell]].concat(), 2, &["cells", "--cell"]);
    }
    place.ok(&["points", "cloud:t.xyz", "squares", "--tile", "33.3"]);
    let mut names: Vec<String> = std::fs::read_dir(place.path("squares"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["499999.5_4749978.6.laz", "500099.4_4750078.5.laz"]);
}

/// Where the header of LAS has where points begin, scales, offsets, and the largest and least x.
const POINTS_AT: usize = 96;
const SCALES: usize = 131;
const OFFSETS: usize = 155;
const BOUNDS: usize = 179;

#[test]
fn clouds_wider_than_geometry_is_exact_in_are_copied_and_others_are_told_what_helps() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=40,density=2,seed=5", "a.las", "-q"]);
    let plain = place.bytes("a.las");
    let four = |at: usize| u32::from_le_bytes(plain[at..at + 4].try_into().unwrap());
    let float = |at: usize| f64::from_le_bytes(plain[at..at + 8].try_into().unwrap());
    let tin = ["tin", "wide.las", "out.ply", "--max-error", "1", "--overwrite"];
    for (axis, part) in [(0, "--bounds"), (1, "--bounds"), (2, "--z-range")] {
        let mut bytes = plain.clone();
        let mut put = |at: usize, with: &[u8]| bytes[at..at + with.len()].copy_from_slice(with);
        for (point, step, bound) in [(0, i32::MAX, 0), (1, i32::MIN, 8)] {
            let world = f64::from(step) * float(SCALES + 8 * axis) + float(OFFSETS + 8 * axis);
            put(four(POINTS_AT) as usize + 30 * point + 4 * axis, &step.to_le_bytes());
            put(BOUNDS + 16 * axis + bound, &world.to_le_bytes());
        }
        place.write("wide.las", &bytes);
        let told = place.ok(&["info", "wide.las", "--stats", "--json"]).out;
        let count = json(&told)["points"].clone();
        assert_eq!(json(&told)["stats"]["read"], count, "{told}");
        for (output, how) in [
            ("out.las", &[][..]),
            ("out.laz", &["--dedupe", "--attribute", "user_data=3"]),
            ("out.copc.laz", &[]),
            ("out.csv", &["--sort", "morton"]),
        ] {
            let args = ["points", "wide.las", output, "--overwrite", "--keep-withheld", "--json"];
            let made = json(&place.ok(&[&args, how].concat()).out);
            assert_eq!(made["points"], count, "{output}");
        }
        let records = |name: &str| place.bytes(name)[four(POINTS_AT) as usize..].to_vec();
        assert!(records("out.las") == records("wide.las"));
        place.write("out.ply", "");
        place.write("sparse.laz", "");
        place.fails(&tin, 65, &["xyz"[axis..=axis].as_ref(), "steps of", part]);
        let thin = ["points", "wide.las", "sparse.laz", "--thin", "1", "--overwrite"];
        place.fails(&thin, 65, &[part]);
        // What the error advises helps.
        let within = match axis {
            2 => ["--z-range".to_owned(), "-1000,5000".to_owned()],
            _ => ["--bounds".to_owned(), "500000,4750000,500040,4750040".to_owned()],
        };
        let within: Vec<&str> = within.iter().map(String::as_str).collect();
        place.ok(&[&tin[..], &within].concat());
        place.ok(&[&thin[..], &within].concat());
    }
}
