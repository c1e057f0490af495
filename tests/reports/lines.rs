//! Reports on lines and polygons.

use std::collections::BTreeMap;

use crate::cli_support::{Place, json};

/// Positions of rings or lines, in the order of a WKT text.
fn parts(wkt: &str) -> Vec<Vec<[f64; 2]>> {
    let vertex = |text: &str| -> [f64; 2] {
        let numbers: Vec<f64> = text.split_whitespace().map(|c| c.parse().unwrap()).collect();
        [numbers[0], numbers[1]]
    };
    let texts = wkt.split(['(', ')']).filter(|text| text.contains(|c: char| c.is_ascii_digit()));
    texts.map(|text| text.split(',').map(vertex).collect()).collect()
}

/// How often each segment is there, whichever way round.
fn segments(wkt: &str) -> BTreeMap<[[u64; 2]; 2], usize> {
    let key = |p: [f64; 2]| p.map(|c| (c + 0.0).to_bits());
    let mut all = BTreeMap::new();
    for part in parts(wkt) {
        for pair in part.windows(2) {
            let [a, b] = [key(pair[0]), key(pair[1])];
            *all.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    all
}

fn area(ring: &[[f64; 2]]) -> f64 {
    ring.windows(2).map(|p| p[0][0] * p[1][1] - p[1][0] * p[0][1]).sum::<f64>() / 2.0
}

fn text(place: &Place, name: &str) -> String {
    std::fs::read_to_string(place.path(name)).unwrap()
}

/// Simplifies a coverage, has the result proved, and returns it.
fn proved(place: &Place, wkt: &str, goal: &[&str]) -> String {
    place.write("a.wkt", wkt);
    let base = ["line", "a.wkt", "b.wkt", "--topology", "--overwrite", "-q"];
    place.ok(&[&base[..], goal].concat());
    let tolerance = if goal[0] == "--tolerance" { &goal[..2] } else { &[] };
    let proof = place.run(&[&["verify", "b.wkt", "a.wkt", "--topology"][..], tolerance].concat());
    // Without a tolerance distances are not judged.
    let code = if tolerance.is_empty() { 3 } else { 0 };
    assert_eq!(proof.code, code, "{}{}", proof.out, proof.err);
    text(place, "b.wkt")
}

#[test]
fn c1_a_hole_filled_by_two_polygons_stays_filled() {
    let place = Place::new();
    let all = "POLYGON((200 300,300 300,300 100,100 100,100 300,200 300),(170 220,170 160,200 140,\
               200 250,170 220),(170 250,200 250,200 300,170 250))\n\
               POLYGON((170 220,200 250,200 140,170 160,170 220))\n\
               POLYGON((170 250,200 300,200 250,170 250))\n";
    for method in ["cone", "rdp", "imai-iri"] {
        let found = proved(&place, all, &["--tolerance", "100", "--method", method]);
        let rings = parts(&found);
        assert_eq!(rings.len(), 5, "{found}");
        let segments = segments(&found);
        // Every side of what fills the holes is there twice: once in the hole.
        let lone = segments.values().filter(|count| **count == 1).count();
        assert_eq!(lone, rings[0].len() - 1, "{found}");
    }
}

#[test]
fn c2_two_holes_that_touch_keep_their_point() {
    let place = Place::new();
    let (one, two) = (
        "(4 5,12 5,12 6,10 6,10 8,9 8,9 9,7 9,7 8,6 8,6 6,4 6,4 5)",
        "(12 6,14 6,14 9,13 9,13 7,12 7,12 6)",
    );
    let all =
        format!("POLYGON((0 0,0 11,19 11,19 0,0 0),{one},{two})\nPOLYGON({one})\nPOLYGON({two})\n");
    let found = proved(&place, &all, &["--tolerance", "1"]);
    let with_point = parts(&found).iter().filter(|ring| ring.contains(&[12.0, 6.0])).count();
    assert_eq!(with_point, 4, "{found}");
    assert!(segments(&found).values().filter(|count| **count == 1).count() <= 4, "{found}");
}

#[test]
fn c3_c4_a_hole_stays_inside_of_its_shell() {
    let place = Place::new();
    let cases = [
        ("POLYGON((3 15,6 10,1 3,5 2,0 0,3 15),(4 13,3 14,3 13,4 13))\n", "10"),
        ("POLYGON((0 0,2 0,2.2 1,2 2,0 2,0 0),(2.1 .9,2.15 1,2.1 1.1,2.1 .9))\n", "2"),
    ];
    for (all, tolerance) in cases {
        for collapse in ["minimal", "drop", "keep"] {
            place.write("a.wkt", all);
            let base = ["line", "a.wkt", "b.wkt", "--tolerance", tolerance, "--overwrite", "-q"];
            place.ok(&[&base[..], &["--topology", "--collapse", collapse]].concat());
            let found = text(&place, "b.wkt");
            let rings = parts(&found);
            let signs = |all: &str| -> Vec<bool> {
                parts(all).iter().map(|ring| area(ring) > 0.0).collect()
            };
            assert!(signs(all).starts_with(&signs(&found)), "{collapse}: {found}");
            if collapse != "drop" {
                assert_eq!(rings.len(), 2, "{collapse}: {found}");
                let verify = ["verify", "b.wkt", "a.wkt", "--topology", "--tolerance", tolerance];
                place.ok(&verify);
            }
        }
    }
    // Without topology verify tells of what crosses.
    place.write("a.wkt", cases[1].0);
    place.ok(&["line", "a.wkt", "b.wkt", "--tolerance", "0.3", "--overwrite", "-q"]);
    let ran = place.run(&["verify", "b.wkt", "a.wkt", "--topology", "--tolerance", "0.3"]);
    let crosses = !text(&place, "b.wkt").contains("2.2 1");
    assert_eq!(ran.code == 1, crosses, "{}{}", ran.out, ran.err);
}

#[test]
fn c5_the_start_of_a_ring_makes_no_crossing() {
    let ring = ["1 4", "3 4", "1 1", "7 0", "1 0", "0 1"];
    for turn in 0..ring.len() {
        let place = Place::new();
        let all: Vec<&str> = (0..=ring.len()).map(|i| ring[(turn + i) % ring.len()]).collect();
        let all = format!("POLYGON(({}))\n", all.join(","));
        let goal = ["--area", "2.25", "--method", "visvalingam"];
        let found = proved(&place, &all, &goal);
        let left = parts(&found).remove(0);
        let at = left[1..].iter().filter(|p| **p == [1.0, 1.0]).count();
        assert!(at < 2 && area(&left) != 0.0, "{turn}: {found}");
    }
}

/// A FlatBuffers table with these fields (nothing, bytes of a number, or room for an offset).
fn table(out: &mut Vec<u8>, fields: &[Option<&[u8]>]) -> (usize, Vec<usize>) {
    let list = out.len();
    let count = 4 + 2 * fields.len();
    let table = (list + count).next_multiple_of(8);
    out.resize(table + 4, 0);
    let mut places = Vec::new();
    for (at, field) in fields.iter().enumerate() {
        let Some(bytes) = field else {
            places.push(0);
            continue;
        };
        out.resize(out.len().next_multiple_of(bytes.len().max(1)), 0);
        places.push(out.len());
        let offset = (out.len() - table) as u16;
        out.extend_from_slice(bytes);
        out[list + 4 + 2 * at..][..2].copy_from_slice(&offset.to_le_bytes());
    }
    let size = (out.len() - table) as u16;
    out[list..list + 2].copy_from_slice(&(count as u16).to_le_bytes());
    out[list + 2..list + 4].copy_from_slice(&size.to_le_bytes());
    out[table..table + 4].copy_from_slice(&((table - list) as i32).to_le_bytes());
    (table, places)
}

/// Points an offset at what is appended next.
fn link(out: &mut Vec<u8>, place: usize, align: usize) {
    while !(out.len() + 4).is_multiple_of(align) {
        out.push(0);
    }
    let offset = (out.len() - place) as u32;
    out[place..place + 4].copy_from_slice(&offset.to_le_bytes());
}

/// A buffer behind its size.
fn sized(body: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = vec![0; 8];
    body(&mut out);
    let size = out.len() as u32 - 4;
    out[..4].copy_from_slice(&size.to_le_bytes());
    out
}

const OFFSET: Option<&[u8]> = Some(&[0; 4]);

/// A FlatGeobuf of features of one kind: positions of each geometry, `None` for one without; `count` is
/// what the header says.
fn flatgeobuf(kind: u8, features: &[Option<&[f64]>], count: u64) -> Vec<u8> {
    let mut file = b"fgb\x03fgb\x00".to_vec();
    let count = count.to_le_bytes();
    file.extend(sized(|out| {
        let fields = [None, None, Some(&[kind][..]), None, None, None, None, None];
        let node = 0_u16.to_le_bytes();
        let (root, _) = table(out, &[&fields[..], &[Some(&count), Some(&node)]].concat());
        let offset = (root - 4) as u32;
        out[4..8].copy_from_slice(&offset.to_le_bytes());
    }));
    for xy in features {
        file.extend(sized(|out| {
            let (root, places) = table(out, &[if xy.is_some() { OFFSET } else { None }]);
            let offset = (root - 4) as u32;
            out[4..8].copy_from_slice(&offset.to_le_bytes());
            if let Some(xy) = xy {
                let link_at = places[0];
                let (geometry, places) = table(out, &[None, OFFSET]);
                let offset = (geometry - link_at) as u32;
                out[link_at..link_at + 4].copy_from_slice(&offset.to_le_bytes());
                link(out, places[1], 8);
                out.extend_from_slice(&(xy.len() as u32).to_le_bytes());
                out.extend(xy.iter().flat_map(|c| c.to_le_bytes()));
            }
        }));
    }
    file
}

#[test]
fn c6_flatgeobuf_of_one_part_has_no_ends() {
    let place = Place::new();
    let line: &[f64] = &[0.0, 0.0, 1.0, 1.0, 2.0, 0.0];
    let square: &[f64] = &[0.0, 0.0, 0.0, 9.0, 9.0, 9.0, 9.0, 0.0, 0.0, 0.0];
    // The number of a kind, its geometries, the number that the header tells, and what comes of it.
    type Geometries<'a> = &'a [Option<&'a [f64]>];
    let cases: [(u8, Geometries<'_>, u64, &str); 7] = [
        (5, &[Some(line)], 1, "MULTILINESTRING ((0 0,1 1,2 0))"),
        (6, &[Some(square)], 1, "MULTIPOLYGON (((0 0,0 9,9 9,9 0,0 0)))"),
        (4, &[Some(line)], 1, "MULTIPOINT (0 0,1 1,2 0)"),
        (2, &[Some(line), None, Some(line)], 3, "LINESTRING (0 0,1 1,2 0)"),
        (2, &[Some(&[]), Some(line)], 2, "LINESTRING (0 0,1 1,2 0)"),
        (2, &[], 0, ""),
        (2, &[Some(line), Some(line)], 0, "LINESTRING (0 0,1 1,2 0)"),
    ];
    for (kind, features, count, told) in cases {
        place.write("a.fgb", flatgeobuf(kind, features, count));
        place.ok(&["line", "a.fgb", "b.wkt", "--keep-ratio", "1", "--overwrite", "-q"]);
        let found = text(&place, "b.wkt");
        assert!(found.contains(told), "{kind}: {found}");
        assert_eq!(found.lines().count(), features.len(), "{kind}: {found}");
        place.ok(&["line", "a.fgb", "c.fgb", "--keep-ratio", "1", "--overwrite", "-q"]);
        place.ok(&["line", "c.fgb", "c.wkt", "--keep-ratio", "1", "--overwrite", "-q"]);
        assert_eq!(text(&place, "c.wkt").lines().count(), features.len(), "{kind}");
    }
}

/// A Shapefile of one polygon record with these rings, and nothing beside it.
fn shapefile(rings: &[Vec<[f64; 2]>]) -> Vec<u8> {
    let points: Vec<[f64; 2]> = rings.concat();
    let bound =
        |axis: usize, of: fn(f64, f64) -> f64| points.iter().map(|p| p[axis]).reduce(of).unwrap();
    let bounds = [bound(0, f64::min), bound(1, f64::min), bound(0, f64::max), bound(1, f64::max)];
    let mut record = 5_u32.to_le_bytes().to_vec();
    record.extend(bounds.iter().flat_map(|c| c.to_le_bytes()));
    record.extend([rings.len() as u32, points.len() as u32].map(u32::to_le_bytes).concat());
    let mut start = 0_u32;
    for ring in rings {
        record.extend(start.to_le_bytes());
        start += ring.len() as u32;
    }
    record.extend(points.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
    let words = record.len() as u32 / 2;
    let mut file = 9994_u32.to_be_bytes().to_vec();
    file.resize(24, 0);
    file.extend((54 + words).to_be_bytes());
    file.extend([1000_u32, 5].map(u32::to_le_bytes).concat());
    file.extend(bounds.iter().flat_map(|c| c.to_le_bytes()));
    file.resize(100, 0);
    file.extend([1_u32, words].map(u32::to_be_bytes).concat());
    file.extend(record);
    file
}

/// A square from its lower left corner; shells go clockwise.
fn square(x: f64, y: f64, side: f64, is_shell: bool) -> Vec<[f64; 2]> {
    let mut ring = vec![[x, y], [x, y + side], [x + side, y + side], [x + side, y], [x, y]];
    if !is_shell {
        ring.reverse();
    }
    ring
}

#[test]
fn c7_rings_of_a_shapefile_in_any_order() {
    // Rings, and the areas of the polygons that they are.
    let cases = [
        (vec![square(1.0, 1.0, 2.0, false), square(0.0, 0.0, 9.0, true)], vec![77.0]),
        (
            vec![
                square(1.0, 1.0, 2.0, false),
                square(20.0, 0.0, 9.0, true),
                square(21.0, 1.0, 3.0, false),
                square(0.0, 0.0, 9.0, true),
            ],
            vec![72.0, 77.0],
        ),
        // A hole that goes the wrong way.
        (vec![square(0.0, 0.0, 9.0, true), square(1.0, 1.0, 2.0, true)], vec![77.0]),
        // An island in a lake of an island.
        (
            vec![
                square(3.0, 3.0, 1.0, true),
                square(2.0, 2.0, 4.0, false),
                square(0.0, 0.0, 9.0, true),
            ],
            vec![1.0, 65.0],
        ),
    ];
    for (rings, areas) in cases {
        let place = Place::new();
        place.write("a.shp", shapefile(&rings));
        place.ok(&["line", "a.shp", "b.geojson", "--keep-ratio", "1", "-q"]);
        let found = &json(&text(&place, "b.geojson"))["features"][0]["geometry"];
        let coordinates = found["coordinates"].clone();
        let polygons = match found["type"].as_str() {
            Some("Polygon") => vec![coordinates],
            _ => coordinates.as_array().unwrap().clone(),
        };
        let of_ring = |ring: &serde_json::Value| {
            let ring: Vec<[f64; 2]> = serde_json::from_value(ring.clone()).unwrap();
            area(&ring).abs()
        };
        let of_polygon = |polygon: &serde_json::Value| {
            let rings: Vec<f64> = polygon.as_array().unwrap().iter().map(of_ring).collect();
            rings[0] - rings[1..].iter().sum::<f64>()
        };
        let mut found: Vec<f64> = polygons.iter().map(of_polygon).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found, areas, "{rings:?}");
    }
}

#[test]
fn c8_quotation_marks_and_line_breaks_of_csv() {
    let place = Place::new();
    let head = "id,x,y,\"na\nme\"\n";
    let lines = |name: &str| {
        let ran = place.ok(&["line", name, "-", "-f", "GeoJSON", "--keep-ratio", "1", "-q"]);
        json(&ran.out)["features"].clone()
    };
    for (begin, end) in [("", "\n"), ("\u{feff}", "\n"), ("", "\r\n")] {
        let rows =
            "1,1,2,\"5\"\" pipe\"\n2,3,4,\"a \"\"b\"\" c\"\n3,5,6,\"two\nlines, # not one\"\n";
        let all = format!("{begin}{head}{rows}");
        place.write("a.csv", all.replace('\n', end));
        let found = lines("a.csv");
        let values: Vec<&str> = (0..3)
            .map(|at| found[at]["properties"][&format!("na{end}me")].as_str().unwrap())
            .collect();
        let broken = format!("two{end}lines, # not one");
        assert_eq!(values, ["5\" pipe", "a \"b\" c", &broken], "{begin:?} {end:?}");
    }
    let named = "id,x,y,name\n1,1,2,a\n2,3,4,b\n";
    for (row, told) in [
        ("1,2,3,5\" pipe\n", "inside an unquoted value"),
        ("1,2,3,\"open\n4,5,6,c\n", "not closed"),
        ("1,2,3,\"open\n4,5,6,\"c\"\n", "text after the closing quotation mark"),
    ] {
        place.write("b.csv", format!("{named}{row}"));
        place.fails(&["line", "b.csv", "c.csv", "--keep-ratio", "1"], 65, &["line 4", told]);
    }
    let wide: Vec<u8> = named.encode_utf16().flat_map(u16::to_le_bytes).collect();
    place.write("d.csv", [&[0xff, 0xfe][..], &wide].concat());
    place.fails(&["line", "d.csv", "c.csv", "--keep-ratio", "1"], 65, &["UTF-8"]);
}

#[test]
fn c9_collections_take_part_in_a_coverage() {
    let place = Place::new();
    // Upper and lower counties share a border that bulges by 1.
    let polygon = |x: i32, y: i32| {
        let ring = [[x, y], [x + 10, y], [x + 10, 10], [x + 5, 11], [x, 10], [x, y]];
        format!("{{\"type\":\"Polygon\",\"coordinates\":[{ring:?}]}}").replace(' ', "")
    };
    let sliver = "{\"type\":\"LineString\",\"coordinates\":[[0,10],[5,11],[10,10]]}";
    let collection =
        |all: &str| format!("{{\"type\":\"GeometryCollection\",\"geometries\":[{all}]}}");
    let all = [
        polygon(0, 0),
        polygon(10, 0),
        collection(&format!("{},{sliver}", polygon(0, 20))),
        polygon(10, 20),
        collection(""),
        "null".to_owned(),
    ];
    let feature = |geometry: &String| {
        format!("{{\"type\":\"Feature\",\"properties\":{{}},\"geometry\":{geometry}}}")
    };
    let features: Vec<String> = all.iter().map(feature).collect();
    let all = format!("{{\"type\":\"FeatureCollection\",\"features\":[{}]}}", features.join(","));
    place.write("a.geojson", all);
    place.ok(&["line", "a.geojson", "b.geojson", "--topology", "--tolerance", "2", "-q"]);
    place.ok(&["verify", "b.geojson", "a.geojson", "--topology", "--tolerance", "2"]);
    let found = text(&place, "b.geojson");
    // The bulge is gone from all of them, or from none.
    assert!(!found.contains("[5,11]") && !found.contains("[15,11]"), "{found}");
    assert_eq!(json(&found)["features"].as_array().unwrap().len(), 6);
}

/// Takes half a minute where nothing is optimized.
#[test]
fn c10_a_polygon_of_very_many_rings() {
    let place = Place::new();
    let side = 140;
    let shells = (0..side * side).map(|at| (at, true));
    let holes = (0..side * side).map(|at| (at, false));
    let mut rings: Vec<Vec<[f64; 2]>> = shells
        .chain(holes)
        .map(|(at, is_shell)| {
            let [x, y] = [at % side, at / side].map(|c| f64::from(c) * 10.0);
            if is_shell { square(x, y, 5.0, true) } else { square(x + 1.0, y + 1.0, 2.0, false) }
        })
        .collect();
    // Any order, the same each time.
    rings.sort_by_key(|ring| {
        let hash = (ring[0][0] * 7919.0 + ring[0][1]) as u64;
        hash.wrapping_mul(0x9e37_79b9_7f4a_7c15)
    });
    place.write("a.shp", shapefile(&rings));
    for output in ["b.shp", "b.geojson"] {
        place.ok(&["line", "a.shp", output, "--topology", "--tolerance", "1", "-q"]);
        place.ok(&["verify", output, "a.shp", "--topology", "--tolerance", "1"]);
    }
    let polygons = place.ok(&["info", "b.geojson", "--json"]).out;
    assert!(polygons.contains("19600"), "{polygons}");
}
