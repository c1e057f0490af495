//! `terrane grid` of attributes, of some of the points, and into tables: against the points as text.

use std::collections::BTreeMap;

use crate::cli_support::{Place, json};

/// A table: the names of its columns, and its lines.
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// Of text, whose names in quotes have no comma where they are asked for.
    fn of(text: &str) -> Self {
        let mut lines = text.lines();
        let names = lines.next().unwrap().replace('"', "").split(',').map(str::to_owned).collect();
        let number = |cell: &str| if cell.is_empty() { f64::NAN } else { cell.parse().unwrap() };
        Self { names, rows: lines.map(|line| line.split(',').map(number).collect()).collect() }
    }

    fn read(place: &Place, name: &str) -> Self {
        Self::of(&std::fs::read_to_string(place.path(name)).unwrap())
    }

    fn column(&self, name: &str) -> usize {
        self.names.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}"))
    }
}

/// A point with its attributes by name.
type Named<'a> = &'a dyn Fn(&str) -> f64;

/// Statistics by name, and what they are of the values of which points.
type Twin = (&'static str, fn(Named<'_>) -> Option<f64>, fn(Vec<f64>) -> f64);

fn mean(values: Vec<f64>) -> f64 {
    let base = values.first().copied().unwrap_or(f64::NAN);
    base + values.iter().map(|value| value - base).sum::<f64>() / values.len() as f64
}

fn most(values: Vec<f64>) -> f64 {
    values.into_iter().fold(f64::NAN, f64::max)
}

fn count(values: Vec<f64>) -> f64 {
    values.len() as f64
}

fn mode(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let often = |value: f64| values.iter().filter(|other| **other == value).count();
    let best = values.iter().map(|value| often(*value)).max();
    values.iter().copied().find(|value| Some(often(*value)) == best).unwrap_or(f64::NAN)
}

const TWINS: &[Twin] = &[
    ("max:attribute=intensity", |p| Some(p("intensity")), most),
    ("mean:attribute=angle", |p| Some(p("scan_angle")), mean),
    ("mean:attribute=time", |p| Some(p("gps_time")), mean),
    ("max:attribute=source", |p| Some(p("point_source_id")), most),
    ("mean:attribute=red", |p| Some(p("red")), mean),
    ("mean:attribute=returns", |p| Some(p("number_of_returns")), mean),
    ("mean:attribute=overlap", |p| Some(p("overlap")), mean),
    ("mode", |p| Some(p("classification")), mode),
    ("count:class=5", |p| (p("classification") == 5.0).then_some(0.0), count),
    ("count:return=last", |p| (p("return_number") >= p("number_of_returns")).then_some(0.0), count),
    ("max:class=2", |p| (p("classification") == 2.0).then(|| p("z")), most),
    ("share:class=2", |p| Some(f64::from(p("classification") == 2.0)), mean),
    ("cover:above=230", |p| (p("return_number") == 1.0).then(|| f64::from(p("z") > 230.0)), mean),
];

#[test]
fn attributes_are_those_of_the_points_as_text() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=3,seed=5", "c.laz", "--point-format", "8"]);
    place.ok(&["points", "c.laz", "points.csv", "-q"]);
    let list = TWINS.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(",");
    let grid = |input: &str, output: &str, more: &[&str]| {
        let args =
            ["grid", input, output, "--cell", "4", "--stat", &list, "--type", "float64", "-q"];
        place.ok(&[&args[..], more].concat());
        std::fs::read_to_string(place.path(output)).unwrap()
    };
    let text = grid("c.laz", "t.csv", &[]);
    let (points, table) = (Table::read(&place, "points.csv"), Table::of(&text));
    let column = |name: &str| points.column(name);
    let [x, y] = ["x", "y"].map(column);
    let mut cells: BTreeMap<[i64; 2], Vec<&Vec<f64>>> = BTreeMap::new();
    // Files of points keep those that are marked as withheld.
    for point in points.rows.iter().filter(|point| point[column("withheld")] == 0.0) {
        let at = [point[x], point[y]].map(|v| (v / 4.0 + 1e-9).floor() as i64);
        cells.entry(at).or_default().push(point);
    }
    assert!(cells.len() > 150 && table.rows.len() == cells.len());
    for row in &table.rows {
        let own = &cells[&[row[0], row[1]].map(|v| (v / 4.0).floor() as i64)];
        for (at, (name, value, of)) in (2..).zip(TWINS) {
            let values = own.iter().filter_map(|point| value(&|name| point[column(name)]));
            let expected = of(values.collect());
            let (found, slack) = (row[at], 1e-6 * expected.abs().max(1.0));
            let is = found.is_nan() && expected.is_nan() || (found - expected).abs() <= slack;
            assert!(is, "{name} at {}, {}: {found} {expected}", row[0], row[1]);
        }
    }
    // The same of any file, whoever does it in whatever memory.
    place.ok(&["points", "c.laz", "c.las", "-q"]);
    place.ok(&["points", "c.laz", "c.copc.laz", "-q"]);
    for (number, (input, more)) in [
        ("c.las", &["--threads", "1"][..]),
        ("c.copc.laz", &["--threads", "3"]),
        ("c.laz", &["--memory", "64M", "--threads", "1"]),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!(grid(input, &format!("t{number}.csv"), more), text, "{input}");
    }
    let plan = ["plan", "grid", "c.laz", "-o", "work", "--cell", "4", "--stat", &list];
    place.ok(&[&plan[..], &["--type", "float64", "-f", "CSV", "-q"]].concat());
    place.ok(&["run", "work", "-o", "planned.csv", "-q"]);
    assert_eq!(std::fs::read_to_string(place.path("planned.csv")).unwrap(), text);
    // A cloud that is made by rule has what files of it have.
    let named = grid("synth:cloud,size=60,density=3,seed=5", "named.csv", &[]);
    assert_eq!(named, text);
}

#[test]
fn filters_of_the_cloud_come_before_those_of_statistics() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=40,density=3,seed=6", "c.laz"]);
    let grid = |output: &str, stat: &str, more: &[&str]| {
        let args = ["grid", "c.laz", output, "--cell", "5", "--stat", stat, "-q"];
        place.ok(&[&args[..], more].concat());
        let text = std::fs::read_to_string(place.path(output)).unwrap();
        text.split_once('\n').unwrap().1.to_owned()
    };
    let filtered = grid("a.csv", "mean,count", &["--class", "2", "--return", "last"]);
    let both = grid("b.csv", "mean:class=2,count:class=2", &["--return", "last"]);
    let own = grid("c.csv", "mean:class=2+2,return=last,count:return=last,class=2", &[]);
    assert!(filtered.lines().count() > 20);
    assert_eq!((&both, &own), (&filtered, &filtered));
    let none = grid("d.csv", "mean:class=2,count:class=2", &["--class", "5"]);
    assert_eq!(none, "");
    // Points in no cell are those of the cloud, whatever the statistics are of.
    let outside = |stat: &str| {
        let args =
            ["grid", "c.laz", "o.tif", "--cell", "5", "--stat", stat, "--overwrite", "--json"];
        let cells = ["--bbox", "500010,4750010,500025,4750025"];
        json(&place.ok(&[&args[..], &cells].concat()).out)["outside_grid"].as_u64().unwrap()
    };
    assert!(outside("count") > 1000);
    assert_eq!(outside("count:class=2,max:above=300"), outside("count"));
}

/// A LAS 1.2 file of points of format 0 in a square, in whole units, with extra bytes: a gain of one byte in
/// halves, of which 255 is none, and a double.
fn with_extra_bytes(points: &[(i32, u8, f64)]) -> Vec<u8> {
    let mut file = b"LASF".to_vec();
    let at_points = 227_u32 + 54 + 2 * 192;
    file.resize(at_points as usize, 0);
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(24, &[1, 2]);
    put(94, &227_u16.to_le_bytes());
    put(96, &at_points.to_le_bytes());
    put(100, &1_u32.to_le_bytes());
    put(105, &29_u16.to_le_bytes());
    put(107, &(points.len() as u32).to_le_bytes());
    let doubles = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 99.0, 0.0, 0.0, 0.0, 9.0, 0.0];
    for (i, value) in doubles.into_iter().enumerate() {
        put(131 + 8 * i, &f64::to_le_bytes(value));
    }
    put(229, b"LASF_Spec");
    put(245, &4_u16.to_le_bytes());
    put(247, &(2 * 192_u16).to_le_bytes());
    let [gain, bias] = [281, 281 + 192];
    put(gain + 2, &[1, 1 | 8]);
    put(gain + 4, b"Gain");
    put(gain + 40, &255_u64.to_le_bytes());
    put(gain + 112, &0.5_f64.to_le_bytes());
    put(bias + 2, &[10, 0]);
    put(bias + 4, b"Range Bias");
    for (x, gain, bias) in points {
        for value in [*x, 0, 5] {
            file.extend(value.to_le_bytes());
        }
        file.extend([0, 0, 0b0000_1001, 2, 0, 0, 0, 0, *gain]);
        file.extend(bias.to_le_bytes());
    }
    file
}

#[test]
fn extra_bytes_are_known_by_name_and_what_is_none_is_left_out() {
    let place = Place::new();
    let points =
        [(0, 4, 1e300), (1, 255, -2.5), (2, 7, f64::NAN), (10, 255, 0.1), (20, 0, f64::INFINITY)];
    place.write("e.las", with_extra_bytes(&points));
    let stat = "mean:attribute=GAIN,variety:attribute=gain,min:attribute=Range Bias,\
                max:attribute=range bias,count";
    place.ok(&["grid", "e.las", "e.csv", "--cell", "10", "--stat", stat, "--type", "float64"]);
    let text = std::fs::read_to_string(place.path("e.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "x,y,mean:attribute=gain,variety:attribute=gain,min:attribute=range bias,max:attribute=range bias,count"
        )
    );
    let high = format!("{}", 1e300);
    let expected = [
        format!("5,5,2.75,2,-2.5,{high},3"),
        "15,5,,0,0.1,0.1,1".to_owned(),
        "25,5,0,1,,,1".to_owned(),
    ];
    assert_eq!(lines.collect::<Vec<_>>(), expected);
}

#[test]
fn what_points_do_not_have_is_refused_by_file_and_name() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=20,density=2,seed=6", "old.las", "--point-format", "0"]);
    place.ok(&["synth", "cloud,size=20,density=2,seed=6", "new.laz", "--point-format", "6"]);
    place.write("a.xyz", "x y z\n0 0 1\n1 1 2\n");
    let refused = |inputs: &[&str], stat: &str, words: &[&str]| {
        let more = ["o.tif", "--cell", "1", "--stat", stat];
        place.fails(&[&["grid"], inputs, &more].concat(), 2, words);
        let plan = ["-o", "work", "--cell", "1", "--stat", stat];
        place.fails(&[&["plan", "grid"], inputs, &plan].concat(), 2, words);
    };
    refused(&["old.las"], "mean:attribute=time", &["old.las", "\"gps_time\"", "intensity"]);
    refused(&["new.laz", "old.las"], "max:attribute=red", &["\"red\"", "return_number"]);
    refused(&["new.laz"], "max:attribute=Amplitude", &["new.laz", "\"amplitude\"", "gps_time"]);
    refused(&["a.xyz"], "max:attribute=intensity", &["a.xyz", "\"intensity\"", "classification"]);
    refused(&["new.laz"], "tin:class=2", &["\"class=2\" is not a parameter of tin"]);
    refused(&["new.laz"], "idw:attribute=time", &["idw is not supported for gps_time"]);
    refused(&["new.laz"], "max:class=300", &["\"class=300\"", "class=CODES"]);
    assert!(place.files().iter().all(|name| !name.starts_with("o.") && name != "work"));
    // Classes and returns are known of any cloud.
    place.ok(&["grid", "a.xyz", "o.tif", "--cell", "1", "--stat", "mode,count:return=1"]);
}

/// Heights above the ground are a dimension, or take the place of z.
#[test]
fn heights_above_the_ground_are_gridded_by_either_way() {
    let place = Place::new();
    place.ok(&["synth", "cloud,size=60,density=4,seed=8", "c.laz"]);
    place.ok(&["points", "c.laz", "d.laz", "--height-above-ground", "-q"]);
    place.ok(&["points", "c.laz", "z.laz", "--height-above-ground=z", "-q"]);
    let grid = |input: &str, output: &str, stat: &str| {
        let args =
            ["grid", input, output, "--cell", "5", "--stat", stat, "--type", "float64", "-q"];
        place.ok(&args);
        Table::read(&place, output).rows
    };
    let of = ":attribute=HeightAboveGround";
    let list = ["mean", "max", "std", "p90", "skewness"];
    let by_dimension = grid("d.laz", "d.csv", &list.map(|name| format!("{name}{of}")).join(","));
    let as_z = grid("z.laz", "z.csv", &list.join(","));
    assert!(as_z.len() > 100 && by_dimension.len() == as_z.len());
    for (one, other) in by_dimension.iter().zip(&as_z) {
        let is_near = |(a, b): (&f64, &f64)| a.is_nan() && b.is_nan() || (a - b).abs() < 1e-6;
        assert!(one.iter().zip(other).all(is_near), "{one:?} {other:?}");
    }
    let cover = grid("z.laz", "e.csv", "cover,share:max=0.5,entropy,count");
    let within = |row: &Vec<f64>| row[2..5].iter().all(|v| v.is_nan() || (0.0..=1.0).contains(v));
    assert!(cover.iter().all(within) && cover.iter().any(|row| row[2] > 0.2 && row[2] < 0.9));
}

#[test]
fn tables_hold_what_grids_do_and_appear_whole() {
    let place = Place::new();
    place.write("a.xyz", "x y z\n0.25 0.25 1.5\n0.75 0.25 2\n5.5 0.25 -3\n5.5 3.75 7\n");
    let stat = "mean,idw:radius=0.4,power=2,count";
    let grid = |output: &str, more: &[&str]| {
        let args = ["grid", "a.xyz", output, "--cell", "0.5", "--stat", stat, "--json"];
        place.ok(&[&args[..], more].concat()).out
    };
    let report = json(&grid("t.csv", &["--crs", "EPSG:32631"]));
    assert_eq!((&report["format"], &report["cells"]), (&"CSV".into(), &(12 * 8).into()));
    let text = std::fs::read_to_string(place.path("t.csv")).unwrap();
    let expected = "x,y,mean,\"idw:radius=0.4,power=2\",count\n5.25,3.75,,7,0\n5.75,3.75,7,7,1\n\
                    0.25,0.25,1.5,1.5,1\n0.75,0.25,2,2,1\n5.25,0.25,,-3,0\n5.75,0.25,-3,-3,1\n";
    assert_eq!(text, expected);
    assert!(std::fs::read_to_string(place.path("t.prj")).unwrap().contains("UTM"));
    let args = ["grid", "a.xyz", "t.csv", "--cell", "0.5"];
    place.fails(&args, 2, &["t.csv", "--overwrite"]);
    place
        .ok(&[&args[..], &["--overwrite", "--stat", "max", "--type", "int16", "--round"]].concat());
    let text = std::fs::read_to_string(place.path("t.csv")).unwrap();
    assert!(text.starts_with("x,y,max\n5.75,3.75,7\n0.25,0.25,2\n"), "{text}");
    place.fails(
        &["grid", "a.xyz", "u.csv", "--cell", "0.5", "--stat", "max", "--type", "int16"],
        65,
        &["u.csv", "1.5", "--round"],
    );
    let with = [&args[..2], &["u.csv"], &args[3..]].concat();
    place.fails(
        &[&with[..], &["--nodata", "-1"]].concat(),
        2,
        &["--nodata is not supported", "CSV"],
    );
    place.ok(&["grid", "a.xyz", "a.tif", "--cell", "0.5", "-q"]);
    let convert = ["convert", "a.tif", "u.csv"];
    place.fails(
        &[&convert[..], &["--out-nodata", "0"]].concat(),
        2,
        &["--out-nodata is not supported"],
    );
    assert!(!place.path("u.csv").exists());
    place.ok(&convert);
    let text = std::fs::read_to_string(place.path("u.csv")).unwrap();
    assert_eq!(text, "x,y,z\n5.75,3.75,7\n0.25,0.25,1.5\n0.75,0.25,2\n5.75,0.25,-3\n");
}
