//! Lines at the limits of what they are: of one vertex, with values of several lines, with coordinates that
//! no product holds; and what is refused at the door.

use std::path::Path;

use terrane::ErrorKind;
use terrane_engine::{Cancel, Resources, Silent};
use terrane_line::METHODS;
use terrane_line::registry::ToleranceKind;
use terrane_proof::lines::{self, LineQuestion, ProofDistance};
use terrane_simplify::{Length, LineGoal, LineJob, LineReport, Topology, run};
use terrane_terrain::contour::{self, ContourJob, ContourOptions};
use terrane_vector::{
    self as vector, FORMATS, Feature, GeometryType, PropertyValue, VectorOpenOptions,
};
use terrane_verify::{LineVerifyJob, verify_lines};

fn resources() -> Resources {
    Resources { threads: 1, memory: 1 << 30, temp_dir: None }
}

fn length(value: f64) -> LineGoal {
    LineGoal::Tolerance(Length { value, unit: None })
}

fn job(input: &Path, output: &Path, goal: LineGoal) -> LineJob {
    LineJob { overwrite: true, resources: resources(), ..LineJob::new(input, output, goal) }
}

fn made(job: &LineJob) -> terrane::Result<LineReport> {
    run(job, &Silent, &Cancel::default())
}

fn read(path: &Path) -> (Vec<Feature>, Vec<String>) {
    let mut source = vector::open(path, &VectorOpenOptions::default()).unwrap();
    let all = std::iter::from_fn(|| source.next().unwrap()).collect();
    (all, source.notes())
}

fn proof(lines: &Path, original: &Path, topology: bool) -> LineVerifyJob {
    LineVerifyJob {
        lines: lines.into(),
        original: original.into(),
        layer: None,
        tolerance: Some(Length { value: 0.1, unit: None }),
        is_space: false,
        topology,
        may_drop: false,
        sides: None,
        resources: resources(),
    }
}

/// Vertices of each part or point.
fn counts(features: &[Feature]) -> Vec<usize> {
    let leaves = features.iter().flat_map(|feature| feature.geometry.leaves());
    let of = |leaf: &vector::Geometry| -> Vec<usize> {
        match leaf.kind().is_points() {
            true => vec![leaf.vertices()],
            false => leaf.parts().map(|part| part.xy.len()).collect(),
        }
    };
    let mut all: Vec<usize> = leaves.flat_map(of).collect();
    all.sort_unstable();
    all
}

#[test]
fn lines_of_one_vertex_stay_in_every_format_by_every_method() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let wkt = "LINESTRING (3 4)\nMULTILINESTRING ((0 0,1 0.01,2 0),(3 4))\n";
    std::fs::write(path("a.wkt"), wkt).unwrap();
    let mut inputs = Vec::new();
    let formats: Vec<_> = FORMATS.iter().filter(|format| format.create.is_some()).collect();
    for format in &formats {
        let input = path("a").with_extension(format.extensions[0]);
        if format.name != "WKT" {
            made(&job(&path("a.wkt"), &input, LineGoal::Ratio(1.0))).unwrap();
        }
        inputs.push(input);
    }
    for input in &inputs {
        // A table of vertices does not tell the first line from a point.
        let lone = if input.extension().unwrap() == "csv" { 1 } else { 2 };
        let (found, notes) = read(input);
        assert_eq!(counts(&found), [1, 1, 3], "{input:?}");
        let told = format!("{lone} lines have a single vertex and are kept");
        assert!(notes.contains(&told), "{input:?}: {notes:?}");
        for method in METHODS {
            for topology in [None, Some(Topology::default())] {
                let goal = match method.bounds {
                    ToleranceKind::Distance => length(0.1),
                    ToleranceKind::Area(_) => LineGoal::Area(0.1),
                };
                for goal in [goal, LineGoal::Ratio(0.9), LineGoal::Ratio(1.0)] {
                    let output = path("b.geojson");
                    let job =
                        LineJob { method, topology: topology.clone(), ..job(input, &output, goal) };
                    let report = made(&job).unwrap();
                    let kept = if goal == LineGoal::Ratio(1.0) { 3 } else { 2 };
                    let name = format!("{input:?} {} {topology:?} {goal:?}", method.name);
                    assert_eq!(counts(&read(&output).0), [1, 1, kept], "{name}");
                    assert!(report.notes.contains(&told), "{name}: {:?}", report.notes);
                }
            }
        }
        for format in &formats {
            let output = path("b").with_extension(format.extensions[0]);
            if lone == 1 && format.extensions.contains(&"shp") {
                let refused = made(&job(input, &output, length(0.1))).unwrap_err();
                assert!(refused.to_string().contains("points and lines"), "{refused}");
                continue;
            }
            made(&job(input, &output, length(0.1))).unwrap();
            assert_eq!(counts(&read(&output).0), [1, 1, 2], "{input:?} {output:?}");
            for topology in [false, true] {
                let report =
                    verify_lines(&proof(&output, input, topology), &Silent, &Cancel::default());
                let report = report.unwrap();
                assert!(report.verdict.passed, "{input:?} {output:?}: {report:?}");
            }
        }
    }
}

#[test]
fn values_of_several_lines_come_back_from_csv() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let values =
        ["a\nb", "a\r\nb", "\n", "a\n\n#b", " a ", "\"\n\"", "a,\nb\n", "\ra", "x\n1,0,5,5,y"];
    let feature = |value: &str| {
        serde_json::json!({"type": "Feature", "properties": {"s": value, "n\no": 7},
            "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}})
    };
    let write = |name: &str, values: &[&str]| {
        let all: Vec<_> = values.iter().map(|value| feature(value)).collect();
        let all = serde_json::json!({"type": "FeatureCollection", "features": all});
        std::fs::write(path(name), all.to_string()).unwrap();
    };
    write("a.geojson", &values);
    made(&job(&path("a.geojson"), &path("b.csv"), LineGoal::Ratio(1.0))).unwrap();
    let (found, _) = read(&path("b.csv"));
    assert_eq!(found.len(), values.len());
    for (feature, value) in found.iter().zip(values) {
        assert_eq!(
            feature.properties.get("s"),
            Some(&PropertyValue::Text(value.to_owned())),
            "{value:?}"
        );
        assert_eq!(feature.properties.get("n\no"), Some(&PropertyValue::Int(7)), "{value:?}");
    }
    let verdict = |original: &str| {
        let job = proof(&path("b.csv"), &path(original), false);
        verify_lines(&job, &Silent, &Cancel::default()).unwrap().changed_attributes
    };
    assert_eq!(verdict("a.geojson"), 0);
    write("c.geojson", &values.map(|value| value.replace('\n', " ")).each_ref().map(|s| &s[..]));
    assert_eq!(verdict("c.geojson"), 6, "those with a line feed, and not that alone");
}

#[test]
fn rows_with_other_values_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    for (text, others) in [
        ("lon,lat,name\n1,2,a\n3,4,b\n", 1),
        ("id,x,y,name\n7,1,2,a\n7,3,4,a\n7,4,4,b\n7,5,5,c\n8,1,1,b\n", 2),
        ("id,x,y,name\n7,1,2,a\n7,3,4,a \n8,1,1,b\n", 0),
        ("x,y\n1,2\n3,4\n", 0),
    ] {
        std::fs::write(&path, text).unwrap();
        let (_, notes) = read(&path);
        let told = format!("{others} rows have property values that differ");
        assert_eq!(
            notes.iter().any(|note| note.contains("property values that differ")),
            others > 0,
            "{text}"
        );
        assert!(others == 0 || notes.iter().any(|note| note.starts_with(&told)), "{notes:?}");
    }
}

#[test]
fn dates_are_days_of_the_calendar() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("a.wkt"), "POINT (1 2)\n").unwrap();
    for (date, read) in [
        ("20240209", Some(PropertyValue::Date("2024-02-09".to_owned()))),
        ("20240229", Some(PropertyValue::Date("2024-02-29".to_owned()))),
        ("        ", Some(PropertyValue::Null)),
        ("00000000", Some(PropertyValue::Null)),
        ("2024-2-9", None),
        ("20241332", None),
        ("20230229", None),
        ("202402 9", None),
        ("-2024021", None),
        ("2024021", None),
    ] {
        made(&job(&path("a.wkt"), &path("b.shp"), LineGoal::Ratio(1.0))).unwrap();
        // A table of one record with one field.
        let mut table = vec![3, 100, 1, 1, 1, 0, 0, 0, 65, 0, 9, 0];
        table.resize(32, 0);
        table.extend(b"day\0\0\0\0\0\0\0\0D");
        table.resize(48, 0);
        table.push(8);
        table.resize(64, 0);
        table.extend(format!("\r {date:8}\x1a").bytes());
        std::fs::write(path("b.dbf"), table).unwrap();
        for output in ["c.shp", "c.geojson"] {
            let report = made(&job(&path("b.shp"), &path(output), LineGoal::Ratio(1.0)));
            match (&read, report) {
                (Some(value), report) => {
                    report.unwrap();
                    let (found, _) = self::read(&path(output));
                    let found = found[0].properties.get("day").cloned().unwrap_or_default();
                    let is_text = *value != PropertyValue::Null && output == "c.geojson";
                    let text = |value: &PropertyValue| match value {
                        PropertyValue::Date(text) | PropertyValue::Text(text) => text.clone(),
                        other => format!("{other:?}"),
                    };
                    assert_eq!(text(&found), text(value), "{date} {output}");
                    assert_eq!(matches!(found, PropertyValue::Text(_)), is_text, "{date} {output}");
                }
                (None, report) => {
                    let error = report.unwrap_err();
                    assert_eq!(error.kind(), ErrorKind::BadInput, "{date}");
                    let error = error.to_string();
                    for told in ["b.dbf", "record 1", "field \"day\"", date.trim()] {
                        assert!(error.contains(told), "{told}: {error}");
                    }
                }
            }
        }
    }
}

/// `None` where a line is refused, or how many of its vertices are left.
#[test]
fn what_no_product_holds_is_refused_and_never_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let cases: [(&str, f64, Option<usize>); 14] = [
        ("0 0,1e-162 1e-162,2e-162 0", 1e-170, None),
        ("0 0,1e-162 1e-162,2e-162 0", 0.0, None),
        ("0 0,1e-162 1e-162,2e-162 0", 1e-3, Some(2)),
        ("0 0,1e-100 1e-100,2e-100 0", 1e-101, None),
        ("0 0,1e-40 1e-40,2e-40 0", 1e-41, Some(3)),
        ("0 0,1e-40 1e-40,2e-40 0", 1e-39, Some(2)),
        // A segment whose length has no square, and a vertex far from it.
        ("0 0,0 1,1e-162 0", 0.5, Some(3)),
        ("0 0,1e-200 1,1e-170 0", 0.5, Some(3)),
        ("1e308 1e308,-1e308 -1e308,1e308 0", 1.0, None),
        ("1e155 0,2e155 1e155,3e155 0", 1.0, None),
        ("1e80 0,2e80 1e80,3e80 0", 1.0, None),
        ("1e69 0,2e69 1e69,3e69 0", 1.0, Some(3)),
        ("1e69 0,2e69 1e69,3e69 0", 2e69, Some(2)),
        ("0 0,1 1e-300,2 0", 1e-9, Some(2)),
    ];
    for (line, tolerance, left) in cases {
        std::fs::write(path("a.wkt"), format!("LINESTRING ({line})\n")).unwrap();
        for method in METHODS.iter().filter(|method| method.bounds == ToleranceKind::Distance) {
            for topology in [None, Some(Topology::default())] {
                let name = format!("{line} {tolerance} {} {topology:?}", method.name);
                // To be told apart exactly coordinates have to be larger still.
                let is_tiny =
                    line.contains("e-162") || line.contains("e-200") || line.contains("e-300");
                let left = left.filter(|_| topology.is_none() || !is_tiny);
                let job = job(&path("a.wkt"), &path("b.wkt"), length(tolerance));
                let report = made(&LineJob { method, topology, ..job });
                match left {
                    Some(left) => {
                        report.unwrap();
                        assert_eq!(counts(&read(&path("b.wkt")).0), [left], "{name}");
                    }
                    None => {
                        let error = report.unwrap_err();
                        assert_eq!(error.kind(), ErrorKind::BadInput, "{name}: {error}");
                    }
                }
            }
        }
        // What is not measured is copied.
        let is_large = ["e308", "e155", "e80"].iter().any(|large| line.contains(large));
        let copied = made(&job(&path("a.wkt"), &path("b.wkt"), LineGoal::Ratio(1.0)));
        assert_eq!(copied.is_err(), is_large, "{line}");
        let length = Length { value: tolerance, unit: None };
        let proof = proof(&path("a.wkt"), &path("a.wkt"), false);
        let proof = LineVerifyJob { tolerance: Some(length), ..proof };
        let proved = verify_lines(&proof, &Silent, &Cancel::default());
        assert_eq!(proved.is_err(), left.is_none() && !line.contains("e80"), "{line} {tolerance}");
    }
}

#[test]
fn bytes_that_are_not_utf_8_are_refused_wherever_they_are_in_gpx() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gpx");
    let all = "<?xml version=\"1.0\"?><!--Z--><gpx version=\"1.1\" creator=\"Z\"><?x Z?><metadata a=\"Z\">\
               <name>Z</name></metadata><trk><name>Z</name><xZ yZ=\"1\"/><trkseg><trkpt lat=\"1\" lon=\"2\"/>\
               <trkpt lat=\"2\" lon=\"3\" z=\"Z\"><cmt><![CDATA[Z]]></cmt></trkpt></trkseg></trk></gpx>";
    let places: Vec<usize> = all.match_indices('Z').map(|(at, _)| at).collect();
    for bad in places.iter().copied().chain([9]) {
        let mut bytes = all.as_bytes().to_vec();
        bytes[bad] = 0xff;
        std::fs::write(&path, bytes).unwrap();
        let error = vector::open(&path, &VectorOpenOptions::default()).and_then(|mut source| {
            while source.next()?.is_some() {}
            Ok(())
        });
        let error = error.unwrap_err().to_string();
        assert!(error.contains("a.gpx") && error.to_lowercase().contains("utf"), "{bad}: {error}");
    }
}

#[test]
fn goals_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("a.wkt"), "LINESTRING (0 0,1 1,2 0)\n").unwrap();
    for value in [f64::NAN, -1.0, f64::INFINITY] {
        for goal in [length(value), LineGoal::Area(value), LineGoal::Ratio(value)] {
            let method = if matches!(goal, LineGoal::Area(_)) { &METHODS[3] } else { &METHODS[0] };
            let error = made(&LineJob { method, ..job(&path("a.wkt"), &path("b.wkt"), goal) });
            assert_eq!(error.unwrap_err().kind(), ErrorKind::Usage, "{goal:?}");
        }
    }
}

#[test]
fn measures_stay_with_shared_borders() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let all = "POLYGON M ((0 0 1,10 0 2,10 5 3,10.1 7 4,10 10 5,0 10 6,0 0 1))\n\
               POLYGON M ((10 0 7,20 0 8,20 10 9,10 10 10,10.1 7 11,10 5 12,10 0 7))\n";
    std::fs::write(path("a.wkt"), all).unwrap();
    let job = LineJob {
        topology: Some(Topology::default()),
        ..job(&path("a.wkt"), &path("b.wkt"), length(0.5))
    };
    made(&job).unwrap();
    let found = std::fs::read_to_string(path("b.wkt")).unwrap();
    assert_eq!(
        found,
        "POLYGON M ((0 0 1,10 0 2,10 10 5,0 10 6,0 0 1))\n\
         POLYGON M ((10 0 7,20 0 8,20 10 9,10 10 10,10 0 7))\n"
    );
}

#[test]
fn the_system_of_topojson_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.topojson");
    let all = r#"{"type":"Topology","crs":{"type":"name","properties":{"name":"EPSG:28992"}},
        "arcs":[[[3,4],[5,6]]],"objects":{"a":{"type":"LineString","arcs":[0]}}}"#;
    std::fs::write(&path, all).unwrap();
    let source = vector::open(&path, &VectorOpenOptions::default()).unwrap();
    assert_eq!(source.layer().crs.epsg, Some(28992));
}

/// Contours of rough ground, rounded until lines would meet.
#[test]
fn contours_do_not_cross_as_they_are_rounded() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut dice = 7_u64;
    let mut rough = || {
        dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (dice >> 40) as f64 / 2e6
    };
    let rows =
        (0..40).map(|_| (0..40).map(|_| format!("{:.3} ", rough())).collect::<String>() + "\n");
    let head = "ncols 40\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 1\n";
    std::fs::write(path("a.asc"), head.to_owned() + &rows.collect::<String>()).unwrap();
    let interval = Some(1.0);
    let mut options = ContourOptions::default();
    (options.interval, options.resources) = (interval, resources());
    let input = path("a.asc").to_str().unwrap().into();
    let job = ContourJob { input, output: path("a.geojson"), options };
    contour::run(&job, &Silent, &Cancel::default()).unwrap();
    let mut told = 0;
    for decimals in [0, 1, 2] {
        let job = LineJob {
            topology: Some(Topology::default()),
            decimals: Some(decimals),
            ..self::job(&path("a.geojson"), &path("b.geojson"), length(0.2))
        };
        let report = made(&job).unwrap();
        assert_eq!(report.input_crossings, 0);
        told += report.unrounded;
        let (found, _) = read(&path("b.geojson"));
        let (mut points, mut starts, mut closed) = (Vec::new(), vec![0], Vec::new());
        for part in found.iter().flat_map(|feature| feature.geometry.parts()) {
            assert_ne!(part.role, vector::PartRole::Hole);
            let mut xy = part.xy.to_vec();
            xy.dedup();
            points.extend(xy.iter().map(|[x, y]| [*x, *y, 0.0]));
            starts.push(points.len());
            closed.push(xy.first() == xy.last());
        }
        let lines = lines::ProofLines { points: &points, starts: &starts, closed: &closed };
        let (original, simplified) = (lines, lines);
        let distance = ProofDistance::Plane;
        let question =
            LineQuestion { original, simplified, points: &[], distance, tolerance: None };
        let report = lines::check(&question).unwrap();
        assert_eq!((report.crossings, report.original_crossings), (0, 0), "{decimals}: {report:?}");
        assert!(found.iter().all(|feature| feature.geometry.kind() != GeometryType::Null));
    }
    assert!(told > 0, "nothing was in the way");
}
