//! Reports on grids of point clouds: heights in triangles, cells of templates.

use terrane_base::geom::Point;
use terrane_delaunay::Triangulation;

use crate::cli_support::{Place, json};
use crate::cloud_support::{Made, Packing, Random};

/// Whole coordinates near the ends of 32 bits.
const FAR: [i32; 2] = [i32::MAX - 1_100_000, i32::MIN + 70_000];
const SIDE: usize = 1_000_000;

/// Ground points of one class: some of them twice at one place, some a step apart, some on one line.
fn rough_ground() -> Vec<[i32; 3]> {
    let mut random = Random::of(5);
    let mut points: Vec<[i32; 3]> = (0..20_000)
        .map(|_| {
            let [x, y] = [random.below(SIDE) as i32, random.below(SIDE) as i32];
            [FAR[0] + x, FAR[1] + y, (x / 50 + y / 90) % 40_000 + random.below(300) as i32]
        })
        .collect();
    for i in 0..1_000 {
        let [x, y, z] = points[7 * i];
        points.push([x, y, z + if i % 2 == 0 { 3_000 } else { -3_000 }]);
        let [x, y, z] = points[11 * i + 3];
        points.push([x + 1, y, z + 500]);
    }
    points.extend((0..200).map(|i| [FAR[0] + 4_000 * i, FAR[1] + 2_000 * i, 100 * i]));
    points
}

fn las(points: &[[i32; 3]]) -> Vec<u8> {
    let mut made = Made::new(6, Packing::Plain, 0);
    made.records = points
        .iter()
        .map(|point| {
            let mut record = vec![0; 30];
            record[..12].copy_from_slice(point.map(i32::to_le_bytes).as_flattened());
            (record[14], record[16]) = (0x11, 2);
            record
        })
        .collect();
    (made.scale, made.offset) = ([0.001; 3], [0.0; 3]);
    made.bytes()
}

/// The triangles of the lowest point at each place, with the corners' heights.
fn triangles(points: &[[i32; 3]]) -> Vec<[Point; 3]> {
    let mut all: Vec<Point> =
        points.iter().map(|[x, y, z]| Point::new(x - FAR[0], y - FAR[1], *z)).collect();
    all.sort();
    all.dedup_by_key(|point| (point.x, point.y));
    let triangulation = Triangulation::new(&all).unwrap();
    triangulation.triangles().map(|ids| ids.map(|id| all[id as usize])).collect()
}

/// lasR#217: stripes far below the ground where points lie at one place, or nearly.
#[test]
fn b5_cells_lie_between_the_corners_of_their_triangles() {
    let place = Place::new();
    let points = rough_ground();
    place.write("a.las", las(&points));
    let turned: Vec<_> = points.iter().rev().copied().collect();
    let (one, two) = turned.split_at(9_000);
    place.write("b.las", las(two)).write("c.las", las(one));
    let model = ["--cell", "25", "--dtm", "--type", "float64", "--crs", "EPSG:32631"];
    place.ok(&[&["grid", "a.las", "a.asc"], &model[..]].concat());
    place.ok(&[&["grid", "c.las", "b.las", "b.asc"], &model[..]].concat());
    let text = String::from_utf8(place.bytes("a.asc")).unwrap();
    assert!(
        place.bytes("b.asc") == text.as_bytes(),
        "the order of points and files changes nothing"
    );
    let head = |key: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    };
    let values = || text.lines().filter(|line| !line.starts_with(|c: char| c.is_alphabetic()));
    let (rows, west, south) = (head("nrows") as usize, head("xllcorner"), head("yllcorner"));
    let triangles = triangles(&points);
    let (mut inside, mut outside) = (0, 0);
    for (row, line) in values().enumerate() {
        for (col, value) in line.split_whitespace().enumerate() {
            let value: f64 = value.parse().unwrap();
            let x = (west + 25.0 * (col as f64 + 0.5)) * 1000.0 - f64::from(FAR[0]);
            let y = (south + 25.0 * ((rows - row) as f64 - 0.5)) * 1000.0 - f64::from(FAR[1]);
            let side = |a: &Point, b: &Point| {
                let [ax, ay, bx, by] = [a.x, a.y, b.x, b.y].map(f64::from);
                (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            };
            let holds = |[a, b, c]: &&[Point; 3]| {
                side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0
            };
            match triangles.iter().find(holds) {
                None => {
                    assert!(value == -9999.0, "{value} beyond the points");
                    outside += 1;
                }
                Some(corners) => {
                    let heights = corners.map(|corner| f64::from(corner.z) / 1000.0);
                    let [low, high] = [
                        heights[0].min(heights[1]).min(heights[2]),
                        heights[0].max(heights[1]).max(heights[2]),
                    ];
                    assert!(
                        low - 1e-9 <= value && value <= high + 1e-9,
                        "{value} in {low} to {high}"
                    );
                    inside += 1;
                }
            }
        }
    }
    assert!(inside > 1500 && outside > 0, "{inside} {outside}");
}

/// lidR#811, lasR#118: parts that do not fit together where a template says the cells, and a model half a
/// cell off.
#[test]
fn b7_parts_of_a_template_are_its_whole() {
    let place = Place::new();
    let (west, south, cell) = (624_135.0, 5_640_015.0, 30.0);
    let plane = |x: f64, y: f64| (x - west) + 2.0 * (y - south);
    let mut random = Random::of(8);
    for tile in 0..9 {
        let [col, row] = [tile % 3, tile / 3].map(f64::from);
        let line = |i: usize| {
            let near = |i: usize, at: f64, low: f64| low + 300.0 * at + (i as f64) * 10.0;
            let [dx, dy] = [random.below(80) as f64 / 10.0, random.below(80) as f64 / 10.0];
            let [x, y] = [near(i % 30, col, west) + dx, near(i / 30, row, south) + dy];
            format!("{x:.1} {y:.1} {:.1} 2\n", plane(x, y))
        };
        let lines: String = (0..900).map(line).collect();
        place.write(&format!("{tile}.xyz"), format!("x y z class\n{lines}"));
    }
    // 30 x 30 cells whose corners are no multiples of their size.
    let zeros = format!("{}\n", "0 ".repeat(30).trim()).repeat(30);
    let head =
        format!("ncols 30\nnrows 30\nxllcorner {west}\nyllcorner {south}\ncellsize {cell}\n");
    place.write("like.asc", head + &zeros);
    let inputs: Vec<String> = (0..9).map(|tile| format!("cloud:{tile}.xyz")).collect();
    let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
    for model in
        [&["--stat", "tin"][..], &["--dtm"], &["--stat", "mean"], &["--stat", "idw:radius=40"]]
    {
        let grid = |output: &str, cells: &[&str]| {
            let more = [output, "--crs", "EPSG:32631", "--overwrite", "--type", "float64"];
            place.ok(&[&["grid"], &inputs[..], &more[..1], &more[1..], model, cells].concat());
        };
        grid("whole.tif", &["--like", "like.asc"]);
        let align = format!("{west},{south}");
        for part in 0..9 {
            let [x, y] = [part % 3, part / 3].map(|at| f64::from(at) * 300.0);
            let bbox = [west + x, south + y, west + x + 300.0, south + y + 300.0];
            let bbox = bbox.map(|side| side.to_string()).join(",");
            let cells = ["--cell", "30", "--align", &align, "--bbox", &bbox];
            grid(&format!("part-{part}.tif"), &cells);
            let info = json(&place.ok(&["info", &format!("part-{part}.tif"), "--json"]).out);
            assert_eq!((&info["width"], &info["height"]), (&10.into(), &10.into()), "{model:?}");
        }
        let parts: Vec<String> = (0..9).map(|part| format!("part-{part}.tif")).collect();
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        place.ok(&[&["convert"], &parts[..], &["joined.asc", "--overwrite"]].concat());
        place.ok(&["convert", "whole.tif", "whole.asc", "--overwrite"]);
        assert!(place.bytes("joined.asc") == place.bytes("whole.asc"), "{model:?}");
        if !["tin", "--dtm"].iter().any(|name| model.contains(name)) {
            continue;
        }
        let text = String::from_utf8(place.bytes("whole.asc")).unwrap();
        let rows = text.lines().filter(|line| !line.starts_with(|c: char| c.is_alphabetic()));
        let mut compared = 0;
        for (row, line) in rows.enumerate() {
            for (col, value) in line.split_whitespace().enumerate() {
                let value: f64 = value.parse().unwrap();
                let centre = [col as f64 + 0.5, 29.5 - row as f64].map(|at| at * cell);
                let expected = plane(west + centre[0], south + centre[1]);
                if value != -9999.0 {
                    assert!((value - expected).abs() < 0.4, "{value} for {expected} at {centre:?}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 800, "{compared}");
    }
}

/// PDAL#4756: cell centres within 1e-12 of the side of a triangle.
#[test]
fn b_spare_4756_centres_on_sides_have_the_height_of_the_side() {
    let place = Place::new();
    let lattice = |i: i32| {
        let [x, y] = [i % 21, i / 21].map(|at| f64::from(at) * 0.1);
        format!("{x:.1} {y:.1} {:.2} 2\n", x + 10.0 * y)
    };
    let lines: String = (0..441).map(lattice).collect();
    place.write("p.xyz", format!("x y z class\n{lines}"));
    for cell in ["0.1", "0.2", "0.05"] {
        let args = [
            "grid",
            "cloud:p.xyz",
            "o.asc",
            "--cell",
            cell,
            "--stat",
            "tin",
            "--type",
            "float64",
            "--overwrite",
        ];
        place.ok(&args);
        let text = String::from_utf8(place.bytes("o.asc")).unwrap();
        let side: f64 = cell.parse().unwrap();
        let rows: Vec<&str> =
            text.lines().filter(|line| !line.starts_with(|c: char| c.is_alphabetic())).collect();
        let mut compared = 0;
        for (row, line) in rows.iter().enumerate() {
            for (col, value) in line.split_whitespace().enumerate() {
                let [x, y] = [col, rows.len() - 1 - row].map(|at| (at as f64 + 0.5) * side);
                if x < 2.0 && y < 2.0 {
                    let value: f64 = value.parse().unwrap();
                    assert!((value - x - 10.0 * y).abs() < 1e-9, "{value} at {x}, {y} of {cell}");
                    compared += 1;
                }
            }
        }
        assert!(compared >= 100, "{compared}");
    }
}
