//! `demo --methods`: the picture, and a table that says what `tin --method` and `verify` say.

use crate::cli_support::Place;
use serde_json::Value;

fn told(place: &Place, args: &[&str]) -> Value {
    let ran = place.ok(&[args, &["--json"]].concat());
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{args:?}: {e}: {}", ran.out))
}

/// The grid, its report, and where the files of the comparison are.
fn compared(place: &Place) -> (Value, String) {
    let report = told(place, &["demo", "--methods", "--dir", "d"]);
    let terrain = report["terrain"].as_str().unwrap().to_owned();
    assert_eq!(terrain, place_name("terrain.tif"));
    (report, terrain)
}

fn place_name(file: &str) -> String {
    std::path::Path::new("d").join("methods").join(file).to_str().unwrap().to_owned()
}

#[test]
fn the_table_says_what_tin_and_verify_do() {
    let place = Place::new();
    let (report, terrain) = compared(&place);
    let rows = report["methods"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    assert_eq!(names, ["greedy", "greedy --fit-heights", "collapse", "kdtree", "rtin", "vip"]);
    for (name, row) in names.iter().zip(rows) {
        let way: Vec<&str> = format!("--method {name}").leak().split(' ').collect();
        let goal = ["--max-error", "2", "--overwrite"];
        let made = told(&place, &[&["tin", &terrain, "o.ply"], &goal[..], &way].concat());
        for count in ["vertices", "triangles"] {
            assert_eq!(row[count], made[count], "{name}");
        }
        let mesh = row["mesh"].as_str().unwrap();
        assert_eq!(
            std::fs::read(place.path(mesh)).unwrap(),
            std::fs::read(place.path("o.ply")).unwrap()
        );
        let proof = told(&place, &["verify", mesh, &terrain, "--max-error", "2"]);
        assert_eq!([&row["max_error"], &row["rmse"]], [&proof["max_error"], &proof["rmse"]]);
        assert_eq!([&row["passed"], &proof["passed"]], [&Value::Bool(true); 2], "{name}: {proof}");
    }
    let stored = std::fs::read_to_string(place.path(&place_name("report.json"))).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&stored).unwrap(), report);
}

#[test]
fn the_picture_is_there_and_the_table_has_every_panel() {
    let place = Place::new();
    let ran = place.ok(&["demo", "--methods", "--dir", "d"]);
    let file = std::fs::File::open(place.path(&place_name("methods.png"))).unwrap();
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    // Three by two panels of 480 pixels with two lines of 24 below, and 16 around them.
    let size = (16 + 3 * (480 + 16), 16 + 2 * (480 + 48 + 16));
    assert_eq!((reader.info().width, reader.info().height), size);
    assert!(ran.out.contains("proved for every mesh"), "{}", ran.out);
    let report = std::fs::read_to_string(place.path(&place_name("report.json"))).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    for row in report["methods"].as_array().unwrap() {
        let name = format!("  {} ", row["method"].as_str().unwrap());
        let line = ran.out.lines().find(|line| line.starts_with(&name)).unwrap();
        let counts = [&row["vertices"], &row["triangles"]].map(|n| grouped(n.as_u64().unwrap()));
        assert!(counts.iter().all(|count| line.contains(count)), "{row} in\n{}", ran.out);
    }
    assert_eq!(place.ok(&["demo", "--methods", "--dir", "d", "--quiet"]).out, "");
}

/// As people write numbers below a million.
fn grouped(n: u64) -> String {
    if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) }
}
