//! `--where` and `--split`: against the points as text, chosen one by one here.

use std::collections::BTreeMap;

use crate::cli_support::{Place, json};

/// A point as a line of text has it.
struct Line<'a> {
    text: &'a str,
    values: BTreeMap<&'a str, f64>,
}

impl Line<'_> {
    fn get(&self, name: &str) -> f64 {
        *self.values.get(name).unwrap_or_else(|| panic!("no {name}"))
    }

    /// The height above the ground in whole centimetres; `None` where there is none.
    fn above(&self) -> Option<i64> {
        let steps = (self.get("HeightAboveGround") * 100.0).round() as i64;
        (steps > i64::from(i32::MIN)).then_some(steps)
    }
}

fn lines(text: &str) -> Vec<Line<'_>> {
    let mut all = text.lines();
    let names: Vec<&str> = all.next().unwrap().split(',').collect();
    let line = |text| {
        let values = str::split(text, ',').map(|value| value.parse().unwrap());
        Line { text, values: names.iter().copied().zip(values).collect() }
    };
    all.map(line).collect()
}

/// A condition, and what it means.
type Twin = (&'static str, fn(&Line<'_>) -> bool);

const TWINS: &[Twin] = &[
    ("intensity > 100 and point_source = 7", |p| {
        p.get("intensity") > 100.0 && p.get("point_source_id") == 7.0
    }),
    ("Classification == 2 && Intensity >= 90", |p| {
        p.get("classification") == 2.0 && p.get("intensity") >= 90.0
    }),
    ("class in (3, 4, 5) or ReturnNumber < NumberOfReturns", |p| {
        (3.0..=5.0).contains(&p.get("classification"))
            || p.get("return_number") < p.get("number_of_returns")
    }),
    ("not class in (2, 6) and not withheld = 1", |p| {
        ![2.0, 6.0].contains(&p.get("classification")) && p.get("withheld") != 1.0
    }),
    ("scan_angle < -4.5 and scan_angle >= -8.004", |p| {
        p.get("scan_angle") < -4.5 && p.get("scan_angle") >= -8.004
    }),
    ("user_data / 3 * 2 - 1 > -(1 - number_of_returns)", |p| {
        p.get("user_data") / 3.0 * 2.0 - 1.0 > p.get("number_of_returns") - 1.0
    }),
    ("z >= 220.25 and x < 500040.5 and y <> 4750010", |p| {
        p.get("z") >= 220.25 && p.get("x") < 500_040.5 && p.get("y") != 4_750_010.0
    }),
    ("gps_time * 2 > 600000001 and edge_of_flight_line = 0", |p| {
        p.get("gps_time") * 2.0 > 600_000_001.0 && p.get("edge_of_flight_line") == 0.0
    }),
    ("HeightAboveGround = 0.29 or heightaboveground > 7.1", |p| {
        p.above().is_some_and(|steps| steps == 29 || steps > 710)
    }),
    ("not HeightAboveGround <= 7.1", |p| p.above().is_some_and(|steps| steps > 710)),
    ("100 / (class - 2) > 34", |p| {
        p.get("classification") == 3.0 || p.get("classification") == 4.0
    }),
    ("class = 99", |_| false),
];

/// A cloud with extra bytes, some of which have no value, in several forms.
fn place() -> Place {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=80,density=3,seed=9,relief=300", "plain.laz"]);
    let set = ["--attribute", "point_source_id = 5 + number_of_returns"];
    let more = ["--attribute", "user_data = 3 * return_number", "--height-above-ground"];
    place.ok(&[&["points", "plain.laz", "c.laz"], &set[..], &more[..]].concat());
    place.ok(&["points", "c.laz", "c.las"]);
    place.ok(&["points", "c.laz", "c.copc.laz"]);
    place.ok(&["points", "c.laz", "all.csv"]);
    place
}

/// The bytes of a file, or of all files of a folder by name.
fn files(place: &Place, name: &str) -> Vec<(String, Vec<u8>)> {
    let path = place.path(name);
    if !path.is_dir() {
        return vec![(String::new(), place.bytes(name))];
    }
    let mut all: Vec<_> = std::fs::read_dir(path).unwrap().flatten().collect();
    all.sort_by_key(|entry| entry.file_name());
    let file = |entry: &std::fs::DirEntry| {
        (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap())
    };
    all.iter().map(file).collect()
}

fn read(place: &Place, name: &str) -> String {
    std::fs::read_to_string(place.path(name)).unwrap()
}

#[test]
fn conditions_choose_the_points_that_meet_them() {
    let place = place();
    let text = read(&place, "all.csv");
    let all = lines(&text);
    let mut chosen_by_some = 0;
    for (number, (condition, holds)) in TWINS.iter().enumerate() {
        let expected: Vec<&str> = all.iter().filter(|p| holds(p)).map(|p| p.text).collect();
        chosen_by_some += usize::from(!expected.is_empty() && expected.len() < all.len());
        for input in ["c.laz", "c.las"] {
            let out = format!("{number}-{input}.csv");
            place.ok(&["points", input, &out, "--where", condition]);
            let found = read(&place, &out);
            assert!(found.lines().skip(1).eq(expected.iter().copied()), "{condition} of {input}");
        }
        let info =
            json(&place.ok(&["info", "c.las", "--stats", "--json", "--where", condition]).out);
        assert_eq!(info["stats"]["kept"], expected.len(), "{condition}");
    }
    assert!(chosen_by_some >= 9, "{chosen_by_some}");
}

#[test]
fn every_form_memory_and_number_of_threads_has_the_same_points() {
    let place = place();
    let condition = "intensity > 110 and scan_angle < 9 or HeightAboveGround > 3";
    let made = |input: &str, more: &[&str]| {
        let out = format!("o{}.laz", place.files().len());
        place.ok(&[&["points", input, &out, "--where", condition], more].concat());
        place.bytes(&out)
    };
    let once = made("c.laz", &[]);
    assert_eq!(made("c.laz", &["--threads", "1", "--memory", "200M"]), once);
    assert_eq!(made("c.las", &["--threads", "3"]), once);
    let sorted = |input: &str| {
        let out = format!("s{}.csv", place.files().len());
        place.ok(&["points", input, &out, "--where", condition]);
        let mut lines: Vec<String> = read(&place, &out).lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    assert_eq!(sorted("c.copc.laz"), sorted("c.laz"));
    // Two halves in any order are the whole.
    place.ok(&["points", "c.laz", "west.laz", "--where", "x < 500040"]);
    place.ok(&["points", "c.laz", "east.laz", "--where", "not x < 500040"]);
    let two = |names: [&str; 2]| {
        let out = format!("t{}.laz", place.files().len());
        place.ok(&["points", names[0], names[1], &out, "--where", condition]);
        place.bytes(&out)
    };
    assert_eq!(two(["west.laz", "east.laz"]), two(["east.laz", "west.laz"]));
}

/// A verb with a condition does what it does with a file of the points that meet it.
#[test]
fn every_verb_that_reads_clouds_takes_conditions() {
    let place = place();
    let condition = "class = 2 and intensity > 95";
    place.ok(&["points", "c.las", "some.las", "--where", condition]);
    let bbox = "500000,4750000,500080,4750080";
    let verbs: [&[&str]; 3] = [
        &["grid", "INPUT", "OUT.asc", "--cell", "4", "--stat", "mean", "--bbox", bbox],
        &["grid", "INPUT", "OUT.asc", "--cell", "4", "--dtm", "--bbox", bbox],
        &["points", "INPUT", "OUT.csv"],
    ];
    for (number, verb) in verbs.iter().enumerate() {
        let with = |input: &str, more: &[&str]| {
            let out = format!("{number}-{}", input.replace(".las", ""));
            let args: Vec<String> =
                verb.iter().map(|arg| arg.replace("INPUT", input).replace("OUT", &out)).collect();
            let args: Vec<&str> =
                args.iter().map(String::as_str).chain(more.iter().copied()).collect();
            place.ok(&args);
            let name = args.iter().find(|arg| arg.starts_with(&out)).unwrap();
            place.bytes(name)
        };
        assert!(with("c.las", &["--where", condition]) == with("some.las", &[]), "{verb:?}");
    }
    let mesh = ["tin", "c.las", "m.ply", "--max-error", "0.5", "--where", condition];
    place.ok(&mesh);
    place.ok(&["verify", "m.ply", "c.las", "--where", condition]);
    assert_eq!(place.run(&["verify", "m.ply", "c.las"]).code, 1, "other points are off");
    // Plans, of which every task has the condition.
    for (verb, options, output) in [
        ("grid", &["--cell", "1", "--stat", "count"][..], "g.tif"),
        ("tin", &["--max-error", "0.5"][..], "t.ply"),
        ("points", &["--tile", "40"][..], "p"),
    ] {
        let run = [&[verb, "c.las", output, "--where", condition], options].concat();
        place.ok(&run);
        let plan = [&["plan", verb, "c.las", "-o", "work", "--where", condition], options].concat();
        place.ok(&plan);
        let planned = format!("planned-{output}");
        place.ok(&["run", "work", "-o", &planned]);
        assert!(files(&place, output) == files(&place, &planned), "{verb}");
        std::fs::remove_dir_all(place.path("work")).unwrap();
    }
}

#[test]
fn the_ground_is_that_of_all_points_as_with_other_filters() {
    let place = place();
    for (out, filter, condition) in [("a.csv", "--class", "5"), ("b.csv", "--where", "class = 5")] {
        place.ok(&["points", "plain.laz", out, "--height-above-ground", filter, condition]);
    }
    assert_eq!(read(&place, "a.csv"), read(&place, "b.csv"));
}

#[test]
fn what_cannot_be_asked_is_refused_by_name() {
    let place = place();
    let told: [(&str, &str, &[&str]); 6] = [
        (
            "--where",
            "amplitude > 3",
            &["no attribute \"amplitude\"", "c.laz", "intensity", "HeightAboveGround"],
        ),
        ("--where", "intensity", &["is not a condition"]),
        ("--where", "1 < z < 5", &["chained comparisons"]),
        ("--where", "intensity >", &["unexpected end"]),
        ("--split", "amplitude", &["no attribute \"amplitude\"", "point_source_id"]),
        ("--split", "x", &["is a coordinate", "--tile"]),
    ];
    for (option, value, words) in told {
        let output = if option == "--split" { "o" } else { "o.laz" };
        place.fails(&["points", "c.laz", output, option, value], 2, words);
    }
    place.fails(
        &["plan", "points", "c.laz", "-o", "w", "--split", "class"],
        2,
        &["--split", "plan points"],
    );
    place.fails(
        &["points", "c.laz", "o", "--split", "class", "--tile", "20"],
        2,
        &["--split", "--tile", "cannot be used with"],
    );
    place.fails(
        &["tin", "synth:rough,size=33", "o.ply", "--max-error", "1", "--where", "z > 1"],
        2,
        &["--where is for point clouds"],
    );
    // The name of an attribute is looked for where points are read, in each file.
    place.write("other.csv", "x,y,z\n500001,4750001,3\n");
    place.fails(
        &[
            "grid",
            "c.laz",
            "cloud:other.csv",
            "o.tif",
            "--cell",
            "1",
            "--where",
            "intensity > 3",
            "--crs",
            "EPSG:32631",
        ],
        2,
        &["other.csv", "no attribute \"intensity\""],
    );
    assert!(!place.path("o.laz").exists() && !place.path("o").exists());
}

#[test]
fn parts_are_what_conditions_choose() {
    let place = place();
    let text = read(&place, "all.csv");
    for (attribute, column, of) in [
        ("class", "classification", "c.laz"),
        ("PointSourceId", "point_source_id", "c.laz"),
        ("return_number", "return_number", "c.las"),
        ("withheld", "withheld", "c.laz"),
    ] {
        let told = json(&place.ok(&["points", of, "parts", "--split", attribute, "--json"]).out);
        let all = lines(&text);
        let mut values: Vec<i64> = all.iter().map(|p| p.get(column) as i64).collect();
        values.sort_unstable();
        values.dedup();
        assert!(values.len() > 1 && told["files"] == values.len(), "{attribute}: {values:?}");
        assert_eq!(told["points"], all.len());
        for value in &values {
            let condition = format!("{column} = {value}");
            place.ok(&["points", of, "one.laz", "--where", &condition, "--overwrite"]);
            let part = place.path("parts").join(format!("{column}_{value}.laz"));
            assert!(std::fs::read(part).unwrap() == place.bytes("one.laz"), "{condition}");
        }
        let files = std::fs::read_dir(place.path("parts")).unwrap().count();
        assert_eq!(files, values.len(), "nothing else is in the folder");
        std::fs::remove_dir_all(place.path("parts")).unwrap();
    }
}

#[test]
fn parts_are_the_same_bytes_however_they_are_made() {
    let place = place();
    place.ok(&["points", "c.laz", "west.laz", "--where", "x < 500040"]);
    place.ok(&["points", "c.laz", "east.laz", "--where", "x >= 500040"]);
    let runs: [&[&str]; 3] = [
        &["west.laz", "east.laz", "a", "--threads", "1"],
        &["east.laz", "west.laz", "b", "--threads", "3", "--memory", "200M"],
        &["west.laz", "east.laz", "c", "--tile-format", "laz"],
    ];
    let files = runs.map(|run| {
        place.ok(&[&["points"], run, &["--split", "point_source_id"]].concat());
        files(&place, run[2])
    });
    assert!(files[0] == files[1] && files[1] == files[2] && files[0].len() > 1);
}

#[test]
fn scaled_and_missing_values_are_names_of_files() {
    let place = Place::new();
    // The ground at 0; points 0.1, 0.3 and 0.3 above it, one beyond it.
    let ground = "0 0 0 2\n10 0 0 2\n0 10 0 2\n10 10 0 2\n";
    place.write(
        "p.xyz",
        format!("x y z class\n{ground}2 3 0.1 5\n3 2 0.3 5\n4 4 0.3 5\n99 99 1 5\n"),
    );
    place.ok(&["points", "cloud:p.xyz", "p.las", "--height-above-ground"]);
    place.ok(&["points", "p.las", "parts", "--split", "HeightAboveGround", "--tile-format", "las"]);
    let mut names: Vec<_> = std::fs::read_dir(place.path("parts")).unwrap().flatten().collect();
    names.sort_by_key(|entry| entry.file_name());
    let names: Vec<String> = names.iter().map(|e| e.file_name().into_string().unwrap()).collect();
    let expected =
        ["0.1", "0.3", "0", "none"].map(|value| format!("HeightAboveGround_{value}.las"));
    assert_eq!(names, expected);
    // Only folders of such files are replaced.
    // A folder of the values of another attribute is not this one's to replace.
    let other = ["points", "p.las", "parts", "--split", "class", "--overwrite"];
    place.fails(&other, 2, &["parts", "contains other files"]);
    std::fs::remove_dir_all(place.path("parts")).unwrap();
    place.ok(&other);
    place.ok(&other);
    place.write("parts/notes.txt", "mine");
    place.fails(
        &["points", "p.las", "parts", "--split", "class", "--overwrite"],
        2,
        &["contains other files"],
    );
}

/// What `info` says of points that are chosen is of these, though no statistics are asked for.
#[test]
fn info_counts_the_points_that_are_chosen() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=100,density=2,seed=4", "c.laz", "-q"]);
    let told = |options: &[&str]| {
        let told = json(&place.ok(&[&["info", "c.laz", "--json"], options].concat()).out);
        (told["stats"]["kept"].as_u64(), told["density"].as_f64().unwrap())
    };
    let (none, all) = told(&[]);
    assert!(none.is_none() && (1.5..2.5).contains(&all), "{all}");
    for options in [&["--class", "2"][..], &["--where", "class = 2"], &["--return", "last"]] {
        let (kept, density) = told(options);
        let kept = kept.unwrap_or_else(|| panic!("{options:?}")) as f64;
        assert!(kept > 0.0 && density < 0.99 * all, "{options:?}: {density} of {all}");
    }
    let (kept, density) = told(&["--bounds", "500000,0,500050,9000000"]);
    assert!(kept.is_some() && (0.7 * all..1.3 * all).contains(&density), "{density} of {all}");
}

#[test]
fn points_within_polygons_are_the_same_whatever_the_format_of_these() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=4,seed=5", "cloud.laz", "-q"]);
    let ring = "500010 4750010, 500050 4750012, 500048 4750052, 500010 4750010";
    let hole = "500030 4750020, 500036 4750020, 500036 4750026, 500030 4750020";
    let other = "500002 4750040, 500012 4750040, 500012 4750058, 500002 4750040";
    place.write("areas.wkt", format!("MULTIPOLYGON ((({ring}), ({hole})), (({other})))\n"));
    place.write("areas.prj", "EPSG:32631");
    let plain = "500 4750000, 501 4750000, 501 4750001, 500 4750000";
    place.write("far.wkt", format!("POLYGON (({plain}))\n")).write("far.prj", "EPSG:32632");
    place.write("line.wkt", "LINESTRING (0 0, 1 1)\n").write("none.wkt", "");
    for name in ["b.geojson", "c.fgb", "d.shp"] {
        place.ok(&["simplify", "areas.wkt", name, "--tolerance", "0", "-q"]);
    }
    place.ok(&["points", "cloud.laz", "whole.csv", "--clip", "areas.wkt", "-q"]);
    let text = String::from_utf8(place.bytes("whole.csv")).unwrap();
    // In whole centimetres, which points have.
    let inside = |place: [f64; 2]| {
        let [x, y] =
            [place[0] - 500_000.0, place[1] - 4_750_000.0].map(|c| (100.0 * c).round() as i64);
        let within = |corners: &[[i64; 2]]| {
            let next = corners.iter().cycle().skip(1);
            let crossed = corners.iter().zip(next).filter(|(a, b)| {
                let ([ax, ay], [bx, by]) = if a[1] < b[1] { (**a, **b) } else { (**b, **a) };
                ay <= y && y < by && (bx - ax) * (y - ay) > (by - ay) * (x - ax)
            });
            crossed.count() % 2 == 1
        };
        let ring = [[1000, 1000], [5000, 1200], [4800, 5200]];
        let hole = [[3000, 2000], [3600, 2000], [3600, 2600]];
        let other = [[200, 4000], [1200, 4000], [1200, 5800]];
        within(&ring) && !within(&hole) || within(&other)
    };
    let places = |text: &str| -> Vec<[f64; 2]> {
        let place = |line: &str| {
            let mut columns = line.split(',').map(|number| number.parse().unwrap());
            [columns.next().unwrap(), columns.next().unwrap()]
        };
        text.lines().skip(1).map(place).collect()
    };
    let kept = places(&text);
    place.ok(&["points", "cloud.laz", "all.csv", "-q"]);
    let all = places(&String::from_utf8(place.bytes("all.csv")).unwrap());
    assert!(kept.len() > 1000 && kept.iter().all(|place| inside(*place)), "{}", kept.len());
    assert_eq!(all.iter().filter(|place| inside(**place)).count(), kept.len());
    for name in ["b.geojson", "c.fgb", "d.shp"] {
        for option in ["--clip", "--polygon"] {
            let args = ["points", "cloud.laz", "part.csv", option, name, "--overwrite", "-q"];
            place.ok(&args);
            assert!(place.bytes("part.csv") == text.as_bytes(), "{name}");
        }
    }
    // Features are united.
    let twice = format!("POLYGON (({ring}), ({hole}))\nPOLYGON (({other}))\nPOLYGON (({other}))\n");
    place.write("twice.wkt", twice).write("twice.prj", "EPSG:32631");
    place.ok(&["points", "cloud.laz", "part.csv", "--clip", "twice.wkt", "--overwrite", "-q"]);
    assert!(place.bytes("part.csv") == text.as_bytes());
    let made = ["grid", "synth:cloud,size=60", "a.tif", "--cell", "2", "--clip", "far.wkt"];
    place.fails(&made, 65, &["far.wkt", "EPSG:32632"]);
    for (name, told) in [
        ("far.wkt", "EPSG:32632"),
        ("line.wkt", "is a LineString"),
        ("none.wkt", "is empty"),
        ("gone.wkt", "no such file"),
    ] {
        for verb in [
            &["points", "cloud.laz", "a.laz"][..],
            &["grid", "cloud.laz", "a.tif", "--cell", "2"],
            &["tin", "cloud.laz", "a.ply", "--max-error", "1"],
            &["info", "cloud.laz", "--stats"],
            &["plan", "grid", "cloud.laz", "-o", "work", "--cell", "2"],
        ] {
            place.fails(&[verb, &["--clip", name]].concat(), 65, &[name, told]);
        }
    }
}

#[test]
fn polygons_leave_less_of_the_memory() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=2,seed=5", "c.las", "-q"]);
    let corner = |i: u32| {
        let (sin, cos) = (f64::from(i) / 200_000.0 * std::f64::consts::TAU).sin_cos();
        format!("{} {}", 500_030.0 + 25.0 * cos, 4_750_030.0 + 25.0 * sin)
    };
    let corners: Vec<String> = (0..=200_000).map(|i| corner(i % 200_000)).collect();
    place.write("round.wkt", format!("POLYGON (({}))", corners.join(", ")));
    place.write("round.prj", "EPSG:32631");
    for verb in [
        &["grid", "c.las", "o.tif", "--cell", "2"][..],
        &["points", "c.las", "o.laz"],
        &["tin", "c.las", "o.ply", "--max-error", "1"],
    ] {
        let run = |memory: u64, clip: bool| {
            let memory = format!("{memory}M");
            let clip = if clip { &["--clip", "round.wkt"][..] } else { &[] };
            let shared = ["-q", "--overwrite", "--threads", "1", "--memory", &memory];
            place.run(&[verb, &shared, clip].concat())
        };
        // Half of it holds the polygons.
        let least = (40..400).find(|memory| run(*memory, false).code == 0).unwrap();
        let short = run(least, true);
        assert_eq!(short.code, 75, "{verb:?} {least}: {}", short.err);
        let told = ["round.wkt", "MiB of polygons", "--memory", "simplify the polygons"];
        assert!(told.iter().all(|word| short.err.contains(word)), "{}", short.err);
        let advised = short.err.split("--memory ").nth(1).unwrap().split('M').next().unwrap();
        let enough = run(advised.parse().unwrap(), true);
        assert_eq!(enough.code, 0, "{verb:?} {advised}: {}", enough.err);
    }
    // What takes more than half of all is refused by itself.
    let told = ["round.wkt", "200001 vertices", "--memory", "simplify"];
    let points = ["points", "c.las", "p.laz", "--clip", "round.wkt", "--memory", "30M"];
    place.fails(&points, 75, &told);
}
