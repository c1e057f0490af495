//! `terrane grid` from the command line: what it tells, writes and refuses; memory kept; the book
//! against the registry.

use crate::cli_support::{Place, json};
use terrane_gridding as gridding;

/// A cloud as text: a corner of each of four cells, and one point more.
const CLOUD: &str = "x y z\n0.0 0.0 1.0\n1.0 0.0 2.0\n0.0 1.0 3.0\n1.0 1.0 4.5\n0.5 0.5 2.0\n";

#[test]
fn a_cloud_becomes_bands_and_a_report() {
    let place = Place::new();
    place.write("a.xyz", CLOUD);
    let args =
        ["grid", "a.xyz", "a.tif", "--cell", "1", "--stat", "mean,max,count", "--report", "r.json"];
    let told = place.ok(&args).out;
    for part in ["5 read", "2 x 2 cells of 1 x 1", "count (100.00 % of the cells)"] {
        assert!(told.contains(part), "{part} in\n{told}");
    }
    let report = json(&std::fs::read_to_string(place.path("r.json")).unwrap());
    assert_eq!((&report["points"]["kept"], &report["cells"]), (&5.into(), &4.into()));
    assert_eq!(report["corner"], serde_json::json!([0.0, 2.0]));
    for (band, highest) in [("1", 4.5), ("2", 4.5), ("3", 2.0)] {
        let info = place.ok(&["info", "a.tif", "--stats", "--band", band, "--json"]).out;
        assert_eq!(json(&info)["bands"], 3, "{info}");
        assert!(info.contains(&format!("{highest}")), "{info}");
    }
    place.ok(&["grid", "a.xyz", "b.tif", "--like", "a.tif", "-q"]);
    place.ok(&["grid", "a.xyz", "c.asc", "--cell", "1,2", "--progress", "json"]);
    let files = ["a.tif", "a.xyz", "b.tif", "c.asc", "r.json"];
    assert_eq!(place.files(), files);
}

#[test]
fn what_refuses_a_height_for_want_of_rounding_takes_it_rounded() {
    let place = Place::new();
    place.write("a.xyz", "0.5 0.5 1.4999999999\n1.5 0.5 2.26\n");
    let mut advised = 0;
    for format in terrane_raster::write::FORMATS {
        let name = format!("{}.{}", format.name, format.extensions[0]);
        for to_type in ["int16", "float32", "float64"] {
            let args = ["grid", "a.xyz", &name, "-f", format.name, "--cell", "1", "--stat", "mean"];
            let args = [&args[..], &["--type", to_type, "--overwrite", "-q"]].concat();
            let ran = place.run(&args);
            if ran.code != 0 && ran.err.contains("pass --round") {
                place.ok(&[&args[..], &["--round"]].concat());
                advised += 1;
            } else {
                assert!(ran.code == 0 || !ran.err.contains("--round"), "{args:?}: {}", ran.err);
            }
        }
    }
    assert!(advised > 2, "{advised}");
}

#[test]
fn what_cannot_act_is_refused() {
    let place = Place::new();
    place.write("a.xyz", CLOUD);
    let with = |more: &[&str], words: &[&str]| {
        let base = ["grid", "a.xyz", "a.tif", "--cell", "1"];
        place.fails(&[&base, more].concat(), 2, words);
    };
    with(&["--radius", "2"], &["--radius has no effect", "leave out --radius"]);
    with(&["--stat", "idw:power=2", "--power", "1"], &["--power has no effect"]);
    with(&["--stat", "count", "--fill", "2"], &["--fill has no effect"]);
    with(&["--round"], &["--round has no effect"]);
    with(&["--align", "1,1", "--compat", "pdal"], &["--compat pdal sets the grid origin"]);
    with(&["--co", "TILE=YES"], &["GTiff has no creation option TILE"]);
    place.fails(&["grid", "a.xyz", "a.xyz", "--cell", "1"], 2, &["matches no grid format"]);
    place.fails(
        &["grid", "a.xyz", "a.asc", "--cell", "1", "--stat", "min,max"],
        2,
        &["several bands"],
    );
    place.fails(&["grid", "b.xyz", "a.tif", "--cell", "1"], 65, &["b.xyz"]);
}

/// A LAS 1.2 file of `count` points of format 0 in centimetres, in rows over a square of `side`.
fn las(count: u32, side: i32) -> Vec<u8> {
    let mut file = b"LASF".to_vec();
    file.resize(227, 0);
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(24, &[1, 2]);
    put(94, &227_u16.to_le_bytes());
    put(96, &227_u32.to_le_bytes());
    put(105, &20_u16.to_le_bytes());
    put(107, &count.to_le_bytes());
    put(111, &count.to_le_bytes());
    let side_world = f64::from(side) / 100.0;
    let box_ = [side_world, 0.0, side_world, 0.0, 100.0, 0.0];
    let doubles = [0.01, 0.01, 0.01, 0.0, 0.0, 0.0].into_iter().chain(box_);
    for (i, value) in doubles.enumerate() {
        put(131 + 8 * i, &value.to_le_bytes());
    }
    let across = f64::from(count).sqrt() as u32;
    for i in 0..count {
        let at = |n: u32| (f64::from(n % across) / f64::from(across) * f64::from(side)) as i32;
        let z = (i.wrapping_mul(2_654_435_761) % 10_000) as i32;
        for value in [at(i), at(i / across), z] {
            file.extend(value.to_le_bytes());
        }
        file.extend([0, 0, 0b0000_1001, 2, 0, 0, 0, 0]);
    }
    file
}

#[test]
#[cfg(target_os = "linux")]
fn a_budget_is_kept_that_the_cells_would_break() {
    let place = Place::new();
    place.write("a.las", las(1_200_000, 120_000));
    let peak = |output: &str, threads: &str, memory: &str| {
        let args = ["grid", "a.las", output, "--cell", "1", "--stat", "mean,std,idw,median"];
        let more = ["--threads", threads, "--memory", memory, "--json"];
        let report = json(&place.ok(&[&args[..], &more].concat()).out);
        let spilled = report["spilled_bytes"].as_u64().unwrap() > 0;
        (report["peak_memory"].as_f64().unwrap() / f64::from(1 << 20), spilled)
    };
    let (free, spilled) = peak("free.tif", "1", "4G");
    assert!(!spilled && free > 80.0, "the job needs only {free} MiB and proves nothing");
    for (threads, budget) in [("1", 42.0), ("2", 58.0)] {
        let output = format!("{threads}.tif");
        let (bound, spilled) = peak(&output, threads, &format!("{budget}M"));
        assert!(spilled && bound <= budget, "{bound} MiB of {budget} with {threads} threads");
        let read = |name: &str| std::fs::read(place.path(name)).unwrap();
        assert!(read("free.tif") == read(&output), "the budget left a trace");
    }
}

#[test]
fn the_book_tells_of_every_statistic_and_option() {
    let names = include_str!("../../docs/src/reference/names.md");
    let page = include_str!("../../docs/src/guide/grid.md");
    for method in gridding::METHODS {
        let row =
            format!("| `{}` | {} | {} |", method.name, method.aliases.join(" "), method.about);
        assert!(names.contains(&row), "{row}");
        for parameter in method.parameters {
            assert!(page.contains(&format!("`{}`", parameter.key)), "{}", parameter.key);
        }
    }
    for parameter in gridding::OF_POINTS {
        assert!(page.contains(&format!("| `{}=", parameter.key)), "{}", parameter.key);
    }
    for attribute in terrane_base::attribute::ATTRIBUTES {
        assert!(names.contains(&format!("| `{}` |", attribute.name)), "{}", attribute.name);
    }
    let help = Place::new().ok(&["grid", "--help"]).out;
    let options = help.split_whitespace().filter(|word| word.starts_with("--") && word.len() > 2);
    let own =
        options.filter(|word| word.chars().skip(2).all(|c| c.is_ascii_lowercase() || c == '-'));
    let common = ["--help", "--progress", "--json", "--quiet"];
    for option in own.filter(|option| !common.contains(option)) {
        assert!(page.contains(&format!("`{option}")), "{option}");
    }
}
