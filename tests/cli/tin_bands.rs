//! `tin --bands`: a photograph becomes coloured triangles, and every channel keeps the bound.

use crate::cli_support::{Place, Ran, colour, json, photograph};
use crate::tiff_builder::{Spec, Value};
use terrane_mesh as mesh;

const SIZE: [usize; 2] = [97, 61];

/// A folder with the photograph as a TIFF.
fn place() -> Place {
    let place = Place::new();
    let spec = Spec { bands: 3, ..Spec::new(SIZE[0], SIZE[1], 1, 8) };
    place.write("photo.tif", spec.build(|col, row, band| f64::from(colour(col, row)[band])));
    place
}

/// A mesh as it was read back: positions on the grid, heights, channels, triangles.
#[derive(Debug, PartialEq)]
struct Read {
    names: Vec<String>,
    at: Vec<[f64; 2]>,
    z: Vec<f64>,
    channels: Vec<Vec<f64>>,
    triangles: Vec<[u64; 3]>,
}

fn read(place: &Place, name: &str) -> Read {
    let source = mesh::open(&place.path(name)).unwrap();
    let info = source.info();
    let (count, names) = (info.vertices as usize, info.channels.clone());
    let (mut points, mut triangles) =
        (vec![[0.0; 3]; count], vec![[0; 3]; info.triangles as usize]);
    let mut values = vec![0.0; count * names.len()];
    source.read_vertices(0, &mut points).unwrap();
    source.read_triangles(0, &mut triangles).unwrap();
    if !names.is_empty() {
        source.read_channels(0, &mut values).unwrap();
    }
    let channels = values.chunks(names.len().max(1)).map(<[f64]>::to_vec).collect();
    let at = points.iter().map(|p| [p[0], 0.0 - p[1]]).collect();
    Read { names, at, z: points.iter().map(|p| p[2]).collect(), channels, triangles }
}

/// The largest error of each channel, by triangles and pixels one after the other.
fn errors(mesh: &Read, value: impl Fn(usize, usize, usize) -> f64) -> Vec<f64> {
    let mut worst = vec![0.0_f64; mesh.names.len()];
    for ids in &mesh.triangles {
        let [a, b, c] = ids.map(|id| mesh.at[id as usize]);
        let cross = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
            (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        };
        for at in (0..SIZE[0] * SIZE[1]).map(|i| [(i % SIZE[0]) as f64, (i / SIZE[0]) as f64]) {
            let area = cross(a, b, c);
            let weights = [cross(b, c, at), cross(c, a, at), cross(a, b, at)].map(|w| w / area);
            if weights.iter().any(|&weight| weight < 0.0) {
                continue;
            }
            for (channel, worst) in worst.iter_mut().enumerate() {
                let corners = ids.map(|id| mesh.channels[id as usize][channel]);
                let drawn: f64 = weights.iter().zip(corners).map(|(w, z)| w * z).sum();
                *worst = worst.max((drawn - value(at[0] as usize, at[1] as usize, channel)).abs());
            }
        }
    }
    worst
}

fn photo(col: usize, row: usize, band: usize) -> f64 {
    f64::from(colour(col, row)[band])
}

fn told(place: &Place, args: &str) -> Ran {
    place.run(&args.split(' ').collect::<Vec<_>>())
}

fn ok(place: &Place, args: &str) -> serde_json::Value {
    let ran = told(place, &format!("{args} --json"));
    assert_eq!(ran.code, 0, "{args}: {}", ran.err);
    json(&ran.out)
}

#[test]
fn every_channel_keeps_its_share_of_the_bound_and_vertices_have_the_colours_of_pixels() {
    let place = place();
    for (weights, allowed) in [("1,1,1", [9.0, 9.0, 9.0]), ("1,0.5,3", [9.0, 18.0, 3.0])] {
        let job = format!("tin photo.tif o.ply --bands 1,2,3 --weights {weights} --max-error 9");
        let report = ok(&place, &format!("{job} --verify --overwrite"));
        let made = read(&place, "o.ply");
        assert_eq!(made.names, ["red", "green", "blue"]);
        assert!(made.z.iter().all(|z| *z == 0.0), "heights of a photograph");
        for (at, channels) in made.at.iter().zip(&made.channels) {
            let pixel = [0, 1, 2].map(|band| photo(at[0] as usize, at[1] as usize, band));
            assert_eq!(channels[..], pixel);
        }
        let found = errors(&made, photo);
        for (band, (found, allowed)) in found.into_iter().zip(allowed).enumerate() {
            assert!(found <= allowed + 1e-9, "band {}: {found} of {allowed}", band + 1);
            for told in [&report["bands"][band], &report["verify"]["bands"][band]] {
                assert!((told["max_error"].as_f64().unwrap() - found).abs() < 1e-9, "{told}");
                assert_eq!(told["band"], band + 1);
            }
            assert_eq!(report["verify"]["bands"][band]["tolerance"], allowed);
        }
        assert_eq!(report["verify"]["passed"], true);
        assert_eq!(report["verify"]["judged"], true);
        // No error is far below what is allowed: the weights are at work.
        assert!(report["max_error"].as_f64().unwrap() > 8.0, "{report}");
        let info = place.ok(&["info", "o.ply"]).out;
        for part in ["1,2,3", weights, "red, green, blue", "max error       9"] {
            assert!(info.contains(part), "{part} in {info}");
        }
    }
}

#[test]
fn one_band_of_weight_1_has_the_vertices_of_greedy4() {
    let place = place();
    ok(&place, "tin photo.tif a.ply --band 2 --max-error 7 --method greedy4");
    ok(&place, "tin photo.tif b.ply --band 2 --bands 2 --max-error 7 --verify");
    let [a, b] = ["a.ply", "b.ply"].map(|name| read(&place, name));
    assert_eq!((&a.at, &a.z, &a.triangles), (&b.at, &b.z, &b.triangles));
    assert_eq!(b.names, ["band_2"]);
    assert!(b.channels.iter().map(|channels| channels[0]).eq(b.z.iter().copied()));
}

#[test]
fn glb_has_the_same_colours_in_light() {
    let place = place();
    place.write("rgba.png", photograph(SIZE, 4));
    for bands in ["1,2,3", "3,1,2", "1,2,3,4"] {
        let input = if bands.len() > 5 { "rgba.png" } else { "photo.tif" };
        let job = format!("--bands {bands} --max-error 14 --verify --overwrite");
        ok(&place, &format!("tin {input} o.ply {job}"));
        ok(&place, &format!("tin {input} o.glb {job}"));
        let [ply, glb] = ["o.ply", "o.glb"].map(|name| read(&place, name));
        assert_eq!((&ply.names, &ply.channels), (&glb.names, &glb.channels));
        assert_eq!((ply.names.len(), &ply.triangles), (bands.len().div_ceil(2), &glb.triangles));
    }
    let json = String::from_utf8_lossy(&place.bytes("o.glb")).into_owned();
    assert!(json.contains("COLOR_0") && json.contains("VEC4") && json.contains("BLEND"), "{json}");
}

#[test]
fn a_png_has_its_colours_as_bands() {
    let place = place();
    place.write("photo.png", photograph(SIZE, 3));
    place.ok(&["tin", "photo.tif", "a.ply", "--bands", "1,2,3", "--max-error", "12", "-q"]);
    place.ok(&["tin", "photo.png", "b.ply", "--bands", "1,2,3", "--max-error", "12", "-q"]);
    let [a, b] = ["a.ply", "b.ply"].map(|name| read(&place, name));
    assert_eq!((a.channels, a.triangles), (b.channels, b.triangles));
    place.ok(&["verify", "b.ply", "photo.png", "--bands", "1,2,3", "-q"]);
    place.fails(&["tin", "photo.png", "c.ply", "--max-error", "9"], 65, &["--bands 1,2,3"]);
    let four = ["tin", "photo.png", "c.ply", "--max-error", "9", "--bands", "1,4"];
    place.fails(&four, 2, &["band 4 is out of range", "1 to 3"]);
}

#[test]
fn heights_and_voids_of_bands_in_floats() {
    let place = Place::new();
    let nodata = vec![(42_113, Value::Text("-9999".to_owned()))];
    let value = |col: usize, row: usize, band: usize| match (band, (col + 3 * row) % 71) {
        (0, 0) => -9999.0,
        (1, 20) => f64::NAN,
        (0, _) => f64::from(colour(col, row)[0]) / 3.0,
        _ => 0.5 * (col * row % 13) as f64,
    };
    let spec = Spec { bands: 2, extra: nodata, ..Spec::new(SIZE[0], SIZE[1], 3, 32) };
    place.write("two.tif", spec.build(value));
    let job = "--bands 2,1 --weights 2,0.7 --max-error 6 --verify";
    let report = ok(&place, &format!("tin two.tif o.ply {job} --band 1"));
    let made = read(&place, "o.ply");
    assert_eq!(made.names, ["band_2", "band_1"]);
    assert!(made.channels.iter().map(|channels| channels[1]).eq(made.z.iter().copied()));
    let voids = (0..SIZE[0] * SIZE[1])
        .filter(|i| [0, 20].contains(&((i % SIZE[0] + 3 * (i / SIZE[0])) % 71)));
    assert_eq!(report["valid_samples"], SIZE[0] * SIZE[1] - voids.count());
    assert_eq!(report["verify"]["valid_samples"], report["valid_samples"]);
    let [first, second] =
        [0, 1].map(|i| report["verify"]["bands"][i]["max_error"].as_f64().unwrap());
    assert!(first <= 3.0 && second <= 6.0 / 0.7, "{report}");
    // The heights are a promise, too: they are not those of the other band, and not 0.
    let verify = "verify o.ply two.tif --bands 2,1";
    for (more, code) in [("", 0), (" --band 1", 0), (" --band 2", 1)] {
        let ran = told(&place, &format!("{verify}{more} -q"));
        assert_eq!(ran.code, code, "{more}: {}", ran.err);
    }
    let alone = told(&place, "verify o.ply two.tif --band 1");
    assert_eq!(alone.code, 1, "{}", alone.out);
    assert!(alone.out.contains("pass --bands 2,1"), "{}", alone.out);
    place.fails(
        &["tin", "two.tif", "o.glb", "--bands", "1,2", "--max-error", "3"],
        2,
        &["GLB supports only vertex colours", "write PLY"],
    );
}

#[test]
fn without_bands_a_proof_does_not_judge_channels_and_with_them_it_finds_what_is_wrong() {
    let place = place();
    ok(&place, "tin photo.tif o.ply --bands 1,2,3 --max-error 20");
    let verify = |args: &str, code: i32, words: &[&str]| {
        let ran = told(&place, &format!("verify {args}"));
        assert_eq!(ran.code, code, "{args}: {}{}", ran.out, ran.err);
        let text = ran.out + &ran.err;
        assert!(words.iter().all(|word| text.contains(word)), "{words:?} in {text}");
    };
    verify(
        "o.ply photo.tif",
        3,
        &["not judged", "the errors of its channels in bands 1,2,3 (--bands)"],
    );
    verify("o.ply photo.tif --max-error 20", 2, &["no heights", "pass --bands 1,2,3"]);
    verify("o.ply photo.tif --bands 1,2,3", 0, &["verified: every promise is kept", "20 allowed"]);
    verify(
        "o.ply photo.tif --bands 1,2,3 --max-error 5",
        1,
        &["band 1: ", "further from the mesh"],
    );
    verify("o.ply photo.tif --bands 1,2,3 --weights 1,9,1", 1, &["NOT verified\n  - band 2: "]);
    verify("o.ply photo.tif --bands 3,2,1", 2, &["made of bands 1,2,3, not 3,2,1"]);
    // One channel of one vertex, a step off: too little for the bound, and no sample of the band.
    let mut bytes = place.bytes("o.ply");
    let body = bytes.windows(11).position(|end| end == b"end_header\n").unwrap() + 11;
    bytes[body + 5 * 27 + 25] ^= 1;
    place.write("off.ply", &bytes);
    verify("off.ply photo.tif --bands 1,2,3", 1, &["band 2: 1 vertices off the samples"]);
    verify("off.ply photo.tif", 3, &["not judged"]);
    // A height that is none.
    bytes[body + 5 * 27 + 25] ^= 1;
    bytes[body + 5 * 27 + 22] = 0x3f;
    place.write("high.ply", &bytes);
    verify("high.ply photo.tif --bands 1,2,3", 1, &["1 vertices off the samples"]);
    // A mesh that was made of heights has no channels to hold to anything.
    ok(&place, "tin photo.tif plain.ply --max-error 20");
    verify("plain.ply photo.tif --bands 1,2,3", 2, &["no channels at its vertices"]);
}

#[test]
fn a_number_of_vertices_states_an_error_that_is_kept() {
    let place = place();
    for (goal, counted, most) in
        [("--max-vertices", "vertices", 150), ("--max-triangles", "triangles", 201)]
    {
        let job =
            format!("tin photo.tif o.ply --bands 1,2,3 --weights 0.3,0.59,0.11 {goal} {most}");
        let report = ok(&place, &format!("{job} --verify --overwrite"));
        let count = report[counted].as_i64().unwrap();
        assert!(count == most || count == most - 1, "{count}");
        assert_eq!(report["tolerance"], report["max_error"]);
        assert_eq!(report["verify"]["passed"], true);
    }
    let few = ["tin", "photo.tif", "p.ply", "--bands", "1,2,3", "--max-vertices", "3"];
    place.fails(&few, 2, &["4 vertices", "allow 4"]);
}

#[test]
fn pictures_of_such_meshes_have_their_colours() {
    let place = place();
    ok(&place, "tin photo.tif o.ply --bands 1,2,3 --max-error 6");
    place.ok(&["view", "o.ply", "-o", "o.png", "--width", "96", "-q"]);
    let file = std::io::BufReader::new(std::fs::File::open(place.path("o.png")).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!([info.width, info.height], [96, 60]);
    let mut wrong = 0;
    for (i, pixel) in pixels.chunks_exact(4).enumerate() {
        // A pixel of the picture lies between four of the photograph.
        let around = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| colour(i % 96 + x, i / 96 + y));
        for band in 0..3 {
            let low = around.iter().map(|c| c[band]).min().unwrap().saturating_sub(7);
            let high = around.iter().map(|c| c[band]).max().unwrap().saturating_add(7);
            wrong += u32::from(!(low..=high).contains(&pixel[band]));
        }
        assert_eq!(pixel[3], 255);
    }
    // Between four pixels a fold of the mesh may lie beyond all of them.
    assert!(wrong < 20, "{wrong} of {}", 3 * 96 * 60);
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let place = place();
    place.ok(&["synth", "cloud,size=20,density=2", "c.laz", "-q"]);
    let refused = |args: &str, words: &[&str]| {
        place.fails(&args.split(' ').collect::<Vec<_>>(), 2, words);
    };
    let job = "tin photo.tif o.ply --max-error 4 --bands";
    refused(&format!("{job} 1,2,2"), &["band 2 is repeated"]);
    refused(
        &format!("{job} 1,4"),
        &["photo.tif: band 4 is out of range: the file has 3 bands", "from 1 to 3"],
    );
    refused(&format!("{job} 0,1"), &["--bands", "a whole number from 1"]);
    refused(&format!("{job} 1,2 --weights 1"), &["1 weights for 2 bands"]);
    for weight in ["0", "-1", "nan", "inf", "x"] {
        refused(&format!("{job} 1,2 --weights=1,{weight}"), &["--weights", "above zero"]);
    }
    refused("tin photo.tif o.ply --max-error 4 --weights 1", &["--bands"]);
    refused(&format!("{job} 1,2 --band 3"), &["--band 3", "not among --bands 1,2"]);
    for option in [
        "--method greedy4",
        "--triangulation split3",
        "--fit-heights",
        "--strict",
        "--no-drop",
        "--tile 64",
        "--bound surface",
        "--min-angle 20",
        "--keep-points p.wkt",
        "--breaklines p.wkt",
        "--workdir w",
        "--split 2",
    ] {
        let name = option.split(' ').next().unwrap();
        refused(&format!("{job} 1,2 {option}"), &["--bands cannot be used with", name]);
    }
    for format in ["stl", "obj"] {
        let name = format.to_uppercase();
        let job = format!("tin photo.tif o.{format} --max-error 4 --bands 1,2,3");
        refused(&job, &[&name, "does not support --bands", "write PLY, or GLB"]);
    }
    refused(
        "tin photo.tif o.glb --max-error 4 --bands 1,2",
        &["GLB supports only vertex colours", "write PLY"],
    );
    refused("tin c.laz o.ply --max-error 4 --bands 1", &["--bands is for grids"]);
    refused("tin synth:rough,size=9 o.ply --max-error 4 --bands 1,2", &["the file has 1 band"]);
    refused("plan tin photo.tif -o w --max-error 4 --bands 1,2", &["--bands"]);
    place.ok(&["tin", "photo.tif", "m.ply", "--bands", "1,2,3", "--max-error", "9", "-q"]);
    for option in ["--bound surface", "--keep-points p.wkt", "--breaklines p.wkt"] {
        let name = option.trim_end_matches(" p.wkt");
        let job = format!("verify m.ply photo.tif --bands 1,2,3 {option}");
        refused(&job, &["--bands cannot be used with", name]);
    }
    refused("verify m.ply c.laz --bands 1,2,3", &["--bands is for meshes of grids"]);
    refused("verify m.ply photo.tif --bands 1,2", &["made of bands 1,2,3, not 1,2"]);
    let small =
        ["tin", "photo.tif", "o.ply", "--bands", "1,2,3", "--max-error", "4", "--memory", "15M"];
    place.fails(&small, 75, &["97 x 61", "3 bands", "--memory", "at most "]);
}
