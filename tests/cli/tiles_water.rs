//! `terrane tiles --water-mask`: pixels are water where their middle lies in a polygon, the same bytes however they are
//! made, and `verify` notices others.

use std::fs;

use serde_json::Value;

use crate::cli_support::{Place, json};
use crate::tiles::{place as degrees, plain, walk};

/// What may be wrong with masks.
pub(crate) const NAMED: [&str; 2] = [
    "pixels of water masks that are land in a polygon, or water outside",
    "tiles without the water mask that layer.json announces",
];

const MAKE: [&str; 7] =
    ["tiles", "dem.asc", "t", "--water", "lakes.wkt", "--water-mask", "--no-gzip"];
const SIDE: usize = 256;

/// A lake with an island, one that reaches beyond the grid, one that overlaps the first, and one beside the grid.
const LAKES: [&[&[[f64; 2]]]; 4] = [
    &[
        &[
            [7.0312, 46.0243],
            [7.049, 46.0221],
            [7.0533, 46.04],
            [7.0405, 46.0475],
            [7.0311, 46.035],
        ],
        &[[7.039, 46.0301], [7.045, 46.0302], [7.0442, 46.0351]],
    ],
    &[&[[7.06, 46.05], [7.3, 46.051], [7.31, 46.2], [7.0601, 46.19]]],
    &[&[[7.05, 46.03], [7.06, 46.03], [7.06, 46.041]]],
    &[&[[9.0, 46.0], [9.5, 46.0], [9.5, 46.4]]],
];

/// Polygons as WKT, of places that `to` brings elsewhere.
fn wkt(lakes: &[&[&[[f64; 2]]]], to: impl Fn([f64; 2]) -> [f64; 2]) -> String {
    let at = |at: &[f64; 2]| to(*at).map(|part| part.to_string()).join(" ");
    let ring = |ring: &&[[f64; 2]]| {
        let all: Vec<_> = ring.iter().chain(ring.first()).map(at).collect();
        format!("({})", all.join(", "))
    };
    let polygon = |rings: &&[&[[f64; 2]]]| {
        format!("POLYGON ({})", rings.iter().map(ring).collect::<Vec<_>>().join(", "))
    };
    lakes.iter().map(polygon).collect::<Vec<_>>().join("\n")
}

fn place(side: usize) -> Place {
    let place = degrees(side);
    place.write("lakes.wkt", wkt(&LAKES, |at| at)).write("lakes.prj", "EPSG:4326");
    place
}

/// Where the mask of a tile begins and how long it is: the extension after the header, vertices, triangles, sides and
/// normals.
fn mask(bytes: &[u8]) -> Option<[usize; 2]> {
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let mut at = 92 + 6 * number(88);
    at += 4 + 6 * number(at);
    (0..4).for_each(|_| at += 4 + 2 * number(at));
    while at < bytes.len() {
        let length = number(at + 1);
        if bytes[at] == 2 {
            return Some([at + 5, length]);
        }
        at += 5 + length;
    }
    None
}

/// Whether a place is in one of the polygons that meet the grid, by crossings of a ray to the north; none where it is
/// too near to a side.
fn is_water([x, y]: [f64; 2]) -> Option<bool> {
    let mut any = false;
    for lake in &LAKES[..3] {
        let mut is_odd = false;
        for ring in *lake {
            for (a, b) in ring.iter().zip(ring.iter().skip(1).chain(ring.first())) {
                if (a[0] <= x) != (b[0] <= x) {
                    let north = a[1] + (x - a[0]) / (b[0] - a[0]) * (b[1] - a[1]) - y;
                    if north.abs() < 1e-11 {
                        return None;
                    }
                    is_odd ^= north > 0.0;
                }
            }
        }
        any |= is_odd;
    }
    Some(any)
}

#[test]
fn pixels_are_water_where_their_middle_is_in_a_polygon() {
    let place = place(150);
    place.ok(&[&MAKE[..], &["-q"]].concat());
    let layer: Value = serde_json::from_slice(&place.bytes("t/layer.json")).unwrap();
    assert_eq!(
        layer["extensions"],
        serde_json::json!(["octvertexnormals", "watermask", "metadata"])
    );
    let (mut kinds, mut looked) = ([0; 3], 0);
    for name in walk(&place, "t").iter().filter(|name| name.ends_with(".terrain")) {
        let bytes = place.bytes(&format!("t/{name}"));
        let [at, length] = mask(&bytes).unwrap_or_else(|| panic!("{name} has no mask"));
        let pixels = &bytes[at..at + length];
        kinds[match pixels {
            [0] => 0,
            [255] => 1,
            _ => 2,
        }] += 1;
        let id: Vec<f64> = name.split(['/', '.']).take(3).map(|n| n.parse().unwrap()).collect();
        let width = 180.0 / 2_f64.powf(id[0]);
        let [west, north] = [id[1] * width - 180.0, (id[2] + 1.0) * width - 90.0];
        for i in 0..SIDE * SIDE {
            let [col, row] = [i % SIDE, i / SIDE].map(|at| (at as f64 + 0.5) * width / SIDE as f64);
            let Some(expected) = is_water([west + col, north - row]) else { continue };
            let found = if length == 1 { pixels[0] } else { pixels[i] };
            assert_eq!(found, if expected { 255 } else { 0 }, "{name}, pixel {i}");
            looked += 1;
        }
    }
    assert!(kinds.iter().all(|count| *count > 0) && looked > 65_000, "{kinds:?} {looked}");
    let told = json(&place.ok(&["verify", "t", "dem.asc", "--water", "lakes.wkt", "--json"]).out);
    assert_eq!((&told["passed"], &told["judged"]), (&true.into(), &true.into()), "{told}");
    let water = told["checks"].as_array().unwrap().iter().find(|check| check["check"] == "water");
    let looked_at = water.unwrap()["looked_at"].as_str().unwrap();
    assert!(looked_at.contains("pixels,") && looked_at.contains("too near a shore"), "{looked_at}");
}

#[test]
fn the_bytes_are_the_same_however_they_are_made() {
    let place = place(120);
    place.ok(&[&MAKE[..], &["-q", "--threads", "1"]].concat());
    let other = |folder: &'static str, more: &[&'static str]| {
        let args =
            ["tiles", "dem.asc", folder, "--water", "lakes.wkt", "--water-mask", "--no-gzip"];
        place.ok(&[&args[..], &["-q"], more].concat());
        let set = if more.contains(&"3dtiles") {
            format!("{folder}/quantized-mesh")
        } else {
            folder.into()
        };
        assert_eq!(walk(&place, "t"), walk(&place, &set));
        for name in walk(&place, "t") {
            let [a, b] = ["t", &set].map(|set| place.bytes(&format!("{set}/{name}")));
            assert_eq!(a, b, "{set}/{name}");
        }
    };
    other("two", &["--threads", "2", "--memory", "110M"]);
    other("three", &["--workdir", "work"]);
    other("four", &["-f", "quantized-mesh", "-f", "3dtiles"]);
}

#[test]
fn other_pixels_are_noticed() {
    let place = place(100);
    place.ok(&[&MAKE[..], &["-q"]].concat());
    let verify = ["verify", "t", "dem.asc", "--water", "lakes.wkt"];
    let all = walk(&place, "t");
    let is_mixed = |name: &&String| {
        name.starts_with("13/") && mask(&place.bytes(&format!("t/{name}"))).unwrap()[1] > 1
    };
    let name = all.iter().find(is_mixed).expect("a tile with banks");
    let path = place.path("t").join(name);
    let whole = fs::read(&path).unwrap();
    let [at, length] = mask(&whole).unwrap();
    let notices = |changed: &[u8], words: &str| {
        fs::write(&path, changed).unwrap();
        let ran = place.run(&verify);
        assert!(ran.code == 1 && ran.out.contains(words), "{words}: {} {}", ran.out, ran.err);
    };
    let mut turned = whole.clone();
    turned[at..at + length].iter_mut().for_each(|pixel| *pixel = 255 - *pixel);
    notices(&turned, NAMED[0]);
    let mut moved = whole.clone();
    moved[at..at + length].rotate_left(3);
    notices(&moved, "pixels of water masks");
    let mut grey = whole.clone();
    grey[at + length / 2] = 100;
    notices(&grey, "1 pixels of water masks");
    let without = [&whole[..at - 5], &whole[at + length..]].concat();
    notices(&without, NAMED[1]);
    let short =
        [&whole[..at - 4], &2_u32.to_le_bytes(), &[255, 255], &whole[at + length..]].concat();
    fs::write(&path, short).unwrap();
    let ran = place.run(&verify);
    assert!(ran.code == 1 && ran.out.contains("a water mask has 2 bytes"), "{ran:?}");
    fs::write(&path, &whole).unwrap();
    place.ok(&verify);
    // Other polygons are noticed by the pixels alone, where the ground is level all the same.
    let told = place.run(&["verify", "t", "dem.asc"]);
    assert!(told.out.contains("pass --water"), "{} {}", told.out, told.err);
    assert_ne!(told.code, 0);
}

#[test]
fn sides_are_followed_in_any_system() {
    let place = Place::new();
    let rough = |col: usize, row: usize| ((col * 7 + row * 13) % 50) as f64;
    for (system, corner, cell) in [
        ("EPSG:32631", [499_000.0, 4_738_000.0], 30.0),
        ("EPSG:3035", [4_321_000.0, 3_210_000.0], 1000.0),
        ("EPSG:3413", [-1_100_000.0, -1_000_000.0], 500.0),
        ("EPSG:4267", [-100.0, 40.0], 0.001),
    ] {
        plain(&place, [90, 80], [corner[0], corner[1], cell], rough);
        // Of few sides, which bend where they are brought to the globe.
        let lakes: [&[&[[f64; 2]]]; 2] = [
            &[
                &[[5.0, 5.0], [85.0, 9.0], [83.0, 70.0], [2.0, 74.0]],
                &[[30.0, 30.0], [60.0, 31.0], [40.0, 60.0]],
            ],
            &[&[[-40.0, -30.0], [120.0, -30.0], [120.0, 3.0], [-40.0, 3.5]]],
        ];
        let to = |at: [f64; 2]| [0, 1].map(|axis: usize| corner[axis] + at[axis] * cell);
        place.write("lakes.wkt", wkt(&lakes, to)).write("lakes.prj", system).write("g.prj", system);
        let water = ["--water", "lakes.wkt"];
        place
            .ok(&[&["tiles", "g.asc", "t", "--water-mask", "--overwrite", "-q"], &water[..]]
                .concat());
        let told = json(&place.ok(&[&["verify", "t", "g.asc", "--json"], &water[..]].concat()).out);
        assert_eq!(
            (&told["passed"], &told["judged"]),
            (&true.into(), &true.into()),
            "{system}: {told}"
        );
    }
}

#[test]
fn masks_without_water_or_of_other_formats_are_refused() {
    let place = place(20);
    place.fails(&["tiles", "dem.asc", "t", "--water-mask"], 2, &["--water-mask", "add --water"]);
    let three = ["tiles", "dem.asc", "t", "--water-mask", "--water", "lakes.wkt", "-f", "3dtiles"];
    place.fails(&three, 2, &["--format quantized-mesh", "leave --water-mask out"]);
    let far = ["tiles", "dem.asc", "t", "--water-mask", "--water", "far.wkt"];
    place.write("far.wkt", wkt(&LAKES[3..], |at| at)).write("far.prj", "EPSG:4326");
    place.fails(&far, 65, &["far.wkt", "water polygons do not overlap the grid"]);
}
