//! Pages: what is refused, and what is the same whatever the threads.

use crate::cli_support::Place;

/// A grid, a mesh and lines.
fn place() -> Place {
    let place = Place::new();
    place.ok(&["synth", "rough,size=65,seed=5", "dem.tif"]);
    place.ok(&["tin", "dem.tif", "mesh.ply", "--max-error", "5"]);
    place.ok(&["synth", "coverage,vertices=200,features=6", "areas.fgb"]);
    place
}

#[test]
fn a_page_of_each_kind_is_one_file_that_loads_nothing() {
    let place = place();
    let jobs: [&[&str]; 5] = [
        &["view", "dem.tif"],
        &["view", "mesh.ply", "--against", "dem.tif", "--edges", "--azimuth", "300"],
        &["view", "dem.tif", "--insertion", "--exaggeration", "3"],
        &["view", "areas.fgb"],
        &["view", "synth:koch,vertices=500"],
    ];
    let before = place.files().len();
    for (number, job) in jobs.iter().enumerate() {
        let page = format!("{number}.html");
        place.ok(&[job, &["--html", &page, "--threads", "1"][..]].concat());
        let first = place.bytes(&page);
        place.ok(&[job, &["--html", &page, "--threads", "3", "--overwrite"][..]].concat());
        assert_eq!(first, place.bytes(&page), "{job:?}: the same bytes");
        let text = String::from_utf8(first).unwrap();
        assert!(text.starts_with("<!DOCTYPE html>") && text.contains("default-src 'none'"));
        for word in ["http:", "https:", "src=", "href="] {
            assert!(!text.contains(word), "{job:?}: {word}");
        }
    }
    assert_eq!(place.files().len(), before + jobs.len(), "a file each");
}

/// Samples on edges and at vertices are in several triangles, and count once; so they do in the proof.
#[test]
fn a_page_counts_each_sample_once() {
    let place = place();
    let flat = "ncols 9\nnrows 7\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9\n";
    let heights: Vec<String> = (0..63).map(|i| (i * 37 % 23).to_string()).collect();
    place.write("all.asc", format!("{flat}{}\n", heights.join(" ")));
    place.write("void.asc", format!("{flat}{}\n", heights.join(" ").replacen("22", "-9", 1)));
    for (grid, error, samples) in
        [("dem.tif", "5", 65 * 65), ("all.asc", "0", 63), ("void.asc", "0", 62)]
    {
        place.ok(&["tin", grid, "m.ply", "--max-error", error, "--overwrite"]);
        place.ok(&["view", "m.ply", "--html", "m.html", "--against", grid, "--overwrite"]);
        let page = String::from_utf8(place.bytes("m.html")).unwrap();
        let told = format!("[\"Samples compared\",{samples}]");
        let found = page.split("Samples compared").nth(1).map(|rest| &rest[..rest.len().min(20)]);
        assert!(page.contains(&told), "{grid}: {told}: {found:?}");
    }
}

#[test]
fn what_a_page_cannot_do_is_refused() {
    let place = place();
    let cases: [(&[&str], &[&str]); 14] = [
        (&["dem.tif"], &["--output"]),
        (&["dem.tif", "--html", "a.html", "-o", "a.png"], &["cannot be used"]),
        (&["dem.tif", "--html", "a.png"], &[".html"]),
        (&["dem.tif", "--html", "a.html", "--width", "100"], &["--width"]),
        (&["dem.tif", "--html", "a.html", "--against", "dem.tif"], &["--against", "mesh"]),
        (&["dem.tif", "--html", "a.html", "--layer", "x"], &["--layer", "lines"]),
        (&["dem.tif", "-o", "a.png", "--insertion"], &["--insertion"]),
        (&["mesh.ply", "-o", "a.png", "--against", "dem.tif"], &["--against"]),
        (&["dem.tif", "-o", "a.png", "--layer", "x"], &["--layer"]),
        (&["mesh.ply", "--html", "a.html", "--insertion"], &["grid", "mesh"]),
        (&["mesh.ply", "--html", "a.html", "--band", "1"], &["--band", "mesh"]),
        (&["areas.fgb", "--html", "a.html", "--azimuth", "3"], &["--azimuth", "lines"]),
        (&["areas.fgb", "--html", "a.html", "--skip-bad"], &["--skip-bad", "lines"]),
        (&["areas.fgb", "areas.fgb", "--html", "a.html"], &["one line file"]),
    ];
    for (args, told) in cases {
        place.fails(&[&["view"], args].concat(), 2, told);
    }
    place.fails(&["view", "mesh.ply", "--html", "a.html", "--bbox", "0,0,1,1"], 65, &["--bounds"]);
    let large = ["view", "synth:rough,size=513", "--html", "a.html", "--memory", "16M"];
    place.fails(&large, 75, &["--memory"]);
    place.fails(&["view", "gone.ply", "--html", "a.html"], 65, &["gone.ply"]);
    let row = "ncols 5\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3 4 5\n";
    place.write("row.asc", row);
    let small = ["view", "row.asc", "--html", "a.html"];
    place.fails(&small, 65, &["row.asc", "no surface"]);
    place.fails(&[&small[..], &["--insertion"]].concat(), 2, &["row.asc", "two rows"]);
    let beside = ["view", "dem.tif", "--html", "a.html", "--bbox", "0,0,1,1"];
    place.fails(&beside, 2, &["dem.tif", "--bounds"]);
    assert!(!place.path("a.html").exists());
}

#[test]
fn a_part_of_a_mesh_and_of_a_grid_can_be_shown() {
    let place = place();
    let bbox = "500100,4749500,500300,4749800";
    let count = |input: &str, page: &str| {
        let told = place.ok(&["view", input, "--html", page, "--bbox", bbox, "--json"]).out;
        crate::cli_support::json(&told)["vertices"].as_u64().unwrap()
    };
    assert_eq!(count("dem.tif", "grid.html"), 21 * 31);
    let whole = crate::cli_support::json(&place.ok(&["info", "mesh.ply", "--json"]).out);
    let part = count("mesh.ply", "mesh.html");
    assert!(part > 3 && part < whole["vertices"].as_u64().unwrap(), "{part}");
}
