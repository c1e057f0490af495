//! `terrane points`: what it is told, what it tells, and what it refuses.

use crate::cli_support::Place;

/// A place with two clouds beside each other and a text file.
fn clouds() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "a.laz"]);
    place.ok(&["synth", "cloud,size=60,density=4,seed=6", "b.las", "--point-format", "3"]);
    place.write("c.xyz", "x y z class\n500001 4750001 3.25 2\n500002 4750002 4.5 6\n");
    place
}

/// Points of a cloud that are not marked as withheld.
fn points(place: &Place, name: &str) -> u64 {
    let told = place.ok(&["info", name, "--json", "--stats"]).out;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    told["stats"]["kept"].as_u64().unwrap()
        - told["stats"]["flags"]["withheld"].as_u64().unwrap_or(0)
}

#[test]
fn clouds_are_merged_filtered_and_told_of() {
    let place = clouds();
    let told = place.ok(&["points", "b.las", "a.laz", "all.laz", "--json"]).out;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!((&told["point_format"], &told["files"]), (&7.into(), &1.into()));
    assert_eq!(told["points"], told["census"]["read"]);
    let all = points(&place, "all.laz");
    assert_eq!(all, points(&place, "a.laz") + points(&place, "b.las"));
    place.ok(&["points", "a.laz", "b.las", "again.laz"]);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(bytes("all.laz") == bytes("again.laz"));
    let told =
        place.ok(&["points", "all.laz", "ground.copc.laz", "--class", "2", "--thin", "2:lowest"]);
    assert!(
        told.out.contains("of point format 7") && told.out.contains("filtered out"),
        "{}",
        told.out
    );
    assert!((100..=961).contains(&points(&place, "ground.copc.laz")));
    let squares = place.ok(&["points", "all.laz", "squares", "--tile", "25", "--buffer", "3"]).out;
    assert!(squares.contains("in 9 files"), "{squares}");
    assert!(place.path("squares/500050_4750025.laz").exists());
    assert_eq!(points(&place, "squares"), all, "those of buffers are withheld");
    place.ok(&["points", "cloud:c.xyz", "text.las"]);
    assert_eq!(points(&place, "text.las"), 2);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let place = clouds();
    place.ok(&["points", "a.laz", "out.laz"]);
    place.ok(&["points", "a.laz", "degrees.laz", "--to-crs", "EPSG:4326"]);
    for (args, code, told) in [
        ("points a.laz out.laz", 2, "exists"),
        ("points a.laz a.laz --overwrite", 2, "a.laz"),
        ("points a.laz out.tif", 2, ".copc.laz"),
        ("points a.laz x.copc.laz --point-format 3", 65, "COPC does not support point format 3"),
        ("points a.laz x.laz --point-format 11", 2, "unknown point format 11"),
        ("points a.laz x.laz --thin 0", 2, "above 0"),
        ("points a.laz x.laz --thin 0.0001", 2, "smaller than the coordinate resolution"),
        ("points a.laz x.laz --buffer 3", 2, "--tile"),
        ("points a.laz x --tile 0.001", 2, "raise --tile"),
        ("points a.laz x --tile 10 --buffer 100", 2, "too wide"),
        ("points cloud:c.xyz x.laz --to-crs EPSG:4326", 65, "c.xyz"),
        ("points a.laz x.laz --ground pmf", 2, "--ground has no effect without"),
        ("points a.laz x.laz --classify ground --ground class", 2, "no effect"),
        ("points a.laz x.laz --classify trees", 2, "expected ground, ground:"),
        ("points a.laz x.laz --height-above-ground=x", 2, "dimension"),
        ("points b.las x.laz --classify height:40=1", 2, "class 40 is not supported"),
        (
            "points a.laz x.laz --classify noise --classify noise:statistical",
            2,
            "same method twice",
        ),
        ("points a.laz x.laz --classify noise:moss", 2, "known methods are voxel, statistical"),
        ("points a.laz x.laz --classify noise:voxel:size=3", 2, "step=4 (from 0.001 to 100000)"),
        ("points a.laz x.laz --classify noise:voxel:class=9", 2, "class=7 (7 or 18)"),
        ("points a.laz x.laz --classify noise:statistical:k=0.5", 2, "from 1 to 100"),
        (
            "points a.laz x.laz --classify noise:voxel:step=0.005",
            2,
            "smaller than the coordinate resolution",
        ),
        ("points degrees.laz x.laz --classify noise", 2, "a unit of length"),
        ("points degrees.laz x.laz --classify noise:statistical", 2, "a unit of length"),
        ("points a.laz x.laz --classify noise --ground csf", 2, "--ground has no effect without"),
        ("plan points a.laz -o x --tile 20 --to-crs EPSG:4326", 2, "--to-crs is not supported"),
        (
            "plan points a.laz -o x --tile 20 --thin-distance 2",
            2,
            "--thin-distance is not supported",
        ),
        ("points a.laz x.laz --thin-distance 0", 2, "--thin-distance"),
        ("points a.laz x.laz --thin-distance 0.001", 2, "smaller than the coordinate resolution"),
        ("points degrees.laz x.laz --thin-distance 2", 2, "these are in degrees"),
        ("points a.laz x.laz --drop-overlap=-1", 2, "--drop-overlap"),
        ("points a.laz x.laz --drop-overlap=0.001", 2, "smaller than the coordinate resolution"),
        ("points a.laz x.copc.laz --sort morton", 2, "the order of its octree"),
        ("points a.laz x.laz --sort hilbert", 2, "possible values: morton, time"),
        ("points a.laz x.laz --point-format 0 --sort time", 2, "point format 0 lacks"),
        ("points a.laz x.laz --attribute z=1", 2, "not an attribute"),
        ("points a.laz x.laz --attribute red=1", 2, "have no attribute \"red\""),
        ("points a.laz x.laz --attribute class=amplitude", 2, "have no attribute \"amplitude\""),
        ("points a.laz x.laz --attribute class=(1", 2, "unclosed parenthesis"),
        ("points a.laz x.laz --attribute class=-1", 65, "does not fit into classification"),
        ("points b.las x.laz --attribute class=user_data/0", 65, "division by zero"),
        ("points nothing.laz x.laz", 65, "nothing.laz"),
        ("points synth:cloud,size=9 x.laz", 2, "synth"),
    ] {
        let args: Vec<&str> = args.split(' ').collect();
        place.fails(&args, code, &[told]);
        assert!(!place.path("x.laz").exists() && !place.path("x").exists(), "{args:?}");
    }
}

#[test]
fn few_points_are_sorted_set_and_told_of() {
    let place = clouds();
    let many = ["--drop-overlap", "--thin-distance", "1.5", "--sort", "time"];
    let many =
        [&many[..], &["--attribute", "user = return * 10", "--attribute", "source=user_data+1"]]
            .concat();
    let told = place.ok(&[&["points", "a.laz", "b.las", "few.csv"][..], &many].concat()).out;
    assert!(told.contains("points of other flight lines dropped, in cells of 1"), "{told}");
    let text = std::fs::read_to_string(place.path("few.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|value| value.parse().unwrap()).collect()).collect();
    assert!((1500..4000).contains(&rows.len()), "{}", rows.len());
    assert!(rows.is_sorted_by_key(|row| row[column("gps_time")]));
    for row in &rows {
        assert_eq!(row[column("user_data")], 10.0 * row[column("return_number")]);
        assert_eq!(row[column("point_source_id")], row[column("user_data")] + 1.0);
    }
}

#[test]
fn a_folder_that_is_read_or_of_others_is_not_replaced() {
    let place = clouds();
    place.ok(&["points", "a.laz", "b.las", "squares", "--tile", "25"]);
    let one = "squares/500000_4750000.laz";
    for input in ["squares", "squares/*.laz", one] {
        place.fails(
            &["points", input, "squares", "--tile", "50", "--overwrite"],
            2,
            &["contains the input"],
        );
    }
    assert_eq!(std::fs::read_dir(place.path("squares")).unwrap().count(), 9);
    place.ok(&["points", "a.laz", "squares", "--tile", "50", "--overwrite"]);
    // A file of somebody else.
    let mut bytes = std::fs::read(place.path(one)).unwrap();
    bytes[58..90].fill(0);
    place.write(one, bytes);
    place.fails(
        &["points", "a.laz", "squares", "--tile", "50", "--overwrite"],
        2,
        &["not created by terrane"],
    );
}

#[test]
fn bad_files_of_many_are_skipped_when_asked() {
    let place = clouds();
    place.write("bad.laz", "LASF and no more");
    place.fails(&["points", "a.laz", "bad.laz", "x.laz"], 65, &["bad.laz"]);
    let told = place.ok(&["points", "a.laz", "bad.laz", "x.laz", "--skip-bad", "--json"]).out;
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert_eq!(told["skipped"][0]["file"], "bad.laz");
    assert_eq!(points(&place, "x.laz"), points(&place, "a.laz"));
}

#[test]
fn what_fails_or_is_killed_leaves_nothing_behind() {
    let place = clouds();
    let names = || {
        let all = std::fs::read_dir(place.path(".")).unwrap();
        let mut names: Vec<_> = all.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    for job in [
        "a.laz o.las",
        "a.laz o.copc.laz",
        "a.laz o --tile 20",
        "a.laz o.csv",
        "a.laz o.laz --dedupe --thin 1",
        "a.laz o.laz --thin-distance 1 --sort morton",
    ] {
        for point in ["create", "sync", "rename"] {
            let args: Vec<&str> = ["points"].into_iter().chain(job.split(' ')).collect();
            let fault = format!("{point}:1");
            let ran = place.command(&args).env("TERRANE_FAULT", &fault).output().unwrap();
            let told = String::from_utf8_lossy(&ran.stderr);
            assert!(matches!(ran.status.code(), Some(73 | 74)), "{job} {fault}: {told}");
            assert_eq!(names(), before, "{job} {fault}");
        }
    }
    for wait in [5, 20, 40, 80] {
        let mut command = place.command(&["points", "a.laz", "b.las", "o.copc.laz", "-q"]);
        let mut child = command.spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(wait));
        let _ = child.kill();
        child.wait().unwrap();
        if place.path("o.copc.laz").exists() {
            std::fs::remove_file(place.path("o.copc.laz")).unwrap();
        }
        // The next run takes away what is left of one that was killed.
        place.ok(&["points", "a.laz", "b.las", "o.copc.laz", "-q"]);
        std::fs::remove_file(place.path("o.copc.laz")).unwrap();
        assert_eq!(names(), before);
    }
}

#[test]
fn noise_gets_its_class_and_is_no_ground() {
    let place = clouds();
    let outliers = (0..30).map(|i| {
        format!("{} {} {} 1\n", 500_000 + i * 37 % 60, 4_750_000 + i * 53 % 60, 900 - 60 * i)
    });
    place.write("d.xyz", format!("x y z class\n{}", outliers.collect::<String>()));
    place.write("d.prj", "EPSG:32631");
    place.ok(&["points", "a.laz", "cloud:d.xyz", "dirty.laz"]);
    let asked = "--classify noise --classify ground --ground csf --height-above-ground";
    let asked: Vec<&str> = asked.split(' ').collect();
    let told = place.ok(&[&["points", "dirty.laz", "clean.copc.laz"][..], &asked].concat()).out;
    assert!(told.contains("noise: 30 points of class 7 by voxel:step=4,isolated=5"), "{told}");
    let same = |name: &str, first: &str, options: &str| {
        let options: Vec<&str> = options.split(' ').collect();
        place.ok(&[&["points", first, name, "-q"][..], &options].concat());
        std::fs::read(place.path(name)).unwrap()
    };
    // Two commands, one after the other.
    same("noise.laz", "dirty.laz", "--classify noise");
    let two = same("two.laz", "noise.laz", "--classify ground --ground csf");
    assert!(two == same("one.laz", "dirty.laz", "--classify ground --ground csf --classify noise"));
    let far = "--classify noise:statistical:k=6,m=3,class=18";
    let text = String::from_utf8(same("far.csv", "dirty.laz", far)).unwrap();
    assert!(text.lines().filter(|line| line.split(',').any(|value| value == "18")).count() >= 29);
    // Squares by plan are those of one run.
    let squares = "--classify noise:voxel:step=1.5,isolated=25 --tile 20 --buffer 3 --thin 0.5";
    let squares: Vec<&str> = squares.split(' ').collect();
    place.ok(&[&["points", "dirty.laz", "whole"][..], &squares].concat());
    place
        .ok(&[&["plan", "points", "dirty.laz", "-o", "work", "--cut", "1"][..], &squares].concat());
    place.ok(&["run", "work", "-o", "parts"]);
    let names = |folder: &str| {
        let names = std::fs::read_dir(place.path(folder)).unwrap();
        let mut names: Vec<_> = names.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names("whole"), names("parts"));
    for name in names("whole") {
        let bytes = |folder: &str| std::fs::read(place.path(folder).join(&name)).unwrap();
        assert!(bytes("whole") == bytes("parts"), "{name:?}");
    }
}

#[test]
fn ground_that_is_found_and_kept_makes_the_same_model() {
    let place = clouds();
    let asked = ["--classify", "ground", "--ground", "pmf"];
    let told = place.ok(&[&["points", "a.laz", "c.laz"][..], &asked].concat()).out;
    assert!(told.contains("found by the method pmf") && told.contains("no longer"), "{told}");
    place.ok(&["grid", "a.laz", "a.tif", "--dtm", "--ground", "pmf", "--cell", "1"]);
    place.ok(&["grid", "c.laz", "c.tif", "--dtm", "--ground", "class", "--cell", "1"]);
    let bytes = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(bytes("a.tif") == bytes("c.tif"));
    let text = ["--height-above-ground", "--classify", "height", "-q"];
    place.ok(&[&["points", "c.laz", "h.csv"][..], &text].concat());
    let text = String::from_utf8(bytes("h.csv")).unwrap();
    assert!(text.lines().next().unwrap().ends_with("HeightAboveGround"));
}
