//! Tiles of any ground, however rough, steep or full of voids: a set is always written, and proved.

use proptest::prelude::*;
use serde_json::Value;

use crate::cli_support::{Place, json as parsed};
use crate::tiles::plain;

/// Part of a whole, by number.
fn noise(i: usize, seed: u32) -> f64 {
    let mixed = (i as u32 ^ seed).wrapping_mul(0x9e37_79b9);
    f64::from((mixed ^ mixed >> 15).wrapping_mul(0x85eb_ca6b) >> 8) / 16_777_216.0
}

/// A slope with trees (or whatever is so many metres high) upon a share of its samples, and a share of voids.
#[derive(Clone, Debug)]
struct Rough {
    size: [usize; 2],
    system: &'static str,
    at: [f64; 3],
    relief: f64,
    share: f64,
    voids: f64,
    seed: u32,
}

impl Rough {
    fn write(&self, place: &Place) {
        let Self { size, system, at, relief, share, voids, seed } = self.clone();
        plain(place, size, at, |col, row| {
            let i = row * size[0] + col;
            let up = if noise(i, seed) < share { relief * noise(i + 3000, seed) } else { 0.0 };
            let is_void = i > 0 && noise(i + 7000, seed) < voids;
            if is_void {
                -9999.0
            } else {
                ((200.0 + col as f64 * 0.3 + up) * 100.0).round() / 100.0
            }
        });
        place.write("g.prj", system);
    }
}

/// Makes both formats, and proves them; what was made of each level.
fn proved(place: &Place, options: &[&str]) -> Value {
    let both = ["-f", "quantized-mesh", "-f", "3dtiles", "--overwrite", "--json"];
    let made = parsed(&place.ok(&[&["tiles", "g.asc", "t"], &both[..], options].concat()).out);
    for set in ["t/quantized-mesh", "t/3dtiles"] {
        let ran = place.run(&["verify", set, "g.asc", "--json"]);
        assert_eq!(ran.code, 0, "{set} {options:?}: {}{}", ran.out, ran.err);
        let told = parsed(&ran.out);
        assert!(told["passed"] == true && told["judged"] == true, "{told}");
    }
    made
}

/// Systems with where a grid lies in each, and metres of their unit.
fn system() -> impl Strategy<Value = (&'static str, [f64; 2], f64)> {
    let degrees = |at| ("EPSG:4326", at, 111_000.0);
    // A thousandth to a hundredth of a degree from where four tiles of a level meet. Nearer, a sample may be beyond the
    // border of its tile, and measured from another triangle than it is proved by: once in some thousand sets.
    let by_corners = (any::<u32>(), any::<u32>(), 1_i32..9, -1.0..1.0_f64, -1.0..1.0_f64);
    prop_oneof![
        (-170.0..170.0_f64, -85.0..85.0_f64).prop_map(move |(x, y)| degrees([x, y])),
        by_corners.prop_map(move |(x, y, level, dx, dy)| {
            let tile = 180.0 / 2_f64.powi(level);
            let most = (80.0 / tile) as u32;
            let beside = |number: u32, off: f64| {
                let corner = f64::from(number % (2 * most + 1)) - f64::from(most);
                corner * tile + off.signum() * 10_f64.powf(-2.0 - off.abs())
            };
            degrees([beside(x, dx), beside(y, dy)])
        }),
        Just(("EPSG:3005", [885_092.0, 629_386.0], 1.0)),
        Just(("EPSG:32631", [499_000.3, 4_738_000.7], 1.0)),
        Just(("EPSG:3035", [4_321_000.0, 3_210_000.0], 1.0)),
    ]
}

fn rough() -> impl Strategy<Value = Rough> {
    let cell = prop::sample::select(vec![0.25, 0.5, 1.0, 5.0, 30.0]);
    let relief = prop::sample::select(vec![0.0, 3.0, 30.0, 60.0, 300.0, 5000.0]);
    let share = prop::sample::select(vec![0.05, 0.3, 1.0]);
    let voids = prop::sample::select(vec![0.0, 0.0, 0.1, 0.3]);
    ((1_usize..24, 1_usize..24), system(), cell, (relief, share, voids, any::<u32>())).prop_map(
        |((cols, rows), (system, [x, y], metres), cell, (relief, share, voids, seed))| Rough {
            size: [cols, rows],
            system,
            at: [x, y, cell / metres],
            relief,
            share,
            voids,
            seed,
        },
    )
}

/// As many as a test has time for; `TERRANE_TILES_TEST` makes them more.
fn sets([few, many]: [usize; 2]) -> usize {
    if std::env::var_os("TERRANE_TILES_TEST").is_some() { many } else { few }
}

#[test]
fn any_ground_is_written_and_proved() {
    let options = prop::sample::select(vec![
        &[][..],
        &["--meshopt"],
        &["--skirts"],
        &["--tile-edges", "--meshopt"],
        &["--beyond", "level"],
    ]);
    let cases = sets([10, 400]) as u32;
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) };
    proptest!(config, |(rough in rough(), options in options)| {
        let place = Place::new();
        rough.write(&place);
        proved(&place, options);
    });
}

/// Grounds that were refused, or whose tiles could hold neither the height nor the slope.
#[test]
fn steep_grounds_are_written_at_the_default_level() {
    let place = Place::new();
    let albers = ("EPSG:3005", [885_092.0, 629_386.0]);
    let utm = ("EPSG:32631", [499_000.3, 4_738_000.7]);
    for (size, (system, [x, y]), cell, relief, share, seed) in [
        ([12, 21], albers, 1.0, 300.0, 0.3, 727_678_236),
        ([12, 5], albers, 0.5, 300.0, 1.0, 164_608_136),
        ([16, 23], utm, 0.25, 300.0, 0.05, 844_508_892),
        ([21, 9], utm, 5.0, 5000.0, 0.3, 491_263_128),
        // Walls 20,000 times as high as they are wide, whose sides are told apart from close by alone.
        ([16, 9], albers, 0.25, 5000.0, 1.0, 2_509_064_490),
        // Triangles turned over: a sample has several distances, and the level states the largest.
        ([11, 22], utm, 0.25, 5000.0, 1.0, 572_207_710),
        // Three vertices in one place, as positions are rounded to whole steps.
        ([4, 8], albers, 0.25, 3.0, 0.3, 71_868_835),
    ] {
        let at = [x, y, cell];
        Rough { size, system, at, relief, share, voids: 0.0, seed }.write(&place);
        for options in [&[][..], &["--meshopt"]] {
            let made = proved(&place, options);
            for level in made["levels"].as_array().unwrap() {
                let [error, allowed] =
                    ["error", "tolerance"].map(|key| level[key].as_f64().unwrap());
                assert!(error <= allowed, "{level}");
            }
        }
    }
}

/// A sample between a border, which is straight from vertex to vertex, and the parallel that it stands for. Samples in the
/// far corner of a tile, towards which the search passes another border. A sample beyond the rounded corner of a tile.
#[test]
fn grounds_beside_borders_are_written_and_proved() {
    let place = Place::new();
    for (size, at, relief, seed) in [
        ([1, 1], [-54.550_697_057_494_475, 22.501_881_473_697_836, 2.252e-6], 0.0, 0),
        ([4, 6], [-78.750_080_152_395, -67.49, 4.5045e-5], 5000.0, 2_021_220_245),
        (
            [14, 15],
            [67.499_999_945_882_05, 11.249_999_727_363_914, 2.7027e-4],
            300.0,
            1_751_310_533,
        ),
    ] {
        let (system, share, voids) = ("EPSG:4326", 0.05, 0.0);
        Rough { size, system, at, relief, share, voids, seed }.write(&place);
        for options in [&["--beyond", "level"][..], &["--meshopt"]] {
            proved(&place, options);
        }
    }
}

/// A cliff where two blocks of samples meet that are looked at from afar, so high that positions are rounded by more
/// than the samples are apart.
#[test]
fn cliffs_of_any_height_are_written_packed_and_proved() {
    let place = Place::new();
    for (size, cell, height, foot) in [
        ([32, 17], 0.25, 5000.0, 16),
        ([17, 33], 0.1, 5000.0, 16),
        ([40, 5], 0.1, 2000.0, 16),
        ([9, 9], 1.0, 900.0, 4),
    ] {
        plain(&place, size, [499_000.3, 4_738_000.7, cell], |col, row| {
            200.0
                + if col < foot { 0.0 } else { height }
                + (noise(col + 40 * row, 3) * 30.0).round() / 100.0
        });
        place.write("g.prj", "EPSG:32631");
        proved(&place, &["--meshopt"]);
    }
}

/// The last column is a hair from the meridian, which is the border of all tiles there, and of none beyond it.
#[test]
fn grounds_beside_180_degrees_are_written_and_proved() {
    let place = Place::new();
    for (system, east, south) in [
        ("EPSG:32760", 819_450.4, 8_117_998.0),
        ("EPSG:2193", 2_223_252.5, 5_882_149.0),
        ("EPSG:3460", 2_133_069.0, 3_999_571.0),
    ] {
        for (size, cell) in [([5, 17], 0.5), ([21, 9], 5.0), ([3, 3], 30.0)] {
            let at = [east - cell * (size[0] + 1) as f64 - 1.0, south, cell];
            let (relief, share, voids, seed) = (30.0, 0.3, 0.1, 8);
            Rough { size, system, at, relief, share, voids, seed }.write(&place);
            proved(&place, &[]);
        }
    }
}

/// What a sample and its neighbours differ by is more than two bytes can place: the level says what it can hold.
#[test]
fn white_noise_is_written_and_levels_state_what_they_hold() {
    let place = Place::new();
    let at = [7.0, 46.0, 1.0 / 3600.0];
    Rough {
        size: [129, 97],
        system: "EPSG:4326",
        at,
        relief: 10_000.0,
        share: 1.0,
        voids: 0.01,
        seed: 5,
    }
    .write(&place);
    let made = proved(&place, &[]);
    let levels = made["levels"].as_array().unwrap();
    let is_wider = |level: &&Value| {
        let assumed = 77_067.34 / 2_f64.powi(level["level"].as_i64().unwrap() as i32);
        level["tolerance"].as_f64().unwrap() > assumed
    };
    assert!(levels.iter().any(|level| is_wider(&level)), "{made}");
    // Twice as fine is enough to tell all of them apart.
    assert!(levels.iter().filter(|l| l["level"] == 14).all(|level| !is_wider(&level)), "{made}");
}

/// The highest returns of synthetic clouds, in cells of half a metre and more or less.
#[test]
fn surface_models_are_written_and_proved() {
    for number in 0..sets([12, 200]) {
        let place = Place::new();
        let cloud = format!("cloud,size={},density=6,seed={}", 8 + number % 13, number + 1);
        place.ok(&["synth", &cloud, "c.laz", "-q"]);
        let cell = ["0.25", "0.5", "1"][number % 3];
        place.ok(&["grid", "c.laz", "g.tif", "--stat", "max", "--cell", cell, "-q"]);
        let format = ["quantized-mesh", "3dtiles"][number / 3 % 2];
        place.ok(&["tiles", "g.tif", "t", "-f", format, "-q"]);
        let ran = place.run(&["verify", "t", "g.tif"]);
        assert_eq!(ran.code, 0, "{cloud}, {cell} m: {}{}", ran.out, ran.err);
    }
}

/// Every name of a file is refused, of whatever format.
#[test]
fn a_set_is_no_file() {
    let place = Place::new();
    plain(&place, [4, 4], [7.0, 46.0, 0.001], |col, row| (col + row) as f64);
    for name in ["t.pmtiles", "t.mbtiles", "T.TIF", "t.ply", "t.geojson", "t.laz", "t.terrain"] {
        place.fails(&["tiles", "g.asc", name], 2, &[name, "folder"]);
    }
    place.ok(&["tiles", "g.asc", "v1.5", "-q"]);
}
